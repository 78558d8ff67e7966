"""CPU time for one percent of standard error of the expected shift time, and what it is worth.

    python -m benchmarks.expectation

The prototype at all operating points of the paper's study, 96 even angles at each in Drake and in
the compiled engine. One process; takes some ten minutes; needs the extra ``blind``.

**Random angles**: what the variance over these angles asks for, times what a shift costs, in Drake
and in MuJoCo, measured interleaved. **Even angles**: how many give one percent, with the scatter of
the mean over 400 random starts on the same 96 times.

**The program** run to one percent, without the numerical error, which repeats an eighth of the
shifts.

**Coverage**: the program run ``RUNS`` times from other random starts, each angle replaced by the
nearest of the 96 below, so that its angles are even ones among them and no shift is simulated
again. The share of 95 % intervals that hold the mean of all 96 Drake shifts: of single operating
points and of the whole. A retry costs twelve mean times, and one shift that does not engage is in
some runs and not in others; so beside it the same without retries.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.common import angles_of, paper_study
from dogshape.pipeline.cli.progress_bar import ProgressBar
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, WorkCounter
from dogshape.pipeline.simulate.evaluation import expectation_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.simulate.precision import FIRST, expect_to
from dogshape.sim.engines import engage
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.expectation import Expectation, PointExpectation
from dogshape.sim.statistics.shift_records import Record
from dogshape.validation.second_engine import SecondEngine

DENSE, STARTS, GOAL, RUNS = 96, 400, 0.01, 20


@dataclass
class Dense:
    """Shifts at all angles of a grid, in place of an executor that simulates them."""

    study: Setup
    rows: dict[tuple[str, float, float, int], Record]
    cpu: dict[tuple[str, float, float, int], float]
    used: set[tuple[str, float, float, int]] = field(default_factory=set)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of blocks, each at the nearest angle of the grid below its own."""
        return [[self._row(block, angle) for angle in block.angles] for block in blocks]

    def _row(self, block: Block, angle: float) -> Record:
        phase = angle / block.clutch.dog.pitch_angle
        engine = block.clutch.solver.engine
        place = engine, *_named(block.point), int(phase * DENSE + 1e-9) % DENSE
        self.used.add(place)
        return self.rows[place]

    def fresh(self) -> Dense:
        """Return the same shifts, none of them used."""
        return replace(self, used=set())

    def times(self, engine: str) -> np.ndarray:
        """Tabulate the shift times, s, NaN where a shift did not engage, (points, angles)."""
        named = [_named(point) for point in self.study.points]
        rows = [[self.rows[engine, *key, k] for k in range(DENSE)] for key in named]
        return np.array([[r["shift_time_s"] for r in mine] for mine in rows], dtype=float)

    def cost(self, engine: str) -> np.ndarray:
        """Average the CPU time of a shift at each operating point, s, (points,)."""
        named = [_named(point) for point in self.study.points]
        return np.array(
            [np.mean([self.cpu[engine, *key, k] for k in range(DENSE)]) for key in named]
        )

    @property
    def reference(self) -> Expectation:
        """Expectation of all Drake's shifts."""
        named = [_named(point) for point in self.study.points]
        rows = [[self.rows["drake", *key, k] for k in range(DENSE)] for key in named]
        return expectation_of(self.study, self.study.points, rows)


def main() -> None:
    """Print the comparison."""
    study = paper_study()
    dense, other = simulated(study)
    times, cpu = dense.times("drake"), dense.cost("drake")
    mean = float(np.nanmean(times, axis=1).mean())
    print(f"expected shift time {dense.reference.mean * 1e3:.2f} ms with retries, "
          f"{mean * 1e3:.2f} ms without, {len(times)} operating points")  # fmt: skip
    lost = [int(np.isnan(dense.times(engine)).sum()) for engine in ("drake", "planar")]
    apart = np.abs(dense.times("planar") - times)
    print(f"of {times.size} shifts {lost[0]} did not engage in Drake, {lost[1]} in the compiled "
          f"engine; {np.mean(apart > 1e-3):.2%} differ by more than 1 ms")  # fmt: skip
    random = np.nanvar(times, axis=1).mean() / (GOAL * mean) ** 2
    drake, second = random * cpu.mean(), random * other
    print(f"random angles: {random:.0f} shifts for 1 %")
    print(f"  Drake    {cpu.mean() * 1e3:6.1f} ms a shift, {drake:7.1f} s CPU")
    print(f"  MuJoCo   {other * 1e3:6.1f} ms a shift, {second:7.1f} s CPU")
    print(f"  compiled {dense.cost('planar').mean() * 1e3:6.1f} ms a shift")
    print("even angles")
    for factor in (1.0, 4 / 3, 5 / 3, 2.0):
        count = np.round(np.full(len(times), FIRST) * factor).astype(int)
        error = scatter(times, count) / mean
        cost = float(count @ cpu)
        # Error falls as one over the angles: cost at one percent.
        scaled = cost * error / GOAL
        times_less = f"1/{drake / scaled:.1f} of Drake, 1/{second / scaled:.1f} of MuJoCo"
        line = f"  {count.sum():4d} shifts: {error:.2%} in {cost:6.1f} s; "
        print(f"{line}1 % in {scaled:6.1f} s CPU, {times_less} at random angles")
    reported(study)
    coverage(study, dense)


