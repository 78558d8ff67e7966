"""Cost of one percent of standard error of the expected shift time, and coverage of its interval.

    python -m benchmarks.expectation

The prototype at all operating points of the paper's study, 96 even angles at each in Drake. The
program is run to one percent, without the numerical error, which repeats an eighth of the shifts.

Then it is run ``RUN_COUNT`` times from other random starts, each angle replaced by the nearest of
the 96 below, so that its angles are even angles among them and no shift is simulated again. The
share of 95 % intervals that hold the mean of all 96: of single operating points and of the whole. A
retry costs twelve mean times, and a shift that does not engage is in some runs only; so the same is
printed without retries. One process; takes some four minutes.
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
from dogshape.sim.statistics.expectation import MixExpectation, PointExpectation
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import DEG
from dogshape.terminal import ProgressBar

GRID_ANGLES = 96  #: even angles in Drake
PRECISION = 0.01  #: relative standard error
RUN_COUNT = 20
Place = tuple[float, float, int]  #: mismatch, force and number of the angle


@dataclass
class Dense:
    """Simulated shifts at all angles of a grid, used as an executor."""

    study: Setup
    rows: dict[Place, Record]
    cpu: dict[Place, float]
    used: set[Place] = field(default_factory=set)

    def run(self, blocks: Sequence[Block]) -> list[list[Record]]:
        """Return the records of blocks, of the nearest angle of the grid below each angle."""
        rows = []
        for block in blocks:
            rows.append([self._row(block, angle) for angle in block.angles])
        return rows

    def _row(self, block: Block, angle: float) -> Record:
        phase = angle / block.clutch.dog.pitch_angle
        place = *_point_key(block.point), int(phase * GRID_ANGLES + 1e-9) % GRID_ANGLES
        self.used.add(place)
        return self.rows[place]

    def copy_unused(self) -> Dense:
        """Copy the shifts without those used."""
        return replace(self, used=set())

    @property
    def reference(self) -> MixExpectation:
        """Expectation of all shifts."""
        rows = []
        for point in self.study.points:
            key = _point_key(point)
            rows.append([self.rows[*key, k] for k in range(GRID_ANGLES)])
        return expectation_of(self.study, self.study.points, rows)


def main() -> None:
    """Print cost and coverage."""
    study = paper_study()
    dense = simulate_grid(study)
    reference = dense.reference
    assert reference.unaided_mean is not None
    times = (
        f"{reference.mean * 1e3:.2f} ms with retries, {reference.unaided_mean * 1e3:.2f} ms without"
    )
    print(f"expected shift time {times}, {len(study.points)} operating points")
    print(f"of {len(dense.rows)} shifts {reference.lost} did not engage")
    print_program(study)
    print_coverage(study, dense)


def simulate_grid(study: Setup) -> Dense:
    """Simulate all shifts."""
    grid = (np.arange(GRID_ANGLES) + 0.5) / GRID_ANGLES * study.clutch.dog.pitch_angle
    dense = Dense(study, {}, {})
    engage(
        study.clutch, study.points[-1], float(grid[0])
    )  # the plant is built outside of the times
    for point in study.points:
        for index, angle in enumerate(grid):
            key = *_point_key(point), index
            start = time.process_time()
            result = engage(study.clutch, point, float(angle))
            dense.cpu[key] = time.process_time() - start
            dense.rows[key] = {
                "outcome": result.outcome.value,
                "shift_time_s": result.shift_time,
                "relative_angle_deg": angle / DEG,
                "count": study.clutch.dog.count,
                "face_contacts": result.events.face_contacts,
            }
    return dense


def _point_key(point: OperatingPoint) -> tuple[float, float]:
    return point.mismatch, point.profile.force


def print_program(study: Setup) -> None:
    """Print result and cost of the program run to a precision of one percent."""
    start = time.process_time()
    with WorkCounter(ProgressBar(), 1) as progress:
        executor = scratch_executor(1, progress.advance)
        expectation, _, _ = expect_to_precision(study, study.points, PRECISION, executor, progress)
    cpu = time.process_time() - start
    time_s = f"{expectation.mean * 1e3:.2f} +- {expectation.standard_error * 1e3:.2f} ms"
    print(
        f"expect --precision 0.01: {time_s}, {expectation.shifts} shifts of Drake, {cpu:.1f} s CPU"
    )


def print_coverage(study: Setup, dense: Dense) -> None:
    """Print the coverage of the program's intervals from other starts on the dense shifts."""
    reference = dense.reference
    settings = study.file.expectation
    print(f"95 % intervals of {RUN_COUNT} runs that hold the mean of {GRID_ANGLES} angles in Drake")
    runs = []
    cpu = []
    for seed in range(1000, 1000 + RUN_COUNT):
        expectation_settings = settings.model_copy(update={"seed": seed})
        seeded_study = replace(
            study, file=study.file.model_copy(update={"expectation": expectation_settings})
        )
        table = dense.copy_unused()
        with WorkCounter(SILENT, 1) as progress:
            expectation, _, _ = expect_to_precision(
                seeded_study, study.points, PRECISION, table, progress
            )
            runs.append(expectation)
        cpu.append(sum(table.cpu[key] for key in table.used))
    print(
        f"  {np.mean([r.shifts for r in runs]):.0f} shifts of Drake, {np.mean(cpu):.1f} s CPU; "
        f"error {_rms_ms([r.mean - reference.mean for r in runs]):.2f} ms, "
        f"stated {_rms_ms([r.standard_error for r in runs]):.2f} ms"
    )
    keys = {
        "with retries": ("mean", "standard_error"),
        "without": ("engaged_mean", "engaged_error"),
    }
    for label, (key, error) in keys.items():
        points = []
        for r in runs:
            for p, q in zip(r.points, reference.points, strict=True):
                points.append(_covers(p, q, key, error))
        total = [_covers(r, reference, key, error) for r in runs]
        print(f"    {label}: operating points {np.mean(points):.1%}, whole {np.mean(total):.1%}")


def _rms_ms(values: Sequence[float]) -> float:
    """Compute the root mean square of times in s, ms."""
    return 1e3 * float(np.sqrt(np.mean(np.square(values))))


def _covers(
    estimate: MixExpectation | PointExpectation,
    reference: MixExpectation | PointExpectation,
    key: str,
    error: str,
) -> bool:
    deviation = abs(getattr(estimate, key) - getattr(reference, key))
    return bool(deviation <= 1.96 * getattr(estimate, error))


if __name__ == "__main__":
    main()
