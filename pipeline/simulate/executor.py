"""Running blocks of shifts on all cores or a cluster, never simulating a finished shift again.

On this machine workers write the journal themselves, so a kill of the parent loses nothing
that was finished. Workers of a cluster hand their records back, and the parent writes them.
A command that is stopped keeps its shifts in a folder for its question, and goes on from there.
"""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor, process_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError

from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.store.folder import ShiftJournal, append
from dogshape.sim.errors import InputError, StorageError, WorkerError
from dogshape.sim.files import writing
from dogshape.sim.statistics.blocks import Block, run_block
from dogshape.sim.statistics.shift_records import Record, content_key
from dogshape.sim.versions import engine, versions

Advance = Callable[[int, int], None]  #: gets the shifts just finished, and those known before
UNSEEN: Advance = WorkCounter(SILENT, 0).advance  #: reports no progress

PATIENCE = 10.0  #: s to wait for a cluster and for its first worker
MANY = 100  #: blocks that a cluster is sent at once
LOOK = 1.0  #: s between looks whether the parent is alive
LEAK = int(1.5e9)  #: bytes by which a worker may grow
FEW = 3000  #: compiled shifts that threads end sooner than processes, which start slowly
TRIES = 3  #: times that workers may die one after the other without a shift finished

# The pool replaces a worker that has grown by plants and compiled code, and loses nothing by it.
warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)

_one_at_a_time = threading.Lock()  #: a process has one plant, and a cluster's worker has threads


def workers_of(jobs: int) -> int:
    """Return the number of worker processes; 0 asks for one a core."""
    return jobs or os.cpu_count() or 1


@dataclass
class Executor:
    """Runs blocks in worker processes and keeps their shifts in a journal.

    ``jobs`` 0 means one worker for each core; one forks nothing. ``cluster`` is the address of a
    Dask scheduler, whose workers take the place of the cores.
    """

    journal: ShiftJournal
    jobs: int = 0
    progress: Advance = UNSEEN
    cluster: str | None = None
    _counted: set[str] = field(default_factory=set, init=False, repr=False)
    _asked: int = field(default=0, init=False, repr=False)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of every block, in the order of its angles.

        WorkerError where workers die again and again or the cluster is lost, StorageError where
        the journal cannot be written.
        """
        asked = {key for block in blocks for key in block.keys}
        known = [key for key in asked - self._counted if key in self.journal.rows]
        self._counted |= asked
        if known:
            self.progress(len(known), len(known))
        left = self._unfinished(blocks)
        self._asked += sum(len(block.angles) for block in left)
        jobs = min(workers_of(self.jobs), len(left))
        if left and self.cluster is not None:
            found = self._on_cluster(left, self.cluster)
        elif jobs > 1:
            found = self._on_cores(left, jobs)
        else:
            found = (_work(block, self.journal.path) for block in left)
        for rows in found:
            self.journal.rows.update((row["key"], row) for row in rows)
            self.progress(len(rows), 0)
        if left:  # once: the disk takes longer for a block than its shifts
            self.journal.sync()
        return [[self.journal.rows[key] for key in block.keys] for block in blocks]

    def forget(self, kept: Collection[str] = ()) -> None:
        """Drop the shifts of the journal, but those ``kept`` by their keys: results have them."""
        self.journal.drop(self.journal.rows.keys() - set(kept))
        self._counted &= set(kept)

    def _unfinished(self, blocks: Sequence[Block]) -> list[Block]:
        """Reduce blocks to the shifts that are not finished, each once."""
        left, taken = [], set(self.journal.rows)
        for block in blocks:
            keys = {key: place for place, key in enumerate(block.keys)}
            places = [place for key, place in keys.items() if key not in taken]
            taken.update(keys)
            if places:  # a whole block keeps the keys that it has worked out
                left.append(block if len(places) == len(block.keys) else block.only(places))
        return left

    def _on_cores(self, blocks: list[Block], jobs: int) -> Iterator[list[Record]]:
        """Yield the records of blocks as they finish; what a dead worker left goes to others."""
        tries = TRIES
        while blocks:
            known = len(self.journal.rows)
            few = self._asked < FEW and all(b.clutch.solver.engine == "planar" for b in blocks)
            work, how = (_work, {}) if few else (_work_alone, {"inner_max_num_threads": 1})
            try:
                with parallel_config("threading" if few else "loky", **how):
                    pool = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
                yield from pool(delayed(work)(block, self.journal.path) for block in blocks)
            except TerminatedWorkerError as error:
                yield self.journal.read_new()
                tries = tries - 1 if len(self.journal.rows) == known else TRIES
                if not tries:
                    raise WorkerError(
                        f"worker processes died {TRIES} times without finishing a shift, as they "
                        "do when memory runs out; finished shifts are kept, so run the command "
                        "again with fewer --jobs"
                    ) from error
            blocks = self._unfinished(blocks)

    def _on_cluster(self, blocks: list[Block], address: str) -> Iterator[list[Record]]:
        """Yield the records of blocks as a cluster hands them back, written."""
        from distributed import as_completed  # noqa: PLC0415  an extra, and slow to load

        client = connect(address)
        try:
            left = client.map(_work_away, blocks, pure=False, batch_size=MANY)
            try:
                for future in as_completed(left, loop=client.loop):  # type: ignore[no-untyped-call]
                    rows = future.result()
                    _require_same(address, rows[0], "a worker")
                    append(self.journal.path, *rows)
                    yield rows
            finally:
                client.cancel(left)
        except Exception as error:
            of_dask = type(error).__module__.partition(".")[0] in ("distributed", "concurrent")
            if not of_dask and not isinstance(error, TimeoutError):
                raise
            fault = f"the cluster {address} was lost ({type(error).__name__})"
            remedy = "shifts that came back are kept, so mend it and run the command again"
            raise WorkerError(f"{fault}; {remedy}") from error


def _work(block: Block, path: Path) -> list[Record]:
    """Simulate a block; the journal has each of its shifts as soon as it is finished."""
    rows = []
    for row in run_block(block):
        append(path, row)
        rows.append(row)
    return rows


def _work_alone(block: Block, path: Path) -> list[Record]:
    """Work in a process of its own, no longer than its parent; Ctrl-C is the parent's business."""
    _end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A worker that grows by more is taken to leak and ends; both engines take 0.4 GB of code.
    process_executor._MAX_MEMORY_LEAK_SIZE = LEAK
    return _work(block, path)


