"""The result of a study in a sentence, tables and facts, for console and page."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Bad, Table, percent
from dogshape.pipeline.reports.data_sheet import (
    ENGAGED,
    HANGS,
    STATISTICAL_MARGIN,
    TIME,
    WORST_MARGIN,
    difference,
    hang_share,
    point_differences,
    searched_record,
    searched_verdict,
    words_of,
)
from dogshape.pipeline.reports.designs import (
    MARGIN,
    UNCLEAR,
    Goal,
    Row,
    confirmation_of,
    confirmed_designs,
    confirmed_verdict,
    design_name,
    engaged_shifts,
    goals_of,
    margins_of,
    nearest_records,
    objection,
    out_at_new_angles,
)
from dogshape.pipeline.reports.text import (
    axis,
    check_name,
    engaged_text,
    hang_words,
    in_ms,
    label,
    margin_cell,
    minus,
    ms_with_error,
    place_name,
    quantile_words,
    value,
)
from dogshape.pipeline.simulate.design import (
    SIMULATED,
    SUMMARIES,
    WITHIN,
    WITHIN_WORDS,
    failing_words,
)
from dogshape.pipeline.store.result_records import EngineAgreement, VerdictRow

BESIDE = 10  #: designs beside each other in the table of margins
END = 0.01  #: share of a search range within which a value lies at its end
LANDING = "_impact"  #: end of the names of the checks of a landing
VERDICT = "verdict"
#: Columns of the alternatives, of the words of a record.
COLUMNS = ("state", STATISTICAL_MARGIN, WORST_MARGIN)
SIDES = {"prototype": "prototype", "best": "chosen"}  #: of a confirmation, by their keys
WITHIN_ERROR = " (within two standard errors)"
Pair = tuple[float, float]


def headline(result: Row) -> str:
    """Compose the result of a study: the leading objective, and what keeps it from passing."""
    best, c = result["best"], result["confirmation"]
    if best is None:
        how = _most_failed(result)
        words = f"No design of this search passes every check{f': {how}' if how else ''}."
        return words + _nearest_sentences(result)
    name, lead = design_name(best).capitalize(), goals_of(result)[0]
    if not c:
        timed = best[SIMULATED] is not None
        words = lead.words(lead.shown(best), lead.error(best)) if timed else "no time"
        return f"Best so far, not confirmed: {design_name(best)}, {lead.label} {words}."
    if best["prototype"]:
        return _own_headline(lead, c["best"])
    words = " engages in {} of {} shifts".format(*engaged_shifts(c["best"]))
    gains = gained(result)
    if gains and gains[0][0] == lead:
        _, before, after, gain = gains[0]
        words = f": {lead.label} {lead.words(*after)}"
        own_words, own_state = lead.words(*before), confirmed_verdict(c["prototype"]).state
        if own_state in ("fails", "not_clear"):
            link = ", but" if own_state == "fails" else " and is"
            words += f"; your own dog has {own_words}{link} {objection(c['prototype'])}"
        else:
            than = ", not clearly better than" if unclear(*gain) else " instead of"
            words += f"{than} {own_words} of your own dog"
    return f"{name}{words}.{_verdict_sentence(name, c['best'])}"


def _nearest_sentences(result: Row) -> str:
    """Name the nearest designs that do not fail at the new angles, each with a blank before."""
    words = ""
    for trial, record in nearest_records(result).items():
        state = confirmed_verdict(record).state
        rows = [row for row in result["trials"] if row["trial"] == trial]
        name = "Your own dog" if rows[0]["prototype"] else f"Design {trial}"
        if state == "not_clear":
            words += _verdict_sentence(name, record)
        elif state != "fails":
            words += f" {name} fails no check at the new angles; raise expectation.angles."
    return words


def _own_headline(lead: Goal, confirmed: Row) -> str:
    """Compose the result of a study in which no design is chosen before its own dog."""
    verdict = confirmed_verdict(confirmed)
    if verdict.state == "fails":
        words = "No design of this search is chosen before your own dog."
    else:
        superlative = "fastest" if lead.unit == "ms" else "best"
        that = " that passes" if verdict.state == "passes" else ""
        time = lead.words(*lead.estimate(confirmed["estimates"]))
        words = f"Your own dog is the {superlative}{that}: {lead.label} {time}."
    return words + _verdict_sentence("Your own dog", confirmed)


def _verdict_sentence(subject: str, confirmed: Row) -> str:
    """Compose the sentence on a confirmed design that does not pass, with a blank before."""
    words = objection(confirmed)
    if not words:
        return ""
    state = confirmed_verdict(confirmed).state
    if state == "not_judged":
        return f" {words.capitalize()}."
    return f" {subject} {words}." if state == "fails" else f" {subject} is {words}."


def unclear(gain: float, error: float) -> bool:
    """Check that a difference is within two standard errors, hangs included."""
    return abs(gain) < 2.0 * error


def gained(result: Row) -> list[tuple[Goal, Pair, Pair, Pair]]:
    """Compare the simulated objectives of prototype and chosen design, as shown, with errors.

    The gain is positive where the chosen design is better. Empty before the confirmation; without
    times where one of both does not engage.
    """
    c, best = result["confirmation"], result["best"]
    if not c or best is None or best["prototype"]:
        return []
    timed = None not in (c[side][SIMULATED] for side in SIDES)
    before, after = (c[side]["estimates"] for side in SIDES)
    return [
        (goal, goal.estimate(before), goal.estimate(after), goal.estimate(c["gains"]))
        for goal in goals_of(result, SIMULATED)
        if goal.name in c["gains"] and (timed or goal.unit != "ms")
    ]


def summary_tables(study: Setup, result: Row) -> list[Table]:
    """Tabulate the designs worth a choice, and the facts about the chosen one.

    Where none passes: the nearest designs, and the checks that stop them.
    """
    if result["best"] is None:
        if not result["trials"]:
            return []
        facts = list(nearest_facts(study, result))
        tables = [nearest_table(study, result), barriers_table(result)]
        return [*tables, *([Table(("", ""), facts)] if facts else [])]
    facts = list(facts_of(study, result)) if result["confirmation"] else []
    return [alternatives_table(study, result), *([Table(("", ""), facts)] if facts else [])]


def alternatives_table(study: Setup, result: Row) -> Table:
    """Tabulate the chosen design, others of the front that pass every check, and the prototype.

    Costs are differences to the chosen design, ± one standard error.
    """
    best, confirmed = result["best"], bool(result["confirmation"])
    shown = {SIMULATED, MARGIN, *study.variables}
    goals = [goal for goal in goals_of(result, SIMULATED) if goal.name not in shown]
    own = [row for row in result["trials"] if row["prototype"]]
    rows = {row["trial"]: row for row in (best, *result["front"], *own)}
    known = {trial: searched_record(study, result, row) for trial, row in rows.items()}
    chosen, cells = known[best["trial"]], []

    def place(trial: int) -> tuple[bool, bool, float]:
        one = known[trial]
        return one is not chosen, one["prototype"], one[SIMULATED] or math.inf

    for trial in sorted(known, key=place):
        row, one = rows[trial], known[trial]
        holds = not one["verdict"]["failed"]
        passes = holds and one["confirmed"] == confirmed and not best["prototype"]
        if not passes and one is not chosen and not one["prototype"]:
            continue
        words, cost = words_of(one), difference(chosen, one)
        worst = one["worst_against_prototype"] or {"difference_s": None, "standard_error_s": None}
        repeated = (confirmation_of(result, row) or {}).get("estimates", {})
        cells.append([
            "prototype" if one["prototype"] else str(trial),
            *(minus(f"{row[name]:.4g}") for name in study.variables), words[TIME],
            words[ENGAGED], words[HANGS],
            *("-" if row.get(goal.name) is None
              else goal.pair(*goal.estimate(repeated)) if goal.name in repeated
              else goal.pair(goal.shown(row), goal.error(row)) for goal in goals),
            ms_with_error(worst["difference_s"], worst["standard_error_s"], "+"),
            *(words[column] for column in COLUMNS),
            "" if one is chosen else "-" if cost is None else ms_with_error(*cost, "+"),
        ])  # fmt: skip
    heads = (
        *(
            "design",
            *map(axis, study.variables),
            TIME,
            ENGAGED,
            HANGS,
            *(goal.title for goal in goals),
        ),
        "worst point minus prototype, ms",
        "verdict",
        "margin at statistical tolerances",
        "margin at worst-case tolerances",
        "minus chosen, ms",
    )
    looks = {0: "best"} | ({len(cells) - 1: "prototype"} if cells[-1][0] == "prototype" else {})
    first = heads.index("verdict")
    texts = (heads.index(HANGS), *range(first, first + len(COLUMNS)))
    note = (
        "Designs of the front without a negative margin at the new angles, and your own dog, the "
        "prototype; ± one standard error, that of the expected time with the error of hangs. "
        "Smallest margins, that of the landing at nominal size."
    )
    return Table(heads, cells, looks, texts, note)


def margins_for_all(row: Row) -> dict[str, float]:
    """Give the margins of a design by check, without those that sum up others."""
    return {name: m for name, m in row["margins"].items() if name not in SUMMARIES}


def _at_new_angles(result: Row, row: Row) -> Row:
    """Replace time and margins of a design by those at new angles, where it was simulated there."""
    confirmed = confirmation_of(result, row)
    if confirmed is None:
        return row
    return row | {SIMULATED: confirmed[SIMULATED], "margins": margins_of(row, confirmed)}


def nearest_designs(result: Row) -> list[Row]:
    """List the designs with the least shortfall of their worst check, and the study's own dog."""
    known = [row for row in result["trials"] if row["margins"]]
    ordered = sorted(known, key=lambda row: (-min(row["margins"].values()), row["trial"]))
    own = [row for row in ordered if row["prototype"]]
    return [*[row for row in ordered if not row["prototype"]][:BESIDE], *own]


