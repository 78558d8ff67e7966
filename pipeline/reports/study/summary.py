"""The first lines of the report: what was found, how sure it is, what limits it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import (
    check_name,
    label,
    minus,
    ms_with_error,
    percent,
    value,
)
from dogshape.pipeline.reports.study.front import confirmed_designs
from dogshape.pipeline.reports.study.goals import Goal, Goals, goals_of
from dogshape.pipeline.reports.study.point_gains import Gain, gains
from dogshape.pipeline.simulate.design import ENGAGEMENT, SIMULATED
from dogshape.pipeline.simulate.failing import failing_words

Span = tuple[float, float]
END = 0.01  #: share of a search range within which a value lies at its end
COUNTS = {2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven"}


def ms(seconds: float, digits: int = 1) -> str:
    """Print a time in ms without its unit, with a real minus."""
    return minus(f"{seconds * 1e3:.{digits}f}")


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

    Simulated ones are those of the confirmation, others exact. A time is left out where either
    engages too seldom to have one. Empty before the confirmation.
    """
    c, best = result["confirmation"], result["best"]
    prototype = next((row for row in result["trials"] if row["prototype"]), None)
    if not c or best is None:
        return []
    found = []
    for goal in goals_of(result).told:
        if goal.objective.simulated:
            if goal.name not in c["prototype"]["estimates"].keys() & c["best"]["estimates"].keys():
                continue
            one, other = (goal.estimate(value) for value in (c["prototype"], c["best"]))
            gain = c["gains"].get(goal.name, {"value": 0.0, "standard_error": 0.0})
            change = (goal.factor * gain["value"], goal.factor * (gain["standard_error"] or 0.0))
        elif prototype is not None and prototype.get(goal.name) is not None:
            one, other = (goal.shown(prototype), 0.0), (goal.shown(best), 0.0)
            change = (goal.objective.sign * (one[0] - other[0]), 0.0)
        else:
            continue
        found.append(Gained(goal, one, other, change))
    return found


ENGINES = {"drake": "Drake", "planar": "the compiled engine"}


def engine_of(result: Row) -> str:
    """Name the engine that simulated the shifts of a study, and another one that confirmed it."""
    engine = result.get("engine", "drake")
    other = (result["confirmation"] or {}).get("engine") or engine
    searched, confirmed = (ENGINES[name] for name in (engine, other))
    return searched if other == engine else f"{searched}, at the new angles by {confirmed}"


def counted(result: Row) -> str:
    """Count the shifts that were simulated, by engine."""
    said = f"{result['n_simulated_shifts']} shifts were simulated by {engine_of(result)}"
    if compiled := result.get("n_compiled_shifts"):
        said += f" and {compiled} by the compiled engine"
    return said


def both_levels(result: Row) -> str:
    """Name the shifts that times and errors rest on in two levels; empty in one level."""
    if not result.get("n_compiled_shifts"):
        return ""
    return (
        "Times are those of the compiled engine at many angles, corrected by what Drake differs at "
        "some of the same angles; their error is that of both: of the compiled engine's mean, and "
        "of the correction."
    )


def headline(result: Row) -> str:
    """Summarise the study in one sentence."""
    best, lead = result["best"], goals_of(result).leading
    if best is None:
        return none_passes(result)
    if not result["confirmation"]:
        value = lead.words(lead.shown(best), lead.error(best))
        return (
            f"The best design so far is number {best['trial']}: {lead.label} {value}. "
            "It has not been confirmed at new angles yet."
        )
    if best["prototype"]:
        if not any(row["feasible"] for row in result["trials"] if not row["prototype"]):
            return none_passes(result)
        better = "faster" if lead.name == SIMULATED else f"better in the {lead.label}"
        return f"No design of this search is {better} than the prototype."
    failed = ", but fails a check at the new angles" if _chosen_fails(result) else ""
    found = gained(result)
    if not found or not found[0].goal.leading:
        return f"Design {best['trial']} {engaged_words(result)}{failed}."
    return f"Design {best['trial']} {_against_prototype(found[0])}{failed}."


def engaged_words(result: Row) -> str:
    """Count the shifts in which the chosen design and the prototype engage."""
    best, own = (result["confirmation"][key] for key in ("best", "prototype"))
    counts = [f"{one['shifts'] - one['not_engaged']} of {one['shifts']}" for one in (best, own)]
    return f"engages in {counts[0]} shifts, the prototype in {counts[1]}: no gain in time is known"


def none_passes(result: Row) -> str:
    """Write a sentence on a search of which no design passes, with the checks that most fail."""
    own = [row for row in result["trials"] if row["prototype"]]
    others = [row for row in result["trials"] if not row["prototype"]]
    passing = any(row["feasible"] for row in own)
    rows = others if passing else result["trials"]
    said = "No design of this search passes every check" + (" but the prototype" if passing else "")
    if not (failing := failing_words([row["margins"] for row in rows])):
        return f"{said}."
    silent = [row["engaged"] for row in rows if ENGAGEMENT.name in row["failed"]]
    also = ""
    if silent:
        also = f"{len(silent)} have no time: at their worst operating point at most " \
               f"{max(silent):.0%} of the shifts engage. "  # fmt: skip
    also += "" if passing else _prototype_fails(own)
    return f"{said}: {failing}. {also}Widen [variables], or change what these checks rest on."


