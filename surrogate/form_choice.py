r"""Choice of the form of the surrogate: the likelihood of designs left out decides.

Each form is fitted to one half of the designs and predicts the other half, and vice versa. The
score of a form is the mean log density of the results under its predictions, the noise of the rows
included (Rasmussen and Williams 2006, ch. 5.4). The score punishes intervals that are too narrow or
too wide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dogshape.surrogate.covariance import Array, Mask
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.fitting import Effort, fit_process
from dogshape.surrogate.model import ALTERNATIVES
from dogshape.surrogate.process_targets import time_targets

EFFORT = Effort(rows=450, steps=40)


@dataclass(frozen=True)
class Score:
    """Figures of a form on single rows of designs that it did not see.

    ``log_density`` is the mean logarithm of the predictive density of ln t, ``log_rmse`` the
    root-mean-square error of ln t, ``coverage_95`` the share within the 95 % interval.
    """

    form: str
    log_density: float
    log_rmse: float
    coverage_95: float

    def as_dict(self) -> dict[str, Any]:
        """Return the figures by name."""
        return asdict(self)


def compare(
    data: Dataset, seed: int = 0, say: Callable[[str], None] = lambda _: None
) -> list[Score]:
    """Score all alternatives, the best first."""
    halves = np.random.default_rng(seed).permutation(len(data.designs)) % 2 == 0
    first = halves[data.design_of_row]
    scores = []
    for form in ALTERNATIVES:
        score = _score(form, _left_out(data, form, first))
        say(f"{form}: mean log density {score.log_density:.3f}")
        scores.append(score)
    return sorted(scores, key=lambda score: -score.log_density)


def _left_out(data: Dataset, form: str, first: Mask) -> tuple[Array, Array]:
    """Compute errors of ln t and their predicted standard deviations for all rows, each (n,)."""
    errors, deviations = [], []
    for seen in (first, ~first):
        made = ALTERNATIVES[form]
        known = time_targets(data.subset(seen), made.ridge)
        inputs, targets, noise = time_targets(data.subset(~seen), made.ridge)
        process = fit_process(made.terms, known[0].shape[1] - 2, known, effort=EFFORT)
        mean, variance = process.predict(inputs)
        errors.append(targets - mean)
        deviations.append(np.sqrt(variance + noise))
    return np.concatenate(errors), np.concatenate(deviations)


def _score(form: str, found: tuple[Array, Array]) -> Score:
    error, deviation = found
    density = -0.5 * np.log(2.0 * np.pi * deviation**2) - 0.5 * (error / deviation) ** 2
    return Score(
        form,
        float(density.mean()),
        float(np.sqrt((error**2).mean())),
        float((np.abs(error) <= 1.96 * deviation).mean()),
    )
