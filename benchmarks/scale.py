"""Cost of search, fit and bank against their size, workers, and a study of a million shifts.

    python -m benchmarks.scale [--quick]

Costs are CPU times of this process and its workers. Each table has the slope of the cost in the
size, in logarithms: 1 is proportional. Shifts are simulated by the compiled engine, the prototype
of ``mq200`` and designs beside it at its operating points. Storage, sampler, fit and bank are
measured with synthetic results: records of real inputs with a time that is a formula, so that
nothing but what is measured takes time. So are the million shifts, which the journal's own writer
writes. ``--quick`` leaves out the largest sizes. One process but for the workers; takes ten
minutes.
"""

from __future__ import annotations

import argparse
import math
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import psutil

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.building import build_models
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions
from dogshape.pipeline.search.sampler import Space
from dogshape.pipeline.search.search import _store, next_round, open_search, run
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.evaluation import OperatedDesign, evaluate
from dogshape.pipeline.simulate.executor import Executor, end_workers, scratch_executor
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder, append
from dogshape.pipeline.train.training import first_designs
from dogshape.pipeline.train.training_rows import with_rows
from dogshape.sim.effects import load
from dogshape.sim.statistics.blocks import Block, run_block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import DEG
from dogshape.surrogate.model import fit
from dogshape.surrogate.process import Effort

MILLION = 1_000_000
LARGEST_STUDY = "search.trials=10000"  #: as many designs as a study may have
BLOCK_SHIFTS = 64  #: synthetic shifts that are written at once, as the angles of a block
Params = dict[str, float]


def cpu() -> float:
    """Return the CPU time of this process and its workers, s."""
    process = psutil.Process()
    processes = [
        process.cpu_times(),
        *(child.cpu_times() for child in process.children(recursive=True)),
    ]
    ended_cpu = process.cpu_times().children_user + process.cpu_times().children_system
    return float(ended_cpu + sum(times.user + times.system for times in processes))


def study_of(*settings: str) -> Setup:
    """Return the default study in the compiled engine."""
    return load_study("mq200", settings).search_setup


def print_table(title: str, sizes: Sequence[int], cost: Callable[[int], float], unit: str) -> None:
    """Print the cost of each size in s, and the slope between the least and the largest."""
    costs = [cost(size) for size in sizes]
    slope = math.log(costs[-1] / costs[0]) / math.log(sizes[-1] / sizes[0])
    print(f"\n{title}; slope {slope:.2f}")
    print(f"{unit:>10s}" + "".join(f"{size:>10d}" for size in sizes))
    print("    CPU, s" + "".join(f"{value:>10.3f}" for value in costs), flush=True)


