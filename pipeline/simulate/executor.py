"""Execution of blocks of shifts on all cores or a cluster, without finished shifts.

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
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor, process_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError

from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.store.folder import ShiftJournal, append
from dogshape.pipeline.store.folder_lock import lock_folder
from dogshape.sim.errors import InputError, StorageError, WorkerError
from dogshape.sim.interface import argument
from dogshape.sim.statistics.blocks import Block, run_block
from dogshape.sim.statistics.shift_records import Record, content_key, key_of
from dogshape.sim.versions import engine_versions, program_versions, versions

Advance = Callable[
    [int, int], None
]  #: takes numbers of shifts: finished, and of them by earlier runs
NO_PROGRESS: Advance = WorkCounter(SILENT, 0).advance

CLUSTER_TIMEOUT_S = 10.0  #: time to wait for a cluster and for its first worker, s
CLUSTER_BATCH = 100  #: blocks that a cluster is sent at once
PARENT_CHECK_S = 1.0  #: time between checks that the parent is alive, s
MAX_GROWTH_BYTES = int(1.5e9)  #: memory by which a worker may grow, bytes
MAX_THREAD_SHIFTS = 3000  #: compiled shifts up to which threads beat processes, which start slowly
MAX_DEATHS = 3  #: deaths of workers in succession without a finished shift
DASK_PACKAGES = ("distributed", "concurrent")  #: packages whose errors mean a lost cluster

# The pool replaces a worker that has grown by plants and compiled code, and loses nothing by it.
warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)

_plant_lock = threading.Lock()  #: a process has one plant, and a cluster's worker has threads


def workers_of(jobs: int) -> int:
    """Return the number of worker processes; 0 means one for each core."""
    return jobs or os.cpu_count() or 1


@dataclass
class Executor:
    """Runs blocks in worker processes and keeps their shifts in a journal.

    ``jobs`` 0 means one worker for each core; one forks nothing. ``cluster`` is the address of a
    Dask scheduler, whose workers take the place of the cores.
    """

    journal: ShiftJournal
    jobs: int
    progress: Advance = NO_PROGRESS
    cluster: str | None = None
    _counted: set[str] = field(default_factory=set, init=False, repr=False)
    _started: int = field(default=0, init=False, repr=False)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of every block, in the order of its angles; simulate missing ones.

        WorkerError where workers die again and again or the cluster is lost, StorageError where
        the journal cannot be written.
        """
        self._count_finished(blocks)
        missing_blocks = self._missing_blocks(blocks)
        self._started += sum(len(block.angles) for block in missing_blocks)
        for rows in self._simulate(missing_blocks):
            self.journal.rows.update((key_of(row), row) for row in rows)
            self.progress(len(rows), 0)
        if missing_blocks:  # once: the disk takes longer for a block than its shifts
            self.journal.sync()
        return [[self.journal.rows[key] for key in block.keys] for block in blocks]

    def _count_finished(self, blocks: Sequence[Block]) -> None:
        """Report the finished shifts of blocks to the progress, each shift in one run only."""
        keys = {key for block in blocks for key in block.keys}
        finished_keys = [key for key in keys - self._counted if key in self.journal.rows]
        self._counted |= keys
        if finished_keys:
            self.progress(len(finished_keys), len(finished_keys))

    def _simulate(self, blocks: list[Block]) -> Iterator[list[Record]]:
        """Yield the records of finished blocks, from cluster, cores or this process."""
        jobs = min(workers_of(self.jobs), len(blocks))
        if blocks and self.cluster is not None:
            yield from self._on_cluster(blocks, self.cluster)
        elif jobs > 1:
            yield from self._on_cores(blocks, jobs)
        else:
            for block in blocks:
                yield _simulate_block(block, self.journal.path)

    def drop_shifts(self, kept_keys: Collection[str] = ()) -> None:
        """Drop the shifts of the journal except some keys; their results are stored elsewhere."""
        self.journal.drop(self.journal.rows.keys() - set(kept_keys))
        self._counted &= set(kept_keys)

    def _missing_blocks(self, blocks: Sequence[Block]) -> list[Block]:
        """Reduce blocks to the shifts that the journal lacks, without repeated shifts."""
        missing_blocks = []
        covered_keys = set(self.journal.rows)
        for block in blocks:
            indices_by_key = {key: index for index, key in enumerate(block.keys)}
            indices = [index for key, index in indices_by_key.items() if key not in covered_keys]
            covered_keys.update(indices_by_key)
            if not indices:
                continue
            is_untouched = len(indices) == len(block.keys)  # such a block keeps its computed keys
            missing_blocks.append(block if is_untouched else block.only(indices))
        return missing_blocks

    def _on_cores(self, blocks: list[Block], jobs: int) -> Iterator[list[Record]]:
        """Yield the records of finished blocks; repeat the blocks of a worker that died."""
        remaining_tries = MAX_DEATHS
        while blocks:
            finished_count = len(self.journal.rows)
            backend = "loky"
            options = {"inner_max_num_threads": 1}
            simulate = _simulate_in_worker
            if self._suits_threads(blocks):
                backend = "threading"
                options = {}
                simulate = _simulate_block
            try:
                with parallel_config(backend, **options):
                    pool = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
                yield from pool(delayed(simulate)(block, self.journal.path) for block in blocks)
            except TerminatedWorkerError as error:
                yield self.journal.read_new()
                if len(self.journal.rows) == finished_count:
                    remaining_tries -= 1
                else:
                    remaining_tries = MAX_DEATHS
                if not remaining_tries:
                    raise WorkerError(
                        f"worker processes died {MAX_DEATHS} times without finishing a shift, as "
                        "they do when memory runs out; finished shifts are kept, so run the "
                        f"command again with fewer {argument('jobs')}"
                    ) from error
            blocks = self._missing_blocks(blocks)

    def _suits_threads(self, blocks: Sequence[Block]) -> bool:
        """Decide whether threads are faster: for few shifts of the compiled engine."""
        is_compiled = all(block.clutch.solver.engine == "planar" for block in blocks)
        return self._started < MAX_THREAD_SHIFTS and is_compiled

    def _on_cluster(self, blocks: list[Block], address: str) -> Iterator[list[Record]]:
        """Yield the records of blocks as a cluster returns them, after they are written."""
        from distributed import as_completed  # noqa: PLC0415  an extra, and slow to load

        client = connect(address)
        try:
            futures = client.map(_simulate_remotely, blocks, pure=False, batch_size=CLUSTER_BATCH)
            try:
                for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]
                    rows = future.result()
                    _require_same_versions(address, rows[0], engine_versions(), "a worker")
                    append(self.journal.path, *rows)
                    yield rows
            finally:
                client.cancel(futures)
        except Exception as error:
            package = type(error).__module__.partition(".")[0]
            if package not in DASK_PACKAGES and not isinstance(error, TimeoutError):
                raise
            fault = f"the cluster {address} was lost ({type(error).__name__})"
            remedy = "shifts that came back are kept, so mend it and run the command again"
            raise WorkerError(f"{fault}; {remedy}") from error


