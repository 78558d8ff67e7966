"""What more workers bring: shifts a second measured with one and two, and a model of more.

    python -m benchmarks.workers [--rounds N]

A round of the paper's study, four designs at ten operating points with six angles, is simulated
with one and two worker processes and with one and two Dask workers on this machine, in turns. Two
processes that have nothing to do with each other, each with a whole round, say what the machine
itself gives: two cores share its memory and its clock. The rest is the end of the round, where one
worker has no block left, and what starting and feeding workers takes.

The model takes the measured time of each block of shifts and the measured time to fit and ask a
round, and lays the blocks of a round on W workers, each taking the next block when it is free: what
is lost are the time to ask, in which no worker simulates, and the idle time at the end of a round.

What else the machine did meanwhile is measured and printed: a table of a loaded machine says so.
Takes five minutes; needs the extra ``machines``.
"""

from __future__ import annotations

import argparse
import heapq
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Barrier
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import optuna
import psutil
from distributed import LocalCluster

from benchmarks.common import DESIGNS, clutch_of, load_told, paper_study
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import DogGuide, search_space
from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.pipeline.simulate.block_cost import likely_cost
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.units import RPM

POINTS = 10  #: operating points of a design in a round, of 28
OTHERS = 0.03  #: share of the machine that other work may take where it counts as idle
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


def round_of(study: Setup) -> list[Block]:
    """Return the blocks of a round: four designs, each at operating points of its own."""
    blocks, angles = [], study.file.expectation.angles
    for place, name in enumerate(DESIGNS):
        every = even_blocks(clutch_of(study, name), study.points, angles, 1)
        chosen = np.round(np.linspace(0, len(every) - 1, POINTS)).astype(int)
        blocks += [every[(k + place) % len(every)] for k in chosen]
    return blocks


def measure(study: Setup, rounds: int) -> tuple[list[Setting], float]:
    """Return all settings, measured in turns, each warmed up first, and the machine's own limit.

    That is how many times the shifts of one process two make that are unrelated.
    """
    apart: list[float] = []
    blocks = round_of(study)
    made = [Setting("processes", 1), Setting("processes", 2)]
    with quiet_cluster(1) as one, quiet_cluster(2) as two:
        for count, cluster in ((1, one), (2, two)):
            made.append(Setting("Dask", count, cluster.scheduler_address))
        for index in range(rounds + 1):
            for setting in made:
                setting.run(blocks if index else blocks[-2:])
            if index:
                apart.append(unrelated(blocks))
        for setting in made:
            if setting.cluster is not None:
                connect(setting.cluster).close()
    for setting in made:
        del setting.walls[0], setting.blocks[0]
    return made, 2.0 * float(np.median(made[0].walls)) / float(np.median(apart))


def unrelated(blocks: Sequence[Block]) -> float:
    """Return how long two processes take that simulate all blocks each, at the same time, s."""
    context = get_context("spawn")
    barrier, told = context.Barrier(2), context.Queue()
    both = [context.Process(target=_alone, args=(blocks, barrier, told)) for _ in range(2)]
    for one in both:
        one.start()
    lasted = [told.get() for _ in both]
    for one in both:
        one.join()
    return float(np.mean(lasted))


def _alone(blocks: Sequence[Block], barrier: Barrier, told: Queue[float]) -> None:
    deque(run_block(blocks[-1]), maxlen=0)  # warm
    barrier.wait()
    start = time.perf_counter()
    for block in blocks:
        deque(run_block(block), maxlen=0)
    told.put(time.perf_counter() - start)
    barrier.wait()  # neither has the machine for itself at its end


@dataclass
class Others:
    """Share of the machine's processor time that other work took since this was made."""

    start: tuple[float, float] = field(default_factory=lambda: (_own(), _busy()))
    clock: float = field(default_factory=time.perf_counter)

    @property
    def share(self) -> float:
        """Time that others had, and that the machine was kept from us, over all of it."""
        whole = (time.perf_counter() - self.clock) * (psutil.cpu_count() or 1)
        return max(0.0, _busy() - self.start[1] - (_own() - self.start[0])) / whole


def _busy() -> float:
    """Return the processor time that anybody had, and what a host kept back, s."""
    times = psutil.cpu_times()
    return float(sum(times) - times.idle - getattr(times, "iowait", 0.0))


def _own() -> float:
    """Return the processor time of this process and all that it started, s."""
    me = psutil.Process()
    mine = me.cpu_times()
    ended = float(mine.children_user + mine.children_system)
    living = [mine, *(child.cpu_times() for child in me.children(recursive=True))]
    return ended + sum(float(one.user + one.system) for one in living)


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


def print_measured(
    study: Setup, made: Sequence[Setting], limit: float, rounds: int, others: float
) -> None:
    """Print shifts a second of each setting, their ratio to one process, and what is lost."""
    blocks = round_of(study)
    shifts = sum(len(block.angles) for block in blocks)
    told = "idle" if others <= OTHERS else "NOT idle: measure again"
    print(f"measured on this machine, {rounds} rounds of {shifts} shifts each, in turns")
    print(f"other work had {others:.1%} of its processors meanwhile: {told}")
    print(f"{'':<12}{'workers':>9}{'shifts/s':>10}{'ratio':>7}{'least':>7}{'most':>6}")
    base = float(np.median(made[0].walls))
    for setting in made:
        wall, ratios = float(np.median(setting.walls)), base / np.array(setting.walls)
        print(
            f"{setting.name:<12}{setting.workers:>9}{shifts / wall:>10.2f}{base / wall:>7.2f}"
            f"{ratios.min():>7.2f}{ratios.max():>6.2f}"
        )
    print(f"two processes that have nothing to do with each other: {limit:.2f}")
    times = np.median(made[0].blocks, axis=0).tolist()
    cost = [likely_cost(block) for block in blocks]
    orders = {
        "as they are": times,
        "likely dearest first": [times[k] for k in np.argsort(-np.array(cost), kind="stable")],
    }
    for words, ordered in orders.items():
        idle = 1.0 - sum(times) / 2.0 / makespan(ordered, 2)
        print(f"idle at the end of a round on two workers, blocks {words}: {idle:.1%}")


def print_model(study: Setup, measured: Sequence[float], asking: Sequence[float]) -> None:
    """Print what rounds of two sizes give on more workers."""
    angles = study.file.expectation.angles
    # The first design's points stand for all of the study's.
    share = len(study.points) / POINTS
    design = np.resize(np.array(measured[:POINTS]), len(study.points))
    design *= share * sum(measured[:POINTS]) / design.sum()
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
    print(load_told())
    others = Others()
    made, limit = measure(study, rounds)
    print_measured(study, made, limit, rounds, others.share)
    print_model(study, np.median(made[0].blocks, axis=0).tolist(), asking_times(study))


if __name__ == "__main__":
    main()
