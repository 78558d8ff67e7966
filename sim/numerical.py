"""The numerical error of a mean shift time, found by repeating some of its shifts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from sim.batch import Block, Record, result_of

CHECKED = 8  #: one shift in so many is repeated

Runner = Callable[[Sequence[Block]], list[list[Record]]]  #: simulates blocks, in order


def numerical_error(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], run: Runner
) -> float:
    """Return the numerical error of a mean shift time, s.

    Every eighth shift is repeated with a tolerance thirty times smaller. The mean
    difference and its own standard error are added as squares. A shift that does not
    engage counts with the time-out.
    """
    shifts = [
        (block, angle, row)
        for block, mine in zip(blocks, rows, strict=True)
        for angle, row in zip(block.angles, mine, strict=True)
    ]
    chosen = shifts[:: min(CHECKED, len(shifts))]
    fine = run([Block(b.clutch.refined(), b.point, (angle,)) for b, angle, _ in chosen])
    late = blocks[0].clutch.timeout
    pairs = zip(chosen, fine, strict=True)
    apart = np.array([_time(row, late) - _time(again[0], late) for (_, _, row), again in pairs])
    return float(np.sqrt(apart.mean() ** 2 + apart.var() / apart.size))


def _time(row: Record, late: float) -> float:
    time = result_of(row).shift_time
    return late if time is None else time
