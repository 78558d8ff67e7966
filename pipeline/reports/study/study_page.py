"""The report of a study: its content, and the files that it is written with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.drawing import dimensioned_svg, section_svg
from dogshape.pipeline.reports.kit.html import csv_link, figure_html, write_page
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import check_name, label, minus, percent
from dogshape.pipeline.reports.study import alternatives as other_choices
from dogshape.pipeline.reports.study import designs, single_shifts, summary
from dogshape.pipeline.reports.study import point_gains as places
from dogshape.pipeline.reports.study.convergence import convergence_figure, course
from dogshape.pipeline.reports.study.front import front_figure, sure_figure, third_figure
from dogshape.pipeline.reports.study.goals import MARGIN, goals_of
from dogshape.pipeline.reports.study.prices import at_factor, dear, prices_figure, step_price
from dogshape.pipeline.reports.study.provenance import command_of, dates_of, file_of
from dogshape.pipeline.reports.study.replays import replays_of, write_replays
from dogshape.pipeline.reports.study.single_shifts import Shifts, place, read_shifts
from dogshape.pipeline.reports.study.summary import facts_of
from dogshape.pipeline.reports.study.surrogate_effects import learn_effects, stored_effects
from dogshape.pipeline.reports.surrogate.figures import effects_figure, indices_html
from dogshape.pipeline.simulate.design import limits_of
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.store.result_schema import check_record
from dogshape.sim.files import naming
from dogshape.sim.shift.loads import Landing
from dogshape.sim.strength.checks import GROUPS, Check
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import landing_checks
from dogshape.sim.units import RPM
from dogshape.surrogate.validation_figures import validation_of

Say = Callable[[str], None]
#: What every page of a study has, filled or empty; a template asks for nothing else.
FIGURES = (
    "fronts", "sure", "effects", "indices", "prices", "distribution", "engaged", "gain",
    "points", "listed", "convergence",
)  # fmt: skip


def publish(folder: StudyFolder, say: Say) -> Path:
    """Make what the report lacks, then write it; return its path.

    Effects from the surrogate take a minute, the page of a shift half a second each.
    """
    study, result = folder.stored_study(), folder.stored_result()
    require_targets({"the report": folder.report})
    learn_effects(folder, say)
    shifts = read_shifts(study, ShiftJournal(folder.shifts, only_read=True))
    pairs = replays_of(shifts, designs.designs_shown(result) if result["best"] else [])
    write_replays(folder, shifts, [one for pair in pairs for one in pair], say)
    return _write(folder, study, result, shifts)


def write_report(folder: StudyFolder) -> Path:
    """Write ``report.html`` and ``designs.csv`` from what the study stored; return the report."""
    study, journal = folder.stored_study(), ShiftJournal(folder.shifts, only_read=True)
    return _write(folder, study, folder.stored_result(), read_shifts(study, journal))


def _write(folder: StudyFolder, study: Setup, result: Row, shifts: Shifts) -> Path:
    content = content_of(folder, study, result, shifts)
    with naming(folder.designs):
        designs.designs_frame(result, list(study.variables)).to_csv(folder.designs, index=False)
    write_page(folder.report, "report.html.j2", **content)
    return folder.report


def content_of(folder: StudyFolder, study: Setup, result: Row, shifts: Shifts) -> Row:
    """Collect the content of the report's template; what is not known is empty."""
    result = at_own_places(study, result)
    variables, best = list(study.variables), result["best"]
    fitted, confirmation = result["surrogate"], result["confirmation"]
    goals, weights = goals_of(result), {point.weight for point in study.points}
    figures: Row = dict.fromkeys(FIGURES, "")
    if best is not None:
        figures |= _search_figures(result, variables, shifts) | _surrogate_figures(folder)
    both = ("prototype", "best") if confirmation else ()
    measured = {key: designs.is_measured(confirmation[key]) for key in both}
    if confirmation and not best["prototype"]:
        figures |= _confirmed_figures(weighted(study, confirmation), all(measured.values()))
    times = _distributions(result, shifts)
    if times:
        figures["distribution"] = single_shifts.distribution_figure(times)
    quantiles, shown = single_shifts.quantile_rows(times), designs.designs_shown(result)
    searched = [designs.as_searched(result, row) for row in shown]
    facts = facts_of(study, result)
    # For their limits alone.
    still = landing_checks(study.clutch.dog, Landing(), study.limits)
    own = [Check(quantity.rule(limit), limit, limit) for quantity, limit in limits_of(study)]
    trials = result["trials"]
    return {
        **{name: _html(name, figure) for name, figure in figures.items()},
        "study": study,
        "result": result,
        "c": confirmation,
        "variables": variables,
        "goals": goals,
        "lead": goals.leading,
        "columns": [goal for goal in goals.told if goal.name != MARGIN],
        "gained": summary.gained(result),
        "measured": measured,
        "engaged_shifts": designs.engaged_shifts,
        "is_measured": designs.is_measured,
        "confirmed": designs.confirmed_designs(result),
        "apart": [f for f in facts if f.name.startswith("search and new angles")],
        "weighted": len(weights) > 1,
        "uncertain": study.uncertainty.source if study.uncertainty else (),
        "label": label,
        "percent": percent,
        "ms": lambda seconds, digits=1: minus(f"{1e3 * seconds:.{digits}f}"),
        "check_name": check_name,
        "step_price": step_price,
        "at_factor": at_factor,
        "headline": summary.headline(result),
        "facts": facts,
        "head_of_alternatives": other_choices.HEAD,
        "alternatives": other_choices.alternatives(study, result),
        "cells_of": other_choices.cells_of,
        "margin_of": lambda row: designs.least_margins(row["margins"])[0],
        "worst_of": lambda row: designs.weakest_at_worst(study, row),
        "failure": summary.failure,
        "lost": any(row["lost"] for row in quantiles),
        "failed_words": summary.failed_words,
        "quantiles": quantiles,
        "drawings": _drawings(study, best),
        "replays": _replays(folder, shifts, shown) if best else [],
        "csv": csv_link(designs.designs_frame(result, variables).to_csv(index=False)),
        "command": command_of(study),
        "dates": dates_of(folder.result),
        "study_file": file_of(study),
        "surrogate_useful": bool(fitted) and validation_of(fitted).useful,
        "contact": study.clutch.contact,
        "solver": study.clutch.solver,
        "groups": GROUPS,
        "checks": [
            check_record(check)
            for check in (*strength_checks(study.clutch.dog, study.limits), *own, *still)
        ],
        "designs": searched,
        "parts": designs.in_parts(searched),
        "sure_known": bool(shown) and all("probability_on_front" in r for r in result["front"]),
        "barred": [r for r in trials if designs.is_barred(r)],
        "failed_anew": designs.failed_at_new_angles(result),
        "hard": [r for r in trials if not r["feasible"] and not designs.is_barred(r)],
    }


