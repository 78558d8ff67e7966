"""Repeats as columns: each row of a table becomes a row for each of its shifts.

No answer that is offered drops shifts that a table has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dogshape.bench.cell_values import Column, is_blank
from dogshape.bench.column_options import column_labels
from dogshape.bench.foreign_table import REPEATS, ROUNDED, ForeignTable
from dogshape.bench.quantities import (
    MEAN,
    SHIFT_COUNT,
    SHIFT_TIME,
    SHIFT_TIME_SD,
    counts_up,
    has_word,
    plain_words,
    repeated_name,
    score,
)

MIN_REPEATS = 3  #: numbered columns that are repeats, unless a word of a shift time names them


def with_repeats(
    table: ForeignTable, options: Mapping[str, str]
) -> tuple[ForeignTable, Mapping[str, str], list[str]]:
    """Reshape columns of repeats into rows, one for each shift.

    Returns the table, the options with the column that holds all repeats, and questions.
    """
    repeats, unit = _stated_repeats(table.columns, options.get("shift_time_s", ""))
    if not repeats and "shift_time_s" not in options:
        repeats = _certain_repeats(table.columns)
    if not repeats:
        return table, options, []
    other_columns = [column for column in table.columns if column not in repeats]
    summaries, questions = _summaries_of(repeats, other_columns)
    other_columns = [column for column in other_columns if column not in summaries]
    places: list[int] = []
    times_cells: list[str] = []
    empty: list[tuple[int, str]] = []
    for k, row in enumerate(table.rows):
        for column in repeats:
            if is_blank(column.cells[k]):
                empty.append((row, f"'{column.head}' is empty"))
            else:
                places.append(k)
                times_cells.append(column.cells[k])
    first = repeats[0]
    times = replace(
        first,
        head="; ".join(column.head for column in repeats),
        name=repeated_name(first) or first.name,
        cells=tuple(times_cells),
        repeats=len(repeats),
    )
    repeated = [replace(c, cells=tuple(c.cells[k] for k in places)) for c in other_columns]
    body = tuple(table.layout.body[k] for k in places)
    reshaped = replace(
        table,
        layout=replace(table.layout, name=REPEATS, body=body),
        columns=tuple(sorted([*repeated, times], key=lambda column: column.place)),
        left_out=sorted([*table.left_out, *empty]),
        summaries=tuple((column.head, "summary of the repeats") for column in summaries),
    )
    return reshaped, {**options, "shift_time_s": f"{times.head}{unit}"}, questions


def _stated_repeats(columns: Sequence[Column], text: str) -> tuple[list[Column], str]:
    """Read ``t1 [ms]; t2 [ms]:s``: columns that are shifts each, and their unit with its colon."""
    labels = column_labels(columns)
    heads, colon, unit = text.rpartition(":")
    for names, suffix in ((text, ""), (heads, colon + unit)):
        parts = [name.strip() for name in names.split(";")]
        if len(parts) > 1 and set(parts) <= set(labels):
            return [labels[name] for name in parts], suffix
    return [], ""


def _certain_repeats(columns: Sequence[Column]) -> list[Column]:
    """Find numbered columns of shift times that are no phases of a shift."""
    groups: dict[str, list[Column]] = {}
    for column in columns:
        name = repeated_name(column)
        if name is not None and not column.hidden and np.isfinite(column.values).any():
            groups.setdefault(name, []).append(column)
    for name, group in groups.items():
        units = {column.unit.text if column.unit else "" for column in group}
        worded = has_word(SHIFT_TIME.words, name)
        enough = len(group) >= (2 if worded else MIN_REPEATS)
        if enough and len(units) == 1 and not has_word(SHIFT_TIME.against, name):
            values = np.array([column.values for column in group])
            phases = (np.diff(values, axis=0)[:, np.isfinite(values).all(axis=0)] > 0.0).all()
            if worded or not phases or values.shape[1] < 2:
                return group
    return []


def _summaries_of(
    repeats: Sequence[Column], other_columns: Sequence[Column]
) -> tuple[list[Column], list[str]]:
    """Select the columns that hold mean, spread or number of the repeats.

    Also returns a question for each mean or number that the repeats do not give.
    """
    values = np.ma.masked_invalid([column.values for column in repeats])
    summaries, questions = [], []
    for column in other_columns:
        name = plain_words(column.name)
        if score(SHIFT_TIME_SD, column) > 0.0:
            summaries.append(column)
            continue
        if has_word(MEAN, name):
            expected = values.mean(axis=0)
        elif score(SHIFT_COUNT, column) > 0.0 and not counts_up(column):
            expected = values.count(axis=0)
        else:
            continue
        summaries.append(column)
        is_equal = np.isclose(
            column.values, np.ma.filled(expected, np.nan), rtol=ROUNDED, equal_nan=True
        )
        if not is_equal.all():
            questions.append(
                f"'{column.head}' is neither mean nor number of {repeats[0].head} to "
                f"{repeats[-1].head} in every row; give each shift a row of its own"
            )
    return summaries, questions
