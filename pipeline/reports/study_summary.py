"""Summary of a study: headline, gain, alternatives to the chosen design, and facts about it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Bad, Table
from dogshape.pipeline.reports.charts import Row
from dogshape.pipeline.reports.data_sheet import (
    difference,
    ms_or_dash,
    point_differences,
    searched_record,
    words_of,
)
from dogshape.pipeline.reports.designs import (
    MARGIN,
    Goal,
    confirmation_of,
    confirmed_designs,
    design_name,
    engaged_shifts,
    failed_at_new_angles,
    failed_words,
    goals_of,
    is_measured,
    margins_of,
)
from dogshape.pipeline.reports.text import (
    axis,
    check_name,
    in_ms,
    label,
    minus,
    ms_with_error,
    percent,
    place_name,
    time_text,
    value,
)
from dogshape.pipeline.search.confirmation import EngineAgreement
from dogshape.pipeline.simulate.design import SIMULATED, WORST, failing_words

END = 0.01  #: share of a search range within which a value lies at its end
LANDING = "_impact"  #: end of the names of the checks of a landing
TIME_WORDS = "expected shift time, ms"
#: Columns of the alternatives, of the words of a record.
COLUMNS = ("smallest margin, nominal size", "at worst-case tolerances", "locks above friction")
Pair = tuple[float, float]


def headline(result: Row) -> str:
    """Compose the result of a study in one sentence."""
    best, c = result["best"], result["confirmation"]
    if best is None:
        how = _most_failed(result)
        return f"No design of this search passes every check{f': {how}' if how else ''}."
    name = design_name(best)
    if not c:
        lead = goals_of(result)[0]
        words = lead.words(lead.shown(best), lead.error(best)) if is_measured(best) else "no time"
        return f"Best so far, not confirmed: {name}, {lead.label} {words}."
    failed = failed_words(c["best"])
    fails = f", but fails {failed} at the new angles" if failed else ""
    if best["prototype"]:
        return f"No design of this search is chosen before the prototype{fails}."
    return f"{name.capitalize()} {_gain_words(result)}{fails}."


def _gain_words(result: Row) -> str:
    gains = gained(result)
    if not gains or gains[0][0].name != result["leading"]:
        return "engages in {} of {} shifts".format(*engaged_shifts(result["confirmation"]["best"]))
    goal, (before, _), (after, _), (gain, error) = gains[0]
    if abs(gain) < 2.0 * error or not gain:
        return "cannot be told from the prototype"
    share = f"{100 * abs(gain / before):.0f} %" if before else goal.words(abs(gain))
    if goal.name == SIMULATED:
        return f"is {share} {'faster' if gain > 0.0 else 'slower'} than the prototype"
    what = f"{goal.label}, {goal.words(after)}"
    return f"is {share} {'better' if gain > 0.0 else 'worse'} than the prototype in the {what}"


def gained(result: Row) -> list[tuple[Goal, Pair, Pair, Pair]]:
    """Compare all objectives of prototype and chosen design, as shown, each with its error.

    The gain is positive where the chosen design is better. Simulated ones are those of the
    confirmation, others exact. Empty before the confirmation; without times where one of both does
    not engage.
    """
    c, best = result["confirmation"], result["best"]
    if not c or best is None or best["prototype"]:
        return []
    own: Row = next((row for row in result["trials"] if row["prototype"]), {})
    found, timed = [], is_measured(c["prototype"]) and is_measured(c["best"])
    for goal in goals_of(result, SIMULATED):
        if goal.objective.simulated and (timed or goal.unit != "ms"):
            gain = c["gains"][goal.name]
            pairs = goal.estimate(c["prototype"]), goal.estimate(c["best"])
            change = goal.factor * gain["value"], goal.factor * (gain["standard_error"] or 0.0)
        elif not goal.objective.simulated and own.get(goal.name) is not None:
            pairs = (goal.shown(own), 0.0), (goal.shown(best), 0.0)
            change = goal.objective.sign * (pairs[0][0] - pairs[1][0]), 0.0
        else:
            continue
        found.append((goal, *pairs, change))
    return found


def summary_tables(study: Setup, result: Row) -> list[Table]:
    """Tabulate the gain, the designs worth a choice, and the facts about the chosen one."""
    if result["best"] is None:
        return []
    tables = [alternatives_table(study, result)]
    if result["confirmation"]:
        gains = [
            (goal.title, goal.pair(*before), goal.pair(*after), _change(goal, before[0], gain))
            for goal, before, after, gain in gained(result)
        ]
        angles = f"at {result['confirmation']['angles']} new angles"
        tables = [Table((angles, "prototype", "chosen", "gain"), gains), *tables]
        tables.append(Table(("", ""), list(facts_of(study, result))))
    return [table for table in tables if table.rows]


def _change(goal: Goal, before: float, gain: Pair) -> str:
    share = f" ({100 * gain[0] / abs(before):.0f} %)" if before and goal.unit != "%" else ""
    unclear = " (not clear)" if abs(gain[0]) < 2.0 * gain[1] else ""
    text = f"{goal.pair(*gain)}{share}{unclear}"
    return Bad(text) if gain[0] < 0.0 else text


def alternatives_table(study: Setup, result: Row) -> Table:
    """Tabulate the chosen design, others of the front that pass every check, and the prototype.

    Costs are differences to the chosen design, ± one standard error.
    """
    best, confirmed = result["best"], bool(result["confirmation"])
    goals = [goal for goal in goals_of(result, SIMULATED) if goal.name not in (SIMULATED, MARGIN)]

    def recorded(rows: Iterable[Row]) -> list[tuple[Row, Row]]:
        return [(row, searched_record(study, result, row)) for row in rows]

    shown = recorded(row for row in result["trials"] if row["prototype"])
    if not best["prototype"]:
        front = [row for row in result["front"]
                 if not row["prototype"] and row["trial"] != best["trial"]]  # fmt: skip
        others = [pair for pair in recorded(front)
                  if pair[1]["passes"] and pair[1]["confirmed"] == confirmed]  # fmt: skip
        others.sort(key=lambda pair: pair[1][SIMULATED] or math.inf)
        shown = [*recorded([best]), *others, *shown]
    chosen, rows, looks = shown[0][1], list[list[str]](), dict[int, str]()
    for row, one in shown:
        if one["prototype"] or one is chosen:
            looks[len(rows)] = "prototype" if one["prototype"] else "best"
        words, cost, worst = words_of(one), difference(chosen, one), one["worst_against_prototype"]
        repeated = confirmation_of(result, row) or {"estimates": {}}
        rows.append([
            "prototype" if one["prototype"] else str(row["trial"]),
            *(f"{row[name]:.4g}" for name in study.variables), words[TIME_WORDS],
            *(goal.pair(*goal.estimate(repeated)) if goal.name in repeated["estimates"]
              else goal.cell(row) for goal in goals),
            "-" if worst is None else ms_or_dash(
                worst["difference_s"], worst["standard_error_s"], "+"
            ),
            *(words[column] for column in COLUMNS),
            "" if one is chosen else "-" if cost is None else ms_or_dash(*cost, "+"),
        ])  # fmt: skip
    heads = (
        *("design", *map(axis, study.variables), TIME_WORDS, *(goal.title for goal in goals)),
        *("worst point less prototype, ms", *COLUMNS, "costs, ms"),
    )
    texts = [heads.index(column) for column in COLUMNS[:2]]
    note = "Designs of the front that pass every check at the new angles; ± one standard error."
    return Table(heads, rows, looks, texts, note)


def facts_of(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of a confirmed design; what speaks against it is marked as bad."""
    c, best = result["confirmation"], result["best"]
    if best["prototype"]:
        if how := _most_failed(result):
            yield "designs that fail", how
    else:
        yield from _gain_facts(study, result)
    landing = [one for one in margins_of(best, c["best"]).items() if one[0].endswith(LANDING)]
    if landing:
        yield "hardest landing at the new angles", margin_cell(min(landing, key=lambda one: one[1]))
    yield from _failure_facts(result)
    drake, audit = c["best"].get("drake"), result.get("audit")
    for name, found in (("chosen design in Drake", drake), ("audit", audit)):
        if found is not None:
            words = minus(EngineAgreement(**found).text)
            yield name, words if found["agrees"] else Bad(words)


