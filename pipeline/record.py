"""Results: record, table, frame, schema and reference page follow from one declaration.

A ``Record`` declares each key once (``key``): its meaning and unit, and for people the head of its
column, the scale from the stored to the printed value and the format. Console and pages print the
same ``Table``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from pydantic import ModelWrapValidatorHandler, model_validator

from dogshape.sim.clutch_tables import Section, declared_key

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

    Frame: TypeAlias = pd.DataFrame
    Figure: TypeAlias = go.Figure
else:  # they take half a second to load, which a quick answer does not need
    Frame = Figure = Any

SHARE = "share"  #: unit of quantities between 0 and 1
MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Table:
    """A table for console and pages."""

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    #: look of a row by its place, ``best``, ``prototype`` or ``group`` (a row of one cell)
    looks: Mapping[int, str] = field(default_factory=dict)
    words: Sequence[int] = ()  #: columns of text, besides the first
    note: str = ""


class Bad(str):
    """Text of a cell that speaks against a design."""

    __slots__ = ()


class Record(Section):
    """A result, or a row of one; unknown keys are refused."""

    def to_dict(self) -> dict[str, Any]:
        """Return the record as JSON takes it, without keys that were not set."""
        return self.model_dump(exclude_unset=True)

    def cell(self, name: str) -> str:
        """Print the value of a key in the format of its column; None as a dash."""
        value = getattr(self, name)
        declared = declared_key(type(self), name)
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, str):
            return value
        if value is None or math.isnan(value):
            return "-"
        scaled = value if declared.scale == 1.0 else declared.scale * value
        return f"{scaled:{declared.form}}".replace("-", MINUS).replace("%", " %")


class FileRecord(Record):
    """A record that a file holds; its JSON has the keys in the order in which they were given."""

    @model_validator(mode="wrap")
    @classmethod
    def _keep_order(cls, values: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Order the values of a validated record as its keys were given."""
        record = handler(values)
        if isinstance(values, dict):
            validated = record.__dict__
            ordered = {name: validated[name] for name in values}
            object.__setattr__(record, "__dict__", ordered | validated)
        return record


def percent(margin: float) -> str:
    """Print a margin in percent, with decimals where it is small."""
    size = abs(margin)
    digits = 0
    if 0.001 <= size < 0.05:
        digits = 1
    elif 5e-5 <= size < 0.001:
        digits = 2
    return f"{100 * margin:z.{digits}f} %".replace("-", MINUS)


def tabulate(kind: type[Record], rows: Sequence[Record], *names: str) -> Table:
    """Tabulate keys of records, by default all that have a head."""
    columns = names or [name for name in kind.model_fields if declared_key(kind, name).head]
    heads = [declared_key(kind, name).head for name in columns]
    return Table(heads, [[row.cell(name) for name in columns] for row in rows])


def frame_of(rows: Sequence[Record | dict[str, Any]]) -> pd.DataFrame:
    """Build a frame of records, or of rows of values by key, with a column for each key.

    Columns of records are in the order of their declaration.
    """
    import pandas as pd  # noqa: PLC0415  # half a second that a quick answer does not need

    return pd.DataFrame([_declared_order(row) if isinstance(row, Record) else row for row in rows])


def _declared_order(record: Record) -> dict[str, Any]:
    """Return the values of a record by key, in the order of the declaration."""
    values = record.to_dict()
    return {name: values[name] for name in type(record).model_fields if name in values}


def number_or_none(value: float | None) -> float | None:
    """Return a number that JSON can hold: None for None, NaN and infinity."""
    return value if value is not None and math.isfinite(value) else None
