"""Asking the surrogate about one design."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.errors import InputError
from surrogate.model import Surrogate


@dataclass(frozen=True)
class Answer:
    """Expected shift time with its 95 % interval, s, and what speaks against trusting it.

    ``warnings`` is empty exactly when the design lies in the trained range.
    """

    time: float
    low: float
    high: float
    warnings: tuple[str, ...]

    @property
    def in_range(self) -> bool:
        """Whether every variable lies within the simulated designs."""
        return not self.warnings


def ask(surrogate: Surrogate, design: dict[str, float], physics: str) -> Answer:
    """Predict the expected shift time of ``design`` (edge units).

    ``physics`` is the hash of the study that asks; another than the data's
    raises InputError, because the times would be of something else.
    """
    data = surrogate.data
    if physics != data.physics:
        raise InputError(
            f"the surrogate was fitted to other physics (hash {data.physics}) than this study "
            f"has ({physics}), so its times do not apply; fit it again with 'dogshape fit'"
        )
    x = np.array([design[name] for name in data.variables], dtype=float)
    prediction = surrogate.predict(x)
    low, high = data.x.min(axis=0), data.x.max(axis=0)
    outside = tuple(
        f"{name} = {value:.4g} is outside the simulated designs ({a:.4g} to {b:.4g})"
        for name, value, a, b in zip(data.variables, x, low, high, strict=True)
        if not a - 1e-3 * (b - a) <= value <= b + 1e-3 * (b - a)
    )
    return Answer(
        time=float(prediction.time[0]),
        low=float(prediction.low[0]),
        high=float(prediction.high[0]),
        warnings=outside,
    )


def half_difference(
    surrogate: Surrogate, design: dict[str, float], variable: str, step: float
) -> float:
    """Return half of the predicted time's change from ``step`` below to above, s.

    ``design`` and ``step`` are in edge units; the other variables stay.
    """
    names = surrogate.data.variables
    x = np.array([[design[name] for name in names]] * 2, dtype=float)
    x[:, names.index(variable)] += [-step, step]
    below, above = surrogate.predict(x).time
    return float(0.5 * (above - below))
