"""Numbers as people and loggers write them: decimal sign, thousands, signs apart.

A file has one decimal sign. ``1,200`` is 1200 or 1.2, which other numbers of the file decide, or a
statement of the file or of the user; otherwise it is a question.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from dogshape.sim.errors import DataError

_SAME = str.maketrans({
    **dict.fromkeys("\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}", " "),
    **dict.fromkeys("\N{RIGHT SINGLE QUOTATION MARK}\N{LEFT SINGLE QUOTATION MARK}`\N{PRIME}", "'"),
    **dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}\N{NON-BREAKING HYPHEN}", "-"),
})  # fmt: skip
_APART = re.compile(r"^([+-])\s+(?=[\d.,])")
_PLAIN = re.compile(r"[+-]?(?:\d+(?:([.,])\d*)?|([.,])\d+)(?:[eE][+-]?\d+)?")
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:([ ,.'])\d{3})(?:\1\d{3})*(?:(?!\1)([.,])\d+)?")
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2}([.,])\d{3}")
NAMES = {".": "point", ",": "comma"}
OTHER = {".": ",", ",": "."}


@lru_cache(maxsize=1 << 18)
def plain(cell: str) -> str:
    """Write a cell with ordinary minus sign, blank and apostrophe, its sign beside its digits."""
    return cell if cell.isalnum() else _APART.sub(r"\1", cell.translate(_SAME).strip())


@lru_cache(maxsize=1 << 18)
def is_number(cell: str) -> bool:
    """Test that a cell is a number, whichever its decimal sign."""
    text = plain(cell)
    return bool(_PLAIN.fullmatch(text) or _GROUPED.fullmatch(text))


@dataclass(frozen=True)
class Decimals:
    """Decimal sign of a file, None where no number has one, and questions on undecided columns."""

    sign: str | None
    questions: tuple[str, ...] = ()

    def value(self, cell: str) -> float:
        """Convert a cell that is a number."""
        text = plain(cell)
        sign = self.sign or ("," if "," in text and "." not in text else ".")
        for mark in (" ", "'", OTHER[sign]):
            text = text.replace(mark, "")
        return float(text.replace(sign, "."))

    def step(self, cell: str) -> float:
        """Give the value of the last digit of a number."""
        digits = re.split(r"[eE]", plain(cell))[0].partition(self.sign or ".")[2]
        return float(10.0 ** -len(digits))

    def named(self, cells: Sequence[str]) -> str | None:
        """Name the decimal sign of cells, None where none of them has one."""
        return NAMES[self.sign] if self.sign and any(self.sign in c for c in cells) else None


def _evidence(text: str) -> str | None:
    """Find the decimal sign that a number shows beyond doubt."""
    if _EITHER.fullmatch(text):
        return None
    if found := _PLAIN.fullmatch(text):
        return found[1] or found[2]
    if found := _GROUPED.fullmatch(text):
        several = found[1] in OTHER and text.count(found[1]) > 1
        return found[2] or (OTHER[found[1]] if several else None)
    return None


def decimals_of(
    columns: Mapping[str, Sequence[tuple[int, str]]], stated: str | None, separator: str
) -> Decimals:
    """Decide on the decimal sign of a file from columns of cells with their rows.

    ``stated`` is the sign that the file or the user says. Raises DataError for numbers with both.
    """
    sure: dict[str, str] = {}
    for mark in OTHER:
        shown = ((row, plain(c)) for those in columns.values() for row, c in those
                 if "." in c or "," in c or "'" in c)  # fmt: skip
        if first := next(((row, c) for row, c in shown if _evidence(c) == mark), None):
            sure[mark] = f"a {NAMES[mark]} ('{first[1]}', row {first[0]})"
    if len(sure) > 1 or (stated and OTHER[stated] in sure):
        found = " and with ".join(sure[mark] for mark in sorted(sure))
        says = f", but {NAMES[stated]} is said to be the decimal sign" if stated else ""
        raise DataError(
            f"numbers with {found}{says}, which can be read in two ways; save it with one sign"
        )
    sign = stated or next(iter(sure), None)
    if stated:
        return Decimals(stated)
    asked = []
    for head, those in columns.items():
        either = [(n, plain(c)) for n, c in those if len(c) > 4 and _EITHER.fullmatch(plain(c))]
        signs = {"," if "," in text else "." for _, text in either}
        if not either or (len(signs) == 1 and sign not in signs and sign):
            continue  # thousands, as the other sign is that of decimals
        if sign in signs and any(_evidence(plain(cell)) == sign for _, cell in those):
            continue
        bare = any(plain(cell).isdigit() and cell.strip("0") for _, cell in those)
        one = min(signs)
        if len(signs) == 1 and not bare and (sign == one or (separator == "," and one == ".")):
            sign = one
            continue
        row, text = either[0]
        sep = "," if "," in text else "."
        asked.append(
            f"column '{head}', row {row}: '{text}' can be read as {text.replace(sep, '')}, "
            f"--decimal {OTHER[sep]}, or as {text.replace(sep, '.')}, --decimal {sep}"
        )
    return Decimals(sign, tuple(asked))
