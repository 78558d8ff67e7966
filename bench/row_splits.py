"""Rows that stand for several shifts: lists of times in a cell, and shares that engaged.

A row with a list ``116, 131, 88`` in the column of times becomes a row for each, where nothing
contradicts. A row of n shifts of which k engaged becomes two, where the user says that its time is
the mean of those k: ``columns={"engaged": "engaged [%]:share"}``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dogshape.bench.cell_values import Column, is_blank, is_number, numbers_of, split_quantity
from dogshape.bench.column_options import Match, column_labels
from dogshape.bench.draft_arguments import NONE, column_placeholder
from dogshape.bench.foreign_columns import matched
from dogshape.bench.foreign_table import ForeignTable
from dogshape.bench.quantities import MEAN, SHIFT_QUANTITIES, SHIFTS, has_word, plain_words, score

#: Words behind the column of an option: its cells are shares or numbers of shifts that engaged, or
#: of those that failed.
SHARE, NUMBER, FAILED = "share", "number", "failed"
WHOLE_TOLERANCE = 1e-9  #: distance from a whole number up to which a product of decimals is one
MAX_LISTED = 6  #: rows that a sentence lists
#: Between the numbers of a list; a comma needs a blank, as it may be a decimal sign.
_SEPARATORS = (r",\s+", r"\s*;\s*", r"\s*/\s*", r"\s*\|\s*")
_STATISTICS = rf"{MEAN}|min|max|\w*std\w*|sd|sigma|range|spannweite"
_FRACTION = re.compile(r"(\d+)\s*(?:/|\||of|von|aus|out of|sur|di|de|z|ze|av|van|su)\s*(\d+)")
_PERCENT = re.compile(r"(\d+(?:[.,]\d+)?)\s*%")
_DECIMALS = re.compile(r"[.,](\d+)$")


# ---- lists of times


def list_parts(cell: str) -> list[str]:
    """Split a cell into the numbers of a list, empty for any other cell."""
    text = cell.strip(" ,;/|")
    for separator in _SEPARATORS:
        parts = re.split(separator, text)
        if len(parts) > 1 and all(is_number(split_quantity(part)[0]) for part in parts):
            return parts
    return []


def with_lists(
    table: ForeignTable, options: Mapping[str, str]
) -> tuple[ForeignTable, Mapping[str, str]]:
    """Divide rows with a list of times into shifts, where each number is certain to be one.

    Returns the table as it is where a list may be something else, which its reading refuses.
    """
    times = _list_column(table, options)
    counts = None if times is None else _listed_counts(table, options)
    if times is None or counts is None:
        return table, options
    lists = [list_parts(cell) or [cell] for cell in times.cells]
    lengths = [
        0 if is_blank(cell) else len(parts) for cell, parts in zip(times.cells, lists, strict=True)
    ]
    if not _are_shifts(lists, lengths, counts):
        return table, options
    places = [k for k, parts in enumerate(lists) for _ in parts]
    columns = []
    for column in table.columns:
        cells = [column.cells[k] for k in places]
        if column is times:
            cells = [part for parts in lists for part in parts]
        elif column is counts.column:
            cells = ["1" if lengths[k] else column.cells[k] for k in places]
        columns.append(replace(column, cells=tuple(cells)))
    example = next(cell for cell in times.cells if list_parts(cell))
    remark = f"each number in a cell of '{times.head}', such as '{example}', is a shift of its row"
    if counts.numbers and counts.column is None:
        options = {**options, "n_shifts": "1"}
    return _with_rows(table, columns, places).with_remark(remark), options


class _Counts(NamedTuple):
    """Numbers of shifts by row, empty without a source, and their column."""

    numbers: list[float]
    column: Column | None


def _are_shifts(lists: Sequence[Sequence[str]], lengths: Sequence[int], counts: _Counts) -> bool:
    """Test that lists have as many times as their rows have shifts, or no common order."""
    if not counts.numbers:
        return not _is_ranked(lists)
    fits = all(length in (0, count) for length, count in zip(lengths, counts.numbers, strict=True))
    return fits and (counts.column is not None or all(lengths))


def _listed_counts(table: ForeignTable, options: Mapping[str, str]) -> _Counts | None:
    """Read the number of shifts of each row; None for an uncertain one."""
    text = options.get("n_shifts", "")
    if is_number(text):
        return _Counts([float(numbers_of([text])[0])] * len(table.rows), None)
    labels = column_labels(table.columns)
    other_quantities = {
        labels.get(option) for name, option in options.items() if name != "n_shifts"
    }
    columns = [c for c in table.columns if c not in other_quantities and _scores("n_shifts", c)]
    if text:
        stated = labels.get(text)
        columns = [] if stated is None else [stated]
    if len(columns) > 1 or (text not in ("", NONE) and not columns):
        return None
    if not columns:
        return _Counts([], None)
    return _Counts(list(columns[0].values.tolist()), columns[0])


def _list_column(table: ForeignTable, options: Mapping[str, str]) -> Column | None:
    """Find the column of times with lists in its cells; None for an uncertain one."""
    text = options.get("shift_time_s")
    if text is None:
        candidates = [column for column in table.columns if _scores("shift_time_s", column)]
    else:
        labels = column_labels(table.columns)
        label = labels.get(text, labels.get(text.rpartition(":")[0]))
        candidates = [label] if label is not None else []
    candidates = [c for c in candidates if not c.hidden and any(map(list_parts, c.cells))]
    other_columns = [c for c in table.columns if c not in candidates]
    if len(candidates) != 1 or _has_spread_or_trace(other_columns, options):
        return None
    times = candidates[0]
    words = plain_words(times.name)
    if has_word(_STATISTICS, words) or re.search(r"[/;|,]", times.name):
        return None
    readable = [
        is_blank(cell) or is_number(split_quantity(cell)[0]) or bool(list_parts(cell))
        for cell in times.cells
    ]
    return times if all(readable) else None


def _has_spread_or_trace(columns: Sequence[Column], options: Mapping[str, str]) -> bool:
    """Test that a column or an option says of a row that it is one shift or one mean."""
    if options.get("shift_time_sd_s", "") not in ("", NONE):
        return True
    if "shift_time_sd_s" not in options and any(_scores("shift_time_sd_s", c) for c in columns):
        return True
    return any(_scores("trace", column) and any(column.cells) for column in columns)


def _scores(name: str, column: Column) -> bool:
    return score(SHIFT_QUANTITIES[name], column) > 0.0


def _is_ranked(lists: Sequence[Sequence[str]]) -> bool:
    """Test that numbers of all lists have one order, as phases, or a mean with its deviation."""
    ranks = {
        tuple(np.argsort(numbers_of([split_quantity(part)[0] for part in parts]), kind="stable"))
        for parts in lists
        if len(parts) > 1
    }
    lengths = {len(parts) for parts in lists}
    if len(lengths) > 1 or len(ranks) > 1:
        return False
    rank = next(iter(ranks))
    in_order = rank in (tuple(range(len(rank))), tuple(range(len(rank)))[::-1])
    return len(lists) > 1 or in_order


def _with_rows(
    table: ForeignTable, columns: Sequence[Column], places: Sequence[int]
) -> ForeignTable:
    """Replace columns, and repeat the rows at these places."""
    body = tuple(table.layout.body[k] for k in places)
    return replace(table, layout=replace(table.layout, body=body), columns=tuple(columns))


# ---- shares that engaged


@dataclass(frozen=True)
class _Part:
    """Shifts of a row with one outcome; None for an unknown outcome or count."""

    place: int
    outcome: bool | None
    count: int | None


def with_shares(
    table: ForeignTable, options: Mapping[str, str]
) -> tuple[ForeignTable, Mapping[str, str], list[str]]:
    """Divide rows into engaged and failed shifts, by the option of ``engaged``.

    The option of ``engaged`` ends with ``:share``, ``:number`` or ``:failed``. Returns the table,
    its options with the columns of outcomes and numbers, and faults.
    """
    head, _, word = options.get("engaged", "").rpartition(":")
    outcome = column_labels(table.columns).get(head)
    if outcome is None or word not in (SHARE, NUMBER, FAILED):
        return table, options, []
    other_columns = [column for column in table.columns if column is not outcome]
    matches = matched(other_columns, SHIFTS, {**options, "engaged": NONE}).matches
    by_name = {match.quantity.name: match for match in matches}
    counts = _counts_of(by_name.get("n_shifts"), len(table.rows))
    parts: list[_Part] = []
    faults: list[str] = []
    rounded: list[str] = []
    for k, cell in enumerate(outcome.cells):
        if is_blank(cell):
            count = int(counts[k]) if math.isfinite(counts[k]) else None
            parts.append(_Part(k, None, count))
            continue
        try:
            engaged, total, is_rounded = _engaged_count(outcome, cell, counts[k], word)
        except ValueError as error:
            faults.append(f"row {table.rows[k]}: '{cell}' {error}")
            continue
        rounded += [f"row {table.rows[k]}: {engaged} of {total}"] if is_rounded else []
        outcomes = ((True, engaged), (False, total - engaged))
        parts += [_Part(k, engages, count) for engages, count in outcomes if count]
    if faults:
        remainder = f" and {len(faults) - MAX_LISTED} more" if len(faults) > MAX_LISTED else ""
        listed = f"{'; '.join(faults[:MAX_LISTED])}{remainder}"
        return table, {**options, "engaged": NONE}, [f"'{outcome.head}' (engaged): {listed}"]
    divided, count_place = _divide_rows(table, by_name, outcome, parts)
    remark = (
        f"'{outcome.head}' divides rows into shifts that engaged, whose mean is the time of the "
        "row, and shifts that did not"
    )
    if rounded:
        remark += f" (rounded: {', '.join(rounded)})"
    columns = {"engaged": f"column {outcome.place}", "n_shifts": f"column {count_place}"}
    return divided.with_remark(remark), {**options, **columns}, []


def _divide_rows(
    table: ForeignTable, matches: Mapping[str, Match], outcome: Column, parts: Sequence[_Part]
) -> tuple[ForeignTable, int]:
    """Write a row for each part; time and spread stay with the engaged shifts.

    Returns the table, and the place of the column with the numbers of shifts.
    """
    results = {
        column
        for name in ("shift_time_s", "shift_time_sd_s", "trace")
        if name in matches
        for column, _ in matches[name].terms
    }
    count_match = matches.get("n_shifts")
    count_cells = tuple("" if part.count is None else str(part.count) for part in parts)
    divided_rows = {
        part.place for part, following in pairwise(parts) if part.place == following.place
    }
    columns = []
    for column in table.columns:
        cells = [column.cells[part.place] for part in parts]
        if column is outcome:
            words = {True: "yes", False: "no", None: ""}
            cells = [words[part.outcome] for part in parts]
        elif column in results:
            cells = [
                "" if part.outcome is False and part.place in divided_rows else cell
                for part, cell in zip(parts, cells, strict=True)
            ]
        column_part = replace(column, cells=tuple(cells))
        columns.append(replace(column_part, is_outcome=True) if column is outcome else column_part)
    place = max(column.place for column in columns) + 1
    if count_match is not None and len(count_match.terms) == 1 and count_match.formula == "c0":
        index = table.columns.index(count_match.column)
        columns[index] = replace(columns[index], cells=count_cells)
        place = columns[index].place
    else:
        head = f"number by '{outcome.head}'"
        columns.append(Column(place, head, head, None, cells=count_cells))
    return _with_rows(table, columns, [part.place for part in parts]), place


def _counts_of(match: Match | None, rows: int) -> list[float]:
    """Read the number of shifts of each row, NaN without a source."""
    if match is None:
        return [math.nan] * rows
    if not match.terms:
        return [float(match.formula)] * rows
    return list(match.column.values.tolist()) if match.formula == "c0" else [math.nan] * rows


def _engaged_count(column: Column, cell: str, count: float, word: str) -> tuple[int, int, bool]:
    """Read the number of engaged shifts and of all shifts of a row, and whether it was rounded.

    Raises ValueError, with the rest of a sentence, for a share that is no whole number of shifts.
    """
    fraction = _FRACTION.fullmatch(cell)
    if fraction:
        stated, total = int(fraction[1]), int(fraction[2])
        if math.isfinite(count) and count != total:
            raise ValueError(f"is of {total} shifts, but their number is {count:g}; correct one")
    elif not math.isfinite(count) or count < 1 or count % 1:
        remedy = f"say {column_placeholder('n_shifts')}, or a number for all rows"
        raise ValueError(f"is of an unknown number of shifts; {remedy}")
    else:
        total = int(count)
        percent = _PERCENT.fullmatch(cell)
        text = percent[1] if percent else cell
        if not is_number(text):
            raise ValueError("is no share and no number; correct or empty the cell")
        value = float(numbers_of([text])[0])
        in_percent = percent is not None or (column.unit is not None and column.unit.text == "%")
        is_small = bool(np.nanmax(column.values, initial=0.0) <= 1.0)
        if in_percent or (word == SHARE or (word == FAILED and is_small and value % 1)):
            scale = 100.0 if in_percent else 1.0
            return _share_count(text, value / scale, scale, total, word)
        if value % 1:
            raise ValueError("is no whole number of shifts; correct it, or say :share")
        stated = int(value)
    if not 0 <= stated <= total:
        raise ValueError(f"is no part of {total} shifts; correct one of both")
    return (total - stated if word == FAILED else stated), total, False


def _share_count(
    text: str, share: float, scale: float, total: int, word: str
) -> tuple[int, int, bool]:
    """Read a share of shifts as a whole number; a rounded one has to leave a single number."""
    if not 0.0 <= share <= 1.0:
        raise ValueError("is no share between 0 and 1; say :number for numbers of shifts")
    decimals = _DECIMALS.search(text)
    half_step = 0.5 * 10.0 ** -(len(decimals[1]) if decimals else 0) / scale
    exact = share * total
    counts = [k for k in range(total + 1) if abs(k / total - share) <= half_step + WHOLE_TOLERANCE]
    is_whole = abs(exact - round(exact)) <= WHOLE_TOLERANCE * total
    if not is_whole and len(counts) != 1:
        raise ValueError(
            f"of {total} shifts are {exact:.4g}, but must be a whole number of shifts; write the "
            f"number, such as {round(exact)}/{total}"
        )
    stated = round(exact) if is_whole else counts[0]
    return (total - stated if word == FAILED else stated), total, not is_whole
