"""Pages of tables, figures and captions in one file each, which open offline.

``Report(title, headline).add("Front", figure, "caption", table).save(path)``
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from dogshape.pipeline.record import Bad, Table
from dogshape.pipeline.reports.text import bind_units
from dogshape.sim.files import name_file_in_errors

#: Captions are text, HTML is ``Markup``; None adds nothing.
Part: TypeAlias = "go.Figure | Table | Markup | str | None"


@dataclass
class Report:
    """A page of sections; a section without a title stands before the contents."""

    title: str
    headline: str = ""
    compact: bool = False
    sections: list[tuple[str, str, list[Table | Markup | str]]] = field(default_factory=list)

    def add(self, title: str, *parts: Part) -> Report:
        """Add a section if it has a figure, markup or a table with rows; return the report."""
        anchor = re.sub(r"\W+", "-", title.lower()).strip("-") or "summary"
        body: list[Table | Markup | str] = []
        for part in parts:
            if part is None or part == "" or not getattr(part, "rows", True):
                continue
            if isinstance(part, go.Figure):
                body.append(figure_html(part, f"{anchor}-{len(body)}"))
            else:
                body.append(part)
        if any(isinstance(part, Table | Markup) for part in body):
            self.sections.append((title, anchor, body))
        return self

    def save(self, path: Path) -> None:
        """Write the page, with the code of Plotly if it has a figure."""
        parts = [part for *_, body in self.sections for part in body]
        has_figure = any("plotly-graph-div" in str(part) for part in parts)
        plotly = script(get_plotlyjs()) if has_figure else ""
        write_page(path, "report.html.j2", report=self, plotly=plotly)


def write_page(path: Path, template: str, **content: Any) -> None:
    """Fill a template of the package and write the page."""
    environment = Environment(
        loader=PackageLoader("dogshape.pipeline.reports"),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=bind_units,
    )
    for name, kind in (("table", Table), ("markup", Markup), ("bad", Bad)):
        environment.tests[name] = lambda part, kind=kind: isinstance(part, kind)
    page = environment.get_template(template).render(**content)
    with name_file_in_errors(path):
        path.write_text(page, encoding="utf-8")


def figure_html(figure: go.Figure, name: str) -> Markup:
    """Write a figure as HTML without the code of Plotly."""
    settings = {"displayModeBar": False, "responsive": True}
    html = figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=settings)
    return Markup(html)


def script(code: str) -> Markup:
    """Write a script element that contains its code."""
    return Markup(f"<script>{code}</script>")