def _simulate_block(block: Block, path: Path) -> list[Record]:
    """Simulate a block, and append each finished shift to the journal at once."""
    rows = []
    for row in run_block(block):
        append(path, row)
        rows.append(row)
    return rows


def _simulate_in_worker(block: Block, path: Path) -> list[Record]:
    """Simulate a block in a worker process, which ignores Ctrl-C and ends with its parent."""
    _end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A worker that grows by more is taken to leak and ends; both engines take 0.4 GB of code.
    process_executor._MAX_MEMORY_LEAK_SIZE = MAX_GROWTH_BYTES
    return _simulate_block(block, path)


@cache
def _end_with_parent() -> None:
    """End this process soon after its parent: a process whose parent was killed has another one."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_S)
        os._exit(1)

    threading.Thread(target=watch, name="parent", daemon=True).start()


def end_workers() -> None:
    """End this process's workers; their processor time counts as its own after that."""
    get_reusable_executor().shutdown()


def _simulate_remotely(block: Block) -> list[Record]:
    """Simulate a block on another machine, whose process may have several threads."""
    with _plant_lock:
        return list(run_block(block))


def scratch_executor(
    jobs: int = 0, progress: Advance = NO_PROGRESS, cluster: str | None = None
) -> Executor:
    """Make an executor whose journal is a temporary file, removed when the program ends."""
    folder = tempfile.mkdtemp(prefix="dogshape-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Executor(ShiftJournal(Path(folder) / "shifts.jsonl"), jobs, progress, cluster)


_clients: dict[str, Any] = {}  #: of Dask clusters, by address


def connect(address: str | None) -> Any:
    """Return the client of a Dask cluster, one for each address; None without address.

    InputError where nothing answers, WorkerError where a worker has other versions.
    """
    if address is None:
        return None
    if address in _clients and _clients[address].status == "running":
        return _clients[address]
    client = _connect_client(address)
    try:
        worker_versions = client.run(versions, on_error="return")
    except Exception as error:  # what a worker raises does not always find its way here
        fault = f"the workers of the cluster {address} do not answer ({type(error).__name__})"
        remedy = "install the same versions of Dogshape, Drake and Dask on all of them"
        raise WorkerError(f"{fault}; {remedy}") from error
    for worker, programs in worker_versions.items():
        _require_same_versions(address, programs, program_versions(), f"the worker {worker}")
    _clients[address] = client
    return client


def _connect_client(address: str) -> Any:
    """Connect to a Dask cluster that has workers; InputError."""
    try:
        from distributed import Client  # noqa: PLC0415  an extra, and slow to load
    except ImportError as error:
        raise InputError(
            f"{argument('cluster')} needs Dask; install the extra: "
            "pip install -c constraints.txt '.[machines]'"
        ) from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CLUSTER_TIMEOUT_S, set_as_default=False)  # type: ignore[no-untyped-call]
        client.wait_for_workers(1, timeout=CLUSTER_TIMEOUT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"there is no Dask cluster with workers at {address} ({type(error).__name__} within "
            f"{CLUSTER_TIMEOUT_S:.0f} s); give the address of its scheduler, for instance "
            "tcp://scheduler:8786, and start workers"
        ) from error
    return client


