"""The report of a study: sections of tables and figures, and the files that it is written with."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from markupsafe import Markup

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.drawing import open_section_svg, ring_drawings
from dogshape.pipeline.progress import Say
from dogshape.pipeline.record import Bad, Table, percent, tabulate
from dogshape.pipeline.reports.charts import (
    ENTRY_NOTE,
    TimeMark,
    assumptions_figure,
    effects_figure,
    front_figure,
    shiftability_figure,
    times_by_point,
)
from dogshape.pipeline.reports.data_sheet import ASSUMED_TITLE, TIME, provenance_of
from dogshape.pipeline.reports.designs import (
    MARGIN,
    OWN_DOG,
    confirmation_of,
    confirmed_verdict,
    design_head,
    design_name,
    designs_frame,
    designs_shown,
    goals_of,
    margin_intervals,
    margins_of,
    of_kinds,
)
from dogshape.pipeline.reports.headline import compare_objectives, headline, sides_of
from dogshape.pipeline.reports.report import Part, Report, title_table, title_values
from dogshape.pipeline.reports.single_shifts import replays_of, write_replays
from dogshape.pipeline.reports.study_summary import (
    MAX_DESIGNS,
    barriers_table,
    chosen_verdict,
    nearest_designs,
    nearest_table,
    nearest_verdict,
    summary_tables,
)
from dogshape.pipeline.reports.surrogate_findings import (
    Effects,
    learn_effects,
    prices_table,
    stored_effects,
)
from dogshape.pipeline.reports.text import (
    axis,
    bind_units,
    check_name,
    margin_cell,
    ms_with_error,
    time_text,
)
from dogshape.pipeline.search.study_record import (
    Confirmation,
    DesignRow,
    StudyRecord,
    read_study_record,
)
from dogshape.pipeline.simulate.evaluation import LifeStage
from dogshape.pipeline.store.check_records import VerdictRow, assumed_table, hinge_table
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.pipeline.store.result_records import LimitRow, TorqueLimitRow
from dogshape.sim.errors import GeometryError
from dogshape.sim.files import name_file_in_errors, without_formulas
from dogshape.sim.strength.checks import RULES
from dogshape.sim.strength.verdict import WORDS
from dogshape.surrogate.store import Validation

NO_BLOCK: Mapping[str, str] = {}
HINGES_TITLE = "Assumptions that decide the smallest margin"


def publish(folder: StudyFolder, say: Say, block: Mapping[str, str] = NO_BLOCK) -> Path:
    """Complete effects and shift pages of a study, then write its report; return the path.

    ``block`` has values of the title block; InputError for other keys. Effects from the surrogate
    take some ten seconds, the page of a shift half a second.
    """
    title = title_values(block)
    study = folder.stored_study()
    result = read_study_record(folder)
    require_targets({"the report": folder.report})
    learn_effects(folder, say)
    designs = designs_shown(result) if result.best else []
    write_replays(folder, study, replays_of(folder, study, designs), say)
    return write_report(folder, title)


def write_report(folder: StudyFolder, block: Mapping[str, str] = NO_BLOCK) -> Path:
    """Write ``report.html`` and ``designs.csv`` of a stored study; return the report's path."""
    study = folder.stored_study()
    result = read_study_record(folder)
    with name_file_in_errors(folder.designs):
        simulated = [row for row in result.trials if row.expected_shift_time_s is not None]
        designs = designs_frame(result, [*study.variables], simulated)
        without_formulas(designs).to_csv(folder.designs, index=False)
    page = Report(f"{study.name}: shape of the dogs", headline(result))
    if result.best is not None:
        _add_chosen_design(page, folder, study, result, result.best)
    elif result.trials:
        _add_nearest_designs(page, folder, study, result)
    file = Markup("<details><summary>Study file as it was run</summary><pre>{}</pre></details>")
    run = json.dumps(study.file.model_dump(exclude_none=True), indent=1, ensure_ascii=False)
    provenance = provenance_table(folder, study, result)
    page.add("Provenance", title_table(title_values(block)), provenance, file.format(run))
    page.save(folder.report)
    return folder.report


