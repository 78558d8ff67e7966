"""Draw data sets that the diagnosis itself could have made, at values of a cause's priors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.replicates import replicate
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.hypotheses import Space
from dogshape.diagnosis.terms import Array
from dogshape.validation.self_consistency import World, blank_cell


@dataclass(frozen=True)
class Source:
    """Blank data set with what a cause says of its cells at one value, (cells, 1)."""

    blank: Problem
    said: CellPredictions

    def drawn(self, offsets: Array, generator: np.random.Generator) -> Problem:
        """Draw a data set whose means are off, s, (cells,)."""
        blank = self.blank.bench
        assert blank is not None
        cells = replicate(self.said, blank.cells, offsets, generator)
        bench = replace(blank, cells=cells)
        return replace(self.blank, seen=observe(bench), bench=bench)


def source(
    whole: World, space: Space, shifts: int, generator: np.random.Generator, *, single: bool
) -> Source:
    """Predict a cause at values drawn from its priors, with so many shifts at each point."""
    cells = [blank_cell(cell.point, shifts, single=single) for cell in whole.bench.cells]
    bench = replace(whole.bench, cells=tuple(cells))
    problem = Problem(observe(bench), whole.emulator, whole.settings, bench=bench)
    values = space.values(generator.random((1, len(space.parameters))))
    return Source(problem, problem.predictions(space.hypothesis, values))
