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


def _one_level() -> list[float]:
    """Give Q2, that of points and the rank of all designs of the learning curve."""
    found = numbers("learning_curve", "500")
    return [found[place] for place in (1, 5, 7)]


def _grown(clutch: str) -> list[float]:
    """Give Q2 of more and more designs of a clutch, of rows alone and of one engine."""
    rows = [f"all points{c:>11}" for c in (100, 200, 300)]
    found = [
        fitted(clutch, row)[2] for row in (*rows, most_designs(clutch), f"own points{250:>11}")
    ]
    return [*found, fitted(clutch, "one engine")[3]]


#: Shifts at all operating points of the prototype, by default and before.
FIT_SHIFTS = 135000, 150000


def _elsewhere() -> list[float]:
    """Give how long a fit took on another machine, and would take with fewer shifts."""
    few, many = (numbers("fit_clock", f"prototype{count:>13}")[0] for count in FIT_SHIFTS)
    took = numbers("fit_clock", "with 150000 shifts", "prototype")[0]
    return [took, took * few / many]


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
        "each uncertain by {:.1f} ms, Q² {:.3f}, of points {:.3f} and a rank of {:.2f} among",
        lambda: [
            MS * surrogate()["validation"]["noise_s"],
            *(surrogate()["validation"][key] for key in ("q2", "q2_points", "rank_best")),
        ],
    ),
    Entry(
        PAGE,
        "of the prototype they have Q² {:.3f} alone",
        lambda: [fitted("prototype", f"own points{250:>11}")[2]],
    ),
    Entry(
        PAGE,
        "it had Q² {:.3f} for the expected time, {:.3f} for single points, and a rank correlation "
        "of {:.2f}",
        _one_level,
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
        "clock the whole command takes {:.0f} s for the prototype with its 28 operating points on "
        "two cores on which 150 000 such shifts would take {:.0f} s",
        lambda: [numbers("fit_clock", f"prototype{count:>13}")[0] for count in FIT_SHIFTS],
    ),
    Entry(
        PAGE,
        "Another machine took {:.0f} s for these, so it would take some {:.0f} s there",
        _elsewhere,
    ),
    Entry(
        PAGE,
        "it took {:.0f} and {:.0f} s for the small and the large clutch",
        lambda: [numbers("fit_clock", one)[0] for one in ("small", "large")],
    ),
    Entry(
        PAGE,
        "where `check --help` takes {:.2f} s of processor time, a cold start takes {:.2f} s, and "
        "{:.2f} s where",
        lambda: [
            numbers("asking", f"{asked}:")[3]
            for asked in ("check --help", "one design, nothing kept", "one design, kept")
        ],
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
        "one after the other, in {:.0f} s. The compiled engine simulates a design in {:.1f} s",
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
]
