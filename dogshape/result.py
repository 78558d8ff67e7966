"""Base of the public results: text as on the command line, record, table, figure and page."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from html import escape
from itertools import zip_longest
from pathlib import Path
from typing import Any

from markupsafe import Markup

from dogshape.argument_types import check_types, check_types_of_verbs
from dogshape.pipeline.record import Figure, Frame, Table
from dogshape.pipeline.reports.text import bind_units


class Result(ABC):
    """Answer to a problem, with the problem; frozen."""

    def __init_subclass__(cls) -> None:
        check_types_of_verbs(cls)

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the record that the command line prints with ``--json``, fit for JSON."""

    @abstractmethod
    def to_frame(self) -> Frame:
        """Return the result as a table, columns named with their units."""

    @abstractmethod
    def to_parts(self) -> list[str | Table]:
        """Return the sentences and tables that ``print`` and the command line show."""

    @abstractmethod
    def plot(self) -> Figure:
        """Draw the main quantity of the result."""

    @check_types
    def report(self, path: str | Path) -> Path:
        """Write a page of the figure, sentences and tables, which opens offline; returns its path.

        StorageError or OSError for a file that cannot be written.
        """
        from dogshape.pipeline.reports.report import Report  # noqa: PLC0415  # plotly

        words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(self).__name__)
        page = Report(words.capitalize())
        page.add("", self._picture(), self.plot(), *self.to_parts())
        page.save(Path(path))
        return Path(path)

    def _picture(self) -> Markup | None:
        """Draw what the page shows above the figure, if anything."""
        return None

    def __repr__(self) -> str:
        return "\n".join(line for part in self.to_parts() for line in _text_lines(part))

    def _repr_html_(self) -> str:
        return html_of(self.to_parts())


def html_of(parts: Iterable[str | Table]) -> str:
    """Format sentences and tables as HTML, as a notebook shows them."""
    return "\n".join(_html(part) for part in parts if part)


def _text_lines(part: str | Table) -> list[str]:
    """Format a sentence or a table as lines of text, columns aligned."""
    if isinstance(part, str):
        return [part]
    rows: list[Sequence[str]] = [part.heads]
    for row in part.rows:
        rows += zip_longest(*(cell.split("\n") for cell in row), fillvalue="")
    cells = [row for row in rows if len(row) == len(part.heads)]  # a group has one cell
    widths = [max(map(len, column)) for column in zip_longest(*cells, fillvalue="")]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _html(part: str | Table) -> str:
    """Format a sentence or a table as HTML."""
    if isinstance(part, str):
        return f"<div>{_html_text(part)}</div>"
    lines = ["<table>", _html_row(part.heads, "th", part.words)]
    for row in part.rows:
        span = len(part.heads) if len(row) < len(part.heads) else 1
        lines.append(_html_row(row, "td", part.words, span))
    return "\n".join([*lines, "</table>"])


def _html_row(cells: Sequence[str], tag: str, text_columns: Sequence[int], span: int = 1) -> str:
    """Format a row of a table; the first column and ``text_columns`` are set to the left."""
    parts = []
    for column, cell in enumerate(cells):
        side = "left" if column == 0 or column in text_columns else "right"
        attributes = f' style="text-align:{side}"'
        if span > 1:
            attributes += f' colspan="{span}"'
        parts.append(f"<{tag}{attributes}>{_html_text(cell)}</{tag}>")
    return f"<tr>{''.join(parts)}</tr>"


def _html_text(text: str) -> str:
    """Escape a text, with a line break for each new line."""
    return escape(bind_units(text)).replace("\n", "<br>")
