"""Record of one design: shape, expected shift time, margins, friction that locks, provenance.

Times and margins of a searched design are those of the confirmation where it was confirmed, else
of the search. A design that does not engage has no time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.study.designs import (
    confirmed_designs,
    engaged_shifts,
    is_measured,
    least_margins,
    margins_of,
    weakest_at_worst,
)
from dogshape.pipeline.reports.study.point_gains import gains
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.store.result_records import number_or_none
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.units import MM


def design_record(
    study: Setup,
    params: Mapping[str, float],
    margins: Mapping[str, float],
    worst: tuple[str, float] | None,
    **known: Any,
) -> Row:
    """Record a design of a study by one set of keys, None where something is not known.

    Parameters
    ----------
    params : the searched keys of the study, edge units; its own dog where there are none.
    margins : margins of all checks by name.
    worst : check with the smallest margin at worst-case tolerances, and that margin.
    known : number of the design, and what was simulated of it.
    """
    dog, (weakest, least) = study.dog_with(dict(params)), least_margins(margins)[0]
    friction, surface = locking_friction(dog, study.limits.load)
    return {
        "study": study.name,
        "design": known.get("design", 0),
        "prototype": known.get("prototype", True),
        **study.file.dog.model_dump(),
        **params,
        "axial_length_mm": dog.axial_length / MM,
        "travel_mm": dog.travel / MM,
        "expected_shift_time_s": known.get("time"),
        "standard_error_s": known.get("error"),
        "source": known.get("source"),
        "confirmed": known.get("confirmed", False),
        "engaged": known.get("engaged"),
        "shifts_engaged": known.get("shifts_engaged"),
        "gain_s": known.get("gain", (None, None))[0],
        "gain_standard_error_s": known.get("gain", (None, None))[1],
        "worst_against_prototype": known.get("worst_point"),
        "slowest_point": known.get("slowest"),
        "passes": all(margin >= 0.0 for margin in margins.values()),
        "smallest_margin": least,
        "weakest_check": weakest,
        "margin_worst_case": worst and number_or_none(worst[1]),
        "weakest_check_worst_case": worst and worst[0],
        "locking_friction": friction,
        "locking_surface": surface,
        "engine": known.get("engine", study.clutch.solver.engine),
        "contact": study.clutch.contact.name,
        "material": study.limits.material.name,
        "operating_points": len(study.points),
        "physics_hash": study.physics_hash,
        "config_hash": study.config_hash,
        "margins": dict(margins),
    }


def searched_record(study: Setup, result: Row, row: Row) -> Row:
    """Record a design of a result; ``study`` is the one that was searched."""
    params = {name: row[name] for name in study.variables}
    confirmed = confirmation_of(result, row)
    known = row if confirmed is None else confirmed
    simulated: Row = {}
    if is_measured(known):
        simulated = {"time": known[SIMULATED], "error": known["standard_error_s"] or 0.0}
        if confirmed is not None:
            simulated |= _point_facts(result, row, confirmed)
    return design_record(
        study,
        params,
        margins_of(row, confirmed),
        weakest_at_worst(study, row),
        design=int(row["trial"]),
        prototype=bool(row["prototype"]),
        source="search" if confirmed is None else "new angles",
        confirmed=confirmed is not None,
        engaged=known["engaged"],
        shifts_engaged=None if confirmed is None else list(engaged_shifts(confirmed)),
        **simulated,
    )


def confirmation_of(result: Row, row: Row) -> Row | None:
    """Select what a design was confirmed with; None where it was not."""
    confirmation = result["confirmation"]
    if confirmation and row["prototype"]:
        return dict(confirmation["prototype"])
    if confirmation and row["trial"] == confirmation.get("chosen"):
        return dict(confirmation["best"])
    return confirmed_designs(result).get(row["trial"])


def difference(one: Row, other: Row) -> tuple[float, float] | None:
    """Take the second record's time less the first's, with the error of independent means, s."""
    if None in (one["expected_shift_time_s"], other["expected_shift_time_s"]):
        return None
    error = math.hypot(one["standard_error_s"], other["standard_error_s"])
    return other["expected_shift_time_s"] - one["expected_shift_time_s"], error


def _point_facts(result: Row, row: Row, confirmed: Row) -> Row:
    """Collect the slowest operating point, and gain and greatest loss over the prototype."""
    slow = max(confirmed["points"], key=lambda p: p["mean_s"])
    place = slow["mismatch_rpm"], slow["force_N"]
    found: Row = {"slowest": _point(place, "mean_s", slow["mean_s"], slow["standard_error_s"])}
    own = result["confirmation"]["prototype"]
    if row["prototype"] or not is_measured(own):
        return found
    error = math.hypot(own["standard_error_s"] or 0.0, confirmed["standard_error_s"] or 0.0)
    found["gain"] = own[SIMULATED] - confirmed[SIMULATED], error
    points = gains({"prototype": own, "best": confirmed})
    if points:
        worst = min(points, key=lambda one: one.gain_s)
        found["worst_point"] = _point(worst.place, "difference_s", -worst.gain_s, worst.error_s)
    return found


def _point(place: tuple[float, float], name: str, time: float, error: float | None) -> Row:
    return {
        "mismatch_rpm": place[0],
        "force_N": place[1],
        name: time,
        "standard_error_s": number_or_none(error),
    }
