r"""Predictions of the surrogate for one design.

Below the friction angle, :math:`\tan\alpha < \mu_s`, faces hold dog on dog. Where no simulated
design has so small a chamfer, there is no estimate.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.errors import InputError
from dogshape.sim.interface import verb
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.statistics.expectation import MIN_ENGAGED_SHARE
from dogshape.sim.statistics.shift_records import Record, content_key, quantity_of
from dogshape.surrogate.dataset import Dataset, Mix
from dogshape.surrogate.model import Expected, Surrogate

CHAMFERS = ("chamfer_deg", "chamfer_back_deg")
HOLDS = "faces hold: no estimate"  #: reason of a missing time
SOLVER_KEYS = ("engine", "accuracy")  #: in which the engines differ
MAX_DISTANCE = 3.0  #: to a simulated design in median spacings; beyond, an answer extrapolates
RANGE_MARGIN = 0.01  #: beyond a simulated range, of its width
MAX_DIFFERENCES = 3  #: that a message lists
TIME_KEYS = (
    *("expected_shift_time_s", "low_s", "high_s", "standard_error_s", "sd_s", "engaged"),
    *("retries_s", "retries_error_s", "without_retries_s", "without_retries_error_s"),
)


@dataclass(frozen=True)
class Answer:
    """Expected shift time of a design with warnings."""

    expected: Expected | None
    distance: float  #: to the nearest simulated design, in median spacings
    warnings: tuple[str, ...]
    refusal: str = ""  #: why there is no time

    @property
    def in_range(self) -> bool:
        """Whether design and operating points lie within the simulated ones."""
        return not self.warnings


def compare_physics(data: Dataset, physics: Record) -> str:
    """Describe differences between the physics of a study and of the data, empty if equal.

    The engines agree, so ``SOLVER_KEYS`` may differ with the engine.
    """
    ignored = SOLVER_KEYS if physics.get("engine") != data.physics.get("engine") else ()
    differences = []
    for key in {**physics, **data.physics}:
        if key in ignored:
            continue
        if content_key({"v": physics.get(key)}) != content_key({"v": data.physics.get(key)}):
            study_value = physics.get(key, "absent")
            data_value = data.physics.get(key, "absent")
            differences.append(f"{key} is {study_value} here and {data_value} there")
    text = ", ".join(differences[:MAX_DIFFERENCES])
    if len(differences) > MAX_DIFFERENCES:
        text += f", and {len(differences) - MAX_DIFFERENCES} more"
    return text


def require_same_physics(data: Dataset, physics: Record) -> None:
    """Raise InputError where a study's physics differ from the data's."""
    differences = compare_physics(data, physics)
    if differences:
        raise InputError(
            f"the surrogate was fitted to other physics than the study's: {differences}; fit one "
            f"for this study with {verb('fit')}"
        )


def ask(surrogate: Surrogate, design: dict[str, float], mix: Mix, physics: Record) -> Answer:
    """Predict the expected shift time of ``design`` (edge units) over a mix.

    InputError where ``physics``, that of the study, differs from the data's.
    """
    data = surrogate.data
    require_same_physics(data, physics)
    x = np.array([quantity_of(design, name) for name in data.variables])
    distance = float(surrogate.distance(x[None, :])[0])
    warnings = [*_design_warnings(data, x), *_point_warnings(data, mix.points)]
    if faces_hold(data, x[None, :])[0]:
        chamfer = f"chamfer {x[_chamfer_columns(data)].min():.4g} deg"
        friction = np.degrees(np.arctan(_face_friction(data)))
        reason = f"{chamfer}, below the friction angle {friction:.3g} deg"
        refusal = f"{HOLDS} ({reason}; {verb('expect')} simulates it)"
        if not warnings:
            warnings.append(f"{chamfer}: faces hold by friction")
        return Answer(None, distance, tuple(warnings), refusal)
    if distance > MAX_DISTANCE and not warnings:
        warnings.append(f"the nearest simulated design is {distance:.1f} median spacings away")
    expected = surrogate.expect(x, mix)
    if expected.engaged < MIN_ENGAGED_SHARE:
        refusal = f"about {100 * expected.engaged:.0f} % engage at the worst point: no time"
        return Answer(None, distance, tuple(warnings), refusal)
    return Answer(expected, distance, tuple(warnings))


def time_record(expected: Expected | None, refusal: str) -> dict[str, Any]:
    """Return an expected time and its terms, s, by ``TIME_KEYS``, or a reason without a time."""
    if expected is None:
        return {**dict.fromkeys(TIME_KEYS), "reason": refusal}
    values = (*astuple(expected), *expected.without_retries)
    return {**dict(zip(TIME_KEYS, values, strict=True)), "reason": None}


def faces_hold(data: Dataset, x: Array) -> Mask:
    """Mark designs (m, d) whose faces hold by friction below any simulated chamfer, (m,)."""
    columns = _chamfer_columns(data)
    chamfer = x[:, columns]
    smallest = data.grid.x[:, columns].min(axis=0)
    slides = np.tan(np.radians(chamfer)) > _face_friction(data)
    return np.asarray((~slides & (chamfer < smallest)).any(axis=1))


def _face_friction(data: Dataset) -> float:
    """Return the static friction of faces on faces, which the data were simulated with."""
    key = "face_friction" if "face_friction" in data.physics else "static_friction"
    return float(data.physics[key])


def _chamfer_columns(data: Dataset) -> list[int]:
    names = [name.removeprefix(OUTPUT_PREFIX) for name in data.variables]
    return [k for k, name in enumerate(names) if name in CHAMFERS]


def _design_warnings(data: Dataset, x: Array) -> list[str]:
    low = data.grid.x.min(axis=0)
    high = data.grid.x.max(axis=0)
    inside = _mark_within(x, low, high)
    return [
        f"{name} = {x[k]:.4g} is outside the simulated designs ({low[k]:.4g} to {high[k]:.4g})"
        for k, name in enumerate(data.variables)
        if not inside[k]
    ]


def _point_warnings(data: Dataset, points: Array) -> list[str]:
    warnings = []
    for column, (name, unit) in enumerate((("mismatch", "1/min"), ("shift force", "N"))):
        low = float(data.mix.points[:, column].min())
        high = float(data.mix.points[:, column].max())
        extremes = dict.fromkeys([points[:, column].min(), points[:, column].max()])
        warnings += [
            f"{name} {value:.4g} {unit} is outside what was simulated ({low:.4g} to {high:.4g})"
            for value in extremes
            if not _mark_within(value, low, high)
        ]
    return warnings


def _mark_within(values: Array | float, low: Array | float, high: Array | float) -> Mask:
    """Mark values in their range widened by ``RANGE_MARGIN``, same shape."""
    margin = RANGE_MARGIN * (high - low)
    return np.asarray((values >= low - margin) & (values <= high + margin), dtype=bool)


def in_range(
    surrogate: Surrogate, x: Array, mix: Mix | None = None, distance: Array | None = None
) -> Mask:
    """Mark designs (m, d) that lie in the simulated ranges and near a simulated design, (m,).

    No design is in range for a mix beyond the simulated points. ``distance`` is that of
    ``Surrogate.distance``, (m,), to save its computation.
    """
    data = surrogate.data
    if mix is not None and _point_warnings(data, mix.points):
        return np.zeros(len(x), dtype=bool)
    inside = _mark_within(x, data.grid.x.min(axis=0), data.grid.x.max(axis=0))
    if distance is None:
        distance = surrogate.distance(x)
    return inside.all(axis=1) & (distance <= MAX_DISTANCE) & ~faces_hold(data, x)
