"""Compare the simulation with a bench of one's own.

    python examples/own_bench/own_bench.py

The command line does the same: ``dogshape validate examples/own_bench/stand``.
"""

from __future__ import annotations

from pathlib import Path

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.comparison import Comparison, compare
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.units import RPM

STAND = Path(__file__).parent / "stand"


def main(angles: int = 16) -> Comparison:
    """Simulate each operating point of the bench at ``angles`` relative angles."""
    bench = load_bench(STAND)
    result = compare(bench, scratch_executor(jobs=1).run, angles)
    print("1/min      N   bench ms   gap ms   in standard errors")
    for one in result.differences:
        point, time, gap, z = one.cell.point, one.cell.time, one.gap, one.z
        if time is not None and gap is not None and z is not None:
            speed, force = point.mismatch / RPM, point.profile.force
            print(f"{speed:5.0f}  {force:5.0f}  {time * 1e3:9.1f}  {gap * 1e3:+7.1f}  {z:+8.1f}")
    # What makes the gap, once, after up to an hour of simulations for a clutch of one's own:
    # dogshape gap examples/own_bench/stand --out results/gap
    return result


if __name__ == "__main__":
    main()
