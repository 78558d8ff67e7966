"""The report of a study: sections of tables and figures, and the files that it is written with."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from markupsafe import Markup

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.drawing import dimensioned_svg, open_section_svg
from dogshape.pipeline.progress import Say
from dogshape.pipeline.record import Bad, Table, percent, tabulate
from dogshape.pipeline.reports.charts import (
    ENTRY_NOTE,
    effects_figure,
    front_figure,
    shiftability_figure,
    times_by_point,
)
from dogshape.pipeline.reports.data_sheet import (
    ENGAGED,
    HANGS,
    STATISTICAL_MARGIN,
    TIME,
    WORST_MARGIN,
    difference,
    hang_share,
    point_differences,
    provenance_of,
    searched_record,
    searched_verdict,
    words_of,
)
from dogshape.pipeline.reports.designs import (
    MARGIN,
    Goal,
    Row,
    confirmation_of,
    confirmed_designs,
    design_name,
    designs_frame,
    designs_shown,
    engaged_shifts,
    failed_at_new_angles,
    failed_words,
    goals_of,
    margins_of,
)
from dogshape.pipeline.reports.report import Part, Report
from dogshape.pipeline.reports.single_shifts import replays_of, write_replays
from dogshape.pipeline.reports.surrogate_findings import learn_effects, prices_table, stored_effects
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
    time_text,
    value,
)
from dogshape.pipeline.simulate.design import (
    SIMULATED,
    SUMMARIES,
    WITHIN,
    WITHIN_WORDS,
    failing_words,
)
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.pipeline.store.result_records import (
    EngineAgreement,
    LimitRow,
    PointRow,
    TorqueLimitRow,
    VerdictRow,
    hinge_table,
)
from dogshape.sim.errors import GeometryError
from dogshape.sim.files import naming, without_formulas
from dogshape.surrogate.store import Validation

BESIDE = 10  #: designs beside each other in the table of margins
END = 0.01  #: share of a search range within which a value lies at its end
LANDING = "_impact"  #: end of the names of the checks of a landing
FAILS = "fails"
#: Columns of the alternatives, of the words of a record.
COLUMNS = (
    "smallest margin, nominal size",
    STATISTICAL_MARGIN,
    WORST_MARGIN,
    "locks above friction",
)
SIDES = {"prototype": "prototype", "best": "chosen"}  #: of a confirmation, by their keys
NOT_CLEAR = " (not clear)"
Pair = tuple[float, float]


def publish(folder: StudyFolder, say: Say) -> Path:
    """Make what the report lacks, then write it; return its path.

    Effects from the surrogate take some ten seconds, the page of a shift half a second.
    """
    study, result = folder.stored_study(), folder.stored_result()
    require_targets({"the report": folder.report})
    learn_effects(folder, say)
    shown = designs_shown(result) if result["best"] else []
    write_replays(folder, study, replays_of(folder, study, shown), say)
    return write_report(folder)


def write_report(folder: StudyFolder) -> Path:
    """Write ``report.html`` and ``designs.csv`` from what the study stored; return the report."""
    study, result = folder.stored_study(), folder.stored_result()
    with naming(folder.designs):
        rows = [row for row in result["trials"] if row[SIMULATED] is not None]
        designs = designs_frame(result, [*study.variables], rows)
        without_formulas(designs).to_csv(folder.designs, index=False)
    page = Report(f"{study.name}: shape of the dogs", headline(result))
    best, effects = result["best"], stored_effects(folder)
    if best is not None:
        dog = study.dog_with({name: best[name] for name in study.variables})
        title = f"{design_name(best).capitalize()}, dimensioned section"
        section = Markup(open_section_svg(dog, study.clutch.dog, "prototype"))
        page.add("", *summary_tables(study, result), section)
        page.add("Front", *front_parts(study, result))
        if effects is not None:
            page.add("Variables", *effect_parts(effects["effects"]))
            page.add("Limits", prices_table(effects["prices"]))
        if result["confirmation"]:
            hangs_on = chosen_verdict(study, result).hangs_on
            page.add("Assumptions that decide the smallest margin", hinge_table(hangs_on))
        page.add("Operating points", *point_parts(study, result))
        page.add("Single shifts", *shift_parts(folder, study, result))
        page.add("Life", *([life_table(result["life"])] if result.get("life") else []))
        page.add("Drawing", Markup(dimensioned_svg(dog, study.limits, title)))
    elif result["trials"]:
        page.add("Nearest designs", nearest_table(study, result))
        page.add("Checks that stop them", barriers_table(result))
        page.add("Margins", margin_table(result, nearest_designs(result)))
        page.add("Front", *front_parts(study, result)[:-1])
        if effects is not None:
            page.add("Variables", *effect_parts(effects["effects"]))
            page.add("Limits", prices_table(effects["prices"]))
        for row in nearest_designs(result)[:1]:
            page.add("Drawing", *_drawing(study, row))
    file = Markup("<details><summary>Study file as it was run</summary><pre>{}</pre></details>")
    run = json.dumps(study.file.model_dump(exclude_none=True), indent=1, ensure_ascii=False)
    page.add("Provenance", provenance_table(folder, study, result), file.format(run))
    page.save(folder.report)
    return folder.report


def _drawing(study: Setup, row: Row) -> list[Part]:
    """Draw a design that fails a check; nothing where the shape is impossible."""
    try:
        dog = study.dog_with({name: row[name] for name in study.variables})
    except GeometryError:
        return []
    title = f"{design_name(row).capitalize()}, nearest to passing every check"
    return [Markup(dimensioned_svg(dog, study.limits, title))]


def headline(result: Row) -> str:
    """Compose the result of a study in one sentence."""
    best, c = result["best"], result["confirmation"]
    if best is None:
        how = _most_failed(result)
        return f"No design of this search passes every check{f': {how}' if how else ''}."
    name, lead, gains = design_name(best), goals_of(result)[0], gained(result)
    if not c:
        timed = best[SIMULATED] is not None
        words = lead.words(lead.shown(best), lead.error(best)) if timed else "no time"
        return f"Best so far, not confirmed: {name}, {lead.label} {words}."
    failed = failed_words(c["best"])
    fails = f", but fails {failed} at the new angles" if failed else ""
    if best["prototype"]:
        if fails:
            return f"No design of this search is chosen before your own dog{fails}."
        superlative = "fastest" if lead.unit == "ms" else "best"
        words = lead.words(*lead.estimate(c["best"]["estimates"]))
        return f"Your own dog is the {superlative} that passes: {lead.label} {words}."
    words = " engages in {} of {} shifts".format(*engaged_shifts(c["best"]))
    if gains and gains[0][0] == lead:
        _, before, after, gain = gains[0]
        words = f": {lead.label} {lead.words(*after)}"
        if own_failed := failed_words(c["prototype"]):
            return (f"{name.capitalize()}{words}{fails}; your own dog has {lead.words(*before)}, "
                    f"but fails {own_failed}.")  # fmt: skip
        than = ", not clearly better than" if unclear(*gain) else " instead of"
        words += f"{than} {lead.words(*before)} of your own dog"
    return f"{name.capitalize()}{words}{fails}."


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
        return [nearest_table(study, result), barriers_table(result)] if result["trials"] else []
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
        passes = one["passes"] and one["confirmed"] == confirmed and not best["prototype"]
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
        *("worst point minus prototype, ms", *COLUMNS, "minus chosen, ms"),
    )
    looks = {0: "best"} | ({len(cells) - 1: "prototype"} if cells[-1][0] == "prototype" else {})
    texts = [heads.index(column) for column in COLUMNS]
    note = "Designs of the front that pass every check at the new angles; ± one standard error, "
    note += "that of the expected time with the error of hangs."
    return Table(heads, cells, looks, texts, note)


def margins_for_all(row: Row) -> dict[str, float]:
    """Give the margins of a design by check, without those that sum up others."""
    return {name: m for name, m in row["margins"].items() if name not in SUMMARIES}


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
        failed = sorted((m, name) for name, m in row["margins"].items() if m < 0.0)
        words = ", ".join(f"{check_name(name)} ({percent(margin)})" for margin, name in failed)
        if "engines" in row["failed"]:
            words = ", ".join(filter(None, (words, "engines disagree")))
        cells.append([
            "your own dog" if row["prototype"] else str(row["trial"]),
            *(minus(f"{row[name]:.4g}") for name in study.variables),
            ms_with_error(row[SIMULATED], row["standard_error_s"]),
            ms_with_error(row.get("engaged_mean_s"), row.get("engaged_standard_error_s")),
            hang_share(row),
            Bad(words) if words else "none",
        ])  # fmt: skip
    heads = ("design", *map(axis, study.variables), TIME, ENGAGED, HANGS, FAILS)
    looks = {k: "prototype" for k, row in enumerate(rows) if row["prototype"]}
    note = (
        "The designs whose worst check is short by least, at the angles of the search; "
        "± is one standard error. A dash: not simulated, as a check fails before."
    )
    return Table(heads, cells, looks, (heads.index(FAILS),), note)


def barriers_table(result: Row) -> Table:
    """Tabulate the checks that stop designs, with counts and what each costs in shift time.

    The cost is the time of the fastest design that passes the check, less that of the fastest of
    all, whatever else either fails.
    """
    rows = [row for row in result["trials"] if row["margins"]]
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


def facts_of(study: Setup, result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of a confirmed design; what speaks against it is marked as bad."""
    c, best = result["confirmation"], result["best"]
    for side, name in SIDES.items():
        words = chosen_verdict(study, result, side).line
        yield f"verdict on the {name}", words if words.startswith("passes") else Bad(words)
    if not best["prototype"]:
        yield from _gain_facts(study, result)
    elif how := _most_failed(result):
        yield "designs that fail", how
    yield "shafts", study.clutch.drive.text
    if landing := [m for m in margins_of(best, c["best"]).items() if m[0].endswith(LANDING)]:
        yield "hardest landing at the new angles", margin_cell(*min(landing, key=lambda m: m[1]))
    if ranged := [check for check in c["best"]["checks"] if check.get("ends")]:
        worst = min(ranged, key=lambda check: float(check["margin"]))
        words = f"{margin_cell(worst['name'], worst['margin'])}, at {worst['ends']}"
        yield "at the worst end of ranges", Bad(words) if worst["margin"] < 0.0 else words
    if words := failed_words(c["best"]):
        yield "fails at the new angles", Bad(words)
    yield from _confirmation_facts(result)
    engines = {"chosen design in Drake": c["best"].get("drake"), "audit": result.get("audit")}
    for name, found in engines.items():
        if found is not None:
            words = minus(EngineAgreement(**found).text)
            yield name, words if found["agrees"] else Bad(words)
        elif study.unjudged:
            yield name, f"not made: {study.unjudged}"


