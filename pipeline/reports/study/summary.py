"""First page of the report: headline, objectives of both designs, and facts behind them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import (
    check_name,
    in_ms,
    label,
    ms_with_error,
    percent,
    place_name,
    value,
)
from dogshape.pipeline.reports.study.designs import (
    confirmed_designs,
    design_name,
    engaged_shifts,
    failed_at_new_angles,
    is_measured,
    least_margins,
    margins_of,
    weakest_at_worst,
)
from dogshape.pipeline.reports.study.goals import Goal, goals_of
from dogshape.pipeline.reports.study.point_gains import gains
from dogshape.pipeline.simulate.design import SIMULATED, WORST
from dogshape.pipeline.simulate.failing import failing_words

Span = tuple[float, float]
END = 0.01  #: share of a search range within which a value lies at its end
APART = 3.0  #: combined standard errors between search and new angles that are said
LANDING = "_impact"  #: end of the names of the checks of a landing
ENGINES = {"drake": "Drake", "planar": "the compiled engine"}


class Fact(NamedTuple):
    """A line of the first page; ``bad`` speaks against the design."""

    name: str
    words: str
    bad: bool = False


@dataclass(frozen=True)
class Gained:
    """An objective of prototype and chosen design, as shown, each with its error.

    ``gain`` is positive where the chosen design is better.
    """

    goal: Goal
    prototype: tuple[float, float]
    chosen: tuple[float, float]
    gain: tuple[float, float]

    @property
    def clear(self) -> bool:
        """Whether the gain is at least twice its standard error."""
        return abs(self.gain[0]) >= 2.0 * self.gain[1] and self.gain[0] != 0.0

    @property
    def share(self) -> float | None:
        """Gain over the prototype's value; None of a margin, which is a share already."""
        value = self.prototype[0]
        return None if self.goal.unit == "%" or not value else self.gain[0] / abs(value)

    @property
    def more(self) -> bool:
        """Whether the objective of the chosen design is above the prototype's."""
        return (self.gain[0] >= 0.0) == self.goal.objective.maximise

    @property
    def change(self) -> str:
        """Difference of the chosen design to the prototype, in words."""
        gain, error = self.gain
        if not gain and not error:
            return "none"
        side = "more" if self.more else "less"
        unit = " percentage points" if self.goal.unit == "%" else f" {self.goal.unit}".rstrip()
        said = f"{self.goal.pair(abs(gain), error)}{unit} {side}"
        said += "" if self.share is None else f" ({100 * abs(self.share):.0f} %)"
        worse = ", worse" if gain < 0.0 else ""
        return said + (worse if self.clear else ", not clear")


def gained(result: Row) -> list[Gained]:
    """Compare all objectives of prototype and chosen design, the leading one first.

    Simulated ones are those of the confirmation, others exact. Empty before the confirmation, and
    without times where one of both does not engage.
    """
    c, best = result["confirmation"], result["best"]
    prototype = next((row for row in result["trials"] if row["prototype"]), None)
    if not c or best is None or best["prototype"]:
        return []
    found, timed = [], is_measured(c["prototype"]) and is_measured(c["best"])
    for goal in goals_of(result).told:
        if goal.objective.simulated and (timed or goal.unit != "ms"):
            gain, values = c["gains"][goal.name], (c["prototype"], c["best"])
            one, other = (goal.estimate(value) for value in values)
            change = (goal.factor * gain["value"], goal.factor * (gain["standard_error"] or 0.0))
        elif prototype is not None and prototype.get(goal.name) is not None and (
            not goal.objective.simulated
        ):  # fmt: skip
            one, other = (goal.shown(prototype), 0.0), (goal.shown(best), 0.0)
            change = (goal.objective.sign * (one[0] - other[0]), 0.0)
        else:
            continue
        found.append(Gained(goal, one, other, change))
    return found


def engine_of(result: Row) -> str:
    """Name the engine that simulated the shifts of a search."""
    return ENGINES[result["engine"]]


