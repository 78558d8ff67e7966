"""Summary of a study: headline, gain, alternatives to the chosen design, and facts about it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Bad, Table
from dogshape.pipeline.reports.data_sheet import (
    difference,
    engine_of,
    ms_or_dash,
    point_gains,
    searched_record,
    words_of,
)
from dogshape.pipeline.reports.designs import (
    Goal,
    confirmed_designs,
    design_name,
    engaged_shifts,
    failed_at_new_angles,
    failed_words,
    goals_of,
    is_measured,
    least_margins,
    margins_of,
    shown_goals,
    weakest_at_worst,
)
from dogshape.pipeline.reports.look import Row
from dogshape.pipeline.reports.text import (
    check_name,
    label,
    ms_with_error,
    percent,
    place_name,
    time_text,
    value,
)
from dogshape.pipeline.search.confirmation import EngineAgreement
from dogshape.pipeline.simulate.design import SIMULATED, WORST, failing_words

END = 0.01  #: share of a search range within which a value lies at its end
APART = 3.0  #: combined standard errors between search and new angles that are a fact
LANDING = "_impact"  #: end of the names of the checks of a landing
#: Columns of the alternatives, of the words of a record.
COLUMNS = (
    "expected shift time, ms", "worst point against the prototype, ms",
    "smallest margin, nominal size", "at worst-case tolerances", "locks above friction",
    "length, mm",
)  # fmt: skip


def headline(result: Row) -> str:
    """Compose the result of a study in one sentence."""
    best, c = result["best"], result["confirmation"]
    if best is None:
        how = _most_failed(result)
        return f"No design of this search passes every check{f': {how}' if how else ''}."
    name, lead = design_name(best), goals_of(result)[0]
    if not c:
        words = lead.words(lead.shown(best), lead.error(best)) if is_measured(best) else "no time"
        return f"Best so far, not confirmed: {name}, {lead.label} {words}."
    failed = failed_words(c["best"])
    fails = f", but fails {failed} at the new angles" if failed else ""
    if best["prototype"]:
        return f"No design of this search is chosen before the prototype{fails}."
    gains = gained(result)
    if not gains or gains[0][0].name != lead.name:
        engaged, shifts = engaged_shifts(c["best"])
        return f"{name.capitalize()} engages in {engaged} of {shifts} shifts{fails}."
    goal, (before, _), (after, _), (gain, error) = gains[0]
    quick = goal.name == SIMULATED
    word = ("faster", "slower") if quick else ("better", "worse")
    if abs(gain) < 2.0 * error or not gain:
        return f"{name.capitalize()} cannot be told from the prototype{fails}."
    share = f"{abs(gain / before):.0%}".replace("%", " %") if before else goal.words(abs(gain))
    what = "" if quick else f" in the {goal.label}, {goal.words(after)}"
    return f"{name.capitalize()} is {share} {word[gain < 0.0]} than the prototype{what}{fails}."


Pair = tuple[float, float]


def gained(result: Row) -> list[tuple[Goal, Pair, Pair, Pair]]:
    """Compare all objectives of prototype and chosen design, as shown, each with its error.

    The gain is positive where the chosen design is better. Simulated ones are those of the
    confirmation, others exact. Empty before the confirmation; without times where one of both does
    not engage.
    """
    c, best = result["confirmation"], result["best"]
    prototype = next((row for row in result["trials"] if row["prototype"]), None)
    if not c or best is None or best["prototype"]:
        return []
    found, timed = [], is_measured(c["prototype"]) and is_measured(c["best"])
    for goal in shown_goals(result):
        if goal.objective.simulated and (timed or goal.unit != "ms"):
            gain = c["gains"][goal.name]
            pairs = goal.estimate(c["prototype"]), goal.estimate(c["best"])
            change = goal.factor * gain["value"], goal.factor * (gain["standard_error"] or 0.0)
        elif not goal.objective.simulated and (prototype or {}).get(goal.name) is not None:
            pairs = (goal.shown(prototype or {}), 0.0), (goal.shown(best), 0.0)
            change = goal.objective.sign * (pairs[0][0] - pairs[1][0]), 0.0
        else:
            continue
        found.append((goal, *pairs, change))
    return found


def summary_tables(study: Setup, result: Row) -> list[Table]:
    """Tabulate the gain, the alternatives to the chosen design, and the facts about it."""
    if not result["confirmation"] or result["best"] is None:
        return []
    gains = [
        (goal.title, goal.pair(*before), goal.pair(*after), _change(goal, before[0], gain))
        for goal, before, after, gain in gained(result)
    ]
    heads = (f"at {result['confirmation']['angles']} new angles", "prototype", "chosen", "gain")
    facts = Table(("", ""), list(facts_of(study, result)))
    others = alternatives_table(study, result)
    return [*([Table(heads, gains)] if gains else []), *([others] if others.rows else []), facts]


def _change(goal: Goal, before: float, gain: Pair) -> str:
    share = f" ({100 * gain[0] / abs(before):.0f} %)" if before and goal.unit != "%" else ""
    unclear = " (not clear)" if abs(gain[0]) < 2.0 * gain[1] else ""
    text = f"{goal.pair(*gain)}{share}{unclear}"
    return Bad(text) if gain[0] < 0.0 else text


def alternatives_table(study: Setup, result: Row) -> Table:
    """Tabulate the chosen design, others of the front that pass every check, and the prototype.

    Costs are differences to the chosen design, ± one standard error.
    """
    best = result["best"]
    rows, looks = list[list[str]](), {0: "best"}
    if not best["prototype"] and all(name in best for name in study.variables):
        own = [row for row in result["trials"] if row["prototype"]]
        front = [row for row in result["front"] if row["trial"] != best["trial"]]
        chosen = searched_record(study, result, best)
        others = [searched_record(study, result, row) for row in front]
        known = [one for one in others if one["passes"] and one["confirmed"]
                 and not one["prototype"]]  # fmt: skip
        known.sort(key=lambda one: one[SIMULATED] or math.inf)
        for one in (chosen, *known, *(searched_record(study, result, row) for row in own)):
            words, cost = words_of(one), difference(chosen, one)
            name = "prototype" if one["prototype"] else f"design {one['design']}"
            name += ", chosen" if one is chosen else ""
            price = "" if one is chosen else "-" if cost is None else ms_or_dash(*cost, "+")
            if one["prototype"]:
                looks[len(rows)] = "prototype"
            rows.append([name, *(words[column] for column in COLUMNS), price])
    note = "Designs of the front that pass every check at the new angles; ± one standard error."
    return Table(("design", *COLUMNS, "costs, ms"), rows, looks, (2, 3, 4), note)


def facts_of(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of a confirmed design; what speaks against it is marked as bad."""
    c, best = result["confirmation"], result["best"]
    if not best["prototype"]:
        for one in c.get("gains_by_contact", ()):
            if one["gain_s"] is not None:
                words = ms_with_error(one["gain_s"], one["gain_standard_error_s"])
                yield f"gain with {one['contact']}", f"{words} ms"
    elif how := _most_failed(result):
        yield "designs that fail", how
    margins = margins_of(best, c["best"])
    yield "smallest margin, nominal size", margin_cell(least_margins(margins)[0])
    yield "at worst-case tolerances", margin_cell(weakest_at_worst(study, best))
    if best["margin_root_sum_square"] is not None:
        yield "by root sum of squares", share_cell(best["margin_root_sum_square"])
    landing = [(n, m) for n, m in margins.items() if n.endswith(LANDING)]
    if landing:
        yield "hardest landing at the new angles", margin_cell(min(landing, key=lambda one: one[1]))
    if not best["prototype"]:
        yield from _point_facts(c)
    yield from _failure_facts(result)
    yield from _search_facts(study, result)