def chosen_verdict(study: Setup, result: Row, side: str = "best") -> VerdictRow:
    """Give the verdict on the chosen design of a confirmed result, or on the prototype."""
    confirmed, best = result["confirmation"][side], result["best"]
    params = study.prototype if side == "prototype" else {n: best[n] for n in study.variables}
    row = {"margins": {}} if side == "prototype" else best
    return VerdictRow(**searched_verdict(study, params, row, confirmed))


def _confirmation_facts(result: Row) -> Iterator[tuple[str, str]]:
    """List the facts of the other designs that were confirmed, or not."""
    best, confirmed = result["best"], confirmed_designs(result)
    failed = [trial for trial in failed_at_new_angles(result) if trial != best["trial"]]
    if out := [f"design {trial}: {failed_words(confirmed[trial])}" for trial in failed]:
        yield "designs out, failed at the new angles", "; ".join(out)
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
        words = goal.words(gain, error)
        words += minus(f" ({100 * gain / abs(before):.0f} %)") if before else ""
        words += NOT_CLEAR * unclear(gain, error)
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
        yield "shift time within tolerances", f"± {in_ms(within['root_sum_square_s'])} ms"
    ends = [
        f"{label(name)} {value(name, best[name])}"
        for name, (low, high) in study.variables.items()
        if min(best[name] - low, high - best[name]) <= (name != "count") * END * (high - low)
    ]
    for other in c.get("shapes") or ():
        if less := difference(c["best"], other):
            words = f"{ms_with_error(*less, '+')} ms" + NOT_CLEAR * unclear(*less)
            words += "" if other["feasible"] else ", but fails a check"
            yield f"with {other['shape']}", words
    if ends:
        yield "at the end of the search range", Bad(f"{', '.join(ends)}; widen [variables]")


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


