"""Alternatives to the chosen design, each with its cost.

Beside the chosen design stand all others of the front that pass every check at the new angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import (
    check_name,
    ms_with_error,
    percent,
    place_name,
)
from dogshape.pipeline.reports.study.designs import design_name
from dogshape.pipeline.reports.study.goals import goals_of
from dogshape.pipeline.reports.study.paired import Difference
from dogshape.pipeline.reports.study.single_shifts import Shifts
from dogshape.pipeline.reports.study.standing import (
    Standing,
    difference,
    standing_of,
    worst_point,
)
from dogshape.pipeline.reports.study.summary import APART, disagreement
from dogshape.sim.errors import GeometryError

HEAD = (
    "design", "mean, ms", "worst point against the prototype, ms", "smallest margin, nominal size",
    "at worst-case tolerances", "locks above friction", "length, mm", "costs, ms",
)  # fmt: skip


@dataclass(frozen=True)
class Alternative:
    """A design of the table: its standing, its worst point, and what it costs.

    ``cost`` is its expected time less the chosen design's; ``worst`` the operating point where it
    loses most on the prototype, with that loss; None where it was not confirmed. ``apart`` marks
    a search and new angles that differ by more than their errors.
    """

    standing: Standing
    cost: Difference | None
    worst: tuple[Row, Difference] | None
    apart: bool = False

    @property
    def worst_words(self) -> str:
        """Worst operating point against the prototype, ms."""
        if self.standing.row["prototype"]:
            return ""
        if self.worst is None:
            return "-" if self.standing.confirmed else "not confirmed"
        point, loss = self.worst
        at = place_name(point["mismatch_rpm"], point["force_N"])
        side = "slower" if loss.value > 0.0 else "faster"
        return f"{ms_with_error(abs(loss.value), loss.error)} {side} at {at}"

    @property
    def cells(self) -> tuple[str, ...]:
        """Cells of the table, below ``HEAD``."""
        one, worst = self.standing, self.standing.worst
        surface = check_name(one.friction[1]).removesuffix(" release")
        return (
            design_name(one.row),
            one.time_words + ("" if one.confirmed else "*") + ("†" if self.apart else ""),
            self.worst_words,
            ", ".join(f"{percent(m)} {check_name(n)}" for n, m in one.least[:1]),
            "no dog" if worst is None else f"{percent(worst[1])} {check_name(worst[0])}",
            f"{one.friction[0]:.3f} ({surface})",
            f"{one.length_mm:.2f}",
            _cost_words(self.cost),
        )


def alternatives(
    study: Setup, result: Row, shifts: Shifts | None, decided: int | None = None
) -> list[Alternative]:
    """List the chosen design, its alternatives in the order of time, and the prototype.

    The design that somebody ``decided`` for is among them, and so may be one not confirmed.

    Empty where no design was chosen, or the prototype was, or nothing was confirmed yet.
    """
    best = result["best"]
    if best is None or best["prototype"] or not result["confirmation"]:
        return []
    own = next((row for row in result["trials"] if row["prototype"]), None)
    try:
        prototype = None if own is None else standing_of(study, result, own)
        chosen = standing_of(study, result, best)
        others = [standing_of(study, result, row) for row in result["front"]]
    except (GeometryError, KeyError):
        return []  # a front of other variables than the study has
    known = [
        s for s in others
        if s.trial != chosen.trial and not s.row["prototype"] and s.passes and s.confirmed
    ]  # fmt: skip
    lead, rows = goals_of(result).leading, {row["trial"]: row for row in result["trials"]}

    def told(standing: Standing) -> Alternative:
        worst = None if prototype is None else worst_point(prototype, standing, shifts)
        searched = rows[standing.trial]
        apart = standing.record and disagreement(lead, searched, standing.record) > APART
        return Alternative(
            standing, difference(study, chosen, standing, shifts), worst, bool(apart)
        )

    row = next((row for row in result["trials"] if row["trial"] == decided), None)
    if row is not None and decided not in {0, chosen.trial, *(one.trial for one in known)}:
        known.append(standing_of(study, result, row))
    last = [] if prototype is None else [told(prototype)]
    return [told(chosen), *sorted(map(told, known), key=_time), *last]


def _cost_words(cost: Difference | None) -> str:
    if cost is None:
        return "-"
    return "" if cost == Difference(0.0, 0.0, True) else ms_with_error(cost.value, cost.error, "+")


def _time(one: Alternative) -> float:
    return math.inf if one.standing.time is None else one.standing.time[0]