@cache
def _end_with_parent() -> None:
    """End this process soon after its parent: a process whose parent was killed has another one."""
    parent = os.getppid()

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=look, name="parent", daemon=True).start()


def end_workers() -> None:
    """End this process's workers: their processor time counts as its own only then."""
    get_reusable_executor().shutdown()


def _work_away(block: Block) -> list[Record]:
    """Work on another machine, whose process may have several threads."""
    with _one_at_a_time:
        return list(run_block(block))


def scratch_executor(
    jobs: int = 0, progress: Advance = UNSEEN, cluster: str | None = None
) -> Executor:
    """Return an executor whose journal is a temporary file, gone when the program ends."""
    folder = tempfile.mkdtemp(prefix="dogshape-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Executor(ShiftJournal(Path(folder) / "shifts.jsonl"), jobs, progress, cluster)


_clients: dict[str, Any] = {}  #: of Dask clusters, by address


def connect(address: str | None) -> Any:
    """Return the client of a Dask cluster, one for each address; None where none is asked for.

    InputError where nothing answers, WorkerError where a worker has other versions.
    """
    if address is None:
        return None
    if address in _clients and _clients[address].status == "running":
        return _clients[address]
    try:
        from distributed import Client  # noqa: PLC0415  an extra, and slow to load
    except ImportError as error:
        raise InputError(
            "--cluster needs Dask; install the extra: pip install -c constraints.txt '.[machines]'"
        ) from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
        client.wait_for_workers(1, timeout=PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"there is no Dask cluster with workers at {address} ({type(error).__name__} within "
            f"{PATIENCE:.0f} s); give the address of its scheduler, for instance "
            "tcp://scheduler:8786, and start workers"
        ) from error
    try:
        found = client.run(versions, on_error="return")
    except Exception as error:  # what a worker raises does not always find its way here
        fault = f"the workers of the cluster {address} do not answer ({type(error).__name__})"
        remedy = "install the same versions of Dogshape, Drake and Dask on all of them"
        raise WorkerError(f"{fault}; {remedy}") from error
    for where, theirs in found.items():
        _require_same(address, theirs, f"the worker {where}")
    _clients[address] = client
    return client


def _require_same(address: str, found: Any, who: str) -> None:
    """Raise WorkerError unless what a worker says of its programs is what is here."""
    mine = versions()
    if not isinstance(found, dict):
        fault = f"{who} of the cluster {address} does not have Dogshape ({type(found).__name__})"
        remedy = f"install dogshape {mine['dogshape']} with drake {mine['drake']} there"
        raise WorkerError(f"{fault}; {remedy}")
    for name in engine():
        if found[name] != mine[name]:
            raise WorkerError(
                f"{who} of the cluster {address} has {name} {found[name]}, but here it is "
                f"{mine[name]}, and their shifts must not be mixed; install the same on both"
            )


SHIFTS = Path("results") / "shifts"  #: folder of unfinished commands that have none of their own


@dataclass(frozen=True)
class Where:
    """Where shifts run, and where finished ones are kept until all of the work is done.

    ``jobs`` is 0 for one worker a core, ``cluster`` the address of a Dask scheduler, ``keep`` the
    folder in which a run that was stopped leaves its finished shifts.
    """

    jobs: int = 0
    cluster: str | None = None
    keep: str | Path | None = None
    progress: Progress = SILENT

    @contextmanager
    def executor(
        self, name: str, asked: Sequence[Any], shifts: int
    ) -> Iterator[tuple[Executor, WorkCounter]]:
        """Give what simulates the shifts of one question, and the counter that it counts into.

        A folder that cannot be written, or is in use, gets a line, and nothing is kept.
        """
        connect(self.cluster)
        # The same folder for the same question.
        key = content_key({"asked": asked, **engine()})
        folder = None if self.keep is None else Path(self.keep) / f"{name}-{key[:10]}"
        with WorkCounter(self.progress, shifts) as counter, ExitStack() as held:
            try:
                held.enter_context(writing(folder) if folder else nullcontext())
            except StorageError as error:
                reason, folder = str(error).partition(";")[0], None
                counter.say(f"{reason}: should this run be stopped, its finished shifts are lost")
            if folder is None:
                yield scratch_executor(self.jobs, counter.advance, self.cluster), counter
                return
            journal, left = ShiftJournal(folder / "shifts.jsonl"), 1
            try:
                yield Executor(journal, self.jobs, counter.advance, self.cluster), counter
                journal.say_unfinished(counter.say)
                left = 0
            except BaseException as error:
                journal.read_new()
                left = len(journal.rows)
                if left and isinstance(error, KeyboardInterrupt):
                    kept = f"{left} finished shifts are kept in {folder}"
                    counter.say(f"{kept}; the same command goes on from there")
                raise
            finally:
                if not left:
                    shutil.rmtree(folder, ignore_errors=True)
                    with suppress(OSError):  # those of all commands, unless something is there
                        for path in (SHIFTS, SHIFTS.parent) if folder.parent == SHIFTS else ():
                            path.rmdir()