def front_parts(study: Setup, result: Row) -> list[Part]:
    """Build the figures of the front, the table of all designs and that of every margin."""
    variables, trials = list(study.variables), result["trials"]
    others = [goal.name for goal in goals_of(result)[1:]] or [MARGIN]
    barred = sum(row[SIMULATED] is None for row in trials)
    words = f"All {result['n_simulated_designs']} simulated designs with every column (CSV)"
    return [
        *(front_figure(result, variables, name) for name in others),
        "Front: designs that no other beats in every objective, with their numbers. Bars: 95 % "
        "intervals, at the new angles once confirmed; marks without bars: times of the search. "
        f"Designs far off lie outside; {barred} of {len(trials)} failed before simulation.",
        Markup('<p class="note"><a href="designs.csv">{}</a></p>').format(words),
        margin_table(result),
    ]  # fmt: skip


def margin_table(result: Row, designs: Sequence[Row] = ()) -> Table:
    """Tabulate every margin of the prototype and the first designs of the front, by the search.

    ``designs`` are others to show.
    """
    shown = list(designs) or designs_shown(result)[:BESIDE]
    every = [row["margins"] for row in shown]
    names = dict.fromkeys(name for margins in every for name in margins)
    rows = [[check_name(n), *(margin_cell("", one.get(n)) for one in every)] for n in names]
    heads = ["prototype" if row["prototype"] else str(row["trial"]) for row in shown]
    note = f"Distance to the limit over the limit, at nominal size, by the search; {BESIDE} designs"
    return Table(("margin", *heads), rows, note=f"{note} at most, the CSV has all.")


