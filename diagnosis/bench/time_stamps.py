"""Time stamps of shifts in a table: dates, clocks or seconds, as seconds from any beginning."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from dogshape.sim.errors import DataError, InputError

DATES = ("d/m/y", "m/d/y", "excel")  #: words in place of a unit, for dates that two readings have
DAY = 86_400.0  #: s
SAMPLE = 200  #: cells by which a column is known as dates
_ORDER = re.compile(r"^(\d{1,2})([./-])(\d{1,2})[./-]\d{2,4}")
_MONTH = r"(?:jan|feb|mar|mär|mrz|apr|may|mai|jun|jul|aug|sep|oct|okt|nov|dec|dez)[a-zä]*"
_ENGLISH = {"mai": "may", "okt": "oct", "dez": "dec", "mär": "mar", "mrz": "mar"}
_DAY = re.compile(rf"(?i)\d[./-]\d{{1,2}}[./-]\d|\d[. -]*{_MONTH}|{_MONTH}[. -]+\d")
_CLOCK = re.compile(r"\b\d{1,2}:\d{2}")
_WORDS = re.compile(rf"(?i){_MONTH}|[ap]\.?m\.?|utc")


def is_plain(text: str) -> bool:
    """Test that a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def seconds_of(text: str) -> float:
    """Convert a time stamp to s: ISO 8601 (UTC without a zone), or seconds.

    Raises ValueError for a text that is neither.
    """
    if is_plain(text):
        return float(text)
    moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def has_day(cells: Sequence[str]) -> bool:
    """Test that cells have a date."""
    return any(_DAY.search(cell) for cell in cells[:SAMPLE])


def is_dated(cells: Sequence[str]) -> bool:
    """Test that most cells are dates or clocks, with no words but months and zones."""
    known = [cell for cell in cells[:SAMPLE] if cell]
    dated = [(_CLOCK.search(cell) or _DAY.search(cell))
             and not re.search(r"[A-Za-z]{2}", _WORDS.sub("", cell)) for cell in known]  # fmt: skip
    return 2 * sum(map(bool, dated)) > len(known)


def stamps_of(cells: Sequence[Any], factor: float | None, option: str) -> tuple[list[str], str]:
    """Convert dates to ISO 8601, clocks without a date and numbers to s; also how they are read.

    ``factor`` is the unit of numbers in s, None where none is said; ``option`` one of ``DATES``.
    Raises DataError for other cells, InputError for those that can be read in two ways.
    """
    import pandas as pd  # noqa: PLC0415  # slow to load, and most tables have no dates

    whole = pd.Series(cells)
    if not isinstance(cells[0], str):
        # A spreadsheet counts days from 30 December 1899; shifts are less than a day apart.
        if option != "excel" and (factor or not whole.between(25_569, 73_050).all()):
            return [f"{(factor or 1.0) * v:.12g}" for v in cells], "seconds"
        if option != "excel" and (whole.diff().abs() >= 1.0).any():
            raise InputError(
                "it may be seconds, or dates as a spreadsheet counts them; say which behind the "
                "column: --column timestamp=COLUMN:s or COLUMN:excel"
            )
        found = pd.to_datetime(whole, unit="D", origin="1899-12-30", utc=True)
        return [one.isoformat() for one in found.dt.round("ms")], "dates of a spreadsheet"
    days = {bool(_DAY.search(cell)) for cell in cells}
    if len(days) > 1:
        raise DataError("some cells have a date and others have none")
    first, way = _day_first(cells, option)
    whole = whole.str.replace(rf"(?i)\.?[ -]*({_MONTH})\.?", _in_english, regex=True)
    whole = whole.str.replace(r"(?<=:\d\d),(?=\d)", ".", regex=True)
    whole = whole if True in days else "2000-01-01 " + whole
    try:
        found = pd.to_datetime(whole, format="mixed", dayfirst=first, utc=True)
    except (ValueError, OverflowError) as error:
        raise DataError(f"not all cells are dates ({str(error).splitlines()[0]})") from error
    if True in days:
        return [one.isoformat() for one in found], f"dates{way}"
    seconds = (found - found.dt.normalize()).dt.total_seconds()
    seconds += DAY * (seconds.diff() < -DAY / 2.0).cumsum()
    return [f"{one:.12g}" for one in seconds], "clock without a date"


def _in_english(month: re.Match[str]) -> str:
    short = month[1][:3].lower()
    return f" {_ENGLISH.get(short, short)} "


def _day_first(cells: Sequence[str], option: str) -> tuple[bool, str]:
    """Decide whether the day stands before the month; InputError where it may be either."""
    orders = [found for cell in cells if (found := _ORDER.match(cell))]
    if not orders:
        return False, ""
    day, month = (any(int(found[k]) > 12 for found in orders) for k in (1, 3))
    dotted = all(found[2] == "." for found in orders)
    if not (dotted or option or day or month) and len({found[0] for found in orders}) > 1:
        raise InputError(
            f"'{cells[0]}' has its day or its month first; say which behind the column: --column "
            "timestamp=COLUMN:d/m/y or COLUMN:m/d/y"
        )
    first = dotted or option == "d/m/y" or (option != "m/d/y" and not month)
    return first, f", {'day' if first else 'month'} first"
