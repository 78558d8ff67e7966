"""Simulation of effects together, at levels that a diagnosis asks for while it runs.

``together/`` in the folder of banks has a file of the times for each clutch with its operating
points, beside what the package brings for those of its own data sets. A round of levels takes
seconds, so a run that is stopped loses one at most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory

from dogshape.diagnosis.prediction.bank import Bank, Plan, blocks_at, times_at
from dogshape.diagnosis.prediction.bank_store import BankStore, series_key
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.terms import Array
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, content_key

FOLDER = "together"


@dataclass
class JointSimulation:
    """Simulates levels of effects together with the shifts of a bank.

    Parameters
    ----------
    plan, bank : with the sense of the table.
    brought : file of times that the package brings.
    folder : of banks, in which further times are kept.
    jobs : worker processes, 0 for one a core.
    progress : is told what is simulated.
    """

    plan: Plan
    bank: Bank
    brought: Path
    folder: Path
    jobs: int
    progress: Progress

    @cached_property
    def store(self) -> BankStore:
        """Times of the bank's clutch at its operating points."""
        first = [series_key(block) for block in blocks_at(self.plan, self.bank.settings, BARE)]
        name = content_key({"baseline": first})
        return BankStore((self.brought, self.folder / FOLDER / f"{name}.json"))

    def __call__(self, levels: Sequence[Level]) -> Array:
        """Return the times of levels at all operating points, s, (L, C, n)."""
        blocks = [blocks_at(self.plan, self.bank.settings, level) for level in levels]
        every = [block for mine in blocks for block in mine]
        left = sum(len(block.angles) for block in self.store.missing(every))
        if left:
            names = dict.fromkeys(" with ".join(level.hypothesis) for level in levels)
            self.progress.say(f"{left} shifts of effects together: {', '.join(names)}")
        run = partial(self.store.times, run=self._run)
        return times_at(self.plan, self.bank.settings, levels, run)

    def _run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        with TemporaryDirectory(prefix="dogshape-") as folder:
            journal = ShiftJournal(Path(folder) / "shifts.jsonl")
            return Executor(journal, self.jobs).run(blocks)


BARE = Level(())  #: without any effect
