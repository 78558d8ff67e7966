"""Both engines at the operating points of a bench without any effect: how far apart they are.

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

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.model import passing_time
from dogshape.diagnosis.prediction.moments import mask_late
from dogshape.diagnosis.prediction.simulations import read_times, settings_of
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
    places = [even_block(s.clutch, s.point, angles, (1, k)) for k, s in enumerate(settings)]
    rows = scratch_executor(1).run(places)
    engine = Engine(read_stand(bundled_root() / "bench" / "mq200_adams"))
    print("1/min      N   Drake  MuJoCo  difference   share  late  in errors")
    found, begin = [], time.process_time()
    for setting, block, mine in zip(settings, places, rows, strict=True):
        second = second_times(engine, setting, block.angles)
        first = read_times(setting, mine)
        found.append(_row(setting, first, second))
    each = (time.process_time() - begin) / (len(settings) * angles)
    errors = np.array(found)
    print(f"root mean square: {np.sqrt((errors**2).mean()):.2f} sampling errors of ten shifts")
    print(f"MuJoCo takes {each * 1e3:.0f} ms of processor time a shift")


def second_times(engine: Engine, setting: Setting, angles: Iterable[float]) -> np.ndarray:
    """Simulate MuJoCo's times at an operating point, s, NaN for a shift that did not engage."""
    profile = setting.point.profile
    point = Point(setting.point.mismatch, profile.force, profile.rise)
    times = [engine.shift(point, Draw(float(angle))).time for angle in angles]
    return np.array([np.nan if time is None else time for time in times])


def _row(setting: Setting, first: np.ndarray, second: np.ndarray) -> float:
    """Print an operating point and return its difference in sampling errors."""
    point, wait = setting.point, np.array([passing_time(setting)])
    both = np.all([np.isfinite(mask_late(one[None], wait)[0]) for one in (first, second)], axis=0)
    one, two = first[both] * 1e3, second[both] * 1e3
    gap = float((two - one).mean())
    pooled = float(np.sqrt(0.5 * (one.var(ddof=1) + two.var(ddof=1))))
    error = gap / (pooled / SHIFTS**0.5)
    print(
        f"{point.mismatch / RPM:5.0f} {point.profile.force:6.1f} "
        f"{one.mean():7.1f} {two.mean():7.1f} {gap:+11.1f} {100 * gap / one.mean():+5.1f} % "
        f"{(~both).sum():5d} {error:+10.2f}",
        flush=True,
    )
    return error


if __name__ == "__main__":
    main()