def effect_parts(effects: Row) -> list[Part]:
    """Build the figure of the variables; empty where most of it would be extrapolated."""
    if effects["outside_trained_range"] > 0.5:
        return []
    outside = percent(effects["outside_trained_range"])
    return [
        effects_figure(effects),
        f"Accumulated local effects over {effects['designs']} designs that pass every check, "
        f"{outside} of them outside the trained range; zero is their mean, "
        f"{time_text(effects['mean_expected_shift_time_s'])}. Bands hold 95 %.",
    ]


def point_parts(study: Setup, result: Row) -> list[Part]:
    """Build the figures of the operating points; empty before the confirmation.

    Points of a design that is operated in its own way are named as those of the prototype.
    """
    c = result["confirmation"]
    if not c or result["best"]["prototype"]:
        return []
    rows = [
        own | {"chosen_s": one["mean_s"], "chosen_error_s": one["standard_error_s"]}
        for own, one in zip(c["prototype"]["points"], c["best"]["points"], strict=True)
    ]
    sides = {"prototype": ("mean_s", "standard_error_s"), "chosen": ("chosen_s", "chosen_error_s")}
    caption = "At the new angles, retries included; bars are 95 % intervals."
    parts: list[Part] = [times_by_point(rows, sides), caption]
    if all(point.get("shiftability") for key in SIDES for point in c[key]["points"]):
        own = study.clutch.dog.count
        counts = {"prototype": own, "best": result["best"].get("count", own)}
        entries = {name: (c[key]["points"], counts[key]) for key, name in SIDES.items()}
        parts += [shiftability_figure(entries), ENTRY_NOTE, *_entry_tables(c)]
    return parts


