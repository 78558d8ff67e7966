"""Replicates: data sets drawn as the likelihood says that data come about.

Each operating point errs by what its emulator and the simulation are said to err, all together by
what they have in common, spreads of single shifts by an error of their own. In few cells the mean
is off by much more. Late shifts, and shifts that do not engage, come with the shares that are said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.reading import Cell, Reading
from dogshape.diagnosis.likelihood.cell_likelihood import beta_of
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy
from dogshape.diagnosis.likelihood.mean_density import outlier_beta
from dogshape.diagnosis.terms import Array


def offsets_of(
    predicted: CellPredictions, discrepancy: Discrepancy, generator: np.random.Generator
) -> Array:
    """Draw what the means of all cells are off by, s, (cells,), at the one value of a prediction.

    That are the discrepancy, the error that cells share, each cell's own, and odd cells.
    """
    cells = len(predicted.mean)
    found = discrepancy.draw(generator)
    found = found + predicted.common[:, 0] * generator.standard_normal()
    found = found + predicted.error[:, 0] * generator.standard_normal(cells)
    odd = generator.random(cells) < predicted.missed[:, 0]
    drawn: Array = found + odd * predicted.jump[:, 0] * generator.standard_normal(cells)
    return drawn


def replicate(
    predicted: CellPredictions,
    like: Sequence[Cell],
    offsets: Array,
    generator: np.random.Generator,
) -> tuple[Cell, ...]:
    """Draw cells with as many shifts, in the same form, as others.

    Parameters
    ----------
    predicted : of one value, (cells, 1).
    like : the others, of which readings count as tried unless nobody knows.
    offsets : what the cells' means are off by, s, (cells,).
    """
    found = []
    for place, cell in enumerate(like):
        single = any(r.n == 1 or r.sd is not None for r in cell.readings)
        law = _Law.of(predicted, place, generator, single=single)
        rows = [row for r in cell.readings for row in _drawn(r, law, offsets[place], generator)]
        found.append(replace(cell, readings=tuple(rows)))
    return tuple(found)


def _drawn(
    reading: Reading, law: _Law, offset: float, generator: np.random.Generator
) -> list[Reading]:
    """Draw the shifts of a reading: what engaged, and what was tried in vain."""
    if reading.engaged is None:
        return [reading]
    times = law.times(reading.n, generator) + offset
    found = []
    if times.size:
        sd = float(times.std(ddof=1)) if reading.sd is not None and times.size > 1 else None
        mean = float(times.mean())
        found.append(replace(reading, n=times.size, time=mean, engaged=True, trace=None, sd=sd))
    if failed := reading.n - times.size:
        found.append(replace(reading, n=failed, time=None, engaged=False, trace=None, sd=None))
    return found


@dataclass(frozen=True)
class _Law:
    """How the shifts of a cell come about: what is drawn once for all of them.

    ``timely`` are times of shifts that are not late, s, (q,); ``engaged`` and ``late`` are shares;
    ``behind`` and ``behind_sd`` the delay of late shifts and its deviation, s, NaN where unknown.
    """

    timely: Array
    engaged: float
    late: float
    behind: float
    behind_sd: float

    @classmethod
    def of(
        cls, predicted: CellPredictions, cell: int, generator: np.random.Generator, *, single: bool
    ) -> _Law:
        """Draw the law of a cell.

        Of means the spread and the share of late shifts count as known, of single shifts both have
        an error.
        """
        share = float(generator.beta(*(part[cell, 0] for part in beta_of(predicted))))
        mean, times = predicted.mean[cell, 0], predicted.times[cell, 0]
        wrong = predicted.shape[cell, 0] * generator.standard_normal() if single else 0.0
        rate = predicted.outlier_share[cell, 0]
        if single:
            rate = generator.beta(*(part[cell, 0] for part in outlier_beta(predicted)))
        behind = predicted.behind[cell, 0], predicted.behind_sd[cell, 0]
        return cls(mean + np.exp(wrong) * (times - mean), share, float(rate), *map(float, behind))

    def times(self, number: int, generator: np.random.Generator) -> Array:
        """Draw the times of those of some shifts that engage, s, but for errors of their mean."""
        count = int(generator.binomial(number, self.engaged))
        found: Array = generator.choice(self.timely, count)
        late = generator.random(count) < self.late
        if np.isnan(self.behind):
            return found
        return np.where(late, found + generator.normal(self.behind, self.behind_sd, count), found)