def simulated(study: Setup) -> tuple[Dense, float]:
    """Simulate all shifts in both engines by turns; give MuJoCo's CPU time a shift too, s."""
    clutches = {"drake": study.clutch, "planar": study.clutch.with_engine("planar")}
    second, other = SecondEngine(study.clutch), 0.0
    grid = (np.arange(DENSE) + 0.5) / DENSE * study.clutch.dog.pitch_angle
    dense = Dense(study, {}, {})
    for clutch in clutches.values():  # plants are built, and compiled, outside of the times
        engage(clutch, study.points[-1], float(grid[0]))
    for index, point in enumerate(study.points):
        for place, angle in enumerate(grid):
            for engine, clutch in clutches.items():
                key = engine, *_named(point), place
                start = time.process_time()
                found = engage(clutch, point, float(angle))
                dense.cpu[key] = time.process_time() - start
                dense.rows[key] = {
                    "outcome": found.outcome.value,
                    "shift_time_s": found.shift_time,
                }
        start = time.process_time()
        for angle in angles_of(study.clutch, 3, index):
            second.shift(point, float(angle))
        other += (time.process_time() - start) / 3
    return dense, other / len(study.points)


def _named(point: OperatingPoint) -> tuple[float, float]:
    return point.mismatch, point.profile.force


def scatter(table: np.ndarray, count: np.ndarray) -> float:
    """Return the standard deviation of the mean over random starts, s."""
    rng = np.random.default_rng(11)
    means = np.zeros(STARTS)
    for row, n in zip(table, count, strict=True):
        phases = (np.arange(n) + rng.random((STARTS, 1))) / n
        means += np.nanmean(row[(phases * DENSE).astype(int) % DENSE], axis=1)
    return float(means.std() / len(table))


def reported(study: Setup) -> None:
    """Run the program to one percent of its standard error, and print what it took."""
    start = time.process_time()
    with WorkCounter(ProgressBar(), 1) as progress:
        executor = scratch_executor(1, progress.advance)
        found = expect_to(study, study.points, GOAL, executor, progress).expectation
    took = time.process_time() - start
    time_s = f"{found.mean * 1e3:.2f} +- {found.standard_error * 1e3:.2f} ms"
    print(f"expect --precision 0.01: {time_s}, {found.shifts} shifts of Drake, {took:.1f} s CPU")


def coverage(study: Setup, dense: Dense) -> None:
    """Run the program from other starts on the dense shifts, and print what its intervals hold."""
    reference, settings = dense.reference, study.file.expectation
    print(f"95 % intervals of {RUNS} runs that hold the mean of {DENSE} angles in Drake")
    runs, cpu = [], []
    for seed in range(1000, 1000 + RUNS):
        drawn = settings.model_copy(update={"seed": seed})
        turned = replace(study, file=study.file.model_copy(update={"expectation": drawn}))
        table = dense.fresh()
        with WorkCounter(SILENT, 1) as progress:
            runs.append(expect_to(turned, study.points, GOAL, table, progress).expectation)
        cpu.append(sum(table.cpu[key] for key in table.used))
    print(f"  {np.mean([r.shifts for r in runs]):.0f} shifts of Drake, {np.mean(cpu):.1f} s CPU; "
          f"error {_root([r.mean - reference.mean for r in runs]):.2f} ms, "
          f"told {_root([r.standard_error for r in runs]):.2f} ms")  # fmt: skip
    for words, key in (("with retries", "mean"), ("without", "mean_engaged")):
        points = [_holds(p, q, key) for r in runs
                  for p, q in zip(r.points, reference.points, strict=True)]  # fmt: skip
        whole = [_holds(r, reference, key) for r in runs]
        print(f"    {words}: operating points {np.mean(points):.1%}, whole {np.mean(whole):.1%}")


def _root(values: Sequence[float]) -> float:
    """Return the root of the mean square of times in s, ms."""
    return 1e3 * float(np.sqrt(np.mean(np.square(values))))


def _holds(
    told: Expectation | PointExpectation, reference: Expectation | PointExpectation, key: str
) -> bool:
    apart = abs(getattr(told, key) - getattr(reference, key))
    return bool(apart <= 1.96 * told.standard_error)


if __name__ == "__main__":
    main()
