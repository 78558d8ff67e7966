"""The published Adams table beside the simulation, and which choices move the difference.

    python -m benchmarks.adams

Root-mean-square deviation over the 25 cells that have a time, at the same ten angles, with
the published contact as it is and with one choice changed, the engine too. Takes about three
minutes.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.comparison import compare
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.units import DEG


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


def main() -> None:
    """Print the table."""
    bench = load_bench("mq200_adams")
    print(f"{'choice':<30}{'rms, %':>8}{'rms, ms':>9}{'up to 25 1/min, %':>19}{'beyond, %':>11}")
    for name, clutch in choices(bench.clutch).items():
        line(name, replace(bench, clutch=clutch))
    angles = bench.relative_angles or ()
    for shift in (-1.0, 1.0):
        turned = tuple(a + shift * DEG for a in angles)
        line(f"angles {shift:+.0f} deg", replace(bench, relative_angles=turned))


def line(name: str, bench: Bench) -> None:
    """Print one row."""
    result = compare(bench, scratch_executor().run)
    slow, fast = [], []
    for d in result.differences:
        if d.gap is not None and d.cell.time is not None:
            (slow if d.cell.point.mismatch < 3.0 else fast).append((d.gap / d.cell.time) ** 2)
    parts = [100 * (sum(v) / len(v)) ** 0.5 for v in (slow, fast)]
    print(
        f"{name:<30}{100 * result.relative_rms:8.1f}{1e3 * result.rmse:9.1f}"
        f"{parts[0]:19.1f}{parts[1]:11.1f}",
        flush=True,
    )


if __name__ == "__main__":
    main()
