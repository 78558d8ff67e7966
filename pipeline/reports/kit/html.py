"""Pages from templates, with their figures, scripts and data, in one file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from dogshape.sim.files import naming


def render(template: str, **content: Any) -> str:
    """Fill a template of the package; plotly's code is put in once unless content brings it."""
    environment = Environment(
        loader=PackageLoader("dogshape.pipeline.reports"),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    if "plotly" not in content:
        content["plotly"] = script(get_plotlyjs())
    page: str = environment.get_template(template).render(**content)
    return page


def figure_html(figure: go.Figure, name: str) -> str:
    """Write a figure as HTML that uses the code which the page carries."""
    settings = {"displayModeBar": False, "responsive": True}
    html: str = figure.to_html(
        full_html=False, include_plotlyjs=False, div_id=name, config=settings
    )
    return html


def write_page(path: Path, template: str, **content: Any) -> None:
    """Fill a template and write the page, one HTML file that opens offline."""
    page = render(template, **content)
    with naming(path):
        path.write_text(page, encoding="utf-8")


def csv_link(text: str) -> str:
    """Write a table as a data URL, which needs no network."""
    return "data:text/csv;charset=utf-8," + quote(text)


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