def nearest_table(study: Setup, result: Row) -> Table:
    """Tabulate the designs that fail by least, with the checks that they fail."""
    rows, cells = nearest_designs(result), []
    for row in rows:
        confirmed = confirmation_of(result, row)
        known = confirmed or row
        words = _failed_in_search(row) if confirmed is None else objection(confirmed)
        if "engines" in row["failed"]:
            words = ", ".join(filter(None, (words, "engines disagree")))
        cells.append([
            "your own dog" if row["prototype"] else str(row["trial"]),
            *(minus(f"{row[name]:.4g}") for name in study.variables),
            ms_with_error(known[SIMULATED], known["standard_error_s"]),
            ms_with_error(known.get("engaged_mean_s"), known.get("engaged_standard_error_s")),
            hang_share(known),
            Bad(words) if words else "passes",
        ])  # fmt: skip
    heads = ("design", *map(axis, study.variables), TIME, ENGAGED, HANGS, VERDICT)
    looks = {k: "prototype" for k, row in enumerate(rows) if row["prototype"]}
    note = (
        "The designs whose worst check is short by least, at new angles where they were simulated "
        "there; ± is one standard error. A dash: not simulated, as a check fails before."
    )
    return Table(heads, cells, looks, (heads.index(VERDICT),), note)


