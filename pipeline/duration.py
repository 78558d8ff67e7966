"""Times as people say them."""

from __future__ import annotations


def about(seconds: float) -> str:
    """Return a foreseen time in words: minutes, from two hours on hours and minutes."""
    minutes = round(seconds / 60.0)
    if seconds < 45.0:
        return "less than a minute"
    if minutes <= 1:
        return "about a minute"
    if minutes < 120:
        return f"about {minutes} minutes"
    if minutes >= 600:
        return f"about {round(minutes / 60)} h"
    # Nobody plans by the minute what takes hours.
    tens = 10 * round(minutes / 10)
    return f"about {tens // 60} h {tens % 60} min" if tens % 60 else f"about {tens // 60} h"