def headline(result: Row) -> str:
    """Summarise the study in one sentence."""
    best, c, lead = result["best"], result["confirmation"], goals_of(result).leading
    if best is None:
        return none_passes(result)
    name = design_name(best)
    if not c:
        found = "it does not engage"
        if is_measured(best):
            found = f"{lead.label} {lead.words(lead.shown(best), lead.error(best))}"
        return f"Best so far is {name}, not confirmed at new angles: {found}."
    if not (is_measured(c["best"]) and is_measured(c["prototype"])):
        each = [engaged_shifts(c[key]) for key in ("best", "prototype")]
        own, other = (f"in {one} of {n} shifts" for one, n in each)
        also = "no other design is chosen" if best["prototype"] else f"the prototype {other}"
        return f"{name.capitalize()} engages {own}, {also}."
    if best["prototype"]:
        return _no_better(result, lead)
    failed = ", but fails a check at the new angles" if failed_words(c["best"]) else ""
    said = f"{name.capitalize()} {_against_prototype(gained(result)[0])}"
    if result["n_simulated_designs"] < 2:
        said = f"Only {name} was simulated: there is no comparison of designs"
    return f"{said}{failed}."


def _no_better(result: Row, lead: Goal) -> str:
    """Write a sentence on a search that leaves the prototype."""
    fails = failed_words(result["confirmation"]["best"])
    also = f", and the prototype fails {fails}" if fails else ""
    other = [r for r in result["trials"] if not r["prototype"] and r[SIMULATED] is not None]
    if not other:
        return f"Only the prototype was simulated: no other design passes the first checks{also}."
    better = "faster" if lead.name == SIMULATED else f"better in the {lead.label}"
    sign, own = lead.objective.sign, lead.shown(result["best"])
    if any(sign * lead.shown(row) < sign * own for row in other):
        return f"No design that is {better} than the prototype passes every check{also}."
    return f"No design of this search is {better} than the prototype{also}."


def none_passes(result: Row) -> str:
    """Write a sentence on a search of which no design passes, with the checks that most fail."""
    said, how = "No design of this search passes every check", _most_failed(result)
    if not how:
        return f"{said}."
    silent = [r["engaged"] for r in result["trials"] if r["points"] and not is_measured(r)]
    also = ""
    if silent:
        also = (
            f"{len(silent)} have no time: at their worst operating point at most "
            f"{max(silent):.0%} of the shifts engage. "
        )
    return f"{said}: {how}. {also}Widen [variables], or change what these checks rest on."


def _most_failed(result: Row) -> str:
    """Name the checks that most designs fail, and by how much the nearest of them does."""
    every = [{failure(n, row): m for n, m in row["margins"].items()} for row in result["trials"]]
    return failing_words(every)


def failure(name: str, row: Row) -> str:
    """Name a check that a design fails; of the margin within tolerances the check behind it."""
    behind = row.get("weakest_check_worst_case")
    if name == WORST and behind:
        return f"{check_name(behind)} at worst-case tolerances"
    return check_name(name)


def _against_prototype(first: Gained) -> str:
    """Compare the chosen design with the prototype, after its name."""
    goal, gain = first.goal, first.gain
    quick = goal.name == SIMULATED
    if not first.clear:
        word = ("faster" if quick else "better") if gain[0] >= 0.0 else (
            "slower" if quick else "worse"
        )  # fmt: skip
        inside = "" if quick else f" in the {goal.label}"
        limit = ", less than twice the standard error" if gain[1] else ""
        amount = goal.words(abs(gain[0]), gain[1])
        return f"cannot be told from the prototype{inside}: {amount} {word}{limit}"
    if quick and first.share is not None:
        word = "faster" if gain[0] >= 0.0 else "slower"
        return f"shifts {100 * abs(first.share):.0f} % {word} than the prototype"
    change = (
        f"{goal.number(abs(gain[0]))} percentage points"
        if first.share is None and goal.unit == "%"
        else goal.words(abs(gain[0]))
        if first.share is None
        else f"{100 * abs(first.share):.0f} %"
    )
    value = goal.words(first.chosen[0])
    side = "above" if first.more else "below"
    return f"has a {goal.label} of {value}, {change} {side} the prototype's"


