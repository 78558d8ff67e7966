"""Text of a file: bytes within a limit, and the encoding they have.

Tried in this order: byte-order marks of UTF-8 and UTF-16, UTF-16 without a mark (every second byte
is zero), UTF-8, and the four code pages of western Windows, DOS and Macintosh. Of the code pages
that one is taken in which most characters are letters and signs as Europe's tables have them.
Composed letters replace two-character umlauts (NFC).
"""

from __future__ import annotations

import codecs
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path

from dogshape.sim.errors import DataError, InputError, did_you_mean

_WIDE_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
CODE_PAGES = ("cp1252", "cp850", "cp437", "mac_roman")  #: the first of equally likely ones is taken
_BINARY = frozenset(range(32)) - set(b"\t\n\r\f")
_LETTERS = dict.fromkeys("ëâîïôûùáíóúñÀÇåøæÅØÆãõìòÁÍÓÚÑ", 0.8) | dict.fromkeys(
    "äöüÄÖÜßéèêàçÉÈ", 1.2
)
_SIGNS = frozenset(
    "°µ²³±·\N{MULTIPLICATION SIGN}Ø\N{EN DASH}\N{MINUS SIGN}\N{RIGHT SINGLE QUOTATION MARK}"
    "“”„Δσ√…§€«»\N{NO-BREAK SPACE}"
)
_UNIT_LETTERS = ("µs", "µm")  #: a micro sign that begins a word
_INVISIBLE = dict.fromkeys(map(ord, "\N{ZERO WIDTH SPACE}\N{ZERO WIDTH NO-BREAK SPACE}"))
MIN_WIDE_BYTES = 4


@dataclass(frozen=True)
class TableLimits:
    """Sizes up to which a table is read; what exceeds them is refused before it fills the memory.

    Assumptions: a bench makes thousands of shifts, not millions; a trace of 1 s at 100 kHz has
    100000 lines of 60 characters.
    """

    file_bytes: int = 64_000_000  #: of a file on the disk
    unpacked_bytes: int = 256_000_000  #: of a workbook's parts once they are unpacked
    rows: int = 200_000  #: lines of a text, rows of a sheet; a minute on one core
    columns: int = 500
    workbook_cells: int = 300_000  #: rows times columns of a sheet
    cell_characters: int = 10_000

    def require(self, name: str, size: int, where: str, remedy: str) -> None:
        """Raise DataError where a size exceeds the limit of this name."""
        limit = getattr(self, name)
        if size > limit:
            raise DataError(
                f"{where}: {name.replace('_', ' ')} are {size}, but at most {limit} are read; "
                f"{remedy}, or raise the limit: --limit {name}={size}"
            )


def limits_of(values: Mapping[str, str]) -> TableLimits:
    """Convert options such as ``{"rows": "1000000"}``; raises InputError for other names."""
    names = [field.name for field in fields(TableLimits)]
    for name, text in values.items():
        if name not in names:
            raise InputError(f"--limit {name}=... names no limit; {did_you_mean(name, names)}")
        if not text.isdecimal() or int(text) < 1:
            raise InputError(f"--limit {name} is '{text}', but it must be a whole number above 0")
    return replace(TableLimits(), **{name: int(text) for name, text in values.items()})


def read_bytes(path: Path, limits: TableLimits) -> bytes:
    """Read a file that has at most ``limits.file_bytes``; raises DataError for a larger one."""
    with path.open("rb") as file:
        raw = file.read(limits.file_bytes + 1)
    if len(raw) > limits.file_bytes:
        size = max(path.stat().st_size, len(raw))
        limits.require("file_bytes", size, str(path), "divide the file")
    return raw


def decoded(raw: bytes) -> str:
    """Decode a text; raises DataError for bytes that are none."""
    wide = _wide_coding(raw)
    try:
        text = raw.decode(wide or "utf-8-sig")
    except UnicodeDecodeError as error:
        # Bytes that no text has give away anything else.
        if wide or not _BINARY.isdisjoint(raw):
            raise DataError("it is no text") from error
        texts = [_decoded_by(raw, page) for page in CODE_PAGES]
        text = max((text for text in texts if text is not None), key=_likelihood)
    return text if text.isascii() else unicodedata.normalize("NFC", text.translate(_INVISIBLE))


def _wide_coding(raw: bytes) -> str:
    """Find the coding of a text with two bytes a character, empty for another."""
    if raw.startswith(_WIDE_MARKS):
        return "utf-16"
    sample = raw[:4096]
    if len(sample) < MIN_WIDE_BYTES or len(raw) % 2:
        return ""
    even, odd = sample[::2].count(0), sample[1::2].count(0)
    characters = len(sample) / 2
    if odd > 0.7 * characters and not even:
        return "utf-16-le"
    return "utf-16-be" if even > 0.7 * characters and not odd else ""


def _decoded_by(raw: bytes, page: str) -> str | None:
    # cp1252 leaves five bytes without a character; the others have one for each.
    try:
        return raw.decode(page)
    except UnicodeDecodeError:
        return None


def _likelihood(text: str) -> float:
    """Score how likely the characters beyond ASCII are those of a table."""
    total = 0.0
    for place, letter in enumerate(text):
        if letter.isascii():
            continue
        before, after = text[max(0, place - 1) : place], text[place + 1 : place + 2]
        if letter in _LETTERS:
            total += _LETTERS[letter] if _fits_word(before, letter, after) else -1.0
        elif letter in _SIGNS and not (before.isalpha() and after.isalpha()):
            total += 1.0 if letter + after not in _UNIT_LETTERS else 2.0
        else:
            total -= 1.0
    return total


def _fits_word(before: str, letter: str, after: str) -> bool:
    """Test that a letter can stand between its neighbours."""
    if letter == "ß":
        return before.lower() in "aeiouäöüy" and bool(before)
    if letter.isupper() and before.islower():
        return False
    return before.isalpha() or (after.isalpha() and after not in ("s", "m"))
