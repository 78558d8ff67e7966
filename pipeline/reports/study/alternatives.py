"""Alternatives to the chosen design, each with its cost.

Beside the chosen design stand all others of the front that pass every check at the new angles.
"""

from __future__ import annotations

import math

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.study.design_record import (
    difference,
    ms_or_dash,
    searched_record,
    words_of,
)
from dogshape.sim.errors import GeometryError

#: Columns of the table, of the words of a record, between design and cost.
COLUMNS = (
    "expected shift time, ms", "worst point against the prototype, ms",
    "smallest margin, nominal size", "at worst-case tolerances", "locks above friction",
    "length, mm",
)  # fmt: skip
HEAD = ("design", *COLUMNS, "costs, ms")


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
    words, (cost, error) = words_of(one), difference(chosen, one) or (None, None)
    name = "prototype" if one["prototype"] else f"design {one['design']}"
    costs = "" if one["design"] == chosen["design"] else ms_or_dash(cost, error, "+")
    return (name, *(words[column] for column in COLUMNS), costs)


def _time(one: Row) -> float:
    time = one["expected_shift_time_s"]
    return math.inf if time is None else float(time)
