"""The published Adams table beside the simulation, row by row, and what moves the difference.

    python -m benchmarks.adams

Root-mean-square deviation and bias of simulation over table less one, for the 25 cells that have
a time. First with the ten angles of the table, the published contact as it is and one choice
changed, the engine too; then over all angles, 48 even ones. The rows of both follow by mismatch.
Last are the shifts of the fast rows that skip no slot, over the table. Takes about five minutes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.comparison import Comparison, compare
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, RPM

ALL = 48  #: even angles that stand for all
FAST = 99.0  #: 1/min, from which rows are fast


def choices(clutch: Clutch) -> dict[str, Clutch]:
    """Return the clutch with one choice changed, by what was changed."""
    contact = clutch.contact
    made = {
        "stiffness 1e11 Pa/m": replace(contact, stiffness=1e11),
        "stiction velocity 0.08 m/s": replace(contact, stiction_velocity=0.08),
        "stiction velocity 0.12 m/s": replace(contact, stiction_velocity=0.12),
        "dynamic friction 0.20": replace(contact, dynamic_friction=0.20),
    }
    changed = {name: replace(clutch, contact=value) for name, value in made.items()}
    return {"as published": clutch, "compiled engine": clutch.with_engine("planar"), **changed}


def deviations(found: Comparison) -> dict[float, list[float]]:
    """Return simulation over table less one of each cell with a time, by mismatch in 1/min."""
    rows: dict[float, list[float]] = {}
    for d in found.differences:
        if d.gap is not None and d.cell.time is not None:
            rows.setdefault(round(d.cell.point.mismatch / RPM), []).append(-d.gap / d.cell.time)
    return rows


def unhindered(bench: Bench) -> list[float]:
    """Return mean times of shifts that skip no slot over the table's, for each fast cell."""
    clutch, found = bench.clutch.with_engine("planar"), []
    for cell in bench.cells:
        if cell.time is None or cell.point.mismatch < FAST * RPM:
            continue
        turns = (np.arange(ALL) + 0.5) / ALL * clutch.dog.pitch_angle
        shifts = [engage(clutch, cell.point, float(turn)) for turn in turns]
        times = [s.shift_time for s in shifts if s.shift_time and not s.events.slots_skipped]
        found.append(float(np.mean(times)) / cell.time)
    return found


def main() -> None:
    """Print the tables."""
    bench = load_bench("mq200_adams")
    print(f"{'choice':<30}{'rms, %':>8}{'bias, %':>9}{'rms, ms':>9}"
          f"{'up to 25 1/min, %':>19}{'beyond, %':>11}")  # fmt: skip
    ten, every = {}, {}
    for name, clutch in choices(bench.clutch).items():
        ten[name] = line(name, replace(bench, clutch=clutch))
    angles = bench.relative_angles or ()
    for shift in (-1.0, 1.0):
        turned = tuple(a + shift * DEG for a in angles)
        line(f"angles {shift:+.0f} deg", replace(bench, relative_angles=turned))
    for name in ("as published", "compiled engine"):
        clutch = choices(bench.clutch)[name]
        every[name] = line(f"all angles, {name}", replace(bench, clutch=clutch), ALL)
    print(f"\n{'1/min':>5}{'cells':>7}{'ten angles: rms, %':>20}{'bias, %':>9}"
          f"{'all angles: rms, %':>20}{'bias, %':>9}")  # fmt: skip
    for speed, cells in ten["as published"].items():
        text = f"{speed:5.0f}{len(cells):7d}"
        for one in (cells, every["as published"][speed]):
            text += f"{rms(one):20.1f}{bias(one):9.1f}"
        print(text)
    free = unhindered(bench)
    print(f"\nshifts of the compiled engine that skip no slot over the table, {len(free)} cells "
          f"from 100 1/min: {np.mean(free):.3f} +- {np.std(free, ddof=1):.3f}")  # fmt: skip


def rms(values: Iterable[float]) -> float:
    """Give the root mean square, percent."""
    return 100.0 * float(np.sqrt(np.mean(np.square(list(values)))))


def bias(values: Iterable[float]) -> float:
    """Give the mean, percent."""
    return 100.0 * float(np.mean(list(values)))


def line(name: str, bench: Bench, angles: int | None = None) -> dict[float, list[float]]:
    """Print one row; return its deviations by mismatch."""
    found = compare(bench, scratch_executor().run, angles)
    rows = deviations(found)
    slow = [v for speed, values in rows.items() if speed < 30 for v in values]
    fast = [v for speed, values in rows.items() if speed > 30 for v in values]
    whole, rmse = [*slow, *fast], found.rmse or 0.0
    print(
        f"{name:<30}{rms(whole):8.1f}{bias(whole):9.1f}{1e3 * rmse:9.1f}{rms(slow):19.1f}"
        f"{rms(fast):11.1f}",
        flush=True,
    )
    return rows


if __name__ == "__main__":
    main()