def _prototype_fails(own: list[Row]) -> str:
    """Write a sentence on the checks that the prototype itself fails, or none."""
    if not own or not own[0]["failed"]:
        return ""
    margins = own[0]["margins"] or {}
    words = ", ".join(
        check_name(name) + (f" ({percent(margins[name])})" if name in margins else "")
        for name in own[0]["failed"]
    )
    return f"The prototype itself fails: {words}. "


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


def choice(result: Row) -> str:
    """Explain the objectives, the rule by which a design is chosen, and the margins that decide."""
    goals = goals_of(result)
    number = COUNTS.get(len(goals.every), str(len(goals.every)))
    first = f"The objective is the {goals.leading.label}."
    if goals.others:
        others = "; ".join(f"the {goal.label}" for goal in goals.others)
        lead = f"the {goals.leading.label}, which leads"
        first = f"There are {number} objectives: {lead}; {others}."
    chosen = (
        "Chosen is the design of the front that the search had put first; the front is by the "
        "values of the new angles"
    )
    if result["confirmation"] and _chosen_fails(result):
        chosen += "; no confirmed design passes every check, so it is the first of all"
    return (
        f"{first} {chosen}. Margins at nominal size decide what passes; the margin with every "
        "tolerance at its worst is shown, and may be negative."
    )


def points_of(result: Row) -> list[str]:
    """Write sentences on a confirmed design: certainty, limits, and losses."""
    confirmation, best = result["confirmation"], result["best"]
    if best["prototype"]:
        return [_simulated(result), _limits(best)]
    said = [_how_sure(result), *_hung(result), *_better(result), _limits(best)]
    return [*said, *_slower(gains(confirmation))]


def failures_of(result: Row) -> list[str]:
    """Write a sentence where the chosen design, or else the prototype, fails a check."""
    best, said = result["best"], []
    if words := failed_words(confirmed_designs(result).get(best["trial"])):
        said.append(f"Design {best['trial']}, the chosen one, fails at the new angles: {words}.")
    own = [row for row in result["trials"] if row["prototype"]]
    if not best["prototype"] and (words := _prototype_fails(own)):
        said.append(words.strip())
    return said


def passed_over(result: Row) -> str:
    """Write a sentence on designs beside the chosen one that fail at the new angles, or none."""
    best, found = result["best"]["trial"], confirmed_designs(result)
    worst = {
        trial: min(check["margin"] for check in one["checks"] if not check["passed"])
        for trial, one in found.items()
        if trial != best and failed_words(one)
    }
    if not worst:
        return ""
    names = ", ".join(str(trial) for trial in worst)
    many = len(worst) > 1
    what = sorted({check_name(check["name"]) for trial in worst
                   for check in found[trial]["checks"] if not check["passed"]})  # fmt: skip
    over = [percent(-margin) for margin in sorted(worst.values(), reverse=True)]
    by = f"by {over[0]} to {over[-1]}" if many and over[0] != over[-1] else f"by {over[0]}"
    who = f"Designs {names}, found by the search, are" if many else f"Design {names} is"
    fails = "they fail" if many else "it fails"
    return f"{who} out: {fails} at the new angles {by} ({', '.join(what)})."


def at_the_ends(result: Row, ranges: Mapping[str, Span]) -> str:
    """Write a sentence on variables of the chosen design at an end of their range, or none.

    ``ranges`` has the ends of each variable in edge units.
    """
    best = result["best"]
    if best is None or best["prototype"]:
        return ""
    found = []
    for name, (low, high) in ranges.items():
        room = END * (high - low) if name != "count" else 0.0
        for end, near in ((low, best[name] <= low + room), (high, best[name] >= high - room)):
            if near:
                side = "lower" if end == low else "upper"
                found.append(f"{label(name)} {value(name, best[name])} ({side} end {end:g})")
    if not found:
        return ""
    keys = "it" if len(found) == 1 else "them"
    return (
        f"At the end of the search range: {', '.join(found)}. The best may lie beyond: "
        f"widen {keys} in [variables]."
    )


def failed_words(confirmed: Row | None) -> str:
    """List the checks that a confirmed design fails, with their margins; empty where none."""
    failed = [check for check in (confirmed or {"checks": []})["checks"] if not check["passed"]]
    return ", ".join(f"{check_name(c['name'])} ({percent(c['margin'])})" for c in failed)


def _chosen_fails(result: Row) -> bool:
    return bool(failed_words(result["confirmation"]["best"]))


