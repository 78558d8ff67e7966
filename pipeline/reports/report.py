"""Pages in one file that open offline: a report is built of tables, figures and captions.

``Report(title, headline).add("Front", figure, "caption", table).save(path)``
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import quote

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape
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
    sections: list[tuple[str, str, Markup]] = field(default_factory=list)

    def add(self, title: str, *parts: Part) -> Report:
        """Add a section; one of captions alone is left out."""
        anchor = re.sub(r"\W+", "-", title.lower()).strip("-") or "summary"
        given = [part for part in parts if part is not None and part != ""]
        if any(not isinstance(part, str) or isinstance(part, Markup) for part in given):
            body = Markup("\n").join(
                _html(part, after, f"{anchor}-{place}")
                for place, (part, after) in enumerate(zip_longest(given, given[1:]))
                if not _is_caption(part) or place == 0 or not _is_figure(given[place - 1])
            )
            self.sections.append((title, anchor, body))
        return self

    def save(self, path: Path) -> None:
        """Write the page."""
        drawn = any('class="plotly-graph-div"' in body for _, _, body in self.sections)
        more = {} if drawn else {"plotly": ""}
        write_page(path, "report.html.j2", report=self, **more)


def _is_caption(part: Part) -> bool:
    return isinstance(part, str) and not isinstance(part, Markup)


def _is_figure(part: Part) -> bool:
    return isinstance(part, go.Figure)


def _html(part: Part, after: Part, name: str) -> Markup:
    """Write a part as HTML; a figure keeps the caption ``after`` it on its sheet of paper."""
    if isinstance(part, Table):
        return table_html(part)
    if isinstance(part, go.Figure):
        note = _note(after) if _is_caption(after) else ""
        return Markup('<div class="keep">{}{}</div>').format(Markup(figure_html(part, name)), note)
    return part if isinstance(part, Markup) else _note(part)


def _note(text: Part) -> Markup:
    return Markup('<p class="note">{}</p>').format(text)


def table_html(table: Table) -> Markup:
    """Write a table as HTML; one without heads lists facts by their names."""
    facts = not any(table.heads)
    words = {0, *table.words}
    head = Markup("").join(
        Markup("<th{}>{}</th>").format(_class("words" if k in words else ""), title)
        for k, title in enumerate(table.heads)
    )
    rows = []
    for place, row in enumerate(table.rows):
        look = table.looks.get(place, "")
        if look == "group":
            cells = Markup('<td colspan="{}">{}</td>').format(len(table.heads), row[0])
        else:
            cells = Markup("").join(_cell(text, k, k in words, facts) for k, text in enumerate(row))
        rows.append(Markup("<tr{}>{}</tr>").format(_class(look), cells))
    whole = Markup('<div class="scroll"><table class="{}">{}<tbody>{}</tbody></table></div>{}')
    return whole.format(
        "facts" if facts else "data",
        "" if facts else Markup("<thead><tr>{}</tr></thead>").format(head),
        Markup("\n").join(rows),
        _note(table.note) if table.note else "",
    )  # fmt: skip


def _cell(text: str, place: int, words: bool, facts: bool) -> Markup:
    kind = "th" if facts and place == 0 else "td"
    look = " ".join(["words"] * words + ["bad"] * isinstance(text, Bad))
    inner = text if isinstance(text, Markup) else Markup("<br>").join(escape(text).split("\n"))
    return Markup("<{}{}>{}</{}>").format(kind, _class(look), inner, kind)


def _class(look: str) -> Markup:
    return Markup(' class="{}"').format(look) if look else Markup("")


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
    content.setdefault("plotly", script(get_plotlyjs()))
    page = environment.get_template(template).render(**content)
    with naming(path):
        path.write_text(page, encoding="utf-8")


def figure_html(figure: go.Figure, name: str) -> str:
    """Write a figure as HTML that uses the code which the page carries."""
    settings = {"displayModeBar": False, "responsive": True}
    html: str = figure.to_html(
        full_html=False, include_plotlyjs=False, div_id=name, config=settings
    )
    return html


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