def _failure_facts(result: Row) -> Iterator[tuple[str, str]]:
    best = result["best"]
    own = next((row for row in result["trials"] if row["prototype"]), None)
    if words := failed_words(result["confirmation"]["best"]):
        yield "fails at the new angles", Bad(words)
    if own is not None and own["failed"] and not best["prototype"]:
        yield "the prototype itself fails", Bad(", ".join(failure(n, own) for n in own["failed"]))
    out = [row for row in failed_at_new_angles(result) if row["trial"] != best["trial"]]
    if out:
        names = ", ".join(str(row["trial"]) for row in out)
        yield "designs out, failed at the new angles", names


def margin_cell(one: tuple[str, float] | None) -> str:
    """Print a margin with its check; below zero it is marked as bad."""
    if one is None:
        return Bad("no dog")
    text = f"{percent(one[1])} {check_name(one[0])}"
    return Bad(text) if one[1] < 0.0 else text


def share_cell(margin: float) -> str:
    """Print a margin; below zero it is marked as bad."""
    return Bad(percent(margin)) if margin < 0.0 else percent(margin)


def _point_facts(c: Row) -> Iterator[tuple[str, str]]:
    timed = is_measured(c["best"]) and is_measured(c["prototype"])
    found = point_gains(c["prototype"], c["best"]) if timed else []
    slower = sorted((g for g in found if g["gain_s"] < 0.0), key=lambda g: float(g["gain_s"]))
    words = f"{len(slower)} of {len(found)}"
    if slower:
        first, clear = slower[0], sum(g["clear"] for g in slower)
        loss = ms_with_error(-first["gain_s"], first["error_s"])
        at = place_name(first["mismatch_rpm"], first["force_N"])
        words += f" ({clear} clearly), most by {loss} ms at {at}"
        words = Bad(words) if clear else words
    if found:
        yield "operating points slower than the prototype", words
    (own, n), (other, m) = (engaged_shifts(c[key]) for key in ("best", "prototype"))
    words = f"{own} of {n} shifts; prototype {other} of {m}"
    yield "engaged at the first try", Bad(words) if own < n else words
    if own < n and (again := c["best"].get("mean_engaged_s")) is not None:
        yield "expected shift time without retries", time_text(again)


