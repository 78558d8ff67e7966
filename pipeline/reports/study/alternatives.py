"""Alternatives to the chosen design: those that another engineer would take, and why.

Beside the design that the search chose stand at most three others of the front: the one that loses
least on the prototype anywhere, the one that bears most friction before a surface locks, the one
with the largest smallest margin, the shortest, else the next in time. Each is said with its cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import (
    check_name,
    in_ms,
    ms_with_error,
    percent,
    place_name,
)
from dogshape.pipeline.reports.study.paired import Difference
from dogshape.pipeline.reports.study.single_shifts import Shifts
from dogshape.pipeline.reports.study.standing import (
    Standing,
    difference,
    standing_of,
    worst_point,
)
from dogshape.sim.errors import GeometryError

MOST = 3  #: alternatives beside the chosen design
FEWEST = 2  #: below which the next in time join them
MORE_FRICTION, MORE_MARGIN, SHORTER = 0.01, 0.005, 0.05  #: coefficient, share and mm that count
LANDING = "_impact"  #: end of the names of the checks of a landing


@dataclass(frozen=True)
class Alternative:
    """A design of the table: its standing, its worst point, and what it costs.

    ``cost`` is its expected time less the chosen design's; ``worst`` the operating point where it
    loses most on the prototype, with that loss; None where it was not confirmed.
    """

    standing: Standing
    cost: Difference | None
    worst: tuple[Row, Difference] | None

    @property
    def loss(self) -> float:
        """Largest loss on the prototype, s; infinite where it is not known."""
        return math.inf if self.worst is None else self.worst[1].value

    @property
    def name(self) -> str:
        """Name of the design."""
        row = self.standing.row
        return "prototype" if row["prototype"] else f"design {row['trial']}"

    @property
    def time_words(self) -> str:
        """Mean time with its error, ms."""
        time = self.standing.time
        return "-" if time is None else ms_with_error(*time)

    @property
    def worst_words(self) -> str:
        """Worst operating point against the prototype, ms."""
        if self.worst is None:
            return "not confirmed"
        point, loss = self.worst
        at = place_name(point["mismatch_rpm"], point["force_N"])
        side = "slower" if loss.value > 0.0 else "faster"
        return f"{ms_with_error(abs(loss.value), loss.error)} {side} at {at}"

    @property
    def margin_words(self) -> str:
        """Smallest margins with the names of their checks."""
        return ", ".join(f"{percent(m)} {check_name(n)}" for n, m in self.standing.least[:2])

    @property
    def friction_words(self) -> str:
        """Friction above which a surface locks, and that surface."""
        value, name = self.standing.friction
        return f"{value:.3f} ({check_name(name).removesuffix(' release')})"

    @property
    def cost_words(self) -> str:
        """Time that it costs against the chosen design, ms."""
        return "-" if self.cost is None else _signed(self.cost)


def alternatives(
    study: Setup, result: Row, shifts: Shifts | None, decided: int | None = None
) -> list[Alternative]:
    """List the chosen design, its alternatives in the order of time, and the prototype.

    The design that somebody ``decided`` for is among them.

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
    known = [s for s in others if s.trial != chosen.trial and not s.row["prototype"] and s.passes]

    def told(standing: Standing) -> Alternative:
        worst = None if prototype is None else worst_point(prototype, standing, shifts)
        return Alternative(standing, difference(study, chosen, standing, shifts), worst)

    first = told(chosen)
    picked = _picked(first, [told(one) for one in known])
    trials = {one.standing.trial for one in (first, *picked)} | {0}
    row = next((row for row in result["trials"] if row["trial"] == decided), None)
    if row is not None and decided not in trials:
        picked.append(told(standing_of(study, result, row)))
    last = [] if prototype is None else [told(prototype)]
    return [first, *sorted(picked, key=_time), *last]


def _time(one: Alternative) -> float:
    return math.inf if one.standing.time is None else one.standing.time[0]


def _picked(chosen: Alternative, others: list[Alternative]) -> list[Alternative]:
    """Pick the others that are best in something that counts; then the next in time."""
    wishes: tuple[tuple[Callable[[Alternative], float], Callable[[Alternative], bool]], ...] = (
        (lambda one: one.loss, lambda one: _steadier(chosen, one)),
        (lambda one: -one.standing.friction[0], lambda one: _friction(chosen, one) > 0.0),
        (lambda one: -_least(one), lambda one: _least(one) > _least(chosen) + MORE_MARGIN),
        (lambda one: one.standing.length_mm, lambda one: _shorter(chosen, one) > 0.0),
    )
    found: list[Alternative] = []
    for rank, counts in wishes:
        fit = [one for one in others if counts(one)]
        best = min(fit, key=rank, default=None)
        if best is not None and best not in found and len(found) < MOST:
            found.append(best)
    for one in sorted(others, key=_time):
        if len(found) < FEWEST and one not in found:
            found.append(one)
    return found


def _least(one: Alternative) -> float:
    return one.standing.least[0][1] if one.standing.least else 0.0