def with_points(study: Setup, count: int) -> Setup:
    """Thin or repeat the operating points of a study to ``count``."""
    points = study.points
    return replace(
        study, points=tuple(points[k * len(points) // count % len(points)] for k in range(count))
    )


def measure_simulation(study: Setup, designs: Sequence[Params], angles: int) -> float:
    """Measure the simulation of designs, s."""
    start = cpu()
    evaluate(study, designs, scratch_executor(1), angles, 1)
    return cpu() - start


@dataclass
class Synthetic(Executor):
    """Executor of real inputs with times by a formula of design and angle."""

    result: Record = field(default_factory=dict)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of blocks."""
        return [self._rows(block) for block in blocks]

    def _rows(self, block: Block) -> list[Record]:
        dog = block.clutch.dog
        speed = abs(block.point.mismatch)
        lean = (dog.chamfer - 10.0 * DEG) ** 2 + (dog.traction - 12.0 * DEG) ** 2
        time = 0.03 + 8.0 * dog.height + lean + 0.2 / (3.0 + speed) + 1e-3 * dog.count
        turns = np.array(block.angles) / dog.pitch_angle % 1.0
        return [
            {**self.result, **inputs, "shift_time_s": time * (0.8 + 0.4 * turn)}
            for inputs, turn in zip(block.inputs, turns.tolist(), strict=True)
        ]


def synthetic_executor(study: Setup) -> Synthetic:
    """Build an executor of synthetic times, with the other figures of a real shift."""
    block = OperatedDesign.of(study, study.prototype).blocks(1, 1)[10]
    return Synthetic(scratch_executor(1).journal, 0, result=next(run_block(block)))


def measure_search(trials: int) -> float:
    """Measure a search without the simulation of its designs, s."""
    study = study_of(f"search.trials={trials}", "expectation.angles=4")
    stand_in = synthetic_executor(study)
    with TemporaryDirectory() as place:
        start = cpu()
        search = open_search(study, StudyFolder(Path(place)), None, False)
        run(search, stand_in, lambda *_: None)
        return cpu() - start


def measure_fit(designs: int) -> float:
    """Measure the fit of a surrogate to a number of designs, s."""
    study = study_of("expectation.angles=4")
    evaluations = evaluate(study, first_designs(study, designs), synthetic_executor(study), 4, 1)
    data = with_rows(study, np.concatenate([evaluation.rows for evaluation in evaluations]))
    start = cpu()
    fit(data, Effort(seed=1))
    return cpu() - start


def measure_bank(points: int) -> float:
    """Measure the bank of a bench with a number of operating points, without shifts, s."""
    bench = load_bench("mq200_adams")
    options = BankOptions()
    cells = tuple(bench.cells[k % len(bench.cells)] for k in range(points))
    bench = replace(bench, clutch=bench.clutch.with_engine("planar"), cells=cells)
    stand_in = synthetic_executor(study_of())
    start = cpu()
    build_models(bench, load(None), options.settings, stand_in.run)
    return cpu() - start


@contextmanager
def dask_workers(count: int) -> Iterator[str]:
    """Start a Dask cluster of ``count`` workers on this machine; yield its address."""
    from distributed import LocalCluster  # noqa: PLC0415  an extra

    with LocalCluster(count, threads_per_worker=1, dashboard_address=None) as cluster:  # type: ignore[no-untyped-call]
        yield cluster.scheduler_address


def print_workers(count: int, angles: int) -> None:
    """Print the cost of a shift and the rate by 1 and 2 workers, and by Dask with 1 and 2.

    The rate by CPU is what idle cores would give: a core for each worker, or two where there are
    processes beside them.
    """
    study = study_of()
    designs = first_designs(study, count)
    place = f"{len(study.points)} operating points, {angles} angles"
    print(f"\nworkers, {count} designs at {place}")
    print("workers    shifts   CPU of a shift, ms   shifts/s   shifts/s by CPU", flush=True)
    for cluster, jobs in ((False, 1), (False, 2), (True, 1), (True, 2)):
        with dask_workers(jobs) if cluster else nullcontext() as address:
            executor = scratch_executor(jobs, cluster=address)
            evaluate(study, designs, executor, 2, 1)  # workers have loaded their code
            start = cpu()
            clock = time.monotonic()
            evaluations = evaluate(study, designs, executor, angles, 2)
            clock = time.monotonic() - clock
            used_cpu = cpu() - start
            end_workers()
        shifts = sum(evaluation.shifts for evaluation in evaluations)
        cores = 2 if cluster or jobs > 1 else 1
        label = "Dask " if cluster else ""
        print(
            f"{label:>5s}{jobs:2d} {shifts:11d} {1e3 * used_cpu / shifts:20.3f} "
            f"{shifts / clock:10.0f} {cores * shifts / used_cpu:17.0f}",
            flush=True,
        )


def write_journal(path: Path, shifts: int) -> None:
    """Write a journal of synthetic shifts, and print size and cost."""
    study = study_of()
    start_cpu = cpu()
    block = OperatedDesign.of(study, study.prototype).blocks(1, 1)[0]
    (record,) = synthetic_executor(study).run([block])[0]
    for start in range(0, shifts, BLOCK_SHIFTS):
        keys = range(start, min(start + BLOCK_SHIFTS, shifts))
        append(path, *({**record, "key": f"{key:020x}"} for key in keys))
    print(
        f"journal: {path.stat().st_size / 1e9:.2f} GB, written in {cpu() - start_cpu:.0f} s of CPU"
    )


def write_search(folder: StudyFolder, study: Setup, designs: int) -> None:
    """Write a search of ``designs`` finished synthetic designs, and print its size."""
    search = open_search(study, folder, None, False)
    stand_in = synthetic_executor(study)
    params_list = [study.prototype, *first_designs(study, designs - 1)]
    for params, evaluation in zip(
        params_list, evaluate(study, params_list, stand_in, 4, 1), strict=True
    ):
        template = Space(study.variables).trial(params)
        optuna_study = search.optuna_study
        trial = optuna_study._storage.get_trial(
            optuna_study._storage.create_new_trial(optuna_study._study_id, template)
        )
        _store(search, trial, design_of(study, params), evaluation)
    print(f"search: {designs} designs, {folder.trials.stat().st_size / 1e6:.0f} MB of trials")


def print_peak(label: str, start: float, clock: float) -> None:
    """Print CPU, time on the clock and largest memory of this process."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{label:<44s} {cpu() - start:8.2f} {time.monotonic() - clock:8.2f} {peak:8.2f}")


def print_resumption(kind: str, root: Path) -> None:
    """Print the cost to resume a ``nothing``, a ``journal`` or a ``search`` in this process."""
    study = study_of(LARGEST_STUDY)
    folder = StudyFolder(root)
    start = cpu()
    clock = time.monotonic()
    if kind == "nothing":
        print_peak("before", start, clock)
    elif kind == "journal":
        journal = ShiftJournal(folder.running)
        print_peak(f"journal of {len(journal.rows)} shifts, opened", start, clock)
        keys = list(journal.rows)[: 4 * 64 * len(study.points)]
        start = cpu()
        clock = time.monotonic()
        times = [journal.rows[key]["shift_time_s"] for key in keys]
        print_peak(f"{len(times)} of them read", start, clock)
        start = cpu()
        clock = time.monotonic()
        journal.drop(set(keys))
        print_peak("the same removed", start, clock)
    else:
        search = open_search(study, folder, None, True)
        state = search.read()
        front = state.front
        print_peak(f"search of {len(state.trials)} designs, front of {len(front)}", start, clock)
        start = cpu()
        clock = time.monotonic()
        print_peak(f"{len(next_round(search))} designs proposed", start, clock)


def print_million(shifts: int) -> None:
    """Print disk space, memory and cost to resume of a study of ``shifts`` shifts."""
    study = study_of(LARGEST_STUDY)
    with TemporaryDirectory() as place:
        folder = StudyFolder(Path(place))
        print(f"\n{shifts} synthetic shifts")
        write_journal(folder.running, shifts)
        write_search(folder, study, shifts // (len(study.points) * study.file.expectation.angles))
        print(
            "                                               CPU, s     s     peak, GB", flush=True
        )
        for kind in ("nothing", "journal", "search"):
            call = [sys.executable, "-m", "benchmarks.scale", "--resumed", kind, place]
            print(subprocess.run(call, check=True, capture_output=True, text=True).stdout, end="")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--resumed", nargs=2, metavar=("WHAT", "FOLDER"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.resumed:
        print_resumption(arguments.resumed[0], Path(arguments.resumed[1]))
        return
    size_count = 3 if arguments.quick else 4
    study = study_of()
    designs = first_designs(study, 16)
    measure_simulation(study, designs[:2], 2)  # compiled before it is timed
    for title, sizes, cost, unit in (
        (
            "simulation of 4 designs, 8 angles",
            (7, 14, 28, 56),
            lambda n: measure_simulation(with_points(study, n), designs[:4], 8),
            "points",
        ),
        (
            "simulation at 28 points, 8 angles",
            (2, 4, 8, 16),
            lambda n: measure_simulation(study, designs[:n], 8),
            "designs",
        ),
        (
            "simulation of 4 designs at 28 points",
            (4, 8, 16, 32),
            lambda n: measure_simulation(study, designs[:4], n),
            "angles",
        ),
        ("search without simulation", (32, 64, 128, 256), measure_search, "designs"),
        ("fit of the surrogate", (50, 100, 200, 400), measure_fit, "designs"),
        ("bank without simulation", (7, 14, 28, 56), measure_bank, "points"),
    ):
        print_table(title, sizes[:size_count], cost, unit)
    print_workers(4 if arguments.quick else 8, 16)
    print_million(MILLION // (10 if arguments.quick else 1))


if __name__ == "__main__":
    main()
