"""Base of all results: text as on the command line, record and table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.record import Table

if TYPE_CHECKING:
    from pandas import DataFrame as Frame
    from plotly.graph_objects import Figure
else:  # they take half a second to load, which a quick answer does not need
    Frame = Figure = Any

__all__ = ["Figure", "Frame", "Result"]


class Result(ABC):
    """Answer to a problem, which it carries; frozen, so that it stays what was computed."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Give the record that the command line prints with ``--json``, fit for JSON."""

    @abstractmethod
    def to_frame(self) -> Frame:
        """Give the result as a table, columns named with their units."""

    @abstractmethod
    def to_parts(self) -> list[str | Table]:
        """Give the sentences and tables that ``print`` and the command line show."""

    def __repr__(self) -> str:
        return "\n".join(line for part in self.to_parts() for line in _lines(part))


def _lines(part: str | Table) -> list[str]:
    if isinstance(part, str):
        return [part]
    rows = [part.heads, *part.rows]
    cells = [row for row in rows if len(row) == len(part.heads)]  # a group has one cell
    widths = [max(map(len, column)) for column in zip_longest(*cells, fillvalue="")]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
