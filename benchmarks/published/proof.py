"""List the published figures of docs/proof.md."""

from __future__ import annotations

from functools import partial

from benchmarks.entries import Entry
from benchmarks.kept import numbers

PAGE = "docs/proof.md"


def _row(speed: int) -> list[float]:
    """Give deviations of a row of the published table at the ten angles and over all, percent."""
    return numbers("adams", "1/min", f"{speed} ")[1:]


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "means is {:.2f} %, the median error",
        lambda: numbers("convergence", "largest error of a mean, %")[3:4],
    ),
    Entry(
        PAGE,
        "of a single shift {:.4f} %",
        lambda: numbers("convergence", "median error of a shift, %")[3:4],
    ),
    Entry(
        PAGE,
        "in the accuracy is {:.1f};",
        lambda: numbers(
            "convergence", "observed order of the median error in the accuracy, 3e-3 to 1e-4:"
        ),
    ),
    Entry(
        PAGE,
        "at 1e-2 a design loses {:.0f} %.",
        lambda: numbers("convergence", "largest error of a mean, %")[:1],
    ),
    Entry(
        PAGE,
        "| the ten published ones | {:.1f} % | {:.1f} % | {:.1f} % | {:.1f} % |",
        lambda: [
            *numbers("adams", "as published")[:2],
            *numbers("adams", "compiled engine")[:2],
        ],
    ),
    Entry(
        PAGE,
        "| all, 48 even ones | {:.1f} % | {:.1f} % | {:.1f} % | {:.1f} % |",
        lambda: [
            *numbers("adams", "all angles, as published")[:2],
            *numbers("adams", "all angles, compiled engine")[:2],
        ],
    ),
    *(
        Entry(
            PAGE,
            f"| {speed} | {{:.1f}} % | {{:.1f}} % | {{:.1f}} % | {{:.1f}} % |",
            partial(_row, speed),
        )
        for speed in (5, 10, 25, 50, 100, 149, 249)
    ),
    Entry(
        PAGE,
        "take {:.2f} ± {:.2f} of the table",
        lambda: numbers("adams", "shifts of the compiled engine that skip no slot")[-2:],
    ),
    Entry(
        PAGE,
        "the median is {:.3f} % and the worst of these shifts {:.2f} % off; "
        "1e-2 costs {:.2f} as much with {:.2f} % and {:.0f} %",
        lambda: [
            *numbers("work_precision", "Drake rk3                     3e-04")[3:5],
            *(
                numbers("work_precision", "Drake rk3                     1e-02")[k]
                for k in (1, 3, 4)
            ),
        ],
    ),
    Entry(
        PAGE,
        "All dogs cost {:.1f} times one dog",
        lambda: numbers("work_precision", "Drake rk3, all dogs           3e-04")[1:2],
    ),
    Entry(
        PAGE,
        "({:.2f} of the default's cost)",
        lambda: numbers("work_precision", "MuJoCo                        20 us")[1:2],
    ),
    Entry(
        PAGE,
        "At 0.1 % it costs {:.2f},",
        lambda: numbers("work_precision", "MuJoCo                         5 us")[1:2],
    ),
    Entry(
        PAGE,
        "on the paper's study takes {:.0f} shifts of Drake and {:.1f} s of processor time",
        lambda: [numbers("expectation", "expect --precision 0.01")[k] for k in (2, -1)],
    ),
    Entry(
        PAGE,
        "hold Drake's mean of 96 angles at {:.1f} % of the operating points and in {:.1f} % of the "
        "runs; without the retries at {:.1f} % and in {:.1f} %",
        lambda: [
            number
            for row in ("with retries:", "without:")
            for number in numbers("expectation", "95 % intervals", row)
        ],
    ),
    Entry(
        PAGE,
        "One of the {:.0f} shifts does not engage: its retry moves the mean by {:.2f} ms",
        lambda: [
            numbers("expectation", "of ")[0],
            numbers("expectation", "expected shift time")[0]
            - numbers("expectation", "expected shift time")[1],
        ],
    ),
]