def _failure_facts(result: Row) -> Iterator[tuple[str, str]]:
    c, best = result["confirmation"], result["best"]
    if words := failed_words(c["best"]):
        yield "fails at the new angles", Bad(words)
    own = next((row for row in result["trials"] if row["prototype"]), best)
    if own["failed"] and not best["prototype"]:
        yield "the prototype itself fails", Bad(", ".join(failure(n, own) for n in own["failed"]))
    confirmed = confirmed_designs(result)
    out = [row["trial"] for row in failed_at_new_angles(result) if row["trial"] != best["trial"]]
    if out:
        words = "; ".join(f"{trial}: {failed_words(confirmed[trial])}" for trial in out)
        yield "designs out, failed at the new angles", words
    for trial, one in confirmed.items():
        if one.get("agrees") is False:
            words = f"{one['errors_apart']:.1f} standard errors apart"
            yield f"search and new angles of design {trial}", Bad(words)
    if left := c.get("left_out"):
        yield "designs not confirmed", f"{', '.join(map(str, left))}; raise search.confirm_designs"


def _gain_facts(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of a chosen design beside the prototype."""
    c, best = result["confirmation"], result["best"]
    for one in c.get("gains_by_contact", ()):
        if one["gain_s"] is not None:
            words = ms_with_error(one["gain_s"], one["gain_standard_error_s"])
            yield f"gain with {one['contact']}", f"{words} ms"
    timed = is_measured(c["best"]) and is_measured(c["prototype"])
    if found := point_differences(c["prototype"], c["best"]) if timed else []:
        slower = [one for one in found if one["difference_s"] > 0.0]
        words = f"{len(slower)} of {len(found)}"
        if slower:
            most = max(slower, key=lambda one: float(one["difference_s"]))
            loss = ms_with_error(most["difference_s"], most["standard_error_s"] or 0.0)
            at = place_name(most["mismatch_rpm"], most["force_N"])
            clear = sum(
                p["difference_s"] >= 2.0 * (p["standard_error_s"] or math.inf) for p in slower
            )
            words += f" ({clear} clearly), most by {loss} ms at {at}"
            words = Bad(words) if clear else words
        yield "operating points slower than the prototype", words
    (own, n), (other, m) = (engaged_shifts(c[key]) for key in ("best", "prototype"))
    words = f"{own} of {n} shifts; prototype {other} of {m}"
    yield "engaged at the first try", Bad(words) if own < n else words
    if own < n and (again := c["best"].get("mean_engaged_s")) is not None:
        yield "expected shift time without retries", time_text(again)
    if within := best["time_within_tolerances"]:
        yield "shift time within tolerances", f"± {in_ms(within['root_sum_square_s'])} ms"
    ends = [
        f"{label(name)} {value(name, best[name])}"
        for name, (low, high) in study.variables.items()
        if not low < best[name] < high or (name != "count" and min(
            best[name] - low, high - best[name]) <= END * (high - low))
    ]  # fmt: skip
    if ends:
        yield "at the end of the search range", Bad(f"{', '.join(ends)}; widen [variables]")


def margin_cell(one: tuple[str, float] | None) -> str:
    """Print a margin with its check; below zero it is marked as bad."""
    if one is None:
        return Bad("no dog")
    text = f"{percent(one[1])} {check_name(one[0])}"
    return Bad(text) if one[1] < 0.0 else text


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