def _failed_in_search(row: Row) -> str:
    """List the checks that a design fails by the margins of its search."""
    failed = sorted((m, name) for name, m in row["margins"].items() if m < 0.0)
    words = ", ".join(f"{check_name(name)} ({percent(margin)})" for margin, name in failed)
    return f"fails {words}" if words else ""


def barriers_table(result: Row) -> Table:
    """Tabulate the checks that stop designs, with counts and what each costs in shift time.

    The cost is the time of the fastest design that passes the check, less that of the fastest of
    all, whatever else either fails.
    """
    rows = [_at_new_angles(result, row) for row in result["trials"] if row["margins"]]
    timed = [row for row in rows if row[SIMULATED] is not None]
    margins = [margins_for_all(row) for row in rows]
    failing = Counter(name for one in margins for name, margin in one.items() if margin < 0.0)
    fastest, cells = min((row[SIMULATED] for row in timed), default=None), []
    for name, count in failing.most_common():
        alone = sum(one[name] < 0.0 and sum(m < 0.0 for m in one.values()) == 1
                    for one in margins if name in one)  # fmt: skip
        near = max(one[name] for one in margins if one.get(name, 0.0) < 0.0)
        passing = [row for row in timed if row["margins"].get(name, -1.0) >= 0.0]
        best = min(passing, key=lambda row: float(row[SIMULATED]), default=None)
        price = None if best is None or fastest is None else best[SIMULATED] - fastest
        cells.append([
            check_name(name), f"{count} of {len(rows)}", str(alone), percent(near),
            "none passes" if best is None
            else f"{in_ms(best[SIMULATED])} ({design_name(best)})",
            in_ms(price),
        ])  # fmt: skip
    heads = ("check", "designs that fail it", "fail it alone", "nearest of them",
             "fastest that passes it, ms", "costs, ms")  # fmt: skip
    note = (
        "Costs: fastest simulated design that passes the check, less the fastest of all, whatever "
        "other checks they fail. Where none passes, widen [variables] or the limit."
    )
    return Table(heads, cells, {}, (4,), note)


