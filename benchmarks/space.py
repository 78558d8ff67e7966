"""Find what ``make one-level`` left in ``results``, for the tables about it."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.filling import first_designs
from dogshape.pipeline.train.training import references_of
from dogshape.pipeline.train.training_rows import dataset_of, study_mix
from dogshape.sim.statistics.shift_records import Record
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.references import Reference
from dogshape.surrogate.store import load


@dataclass(frozen=True)
class Space:
    """A filled folder."""

    folder: StudyFolder
    study: Setup

    @property
    def mix(self) -> Mix:
        """Operating points of the study."""
        return study_mix(self.study)

    @cached_property
    def form(self) -> str:
        """Form of the surrogate that was chosen."""
        return load(self.folder.surrogate).surrogate.form

    @cached_property
    def references(self) -> tuple[Reference, Reference]:
        """References that fill the space, and those of the best tenth."""
        return references_of(self.study, self.folder)

    @cached_property
    def shifts(self) -> list[Record]:
        """Shifts of the filling, those that a question added left out."""
        rows = ShiftJournal(self.folder.shifts).rows.values()
        return [row for row in rows if row["seed"] == self.study.file.surrogate.seed]

    def shifts_of(self, count: int) -> list[Record]:
        """Return the shifts of the first ``count`` designs."""
        names = list(self.study.variables)
        first = {tuple(d[n] for n in names) for d in first_designs(self.study, count)}
        # A shift's record has gone through SI, which may cost the last digit.
        return [s for s in self.shifts if tuple(round(s[n], 3) for n in names) in first]

    def first(self, count: int) -> Dataset:
        """Return the rows of the first ``count`` designs."""
        return dataset_of(self.study, self.shifts_of(count))


def space() -> Space:
    """Return the filled folder of the paper's study; exit where it is not there yet."""
    folder = StudyFolder(Path("results/mq200_paper_drake-space"))
    if not folder.best.exists():
        sys.exit(f"{folder.root} is not filled yet: run 'make one-level' first")
    return Space(folder, folder.stored_study())
