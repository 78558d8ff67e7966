"""Pages of tables, figures and captions in one file each, which open offline.

``Report(title, headline).add("Front", figure, "caption", table).save(path)``
"""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeAlias, TypeGuard

import plotly.graph_objects as go
import plotly.io as pio
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from dogshape.pipeline.record import Bad, Table
from dogshape.pipeline.reports.text import bind_units
from dogshape.pipeline.reports.workbook import workbook_of
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.files import name_file_in_errors

#: Plotly without maps and solids, ``make plotly``; of the version that the package ``plotly`` has.
PLOTLY_FILE = "plotly-cartesian.min.js.gz"
#: Keys of the title block of a page with their words.
TITLE_BLOCK = {
    "number": "drawing number",
    "revision": "revision",
    "date": "date",
    "author": "author",
    "checker": "checked by",
    "decided_by": "decided by",
}
DEFAULT_HEIGHT_PX = 450  #: of a figure that states none
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
        plotly = packed_script(plotly_code()) if has_figure else ""
        tables = [
            (title, part) for title, _, body in self.sections for part in body if is_data(part)
        ]
        workbook = base64.b64encode(workbook_of(tables)).decode() if tables else ""
        write_page(path, "report.html.j2", report=self, plotly=plotly, workbook=workbook)


def is_data(part: Part) -> TypeGuard[Table]:
    """Check whether a part is a table with heads; one without lists facts."""
    return isinstance(part, Table) and any(part.heads)


def title_values(block: Mapping[str, str]) -> dict[str, str]:
    """Complete the values of a title block: today's date, the others empty where not given.

    InputError for keys that ``TITLE_BLOCK`` lacks.
    """
    for name in block.keys() - TITLE_BLOCK.keys():
        raise InputError(f"'{name}' is no key of a title block; {did_you_mean(name, TITLE_BLOCK)}")
    values = {**dict.fromkeys(TITLE_BLOCK, ""), "date": f"{datetime.now(UTC):%Y-%m-%d}"}
    return values | {name: text.strip() for name, text in block.items()}


def title_table(values: Mapping[str, str]) -> Table:
    """Tabulate a complete title block; what is empty is filled in by hand."""
    heads = list(TITLE_BLOCK.values())
    return Table(heads, [[values[name] for name in TITLE_BLOCK]], {}, range(len(heads)))


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
    """Write a figure as an empty element and its JSON, which ``unpack.js`` draws."""
    # A script ends at the first tag that ends it, in a text too.
    content = Markup(pio.to_json(figure, validate=False).replace("<", "\\u003c"))
    element = '<div id="{}" class="plotly-graph-div" style="height:{}px"></div>'
    json = '<script type="application/json">{}</script>'
    return Markup(element + json).format(name, figure.layout.height or DEFAULT_HEIGHT_PX, content)


@cache
def plotly_code() -> str:
    """Read the code of Plotly that the pages have."""
    packed = files("dogshape.pipeline.reports").joinpath("templates", PLOTLY_FILE).read_bytes()
    return gzip.decompress(packed).decode()


@cache
def packed_script(code: str) -> Markup:
    """Write a script as compressed text, which ``unpack.js`` runs: a third of its size."""
    text = base64.b64encode(gzip.compress(code.encode(), mtime=0)).decode()
    return Markup('<script type="text/plain" class="packed">{}</script>').format(text)