def failed_words(confirmed: Row | None) -> str:
    """List the checks that a confirmed design fails, with their margins; empty where none."""
    failed = [check for check in (confirmed or {"checks": []})["checks"] if not check["passed"]]
    return ", ".join(f"{check_name(c['name'])} ({percent(c['margin'])})" for c in failed)


def facts_of(study: Setup, result: Row) -> list[Fact]:
    """List the facts of the chosen design, and what speaks against it."""
    c, best = result["confirmation"], result["best"]
    if not c or best is None:
        return []
    found = [*_margin_facts(study, result)]
    if not best["prototype"]:
        found = [*_contact_facts(c), *found, *_point_facts(c)]
    elif how := _most_failed(result):
        found.append(Fact("designs that fail", how))
    return [*found, *_failure_facts(result), *_search_facts(study, result)]


def _contact_facts(c: Row) -> Iterator[Fact]:
    """Give the gain under other contact, which the sampling error leaves out."""
    found = [one for one in c.get("gains_by_contact", ()) if one["gain_s"] is not None]
    if found:
        words = [
            f"{ms_with_error(one['gain_s'], one['gain_standard_error_s'])} ms with {one['contact']}"
            for one in found
        ]
        yield Fact("gain under other contact", "; ".join(words))


def _margin_facts(study: Setup, result: Row) -> Iterator[Fact]:
    record, best = result["confirmation"]["best"], result["best"]
    searched = next(row for row in result["trials"] if row["trial"] == best["trial"])["margins"]
    margins = margins_of(best, record)
    name, margin = least_margins(margins)[0]
    yield Fact("smallest margin, nominal size", f"{percent(margin)} {check_name(name)}", margin < 0)
    worst, within = weakest_at_worst(study, best), best["margin_root_sum_square"]
    if worst is not None:
        name, margin = worst
        words = f"{percent(margin)} {check_name(name)}"
        yield Fact("at worst-case tolerances", words, margin < 0)
    if within is not None:
        yield Fact("by root sum of squares of the tolerances", percent(within), within < 0)
    landing = {n: m for n, m in margins.items() if n.endswith(LANDING)}
    if landing:
        name = min(landing, key=lambda one: landing[one])
        words = f"{percent(landing[name])} {check_name(name)}"
        if name in searched:
            words += f"; {percent(searched[name])} at the angles of the search"
        scatter = landing_scatter(result, name)
        own = math.inf if scatter is None else scatter * (1.0 - landing[name])
        if scatter is not None:
            words += f"; from angles to angles ± {percent(own)}"
        bad = landing[name] < 0.0 or (scatter is not None and landing[name] < own)
        yield Fact("hardest landing at the new angles", words, bad)


def _point_facts(c: Row) -> Iterator[Fact]:
    timed = is_measured(c["best"]) and is_measured(c["prototype"])
    found = gains(c) if timed else []
    slower = sorted((g for g in found if g.gain_s < 0.0), key=lambda g: g.gain_s)
    words = f"{len(slower)} of {len(found)}"
    if slower:
        first = slower[0]
        loss = ms_with_error(-first.gain_s, first.error_s)
        clear = sum(gain.clear for gain in slower)
        words += (
            f", {clear} by more than twice the standard error; most at "
            f"{place_name(first.mismatch_rpm, first.force_N)}, by {loss} ms"
        )
    if found:
        bad = any(gain.clear for gain in slower)
        yield Fact("operating points slower than the prototype", words, bad)
    counts = {key: engaged_shifts(c[key]) for key in ("best", "prototype")}
    own, other = (f"{one} of {n}" for one, n in counts.values())
    again = c["best"].get("mean_engaged_s")
    lost = counts["best"][0] < counts["best"][1]
    words = f"{own} shifts; prototype {other}"
    if lost and again is not None:
        words += f"; without retries {in_ms(again)} ms"
    yield Fact("engaged at the first try", words, lost)


