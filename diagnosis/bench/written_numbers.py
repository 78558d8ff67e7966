"""Numbers as people and loggers write them: decimal sign, thousands, signs apart.

A file has one decimal sign. ``1,200`` is 1200 or 1.2, which other numbers of the file decide, or a
statement of the file or of the user; otherwise it is a question. Columns are read as a whole.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError

_SAME = str.maketrans({
    **dict.fromkeys("\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}", " "),
    **dict.fromkeys("\N{RIGHT SINGLE QUOTATION MARK}\N{LEFT SINGLE QUOTATION MARK}`\N{PRIME}", "'"),
    **dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}\N{NON-BREAKING HYPHEN}", "-"),
})  # fmt: skip
_APART = re.compile(r"(?m)^([+-])[ \t]+(?=[\d.,])")
_NUMBER = (
    r"[+-]?(?:(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
    r"|\d{1,3}([ ,.'])\d{3}(?:\2\d{3})*(?:(?!\2)[.,]\d+)?)"
)
_LINE = re.compile(rf"(?m)^(?:({_NUMBER})$|.*$)")
_EITHER = re.compile(r"(?m)^[+-]?[1-9]\d{0,2}([.,])\d{3}$")
_BARE = re.compile(r"(?m)^0*[1-9]\d*$")
NAMES = {".": "point", ",": "comma"}
OTHER = {".": ",", ",": "."}
#: Numbers that show their decimal sign beyond doubt.
_SURE = {
    sign: re.compile(
        rf"(?m)^[+-]?(?![1-9]\d{{0,2}}[{sign}]\d{{3}}$)"
        rf"(?:(?:\d+[{sign}]\d*|[{sign}]\d+)(?:[eE][+-]?\d+)?"
        rf"|\d{{1,3}}(?:([ '{other}])\d{{3}}(?:\1\d{{3}})*[{sign}]\d+|(?:[{other}]\d{{3}}){{2,}}))$"
    )
    for sign, other in OTHER.items()
}


def plain(cells: Sequence[str]) -> str:
    """Write cells as lines, with ordinary minus sign and blank, signs beside their digits."""
    lines = "\n".join(cells)
    if lines.count("\n") >= len(cells):  # a cell of several lines
        lines = "\n".join(cell.replace("\n", " ") for cell in cells)
    return _APART.sub(r"\1", lines.translate(_SAME))


def are_numbers(cells: Sequence[str]) -> list[bool]:
    """Test which cells are numbers, whatever their decimal sign."""
    return [bool(found[0]) for found in _LINE.findall(plain(cells))] if cells else []


@dataclass(frozen=True)
class Decimals:
    """Decimal sign of a file, None where no number has one, and questions on undecided columns."""

    sign: str | None
    questions: tuple[str, ...] = ()

    def values(self, cells: Sequence[str]) -> Array:
        """Convert cells, NaN where one is no number, (cells,)."""
        text, known = plain(cells), np.array(are_numbers(cells), dtype=bool)
        if self.sign is None and len(cells) > 1 and "," in text and "." in text:
            return np.concatenate([self.values([cell]) for cell in cells])
        sign = self.sign or ("," if "," in text and "." not in text else ".")
        bare = text.translate({ord(mark): None for mark in " '" + OTHER[sign]}).replace(sign, ".")
        values = np.full(len(cells), np.nan)
        values[known] = np.array(list(compress(bare.split("\n"), known)), dtype=float)
        return values

    def step(self, cell: str) -> float:
        """Give the value of the last digit of a number."""
        digits = re.split(r"[eE]", plain([cell]))[0].partition(self.sign or ".")[2]
        return float(10.0 ** -len(digits))

    def named(self, cells: Sequence[str]) -> str | None:
        """Name the decimal sign of cells, None where none of them has one."""
        return NAMES[self.sign] if self.sign and any(self.sign in c for c in cells) else None


def decimals_of(
    columns: Mapping[str, Sequence[str]], rows: Sequence[int], stated: str | None, separator: str
) -> Decimals:
    """Decide on the decimal sign of a file from the cells of columns.

    ``stated`` is the sign that the file or the user says. Raises DataError for numbers with both.
    """
    texts = {head: plain(cells) for head, cells in columns.items()}
    sure: dict[str, str] = {}
    for mark, pattern in _SURE.items():
        if found := next(filter(None, map(pattern.search, texts.values())), None):
            row = rows[found.string.count("\n", 0, found.start())]
            sure[mark] = f"a {NAMES[mark]} ('{found[0]}', row {row})"
    if len(sure) > 1 or (stated and OTHER[stated] in sure):
        both = " and with ".join(sure[mark] for mark in sorted(sure))
        says = f", but {NAMES[stated]} is said to be the decimal sign" if stated else ""
        raise DataError(
            f"numbers with {both}{says}, which can be read in two ways; save it with one sign"
        )
    if stated:
        return Decimals(stated)
    sign = next(iter(sure), None)
    asked = []
    for head, text in texts.items():
        either = _EITHER.search(text)
        signs = set(_EITHER.findall(text))
        if not either or (len(signs) == 1 and sign and sign not in signs):
            continue  # thousands, as the other sign is that of decimals
        if sign and sign in signs and _SURE[sign].search(text):
            continue
        one, row = min(signs), rows[text.count("\n", 0, either.start())]
        decimal = sign == one or (separator == "," and one == ".")
        if len(signs) == 1 and decimal and not _BARE.search(text):
            sign = one
            continue
        cell, mark = either.group(), either[1]
        asked.append(
            f"column '{head}', row {row}: '{cell}' can be read as {cell.replace(mark, '')}, "
            f"--decimal {OTHER[mark]}, or as {cell.replace(mark, '.')}, --decimal {mark}"
        )
    return Decimals(sign, tuple(asked))