def _html(name: str, figure: Any) -> Any:
    return figure_html(figure, name) if isinstance(figure, go.Figure) else figure


def _search_figures(result: Row, variables: list[str], shifts: Shifts) -> Row:
    several = sum(map(designs.is_measured, result["trials"])) > 1
    others = [goal.name for goal in goals_of(result).others if several]
    fronts = [figure_html(front_figure(result, variables, o), f"front-{o}") for o in others]
    if len(others) >= 2:
        figure = third_figure(result, variables, others[0], others[1])
        fronts.append(figure_html(figure, "front-third"))
    return {
        "fronts": fronts,
        "sure": sure_figure(result) if result["front"] else "",
        "convergence": convergence_figure(result, course(result)),
    }


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


def weighted(study: Setup, confirmation: Row) -> Row:
    """Add the weights of operating points to both designs of a confirmation."""
    weights = {place(p.mismatch / RPM, p.profile.force): p.weight for p in study.points}

    def added(points: list[Row]) -> list[Row]:
        keys = [place(p["mismatch_rpm"], p["force_N"]) for p in points]
        return [{**p, "weight": weights.get(key, 1.0)} for p, key in zip(points, keys, strict=True)]

    both = {key: confirmation[key] for key in ("prototype", "best")}
    return {key: {**found, "points": added(found["points"])} for key, found in both.items()}


def _confirmed_figures(confirmation: Row, measured: bool) -> Row:
    """Draw each operating point; times where ``measured``, shares where they differ."""
    points = [p for key in ("prototype", "best") for p in confirmation[key]["points"]]
    if not places.is_grid(confirmation):
        return {"listed": places.listed_figure(confirmation)} if measured else {}
    found: Row = {}
    if measured:
        found |= {"points": places.points_figure(confirmation)}
        found |= {"gain": places.gain_figure(confirmation)}
    if len({p["engaged"] for p in points}) > 1:
        found |= {"engaged": places.engaged_figure(confirmation)}
    return found


def _surrogate_figures(folder: StudyFolder) -> Row:
    known = stored_effects(folder)
    if known is None:
        return {}
    effects, paid = known["effects"], dear(known["prices"])
    return {
        "prices": (paid, figure_html(prices_figure(paid), "prices")) if paid else "",
        "effects": (effects, _effects(effects)),
        "indices": indices_html(known["indices"]),
    }


def _effects(effects: Row) -> str:
    """Draw the effects; nothing where most designs lie outside the trained range."""
    if effects["outside_trained_range"] > 0.5:
        return ""
    return figure_html(effects_figure(effects), "effects")


def _distributions(result: Row, shifts: Shifts) -> dict[str, single_shifts.Distribution]:
    if not result["confirmation"] or result["best"] is None:
        return {}
    best = {name: result["best"][name] for name in shifts.study.variables}
    pairs = {"prototype": shifts.study.prototype, "chosen": best}
    if result["best"]["prototype"]:
        del pairs["chosen"]
    found = {name: single_shifts.distribution(shifts, one) for name, one in pairs.items()}
    known = {name: one for name, one in found.items() if one is not None}
    return known if len(known) == len(found) else {}


def _drawings(study: Setup, best: Row | None) -> Row:
    span = 2.4 * study.clutch.dog.pitch
    sections, sheet = [section_svg(study.clutch.dog, "Prototype", span)], ""
    if best is not None and not best["prototype"]:
        dog = study.dog_with({name: best[name] for name in study.variables})
        title = f"Design {best['trial']}"
        sections.append(section_svg(dog, title, span))
        sheet = dimensioned_svg(dog, study.limits, f"{title}, dimensioned section")
    return {"sections": sections, "sheet": sheet}


def _replays(folder: StudyFolder, shifts: Shifts, shown: list[Row]) -> list[Row]:
    return [
        {
            "design": pair[0].design,
            "shifts": [{"words": r.words, "angle": r.shift["relative_angle_deg"],
                        "page": r.path if (folder.root / r.path).is_file() else ""}
                       for r in pair],
        }
        for pair in replays_of(shifts, shown)
    ]  # fmt: skip
