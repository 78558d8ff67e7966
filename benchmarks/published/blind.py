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


AGAIN = "field_again_20261205"


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "and *none* is said in {:.0f} instead of {:.0f} of 54",
        lambda: numbers(
            AGAIN,
            "$ python -m benchmarks.field_again results/field --kinds none",
            "none within the margin:",
        )[1::-1],
    ),
    Entry(
        PAGE,
        "in all; {:.0f} instead of 23 clear causes lead",
        lambda: [sum(numbers(AGAIN, kind)[1] for kind in ("beyond", "single", "three"))],
    ),
    Entry(
        PAGE,
        "lead, {:.0f} instead of 7 clear unknown ones",
        lambda: numbers(AGAIN, "outside")[4:5],
    ),
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
        "data, and in {:.0f} % ({:.0f} to {:.0f}) of {:.0f} of two",
        _held("at likely offsets", 1),
    ),
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
