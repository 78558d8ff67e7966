r"""Predictions of the surrogate for one design.

Below the friction angle, :math:`\tan\alpha < \mu_s`, faces hold dog on dog. Where no simulated
design has so small a chamfer nothing is known of that, and there is no estimate.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.expectation import LEAST_ENGAGED
from dogshape.sim.statistics.shift_records import Record, content_key
from dogshape.surrogate.dataset import Dataset, Mix
from dogshape.surrogate.model import Expected, Surrogate

CHAMFERS = ("chamfer_deg", "chamfer_back_deg")
HOLDS = "faces hold: no estimate"  #: reason of a missing time
SOLVER = ("engine", "accuracy")  #: keys in which the engines differ
FAR = 3.0  #: times the median spacing of simulated designs, beyond which an answer extrapolates


@dataclass(frozen=True)
class Answer:
    """Expected shift time of a design with warnings."""

    expected: Expected | None
    distance: float  #: to the nearest simulated design, in median spacings of these
    warnings: tuple[str, ...]
    refusal: str = ""  #: why there is no time

    @property
    def in_range(self) -> bool:
        """Test that design and operating points lie within the simulated ones."""
        return not self.warnings


def other_physics(data: Dataset, physics: Record) -> str:
    """List three keys in which the physics of study and data differ; engines agree."""
    left = SOLVER if physics.get("engine") != data.physics.get("engine") else ()
    mine, theirs = ({k: v for k, v in r.items() if k not in left} for r in (physics, data.physics))
    parts = [
        f"{k} is {mine.get(k, 'absent')} here and {theirs.get(k, 'absent')} there"
        for k in {**mine, **theirs}
        if content_key({"v": mine.get(k)}) != content_key({"v": theirs.get(k)})
    ]
    return ", ".join(parts[:3]) + (f", and {len(parts) - 3} more" if len(parts) > 3 else "")


def require_same_physics(data: Dataset, physics: Record) -> None:
    """Raise InputError where the data are of other physics: their times would not apply."""
    if apart := other_physics(data, physics):
        raise InputError(
            f"the surrogate was fitted to other physics than the study's: {apart}; fit one for "
            "this study with 'dogshape fit'"
        )


def ask(surrogate: Surrogate, design: dict[str, float], mix: Mix, physics: Record) -> Answer:
    """Predict the expected shift time of ``design`` (edge units) over a mix.

    ``physics`` is that of the study that asks; another than the data's raises InputError.
    """
    data = surrogate.data
    require_same_physics(data, physics)
    x = np.array([design[name] for name in data.variables], dtype=float)
    distance = float(surrogate.distance(x[None, :])[0])
    low, high = data.grid.x.min(axis=0), data.grid.x.max(axis=0)
    warnings = [
        f"{name} = {x[k]:.4g} is outside the simulated designs ({low[k]:.4g} to {high[k]:.4g})"
        for k, name in enumerate(data.variables)
        if not _within(x, low, high)[k]
    ]
    warnings += _point_warnings(data, mix.points)
    if faces_hold(data, x[None, :])[0]:
        chamfer = f"chamfer {x[_chamfers(data)].min():.4g} deg"
        friction = np.degrees(np.arctan(_face_friction(data)))
        why = f"{chamfer}, below the friction angle {friction:.3g} deg"
        refusal = f"{HOLDS} ({why}; 'dogshape expect' simulates it)"
        held = warnings or [f"{chamfer}: faces hold by friction"]
        return Answer(None, distance, tuple(held), refusal)
    if distance > FAR and not warnings:
        warnings.append(f"the nearest simulated design is {distance:.1f} median spacings away")
    expected = surrogate.expected(x, mix)
    if expected.engaged < LEAST_ENGAGED:
        few = f"about {100 * expected.engaged:.0f} % engage at the worst point: no time"
        return Answer(None, distance, tuple(warnings), few)
    return Answer(expected, distance, tuple(warnings))


def time_record(found: Expected | None, refusal: str) -> dict[str, Any]:
    """Give an expected time with its parts, s; None with a reason where there is none."""
    keys = ("expected_shift_time_s", "low_s", "high_s", "standard_error_s", "sd_s", "engaged",
            "retries_s", "retries_error_s", "without_retries_s",
            "without_retries_error_s")  # fmt: skip
    if found is None:
        return {**dict.fromkeys(keys), "reason": refusal}
    values = (*astuple(found), *found.without_retries)
    return {**dict(zip(keys, values, strict=True)), "reason": None}


def faces_hold(data: Dataset, x: Array) -> Mask:
    """Mark designs (m, d) whose faces hold by friction, as no simulated design's do, (m,)."""
    columns = _chamfers(data)
    chamfer, least = x[:, columns], data.grid.x[:, columns].min(axis=0)
    slides = np.tan(np.radians(chamfer)) > _face_friction(data)
    return np.asarray((~slides & (chamfer < least)).any(axis=1))


def _face_friction(data: Dataset) -> float:
    """Return the static friction of faces on faces, which the data were simulated with."""
    key = "face_friction" if "face_friction" in data.physics else "static_friction"
    return float(data.physics[key])


def _chamfers(data: Dataset) -> list[int]:
    return [k for k, name in enumerate(data.variables) if name in CHAMFERS]


def _point_warnings(data: Dataset, points: Array) -> list[str]:
    found: list[str] = []
    for column, (name, unit) in enumerate((("mismatch", "1/min"), ("shift force", "N"))):
        known, asked = data.mix.points[:, column], points[:, column]
        low, high = float(known.min()), float(known.max())
        found += [
            f"{name} {value:.4g} {unit} is outside what was simulated ({low:.4g} to {high:.4g})"
            for value in dict.fromkeys([asked.min(), asked.max()])
            if not _within(value, low, high)
        ]
    return found


def _within(values: Array | float, low: Array | float, high: Array | float) -> Mask:
    """Mark values in their range or a hundredth of it beside, of their shape."""
    slack = 0.01 * (high - low)
    return np.asarray((values >= low - slack) & (values <= high + slack), dtype=bool)


def in_range(
    surrogate: Surrogate, x: Array, mix: Mix | None = None, distance: Array | None = None
) -> Mask:
    """Mark the designs (m, d) that lie within the simulated ones and near one, (m,) of bool.

    None do over a mix beyond the simulated points. ``distance`` is ``Surrogate.distance``.
    """
    data = surrogate.data
    if mix is not None and _point_warnings(data, mix.points):
        return np.zeros(len(x), dtype=bool)
    inside = _within(x, data.grid.x.min(axis=0), data.grid.x.max(axis=0))
    apart = surrogate.distance(x) if distance is None else distance
    return inside.all(axis=1) & (apart <= FAR) & ~faces_hold(data, x)
