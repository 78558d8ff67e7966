"""Data sets of the toy bench, drawn as the likelihood says that data come about.

Each operating point errs by what its emulator and the simulation are said to err, all together by
what they have in common, spreads of single shifts by their own error; late shifts, and shifts that
do not engage, come with the shares that are said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.likelihood.cell_likelihood import beta_of
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.mean_density import outlier_beta
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.prediction import Array, Hypothesis, Prediction
from dogshape.diagnosis.settings import USUAL
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM
from tests.toy import CLUTCH, Toy, bench_of

LATE = (0.05, 0.15, 0.02)  #: share of late shifts at fast points, by how much, deviation, s


@dataclass(frozen=True)
class Declared(Toy):
    """The toy with even times, as the bundled bank has them, and with late shifts of fast points.

    The toy's own times are a lump with a tail, of which ten shifts may show the lump alone. Of slow
    points nobody knows how late a shift can be, and none is.
    """

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Return what a hypothesis says of an operating point."""
        plain = super().at(hypothesis, values, cell)
        one = np.ones(len(values))
        even = 2.0 * (np.arange(self.quantiles) + 0.5) / self.quantiles - 1.0
        mean, sd = (f(plain.times, axis=1, keepdims=True) for f in (np.mean, np.std))
        said = replace(plain, times=mean + np.sqrt(3.0) * sd * even, engaged=0.97 * one)
        if abs(self.points[cell].mismatch) < 99.0 * RPM:
            return said
        share, behind, wide = LATE
        return replace(said, outlier_share=share * one, behind=behind * one, behind_sd=wide * one)


@dataclass(frozen=True)
class Change:
    """What data have other than is said: a factor of spreads, an offset of all times, s."""

    stretch: float = 1.0
    offset: float = 0.0
    late: float = 1.0


AS_SAID = Change()


def drawn(
    toy: Toy,
    hypothesis: Hypothesis,
    values: Array,
    generator: np.random.Generator,
    *,
    shifts: int = 10,
    single: bool = False,
    change: Change = AS_SAID,
) -> Bench:
    """Return a data set of a hypothesis with values (1, p)."""
    problem = problem_of(toy, bench_of({}, generator, points=toy.points, shifts=2))
    said = problem.predictions(hypothesis, values)
    together = problem.discrepancy.draw(generator)
    own = said.error[:, 0] * generator.standard_normal(len(toy.points))
    offsets = together + own + change.offset
    readings: list[Reading] = []
    for cell, point in enumerate(toy.points):
        times = _cell(said, cell, generator, (shifts, single), change) + offsets[cell]
        groups = [(1, t) for t in times] if single else [(times.size, times.mean())]
        parts = [(n, float(t), True) for n, t in groups if times.size]
        missed = [(1, None, False)] * (shifts - times.size)
        readings += [Reading(len(readings) + 2, point, *part) for part in (*parts, *missed)]
    return Bench("toy", "as said", CLUTCH, gather(readings), None, Sensor())


def _cell(
    said: CellPredictions,
    cell: int,
    generator: np.random.Generator,
    form: tuple[int, bool],
    change: Change,
) -> Array:
    """Return the times of the shifts of a cell that engage, but for errors of its mean, s."""
    shifts, single = form
    share = generator.beta(*(part[cell, 0] for part in beta_of(said)))
    count = int(generator.binomial(shifts, share))
    mean, times = said.mean[cell, 0], said.times[cell, 0]
    # Of means the spread counts as known, of single shifts it has an error.
    wrong = said.shape[cell, 0] * generator.standard_normal() if single else 0.0
    stretch = change.stretch * np.exp(wrong)
    found = mean + stretch * (generator.choice(times, count) - mean)
    rate = said.outlier_share[cell, 0]
    if single:
        rate = generator.beta(*(part[cell, 0] for part in outlier_beta(said)))
    late = generator.random(count) < change.late * rate
    if np.isnan(said.behind[cell, 0]):
        return found
    behind = generator.normal(said.behind[cell, 0], said.behind_sd[cell, 0], count)
    return np.where(late, found + behind, found)


def problem_of(toy: Toy, bench: Bench) -> Problem:
    """Return the problem of a data set of the toy."""
    return Problem(observe(bench), toy, USUAL, bench=bench)


def few_points(points: Sequence[OperatingPoint], step: int) -> tuple[OperatingPoint, ...]:
    """Return every so many of some operating points."""
    return tuple(points[::step])
