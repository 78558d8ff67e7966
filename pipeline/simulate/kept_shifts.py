"""Keeping the shifts of a command that is stopped, so that the same command goes on.

``expect``, ``strength`` and ``validate`` keep them in ``results/shifts``, ``gap --study`` in its
``--out`` or else in the bank's folder: a folder for each command, named by what was asked and by
the programs' versions, in which shifts are found by their content keys. It goes with the command's
end, when its answer is there. Where it cannot be written the command runs all the same.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.executor import Executor, connect, scratch_executor
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.errors import StorageError
from dogshape.sim.files import writing
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import engine

SHIFTS = Path("results") / "shifts"  #: folder of unfinished commands that have none of their own


def work_folder(root: Path, name: str, *asked: Any) -> Path:
    """Return the folder of a command's shifts, the same for the same question."""
    return root / f"{name}-{content_key({'asked': asked, **engine()})[:10]}"


@contextmanager
def kept_shifts(
    folder: Path, progress: WorkCounter, jobs: int = 0, cluster: str | None = None
) -> Iterator[Executor]:
    """Give an executor whose finished shifts stay in ``folder`` until the work is done.

    A stop by Ctrl-C says how many are kept. A folder that cannot be written, or is in use by the
    same command, is told in a line, and nothing is kept.
    """
    connect(cluster)
    made = [path for path in folder.parents if not path.exists()]
    with ExitStack() as held:
        try:
            held.enter_context(writing(folder))
        except StorageError as error:
            _remove_empty(made)
            reason = str(error).partition(";")[0]
            progress.say(f"{reason}: should this run be stopped, its finished shifts are lost")
            yield scratch_executor(jobs, progress.advance, cluster)
            return
        journal = ShiftJournal(folder / "shifts.jsonl")
        try:
            yield Executor(journal, jobs, progress.advance, cluster, progress.known)
        except BaseException as error:
            if journal.read_new() or journal.rows:
                if isinstance(error, KeyboardInterrupt):
                    progress.say(_kept(len(journal.rows), folder))
                raise
            _remove(folder, made)
            raise
        journal.say_unfinished(progress.say)
        _remove(folder, made)


def _kept(shifts: int, folder: Path) -> str:
    return f"{shifts} finished shifts are kept in {folder}; the same command goes on from there"


def _remove(folder: Path, made: list[Path]) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    own = [folder.parent] if folder.parent == SHIFTS else []
    _remove_empty([*own, *made])


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders, the innermost first, as far as nothing else is in them."""
    with suppress(OSError):
        for path in dict.fromkeys(folders):
            if path.exists():
                path.rmdir()
