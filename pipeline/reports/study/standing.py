"""Standing of designs: time, worst operating point, margins, friction that locks, length.

Of each design alike: from the confirmation where it was confirmed, else from the search.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.study.paired import (
    Difference,
    Place,
    overall,
    paired_points,
    point_differences,
)
from dogshape.pipeline.reports.study.single_shifts import Shifts, place
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.units import MM, RPM

SHOWN = 3  #: least margins that are named


@dataclass(frozen=True)
class Standing:
    """Facts that are known of one design.

    Parameters
    ----------
    row : of ``result.json``.
    time : expected shift time and its standard error, s; None where it was not simulated.
    points : operating points of the confirmation; empty where it was not confirmed.
    margins : margins of all checks by name, those at the new angles where there are any.
    friction : static friction above which a surface locks, and the check of that surface.
    length_mm : axial length, mm.
    checks : records of the checks at the new angles, empty where it was not confirmed.
    """

    row: Row
    time: tuple[float, float] | None
    points: tuple[Row, ...]
    margins: Mapping[str, float]
    friction: tuple[float, str]
    length_mm: float
    checks: tuple[Row, ...] = ()

    @property
    def trial(self) -> int:
        """Number of the design."""
        return int(self.row["trial"])

    @property
    def confirmed(self) -> bool:
        """Whether it was simulated at new angles and every operating point."""
        return bool(self.points)

    @property
    def least(self) -> list[tuple[str, float]]:
        """Smallest margins with their checks, the smallest first."""
        return sorted(self.margins.items(), key=lambda pair: pair[1])[:SHOWN]

    @property
    def passes(self) -> bool:
        """Whether no margin is below zero."""
        return all(margin >= 0.0 for margin in self.margins.values())


def standing_of(study: Setup, result: Row, row: Row) -> Standing:
    """Collect what is known of a design of a result."""
    confirmation = result["confirmation"] or {"designs": []}
    found = next((d for d in confirmation["designs"] if d["trial"] == row["trial"]), None)
    if result["confirmation"] and row["prototype"]:
        found = confirmation["prototype"]
    elif result["confirmation"] and row["trial"] == confirmation.get("chosen"):
        found = confirmation["best"]
    margins = dict(row["margins"] or {})
    time = None
    if row[SIMULATED] is not None:
        time = float(row[SIMULATED]), float(row["standard_error_s"] or 0.0)
    if found is not None:
        margins |= {c["name"]: c["margin"] for c in found["checks"] if c["margin"] is not None}
        mean = found[SIMULATED]
        time = None if mean is None else (float(mean), float(found["standard_error_s"] or 0.0))
    params = {name: row[name] for name in study.variables}
    dog = study.dog_with(params)
    friction, length = locking_friction(dog, study.limits.load), dog.axial_length / MM
    known = (tuple(found["points"]), tuple(found["checks"])) if found else ((), ())
    return Standing(row, time, known[0], margins, friction, length, known[1])


def standings(study: Setup, result: Row) -> dict[int, Standing]:
    """Collect the standing of each simulated design of a result, by its number."""
    found = {}
    for row in result["trials"]:
        if row[SIMULATED] is None:
            continue
        try:
            found[int(row["trial"])] = standing_of(study, result, row)
        except (GeometryError, InputError):
            continue  # no dog, so that nothing can be said of its locking
    return found


def weights_by_place(study: Setup) -> dict[Place, float]:
    """Return the weights of a study's operating points."""
    return {place(p.mismatch / RPM, p.profile.force): p.weight for p in study.points}


def against(one: Standing, other: Standing, shifts: Shifts | None) -> dict[Place, Difference]:
    """Take the second design's times less the first's at each point that both were confirmed at."""
    if not (one.points and other.points):
        return {}
    pairs = {}
    if shifts is not None:
        names = list(shifts.study.variables)
        rows = [shifts.confirmed({n: s.row[n] for n in names}) for s in (one, other)]
        pairs = paired_points(*rows)
    return point_differences(one.points, other.points, pairs)


def difference(
    study: Setup, one: Standing, other: Standing, shifts: Shifts | None = None
) -> Difference | None:
    """Take the second design's expected time less the first's; None where one has none."""
    if one.trial == other.trial:
        return Difference(0.0, 0.0, paired=True)
    if one.time is None or other.time is None:
        return None
    if points := against(one, other, shifts):
        return overall(points, weights_by_place(study))
    error = float((one.time[1] ** 2 + other.time[1] ** 2) ** 0.5)
    return Difference(other.time[0] - one.time[0], error, paired=False)


def worst_point(
    prototype: Standing, design: Standing, shifts: Shifts | None = None
) -> tuple[Row, Difference] | None:
    """Find the operating point where a design loses most on the prototype, or gains least."""
    found = against(prototype, design, shifts)
    if not found:
        return None
    at = max(found, key=lambda key: found[key].value)
    point = next(p for p in design.points if place(p["mismatch_rpm"], p["force_N"]) == at)
    return point, found[at]
