"""What the report's template is filled with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dogshape.pipeline.config.study_file import Study
from dogshape.pipeline.export.drawing import dimensioned_svg, section_svg
from dogshape.pipeline.reports.kit.html import figure_html
from dogshape.pipeline.reports.study import design_names as names
from dogshape.pipeline.reports.study import design_tables as tables
from dogshape.pipeline.reports.study import summary
from dogshape.pipeline.reports.study.convergence import convergence_figure, course
from dogshape.pipeline.reports.study.design_shifts import Shifts, place
from dogshape.pipeline.reports.study.distribution import (
    distribution,
    distribution_figure,
    quantile_rows,
)
from dogshape.pipeline.reports.study.front import (
    confirmed_designs,
    front_figure,
    sure_figure,
    third_figure,
)
from dogshape.pipeline.reports.study.goals import MARGIN, goals_of
from dogshape.pipeline.reports.study.learned import stored_effects
from dogshape.pipeline.reports.study.operating_grid import (
    engaged_figure,
    gain_figure,
    is_grid,
    points_figure,
)
from dogshape.pipeline.reports.study.parallel import parallel_figure
from dogshape.pipeline.reports.study.point_list import listed_figure
from dogshape.pipeline.reports.study.provenance import command_of, dates_of, file_of
from dogshape.pipeline.reports.study.replays import replays_of
from dogshape.pipeline.reports.study.replicated import replicated_rows, replicated_words
from dogshape.pipeline.reports.surrogate.figures import effects_figure, indices_figure
from dogshape.pipeline.reports.surrogate.variable_labels import label
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.result_records import check_record
from dogshape.sim.shift.loads import Landing
from dogshape.sim.strength.checks import GROUPS, Check
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import landing_checks
from dogshape.sim.units import RPM
from dogshape.surrogate.validation_figures import validation_of

Row = dict[str, Any]
#: What every page of a study has, filled or empty; a template asks for nothing else.
FIGURES = (
    "fronts", "sure", "parallel", "effects", "indices", "distribution", "engaged", "gain",
    "points", "listed", "convergence",
)  # fmt: skip


def content_of(folder: StudyFolder, study: Study, result: Row, shifts: Shifts) -> Row:
    """Return the content of the report's template; what is not known is empty."""
    variables = list(study.variables)
    fitted = result["surrogate"]
    figures: Row = dict.fromkeys(FIGURES, "")
    if result["best"] is not None:
        figures |= _search_figures(result, variables, shifts) | _surrogate_figures(folder)
    if result["confirmation"]:
        figures |= _confirmed_figures(weighted(study, result["confirmation"]))
    times = _distributions(result, shifts)
    if times:
        figures["distribution"] = figure_html(distribution_figure(times), "distribution")
    return {
        **figures,
        **_checks_and_designs(study, result),
        "study": study,
        "result": result,
        "c": result["confirmation"],
        "variables": variables,
        **_goals(study, result),
        "label": label,
        "names": names,
        "percent": names.percent,
        "ms": summary.ms,
        "headline": summary.headline(result),
        "said": summary.points_of(result) if result["confirmation"] else [],
        "choice": summary.choice(result),
        "failures": summary.failures_of(result) if result["confirmation"] else [],
        "passed_over": summary.passed_over(result) if result["confirmation"] else "",
        "at_the_ends": summary.at_the_ends(result, study.variables),
        "lost": any(row["lost"] for row in quantile_rows(times)),
        "failed_words": summary.failed_words,
        "replicated_words": replicated_words(result),
        "replicated": replicated_rows(result),
        "quantiles": quantile_rows(times),
        "drawings": _drawings(study, result, variables),
        "replays": _replays(folder, result, shifts),
        "csv": tables.csv_link(tables.designs_frame(result, variables).to_csv(index=False)),
        "command": command_of(study),
        "dates": dates_of(folder.result),
        "study_file": file_of(study),
        "surrogate_useful": bool(fitted) and validation_of(fitted).useful,
        "contact": study.clutch.contact,
        "solver": study.clutch.solver,
    }


def _goals(study: Study, result: Row) -> Row:
    """Return the objectives, and what was simulated of each design."""
    goals, weights = goals_of(result), {point.weight for point in study.points}
    simulated = [row["points"] for row in result["trials"] if row["points"]]
    gained = summary.gained(result)
    return {
        "goals": goals,
        "lead": goals.leading,
        "columns": [goal for goal in goals.told if goal.name != MARGIN],
        "gained": gained,
        "meaning": summary.meaning(goals, len(study.points), len(weights) > 1),
        "confirmed": confirmed_designs(result),
        "partial": any(count < len(study.points) for count in simulated),
        "weighted": len(weights) > 1,
        "uncertain": study.uncertainty.source if study.uncertainty else (),
    }