def _require_same_versions(
    address: str, programs: Any, local_programs: Mapping[str, str], worker: str
) -> None:
    """Raise WorkerError if a worker has other versions than this process.

    ``programs`` are its versions by name, or an exception of a worker without Dogshape.
    """
    if not isinstance(programs, dict):
        fault = (
            f"{worker} of the cluster {address} does not have Dogshape ({type(programs).__name__})"
        )
        needed = " with ".join(f"{name} {version}" for name, version in local_programs.items())
        raise WorkerError(f"{fault}; install {needed} there")
    for name, version in local_programs.items():
        if programs[name] != version:
            raise WorkerError(
                f"{worker} of the cluster {address} has {name} {programs[name]}, but here it is "
                f"{version}, and their shifts must not be mixed; install the same on both"
            )


SHIFTS = Path("results") / "shifts"  #: default folder for the shifts of stopped commands


@dataclass(frozen=True)
class RunOptions:
    """Workers of a run, and the folder of its finished shifts until all of it is done."""

    jobs: int = 0  #: worker processes, 0 for one a core
    cluster: str | None = None  #: address of a Dask scheduler
    journal: str | Path | None = None  #: folder for the finished shifts of a run that is stopped
    progress: Progress = SILENT

    @contextmanager
    def executor(
        self, name: str, inputs: Sequence[Any], shifts: int
    ) -> Iterator[tuple[Executor, WorkCounter]]:
        """Yield an executor and its work counter.

        The shifts of a run that is stopped stay in the folder of ``journal`` that belongs to
        ``name`` and ``inputs``; the same run goes on from there. A folder that cannot be written,
        or is in use, gives a message, and nothing stays.

        Parameters
        ----------
        name
            Beginning of the folder's name.
        inputs
            All inputs of the run, fit for JSON.
        shifts
            Number of shifts to expect.

        """
        connect(self.cluster)
        key = content_key({"asked": inputs, **engine_versions()})
        folder = None if self.journal is None else Path(self.journal) / f"{name}-{key[:10]}"
        with WorkCounter(self.progress, shifts) as counter, ExitStack() as locks:
            if folder is not None:
                try:
                    locks.enter_context(lock_folder(folder))
                except StorageError as error:
                    reason = str(error).partition(";")[0]
                    folder = None
                    counter.say(
                        f"{reason}: should this run be stopped, its finished shifts are lost"
                    )
            if folder is None:
                yield scratch_executor(self.jobs, counter.advance, self.cluster), counter
                return
            journal = ShiftJournal(folder / "shifts.jsonl")
            executor = Executor(journal, self.jobs, counter.advance, self.cluster)
            with _remove_if_finished(folder, journal, counter):
                yield executor, counter


@contextmanager
def _remove_if_finished(
    folder: Path, journal: ShiftJournal, counter: WorkCounter
) -> Iterator[None]:
    """Remove the folder of a run that ends without an error, or without a finished shift."""
    remaining_shifts = 1
    try:
        yield
        journal.say_unfinished(counter.say)
        remaining_shifts = 0
    except BaseException as error:
        journal.read_new()
        remaining_shifts = len(journal.rows)
        if remaining_shifts and isinstance(error, KeyboardInterrupt):
            message = f"{remaining_shifts} finished shifts are kept in {folder}"
            counter.say(f"{message}; the same command goes on from there")
        raise
    finally:
        if not remaining_shifts:
            shutil.rmtree(folder, ignore_errors=True)
            if folder.parent == SHIFTS:
                with suppress(OSError):  # other commands may have folders there
                    SHIFTS.rmdir()
                    SHIFTS.parent.rmdir()
