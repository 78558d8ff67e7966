"""Base of all results: repr, HTML, printed parts, and conversion into data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.record import Table

if TYPE_CHECKING:
    import pandas as pd


class Result(ABC):
    """Answer to a problem, which it carries; frozen, so that it stays what was computed."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Give the record that the command line prints with ``--json``, fit for JSON."""

    @abstractmethod
    def to_frame(self) -> pd.DataFrame:
        """Give the result as a table, columns named with their units."""

    @property
    @abstractmethod
    def facts(self) -> dict[str, str]:
        """Headline values, each with its unit."""

    @property
    def parts(self) -> list[str | Table]:
        """Sentences and tables that the command line prints."""
        return [f"{name}: {value}" for name, value in self.facts.items()]

    def __repr__(self) -> str:
        facts = ", ".join(f"{name} {value}" for name, value in self.facts.items())
        return f"{type(self).__name__}({facts})"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th><td>{escape(value)}</td></tr>"
            for name, value in self.facts.items()
        )
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"
