"""Rows and marks of a foreign table: questions on rows that may be no shifts.

Fourth step of reading. Four kinds of evidence raise a question: a column in which few rows have a
sign, words that split the shifts into groups, numbers of engaged shifts, and what a workbook shows
on a row (hidden, filtered, grouped, struck out, coloured, with a comment). Each is one question
with the rows that it concerns, and three answers: ``drop=["COLUMN=VALUE"]`` leaves rows out,
``keep=["COLUMN=VALUE"]`` takes these rows alone, ``rows="2-7,10"`` names the shifts. ``*`` is any
sign, ``keep=["COLUMN=*"]`` takes all rows. The column of a workbook's marks is ``row``:
``drop=["row=hidden"]``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from dogshape.bench.cell_values import ANSWERS, Column, answer_of, is_blank, is_dated, is_number
from dogshape.bench.draft_arguments import (
    column_argument,
    drop_argument,
    keep_argument,
    rows_argument,
    rows_example,
)
from dogshape.bench.foreign_table import REJECTED, ROUNDED, ForeignTable
from dogshape.bench.quantities import SPLITTING, counts_up, has_word, plain_words
from dogshape.bench.raw_sheet import is_workbook
from dogshape.bench.row_splits import FAILED, NUMBER, SHARE
from dogshape.bench.workbook import COLOURED, odd_colours
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.interface import argument

ROW = "row"  #: name of a workbook's marks among the columns
ANY = "*"
MAX_GROUPS = 6  #: words that recur and divide shifts; more of them are a text
MAX_SHOWN = 6  #: rows that a question shows
_FLAG = (
    r"ungueltig\w*|invalid\w*|ausreisser|outliers?|verworfen|reject\w*|discard\w*|exclu\w*|bad|flag"
    r"|omit|ignore|ausgeschlossen|aberrant\w*|rejete|anomal\w*|scart\w*|neplatn\w*|odrzucon\w*"
    r"|valid\w*|gueltig\w*|use|used|verwend\w*|werten|gewertet|valido|valide|platn\w*|ongeldig|quality"
    r"|remark|bemerkung|kommentar|comment|note|notiz|hinweis|anmerkung|remarque|nota|poznamka|uwagi"
)
_POINT = r"\w*punkt|\w*point|op|bp|set ?point|condition|bedingung|punto|bod|label|kombination"
_SHARE = (
    r"engag\w*|i o|n i o|eingelegt|eingerueckt|eingespurt|eingerastet|erfolg\w*|success\w*|ok|io"
    r"|fail\w*"
    r"|fehl\w*|nok|nio|\w*quote|rate|share|anteil|ratio|percent|prozent|taux|reussi\w*|enclench\w*"
    r"|innest\w*|tasso|porcentaje|podil|udzial|misses|hits|blocked|blockiert|hang\w*"
)
_FAILED = r"not|nicht|fail\w*|\w*fehl\w*|nok|nio|n i o|blocked|blockiert|misses|hang\w*|non"
_OF_SO_MANY = r"\b(of|von|aus|sur|di|de|z|av|van) \d+$"
#: Numbers by which programs say that there is none.
_CODES = frozenset(
    [
        "-1",
        "-9",
        "-99",
        "-999",
        "-9999",
        "999",
        "999.9",
        "999,9",
        "9999",
        "99999",
        "-99999",
        "-999.9",
        "-1.0",
    ]
)
_PHYSICAL = (
    r"temp\w*|\w*temperatur|\w*druck|pressure|feuchte|humidity|voltage|spannung|strom|current"
)
_FRACTION = re.compile(
    r"\d+\s*(?:/|\||of|von|aus|out of|sur|di|de|z|ze|av|van|su)\s*\d+|\d+(?:[.,]\d+)?\s*%"
)


@dataclass(frozen=True)
class RowChoice:
    """Answers of the user on rows: texts ``COLUMN=VALUE`` to drop and to keep.

    ``named`` says that the rows of shifts are named one by one, which answers all questions on
    rows; ``fill_down`` that an empty set value is that of the row above.
    """

    drop: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    named: bool = False
    fill_down: bool = False


@dataclass(frozen=True)
class RowPlan:
    """Rows that are shifts, and questions on rows.

    ``settled`` are the columns of answers, ``share`` is one with numbers of engaged shifts.
    """

    rows: tuple[int, ...]
    questions: tuple[str, ...]
    settled: frozenset[str] = frozenset()
    share: Column | None = None

    def lines(self) -> Iterator[str]:
        """Describe the rows, a line each."""
        yield f"{len(self.rows)} shifts in rows {spans_of(self.rows)}"
        yield from (f"answered: {name}" for name in sorted(self.settled))
        yield from (f"question: {question}" for question in self.questions)


def spans_of(rows: Sequence[int]) -> str:
    """Format row numbers as the argument ``rows`` reads them, ``2-7,10``."""
    spans: list[list[int]] = []
    for row in sorted(set(rows)):
        if spans and row == spans[-1][1] + 1:
            spans[-1][1] = row
        else:
            spans.append([row, row])
    return ",".join(f"{a}-{b}" if b > a else str(a) for a, b in spans)


def marks_of(table: ForeignTable) -> list[list[str]]:
    """List the marks of each row of a table, as a workbook shows them."""
    marks = [[*row.marks] for row in table.layout.body]
    for place in odd_colours(table.layout.body):
        marks[place].append(COLOURED)
    return marks


# ---- answers


def chosen_rows(table: ForeignTable, choice: RowChoice) -> tuple[ForeignTable, frozenset[str]]:
    """Take the rows that the user keeps; also name the columns that the answers are about.

    Raises InputError for a column or value that the table does not have.
    """
    if not (choice.drop or choice.keep):
        return table, frozenset()
    marks = marks_of(table)
    reasons: dict[int, str] = {}  #: for leaving rows out, by place
    settled: set[str] = set()
    selections_by_name: dict[str, list[list[bool]]] = {}
    for text in choice.drop:
        name, hits = _selected(table, marks, text, "drop")
        settled.add(name)
        for k in np.flatnonzero(hits).tolist():
            reasons.setdefault(k, f"{argument('drop')} {text}")
    for text in choice.keep:
        name, hits = _selected(table, marks, text, "keep")
        settled.add(name)
        selections_by_name.setdefault(name, []).append(hits)
    for name, selections in selections_by_name.items():
        for k in np.flatnonzero(~np.any(selections, axis=0)).tolist():
            reasons.setdefault(k, f"not among {argument('keep')} of '{name}'")
    excluded = [(table.rows[k], reason) for k, reason in reasons.items()]
    places = [k for k in range(len(table.rows)) if k not in reasons]
    return table.taking(places, excluded), frozenset(settled)


def _selected(
    table: ForeignTable, marks: Sequence[Sequence[str]], text: str, answer: str
) -> tuple[str, list[bool]]:
    """Find the rows that an answer, ``drop`` or ``keep``, selects, and the head of its column."""
    labels = {column.name: column for column in table.columns}
    labels |= {column.head: column for column in table.columns}
    names = sorted([*labels, ROW], key=len, reverse=True)
    name = next((name for name in names if text.startswith(f"{name}=")), None)
    if name is None:
        column_text = text.partition("=")[0]
        raise InputError(
            f"{argument(answer)} is '{text}', but it must be COLUMN=VALUE; "
            f"{did_you_mean(column_text, names)}"
        )
    value = text[len(name) + 1 :].strip()
    everything = value == ANY and answer == "keep"
    pattern = re.compile(re.escape(value).replace(r"\*", ".*"), re.IGNORECASE)
    if name in labels:
        head, cells = labels[name].head, [[cell] for cell in labels[name].cells]
    else:
        head, cells = ROW, [[*row] or [""] for row in marks]
    hits = [
        everything or any(pattern.fullmatch(cell) and bool(cell or not value) for cell in row_cells)
        for row_cells in cells
    ]
    if not any(hits):
        raise InputError(
            f"{argument(answer)} is '{text}', but no row of column '{head}' has that value"
        )
    return head, hits


# ---- questions


def row_plan(
    table: ForeignTable, read: Mapping[Column, str], choice: RowChoice, settled: frozenset[str]
) -> RowPlan:
    """Collect questions on marks, and on columns that may mark rows as no shifts."""
    questions = [*table.layout.questions]
    shares = _shares(table, read, settled)
    if not choice.named:
        questions += _mark_questions(table, settled)
        outcome = next((column for column, name in read.items() if name == "engaged"), None)
        for column in table.columns:
            if column in read or column.head in settled or column in shares:
                continue
            questions += filter(None, [_column_question(table, column, outcome)])
        questions += filter(
            None, [_mean_question(table, read), *_code_questions(table, read, settled)]
        )
    questions += [_share_question(column) for column in shares]
    return RowPlan(table.rows, tuple(questions), settled, next(iter(shares), None))


def _mean_question(table: ForeignTable, read: Mapping[Column, str]) -> str:
    """Ask about rows that are means of those before them at one operating point."""
    by_name = {name: column for column, name in read.items()}
    time = by_name.get("shift_time_s")
    points = [by_name[name] for name in ("mismatch_rpm", "force_N") if name in by_name]
    if time is None or len(points) < 2:
        return ""
    blocks: list[list[int]] = []
    cells = [*zip(*(column.cells for column in points), strict=True)]
    for k, point in enumerate(cells):
        if k and point == cells[k - 1]:
            blocks[-1].append(k)
        else:
            blocks.append([k])
    blocks = [block for block in blocks if len(block) > 2]
    means = [
        math.isclose(time.values[block[-1]], time.values[block[:-1]].mean(), rel_tol=ROUNDED)
        for block in blocks
    ]
    if len(blocks) < 2 or not all(means):
        return ""
    rows = [table.rows[block[-1]] for block in blocks]
    other_rows = _other_spans(table, rows)
    return (
        f"rows {_shown(rows)} are the means of those above them at the same operating point; name "
        f"the rows of shifts with {rows_example(other_rows)}"
    )


def _code_questions(
    table: ForeignTable, read: Mapping[Column, str], settled: frozenset[str]
) -> list[str]:
    """Ask about set values that may be codes for no value: -1, 9999."""
    questions = []
    for column, name in read.items():
        if name not in ("mismatch_rpm", "force_N", "shift_time_s") or column.head in settled:
            continue
        codes = sorted({cell for cell in column.cells if cell in _CODES})
        others = [
            abs(value)
            for cell, value in zip(column.cells, column.values, strict=True)
            if cell not in codes and math.isfinite(value)
        ]
        odd = [code for code in codes if others and not _is_among(code, others, column)]
        if odd and 2 * sum(cell in odd for cell in column.cells) <= len(column.cells):
            rows = [row for row, cell in zip(table.rows, column.cells, strict=True) if cell in odd]
            questions.append(
                f"'{column.head}' is {', '.join(odd)} in row {_shown(rows)}, which may be a code "
                f"for no value: {drop_argument(column.head, odd[0])} leaves these rows out, "
                f"{keep_argument(column.head, ANY)} takes all rows"
            )
    return questions


def _is_among(code: str, sizes: Sequence[float], column: Column) -> bool:
    """Test that a value lies among others: another one is negative, or as large."""
    value = float(code.replace(",", "."))
    if value < 0.0:
        return bool((column.values < 0.0).sum() > sum(column.values == value))
    return value <= 3.0 * max(sizes)


def _mark_questions(table: ForeignTable, settled: frozenset[str]) -> list[str]:
    if ROW in settled:
        return []
    groups: dict[str, list[int]] = {}
    for row, marks in zip(table.rows, marks_of(table), strict=True):
        for mark in marks:
            groups.setdefault(mark, []).append(row)
    total = len(set(table.rows))
    groups = {mark: rows for mark, rows in groups.items() if len(set(rows)) < total}
    if not groups:
        return []
    mark_text = "; ".join(f"{mark}: row {_shown(rows)}" for mark, rows in groups.items())
    marked = set(chain.from_iterable(groups.values()))
    other_rows = _other_spans(table, marked)
    first = next(iter(groups))
    # A shell ends the option at an apostrophe; where all rows are marked, * would drop them all.
    is_first = len(marked) == total or len(groups) == 1
    shell_text, apostrophe, _ = first.partition("'")
    named_mark = shell_text + ANY if apostrophe else first
    value = named_mark if is_first else ANY
    place = "workbook" if is_workbook(table.path) else "file"
    return [
        f"rows are marked in the {place} ({mark_text}): are they shifts? "
        f"{drop_argument(ROW, value)} leaves them out, {keep_argument(ROW, ANY)} takes all rows, "
        f"{rows_argument(other_rows)} names the shifts"
    ]


def _other_spans(table: ForeignTable, rows: Iterable[int]) -> str:
    """Format the rows of a table that are not among ``rows``, as ``spans_of`` does."""
    excluded = set(rows)
    return spans_of([row for row in table.rows if row not in excluded])


def _shown(rows: Sequence[int]) -> str:
    distinct = list(dict.fromkeys(rows))
    remainder = f" and {len(distinct) - MAX_SHOWN} more" if len(distinct) > MAX_SHOWN else ""
    return ", ".join(map(str, distinct[:MAX_SHOWN])) + remainder


def _column_question(table: ForeignTable, column: Column, outcome: Column | None) -> str:
    """Ask about an unused column; empty for one that distinguishes no rows."""
    cells = ["" if is_blank(cell) else cell for cell in column.cells]
    groups: dict[str, list[int]] = {}
    for row, cell in zip(table.rows, cells, strict=True):
        groups.setdefault(cell, []).append(row)
    name = plain_words(column.name)
    recurring = has_word(SPLITTING, name) and len(groups) < len(cells)
    numbers_or_dates = is_dated(cells) or (counts_up(column) and not recurring)
    if len(groups) == 1 or numbers_or_dates or not _is_code(column, cells, name):
        return ""
    if _says_outcome(column, outcome) or _labels_points(table, column, name):
        return ""
    if _is_outcome(column, name) and outcome is None:
        return _outcome_question(column, groups)
    return _group_question(table, column, name, groups)


def _group_question(
    table: ForeignTable, column: Column, name: str, groups: Mapping[str, Sequence[int]]
) -> str:
    """Ask about rows with a sign, a flag, a word that divides the rows, or one that rejects."""
    count = len(column.cells)
    signs = {word: rows for word, rows in groups.items() if word}
    rejecting = {word: rows for word, rows in signs.items() if REJECTED.search(word)}
    empty = len(groups.get("", ()))
    if len(groups) == 2 and 2 * empty < count and (empty or has_word(_FLAG, name)):
        return _flag_question(table, column, groups)
    if 2 * empty >= count:
        return _sign_question(table, column, signs)
    splits = len(groups) <= max(3, min(MAX_GROUPS, count // 2)) and len(groups) < count
    if splits or (has_word(SPLITTING, name) and len(groups) <= MAX_GROUPS):
        return _split_question(column, groups)
    return _sign_question(table, column, rejecting) if rejecting else ""


def _is_code(column: Column, cells: Sequence[str], name: str) -> bool:
    """Test that cells are words or signs, or few whole numbers without a unit."""
    filled = [cell for cell in cells if cell]
    if not all(map(is_number, filled)):
        return column.unit is None
    if column.unit is not None or column.strange or has_word(_PHYSICAL, name):
        return False
    is_whole = all(re.fullmatch(r"[+-]?\d{1,2}([.,]0+)?", cell) for cell in filled)
    few = len(set(filled)) <= 3
    return is_whole and (few or has_word(SPLITTING, name))


def _says_outcome(column: Column, outcome: Column | None) -> bool:
    """Test that a column repeats the answers of the outcome."""
    if outcome is None:
        return False
    answers = [ANSWERS.get(answer_of(cell)) for cell in column.cells]
    return answers == [ANSWERS.get(answer_of(cell)) for cell in outcome.cells]


def _is_outcome(column: Column, name: str) -> bool:
    """Test that a column holds yes and no, and is named as no mark of bad rows."""
    words = {word: ANSWERS.get(word, "strange") for word in map(answer_of, column.cells)}
    answered = False in words.values() and "strange" not in words.values()
    return answered and not has_word(_FLAG, name) and not REJECTED.search(column.name)


def _outcome_question(column: Column, groups: Mapping[str, Sequence[int]]) -> str:
    words = {word: ANSWERS.get(answer_of(word)) for word in groups}
    opposite = ",".join(
        f"{answer_of(word)}={'no' if yes else 'yes'}"
        for word, yes in words.items()
        if yes is not None
    )
    no = next(word for word, yes in words.items() if yes is False)
    outcome = column_argument("engaged", column.head)
    opposite_outcome = column_argument("engaged", f"{column.head}:{opposite}")
    drop = drop_argument(column.head, no)
    keep_all = keep_argument(column.head, ANY)
    return (
        f"'{column.head}' holds yes and no and may be the outcome; say {outcome}, "
        f"{opposite_outcome} where its yes is a failure, {drop} or another of its words where such "
        f"rows are no shifts, or {keep_all} where it means nothing"
    )


def _flag_question(table: ForeignTable, column: Column, groups: Mapping[str, Sequence[int]]) -> str:
    rare = min(groups, key=lambda word: len(groups[word]))
    group_text = "; ".join(f"'{word}': row {_shown(rows)}" for word, rows in groups.items())
    drop = drop_argument(column.head, rare)
    keep_all = keep_argument(column.head, ANY)
    rows = rows_argument(_other_spans(table, groups[rare]))
    return (
        f"'{column.head}' marks rows ({group_text}): which are no shifts? {drop} leaves these "
        f"out, {keep_all} takes all rows, {rows} names the shifts"
    )


def _sign_question(table: ForeignTable, column: Column, signs: Mapping[str, Sequence[int]]) -> str:
    sign_text = "; ".join(
        f"row {_shown(rows)}: '{word[:40]}'" for word, rows in [*signs.items()][:MAX_SHOWN]
    )
    other_rows = _other_spans(table, chain.from_iterable(signs.values()))
    has_all = all(not cell or cell in signs for cell in column.cells)
    value = ANY if has_all else next(iter(signs))
    drop = drop_argument(column.head, value)
    keep_all = keep_argument(column.head, ANY)
    rows = rows_argument(other_rows)
    return (
        f"'{column.head}' has a sign in few rows ({sign_text}): are they shifts? {drop} leaves "
        f"them out, {keep_all} takes all rows, {rows} names the shifts"
    )


def _split_question(column: Column, groups: Mapping[str, Sequence[int]]) -> str:
    group_text = "; ".join(f"'{word}': row {_shown(rows)}" for word, rows in groups.items())
    first = next(iter(groups))
    keep = keep_argument(column.head, first)
    keep_all = keep_argument(column.head, ANY)
    rows = rows_argument(spans_of(groups[first]))
    return (
        f"'{column.head}' divides the rows ({group_text}): are they all shifts of one kind? "
        f"{keep} takes these alone, {keep_all} takes all rows, {rows} names the shifts"
    )


def _labels_points(table: ForeignTable, column: Column, name: str) -> bool:
    """Test that a column names the operating points and nothing else."""
    if not has_word(_POINT, name) or has_word(SPLITTING, name):
        return False
    values = [c.cells for c in table.columns if c is not column and c.unit is not None]
    points: dict[str, set[tuple[str, ...]]] = {}
    cells = zip(column.cells, zip(*values, strict=True), strict=True) if values else []
    for word, point in cells:
        points.setdefault(word, set()).add(point[:2])
    return all(len(word_points) == 1 for word_points in points.values())


def _shares(
    table: ForeignTable, read: Mapping[Column, str], settled: frozenset[str]
) -> list[Column]:
    """Find columns with numbers or shares of shifts that engaged, which one row cannot hold."""
    of_means = any((column.values > 1).any() for column, name in read.items() if name == "n_shifts")
    return [
        column
        for column in table.columns
        if read.get(column, "engaged") == "engaged"
        and column.head not in settled
        and _is_share(column, of_means)
    ]


def _is_share(column: Column, of_means: bool) -> bool:
    """Test that a column counts the shifts that engaged or failed.

    ``of_means`` says that rows stand for several shifts, so that 0 and 1 may be numbers of these.
    """
    words = plain_words(column.name)
    filled = [cell for cell in column.cells if cell]
    if not filled or has_word(SPLITTING, words):
        return False
    if any(map(_FRACTION.fullmatch, filled)) or re.search(_OF_SO_MANY, words):
        return True
    percent = column.unit is not None and column.unit.text.strip() == "%"
    answers = set(filled) <= {"0", "1"} and not (of_means and has_word(_FAILED, words))
    numbers = all(map(is_number, filled)) and not answers
    plain = column.unit is None and not counts_up(column)
    return has_word(f"{_SHARE}|{_FAILED}", words) and (percent or (numbers and plain))


def _share_question(column: Column) -> str:
    cell_text = ", ".join([cell for cell in column.cells if cell][:3])
    answer = column_argument("engaged", f"{column.head}:{_share_word(column)}")
    return (
        f"'{column.head}' has shares or numbers of shifts ({cell_text} ...), which say that others "
        f"of the row did not engage: say {answer} where the time of a row is the mean of those "
        "that engaged, or write one row for those that engaged (n_shifts, their mean time, engaged "
        "yes) and one for those that did not (n_shifts, no time, engaged no), or say "
        f"{keep_argument(column.head, ANY)} where it is something else"
    )


def _share_word(column: Column) -> str:
    """Choose the option for a column of shares or numbers of shifts."""
    if has_word(_FAILED, plain_words(column.name)):
        return FAILED
    filled = [cell for cell in column.cells if not is_blank(cell)]
    percent = column.unit is not None
    written = any(map(_FRACTION.fullmatch, filled))
    small = bool(np.nanmax(column.values, initial=0.0) <= 1.0)
    return SHARE if percent or written or small else NUMBER
