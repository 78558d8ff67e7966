"""The report of a study: sections of tables and figures, and the files that it is written with."""

from __future__ import annotations

import json
from collections.abc import Sequence
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
    assumptions_figure,
    effects_figure,
    front_figure,
    shiftability_figure,
    times_by_point,
)
from dogshape.pipeline.reports.data_sheet import (
    TIME,
    provenance_of,
)
from dogshape.pipeline.reports.designs import (
    MARGIN,
    Row,
    confirmation_of,
    design_name,
    designs_frame,
    designs_shown,
    goals_of,
    margin_intervals,
    margins_of,
    of_kinds,
)
from dogshape.pipeline.reports.report import Part, Report
from dogshape.pipeline.reports.single_shifts import replays_of, write_replays
from dogshape.pipeline.reports.study_summary import (
    BESIDE,
    SIDES,
    barriers_table,
    chosen_verdict,
    headline,
    nearest_designs,
    nearest_table,
    nearest_verdict,
    summary_tables,
)
from dogshape.pipeline.reports.surrogate_findings import learn_effects, prices_table, stored_effects
from dogshape.pipeline.reports.text import (
    axis,
    check_name,
    margin_cell,
    ms_with_error,
    time_text,
)
from dogshape.pipeline.simulate.design import (
    SIMULATED,
)
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.pipeline.store.result_records import (
    LimitRow,
    PointRow,
    TorqueLimitRow,
    VerdictRow,
    hinge_table,
)
from dogshape.sim.errors import GeometryError
from dogshape.sim.files import naming, without_formulas
from dogshape.surrogate.store import Validation

HINGES_TITLE = "Assumptions that decide the smallest margin"


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
            page.add(HINGES_TITLE, *hinge_parts(chosen_verdict(study, result)))
        page.add("Operating points", *point_parts(study, result))
        page.add("Single shifts", *shift_parts(folder, study, result))
        page.add("Life", *([life_table(result["life"])] if result.get("life") else []))
        page.add("Drawing", Markup(dimensioned_svg(dog, study.limits, title)))
    elif result["trials"]:
        page.add("Nearest designs", nearest_table(study, result))
        page.add("Checks that stop them", barriers_table(result))
        page.add("Margins", margin_table(result, nearest_designs(result)))
        if verdict := nearest_verdict(study, result):
            page.add(HINGES_TITLE, *hinge_parts(verdict))
        if any(of_kinds(result).values()):
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


def hinge_parts(verdict: VerdictRow) -> list[Part]:
    """Build tornado and table of the assumptions of a verdict; empty where none has an effect."""
    if not verdict.hangs_on:
        return []
    return [assumptions_figure(verdict.hangs_on), hinge_table(verdict.hangs_on)]


def _drawing(study: Setup, row: Row) -> list[Part]:
    """Draw a design that fails a check; nothing where the shape is impossible."""
    try:
        dog = study.dog_with({name: row[name] for name in study.variables})
    except GeometryError:
        return []
    title = f"{design_name(row).capitalize()}, nearest to passing every check"
    return [Markup(dimensioned_svg(dog, study.limits, title))]


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
    """Tabulate every margin of the prototype and the first designs of the front.

    At the new angles where a design was simulated there; ``designs`` are others to show.
    """
    shown = list(designs) or designs_shown(result)[:BESIDE]
    records = [confirmation_of(result, row) for row in shown]
    every = [margins_of(row, record) for row, record in zip(shown, records, strict=True)]
    intervals = [margin_intervals(record) for record in records]
    names = dict.fromkeys(name for margins in every for name in margins)
    rows = [
        [
            check_name(name),
            *(
                margin_cell("", margins.get(name), ends.get(name))
                for margins, ends in zip(every, intervals, strict=True)
            ),
        ]
        for name in names
    ]
    heads = ["prototype" if row["prototype"] else str(row["trial"]) for row in shown]
    note = (
        "Distance to the limit over the limit, at nominal size; at the new angles where a design "
        f"was simulated there, with the 95 % interval of a landing. {BESIDE} designs at most, the "
        "CSV has all, by the search."
    )
    return Table(("margin", *heads), rows, note=note)


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
