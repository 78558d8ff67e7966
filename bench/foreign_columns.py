"""Columns of a foreign table: which of them are which quantities, in which unit or formula.

Third step of reading. What fits in two ways becomes a question with its option. Columns that repeat
a shift time are shifts of their own: each row becomes as many rows. No answer that is offered drops
shifts that a table has.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dogshape.bench.cell_values import (
    AREA,
    FORCE,
    MISC,
    NOTHING,
    PRESSURE,
    SPEED,
    TIME,
    Column,
    Unit,
    is_number,
    numbers_of,
    split_quantity,
    unit_named,
    unit_with_factor,
)
from dogshape.bench.draft_arguments import NONE, column_argument, column_placeholder, no_column
from dogshape.bench.foreign_table import MIN_REPEATS, REPEATS, ROUNDED, ForeignTable
from dogshape.bench.quantities import (
    LOOSE,
    SHIFT_QUANTITIES,
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
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.interface import argument, key_argument, text_value

#: Unit of a count in a formula of quantities with units.
PURE_NUMBER = Unit("", MISC, 1.0)
PERCENT = Unit("%", MISC, 0.01)  #: of a share in a formula
#: Quantities of which loose words settle nothing between columns of the right kind.
UNDECIDED = ("mismatch_rpm", "shift_time_s")
#: Quantities with an option of words in place of a unit.
WORDED = ("engaged", "timestamp", "trace")
MEAN = (
    r"mittel\w*|mean|average|avg|durchschnitt\w*|moyenne?|media|promedio|gemiddeld\w*|medel\w*"
    r"|sredni\w*|prumer\w*|median"
)
_STANDARD_ERROR = (
    r"\w*standardfehler|(standard|std) err(or)?|stderr|sem|s e m|\w*abweichung des mittel\w*"
    r"|(standard|std) (deviation|dev) of (the )?mean|erreur (type|standard)|errore standard"
    r"|error estandar|standaardfout|medelfel"
)
_STANDARD_DEVIATION = (
    r"\w*std\w*|sd|stabw|sigma|\w*standardabweichung|standard deviation|ecart type"
    r"|deviazione standard|desviacion (estandar|tipica)|scarto (tipo|quadratico medio)"
    r"|smerodatna odchylka|odchylenie standardowe"
)
_VARIANCE = (
    r"varian[zs]|variance|varianza|variantie|wariancja|rozptyl|var|s ?2|sigma ?2|sigma squared"
)
_VARIATION = (
    r"cv|vk|vko|rsd|variationskoeffizient\w*|\w*variationskoeff\w*|coef\w* (of |de |di )?varia\w*"
    r"|rel\w* (standardabweichung|standard deviation|std\w*|sd|streuung)|variatiecoefficient"
)
#: A variation of another quantity.
_OTHER_SPREAD = r"f|force|\w*kraft|n|mismatch|\w*drehzahl|rise|anstieg|regime"
_SQUARED = re.compile(r"(.*[^\d\W])\s*(?:²|\^?2)")
#: Two or three standard deviations, the number before the word.
_MULTIPLE = rf"\b([23]) ?(?:x |mal |times )?(?:{_STANDARD_DEVIATION}|standard deviations)\b"
_UNSETTLED = rf"{MEAN}|max|min|rel\w*|err\w*|confidence|konfidenz\w*|range|[02-9]\w*|\d\d+|k"
_TIMES_AT = r"(t |time |zeit )?(start|beginn?|begin|anfang|ende?|stop|end)\w*"
Term = tuple[Column, Unit | None]  #: of a formula, with its unit
_AREA_LITERAL = re.compile(r"(\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*(mm|cm|m|in)\s*(?:\^?2|²)")


@dataclass(frozen=True)
class Match:
    """Columns that are taken for a quantity, each with its unit, and the reason.

    ``formula`` joins them as ``c0``, ``c1`` ...; without columns it is a number in the project's
    unit. ``option`` stands behind the colon of an option; ``stated`` says that the user gave it.
    """

    quantity: TableQuantity
    terms: tuple[Term, ...]
    why: str
    formula: str = "c0"
    option: str = ""
    stated: bool = False

    @property
    def head(self) -> str:
        """Heads of its columns."""
        return " and ".join(column.head for column, _ in self.terms) or self.formula


@dataclass(frozen=True)
class Matching:
    """Matches of columns and quantities, with questions on undecided ones."""

    matches: tuple[Match, ...] = ()
    questions: tuple[str, ...] = field(default=())

    @property
    def columns(self) -> dict[Column, str]:
        """The columns that are read, with their quantities."""
        names = {column: m.quantity.name for m in self.matches for column, _ in m.terms}
        # A number of shifts or a mean may also be a factor of the spread.
        names |= {m.terms[0][0]: m.quantity.name for m in self.matches if len(m.terms) == 1}
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
    scores = {q: {c: score(q, c) for c in free} for q in quantities if q.name not in options}
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
    nameless = [column.head == f"column {column.place}" for column in columns]
    if missing and all(nameless):
        questions.append(_ask_for_names(missing, columns))
    else:
        questions += [_missing(quantity, free) for quantity in missing]
    if quantities is SHIFTS:
        matches, spread_questions = _with_spread(matches, free, options)
        questions += [*spread_questions, *_uncounted_means(matches, options)]
    return Matching(tuple(matches), tuple(questions))


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
        "it runs the traction flanks together (docs/mismatch.md), or the column itself"
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
    if column.unit.dimension == PRESSURE:
        product = column_argument("force_N", f"{column.head} * 4.9 cm2")
        return (
            f"'{column.head}' is a pressure and no force_N; say the area of the piston, such as "
            f"{product}, or add the force"
        )
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
    time = SHIFT_QUANTITIES["shift_time_s"]
    clocks = [c.head for c in free if c.is_dated and has_word(time.words, names[c])]
    if clocks:
        return f"'{clocks[0]}' (shift_time_s) holds clock times; write durations in s or ms"
    grown = [c.head for c in free if c.unit and c.unit.dimension == TIME and grows(c)]
    return f"; '{grown[0]}' grows from row to row as a clock does" if grown else ""


# ---- options of columns


def stated_match(
    columns: Sequence[Column], quantities: Sequence[TableQuantity], name: str, text: str
) -> Match:
    """Read a column option: ``COLUMN``, ``COLUMN:UNIT``, a formula, or a value for all rows.

    A column is named by its head, its head without the unit, or its place (``column 3``). A unit of
    the option goes before that of the head. A pressure times an area, ``p * 4.9 cm2``, is a force.
    """
    by_name = {quantity.name: quantity for quantity in quantities}
    if name not in by_name:
        answer = column_placeholder(name, "...")
        raise InputError(f"{answer} names no quantity; {did_you_mean(name, by_name)}")
    quantity, labels = by_name[name], column_labels(columns)
    pattern = "|".join(re.escape(label) for label in sorted(labels, key=len, reverse=True) if label)
    match = re.fullmatch(rf"({pattern})(?::(.*))?", text) if pattern else None
    if match:
        column, option = labels[match[1]], match[2] or ""
        unit = unit_with_factor(option) if option else column.unit
        if name in WORDED:
            unit = unit or column.unit
        else:
            _require_unit(quantity, option, unit)
        if column.repeats:
            text = f"{column.repeats} columns of repeats"
        terms: tuple[Term, ...] = ((column, unit),)
        return Match(quantity, terms, _reason(text, terms), option=option, stated=True)
    constant = _constant(quantity, text)
    if constant:
        return constant
    return _formula_match(quantity, text, labels, pattern, columns)


def column_labels(columns: Sequence[Column]) -> dict[str, Column]:
    """Map heads, names and places that occur once to their columns."""
    labels = {f"column {column.place}": column for column in columns}
    for names in ([column.name for column in columns], [column.head for column in columns]):
        labels |= {n: c for n, c in zip(names, columns, strict=True) if names.count(n) == 1}
    return labels


def _require_unit(quantity: TableQuantity, option: str, unit: Unit | None) -> None:
    if (option and not unit) or (unit and unit.dimension != quantity.dimension):
        raise InputError(
            f"the unit of {quantity.name} is '{option or (unit.text if unit else '')}', but it must"
            f" be one of: {quantity.units or 'none, a number without one'}"
        )


def _reason(text: str, terms: Sequence[Term]) -> str:
    signed = ["its sign is that of the formula, positive where traction flanks meet"]
    heads = [
        f"the head says {column.unit.text}"
        for column, unit in terms
        if column.unit and unit and unit.factor != column.unit.factor
    ]
    option = text if terms[0][0].repeats else f"{argument('columns')} {text}"
    return "; ".join([option, *(signed if len(terms) > 1 else []), *heads])


def _constant(quantity: TableQuantity, text: str) -> Match | None:
    """Read a number with its unit that holds for all rows."""
    cell, unit = split_quantity(text.strip())
    if not is_number(cell) or quantity.name in WORDED:
        return None
    if quantity.dimension is not None:
        _require_unit(quantity, text if unit is None else "", unit)
    value = float(numbers_of([cell])[0]) * (unit.factor if unit else 1.0)
    reason = f"{argument('columns')} {text}, for all rows"
    return Match(quantity, (), reason, formula=f"{value:.15g}", stated=True)


def _formula_match(
    quantity: TableQuantity,
    text: str,
    labels: Mapping[str, Column],
    pattern: str,
    columns: Sequence[Column],
) -> Match:
    """Read a formula of columns; raises InputError for a unit that does not fit."""
    terms: list[Term] = []
    areas = _AREA_LITERAL.findall(text) if quantity.dimension == FORCE else []

    def placed(match: re.Match[str]) -> str:
        column, unit_text = labels[match[1]], match[2] or ""
        unit = unit_named(unit_text) if unit_text else column.unit
        if quantity.name == "shift_time_sd_s":
            unit = _spread_unit(column, unit_text) or unit
        pressed = unit is not None and unit.dimension == PRESSURE and len(areas) == 1
        if not pressed and unit not in (PURE_NUMBER, PERCENT):
            _require_unit(quantity, unit_text, unit)
        terms.append((column, unit))
        return f"c{len(terms) - 1}"

    formula = re.sub(rf"(?<![\w.])({pattern})(?::([\w/^*%-]*\w))?(?!\w)", placed, text)
    if not terms:
        hint = did_you_mean(text, [column.head for column in columns])
        raise InputError(
            f"{key_argument('columns', quantity.name)} is '{text}', but the file has no such "
            f"column; {hint}"
        )
    pressures = [unit for _, unit in terms if unit and unit.dimension == PRESSURE]
    if areas and len(pressures) != 1:
        raise InputError(
            f"{key_argument('columns', quantity.name)} is '{text}', but an area makes a force of "
            "one pressure only; give its column a unit, such as 'p:bar * 4.9 cm2'"
        )
    formula = _AREA_LITERAL.sub(_area_in_cm2, formula)
    if any(unit for _, unit in terms):
        terms = [(column, unit or PURE_NUMBER) for column, unit in terms]
    return Match(quantity, tuple(terms), _reason(text, terms), formula, stated=True)


def _spread_unit(column: Column, unit_text: str) -> Unit | None:
    """Find the unit of a coefficient of variation or of a variance in a formula of a spread."""
    if has_word(_VARIATION, plain_words(column.name)):
        return PERCENT if column.unit is not None and column.unit.text == "%" else PURE_NUMBER
    return squared_time(unit_text or column.strange or "")


def _area_in_cm2(match: re.Match[str]) -> str:
    unit = unit_named(f"{match[2]}2")
    factor = unit.factor if unit is not None and unit.dimension == AREA else np.nan
    return f"({float(match[1].replace(',', '.')) * factor:.12g})"


# ---- repeats as columns


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
            if column.cells[k].lower() in NOTHING:
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
    time = SHIFT_QUANTITIES["shift_time_s"]
    for name, group in groups.items():
        units = {column.unit.text if column.unit else "" for column in group}
        worded = has_word(time.words, name)
        enough = len(group) >= (2 if worded else MIN_REPEATS)
        if enough and len(units) == 1 and not has_word(time.against, name):
            values = np.array([column.values for column in group])
            phases = (np.diff(values, axis=0)[:, np.isfinite(values).all(axis=0)] > 0.0).all()
            if worded or not phases or values.shape[1] < 2:
                return group
    return []


def _summaries_of(
    repeats: Sequence[Column], other_columns: Sequence[Column]
) -> tuple[list[Column], list[str]]:
    """Find mean, spread and number of the repeats among other columns, and wrong ones of them."""
    values = np.ma.masked_invalid([column.values for column in repeats])
    summaries, questions = [], []
    for column in other_columns:
        name = plain_words(column.name)
        if score(SHIFT_QUANTITIES["shift_time_sd_s"], column) > 0.0:
            summaries.append(column)
            continue
        if has_word(MEAN, name):
            expected = values.mean(axis=0)
        elif score(SHIFT_QUANTITIES["n_shifts"], column) > 0.0 and not counts_up(column):
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


# ---- means and their spread


def _with_spread(
    matches: Sequence[Match], free: Sequence[Column], options: Mapping[str, str]
) -> tuple[list[Match], list[str]]:
    """Convert a spread that its name settles into a standard deviation; ask about others.

    Without one, a coefficient of variation among the ``free`` columns is matched.
    """
    name = "shift_time_sd_s"
    converted: list[Match] = []
    questions: list[str] = []
    by_name = {match.quantity.name: match for match in matches}
    if name not in by_name and name not in options:
        variation, questions = _variation_match(by_name.get("shift_time_s"), free)
        return [*matches, *variation], questions
    for match in matches:
        # A product is a coefficient of variation times the mean already.
        if match.quantity.name != name or name in options or len(match.terms) > 1:
            converted.append(match)
            continue
        deviation = _deviation_of(match, by_name.get("n_shifts"))
        if deviation is not None:
            converted.append(deviation)
        elif not has_word(_STANDARD_ERROR, plain_words(match.terms[0][0].name)):
            questions.append(_open_spread(match.terms[0][0], by_name.get("shift_time_s")))
    return converted, questions


def _deviation_of(match: Match, count: Match | None) -> Match | None:
    """Convert the match of a spread into a standard deviation; None where its name is open.

    A standard error is open without ``count``, the match of the numbers of shifts.
    """
    column = match.terms[0][0]
    words = plain_words(column.name)
    multiple = re.search(_MULTIPLE, words)
    squared = squared_time(column.strange or "")
    is_variation = has_word(_VARIATION, words) and column.unit is None
    is_error = has_word(_STANDARD_ERROR, words)
    if squared is not None:
        reason = f"{match.why}; root of the variance"
        return replace(match, terms=((column, squared),), formula="sqrt(c0)", why=reason)
    if is_variation or has_word(_VARIANCE, words):
        return None
    if multiple:
        reason = f"{match.why}; {multiple[1]} standard deviations"
        return replace(match, formula=f"c0 / {multiple[1]}", why=reason)
    if is_error and count is not None:
        reason = f"{match.why}; standard error times the root of '{count.head}'"
        terms = (*match.terms, *((counted, PURE_NUMBER) for counted, _ in count.terms))
        formula = "c0 * sqrt(c1)" if count.terms else f"c0 * sqrt({count.formula})"
        return replace(match, terms=terms, formula=formula, why=reason)
    settled = has_word(_STANDARD_DEVIATION, words) and not has_word(_UNSETTLED, words)
    return match if settled and not is_error else None


def _open_spread(column: Column, time: Match | None) -> str:
    """Ask for the meaning of a spread with an open name."""
    words = plain_words(column.name)
    if has_word(_VARIATION, words) and column.unit is None:
        return _variation_question(column, time)
    if has_word(_VARIANCE, words):
        return _variance_question(column)
    return _spread_question(column)


def squared_time(text: str) -> Unit | None:
    """Find the unit of a variance of times, ``ms²``, its factor to s²; None for another text."""
    match = _SQUARED.fullmatch(text.strip())
    unit = unit_named(match[1]) if match else None
    if unit is None or unit.dimension != TIME:
        return None
    return Unit(text.strip(), TIME, unit.factor**2)


def _variation_match(time: Match | None, free: Sequence[Column]) -> tuple[list[Match], list[str]]:
    """Match a coefficient of variation, whose product with the time is the standard deviation.

    Returns the match, and a question where no unit says percent.
    """
    for column in free:
        words = plain_words(column.name)
        is_other = column.hidden or has_word(_OTHER_SPREAD, words)
        if is_other or not has_word(_VARIATION, words) or not np.isfinite(column.values).any():
            continue
        is_percent = column.unit is not None and column.unit.text.strip() == "%"
        if not is_percent or time is None or time.formula != "c0":
            return [], [_variation_question(column, time)]
        reason = "name and unit; percent of the mean"
        terms = ((column, PERCENT), *time.terms)
        return [Match(SHIFT_QUANTITIES["shift_time_sd_s"], terms, reason, formula="c0 * c1")], []
    return [], []


def _variation_question(column: Column, time: Match | None) -> str:
    mean = time.head if time is not None and time.formula == "c0" else "TIME"
    percent = column_argument("shift_time_sd_s", f"{column.head} * {mean} / 100")
    share = column_argument("shift_time_sd_s", f"{column.head} * {mean}")
    return (
        f"'{column.head}' is a coefficient of variation; say {percent} for percent of the mean, "
        f"{share} for a share of it, or {no_column('shift_time_sd_s')} to leave it out"
    )


def _variance_question(column: Column) -> str:
    root = column_argument("shift_time_sd_s", f"sqrt({column.head}:ms2)")
    deviation = column_argument("shift_time_sd_s", column.head)
    return (
        f"'{column.head}' is a variance, whose root is the standard deviation, but no unit is "
        f"squared; say {root} or s2, {deviation} where it is a standard deviation, or "
        f"{no_column('shift_time_sd_s')} to leave it out"
    )


def _spread_question(column: Column) -> str:
    single = column_argument("shift_time_sd_s", column.head)
    double = column_argument("shift_time_sd_s", f"{column.head} / 2")
    return (
        f"'{column.head}' may be a standard deviation, a multiple of it, a half width or a range; "
        f"say {single} for one standard deviation, {double} for two, or "
        f"{no_column('shift_time_sd_s')} to leave it out"
    )


def _uncounted_means(matches: Sequence[Match], options: Mapping[str, str]) -> list[str]:
    """Ask how many shifts each mean has where no column counts them."""
    by_name = {match.quantity.name: match for match in matches}
    time = by_name.get("shift_time_s")
    if "n_shifts" in by_name or "n_shifts" in options or time is None:
        return []
    spread = by_name.get("shift_time_sd_s")
    means = [column for column, _ in time.terms if has_word(MEAN, plain_words(column.name))]
    if means:
        reason = f"'{means[0].head}' is a mean"
    elif spread is not None:
        reason = f"'{spread.head}' is a spread"
    else:
        return []
    return [
        f"{reason}, so that each row is a mean of shifts, but no column counts them; say "
        f"{column_placeholder('n_shifts')}, or a number for all rows, such as "
        f"{column_placeholder('n_shifts', '5')}"
    ]
