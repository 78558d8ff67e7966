"""Foreseen against true time left, at each tenth of a run.

    python -m benchmarks.forecasts [NAME ...]

A study of small size with Drake, one with screens by the compiled engine, of which most designs
fail, one of the compiled engine alone, the simulations of a surrogate, those of a bank for a clutch
that nobody has met (for two effects), and an expected shift time at given angles. What is foreseen
is what the command line would show when so much of the time is over. One worker runs in this
process and time is its processor time, so that other work on the machine does not count.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.expectation import simulate_mean
from dogshape.pipeline import forecast
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.diagnose.bank_diagnosis import Means, models_of
from dogshape.pipeline.progress import Count, Progress
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from dogshape.pipeline.train.training import fill
from dogshape.running import Where
from dogshape.sim.effects import load as effects_of

TENTHS = tuple(range(1, 10))
SMALL = (
    "operating.mismatch_rpm=[25, 149]", "operating.force_N=[235.2, 469]", "search.trials=14",
    "search.startup=10", "search.points=3", "search.confirm_designs=2", "shift.timeout_s=1.1",
)  # fmt: skip
SCREENED = (
    "operating.mismatch_rpm=[25, 149]", "operating.force_N=[235.2, 469]", "search.trials=16",
    "search.points=3", "search.confirm_designs=2", "search.screen_angles=32",
)  # fmt: skip
COMPILED = (
    "solver.engine=planar", "search.trials=24", "search.startup=12", "search.points=6",
    "expectation.angles=48", "search.confirm_angles=96", "search.confirm_designs=2",
    "shift.timeout_s=1.1",
)  # fmt: skip
UNKNOWN = ("force_scale", "detent_force")  #: effects of the bank
FITTED = (
    "surrogate.designs=24", "surrogate.references=3", "surrogate.mix_shifts=8960",
    "shift.timeout_s=1.1",
)  # fmt: skip


@dataclass
class Told:
    """A progress that keeps what it is told, and when."""

    start: float = field(default_factory=time.process_time)
    seen: list[tuple[float, float]] = field(default_factory=list)
    end: float = 0.0

    def update(self, count: Count) -> None:
        """Keep the time that is foreseen, as a line on the console would show it."""
        now = time.process_time() - self.start
        new = count.done - count.known
        left = count.left_s
        if left is None and new:
            left = now / new * max(0, count.total - count.done)
        if left is not None:
            self.seen.append((now, left))
        self.end = now

    def say(self, line: str) -> None:
        """Ignore a sentence."""

    def at(self, share: float) -> tuple[float, float]:
        """Return time foreseen and true time left, s, when a share of the run is over."""
        now = share * self.end
        before = [left for then, left in self.seen if then <= now] or [self.seen[0][1]]
        return before[-1], self.end - now


def measured(work: Callable[[Progress], object]) -> Told:
    """Run some work and keep what it foresaw."""
    told = Told()
    work(told)
    return told


def _study(name: str, values: tuple[str, ...], folder: Path) -> Callable[[Progress], object]:
    study = load_study(name, values)
    return lambda progress: run_study(
        study, Run(StudyFolder(folder), 1, report=False, progress=progress)
    )


def _bank(folder: Path) -> Callable[[Progress], object]:
    bench = load_bench("mq200_stand")
    clutch = replace(bench.clutch, timeout=1.1).with_engine("planar")
    every = effects_of(None)
    few = {name: every[name] for name in UNKNOWN}
    return lambda progress: models_of(
        replace(bench, clutch=clutch), few, Means(folder, jobs=1, progress=progress)
    )


def _mean(**asked: float) -> Callable[[Progress], object]:
    study = load_study("mq200_paper")
    return lambda progress: simulate_mean(study, Where(1, progress=progress), **asked)


def main(names: Sequence[str]) -> None:
    """Print the table of some runs; of all without names."""
    forecast.CLOCK = time.process_time
    with tempfile.TemporaryDirectory(prefix="dogshape-") as made:
        root = Path(made)
        fitted = load_study("mq200_paper", FITTED)
        runs = {
            "drake": _study("mq200_paper", SMALL, root / "small"),
            "screened": _study("mq200", SCREENED, root / "screened"),
            "compiled": _study("mq200_paper", COMPILED, root / "compiled"),
            "gap": _bank(root / "bank"),
            "expect": _mean(angles=12),
            "fit": lambda progress: fill(
                fitted, StudyFolder(root / "fit"), 1, None, progress, levels=2
            ),
        }
        print("processor time left, foreseen : true, and their ratio; one worker")
        for name, work in runs.items():
            if names and name not in names:
                continue
            told = measured(work)
            print(f"{name}: {told.end:.0f} s to the end of the simulations")
            ratios = []
            for tenth in TENTHS:
                foreseen, true = told.at(tenth / 10.0)
                ratios.append(foreseen / true)
                print(f"  {10 * tenth:3d} %  {foreseen:6.0f} : {true:4.0f} s  {ratios[-1]:5.2f}")
            farthest = max(max(r, 1.0 / r if r > 0.0 else math.inf) for r in ratios)
            print(f"  farthest from 1: {farthest:.2f}")


if __name__ == "__main__":
    main(sys.argv[1:])