def _how_sure(result: Row) -> str:
    first = next(iter(gained(result)), None)
    if first is None or not first.goal.leading:
        return _simulated(result)
    gain, error = first.gain
    if not error:
        sure = f"The {first.goal.label} has no standard error: most margins are exact, and the " \
               "hardest landing is an extreme"  # fmt: skip
    elif first.clear:
        sure = f"Clear: the gain is {abs(gain) / error:.0f} times its standard error"
    else:
        sure = f"Not clear: the gain is {abs(gain) / error:.1f} times its standard error"
    return f"{sure}. {_simulated(result)}"


def _simulated(result: Row) -> str:
    angles = result["confirmation"]["angles"]
    return (
        f"{counted(result)}; the figures above are from {angles} new relative angles "
        f"{_beside(result)}at each operating point, not used by the search."
    )


def _beside(result: Row) -> str:
    """Name the compiled engine's angles of a confirmation in two levels."""
    many = result["confirmation"]["best"]["points"][0].get("n_planar")
    return f"of Drake, among {many} of the compiled engine, " if many else ""


def _hung(result: Row) -> list[str]:
    said = []
    for name, role in (("prototype", "the prototype"), ("best", "the chosen design")):
        found = result["confirmation"][name]
        count = sum(point["n"] for point in found["points"])
        lost = sum(p["n"] - round(p["engaged"] * p["n"]) for p in found["points"])
        if not lost:
            continue
        text = f"{lost} of {count} shifts of {role} did not engage there and are tried again"
        if found.get("mean_engaged_s") is not None:
            text += f"; without the retries it takes {ms(found['mean_engaged_s'])} ms"
        said.append(f"{text}.")
    return said


def _better(result: Row) -> list[str]:
    """Write a sentence where another design of the front did clearly better when confirmed."""
    lead, chosen = goals_of(result).leading, result["best"]["trial"]
    if lead.name not in result["confirmation"]["best"]["estimates"]:
        return []
    own, own_error = lead.estimate(result["confirmation"]["best"])
    better = []
    for trial, one in confirmed_designs(result).items():
        if lead.name not in one["estimates"]:
            continue
        value, error = lead.estimate(one)
        clear = lead.objective.sign * (own - value) > 2.0 * math.hypot(error, own_error)
        if trial != chosen and clear and not failed_words(one):
            better.append(str(trial))
    if not better:
        return []
    return [
        f"Design{'s' if len(better) > 1 else ''} {', '.join(better)} did clearly better than "
        f"design {chosen} at the new angles; the order of the search decides, so that none is "
        "chosen for its luck there."
    ]


def _limits(best: Row) -> str:
    weakest = best["weakest_check"]
    said = (
        f"What limits it: {check_name(weakest)}, with a margin of "
        f"{percent(best['margins'][weakest])} to its limit"
    )
    worst = best["margin_worst_case"]
    if worst is not None:
        said += f"; the smallest margin is {percent(worst)} with every tolerance at its worst"
        said += ", so such a part may break a limit" if worst < 0.0 else ""
    return f"{said}."


def apart_words(result: Row) -> list[str]:
    """Write a sentence on designs of which search and new angles differ beyond their errors."""
    lead, said = goals_of(result).leading, []
    for one in (result["confirmation"] or {"designs": []})["designs"]:
        if one.get("agrees", True):
            continue
        before = [lead.factor * one["searched"][key] for key in ("value", "standard_error")]
        new = lead.words(*lead.estimate(one))
        said.append(
            f"Design {one['trial']}: the search had {lead.words(*before)}, the new angles {new}, "
            f"{abs(one['errors_apart']):.1f} standard errors apart; its error is larger than said."
        )
    return said


def _slower(found: list[Gain]) -> list[str]:
    slower = [gain for gain in found if gain.gain_s < 0.0]
    if not slower:
        return [f"Nowhere slower than the prototype, at {len(found)} operating points."]
    clear = [gain for gain in slower if gain.clear]
    rest = len(slower) - len(clear)
    said = f"Slower than the prototype at {len(slower)} of {len(found)} operating points"
    if not clear:
        return [f"{said}, nowhere clearly: each loss is below twice its standard error."]
    places = "; ".join(
        f"{g.mismatch_rpm:.4g} 1/min with {g.force_N:.4g} N by "
        f"{ms_with_error(-g.gain_s, g.error_s)} ms"
        for g in sorted(clear, key=lambda g: g.gain_s)
    )
    said += f", clearly at {len(clear)}: {minus(places)}"
    return [said + (f"; the other {rest} may be chance." if rest else ".")]


def meaning(goals: Goals, points: int, weighted: bool) -> str:
    """Explain the leading objective in a sentence."""
    lead = goals.leading
    over = f"all relative angles of the rings and {points} operating points (mismatch and force)"
    over += ", each with its weight" if weighted else ""
    said = lead.meaning.replace("{over}", over)
    return f"The {lead.label} is {said}."
