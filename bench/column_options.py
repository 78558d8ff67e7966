"""Options of columns: a column with its unit, a formula of columns, or a value for all rows."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.bench.cell_values import (
    AREA,
    FORCE,
    MISC,
    PRESSURE,
    Column,
    Unit,
    is_number,
    numbers_of,
    split_quantity,
    squared_time,
    unit_named,
    unit_with_factor,
)
from dogshape.bench.draft_arguments import column_placeholder
from dogshape.bench.quantities import VARIATION, TableQuantity, has_word, plain_words
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.interface import argument, key_argument

#: Unit of a count in a formula of quantities with units.
PURE_NUMBER = Unit("", MISC, 1.0)
QUOTE = "(['\"`]?)"  #: before a column, and again behind it
PERCENT = Unit("%", MISC, 0.01)  #: of a share in a formula
#: Quantities with an option of words in place of a unit.
WORDED = ("engaged", "timestamp", "trace")
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
    def column(self) -> Column:
        """The first of its columns."""
        return self.terms[0][0]

    @property
    def head(self) -> str:
        """Heads of its columns."""
        return " and ".join(column.head for column, _ in self.terms) or self.formula


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
    match = re.fullmatch(rf"{QUOTE}({pattern})\1(?::(.*))?", text) if pattern else None
    if match:
        column, option = labels[match[2]], match[3] or ""
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
        column, unit_text = labels[match[2]], match[3] or ""
        unit = unit_named(unit_text) if unit_text else column.unit
        if quantity.name == "shift_time_sd_s":
            unit = _spread_unit(column, unit_text) or unit
        pressed = unit is not None and unit.dimension == PRESSURE and len(areas) == 1
        if not pressed and unit not in (PURE_NUMBER, PERCENT):
            _require_unit(quantity, unit_text, unit)
        terms.append((column, unit))
        return f"c{len(terms) - 1}"

    label = rf"{QUOTE}({pattern})\1(?::([\w/^*%-]*\w))?"
    formula = re.sub(rf"(?<![\w.]){label}(?!\w)", placed, text)
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
    formula = _AREA_LITERAL.sub(_area_in_N_bar, formula)
    if any(unit for _, unit in terms):
        terms = [(column, unit or PURE_NUMBER) for column, unit in terms]
    return Match(quantity, tuple(terms), _reason(text, terms), formula, stated=True)


def _spread_unit(column: Column, unit_text: str) -> Unit | None:
    """Find the unit of a coefficient of variation or of a variance in a formula of a spread."""
    if has_word(VARIATION, plain_words(column.name)):
        return PERCENT if column.unit is not None and column.unit.text == "%" else PURE_NUMBER
    return squared_time(unit_text or column.strange or "")


def _area_in_N_bar(match: re.Match[str]) -> str:
    unit = unit_named(f"{match[2]}2")
    factor = unit.factor if unit is not None and unit.dimension == AREA else np.nan
    return f"({float(match[1].replace(',', '.')) * factor:.12g})"
