"""Time stamps of shifts in a table: dates and times, or seconds, as seconds from any beginning."""

from __future__ import annotations

from datetime import UTC, datetime

#: Ways to write a date and time beside ISO 8601, day before month as in German.
WRITTEN = ("%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M")


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


def as_iso(text: str) -> str:
    """Write a time stamp as ISO 8601, or as it stands where it is one or a number.

    Raises ValueError for a text that is no time stamp.
    """
    for way in WRITTEN:
        try:
            return datetime.strptime(text, way).replace(tzinfo=UTC).isoformat()
        except ValueError:
            continue
    seconds_of(text)
    return text