def _add_chosen_design(
    page: Report, folder: StudyFolder, study: Setup, result: StudyRecord, best: DesignRow
) -> None:
    """Add the sections of a study that has a chosen design."""
    params = best.params(study.variables)
    limits = study.with_design(params).limits
    pair = study.clutch_with(params).pair
    confirmation = result.confirmation
    is_sleeve = limits.sleeve is not None
    section = Markup(open_section_svg(pair, study.clutch.pair, OWN_DOG, is_sleeve=is_sleeve))
    alternatives, *rest = summary_tables(study, result)
    first_screen = Markup('<div class="answer">{}{}</div>')
    page.add("", first_screen.format(_answer_cards(result, best), section), alternatives)
    page.add("Chosen design", *rest)
    page.add("Front", *front_parts(study, result))
    _add_effects(page, folder)
    if confirmation is not None:
        verdict = chosen_verdict(study, best, confirmation)
        page.add(HINGES_TITLE, *hinge_parts(verdict))
        page.add(ASSUMED_TITLE, *assumed_parts(verdict))
    points = [] if confirmation is None else point_parts(study, best, confirmation)
    page.add("Operating points", *points)
    page.add("Single shifts", *shift_parts(folder, study, result))
    if result.life:
        page.add("Life", life_table(result.life))
    title = f"{design_name(best).capitalize()}, dimensioned section"
    drawings = ring_drawings(pair, limits, title)
    page.add("Drawing", *map(Markup, drawings))


def _answer_cards(result: StudyRecord, best: DesignRow) -> Markup:
    """Show the leading objective of chosen design and own dog as numbers, with their verdicts.

    Empty before the confirmation, or where the own dog is chosen.
    """
    comparisons = compare_objectives(result)
    if result.confirmation is None or not comparisons:
        return Markup("")
    goal, before, after, _ = comparisons[0]
    card = '<div class="card{}"><span>{}</span><b>{}</b><span>{}</span></div>'
    cards = []
    for name, confirmed, value, look in (
        (design_name(best), result.confirmation.best, after, " chosen"),
        (OWN_DOG, result.confirmation.prototype, before, ""),
    ):
        state = WORDS[confirmed_verdict(confirmed).state]
        label = f"{name.capitalize()}, {goal.label}"
        cards.append(Markup(card).format(look, label, bind_units(goal.words(*value)), state))
    return Markup('<div class="cards">{}</div>').format(Markup("").join(cards))


def _add_nearest_designs(
    page: Report, folder: StudyFolder, study: Setup, result: StudyRecord
) -> None:
    """Add the sections of a study in which no design passes."""
    nearest = nearest_designs(result)
    page.add("Nearest designs", nearest_table(study, result))
    page.add("Checks that stop them", barriers_table(result))
    page.add("Margins", margin_table(result, nearest))
    verdict = nearest_verdict(study, result)
    if verdict is not None:
        page.add(HINGES_TITLE, *hinge_parts(verdict))
        page.add(ASSUMED_TITLE, *assumed_parts(verdict))
    if any(of_kinds(result).values()):
        page.add("Front", *front_parts(study, result)[:-1])
    _add_effects(page, folder)
    if nearest:
        page.add("Drawing", *_drawing(study, nearest[0]))


def _add_effects(page: Report, folder: StudyFolder) -> None:
    """Add effects of variables and prices of limits, if the folder's surrogate has them."""
    effects = stored_effects(folder)
    if effects is not None:
        page.add("Variables", *effect_parts(effects.effects))
        page.add("Limits", prices_table(effects.prices))


def hinge_parts(verdict: VerdictRow) -> list[Part]:
    """Build figure and table of the assumptions of a verdict; empty without an effect."""
    if not verdict.hangs_on:
        return []
    return [assumptions_figure(verdict.hangs_on), hinge_table(verdict.hangs_on)]


def assumed_parts(verdict: VerdictRow) -> list[Part]:
    """Tabulate the values that nobody gave; empty without any."""
    return [assumed_table(verdict.assumed)] if verdict.assumed else []


