"""Alternatives to the chosen design, each with its cost.

Beside the chosen design stand all others of the front that pass every check at the new angles.
"""

from __future__ import annotations

import math

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import (
    check_name,
    ms_with_error,
    percent,
    place_name,
)
from dogshape.pipeline.reports.study.design_record import difference, searched_record
from dogshape.sim.errors import GeometryError

HEAD = (
    "design", "mean, ms", "worst point against the prototype, ms", "smallest margin, nominal size",
    "at worst-case tolerances", "locks above friction", "length, mm", "costs, ms",
)  # fmt: skip


def alternatives(study: Setup, result: Row) -> list[Row]:
    """Record the chosen design, its alternatives in the order of time, and the prototype.

    Empty where no design was chosen, or the prototype was, or nothing was confirmed yet.
    """
    best = result["best"]
    if best is None or best["prototype"] or not result["confirmation"]:
        return []
    own = [row for row in result["trials"] if row["prototype"]]
    others = [row for row in result["front"] if row["trial"] != best["trial"]]
    try:
        chosen, *found = [searched_record(study, result, row) for row in (best, *others, *own)]
    except (GeometryError, KeyError):
        return []  # a front of other variables than the study has
    known = [one for one in found if one["passes"] and one["confirmed"] and not one["prototype"]]
    return [chosen, *sorted(known, key=_time), *found[len(others) :]]


def cells_of(one: Row, chosen: Row) -> tuple[str, ...]:
    """Write the cells of a design below ``HEAD``; costs are differences to the chosen design."""
    margin, worst = one["margin_worst_case"], one["weakest_check_worst_case"]
    surface = check_name(one["locking_surface"]).removesuffix(" release")
    return (
        "prototype" if one["prototype"] else f"design {one['design']}",
        _time_words(one),
        _worst_words(one),
        f"{percent(one['smallest_margin'])} {check_name(one['weakest_check'])}",
        "no dog" if margin is None else f"{percent(margin)} {check_name(worst)}",
        f"{one['locking_friction']:.3f} ({surface})",
        f"{one['axial_length_mm']:.2f}",
        _cost_words(one, chosen),
    )


def _time_words(one: Row) -> str:
    if one["expected_shift_time_s"] is None:
        return "engages in {} of {}".format(*one["shifts_engaged"])
    return ms_with_error(one["expected_shift_time_s"], one["standard_error_s"])


def _worst_words(one: Row) -> str:
    worst = one["worst_against_prototype"]
    if worst is None:
        return "" if one["prototype"] else "-"
    loss, error = worst["difference_s"], worst["standard_error_s"]
    side = "slower" if loss > 0.0 else "faster"
    at = place_name(worst["mismatch_rpm"], worst["force_N"])
    return f"{ms_with_error(abs(loss), error or 0.0)} {side} at {at}"


def _cost_words(one: Row, chosen: Row) -> str:
    if one["design"] == chosen["design"]:
        return ""
    cost = difference(chosen, one)
    return "-" if cost is None else ms_with_error(*cost, "+")


def _time(one: Row) -> float:
    time = one["expected_shift_time_s"]
    return math.inf if time is None else float(time)
