"""Changes of a design's margins and expected shift time within its tolerances.

Margins follow from the closed forms, slopes of the time from the surrogate: a tolerance moves the
time by less than the standard error of simulating it. The axial gap adds free flight, in closed
form. Diameters scale speed and width alike, and the root radius is not simulated: neither counts.
"""

from __future__ import annotations

from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Record, key, number_or_none
from dogshape.pipeline.simulate.design import KINDS, Design, Within, weakest_within
from dogshape.pipeline.store.result_records import check_record
from dogshape.sim.strength.manufacture import Spread
from dogshape.sim.units import suffix_of, to_si
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import Surrogate


class ToleranceTime(Record):
    """Change of the expected shift time within the tolerances of the dimensions."""

    worst_case_s: float = key("all tolerances at their worst ends", "s")
    root_sum_square_s: float = key("root of the sum of squares over the dimensions", "s")
    by_dimension_s: dict[str, float] = key("change by dimension", "s")


def checks_within(design: Design, within: Within) -> list[dict[str, Any]]:
    """Return every check as a record, with its margins ``within`` the tolerances."""
    empty: dict[str, float] = {}
    return [
        check_record(check)
        | {
            f"margin_{kind}": number_or_none(within.get(check.name, empty).get(kind))
            for kind in KINDS
        }
        for check in design.checks
    ]


def smallest_within(study: Setup, design: Design) -> dict[str, Any]:
    """Return the smallest margin and its check in the worst case, and by root sum of squares."""
    if design.dog is None:
        return {**{f"margin_{kind}": None for kind in KINDS}, "weakest_check_worst_case": None}
    own = study.operated(design.params)
    found = {kind: weakest_within(own, design, kind) for kind in KINDS}
    return {
        **{f"margin_{kind}": number_or_none(margin) for kind, (_, margin) in found.items()},
        "weakest_check_worst_case": found["worst_case"][0],
    }


def tolerance_time(
    study: Setup, surrogate: Surrogate, params: dict[str, float], mix: Mix
) -> ToleranceTime:
    """Compute the change of the expected shift time over a mix."""
    tolerances = study.limits.tolerances.dimensions
    moves = {}
    for variable in surrogate.data.variables:
        name = variable.removesuffix(suffix_of(variable))
        if name in tolerances:
            step = tolerances[name] / to_si(variable, 1.0)
            designs = [{**params, variable: params[variable] + move} for move in (-step, step)]
            below, above = surrogate.medians(study.rows(designs), mix)
            moves[name] = 0.5 * float(above - below)
    if gap := tolerances.get("axial_gap"):
        moves["axial_gap"] = _gap_time(study, mix, gap)
    spread = Spread(moves, sum(abs(move) for move in moves.values()))
    whole, squares = spread.worst_case, spread.root_sum_square
    return ToleranceTime(worst_case_s=whole, root_sum_square_s=squares, by_dimension_s=moves)


def _gap_time(study: Setup, mix: Mix, tolerance: float) -> float:
    """Return the free flight that a wider gap adds, s, mean over the operating points."""
    clutch, gap = study.clutch, study.clutch.dog.axial_gap
    mass = clutch.rings.mass + clutch.mechanism.added_mass
    ends = (gap + tolerance, max(0.0, gap - tolerance))
    added = []
    for force in mix.points[:, 1].tolist():
        profile = study.actuation.at_sleeve(force)
        wide, narrow = (profile.free_flight_time(way, mass) if way > 0.0 else 0.0 for way in ends)
        added.append(0.5 * (wide - narrow))
    return float(mix.weights @ added)