def _drawing(study: Setup, design: DesignRow) -> list[Part]:
    """Draw the section of a design that fails a check; empty for an impossible shape."""
    params = design.params(study.variables)
    try:
        pair = study.clutch_with(params).pair
    except GeometryError:
        return []
    title = f"{design_name(design).capitalize()}, nearest to passing every check"
    return [*map(Markup, ring_drawings(pair, study.with_design(params).limits, title))]


def front_parts(study: Setup, result: StudyRecord) -> list[Part]:
    """Build the figures of the front, the link to all designs, and the table of margins."""
    variables = list(study.variables)
    trials = result.trials
    objectives = [goal.name for goal in goals_of(result)[1:]] or [MARGIN]
    rejected = sum(row.expected_shift_time_s is None for row in trials)
    words = f"All {result.n_simulated_designs} simulated designs with every column (CSV)"
    return [
        *(front_figure(result, variables, name) for name in objectives),
        "Front: designs that no other beats in every objective, with their numbers. Bars: 95 % "
        "intervals, at the new angles once confirmed; marks without bars: times of the search. "
        f"Designs far off lie outside; {rejected} of {len(trials)} failed before simulation.",
        Markup('<p class="note"><a href="designs.csv">{}</a></p>').format(words),
        margin_table(result),
    ]


def margin_table(result: StudyRecord, designs: Sequence[DesignRow] = ()) -> Table:
    """Tabulate all margins of designs, by default of the own dog and the first of the front.

    Margins are those at new angles if a design was simulated there.
    """
    designs = list(designs) or designs_shown(result)[:MAX_DESIGNS]
    records = [confirmation_of(result, design) for design in designs]
    margins = [
        margins_of(design.margins, record) for design, record in zip(designs, records, strict=True)
    ]
    intervals = [margin_intervals(record) for record in records]
    names = dict.fromkeys(name for design_margins in margins for name in design_margins)
    rows = []
    for name in names:
        cells = [
            margin_cell("", design_margins.get(name), design_intervals.get(name))
            for design_margins, design_intervals in zip(margins, intervals, strict=True)
        ]
        references = RULES[name].references if name in RULES else ""
        rows.append([check_name(name), references, *cells])
    heads = [design_head(design) for design in designs]
    note = (
        "Distance to the limit over the limit, at nominal size; at the new angles where a design "
        f"was simulated there, with the 95 % interval of a landing. {MAX_DESIGNS} designs at "
        "most, the CSV has all, by the search."
    )
    return Table(("margin", "follows", *heads), rows, words=[1], note=note)


def effect_parts(effects: Effects) -> list[Part]:
    """Build the figure of effects; empty if most designs are outside the trained range."""
    if effects.outside_trained_range > 0.5:
        return []
    return [
        effects_figure(effects.variables),
        f"Accumulated local effects over {effects.designs} designs that pass every check, "
        f"{percent(effects.outside_trained_range)} of them outside the trained range; zero is "
        f"their mean, {time_text(effects.mean_expected_shift_time_s)}. Bands hold 95 %.",
    ]


def point_parts(study: Setup, best: DesignRow, confirmation: Confirmation) -> list[Part]:
    """Build figures and tables of the operating points; empty where the own dog is chosen.

    Points that the chosen design moves by set-point or force are named as the own dog's.
    """
    if best.prototype:
        return []
    prototype_times = list(map(TimeMark.with_retries, confirmation.prototype.points))
    pairs = zip(confirmation.prototype.points, confirmation.best.points, strict=True)
    chosen_times = [TimeMark.with_retries(chosen)._replace(point=point) for point, chosen in pairs]
    figure = times_by_point({OWN_DOG: prototype_times, "chosen": chosen_times})
    caption = "At the new angles, retries included; bars are 95 % intervals."
    parts: list[Part] = [figure, caption]
    sides = sides_of(confirmation)
    points = [point for confirmed in sides.values() for point in confirmed.points]
    if all(point.shiftability for point in points):
        prototype_count = study.clutch.dog.count
        chosen_count = int(best.value("count") or prototype_count)
        counts = {OWN_DOG: prototype_count, "chosen": chosen_count}
        entries = {name: (sides[name].points, count) for name, count in counts.items()}
        parts += [shiftability_figure(entries), ENTRY_NOTE, *_entry_tables(confirmation)]
    return parts


