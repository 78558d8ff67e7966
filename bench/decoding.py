"""Text of a file: size limits and detection of the encoding.

Tried in this order: byte-order marks of UTF-8 and UTF-16, UTF-16 without a mark (every second byte
is zero), UTF-8, and the four code pages of western Windows, DOS and Macintosh. Among the code pages
the best score of European letters and signs decides. Composed letters replace two-character umlauts
(NFC).
"""

from __future__ import annotations

import codecs
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path

from dogshape.sim.errors import DataError, InputError, did_you_mean
from dogshape.sim.interface import key_argument

_WIDE_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
CODE_PAGES = ("cp1252", "cp850", "cp437", "mac_roman")  #: by precedence where scores are equal
_BINARY = frozenset(range(32)) - set(b"\t\n\r\f")
_RARE_LETTERS = "ëâîïôûùáíóúñÀÇåøæÅØÆãõìòÁÍÓÚÑ"
_FREQUENT_LETTERS = "äöüÄÖÜßéèêàçÉÈ"
_LETTER_SCORES = dict.fromkeys(_RARE_LETTERS, 0.8) | dict.fromkeys(_FREQUENT_LETTERS, 1.2)
_SIGNS = frozenset(
    "°µ²³±·\N{MULTIPLICATION SIGN}Ø\N{EN DASH}\N{MINUS SIGN}\N{RIGHT SINGLE QUOTATION MARK}"
    "“”„Δσ√…§€«»\N{NO-BREAK SPACE}"
)
_UNIT_LETTERS = ("µs", "µm")  #: a micro sign that begins a word
_INVISIBLE = dict.fromkeys(map(ord, "\N{ZERO WIDTH SPACE}\N{ZERO WIDTH NO-BREAK SPACE}"))
MIN_WIDE_BYTES = 4


@dataclass(frozen=True)
class TableLimits:
    """Largest sizes of a table to read; larger ones are refused before they fill the memory.

    Assumptions: a bench makes thousands of shifts, not millions; a trace of 1 s at 100 kHz has
    100000 lines of 60 characters.
    """

    file_bytes: int = 64_000_000  #: of a file on the disk
    unpacked_bytes: int = 256_000_000  #: of a workbook's parts once they are unpacked
    rows: int = 200_000  #: lines of a text, rows of a sheet; a minute on one core
    columns: int = 500
    workbook_cells: int = 300_000  #: rows times columns of a sheet
    cell_characters: int = 10_000

    def require(self, name: str, size: int, place: str, remedy: str) -> None:
        """Raise DataError if ``size`` exceeds the limit ``name``; ``place`` begins the message."""
        limit = getattr(self, name)
        if size > limit:
            answer = key_argument("limits", name, size)
            raise DataError(
                f"{place}: {name.replace('_', ' ')} are {size}, but at most {limit} are read; "
                f"{remedy}, or raise the limit: {answer}"
            )


def parse_limits(values: Mapping[str, str]) -> TableLimits:
    """Build limits from options such as ``{"rows": "1000000"}``; InputError for unknown names."""
    names = [field.name for field in fields(TableLimits)]
    for name, text in values.items():
        if name not in names:
            answer = key_argument("limits", name, "...")
            raise InputError(f"{answer} names no limit; {did_you_mean(name, names)}")
        if not text.isdecimal() or int(text) < 1:
            raise InputError(
                f"{key_argument('limits', name)} is '{text}', but it must be a whole number above 0"
            )
    return replace(TableLimits(), **{name: int(text) for name, text in values.items()})


def read_bytes(path: Path, limits: TableLimits) -> bytes:
    """Read a file of at most ``limits.file_bytes``; raises DataError for a larger one."""
    with path.open("rb") as file:
        raw = file.read(limits.file_bytes + 1)
    if len(raw) > limits.file_bytes:
        size = max(path.stat().st_size, len(raw))
        limits.require("file_bytes", size, str(path), "divide the file")
    return raw


def decode_text(raw: bytes) -> str:
    """Decode the bytes of a text of unknown encoding; raises DataError for binary data."""
    wide_encoding = _wide_encoding(raw)
    try:
        text = raw.decode(wide_encoding or "utf-8-sig")
    except UnicodeDecodeError as error:
        if wide_encoding or not _BINARY.isdisjoint(raw):
            raise DataError("it is no text") from error
        texts = [_decode_by_page(raw, page) for page in CODE_PAGES]
        text = max((text for text in texts if text is not None), key=_table_score)
    return text if text.isascii() else unicodedata.normalize("NFC", text.translate(_INVISIBLE))


def _wide_encoding(raw: bytes) -> str:
    """Detect an encoding of two bytes a character; empty for any other."""
    if raw.startswith(_WIDE_MARKS):
        return "utf-16"
    sample = raw[:4096]
    if len(sample) < MIN_WIDE_BYTES or len(raw) % 2:
        return ""
    even_zeros = sample[::2].count(0)
    odd_zeros = sample[1::2].count(0)
    characters = len(sample) / 2
    if odd_zeros > 0.7 * characters and not even_zeros:
        return "utf-16-le"
    if even_zeros > 0.7 * characters and not odd_zeros:
        return "utf-16-be"
    return ""


def _decode_by_page(raw: bytes, page: str) -> str | None:
    # cp1252 has no character for five of the bytes; the other pages have one for each.
    try:
        return raw.decode(page)
    except UnicodeDecodeError:
        return None


def _table_score(text: str) -> float:
    """Score the characters beyond ASCII: letters in words and signs of units count up."""
    score = 0.0
    for place, letter in enumerate(text):
        if letter.isascii():
            continue
        previous_letter = text[max(0, place - 1) : place]
        next_letter = text[place + 1 : place + 2]
        if letter in _LETTER_SCORES:
            plausible = _fits_word(previous_letter, letter, next_letter)
            score += _LETTER_SCORES[letter] if plausible else -1.0
        elif letter in _SIGNS and not (previous_letter.isalpha() and next_letter.isalpha()):
            score += 2.0 if letter + next_letter in _UNIT_LETTERS else 1.0
        else:
            score -= 1.0
    return score


def _fits_word(previous_letter: str, letter: str, next_letter: str) -> bool:
    """Test whether a letter beyond ASCII is plausible between its neighbours."""
    if letter == "ß":
        return previous_letter.lower() in "aeiouäöüy" and bool(previous_letter)
    if letter.isupper() and previous_letter.islower():
        return False
    return previous_letter.isalpha() or (next_letter.isalpha() and next_letter not in ("s", "m"))
