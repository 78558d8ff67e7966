"""Columns of a foreign table: which of them are which quantities, in which unit or formula.

Third step of reading. What fits in two ways becomes a question with its option.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.bench.cell_values import PRESSURE, SPEED, TIME, Column, split_quantity
from dogshape.bench.column_options import Match, stated_match
from dogshape.bench.draft_arguments import NONE, column_argument, column_placeholder
from dogshape.bench.quantities import (
    FORCE_STANDINS,
    LOOSE,
    SHIFT_FORCE,
    SHIFT_QUANTITIES,
    SHIFT_TIME,
    SHIFTS,
    WORD,
    TableQuantity,
    counts_up,
    grows,
    has_word,
    is_force_by_area,
    plain_words,
    repeated_name,
    score,
)
from dogshape.bench.spreads import uncounted_means, with_spread
from dogshape.sim.errors import InputError
from dogshape.sim.interface import text_value

FORCE_N = SHIFT_FORCE.name  #: quantity that an actuator's set value may stand for
#: Quantities of which loose words settle nothing between columns of the right kind.
UNDECIDED = ("mismatch_rpm", "shift_time_s")
_TIMES_AT = r"(t |time |zeit )?(start|beginn?|begin|anfang|ende?|stop|end)\w*"


@dataclass(frozen=True)
class Matching:
    """Matches of columns and quantities, with questions on undecided ones."""

    matches: tuple[Match, ...]
    questions: tuple[str, ...]

    @property
    def columns(self) -> dict[Column, str]:
        """The columns that are read, with their quantities."""
        names = {column: m.quantity.name for m in self.matches for column, _ in m.terms}
        # A number of shifts or a mean may also be a factor of the spread.
        names |= {m.column: m.quantity.name for m in self.matches if len(m.terms) == 1}
        return names

    def lines(self) -> Iterator[str]:
        """Describe the matches, a line each."""
        for match in self.matches:
            units = ", ".join(unit.text for _, unit in match.terms if unit) or "no unit"
            yield f"{match.quantity.name}: '{match.head}' in {units} ({match.why})"
        yield from (f"question: {question}" for question in self.questions)


def matched(
    columns: Sequence[Column], quantities: Sequence[TableQuantity], options: Mapping[str, str]
) -> Matching:
    """Match columns with quantities, best first, and ask about undecided ones.

    ``options`` maps quantities to column options (``stated_match``), which come first, or to
    ``NONE``.
    """
    matches, questions = _stated_matches(columns, quantities, options)
    stated = {c for match in matches for c, _ in match.terms if not _is_factor(match, c)}
    free = [column for column in columns if column not in stated]
    missing: list[TableQuantity] = []
    standins = [q for q in quantities if q in FORCE_STANDINS and q.name not in options]
    is_set = any(match.quantity in FORCE_STANDINS for match in matches)
    scores = {
        q: {c: score(q, c) for c in free}
        for q in quantities
        if q.name not in options and q not in standins and not (is_set and q.name == FORCE_N)
    }
    order = sorted(scores, key=lambda quantity: -max(scores[quantity].values(), default=0.0))
    for quantity in order:
        candidates = _candidates(quantity, scores[quantity], free)
        question = _open_question(quantity.name, candidates)
        if question:
            questions.append(question)
        elif candidates:
            column = candidates[0]
            free.remove(column)
            reason = "name and unit" if column.unit else "name"
            matches.append(Match(quantity, ((column, column.unit),), reason))
        elif quantity.needed:
            missing.append(quantity)
    missing = _without_standin(missing, standins, matches, questions, free)
    nameless = [column.head == f"column {column.place}" for column in columns]
    if missing and all(nameless):
        questions.append(_ask_for_names(missing, columns))
    else:
        questions += [_missing(quantity, free) for quantity in missing]
    if quantities is SHIFTS:
        matches, spread_questions = with_spread(matches, free, options)
        questions += [*spread_questions, *uncounted_means(matches, options)]
    return Matching(tuple(matches), tuple(questions))


def _force_standin(
    standins: Sequence[TableQuantity], free: Sequence[Column]
) -> tuple[TableQuantity | None, list[Column]]:
    """Find the set value or channel of an actuator with columns of its unit, and these columns.

    A pressure is known by its unit alone; voltage and current need a name too.
    """
    for quantity in standins:
        scores = {
            column: score(quantity, column)
            for column in free
            if _dimension_of(column) == quantity.dimension and not column.hidden
        }
        candidates = [column for column, value in scores.items() if value >= WORD]
        if not candidates and quantity.dimension == PRESSURE:
            candidates = [*scores]
        if candidates:
            return quantity, candidates
    return None, []


def _dimension_of(column: Column) -> str | None:
    """Return the dimension of the unit in the head of a column or in its cells; None for none."""
    units = [column.unit, *(split_quantity(cell)[1] for cell in column.cells)]
    return next((unit.dimension for unit in units if unit is not None), None)


def _without_standin(
    missing: list[TableQuantity],
    standins: Sequence[TableQuantity],
    matches: list[Match],
    questions: list[str],
    free: list[Column],
) -> list[TableQuantity]:
    """Match a column that stands for a missing force, or ask which does.

    Adds to ``matches`` or ``questions``, takes the column from ``free``, and returns the quantities
    that are missing still.
    """
    quantity: TableQuantity | None = None
    columns: list[Column] = []
    if any(q.name == FORCE_N for q in missing):
        quantity, columns = _force_standin(standins, free)
    if quantity is None:
        return missing
    question = _open_question(quantity.name, columns)
    if question:
        questions.append(question)
    else:
        matches.append(Match(quantity, ((columns[0], columns[0].unit),), "unit"))
        free.remove(columns[0])
    return [q for q in missing if q.name != FORCE_N]


def _stated_matches(
    columns: Sequence[Column], quantities: Sequence[TableQuantity], options: Mapping[str, str]
) -> tuple[list[Match], list[str]]:
    """Match the columns of the options; also list the faults of these."""
    matches = []
    faults = []
    for name, text in options.items():
        if text == NONE:
            continue
        try:
            matches.append(stated_match(columns, quantities, name, text))
        except InputError as error:
            faults.append(str(error))
    return matches, faults


def _is_factor(match: Match, column: Column) -> bool:
    """Test that a spread is a formula with a mean or number of shifts, which stay quantities."""
    if match.quantity.name != "shift_time_sd_s" or len(match.terms) < 2:
        return False
    return any(
        score(SHIFT_QUANTITIES[name], column) >= LOOSE for name in ("shift_time_s", "n_shifts")
    )


def _candidates(
    quantity: TableQuantity, scores: Mapping[Column, float], free: Sequence[Column]
) -> list[Column]:
    best = max((scores[column] for column in free), default=0.0)
    loose = quantity.name in UNDECIDED and best < WORD
    return [c for c in free if scores[c] > 0.0 and (loose or scores[c] == best)]


def _ask_about_numbers(head: str) -> str:
    order = column_argument("order", head)
    count = column_argument("n_shifts", head)
    return (
        f"'{head}' numbers the rows and is no count of shifts; say {order}, or {count} where each "
        "row is the mean of so many shifts"
    )


def _ask_for_names(missing: Sequence[TableQuantity], columns: Sequence[Column]) -> str:
    names = ", ".join(quantity.name for quantity in missing)
    heads = ", ".join(repr(column.head) for column in columns)
    answer = column_argument(missing[0].name, f"{columns[0].head}:UNIT")
    return (
        f"no column looks like {names}: no row names the columns ({heads}); add names and units, "
        f"or say each, such as {answer}"
    )


def _open_question(name: str, candidates: Sequence[Column]) -> str:
    """Ask which of several columns is a quantity, or what a column of numbers counts.

    Empty for a single column that is certain, and without any.
    """
    if len(candidates) < 2:
        is_open = bool(candidates) and name == "n_shifts" and counts_up(candidates[0])
        return _ask_about_numbers(candidates[0].head) if is_open else ""
    heads = [column.head for column in candidates]
    if name == "mismatch_rpm" and len(set(heads)) > 1:
        return _difference_question(name, candidates)
    repeated = {repeated_name(column) for column in candidates}
    if name == "shift_time_s" and len(repeated) == 1 and None not in repeated:
        return _repeats_question(candidates)
    labels = [f"column {c.place}" if heads.count(c.head) > 1 else c.head for c in candidates]
    ways = " or ".join(column_argument(name, label) for label in labels)
    question = f"{name} may be the column {' or '.join(map(repr, heads))}; say which: {ways}"
    if name == "shift_time_s" and len(set(heads)) == len(heads):
        answer = column_argument(name, "; ".join(heads))
        question += f", or {answer} where each is the time of a shift"
    return question


def _difference_question(name: str, candidates: Sequence[Column]) -> str:
    first, second = candidates[0].name, candidates[1].name
    heads = " or ".join(repr(column.head) for column in candidates)
    answer = column_argument(name, f"{second} - {first}")
    opposite = text_value(f"{first} - {second}", quoted=True)
    return (
        f"{name} may be {heads}, or their difference; say {answer} or {opposite}, positive where "
        "it runs the traction flanks together (docs/scope.md), or the column itself"
    )


def _repeats_question(candidates: Sequence[Column]) -> str:
    heads = "; ".join(column.head for column in candidates)
    named = ", ".join(repr(column.head) for column in candidates)
    repeats = column_argument("shift_time_s", heads)
    total = column_argument("shift_time_s", candidates[-1].head)
    return (
        f"{named} may be repeats of a shift, or phases of one; say {repeats} where each is the "
        f"time of a shift, or the column of the whole time, such as {total}"
    )


def _missing(quantity: TableQuantity, free: Sequence[Column]) -> str:
    """Ask for the column of a quantity that is needed."""
    special = {
        "mismatch_rpm": _missing_speed,
        "force_N": _missing_force,
        "shift_time_s": _missing_time,
    }.get(quantity.name)
    sentence = special(free) if special else ""
    if sentence and not sentence.startswith(";"):
        return sentence
    heads = ", ".join(
        f"{column.head!r}{' (hidden in the workbook)' if column.hidden else ''}" for column in free
    )
    heads = heads or "none"
    answer = column_placeholder(quantity.name)
    return (
        f"no column looks like {quantity.name}; say which one it is: {answer} or "
        f"{text_value('COLUMN:UNIT')} (columns left: {heads}), or a value for all rows{sentence}"
    )


def _missing_speed(free: Sequence[Column]) -> str:
    speeds = [column for column in free if column.unit and column.unit.dimension == SPEED]
    if len({column.head for column in speeds}) > 1:
        return _difference_question("mismatch_rpm", speeds)
    if speeds:
        head = speeds[0].head
        whole = column_argument("mismatch_rpm", head)
        difference = column_argument("mismatch_rpm", f"{speeds[0].name} - 1450")
        return (
            f"'{head}' is a speed, but no word says that it is the difference of both sides, which "
            f"mismatch_rpm is; say {whole} where it is, or subtract the other side, such as "
            f"{difference}"
        )
    ratios = [c.head for c in free if has_word("slip|schlupf|glissement", plain_words(c.name))]
    if ratios:
        product = column_argument("mismatch_rpm", f"{ratios[0]} * 1450")
        return (
            f"; '{ratios[0]}' has no unit of a speed and may be a ratio: multiply it by the speed "
            f"of the shaft in 1/min, such as {product}"
        )
    return ""


def _missing_force(free: Sequence[Column]) -> str:
    column = next((column for column in free if is_force_by_area(column)), None)
    if column is None or column.unit is None:
        return ""
    weight = column_argument("force_N", f"{column.head}:kgf")
    return (
        f"'{column.head}' is in {column.unit.text}, a mass and no force_N; say {weight} where it "
        "is the weight of so many kilograms (9.80665 N)"
    )


def _missing_time(free: Sequence[Column]) -> str:
    names = {column: plain_words(column.name) for column in free}
    numbered = [column for column in free if column.head.isdecimal()]
    if len(numbered) > 1:
        return _repeats_question(numbered)
    ends = [column for column in free if re.fullmatch(_TIMES_AT, names[column])]
    if len(ends) == 2:
        first, second = sorted(ends, key=lambda column: float(np.nanmean(column.values)))
        answer = column_argument("shift_time_s", f"{second.head} - {first.head}")
        return (
            f"shift_time_s may be the difference of '{first.head}' and '{second.head}'; say "
            f"{answer}"
        )
    clocks = [c.head for c in free if c.is_dated and has_word(SHIFT_TIME.words, names[c])]
    if clocks:
        return f"'{clocks[0]}' (shift_time_s) holds clock times; write durations in s or ms"
    grown = [c.head for c in free if c.unit and c.unit.dimension == TIME and grows(c)]
    return f"; '{grown[0]}' grows from row to row as a clock does" if grown else ""
