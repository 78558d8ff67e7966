"""Cost of one percent of standard error of the expected shift time, and coverage of its interval.

    python -m benchmarks.expectation

The prototype at all operating points of the paper's study, 96 even angles at each in Drake. The
program is run to one percent, without the numerical error, which repeats an eighth of the shifts.

Then it is run ``RUNS`` times from other random starts, each angle replaced by the nearest of the 96
below, so that its angles are even ones among them and no shift is simulated again. The share of
95 % intervals that hold the mean of all 96: of single operating points and of the whole. A retry
costs twelve mean times, and one shift that does not engage is in some runs and not in others; so
beside it the same without retries. One process; takes some four minutes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.common import paper_study
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, WorkCounter
from dogshape.pipeline.simulate.evaluation import expect_to_precision, expectation_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.blocks import Block, engage
from dogshape.sim.statistics.expectation import Expectation, PointExpectation
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import DEG
from dogshape.terminal import ProgressBar

DENSE, GOAL, RUNS = 96, 0.01, 20
Place = tuple[float, float, int]  #: mismatch, force and number of the angle


@dataclass
class Dense:
    """Shifts at all angles of a grid, in place of an executor that simulates them."""

    study: Setup
    rows: dict[Place, Record]
    cpu: dict[Place, float]
    used: set[Place] = field(default_factory=set)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of blocks, each at the nearest angle of the grid below its own."""
        return [[self._row(block, angle) for angle in block.angles] for block in blocks]

    def _row(self, block: Block, angle: float) -> Record:
        phase = angle / block.clutch.dog.pitch_angle
        place = *_named(block.point), int(phase * DENSE + 1e-9) % DENSE
        self.used.add(place)
        return self.rows[place]

    def fresh(self) -> Dense:
        """Return the same shifts, none of them used."""
        return replace(self, used=set())

    @property
    def reference(self) -> Expectation:
        """Expectation of all shifts."""
        named = [_named(point) for point in self.study.points]
        rows = [[self.rows[*key, k] for k in range(DENSE)] for key in named]
        return expectation_of(self.study, self.study.points, rows)


def main() -> None:
    """Print cost and coverage."""
    study = paper_study()
    dense = simulated(study)
    whole = dense.reference
    assert whole.mean_engaged is not None
    times = f"{whole.mean * 1e3:.2f} ms with retries, {whole.mean_engaged * 1e3:.2f} ms without"
    print(f"expected shift time {times}, {len(study.points)} operating points")
    print(f"of {len(dense.rows)} shifts {whole.lost} did not engage")
    reported(study)
    coverage(study, dense)


def simulated(study: Setup) -> Dense:
    """Simulate all shifts."""
    grid = (np.arange(DENSE) + 0.5) / DENSE * study.clutch.dog.pitch_angle
    dense = Dense(study, {}, {})
    engage(
        study.clutch, study.points[-1], float(grid[0])
    )  # the plant is built outside of the times
    for point in study.points:
        for place, angle in enumerate(grid):
            key = *_named(point), place
            start = time.process_time()
            found = engage(study.clutch, point, float(angle))
            dense.cpu[key] = time.process_time() - start
            dense.rows[key] = {
                "outcome": found.outcome.value, "shift_time_s": found.shift_time,
                "relative_angle_deg": angle / DEG, "count": study.clutch.dog.count,
                "face_contacts": found.events.face_contacts,
            }  # fmt: skip
    return dense


def _named(point: OperatingPoint) -> tuple[float, float]:
    return point.mismatch, point.profile.force


def reported(study: Setup) -> None:
    """Run the program to one percent of its standard error, and print what it took."""
    start = time.process_time()
    with WorkCounter(ProgressBar(), 1) as progress:
        executor = scratch_executor(1, progress.advance)
        found, _, _ = expect_to_precision(study, study.points, GOAL, executor, progress)
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
            runs.append(expect_to_precision(turned, study.points, GOAL, table, progress)[0])
        cpu.append(sum(table.cpu[key] for key in table.used))
    print(f"  {np.mean([r.shifts for r in runs]):.0f} shifts of Drake, {np.mean(cpu):.1f} s CPU; "
          f"error {_root([r.mean - reference.mean for r in runs]):.2f} ms, "
          f"told {_root([r.standard_error for r in runs]):.2f} ms")  # fmt: skip
    keys = {"with retries": ("mean", "standard_error"),
            "without": ("engaged_mean", "engaged_error")}  # fmt: skip
    for words, (key, error) in keys.items():
        points = [_holds(p, q, key, error) for r in runs
                  for p, q in zip(r.points, reference.points, strict=True)]  # fmt: skip
        whole = [_holds(r, reference, key, error) for r in runs]
        print(f"    {words}: operating points {np.mean(points):.1%}, whole {np.mean(whole):.1%}")


def _root(values: Sequence[float]) -> float:
    """Return the root of the mean square of times in s, ms."""
    return 1e3 * float(np.sqrt(np.mean(np.square(values))))


def _holds(
    told: Expectation | PointExpectation,
    reference: Expectation | PointExpectation,
    key: str,
    error: str,
) -> bool:
    apart = abs(getattr(told, key) - getattr(reference, key))
    return bool(apart <= 1.96 * getattr(told, error))


if __name__ == "__main__":
    main()
