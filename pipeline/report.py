"""The report of a study: one HTML file that opens without a network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from plotly.offline import get_plotlyjs

from pipeline.config import Study
from pipeline.design import SIMULATED
from pipeline.drawing import dimensioned_svg, section_svg
from pipeline.figures import (
    axis_title,
    convergence_figure,
    front_figure,
    is_barred,
    points_figure,
)
from pipeline.folder import StudyFolder
from pipeline.records import check_record, is_clear
from sim.checks import GROUPS, Check
from sim.landing import landing_checks
from sim.loads import Landing
from sim.strength import strength_checks
from surrogate.figures import validation_of

Row = dict[str, Any]


def write_report(folder: StudyFolder) -> Path:
    """Write ``report.html`` from what the study stored and return its path."""
    study = folder.stored_study()
    result = folder.stored_result()
    page = render("report.html.j2", **_content(study, result))
    folder.report.write_text(page, encoding="utf-8")
    return folder.report


def percent(margin: float) -> str:
    """Return a margin in percent, with a decimal where it is small."""
    return f"{100 * margin:.1f} %" if abs(margin) < 0.05 else f"{100 * margin:.0f} %"


def render(template: str, **content: Any) -> str:
    """Fill a template of the package; plotly's code is put in once."""
    environment = Environment(
        loader=PackageLoader("pipeline"),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page: str = environment.get_template(template).render(plotly=get_plotlyjs(), **content)
    return page


def figure_html(figure: go.Figure, name: str) -> str:
    """Return a figure as HTML that uses the code which the page carries."""
    html: str = figure.to_html(
        full_html=False,
        include_plotlyjs=False,
        div_id=name,
        config={"displayModeBar": False, "responsive": True},
    )
    return html


def _content(study: Study, result: Row) -> Row:
    variables = list(study.variables)
    others = [name for name in result["objectives"] if name != SIMULATED]
    confirmation, best = result["confirmation"], result["best"]
    fitted = result["surrogate"]
    figures, convergence = [], ""
    if best is not None:
        convergence = figure_html(convergence_figure(result), "convergence")
        figures = [figure_html(front_figure(result, variables, o), f"front-{o}") for o in others]
    span = 2.4 * study.clutch.dog.pitch
    drawings = [section_svg(study.clutch.dog, "Prototype", span)]
    sheet = ""
    if best is not None:
        dog = study.dog_with({name: best[name] for name in variables})
        title = f"Design {best['trial']}"
        drawings.append(section_svg(dog, title, span))
        sheet = dimensioned_svg(dog, study.limits, f"{title}, dimensioned section")
    return {
        "study": study,
        "result": result,
        "variables": variables,
        "others": others,
        "axis_title": axis_title,
        "fronts": figures,
        "convergence": convergence,
        "points": figure_html(points_figure(confirmation), "points") if confirmation else "",
        "drawings": drawings,
        "designs": _designs(result),
        "is_clear": is_clear,
        "surrogate_useful": bool(fitted) and validation_of(fitted).useful,
        "percent": percent,
        "sheet": sheet,
        "groups": GROUPS,
        "checks": [check_record(check) for check in _checks(study)],
        "barred": [r for r in result["trials"] if is_barred(r)],
        "hard": [r for r in result["trials"] if not r["feasible"] and not is_barred(r)],
        "contact": study.clutch.contact,
        "solver": study.clutch.solver,
    }


def _checks(study: Study) -> tuple[Check, ...]:
    """Return every check of the prototype; the landing's with their limits alone."""
    dog = study.clutch.dog
    still = landing_checks(dog, Landing(), study.limits)
    return strength_checks(dog, study.limits) + still


def _designs(result: Row) -> Sequence[Row]:
    """Return the prototype and then the front, fastest first."""
    front: list[Row] = result["front"]
    shown = {row["trial"] for row in front}
    return [r for r in result["trials"] if r["prototype"] and r["trial"] not in shown] + front
