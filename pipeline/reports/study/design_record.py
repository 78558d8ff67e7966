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
from dogshape.pipeline.reports.kit.text import check_name, ms_with_error, percent, place_name
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
from dogshape.pipeline.store.result_schema import number_or_none
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.units import MM

#: Keys of what was simulated of a design.
SIMULATION = (
    SIMULATED, "standard_error_s", "source", "engaged", "shifts_engaged", "gain_s",
    "gain_standard_error_s", "worst_against_prototype", "slowest_point",
)  # fmt: skip


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
    known : what else is known of the design, by the keys of the record.
    """
    dog, (weakest, least) = study.dog_with(dict(params)), least_margins(margins)[0]
    friction, surface = locking_friction(dog, study.limits.load)
    return {
        "study": study.name,
        "design": 0,
        "prototype": True,
        **study.file.dog.model_dump(),
        **params,
        "axial_length_mm": dog.axial_length / MM,
        "travel_mm": dog.travel / MM,
        **dict.fromkeys(SIMULATION),
        "confirmed": False,
        "passes": all(margin >= 0.0 for margin in margins.values()),
        "smallest_margin": least,
        "weakest_check": weakest,
        "margin_worst_case": worst and number_or_none(worst[1]),
        "weakest_check_worst_case": worst and worst[0],
        "locking_friction": friction,
        "locking_surface": surface,
        "engine": study.clutch.solver.engine,
        "contact": study.clutch.contact.name,
        "material": study.limits.material.name,
        "operating_points": len(study.points),
        "physics_hash": study.physics_hash,
        "config_hash": study.config_hash,
        "margins": {name: number_or_none(margin) for name, margin in margins.items()},
        **known,
    }


def searched_record(study: Setup, result: Row, row: Row) -> Row:
    """Record a design of a result; ``study`` is the one that was searched."""
    confirmed = confirmation_of(result, row)
    known = row if confirmed is None else confirmed
    simulated: Row = {"engaged": known["engaged"], "source": "search"}
    if confirmed is not None:
        counts = list(engaged_shifts(confirmed))
        simulated |= {"source": "new angles", "confirmed": True, "shifts_engaged": counts}
    if is_measured(known):
        simulated |= {key: known[key] or 0.0 for key in (SIMULATED, "standard_error_s")}
        simulated |= {} if confirmed is None else _point_facts(result, row, confirmed)
    return design_record(
        study,
        {name: row[name] for name in study.variables},
        margins_of(row, confirmed),
        weakest_at_worst(study, row),
        design=int(row["trial"]),
        prototype=bool(row["prototype"]),
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
    keys = ("mismatch_rpm", "force_N", "mean_s", "standard_error_s")
    found: Row = {"slowest_point": {key: slow[key] for key in keys}}
    own = result["confirmation"]["prototype"]
    if row["prototype"] or not is_measured(own):
        return found
    errors = [one["standard_error_s"] or 0.0 for one in (own, confirmed)]
    found["gain_s"] = own[SIMULATED] - confirmed[SIMULATED]
    found["gain_standard_error_s"] = math.hypot(*errors)
    points = gains({"prototype": own, "best": confirmed})
    if points:
        worst = min(points, key=lambda one: one.gain_s)
        found["worst_against_prototype"] = {
            "mismatch_rpm": worst.mismatch_rpm,
            "force_N": worst.force_N,
            "difference_s": -worst.gain_s,
            "standard_error_s": number_or_none(worst.error_s),
        }
    return found


def words_of(one: Row) -> dict[str, str]:
    """Write times, margins and friction of a record with their errors; a dash where unknown."""
    margin, check = one["margin_worst_case"], one["weakest_check_worst_case"]
    surface = check_name(one["locking_surface"]).removesuffix(" release")
    engaged, least = one["engaged"], one["smallest_margin"]
    return {
        "expected shift time, ms": _time_words(one),
        "gain over the prototype, ms": ms_or_dash(one["gain_s"], one["gain_standard_error_s"]),
        "worst point against the prototype, ms": _place_words(one["worst_against_prototype"]),
        "slowest point, ms": _place_words(one["slowest_point"]),
        "engage at the first try, least": "-" if engaged is None else percent(engaged),
        "smallest margin, nominal size": f"{percent(least)} {check_name(one['weakest_check'])}",
        "at worst-case tolerances": "no dog"
        if margin is None
        else f"{percent(margin)} {check_name(check)}",
        "locks above friction": f"{one['locking_friction']:.3f} ({surface})",
        "length, mm": f"{one['axial_length_mm']:.2f}",
    }


def ms_or_dash(time: float | None, error: float | None, sign: str = "") -> str:
    """Print a time and its standard error, both in s, in ms; a dash where there is none."""
    return "-" if time is None else ms_with_error(time, error or 0.0, sign)


def _time_words(one: Row) -> str:
    counts, source = one["shifts_engaged"], one["source"]
    if one[SIMULATED] is None:
        return "engages in {} of {}".format(*counts) if counts else f"none ({source})"
    said = ms_with_error(one[SIMULATED], one["standard_error_s"])
    return said if one["confirmed"] else f"{said} ({source})"


def _place_words(point: Row | None) -> str:
    if point is None:
        return "-"
    at, loss = place_name(point["mismatch_rpm"], point["force_N"]), point.get("difference_s")
    said = ms_or_dash(abs(point["mean_s"] if loss is None else loss), point["standard_error_s"])
    side = "" if loss is None else (" slower" if loss > 0.0 else " faster")
    return f"{said}{side} at {at}"