def _entry_tables(confirmation: Row) -> list[Table]:
    """Tabulate direct entries beside their closed form, and limits of speed and torque."""
    tables: list[Table] = []
    for side, name in SIDES.items():
        points = [PointRow(**point) for point in confirmation[side]["points"]]
        entries = [(point, point.shiftability) for point in points]
        cells = [
            [
                *(point.cell(key) for key in ("mismatch_rpm", "force_N")),
                *(percent(share) for share in (entry.direct, entry.direct_closed_form)),
            ]
            for point, entry in entries
            if entry is not None and entry.direct_closed_form is not None
        ]
        if cells:
            heads = (axis("mismatch_rpm"), axis("force_N"), "direct entry", "closed form")
            tables.append(Table(heads, cells, note=f"Direct entry, {name}."))
        limits = [LimitRow(**limit) for limit in confirmation[side].get("engagement_limits") or ()]
        if limits:
            table = tabulate(LimitRow, limits)
            tables.append(replace(table, note=f"Limit engagement speed, {name}; 95 % interval."))
        rows = confirmation[side].get("engagement_torque_limits") or ()
        if torque_rows := [TorqueLimitRow(**row) for row in rows]:
            table = tabulate(TorqueLimitRow, torque_rows)
            tables.append(replace(table, note=f"Limit engagement torque, {name}; 95 % interval."))
    return tables


def shift_parts(folder: StudyFolder, study: Setup, result: Row) -> list[Part]:
    """Build the table of the fastest and slowest shifts, linked where their pages are."""
    cells: dict[str, list[str]] = {}
    for one in replays_of(folder, study, designs_shown(result)):
        there = (folder.root / one.path).is_file()
        linked = Markup('<a href="{}">{}</a>').format(one.path, one.words)
        cells.setdefault(one.design, [one.design]).append(linked if there else one.words)
    note = "Each link opens an animation with its curves, in shifts beside this report."
    heads = ("design", "fastest shift", "slowest shift")
    return [Table(heads, list(cells.values()), {}, (1, 2), note)] if cells else []


def life_table(stages: list[Row]) -> Table:
    """Tabulate the drift of the chosen design over its life."""
    heads = (
        "share of the life", "crest loss, µm", "chamfer left, °", "edge radius, mm",
        TIME, "engaged", "smallest margin",
    )  # fmt: skip
    rows = [
        [
            percent(one["life"]), f"{1e3 * one['crest_loss_mm']:.3g}", f"{one['chamfer_deg']:.4g}",
            f"{one.get('edge_radius_mm', 0.0):.3g}",
            ms_with_error(one[SIMULATED], one["standard_error_s"]), f"{100 * one['engaged']:.1f} %",
            margin_cell(one["weakest_check"], one["smallest_margin"]),
        ]
        for one in stages
    ]  # fmt: skip
    note = "Wear as [wear] of the study gives it. Edges stay sharp in the simulation."
    return Table(heads, rows, note=note)


def provenance_table(folder: StudyFolder, study: Setup, result: Row) -> Table:
    """Tabulate command, dates, numerical error, surrogate and versions."""
    fitted, now = result["surrogate"], datetime.now(UTC)
    numerical = (result["confirmation"] or {"best": {}})["best"].get("numerical_error_s")
    stored = datetime.fromtimestamp(folder.result.stat().st_mtime, UTC)
    judged = "none: it needs a finished search with at least ten simulated designs"
    if fitted:
        judged = (
            f"Q² {fitted['q2']:.2f}, root-mean-square error {time_text(fitted['rmse_s'])}, "
            f"{percent(fitted['coverage_95'])} within the 95 % interval, on {fitted['n']} designs "
            f"({fitted['source']})"
        )
        judged = judged if Validation(**fitted).useful else Bad(f"{judged}: useless")
    facts = {
        **provenance_of(study, result),
        "dates (UTC)": f"result stored {stored:%Y-%m-%d}, report written {now:%Y-%m-%d}",
        "numerical error": "" if numerical is None else f"{1e3 * numerical:.2g} ms",
        "surrogate": judged,
    }
    return Table(("", ""), [pair for pair in facts.items() if pair[1]])
