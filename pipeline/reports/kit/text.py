"""Numbers as all pages and tables print them."""

from __future__ import annotations

import math


def in_ms(seconds: float | None) -> str:
    """Return a time in ms to a tenth, or a dash where there is none."""
    return "-" if seconds is None or math.isnan(seconds) else f"{seconds * 1e3:.1f}"
