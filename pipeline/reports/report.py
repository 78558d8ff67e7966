"""Pages in one file that open offline: a report is built of tables, figures and captions.

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
from dogshape.pipeline.reports.text import bound
from dogshape.sim.files import naming

#: A caption is a text, ready HTML is marked as such; nothing is left out.
Part: TypeAlias = "go.Figure | Table | Markup | str | None"


@dataclass
class Report:
    """A page of sections; a section without a title stands before the contents."""

    title: str
    headline: str = ""
    compact: bool = False
    sections: list[tuple[str, str, list[Table | Markup | str]]] = field(default_factory=list)

    def add(self, title: str, *parts: Part) -> Report:
        """Add a section; tables without rows and sections of captions alone are left out."""
        anchor = re.sub(r"\W+", "-", title.lower()).strip("-") or "summary"
        given = [p for p in parts if p is not None and p != "" and getattr(p, "rows", True)]
        body = [
            figure_html(part, f"{anchor}-{place}") if isinstance(part, go.Figure) else part
            for place, part in enumerate(given)
        ]
        if any(isinstance(part, Table | Markup) for part in body):
            self.sections.append((title, anchor, body))
        return self

    def save(self, path: Path) -> None:
        """Write the page; Plotly's code is in it where a figure is."""
        drawn = any("plotly-graph-div" in str(part) for *_, body in self.sections for part in body)
        plotly = script(get_plotlyjs()) if drawn else ""
        write_page(path, "report.html.j2", report=self, plotly=plotly)


def write_page(path: Path, template: str, **content: Any) -> None:
    """Fill a template of the package and write the page."""
    environment = Environment(
        loader=PackageLoader("dogshape.pipeline.reports"),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=bound,
    )
    for name, kind in (("table", Table), ("markup", Markup), ("bad", Bad)):
        environment.tests[name] = lambda part, kind=kind: isinstance(part, kind)
    page = environment.get_template(template).render(**content)
    with naming(path):
        path.write_text(page, encoding="utf-8")


def figure_html(figure: go.Figure, name: str) -> Markup:
    """Write a figure as HTML that uses the code which the page carries."""
    settings = {"displayModeBar": False, "responsive": True}
    html = figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=settings)
    return Markup(html)


def script(code: str) -> Markup:
    """Write a script element that holds its code."""
    return Markup(f"<script>{code}</script>")