def nearest_verdict(study: Setup, result: Row) -> VerdictRow | None:
    """Give the verdict on the design that fails by least; None where it was not simulated."""
    for row in nearest_designs(result)[:1]:
        if confirmed := confirmation_of(result, row):
            params = {name: row[name] for name in study.variables}
            return VerdictRow(**searched_verdict(study, params, row, confirmed))
    return None


def nearest_facts(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    """List the hangs of own dog and nearest designs where none passes, and the shafts."""
    records = nearest_records(result)
    for row in nearest_designs(result):
        if (confirmed := records.get(row["trial"])) is None:
            continue
        name = "your own dog, the prototype" if row["prototype"] else design_name(row)
        yield f"hangs, {name}", hang_words(confirmed)
    yield "shafts", study.clutch.drive.text


def facts_of(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of a confirmed design; what speaks against it is marked as bad."""
    c, best = result["confirmation"], result["best"]
    names = {"prototype": "your own dog, the prototype", "best": design_name(best)}
    for side, name in names.items():
        if side == "best" and best["prototype"]:
            continue
        verdict = chosen_verdict(study, result, side)
        words = verdict.line
        yield f"verdict on {name}", words if verdict.state == "passes" else Bad(words)
    if not best["prototype"]:
        yield from _gain_facts(study, result)
    elif how := _most_failed(result):
        yield "designs that fail", how
    yield "shafts", study.clutch.drive.text
    landing = [check for check in c["best"]["checks"]
               if check["name"].endswith(LANDING) and check["margin"] is not None]  # fmt: skip
    if landing:
        least = min(landing, key=lambda check: float(check["margin"]))
        words = margin_cell(least["name"], least["margin"], least.get("margin_interval"))
        yield "smallest margin of a landing, 95 % interval", words
    if ranged := [check for check in c["best"]["checks"] if check.get("ends")]:
        worst = min(ranged, key=lambda check: float(check["margin"]))
        words = f"{margin_cell(worst['name'], worst['margin'])}, at {worst['ends']}"
        yield "at the worst end of ranges", Bad(words) if worst["margin"] < 0.0 else words
    yield from _confirmation_facts(result)
    engines = {"chosen design in Drake": c["best"].get("drake"), "audit": result.get("audit")}
    for name, found in engines.items():
        if found is not None:
            words = minus(EngineAgreement(**found).text)
            yield name, words if found["agrees"] else Bad(words)
        elif study.engine_gap:
            yield name, f"not made: {study.engine_gap}"


def chosen_verdict(study: Setup, result: Row, side: str = "best") -> VerdictRow:
    """Give the verdict on the chosen design of a confirmed result, or on the prototype."""
    confirmed, best = result["confirmation"][side], result["best"]
    params = study.prototype if side == "prototype" else {n: best[n] for n in study.variables}
    row = {"margins": {}} if side == "prototype" else best
    return VerdictRow(**searched_verdict(study, params, row, confirmed))


def _confirmation_facts(result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of the other designs that were confirmed, or not."""
    best, confirmed = result["best"], confirmed_designs(result)
    out = {trial: words for trial, words in out_at_new_angles(result).items()
           if trial != best["trial"]}  # fmt: skip
    if out:
        words = "; ".join(
            f"design {trial} {'is ' if words.startswith(UNCLEAR) else ''}{words}"
            for trial, words in out.items()
        )
        yield "designs out at the new angles", words
    for trial, one in confirmed.items():
        if one.get("agrees") is False:
            words = f"{one['errors_apart']:.1f} standard errors apart"
            yield f"search and new angles of design {trial}", Bad(words)
    if left := result["confirmation"].get("left_out"):
        yield "designs not confirmed", f"{', '.join(map(str, left))}; raise search.confirm_designs"


def _gain_facts(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of a chosen design beside the prototype."""
    c, best = result["confirmation"], result["best"]
    for goal, (before, _), _, (gain, error) in gained(result):
        words = f"{goal.difference(gain, error)} {goal.unit}".strip()
        words += minus(f" ({100 * gain / abs(before):.0f} %)") if before else ""
        words += WITHIN_ERROR * unclear(gain, error)
        yield f"gain in the {goal.label}", Bad(words) if gain < 0.0 else words
    if difference(c["prototype"], c["best"]):
        found = point_differences(c["prototype"], c["best"])
        most = max(found, key=lambda one: float(one["difference_s"]))
        slower = [one for one in found if one["difference_s"] > 0.0]
        clear = [one for one in slower
                 if one["difference_s"] >= 2.0 * (one["standard_error_s"] or math.inf)]  # fmt: skip
        words = f"{len(slower)} of {len(found)}"
        if slower:
            loss = ms_with_error(most["difference_s"], most["standard_error_s"])
            words += f" ({len(clear)} clearly), most by {loss} ms at {place_name(most)}"
        yield "operating points slower than the prototype", Bad(words) if clear else words
    yield from _hang_facts(c)
    (own, n), (other, m) = (engaged_shifts(c[key]) for key in ("best", "prototype"))
    words = f"{own} of {n} shifts; prototype {other} of {m}"
    yield "engaged at the first try", Bad(words) if own < n else words
    for side, name in SIDES.items():
        if words := quantile_words(c[side].get("quantiles") or ()):
            yield f"shift time over the life, {name}", words
    if within := best["time_within_tolerances"]:
        words = f"{1e3 * within['root_sum_square_s']:.2g} ms by root sum of squares, "
        words += f"{1e3 * within['worst_case_s']:.2g} ms at the worst"
        yield "change of the expected shift time within tolerances", words
    ends = [
        f"{label(name)} {value(name, best[name])}"
        for name, (low, high) in study.variables.items()
        if min(best[name] - low, high - best[name]) <= (name != "count") * END * (high - low)
    ]
    for other in c.get("shapes") or ():
        if less := difference(c["best"], other):
            words = f"{ms_with_error(*less, '+')} ms" + WITHIN_ERROR * unclear(*less)
            words += _shape_state(other)
            yield f"with {other['shape']}", words
    if ends:
        yield "at the end of the search range", Bad(f"{', '.join(ends)}; widen [variables]")


def _shape_state(shape: Row) -> str:
    """Name the state of another shape unless it passes; earlier results have no verdict of it."""
    if verdict := shape.get("verdict"):
        return "" if verdict["state"] == "passes" else f", {verdict['line']}"
    return "" if shape["feasible"] else ", fails a check"


def _hang_facts(confirmation: Row) -> Iterator[tuple[str, str]]:
    """List both parts of the expected times; results of earlier versions have none."""
    for side, name in SIDES.items():
        if confirmation[side].get("hang_probability") is not None:
            yield f"mean of engaged shifts, {name}", engaged_text(confirmation[side])
            yield f"hangs, {name}", hang_words(confirmation[side])


def _most_failed(result: Row) -> str:
    """Name the checks that most designs fail, and by how much the nearest of them does.

    Of the smallest margin within the tolerances the check behind it is named, where it is stored.
    """
    every = []
    for row in result["trials"]:
        behind = {n: row.get(f"weakest_check_{kind}") for n, kind in WITHIN.items()}
        names = {n: f"{check_name(b or n)} {WITHIN_WORDS[n]}" for n, b in behind.items()}
        every.append({names.get(n, check_name(n)): m for n, m in row["margins"].items()})
    return failing_words(every)