def _search_facts(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    c, best, lead = result["confirmation"], result["best"], goals_of(result)[0]
    rows = {row["trial"]: row for row in result["trials"]}
    for trial, one in confirmed_designs(result).items():
        row = rows[trial]
        if row.get(lead.name) is None or not (is_measured(row) and is_measured(one)):
            continue
        (after, error), before = lead.estimate(one), lead.shown(row)
        both = math.hypot(error, lead.error(row))
        if both and abs(after - before) / both > APART:
            words = (
                f"{lead.cell(row)} and {lead.words(after, error)}, {abs(after - before) / both:.1f}"
            )
            yield f"search and new angles of design {trial}", Bad(f"{words} standard errors apart")
    if not best["prototype"] and (ends := ", ".join(_at_the_ends(best, study))):
        yield "at the end of the search range", Bad(f"{ends}; widen [variables]")
    if left := c.get("left_out"):
        yield "designs not confirmed", f"{', '.join(map(str, left))}; raise search.confirm_designs"
    if (error := c["best"]["numerical_error_s"]) is not None:
        yield "numerical error of the expected shift time", f"{1e3 * error:.2g} ms"
    words = f"{c['angles']} new angles at each operating point"
    if c.get("drake_angles"):
        words += f", {c['drake_angles']} of them of Drake too"
    count = f"{result['n_simulated_shifts']}, the search by {engine_of(result)}"
    yield "shifts simulated", f"{count}; {words}"
    for name, found in (
        ("chosen design in Drake", c["best"].get("drake")),
        ("audit", result.get("audit")),
    ):
        if found is not None:
            words = EngineAgreement(**found).text
            yield name, words if found["agrees"] else Bad(words)


def _at_the_ends(best: Row, study: Setup) -> Iterator[str]:
    for name, (low, high) in study.variables.items():
        room = END * (high - low) if name != "count" else 0.0
        if best[name] <= low + room or best[name] >= high - room:
            yield f"{label(name)} {value(name, best[name])}"


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
