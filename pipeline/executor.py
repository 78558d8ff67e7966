"""Running blocks of shifts on all cores, never simulating a finished shift again."""

from __future__ import annotations

import atexit
import os
import shutil
import signal
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from joblib import Parallel, delayed, parallel_config

from pipeline.journal import ShiftJournal, append
from sim.batch import run_block
from sim.blocks import Block
from sim.records import Record

Progress = Callable[[int], None]  #: called with the number of shifts just finished


def _silent(_: int) -> None:
    """Report no progress."""


@dataclass
class Executor:
    """Runs blocks in worker processes and keeps their shifts in a journal.

    ``jobs`` 0 means one worker for each core. With one worker nothing is forked.
    """

    journal: ShiftJournal
    jobs: int = 0
    progress: Progress = field(default=_silent)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of every block, in the order of its angles.

        Shifts that the journal holds are not simulated again.
        """
        missing = [block for block in map(self._unfinished, blocks) if block.angles]
        known = sum(len(b.angles) for b in blocks) - sum(len(b.angles) for b in missing)
        if known:
            self.progress(known)
        for rows in self._simulate(missing):
            self.journal.add(rows)
            self.progress(len(rows))
        return [[self.journal.rows[key] for key in block.keys] for block in blocks]

    def _unfinished(self, block: Block) -> Block:
        keys = enumerate(block.keys)
        return block.only([place for place, key in keys if key not in self.journal.rows])

    def _simulate(self, blocks: list[Block]) -> Sequence[list[Record]]:
        jobs = min(self.jobs or os.cpu_count() or 1, len(blocks))
        if jobs <= 1:
            return (_work(block, self.journal.path) for block in blocks)  # type: ignore[return-value]
        with parallel_config(backend="loky", inner_max_num_threads=1):
            pool = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
        results: Sequence[list[Record]] = pool(
            delayed(_work_alone)(block, self.journal.path) for block in blocks
        )
        return results


def _work(block: Block, path: Path) -> list[Record]:
    rows = []
    for row in run_block(block):
        append(path, row)
        rows.append(row)
    return rows


def _work_alone(block: Block, path: Path) -> list[Record]:
    """Work in a process of its own; Ctrl-C is the parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return _work(block, path)


def scratch_executor(jobs: int = 0, progress: Progress = _silent) -> Executor:
    """Return an executor whose journal is a temporary file, gone when the program ends."""
    folder = tempfile.mkdtemp(prefix="dogshape-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Executor(ShiftJournal(Path(folder) / "shifts.jsonl"), jobs, progress)