def _failure_facts(result: Row) -> Iterator[Fact]:
    best, found = result["best"], confirmed_designs(result)
    own = next((row for row in result["trials"] if row["prototype"]), None)
    if words := failed_words(result["confirmation"]["best"]):
        yield Fact("fails at the new angles", f"{design_name(best)}: {words}", bad=True)
    if own is not None and own["failed"] and not best["prototype"]:
        margins = own["margins"] or {}
        words = ", ".join(
            failure(name, own) + (f" ({percent(margins[name])})" if name in margins else "")
            for name in own["failed"]
        )
        yield Fact("the prototype itself fails", words, bad=True)
    out = [row for row in failed_at_new_angles(result) if row["trial"] != best["trial"]]
    if out:
        words = "; ".join(f"{row['trial']}: {failed_words(found[row['trial']])}" for row in out)
        yield Fact("designs out, failed at the new angles", words)


def _search_facts(study: Setup, result: Row) -> Iterator[Fact]:
    c, best, lead = result["confirmation"], result["best"], goals_of(result).leading
    rows = {row["trial"]: row for row in result["trials"]}
    for trial, one in confirmed_designs(result).items():
        if (distance := disagreement(lead, rows[trial], one)) > APART:
            both = (lead.of(rows[trial]), lead.pair(*lead.estimate(one)))
            yield Fact(
                f"search and new angles of design {trial}",
                f"{both[0]} and {both[1]} {lead.unit}, {distance:.1f} combined standard errors "
                "apart: one of both errors is too small",
                bad=True,
            )
    timed = is_measured(c["best"])
    value, error = lead.estimate(c["best"]) if timed else (0.0, 0.0)
    better = [
        str(trial)
        for trial, one in confirmed_designs(result).items()
        if timed and trial != best["trial"] and not failed_words(one) and is_measured(one)
        and lead.objective.sign * (value - lead.estimate(one)[0])
        > 2.0 * math.hypot(error, lead.estimate(one)[1])
    ]  # fmt: skip
    if better:
        yield Fact("designs clearly better at the new angles", ", ".join(better))
    if not best["prototype"] and (ends := at_the_ends(best, study.variables)):
        yield Fact("at the end of the search range", f"{ends}; widen [variables]", bad=True)
    if left := c.get("left_out"):
        words = f"{', '.join(map(str, left))}; raise search.confirm_designs"
        yield Fact("designs not confirmed, and so not on the front", words)
    words = f"{c['angles']} new angles at each operating point"
    if c.get("drake_angles"):
        words += f", {c['drake_angles']} of them of Drake too"
    count = f"{result['n_simulated_shifts']}, the search by {engine_of(result)}"
    yield Fact("shifts simulated", f"{count}; figures above: {words}")
    for name, found in (
        ("chosen design in Drake", c["best"].get("drake")),
        ("audit", result.get("audit")),
    ):
        if found is not None:
            yield Fact(name, agreement_words(found), bad=not found["agrees"])


def agreement_words(found: Row) -> str:
    """Write the agreement of both engines on shifts that Drake repeated."""
    return (
        f"{found['shifts']} shifts again in Drake: {found['different_outcomes']} end differently, "
        f"mean time of the compiled engine {100 * found['mean_deviation']:+.2f} ± "
        f"{100 * found['standard_error']:.2f} %, median deviation of a shift "
        f"{100 * found['median_deviation']:.2f} %"
    )


def disagreement(lead: Goal, row: Row, record: Row) -> float:
    """Compute the combined standard errors between search and new angles; 0 where exact."""
    if row.get(lead.name) is None or not (is_measured(row) and is_measured(record)):
        return 0.0
    value, error = lead.estimate(record)
    both = math.hypot(error, lead.error(row))
    return abs(value - lead.shown(row)) / both if both else 0.0


def at_the_ends(best: Row, ranges: Mapping[str, Span]) -> str:
    """List the variables of a design at an end of their range, in edge units; none is empty."""
    found = []
    for name, (low, high) in ranges.items():
        room = END * (high - low) if name != "count" else 0.0
        for end, near in ((low, best[name] <= low + room), (high, best[name] >= high - room)):
            if near:
                side = "lower" if end == low else "upper"
                found.append(f"{label(name)} {value(name, best[name])} ({side} end {end:g})")
    return ", ".join(found)


def landing_scatter(result: Row, name: str) -> float | None:
    """Compute the relative scatter of a check of the landing from draw to draw of angles.

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
