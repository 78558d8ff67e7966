"""The report of a study: sections of tables and figures, and the files that it is written with."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import plotly.graph_objects as go
from markupsafe import Markup

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.drawing import dimensioned_svg, section_svg
from dogshape.pipeline.record import Bad, Table
from dogshape.pipeline.reports.charts import BLUE, INK, MARKS, Row, styled, times_by_point, window
from dogshape.pipeline.reports.data_sheet import ms_or_dash, provenance_of
from dogshape.pipeline.reports.designs import (
    MARGIN,
    design_name,
    designs_shown,
    goals_of,
    is_measured,
    of_kinds,
    simulated_frame,
)
from dogshape.pipeline.reports.prices import prices_table
from dogshape.pipeline.reports.provenance import dates_of
from dogshape.pipeline.reports.report import Report, link
from dogshape.pipeline.reports.single_shifts import Shifts, read_shifts, replays_of, write_replays
from dogshape.pipeline.reports.study_summary import headline, margin_cell, summary_tables
from dogshape.pipeline.reports.text import axis, check_name, percent, time_text
from dogshape.pipeline.reports.variable_effects import effects_figure, learn_effects, stored_effects
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.sim.files import naming
from dogshape.surrogate.validation_figures import Validation

Say = Callable[[str], None]
BESIDE = 10  #: designs beside each other in the table of margins
NAMED = ("front", "chosen", "prototype")  #: kinds of designs that have a name and error bars


def publish(folder: StudyFolder, say: Say) -> Path:
    """Make what the report lacks, then write it; return its path.

    Effects from the surrogate take a minute, the page of a shift half a second each.
    """
    study, result = folder.stored_study(), folder.stored_result()
    require_targets({"the report": folder.report})
    learn_effects(folder, say)
    shifts = read_shifts(folder, study)
    pairs = replays_of(shifts, designs_shown(result) if result["best"] else [])
    write_replays(folder, shifts, [one for pair in pairs for one in pair], say)
    return write_report(folder, shifts)


def write_report(folder: StudyFolder, shifts: Shifts | None = None) -> Path:
    """Write ``report.html`` and ``designs.csv`` from what the study stored; return the report."""
    study, result = folder.stored_study(), folder.stored_result()
    shifts = shifts or read_shifts(folder, study)
    with naming(folder.designs):
        simulated_frame(result, list(study.variables)).to_csv(folder.designs, index=False)
    report_of(folder, study, result, shifts).save(folder.report)
    return folder.report


def report_of(folder: StudyFolder, study: Setup, result: Row, shifts: Shifts) -> Report:
    """Build the report of a study."""
    result = at_own_places(study, result)
    page = Report(f"{study.name}: shape of the dogs", headline(result))
    best, confirmation = result["best"], result["confirmation"]
    page.add("", *summary_tables(study, result), _sections(study, best))
    if best is not None:
        _add_front(page, study, result)
        _add_limits(page, folder)
        if confirmation and not best["prototype"]:
            sides = {"prototype": confirmation["prototype"]["points"],
                     "chosen": confirmation["best"]["points"]}  # fmt: skip
            page.add(
                "Operating points",
                times_by_point(sides),
                "At the new angles, retries included; bars are 95 % intervals.",
            )
        page.add(
            "Single shifts",
            _replay_table(folder, shifts, result),
            "Each link opens an animation with its curves, in shifts beside this report.",
        )
        page.add("Life", life_table(result["life"]) if result.get("life") else None)
        dog = study.dog_with({name: best[name] for name in study.variables})
        title = f"{design_name(best).capitalize()}, dimensioned section"
        page.add("Drawing", Markup(dimensioned_svg(dog, study.limits, title)))
    file = Markup("<details><summary>Study file as it was run</summary><pre>{}</pre></details>")
    facts = _provenance(folder, study, result)
    run = json.dumps(study.file.model_dump(exclude_none=True), indent=1, ensure_ascii=False)
    page.add("Search and provenance", Table(("", ""), facts), file.format(run))
    return page


def _add_front(page: Report, study: Setup, result: Row) -> None:
    variables, trials = list(study.variables), result["trials"]
    others = [goal.name for goal in goals_of(result)[1:]] or [MARGIN]
    barred = sum(row[SIMULATED] is None for row in trials)
    page.add(
        "Front",
        *(front_figure(result, variables, name) for name in others),
        "No design beats one of the front, named by its number, in every objective. Bars are 95 % "
        "intervals. Point at a mark to read its design; designs far off lie outside the axes.",
        link(
            simulated_frame(result, variables).to_csv(index=False), "text/csv",
            f"{study.name}-designs.csv",
            f"All {result['n_simulated_designs']} simulated designs with every column (CSV)",
        ),
        f"{barred} of {len(trials)} proposed designs failed a check and were not simulated.",
        margin_table(result),
    )  # fmt: skip


def front_figure(result: Row, variables: list[str], other: str) -> go.Figure:
    """Draw the leading objective against another one; designs far from the front are left out."""
    kinds, goals = of_kinds(result), goals_of(result, SIMULATED, other)
    lead, second = goals[0], next(goal for goal in goals if goal.name == other)
    drawn = {kind: [row for row in rows if is_measured(row)] for kind, rows in kinds.items()}
    figure, near = go.Figure(), [row for kind in NAMED for row in drawn[kind]]
    if len(result["objectives"]) == 2:  # what the front dominates lies right of and above it
        figure.add_scatter(
            x=[lead.shown(row) for row in result["front"]],
            y=[second.shown(row) for row in result["front"]],
            mode="lines", line={"color": BLUE, "shape": "hv", "width": 1.5},
            showlegend=False, hoverinfo="skip",
        )  # fmt: skip
    ends = [window([goal.shown(row) for row in near]) if near else None for goal in (lead, second)]
    for kind, rows in drawn.items():
        if not rows:
            continue
        trace = go.Scatter(
            x=[lead.shown(row) for row in rows], y=[second.shown(row) for row in rows],
            customdata=[row["trial"] for row in rows], name=kind, mode="markers",
            marker=MARKS[kind], hoverinfo="text",
            hovertext=[
                "<br>".join([
                    f"<b>{design_name(row)}</b>",
                    *(f"{axis(name)}: {row[name]:.4g}" for name in variables),
                    *(f"{goal.label} {goal.words(goal.shown(row), goal.error(row))}"
                      for goal in goals if row.get(goal.name) is not None),
                    *(f"fails {check_name(name)}" for name in row["failed"]),
                ])
                for row in rows
            ],
        )  # fmt: skip
        if kind in NAMED:
            look = {"thickness": 1.2, "width": 3, "color": INK}
            names = [f"<b>{kind}</b>" if kind != "front" else str(row["trial"]) for row in rows]
            left = [ends[0] and lead.shown(row) > sum(ends[0]) / 2 for row in rows]
            trace.update(
                mode="markers+text", text=names,
                textposition=["top left" if one else "top right" for one in left],
                error_x={"array": [1.96 * lead.error(row) for row in rows], **look},
                error_y={"array": [1.96 * second.error(row) for row in rows], **look},
            )  # fmt: skip
        figure.add_trace(trace)
    figure.update_xaxes(title=lead.title, range=ends[0])
    figure.update_yaxes(title=second.title, range=ends[1])
    return styled(figure, 480)


def _short_name(row: Row) -> str:
    return "prototype" if row["prototype"] else str(row["trial"])


def margin_table(result: Row) -> Table:
    """Tabulate every margin of the prototype and the first designs of the front, by the search."""
    every = designs_shown(result)
    shown = every[:BESIDE]
    names = dict.fromkeys(name for row in shown for name in row["margins"])
    margins = [[row["margins"].get(name) for row in shown] for name in names]
    rows = [
        [check_name(name),
         *("" if m is None else Bad(percent(m)) if m < 0.0 else percent(m) for m in of_check)]
        for name, of_check in zip(names, margins, strict=True)
    ]  # fmt: skip
    note = "Distance to the limit over the limit, at nominal size, by the search."
    note += f" The first {BESIDE} designs; the CSV has all." if len(every) > BESIDE else ""
    return Table(("margin", *map(_short_name, shown)), rows, note=note)


def _add_limits(page: Report, folder: StudyFolder) -> None:
    known = stored_effects(folder)
    if known is None:
        return
    effects = known["effects"]
    if effects["outside_trained_range"] <= 0.5:
        page.add(
            "Variables",
            effects_figure(effects),
            f"Accumulated local effects over {effects['designs']} designs that pass every check, "
            f"{percent(effects['outside_trained_range'])} of them outside the trained range; zero "
            f"is their mean, {time_text(effects['mean_expected_shift_time_s'])}. Bands hold 95 %.",
        )
    page.add("Limits", prices_table(known["prices"]))


def _replay_table(folder: StudyFolder, shifts: Shifts, result: Row) -> Table | None:
    rows = [
        [pair[0].design, *(
            Markup('<a href="{}">{}</a>').format(one.path, one.words)
            if (folder.root / one.path).is_file() else one.words for one in pair
        )]
        for pair in replays_of(shifts, designs_shown(result))
    ]  # fmt: skip
    return Table(("design", "fastest shift", "slowest shift"), rows, {}, (1, 2)) if rows else None


def life_table(stages: list[Row]) -> Table:
    """Tabulate the drift of the chosen design over its life."""
    heads = (
        "share of the life", "crest loss, µm", "chamfer left, °", "edge radius, mm",
        "expected shift time, ms", "engaged", "smallest margin",
    )  # fmt: skip
    rows = [
        [
            percent(one["life"]), f"{1e3 * one['crest_loss_mm']:.3g}", f"{one['chamfer_deg']:.4g}",
            f"{one.get('edge_radius_mm', 0.0):.3g}",
            ms_or_dash(one["expected_shift_time_s"], one["standard_error_s"]),
            f"{one['engaged']:.1%}", margin_cell((one["weakest_check"], one["smallest_margin"])),
        ]
        for one in stages
    ]  # fmt: skip
    note = "Wear as [wear] of the study gives it. Edges stay sharp in the simulation."
    return Table(heads, rows, note=note)


def _sections(study: Setup, best: Row | None) -> Markup:
    """Draw prototype and chosen design to one scale."""
    span = 2.4 * study.clutch.dog.pitch
    drawn = section_svg(study.clutch.dog, "Prototype", span)
    if best is not None and not best["prototype"]:
        dog = study.dog_with({name: best[name] for name in study.variables})
        drawn += section_svg(dog, f"Design {best['trial']}", span)
    return Markup('<div class="drawings">{}</div>').format(Markup(drawn))


def _provenance(folder: StudyFolder, study: Setup, result: Row) -> list[tuple[str, str]]:
    fitted, c, search = result["surrogate"], result["confirmation"] or {}, study.file.search
    judged = "none: it needs a finished search with at least ten simulated designs"
    if fitted:
        judged = (
            f"Q² {fitted['q2']:.2f}, root-mean-square error {time_text(fitted['rmse_s'])}, "
            f"{fitted['coverage_95']:.0%} within the 95 % interval, on {fitted['n']} designs "
            f"({fitted['source']})"
        )
        judged = judged if Validation.from_dict(fitted).useful else Bad(f"{judged}: useless")
    solver, numerical = study.clutch.solver, (c.get("best") or {}).get("numerical_error_s")
    facts = {
        **provenance_of(study, result),
        "dates": dates_of(folder.result),
        "search": f"{search.sampler}, {len(result['trials'])} designs, seed {search.seed}, "
        f"{study.file.expectation.angles} angles",
        "angles in Drake too": str(c.get("drake_angles") or ""),
        "numerical error": "" if numerical is None else f"{1e3 * numerical:.2g} ms",
        "surrogate": judged,
        "uncertain": "; ".join(
            f"{name.replace('_', ' ')} {text}"
            for name, text in (study.uncertainty.source if study.uncertainty else ())
        ),
        "solver": f"{solver.scheme}, accuracy {solver.accuracy}, steps up to "
        f"{1e3 * solver.max_step} ms",
        "retry": f"time-out {study.clutch.timeout} s and retraction {study.retraction} s",
    }
    return [pair for pair in facts.items() if pair[1]]


def at_own_places(study: Setup, result: Row) -> Row:
    """Name the points of a design that is operated in its own way as those of the prototype.

    The n-th point of either is the same one of the study, moved by set-point and force.
    """
    confirmation = result["confirmation"]
    if not study.searches_operation or confirmation is None:
        return result
    keys = ("mismatch_rpm", "force_N")
    named = [{key: p[key] for key in keys} for p in confirmation["prototype"]["points"]]
    best = confirmation["best"]
    points = [{**p, **own} for p, own in zip(best["points"], named, strict=True)]
    return {**result, "confirmation": {**confirmation, "best": {**best, "points": points}}}
