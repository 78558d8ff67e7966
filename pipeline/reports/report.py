"""Pages in one file that open offline: a report is built of tables, figures and captions.

``Report(title, headline).add("Front", figure, "caption", table).save(path)``
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import quote

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from dogshape.pipeline.record import Bad, Table
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
        """Add a section; one of captions alone is left out."""
        anchor = re.sub(r"\W+", "-", title.lower()).strip("-") or "summary"
        given = [part for part in parts if part is not None and part != ""]
        body = [
            figure_html(part, f"{anchor}-{place}") if isinstance(part, go.Figure) else part
            for place, part in enumerate(given)
        ]
        if any(isinstance(part, Table | Markup) for part in body):
            self.sections.append((title, anchor, body))
        return self

    def save(self, path: Path) -> None:
        """Write the page."""
        parts = [part for *_, body in self.sections for part in body]
        drawn = any("plotly-graph-div" in part for part in parts if isinstance(part, Markup))
        more = {} if drawn else {"plotly": ""}
        write_page(path, "report.html.j2", report=self, **more)


def write_page(path: Path, template: str, **content: Any) -> None:
    """Fill a template of the package and write the page.

    Plotly's code is put in once unless the content brings it.
    """
    environment = Environment(
        loader=PackageLoader("dogshape.pipeline.reports"),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests |= {
        "table": lambda part: isinstance(part, Table),
        "markup": lambda part: isinstance(part, Markup),
        "bad": lambda text: isinstance(text, Bad),
    }
    content.setdefault("plotly", script(get_plotlyjs()))
    page = environment.get_template(template).render(**content)
    with naming(path):
        path.write_text(page, encoding="utf-8")


def figure_html(figure: go.Figure, name: str, **settings: Any) -> Markup:
    """Write a figure as HTML that uses the code which the page carries."""
    settings = {"displayModeBar": False, "responsive": True} | settings
    html = figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=settings)
    return Markup(html)


def link(text: str, kind: str, name: str, words: str) -> Markup:
    """Write a link that saves a text as a file, without a network; ``kind`` as ``text/csv``."""
    data = f"data:{kind};charset=utf-8," + quote(text)
    return Markup('<p class="note"><a href="{}" download="{}">{}</a></p>').format(data, name, words)


def as_script_json(data: Any, *, allow_nan: bool = False) -> str:
    """Write data as JSON for a script, which would end at the first "</" wherever it stands."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=allow_nan)
    return text.replace("<", "\\u003c")


def script(code: str) -> Markup:
    """Write a script element that holds its code."""
    return Markup(f"<script>{code}</script>")


def script_beside(page: Path, name: str, code: str) -> Markup:
    """Write a script beside a page where it is not there yet, and the element that loads it."""
    path = page.with_name(name)
    if not path.is_file() or path.read_text(encoding="utf-8") != code:
        with naming(path):
            path.write_text(code, encoding="utf-8")
    return Markup('<script src="{}"></script>').format(name)
