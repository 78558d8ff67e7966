"""List the published figures of docs/surrogate.md."""

from __future__ import annotations

from functools import partial

from benchmarks.entries import Entry
from benchmarks.kept import numbers, surrogate
from benchmarks.published.sources import (
    CLUTCHES,
    MS,
    PERCENT,
    clutch_row,
    fitted,
    most_designs,
    study_name,
)

PAGE = "docs/surrogate.md"


def _bundled() -> list[float]:
    """Give Q2, that of points and the rank of the bundled surrogate and of a fit in two levels."""
    both = fitted("prototype", "bundled")[1:], fitted("prototype", most_designs("prototype"))
    return [found[place] for found in both for place in (2, 4, 6)]


def _grown(clutch: str) -> list[float]:
    """Give Q2 of more and more designs of a clutch, of rows alone and of one engine."""
    rows = [f"all points{c:>11}" for c in (100, 200, 300)]
    found = [
        fitted(clutch, row)[2] for row in (*rows, most_designs(clutch), f"own points{250:>11}")
    ]
    return [*found, fitted(clutch, "one engine")[3]]


ENTRIES: list[Entry] = [
    *(
        Entry(
            PAGE,
            f"| {told} | {{:.3f}} | {{:.2f}} ms | {{:+.2f}} ms | {{:.0f}} % | {{:.3f}} | "
            "{:.0f} % | {:.2f} |",
            partial(clutch_row, clutch),
        )
        for clutch, told in CLUTCHES.items()
    ),
    Entry(
        PAGE,
        "has Q² {:.3f}, of points {:.3f} and a rank of {:.2f}, where what `dogshape fit "
        "mq200_paper --levels 2` makes has {:.3f}, {:.3f} and {:.2f}:",
        _bundled,
    ),
    *(
        Entry(
            PAGE,
            f"| {told} |" + 6 * " {:.3f} |",
            partial(_grown, clutch),
        )
        for clutch, told in CLUTCHES.items()
    ),
    Entry(
        PAGE,
        "themselves uncertain by {:.2f}, {:.2f} and {:.2f} ms. What is learnt from took {:.0f}, "
        "{:.0f} and {:.0f} s of a processor, references {:.0f}, {:.0f} and {:.0f} s and fits "
        "{:.0f}, {:.0f} and {:.0f} s.",
        lambda: [
            *(numbers("two_fidelities", study_name(one), "references", "")[2] for one in CLUTCHES),
            *(
                numbers("two_fidelities", study_name(one), "processor time")[place]
                for place in range(3)
                for one in CLUTCHES
            ),
        ],
    ),
    Entry(
        PAGE,
        "clock the whole command takes {:.0f} s for the prototype",
        lambda: numbers("fit_clock", "prototype")[:1],
    ),
    Entry(
        PAGE,
        "and took {:.0f} and {:.0f} s for the small and the large clutch",
        lambda: [numbers("fit_clock", one)[0] for one in ("small", "large")],
    ),
    Entry(
        PAGE,
        "A cold start takes {:.2f} s of processor time, and {:.2f} s where",
        lambda: [numbers("asking", f"one design, {kept}:")[3] for kept in ("nothing kept", "kept")],
    ),
    Entry(
        PAGE,
        "the whole answer takes {:.1f} s, of which the closed-form checks take {:.2f} s",
        lambda: [
            numbers("asking", "100000 designs:")[3],
            numbers("asking", "their closed-form checks alone:")[0],
        ],
    ),
    Entry(
        PAGE,
        "one after the other, in {:.0f} s. Without a surrogate the compiled engine simulates a "
        "design in {:.1f} s",
        lambda: [
            numbers("asking", "one after the other, as for a limit of one's own:")[0],
            numbers("asking", "one design by the compiled engine:")[3],
        ],
    ),
    *(
        Entry(
            PAGE,
            f"| {form} | {{:.3f}} | {{:.3f}} | {{:.0f}} % |",
            lambda place=place: [  # type: ignore[misc]
                surrogate()["comparison"][place]["log_density"],
                surrogate()["comparison"][place]["log_rmse"],
                PERCENT * surrogate()["comparison"][place]["coverage_95"],
            ],
        )
        for place, form in enumerate(
            (
                "point, smooth, growing steps, growing rough, ridge",
                "smooth, growing rough",
                "smooth, growing steps, growing rough",
                "point, smooth, growing steps, growing rough",
                "smooth, rough",
                "smooth",
            )
        )
    ),
    Entry(
        PAGE,
        "standard error {:.1f} ms) | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            MS * surrogate()["validation"]["noise_s"],
            surrogate()["validation"]["q2"],
            MS * surrogate()["validation"]["rmse_s"],
            PERCENT * surrogate()["validation"]["coverage_95"],
        ],
    ),
    Entry(
        PAGE,
        "at single operating points | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            surrogate()["validation"]["q2_points"],
            MS * surrogate()["validation"]["rmse_points_s"],
            PERCENT * surrogate()["validation"]["coverage_points"],
        ],
    ),
    Entry(
        PAGE,
        "{:d} of their shifts did not engage, where {:.0f} were expected",
        lambda: [surrogate()["validation"]["lost"], surrogate()["validation"]["lost_expected"]],
    ),
    Entry(
        PAGE,
        "rank correlation is {:.2f} (0.9",
        lambda: [surrogate()["validation"]["rank_best"]],
    ),
]
