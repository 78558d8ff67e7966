"""Filling the templates of pages; figures as HTML without plotly's code of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
    """Return a figure as HTML that uses the code which the page carries."""
    html: str = figure.to_html(
        full_html=False,
        include_plotlyjs=False,
        div_id=name,
        config={"displayModeBar": False, "responsive": True},
    )
    return html


def script(code: str) -> Markup:
    """Return a script element that holds its code."""
    return Markup(f"<script>{code}</script>")


def script_beside(page: Path, name: str, code: str) -> Markup:
    """Return a script element for a file beside a page, written where it is not there yet."""
    path = page.with_name(name)
    if not path.is_file() or path.read_text(encoding="utf-8") != code:
        with naming(path):
            path.write_text(code, encoding="utf-8")
    return Markup('<script src="{}"></script>').format(name)
