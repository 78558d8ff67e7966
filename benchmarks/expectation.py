"""CPU time for one percent of standard error of the expected shift time.

    python -m benchmarks.expectation

The prototype at all operating points of the default study. Random angles: what the
variance over 96 even angles at each point asks for, times what a shift costs. Even angles: how
many give one percent, with the scatter of the mean over 400 random starts on the same 96 times;
and what the program itself reports, run to one percent. MuJoCo: as many random angles at its cost
a shift, measured interleaved with Drake's. One process; takes about fifteen minutes; needs the
extra ``blind``.
"""

from __future__ import annotations

import time

import numpy as np

from benchmarks.common import angles_of, default_study
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.config.study_file import Study
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.simulate.precision import FIRST, expect_to
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.validation.second_engine import SecondEngine

DENSE, STARTS, GOAL = 96, 400, 0.01


def main() -> None:
    """Print the comparison."""
    study = default_study()
    clutch, points = study.clutch, study.points
    plant, engine = ClutchPlant(clutch), SecondEngine(clutch)
    grid = (np.arange(DENSE) + 0.5) / DENSE * clutch.dog.pitch_angle
    times, cpu, other = np.empty((len(points), DENSE)), np.zeros(len(points)), 0.0
    for index, point in enumerate(points):
        start = time.process_time()
        times[index] = [engage(plant, point, float(a)).shift_time for a in grid]
        cpu[index] = (time.process_time() - start) / DENSE
        start = time.process_time()
        for angle in angles_of(clutch, 3, index):
            engine.shift(point, float(angle))
        other += (time.process_time() - start) / 3
    mean = times.mean()
    random = times.var(axis=1).mean() / (GOAL * mean) ** 2
    print(f"expected shift time {mean * 1e3:.2f} ms, {len(points)} operating points")
    drake = random * cpu.mean()
    second = random * other / len(points)
    print(f"random angles: {random:.0f} shifts for 1 %")
    print(f"  Drake  {cpu.mean() * 1e3:6.1f} ms a shift, {drake:7.1f} s CPU")
    print(f"  MuJoCo {other / len(points) * 1e3:6.1f} ms a shift, {second:7.1f} s CPU")
    print("even angles")
    for factor in (1.0, 4 / 3, 5 / 3, 2.0):
        count = np.round(np.full(len(points), FIRST) * factor).astype(int)
        error = scatter(times, count) / mean
        cost = float(count @ cpu)
        # Error falls as one over the angles: cost at one percent.
        scaled = cost * error / GOAL
        times_less = f"1/{drake / scaled:.1f} of Drake, 1/{second / scaled:.1f} of MuJoCo"
        line = f"  {count.sum():4d} shifts: {error:.2%} in {cost:6.1f} s; "
        print(f"{line}1 % in {scaled:6.1f} s CPU, {times_less} at random angles")
    reported(study)


def scatter(table: np.ndarray, count: np.ndarray) -> float:
    """Return the standard deviation of the mean over random starts, s."""
    rng = np.random.default_rng(11)
    means = np.zeros(STARTS)
    for row, n in zip(table, count, strict=True):
        phases = (np.arange(n) + rng.random((STARTS, 1))) / n
        means += row[(phases * DENSE).astype(int) % DENSE].mean(axis=1)
    return float(means.std() / len(table))


def reported(study: Study) -> None:
    """Run the program to one percent of reported standard error and print what it took."""
    start = time.process_time()
    with WorkCounter(ProgressBar(), 1) as progress:
        executor = scratch_executor(1, progress.advance)
        result = expect_to(study, study.points, GOAL, executor, progress)
    took = time.process_time() - start
    found = result.expectation
    shifts = sum(len(b.angles) for b in result.blocks)
    print(
        f"expect --precision 0.01: {found.mean * 1e3:.2f} +- {found.standard_error * 1e3:.2f} ms, "
        f"{shifts} shifts, {took:.1f} s CPU"
    )


if __name__ == "__main__":
    main()