def _steadier(chosen: Alternative, one: Alternative) -> bool:
    if chosen.worst is None or one.worst is None:
        return False
    error = math.hypot(chosen.worst[1].error, one.worst[1].error)
    return chosen.loss - one.loss > 2.0 * error


def _friction(chosen: Alternative, one: Alternative) -> float:
    """Return the friction that a design bears more than the chosen one, zero if it is little."""
    more = one.standing.friction[0] - chosen.standing.friction[0]
    return more if more >= MORE_FRICTION else 0.0


def _shorter(chosen: Alternative, one: Alternative) -> float:
    less = chosen.standing.length_mm - one.standing.length_mm
    return less if less >= SHORTER else 0.0


def reasons(listed: list[Alternative]) -> list[str]:
    """Write a sentence on each alternative: why one would take it, and what it costs."""
    if not listed:
        return []
    chosen = listed[0]
    others = [one for one in listed[1:] if not one.standing.row["prototype"]]
    return [_reason(chosen, one) for one in others]


def _reason(chosen: Alternative, one: Alternative) -> str:
    why = []
    if _steadier(chosen, one):
        side = "slower" if one.loss > 0.0 else "faster"
        own = "slower" if chosen.loss > 0.0 else "faster"
        why.append(
            f"at its worst point it is {in_ms(abs(one.loss))} ms {side} than the prototype, where "
            f"{chosen.name} is {in_ms(abs(chosen.loss))} ms {own}"
        )
    if _friction(chosen, one):
        values = [each.standing.friction[0] for each in (one, chosen)]
        why.append(f"nothing locks up to a friction of {values[0]:.3f} instead of {values[1]:.3f}")
    if _least(one) > _least(chosen) + MORE_MARGIN:
        why.append(
            f"its smallest margin is {percent(_least(one))} instead of {percent(_least(chosen))}"
        )
    if less := _shorter(chosen, one):
        why.append(f"it is {less:.2f} mm shorter")
    taken = "; ".join(why) or "it is the next in time"
    return f"{one.name.capitalize()}, {_cost(chosen, one)}: {taken}{_open(one)}."


def _cost(chosen: Alternative, one: Alternative) -> str:
    if one.cost is None:
        return "whose time is not known"
    if not one.cost.clear:
        return f"whose time cannot be told from that of {chosen.name} ({_signed(one.cost)} ms)"
    more = "more" if one.cost.value > 0.0 else "less"
    return f"for {ms_with_error(abs(one.cost.value), one.cost.error)} ms {more}"


def _open(one: Alternative) -> str:
    return "" if one.standing.confirmed else "; it was not simulated at the new angles"


def margin_doubts(result: Row) -> list[str]:
    """Write sentences on margins of the chosen design that are smaller than their own scatter.

    The landing is an extreme of the shifts simulated, whose scatter shows between the angles of
    the search and the new ones. Margins of dimensions scatter with the tolerances, by root sum of
    squares.
    """
    best, confirmation = result["best"], result["confirmation"]
    if best is None or not confirmation:
        return []
    said = []
    margins = {c["name"]: c["margin"] for c in confirmation["best"]["checks"]}
    landing = {n: m for n, m in margins.items() if n.endswith(LANDING) and m is not None}
    name = min(landing, key=lambda one: landing[one], default="")
    scatter = landing_scatter(result, name) if name else None
    if scatter is not None:
        own = scatter * (1.0 - landing[name])
        if 0.0 <= landing[name] < own:
            said.append(
                f"Its margin of the hardest landing, {percent(landing[name])} "
                f"({check_name(name)}), is within its own scatter: other angles move it by "
                f"{percent(own)}, so whether it passes is not settled."
            )
    nominal, within = best["smallest_margin"], best["margin_root_sum_square"]
    if nominal is not None and within is not None and within < 0.0 <= nominal:
        said.append(
            f"Its smallest margin, {percent(nominal)}, is within the scatter of parts: by root sum "
            f"of squares of the tolerances {percent(within)} are left."
        )
    return said


def landing_scatter(result: Row, name: str) -> float | None:
    """Return the relative scatter of a check of the landing from draw to draw of angles.

    It is the standard deviation of the logarithm of its use, new angles over search, over the
    confirmed designs: that more angles find harder landings for all of them does not count. The
    scatter of the search's fewer angles is in it too, so that it is rather too large. None with
    fewer than three designs.
    """
    rows = {row["trial"]: row for row in result["trials"]}
    found = []
    for one in result["confirmation"]["designs"]:
        margins = rows.get(one["trial"], {}).get("margins") or {}
        after = next((c["margin"] for c in one["checks"] if c["name"] == name), None)
        if name in margins and after is not None and max(after, margins[name]) < 1.0:
            found.append(math.log((1.0 - after) / (1.0 - margins[name])))
    if len(found) < 3:
        return None
    middle = sum(found) / len(found)
    return math.sqrt(sum((each - middle) ** 2 for each in found) / (len(found) - 1))


def _signed(one: Difference) -> str:
    return ms_with_error(one.value, one.error, "+")
