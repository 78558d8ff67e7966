"""Difference of both engines at the operating points of a bench without any effect.

    python -m benchmarks.blind_engines [ANGLES]

The blind check takes its truth from MuJoCo (``validation.blind``), the diagnosis simulates with
Drake. At the same even angles, 48 by default, of each operating point of ``mq200_adams`` the table
has both means over shifts that are late in neither engine (``diagnosis.prediction.model``),
their difference, how many are late in one of them, and the difference in sampling errors of a mean
of ten. Four minutes of processor time.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable

import numpy as np

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.baseline import passing_time
from dogshape.diagnosis.prediction.moments import mask_late
from dogshape.diagnosis.prediction.simulations import settings_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from dogshape.validation.blind.mujoco_shift import Draw, Engine
from dogshape.validation.blind.stand import Point, read_stand

ANGLES = 48
SHIFTS = 10  #: of a mean


def main() -> None:
    """Print the comparison."""
    angles = int(sys.argv[1]) if len(sys.argv) > 1 else ANGLES
    bench = load_bench("mq200_adams")
    settings = settings_of(bench, "sleeve")
    blocks = [even_block(s.clutch, s.point, angles, (1, k)) for k, s in enumerate(settings)]
    records = scratch_executor(1).run(blocks)
    engine = Engine(read_stand(bundled_root() / "bench" / "mq200_adams"))
    print("1/min      N   Drake  MuJoCo  difference   share  late  in errors")
    errors = []
    start = time.process_time()
    for setting, block, block_records in zip(settings, blocks, records, strict=True):
        mujoco = second_times(engine, setting, block.angles)
        drake = setting.times_of(block_records)
        errors.append(_row(setting, drake, mujoco))
    cpu_per_shift = (time.process_time() - start) / (len(settings) * angles)
    mean_square = np.square(errors).mean()
    print(f"root mean square: {np.sqrt(mean_square):.2f} sampling errors of ten shifts")
    print(f"MuJoCo takes {cpu_per_shift * 1e3:.0f} ms of processor time a shift")


def second_times(engine: Engine, setting: Setting, angles: Iterable[float]) -> np.ndarray:
    """Simulate MuJoCo's times at an operating point, s, NaN for a shift that did not engage."""
    profile = setting.point.profile
    point = Point(setting.point.mismatch, profile.force, profile.rise)
    times = [engine.shift(point, Draw(float(angle))).time for angle in angles]
    return np.array([np.nan if time is None else time for time in times])


def _row(setting: Setting, drake: np.ndarray, mujoco: np.ndarray) -> float:
    """Print an operating point and return its difference in sampling errors."""
    point = setting.point
    wait = np.array([passing_time(setting)])
    drake_timely = np.isfinite(mask_late(drake[None], wait)[0])
    mujoco_timely = np.isfinite(mask_late(mujoco[None], wait)[0])
    timely_shifts = drake_timely & mujoco_timely
    drake_ms = drake[timely_shifts] * 1e3
    mujoco_ms = mujoco[timely_shifts] * 1e3
    gap = float((mujoco_ms - drake_ms).mean())
    pooled = float(np.sqrt(0.5 * (drake_ms.var(ddof=1) + mujoco_ms.var(ddof=1))))
    error = gap / (pooled / SHIFTS**0.5)
    print(
        f"{point.mismatch / RPM:5.0f} {point.profile.force:6.1f} "
        f"{drake_ms.mean():7.1f} {mujoco_ms.mean():7.1f} {gap:+11.1f} "
        f"{100 * gap / drake_ms.mean():+5.1f} % {(~timely_shifts).sum():5d} {error:+10.2f}",
        flush=True,
    )
    return error


if __name__ == "__main__":
    main()
