"""What more workers bring: shifts a second measured with one and two, and a model of more.

    python -m benchmarks.workers [--rounds N]

Shifts of the prototype at half of the paper's study's operating points are simulated with one
and two worker processes and with one and two Dask workers on this machine, in turns. The model
takes the measured time of each block of shifts and the measured time to fit and ask a round, and
lays the blocks of a round on W workers, each taking the next block when it is free: what is lost
are the time to ask, in which no worker simulates, and the idle time at the end of a round. Takes
two minutes; needs the extra ``machines``.
"""

from __future__ import annotations

import argparse
import heapq
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import optuna
from distributed import LocalCluster

from benchmarks.common import paper_study
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import DogGuide, search_space
from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.units import RPM

ANGLES = 3  #: of a measured block; those of the study have twice as many
WORKERS = (1, 2, 4, 8, 16, 32, 64)
BATCHES = (4, 16)


@dataclass
class Setting:
    """A way to simulate, with what was measured of it, in s."""

    name: str
    workers: int
    cluster: str | None = None
    walls: list[float] = field(default_factory=list)
    blocks: list[list[float]] = field(default_factory=list)

    def run(self, blocks: Sequence[Block]) -> None:
        """Simulate blocks into an empty journal and keep how long that took."""
        ends: list[float] = []
        with TemporaryDirectory() as folder:
            journal = ShiftJournal(Path(folder) / "shifts.jsonl")
            executor = Executor(
                journal, self.workers, lambda _: ends.append(time.perf_counter()), self.cluster
            )
            start = time.perf_counter()
            executor.run(blocks)
        self.walls.append(time.perf_counter() - start)
        self.blocks.append(np.diff([start, *ends]).tolist())


def measure(study: Setup, rounds: int) -> list[Setting]:
    """Return all settings, measured in turns; each is warmed up first."""
    blocks = even_blocks(study.clutch, study.points, ANGLES, 1)[::2]
    made = [Setting("processes", 1), Setting("processes", 2)]
    with quiet_cluster(1) as one, quiet_cluster(2) as two:
        for count, cluster in ((1, one), (2, two)):
            made.append(Setting("Dask", count, cluster.scheduler_address))
        for index in range(rounds + 1):
            for setting in made:
                setting.run(blocks if index else blocks[-2:])
        for setting in made:
            if setting.cluster is not None:
                connect(setting.cluster).close()
    for setting in made:
        del setting.walls[0], setting.blocks[0]
    return made


def quiet_cluster(workers: int) -> LocalCluster:
    """Return a cluster of processes with a thread each on this machine."""
    return LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0")  # type: ignore[no-untyped-call]


def asking_times(study: Setup) -> list[float]:
    """Return the time in s of each proposal of the paper's study's last round.

    The first one fits the process too.
    """
    settings = study.file.search
    sampler = SurrogateSampler(DogGuide(study), settings.seed, settings.startup)
    search = optuna.create_study(directions=["minimize"] * 2, sampler=sampler)
    rng = np.random.default_rng(1)
    for _ in range(settings.trials - settings.batch):
        trial = search.ask(search_space(study))
        mean = 0.08 + 0.01 * rng.random()
        trial.set_user_attr("standard_error_s", 1e-3)
        trial.set_user_attr("rows", _rows(study, list(trial.params.values()), mean))
        search.tell(trial, [mean, rng.random()])
    ends = [time.perf_counter()]
    for _ in range(settings.batch):
        search.ask(search_space(study))
        ends.append(time.perf_counter())
    return np.diff(ends).tolist()


def _rows(study: Setup, design: list[float], mean: float) -> list[list[float]]:
    at = [(point.mismatch / RPM, point.profile.force) for point in study.points]
    return [[*design, *where, mean, 3e-3, 0.01, 6, 6, 1] for where in at]


def makespan(blocks: Sequence[float], workers: int) -> float:
    """Return when the last of blocks ends if each free worker takes the next, s."""
    free = [0.0] * workers
    for block in blocks:
        heapq.heapreplace(free, free[0] + block)
    return max(free)


def print_measured(made: Sequence[Setting], rounds: int) -> None:
    """Print shifts a second of each setting, and their ratio to one process."""
    shifts = ANGLES * len(made[0].blocks[0])
    print(f"measured on this machine, {rounds} rounds of {shifts} shifts each, in turns")
    print(f"{'':<12}{'workers':>9}{'shifts/s':>10}{'ratio':>7}")
    base = float(np.median(made[0].walls))
    for setting in made:
        wall = float(np.median(setting.walls))
        print(f"{setting.name:<12}{setting.workers:>9}{shifts / wall:>10.2f}{base / wall:>7.2f}")


def print_model(study: Setup, measured: Sequence[float], asking: Sequence[float]) -> None:
    """Print what rounds of two sizes give on more workers."""
    angles = study.file.expectation.angles
    # The points between the measured ones take as long.
    design = np.repeat(np.array(measured) * angles / ANGLES, 2)
    fit, ask = asking[0] - float(np.mean(asking[1:])), float(np.mean(asking[1:]))
    print(f"\nmodel of a round: {fit:.1f} s to fit, {ask:.1f} s to ask each design, then for each")
    print(f"a block of {angles} shifts at {len(design)} points, {design.sum():.0f} s in all")
    print(f"{'batch':>5}{'workers':>9}{'shifts/s':>10}{'of ideal':>10}{'asking':>8}{'idle':>7}")
    for batch in BATCHES:
        blocks = np.tile(design, batch)
        for workers in WORKERS:
            span, work = makespan(blocks.tolist(), workers), float(blocks.sum()) / workers
            whole = fit + batch * ask + span
            rate = (
                f"{batch:>5}{workers:>9}{angles * len(blocks) / whole:>10.1f}{work / whole:>10.0%}"
            )
            print(f"{rate}{1.0 - span / whole:>8.0%}{(span - work) / whole:>7.0%}")
    batch = study.file.search.batch
    most = angles * len(design) * batch / (fit + batch * ask)
    print("\nmachines that share a database ask one after the other:")
    print(f"{most:.0f} shifts/s at most with rounds of {batch}")


def main() -> None:
    """Print what was measured and what follows for more workers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    rounds = parser.parse_args().rounds
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = paper_study()
    made = measure(study, rounds)
    print_measured(made, rounds)
    print_model(study, np.median(made[0].blocks, axis=0).tolist(), asking_times(study))


if __name__ == "__main__":
    main()
