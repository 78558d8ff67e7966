"""The numerical error of a mean shift time, found by repeating some of its shifts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, result_of

CHECKED, LEAST = 8, 4  #: one shift in so many is repeated, and at least so many
LEAST_SPREAD = 1e-4  #: s, the least spread that a numerical error is measured in

Runner = Callable[[Sequence[Block]], list[list[Record]]]  #: simulates blocks, in order


def repeated(shifts: int) -> int:
    """Compute the number of shifts that are repeated."""
    return min(shifts, max(LEAST, shifts // CHECKED))


def numerical_error(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], run: Runner
) -> float:
    """Return the numerical error of a mean shift time over operating points, s.

    An eighth of the shifts, at least four, drawn at random, is repeated with a
    tolerance thirty times smaller. The mean difference (weighted as the mean is) and its
    standard error are added as squares. A shift that does not engage counts with the
    time-out. NaN for a single shift.
    """
    apart, which = numerical_differences(blocks, rows, run)
    number = apart.size
    if number < 2:
        return math.nan
    weights = np.array([blocks[k].point.weight / len(blocks[k].angles) for k in which])
    weights /= weights.sum()
    mean = float(weights @ apart)
    scatter = float(weights**2 @ (apart - mean) ** 2) * number / (number - 1)
    return math.sqrt(mean**2 + scatter)


def numerical_differences(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], run: Runner
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Compute changes of some shift times by a smaller tolerance, s, and their blocks, (k,) each.

    The shifts are repeated as for ``numerical_error``.
    """
    shifts = [
        (which, place, row) for which, mine in enumerate(rows) for place, row in enumerate(mine)
    ]
    number = repeated(len(shifts))
    drawn = np.random.default_rng(len(shifts)).permutation(len(shifts))[:number]
    chosen = [shifts[k] for k in sorted(drawn.tolist())]
    fine = run([blocks[which].refined(place) for which, place, _ in chosen])
    timeout = blocks[0].clutch.timeout
    pairs = zip(chosen, fine, strict=True)
    apart = np.array(
        [_time(row, timeout) - _time(again[0], timeout) for (_, _, row), again in pairs]
    )
    return apart, np.array([which for which, _, _ in chosen])


def numerical_ratio(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], run: Runner
) -> tuple[float, float]:
    """Return mean and standard deviation of a shift's numerical error in spreads of its cell.

    ``blocks`` and their ``rows`` are those of whole cells. Of the squared mean that part is left
    out which the scatter of so few shifts makes by itself.
    """
    apart, which = numerical_differences(blocks, rows, run)
    spreads = np.array([_spread(rows[k]) for k in which])
    ratios = apart / np.maximum(spreads, LEAST_SPREAD)
    if ratios.size < 2:
        return float(ratios.mean()), 0.0
    mean, scatter = float(ratios.mean()), float(ratios.std(ddof=1))
    left = math.sqrt(max(0.0, mean**2 - scatter**2 / ratios.size))
    return math.copysign(left, mean), scatter


def _spread(rows: Sequence[Record]) -> float:
    times = [t for row in rows if (t := result_of(row).shift_time) is not None]
    return float(np.std(times, ddof=1)) if len(times) > 1 else 0.0


def _time(row: Record, timeout: float) -> float:
    time = result_of(row).shift_time
    return timeout if time is None else time
