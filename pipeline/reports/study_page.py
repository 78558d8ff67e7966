"""The report of a study: sections of tables and figures, and the files that it is written with."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import plotly.graph_objects as go
from markupsafe import Markup

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.drawing import dimensioned_svg, section_svg
from dogshape.pipeline.record import Bad, Table
from dogshape.pipeline.reports.data_sheet import (
    engine_of,
    ms_or_dash,
)
from dogshape.pipeline.reports.designs import (
    confirmation_of,
    design_name,
    designs_frame,
    designs_shown,
    failed_words,
    goals_of,
    is_barred,
    is_measured,
    least_margins,
    shown_goals,
    weakest_at_worst,
)
from dogshape.pipeline.reports.look import Row
from dogshape.pipeline.reports.prices import at_factor, dear, step_price
from dogshape.pipeline.reports.provenance import command_of, dates_of, file_of
from dogshape.pipeline.reports.report import Report, link
from dogshape.pipeline.reports.single_shifts import (
    Distribution,
    Shifts,
    distribution,
    read_shifts,
    replays_of,
    write_replays,
)
from dogshape.pipeline.reports.study_figures import (
    QUANTILES,
    course_figure,
    distribution_figure,
    front_figure,
    points_figure,
    prices_figure,
    sure_figure,
)
from dogshape.pipeline.reports.study_summary import (
    headline,
    margin_cell,
    share_cell,
    summary_tables,
)
from dogshape.pipeline.reports.text import (
    axis,
    check_name,
    in_ms,
    percent,
    time_text,
)
from dogshape.pipeline.reports.variable_effects import (
    effects_figure,
    indices_figure,
    learn_effects,
    stored_effects,
)
from dogshape.pipeline.simulate.design import limits_of
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.files import naming
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.loads import Landing
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import landing_checks
from dogshape.sim.units import RPM
from dogshape.surrogate.validation_figures import Validation

Say = Callable[[str], None]
BESIDE = 8  #: designs beside each other in a table of margins


def publish(folder: StudyFolder, say: Say) -> Path:
    """Make what the report lacks, then write it; return its path.

    Effects from the surrogate take a minute, the page of a shift half a second each.
    """
    study, result = folder.stored_study(), folder.stored_result()
    require_targets({"the report": folder.report})
    learn_effects(folder, say)
    shifts = read_shifts(study, ShiftJournal(folder.shifts, only_read=True))
    pairs = replays_of(shifts, designs_shown(result) if result["best"] else [])
    write_replays(folder, shifts, [one for pair in pairs for one in pair], say)
    return write_report(folder, shifts)


def write_report(folder: StudyFolder, shifts: Shifts | None = None) -> Path:
    """Write ``report.html`` and ``designs.csv`` from what the study stored; return the report."""
    study, result = folder.stored_study(), folder.stored_result()
    shifts = shifts or read_shifts(study, ShiftJournal(folder.shifts, only_read=True))
    with naming(folder.designs):
        frame = designs_frame(result, list(study.variables), simulated=True)
        frame.to_csv(folder.designs, index=False)
    report_of(folder, study, result, shifts).save(folder.report)
    return folder.report


def report_of(folder: StudyFolder, study: Setup, result: Row, shifts: Shifts) -> Report:
    """Build the report of a study."""
    result = at_own_places(study, result)
    page = Report(f"{study.name}: shape of the dogs", headline(result))
    best, confirmation = result["best"], result["confirmation"]
    page.add("", *(summary_tables(study, result)), _sections(study, best))
    if best is not None:
        _add_front(page, study, result)
        _add_limits(page, folder)
        if confirmation and not best["prototype"]:
            weights = {(p.mismatch / RPM, p.profile.force): p.weight for p in study.points}
            page.add(
                "Operating points",
                points_figure(confirmation, weights),
                "At the new angles; bars are 95 % intervals, retries included, weights in brackets "
                "where they differ. Gain: prototype less chosen design, hollow within twice its "
                "standard error. Engaged: at the first try.",
            )
        _add_shifts(page, folder, result, shifts)
        if result.get("life"):
            page.add("Life", life_table(result["life"]), _life_note(study))
        page.add("Drawing", _sheet(study, best))
    _add_search(page, folder, study, result)
    return page


def _add_front(page: Report, study: Setup, result: Row) -> None:
    variables, trials = list(study.variables), result["trials"]
    several = sum(map(is_measured, trials)) > 1
    others = [goal.name for goal in goals_of(result)[1:] if several]
    barred = sum(map(is_barred, trials))
    frame = designs_frame(result, variables, simulated=True)
    page.add(
        "Front",
        *(front_figure(result, variables, name) for name in others),
        "No design beats one of the front, named by its number, in every objective. Bars are 95 % "
        "intervals. Point at a mark to read all of it; designs far off lie outside the axes.",
        sure_figure(result) if result["front"] else None,
        "Trust the new angles: a search picks designs that were also lucky.",
        front_table(study, result),
        link(
            frame.to_csv(index=False), "text/csv", f"{study.name}-designs.csv",
            f"All {result['n_simulated_designs']} simulated designs with every column (CSV)",
        ),
        f"{barred} of {len(trials)} proposed designs failed a check and were not simulated.",
        *margin_tables(study, result),
        "Distance to the limit over the limit, at nominal size, by the search.",
    )  # fmt: skip


def front_table(study: Setup, result: Row) -> Table:
    """Tabulate prototype and front: variables, objectives by search and new angles, margins."""
    goals, best = shown_goals(result), result["best"]
    rows, looks = list[list[str]](), dict[int, str]()
    goals = [goal for goal in goals if goal.name != "smallest_margin"]
    for row in designs_shown(result):
        if row["prototype"] or row["trial"] == best["trial"]:
            looks[len(rows)] = "best" if row["trial"] == best["trial"] else "prototype"
        repeated = confirmation_of(result, row)
        cells = [goal.cell(row) for goal in goals]
        for place, goal in enumerate(goals):
            if repeated and goal.name in repeated["estimates"] and is_measured(repeated):
                cells[place] += f"\n{goal.pair(*goal.estimate(repeated))}"
        within = row["time_within_tolerances"]
        fails = failed_words(repeated)
        least = margin_cell(least_margins(row["margins"])[0]) if row["margins"] else Bad("no dog")
        rows.append([
            "prototype" if row["prototype"] else str(row["trial"]),
            *(f"{row[name]:.4g}" for name in study.variables), *cells,
            "" if row["engaged"] is None else f"{row['engaged']:.0%}",
            "" if within is None else in_ms(within["root_sum_square_s"]),
            Bad(f"{least}\nfails {fails}") if fails else least,
            margin_cell(weakest_at_worst(study, row)),
        ])  # fmt: skip
    heads = (
        "design", *map(axis, study.variables), *(goal.title for goal in goals), "engaged, least",
        "within tolerances, ± ms", "smallest margin", "at worst-case tolerances",
    )  # fmt: skip
    note = "By the search, ± one standard error; second line: at the new angles."
    return Table(heads, rows, looks, (len(heads) - 2, len(heads) - 1), note)


def margin_tables(study: Setup, result: Row) -> list[Table]:
    """Tabulate every margin of prototype and front, some designs beside each other."""
    dog, limits, shown = study.clutch.dog, study.limits, designs_shown(result)
    own = [(quantity.rule, limit) for quantity, limit in limits_of(study)]
    closed = (*strength_checks(dog, limits), *landing_checks(dog, Landing(), limits))
    rules = [*own, *((check.rule, check.limit) for check in closed)]
    tables = []
    for start in range(0, len(shown), BESIDE):
        part, rows, looks = shown[start : start + BESIDE], list[list[str]](), {}
        for group, title in GROUPS.items():
            mine = [(rule, limit) for rule, limit in rules if rule.group == group]
            if mine:
                looks[len(rows)] = "group"
                rows.append([title])
            for rule, limit in mine:
                found = [row["margins"].get(rule.name) for row in part]
                cells = ["" if margin is None else share_cell(margin) for margin in found]
                sign = "≤" if rule.at_most else "≥"
                rows.append([check_name(rule.name), f"{sign} {limit:.4g} {rule.unit}", *cells])
        names = ["prototype" if row["prototype"] else str(row["trial"]) for row in part]
        tables.append(Table(("check", "limit", *names), rows, looks))
    return tables


def _add_limits(page: Report, folder: StudyFolder) -> None:
    known = stored_effects(folder)
    if known is None:
        return
    effects, paid = known["effects"], dear(known["prices"])
    outside = effects["outside_trained_range"]
    page.add(
        "Variables",
        effects_figure(effects) if outside <= 0.5 else None,
        None
        if outside > 0.5
        else f"Accumulated local effects over {effects['designs']} designs that pass every check, "
        f"{percent(outside)} of them outside the trained range; zero is their mean, "
        f"{time_text(effects['mean_expected_shift_time_s'])}. Bands hold 95 %.",
        *(indices_figure(found) for found in known["indices"]),
        "Sobol indices in a box about the prototype, a tenth of each search range either way; the "
        "second figure with mismatch and force. Bars are 95 % intervals.",
    )
    page.add(
        "Limits",
        prices_figure(paid) if paid else None,
        prices_table(paid) if paid else None,
        "Best expected shift time that the surrogate predicts of any design which keeps all other "
        "limits, if one were another. Limits that are not listed cost nothing. Without landing and "
        "other simulated limits, and without the surrogate's error.",
    )


def prices_table(paid: list[Row]) -> Table:
    """Tabulate the best time, ms, under a tenth less and more of each limit, and its price."""
    rows = []
    for row in paid:
        step, sign = step_price(row), "≤" if row["at_most"] else "≥"
        times = [at_factor(row, factor) for factor in (0.9, 1.0, 1.1)]
        rows.append([
            f"{check_name(row['name'])} {row['key']}", f"{sign} {row['limit']:.4g} {row['unit']}",
            *("no design" if t is None else in_ms(t) for t in (*times, row["without_s"])),
            f"{step[1]:.2g} ms per {step[0]:g} {row['unit']}" if step else "",
        ])  # fmt: skip
    heads = "limit", "as it is", "a tenth less, ms", "as it is, ms", "a tenth more, ms"
    return Table((*heads, "without it, ms", "price"), rows)


def _add_shifts(page: Report, folder: StudyFolder, result: Row, shifts: Shifts) -> None:
    times = _distributions(result, shifts)
    quantiles = [
        [name, str(len(one.times)), *(_quantile(one, s) for s in (*QUANTILES, 1.0)), str(one.lost)]
        for name, one in times.items()
    ]
    heads = ["shifts", *(f"{share:.0%} within, ms" for share in QUANTILES), "longest, ms"]
    rows = []
    for pair in replays_of(shifts, designs_shown(result)):
        cells = [
            Markup('<a href="{}">{}</a>').format(one.path, one.words)
            if (folder.root / one.path).is_file() else one.words
            for one in pair
        ]  # fmt: skip
        rows.append([pair[0].design, *cells])
    page.add(
        "Single shifts",
        distribution_figure(times) if times else None,
        "All operating points with their weights, at the new angles. A shift that does not engage "
        "at its first try never ends here.",
        Table(("", *heads, "did not engage"), quantiles) if quantiles else None,
        Table(("design", "fastest shift", "slowest shift"), rows, {}, (1, 2)) if rows else None,
        "Each link opens an animation with its curves, in shifts beside this report.",
    )


def _quantile(one: Distribution, share: float) -> str:
    time = one.quantile(share)
    return "never" if math.isinf(time) else f"{1e3 * time:.0f}"


def _distributions(result: Row, shifts: Shifts) -> dict[str, Distribution]:
    if not result["confirmation"]:
        return {}
    best = {name: result["best"][name] for name in shifts.study.variables}
    pairs = {"prototype": shifts.study.prototype, "chosen": best}
    if result["best"]["prototype"]:
        del pairs["chosen"]
    found = {name: distribution(shifts, one) for name, one in pairs.items()}
    known = {name: one for name, one in found.items() if one is not None}
    return known if len(known) == len(found) else {}


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
    return Table(heads, rows)


def _life_note(study: Setup) -> str:
    rate = study.file.wear.rate_mm3_Nm if study.file.wear else None
    law = "Loss at the end of the life as the study gives it. "
    if rate is not None:
        law = f"Archard's wear, {rate:g} mm³/(N m), over {study.limits.load.shifts:g} shifts. "
    return law + "Edges stay sharp in the simulation. Margins without manufacture."


def _sections(study: Setup, best: Row | None) -> Markup:
    """Draw prototype and chosen design to one scale."""
    span = 2.4 * study.clutch.dog.pitch
    drawn = section_svg(study.clutch.dog, "Prototype", span)
    if best is not None and not best["prototype"]:
        drawn += section_svg(_dog(study, best), f"Design {best['trial']}", span)
    return Markup('<div class="drawings">{}</div>').format(Markup(drawn))


def _sheet(study: Setup, best: Row) -> Markup:
    name = design_name(best).capitalize()
    drawn = dimensioned_svg(_dog(study, best), study.limits, f"{name}, dimensioned section")
    return Markup('<div class="sheet">{}</div>').format(Markup(drawn))


def _dog(study: Setup, row: Row) -> Dog:
    return study.dog_with({name: row[name] for name in study.variables})


def _add_search(page: Report, folder: StudyFolder, study: Setup, result: Row) -> None:
    fitted = result["surrogate"]
    judged = "none: it needs a finished search with at least ten simulated designs"
    if fitted:
        judged = (
            f"Q² {fitted['q2']:.2f}, root-mean-square error {time_text(fitted['rmse_s'])}, "
            f"{fitted['coverage_95']:.0%} within the 95 % interval, on {fitted['n']} designs "
            f"({fitted['source']})"
        )
        judged = judged if Validation.from_dict(fitted).useful else Bad(f"{judged}: useless")
    figure: go.Figure | None = course_figure(result) if result["best"] is not None else None
    contact, solver, dates = study.clutch.contact, study.clutch.solver, dates_of(folder.result)
    facts = {
        "command": command_of(study) or "dogshape study FILE, of what study.json holds",
        "dates": f"result stored {dates['stored']}, report written {dates['written']} (UTC)",
        "simulated": f"{result['n_simulated_designs']} designs, {result['n_simulated_shifts']} "
        f"shifts by {engine_of(result)}, each in shifts.jsonl with its inputs",
        "surrogate": judged,
        "operating points": study.operating_text,
        "uncertain": "; ".join(
            f"{name.replace('_', ' ')} {text}"
            for name, text in (study.uncertainty.source if study.uncertainty else ())
        ),
        "contact": f"{contact.name}: friction {contact.static_friction} static, "
        f"{contact.dynamic_friction} dynamic, stiffness {contact.stiffness:.3g} Pa/m, dissipation "
        f"{contact.dissipation} s/m",
        "mechanism": ", ".join(f"{name} {one:.4g}" for name, one in study.mechanism.items()),
        "solver": f"{solver.scheme}, accuracy {solver.accuracy}, steps up to "
        f"{1e3 * solver.max_step} ms",
        "end of a shift": f"{study.file.shift.seated_tolerance_mm:g} mm before full travel",
        "retry": f"time-out {study.clutch.timeout} s and retraction {study.retraction} s",
        "search": f"{study.file.search.sampler}, {len(result['trials'])} designs, seed "
        f"{study.file.search.seed}, {study.file.expectation.angles} angles",
        "versions": ", ".join(f"{name} {version}" for name, version in result["versions"].items()),
        "hashes": f"configuration {result['config_hash']}, physics {result['physics_hash']}",
    }
    file = Markup("<details><summary>Study file as it was run</summary><pre>{}</pre></details>")
    page.add(
        "Search and provenance",
        figure,
        "Circles are designs that pass every check.",
        Table(("", ""), [pair for pair in facts.items() if pair[1]]),
        file.format(file_of(study)),
    )


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
