"""Agreement of the compiled engine with Drake, from shifts that both simulate.

Both are simulated at the same designs, operating points, angles and draws. They agree where

- no more than ``max(1, n r + 3 sqrt(n r))`` of *n* shifts end differently, with *r* the share
  ``FLIPS``: at the angles between two slots a rounding decides, in up to 0.8 % of the shifts of a
  clutch (``docs/evidence/engines.txt``); and
- the means of the shifts that engage in both differ by no more than ``MEAN`` of Drake's, or by no
  more than three standard errors of the difference. Measured are 0.06 %, at most 0.8 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.evaluation import Params, design_blocks
from dogshape.pipeline.simulate.executor import Executor
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, result_of

FLIPS = 0.01  #: share of shifts that may end differently
MEAN = 0.01  #: difference of the means over Drake's
SURE = 3.0  #: standard errors from which a difference counts


@dataclass(frozen=True)
class Agreement:
    """Shifts of the compiled engine beside Drake's.

    Parameters
    ----------
    shifts : number that both engines simulated; ``flips`` of them end differently.
    median, worst : median and largest size of the deviation of a shift's time, over Drake's time.
    deviation : mean time of the compiled engine less Drake's, over Drake's; of shifts that engage
        in both. ``error`` is its standard error. All four are 0 where none does.
    """

    shifts: int
    flips: int
    median: float
    worst: float
    deviation: float
    error: float

    @property
    def agrees(self) -> bool:
        """Whether the engines agree by the rule of this module."""
        expected = FLIPS * self.shifts
        alike = self.flips <= max(1.0, expected + SURE * math.sqrt(expected))
        return alike and abs(self.deviation) <= max(MEAN, SURE * self.error)

    @property
    def record(self) -> dict[str, Any]:
        """Agreement by the names of ``result.json``."""
        return {
            "shifts": self.shifts,
            "outcome_same": self.shifts - self.flips,
            "median_deviation": self.median,
            "worst_deviation": self.worst,
            "mean_deviation": self.deviation,
            "standard_error": self.error,
            "agrees": self.agrees,
        }


def agreement_words(record: dict[str, Any]) -> str:
    """Write an agreement, given as its record, as a clause."""
    return (
        f"{record['outcome_same']} of {record['shifts']} shifts end as in Drake, the mean time "
        f"deviates by {record['mean_deviation']:+.2%} ± {record['standard_error']:.2%} (s.e.), "
        f"a shift's time by {record['median_deviation']:.2%} (median), at most "
        f"{record['worst_deviation']:.1%}"
    )


def agreement_of(pairs: Sequence[tuple[Record, Record]]) -> Agreement:
    """Compare shifts of the compiled engine with the same ones of Drake."""
    both = [(result_of(mine), result_of(drake)) for mine, drake in pairs]
    flips = sum(mine.outcome is not drake.outcome for mine, drake in both)
    times = np.array(
        [
            (mine.shift_time, drake.shift_time)
            for mine, drake in both
            if mine.shift_time is not None and drake.shift_time is not None
        ]
    )
    if not len(times):
        return Agreement(len(pairs), flips, 0.0, 0.0, 0.0, 0.0)
    apart, mean = times[:, 0] - times[:, 1], float(times[:, 1].mean())
    error = float(apart.std(ddof=1)) / len(apart) ** 0.5 if len(apart) > 1 else 0.0
    sizes = np.abs(apart) / times[:, 1]
    return Agreement(
        shifts=len(pairs),
        flips=flips,
        median=float(np.median(sizes)),
        worst=float(sizes.max()),
        deviation=float(apart.mean()) / mean,
        error=error / mean,
    )


def compare_engines(
    blocks: Sequence[Block], rows: Sequence[Sequence[Record]], judge: Clutch, executor: Executor
) -> Agreement:
    """Simulate blocks of the compiled engine, whose shifts are ``rows``, again in Drake.

    ``judge`` is the study's clutch in Drake.
    """
    drake = [replace(block, clutch=replace(block.clutch, solver=judge.solver)) for block in blocks]
    found = executor.run(drake)
    pairs = zip(rows, found, strict=True)
    return agreement_of([pair for both in pairs for pair in zip(*both, strict=True)])


def audit(
    study: Setup, designs: Sequence[Params], executor: Executor, judge: Clutch, shifts: int
) -> Agreement:
    """Simulate shifts of a search again in both engines, drawn at random by the search's seed.

    ``study`` is in the compiled engine, ``designs`` are those that it simulated.
    """
    settings = study.file.expectation
    places = len(designs), len(study.points), settings.angles
    rng, size = np.random.default_rng([study.file.search.seed, shifts]), math.prod(places)
    drawn = np.sort(rng.choice(size, min(shifts, size), replace=False))
    blocks: list[Block] = []
    own: list[Block] = []
    last = -1
    for design, point, angle in zip(*np.unravel_index(drawn, places), strict=True):
        if design != last:
            own, last = design_blocks(study, designs[design], places[2], settings.seed), design
        blocks.append(own[point].only([int(angle)]))
    with executor.apart() as running:
        rows = running.run(blocks)
    return compare_engines(blocks, rows, judge, executor)
