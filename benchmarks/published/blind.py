"""List the published figures of docs/blind.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks.entries import Entry
from benchmarks.kept import numbers
from benchmarks.published.sources import PERCENT, SPAN

PAGE = "docs/blind.md"


def _held(name: str, place: int) -> Callable[[], Sequence[float]]:
    """Give how many 90 % intervals hold what was drawn, in percent, and of how many sizes."""

    def found() -> Sequence[float]:
        row = numbers("common_errors", "90 % intervals that hold", name)[4 * place :]
        return [PERCENT * one for one in row[:3]] + row[3:4]

    return found


def _drawn(label: str, *places: int) -> Callable[[], Sequence[float]]:
    """Give figures of the self-consistency at some places of a row, shares in percent."""

    def found() -> Sequence[float]:
        row = numbers("self_consistency", label)
        return [PERCENT * row[k] if abs(row[k]) <= 1.0 else row[k] for k in places]

    return found


ENTRIES: list[Entry] = [
    *(
        Entry(PAGE, text, _drawn(*source))
        for text, source in (
            (f"the 90 % set holds the cause in {SPAN}", ("true cause in the 90 % set", 0, 1, 2)),
            (f"What leads is right in {SPAN}", ("leading one is the cause", 0, 1, 2)),
            ("where {:.0f} % are said on average", ("said on average", 0)),
            ("values lie in their 90 % intervals in " + SPAN, ("true values in 90 %", 0, 1, 2)),
        )
    ),
    Entry(
        PAGE,
        "error is {:.3f}, below the 0.05",
        lambda: numbers("self_consistency", "its calibration error, ten bins"),
    ),
    Entry(
        PAGE,
        "uniform (p = {:.2f})",
        lambda: numbers("self_consistency", "ranks uniform, p of Kolmogorov and Smirnov"),
    ),
    Entry(
        PAGE,
        "effects as often as expected probabilities are too careful by {:.1f} points, with a "
        "standard error of {:.1f}",
        lambda: [
            factor * PERCENT * one
            for factor, one in zip(
                (-1.0, 1.0), numbers("self_consistency", "the same, numbers"), strict=True
            )
        ],
    ),
    Entry(
        PAGE,
        "nothing is named, and *none* is said in " + SPAN,
        _drawn("none said", 0, 1, 2),
    ),
    Entry(
        PAGE,
        "the truth in {:.0f} % ({:.0f} to {:.0f}) of {:.0f} sizes of one effect",
        _held("at likely offsets", 0),
    ),
    Entry(
        PAGE,
        "without an offset have {:.0f} % ({:.0f} to {:.0f}) on the same",
        lambda: _held("without an offset", 0)()[:3],
    ),
    Entry(
        PAGE,
        "and in {:.0f} % ({:.0f} to {:.0f}) of {:.0f} of two",
        _held("at likely offsets", 1),
    ),
    Entry(
        PAGE,
        "they are {:.2f} apart (root mean square)",
        lambda: numbers("blind_engines", "root mean square:")[:1],
    ),
]