def _entry_tables(confirmation: Confirmation) -> list[Table]:
    """Tabulate direct entries with their closed form, and limit speeds and torques, by side."""
    tables: list[Table] = []
    for name, confirmed in sides_of(confirmation).items():
        cells = []
        for point in confirmed.points:
            entry = point.shiftability
            if entry is None or entry.direct_closed_form is None:
                continue
            cells.append(
                [
                    point.cell("mismatch_rpm"),
                    point.cell("force_N"),
                    percent(entry.direct),
                    percent(entry.direct_closed_form),
                ]
            )
        if cells:
            heads = (axis("mismatch_rpm"), axis("force_N"), "direct entry", "closed form")
            tables.append(Table(heads, cells, note=f"Direct entry, {name}."))
        for quantity, kind, limits in (
            ("speed", LimitRow, confirmed.engagement_limits),
            ("torque", TorqueLimitRow, confirmed.engagement_torque_limits),
        ):
            if limits:
                note = f"Limit engagement {quantity}, {name}; 95 % interval."
                tables.append(replace(tabulate(kind, limits), note=note))
    return tables


def shift_parts(folder: StudyFolder, study: Setup, result: StudyRecord) -> list[Part]:
    """Tabulate the fastest and slowest shift of each design, with links to existing pages."""
    cells: dict[str, list[str]] = {}
    for replay in replays_of(folder, study, designs_shown(result)):
        words = replay.words
        if (folder.root / replay.path).is_file():
            words = Markup('<a href="{}">{}</a>').format(replay.path, replay.words)
        cells.setdefault(replay.design, [replay.design]).append(words)
    if not cells:
        return []
    note = "Each link opens an animation with its curves, in shifts beside this report."
    heads = ("design", "fastest shift", "slowest shift")
    return [Table(heads, list(cells.values()), {}, (1, 2), note)]


def life_table(stages: Sequence[LifeStage]) -> Table:
    """Tabulate wear, time and smallest margin of the chosen design by the share of its life."""
    heads = (
        "share of the life",
        "crest loss, µm",
        "chamfer left, °",
        "edge radius, mm",
        TIME,
        "engaged",
        "smallest margin",
    )
    rows = [
        [
            percent(stage.life),
            f"{1e3 * stage.crest_loss_mm:.3g}",
            f"{stage.chamfer_deg:.4g}",
            f"{stage.edge_radius_mm:.3g}",
            ms_with_error(stage.expected_shift_time_s, stage.standard_error_s),
            f"{100 * stage.engaged:.1f} %",
            margin_cell(stage.weakest_check, stage.smallest_margin),
        ]
        for stage in stages
    ]
    note = "Wear as [wear] of the study gives it. Edges stay sharp in the simulation."
    return Table(heads, rows, note=note)


def provenance_table(folder: StudyFolder, study: Setup, result: StudyRecord) -> Table:
    """Tabulate command, dates, numerical error, surrogate and versions."""
    numerical_error = None
    if result.confirmation is not None:
        numerical_error = result.confirmation.best.numerical_error_s
    stored = datetime.fromtimestamp(folder.result.stat().st_mtime, UTC)
    now = datetime.now(UTC)
    facts = {
        **provenance_of(study, result),
        "dates (UTC)": f"result stored {stored:%Y-%m-%d}, report written {now:%Y-%m-%d}",
        "numerical error": "" if numerical_error is None else f"{1e3 * numerical_error:.2g} ms",
        "surrogate": _surrogate_words(result.surrogate),
    }
    return Table(("", ""), [pair for pair in facts.items() if pair[1]])


def _surrogate_words(validation: Validation | None) -> str:
    """Print the validation of a surrogate; ``Bad`` if the surrogate is useless."""
    if validation is None:
        return "none: it needs a finished search with at least ten simulated designs"
    words = (
        f"Q² {validation.q2:.2f}, root-mean-square error {time_text(validation.rmse_s)}, "
        f"{percent(validation.coverage_95)} within the 95 % interval, on {validation.n} "
        f"designs ({validation.source})"
    )
    return words if validation.useful else Bad(f"{words}: useless")
