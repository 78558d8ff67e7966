"""List the published figures of docs/blind.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks.entries import Entry
from benchmarks.kept import numbers
from benchmarks.published.sources import PERCENT, SPAN

PAGE = "docs/blind.md"


def _wide(label: str) -> Callable[[], Sequence[float]]:
    """Give a share of the wide set with its interval, in percent."""
    return lambda: [PERCENT * one for one in numbers("blind_wide", label)[:3]]


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "they are {:.2f} apart (root mean square)",
        lambda: numbers("blind_engines", "root mean square:")[:1],
    ),
    Entry(
        PAGE,
        "of the list {:.0f} % as far as data can show it, {:.0f} % of what",
        lambda: [
            PERCENT * numbers("blind_fine", "of them with effects of the list (60)")[6],
            PERCENT
            * numbers("blind_fine", "of the list: what is named is all that can be seen")[0],
        ],
    ),
    Entry(PAGE, "miss by {:.2f} errors,", lambda: numbers("blind_rest", "all cases:")[:1]),
    Entry(
        PAGE,
        "and by {:.1f} % of the mean time",
        lambda: numbers("blind_rest", "all cases:", "")[:1],
    ),
    Entry(
        PAGE,
        "(median; {:.1f} % root mean square)",
        lambda: numbers("blind_rest", "all cases:")[1:2],
    ),
    *(
        Entry(PAGE, text, _wide(label))
        for label, text in (
            ("none said: the true gap is within the margin", f"within the margin in {SPAN},"),
            ("true gap within the margin: none said", f"within it in {SPAN}. No"),
            ("all cases: all that is named is a cause", f"true in {SPAN} of 33 cases"),
            ("kind single: an effect named", f"anywhere in its prior in {SPAN},"),
            ("all cases: right   ", f"the truth leads in {SPAN} of all"),
            ("pairs: both causes found", f"both are found in {SPAN},"),
            ("all cases: named exactly, of what is named", f"the whole truth in {SPAN} only"),
        )
    ),
    Entry(
        PAGE,
        "the largest is {:.2f} margins",
        lambda: numbers("blind_wide", "largest true gap where none is said:"),
    ),
]