def _search_figures(result: Row, variables: list[str], shifts: Shifts) -> Row:
    others = [goal.name for goal in goals_of(result).others]
    fronts = [figure_html(front_figure(result, variables, o), f"front-{o}") for o in others]
    if len(others) >= 2:
        figure = third_figure(result, variables, others[0], others[1])
        fronts.append(figure_html(figure, "front-third"))
    return {
        "fronts": fronts,
        "sure": figure_html(sure_figure(result), "sure"),
        "parallel": figure_html(parallel_figure(result, variables), "parallel"),
        "convergence": figure_html(
            convergence_figure(result, course(result, shifts)), "convergence"
        ),
    }


def weighted(study: Study, confirmation: Row) -> Row:
    """Return a confirmation whose operating points have their weights."""
    weights = {place(p.mismatch / RPM, p.profile.force): p.weight for p in study.points}

    def added(points: list[Row]) -> list[Row]:
        return [
            {**p, "weight": weights.get(place(p["mismatch_rpm"], p["force_N"]), 1.0)}
            for p in points
        ]

    both = {key: confirmation[key] for key in ("prototype", "best")}
    return {key: {**found, "points": added(found["points"])} for key, found in both.items()}


def _confirmed_figures(confirmation: Row) -> Row:
    if not is_grid(confirmation):
        return {"listed": figure_html(listed_figure(confirmation), "listed")}
    return {
        "points": figure_html(points_figure(confirmation), "points"),
        "engaged": figure_html(engaged_figure(confirmation), "engaged"),
        "gain": figure_html(gain_figure(confirmation), "gain"),
    }


def _surrogate_figures(folder: StudyFolder) -> Row:
    known = stored_effects(folder)
    if known is None:
        return {}
    indices = [
        (found, figure_html(indices_figure(found), f"indices-{number}"))
        for number, found in enumerate(known["indices"])
    ]
    effects = known["effects"]
    figure = figure_html(effects_figure(effects), "effects")
    return {"effects": (effects, figure), "indices": indices}


def _distributions(result: Row, shifts: Shifts) -> Row:
    """Return the distribution of prototype and chosen design, both or none."""
    if not result["confirmation"] or result["best"] is None:
        return {}
    best = {name: result["best"][name] for name in shifts.study.variables}
    designs = {"prototype": shifts.study.prototype, "chosen": best}
    found = {name: distribution(shifts, design) for name, design in designs.items()}
    return found if all(found.values()) else {}


def _drawings(study: Study, result: Row, variables: list[str]) -> Row:
    span, best = 2.4 * study.clutch.dog.pitch, result["best"]
    sections, sheet = [section_svg(study.clutch.dog, "Prototype", span)], ""
    if best is not None and not best["prototype"]:
        dog = study.dog_with({name: best[name] for name in variables})
        title = f"Design {best['trial']}"
        sections.append(section_svg(dog, title, span))
        sheet = dimensioned_svg(dog, study.limits, f"{title}, dimensioned section")
    return {"sections": sections, "sheet": sheet}


def _checks_and_designs(study: Study, result: Row) -> Row:
    designs = names.designs_shown(result)
    trials: Sequence[Row] = result["trials"]
    return {
        "groups": GROUPS,
        "checks": [check_record(check) for check in _checks(study)],
        "designs": designs,
        "parts": tables.in_parts(designs),
        "sure_known": bool(designs) and all("probability_on_front" in r for r in result["front"]),
        "barred": [r for r in trials if names.is_barred(r)],
        "afresh": names.failed_afresh(result),
        "hard": [r for r in trials if not r["feasible"] and not names.is_barred(r)],
    }


def _checks(study: Study) -> tuple[Check, ...]:
    """Return every check of the prototype; the landing's with their limits alone."""
    dog = study.clutch.dog
    still = landing_checks(dog, Landing(), study.limits)
    return strength_checks(dog, study.limits) + still


def _replays(folder: StudyFolder, result: Row, shifts: Shifts) -> list[Row]:
    """Return the fastest and slowest shift of each design shown, with the pages that are there."""
    if result["best"] is None:
        return []
    pairs = replays_of(shifts, names.designs_shown(result))
    return [
        {
            "design": pair[0].design,
            "shifts": [{"words": r.words, "angle": r.shift["relative_angle_deg"],
                        "page": r.path if (folder.root / r.path).is_file() else ""}
                       for r in pair],
        }
        for pair in pairs
    ]  # fmt: skip
