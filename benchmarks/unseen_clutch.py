"""How long the bank of a clutch takes that was never seen, with its flights for traces.

    python -m benchmarks.unseen_clutch [--jobs N] [--points N]

The clutch is that of ``studies/blind/hub`` at the 28 operating points of the published tables,
with the sense of rotation unknown, which is the most that a bank has to hold. Simulated are all
shifts of both banks by the compiled engine into an empty folder, then the flights of every effect
and of each effect with friction of the sleeve, which data sets with traces ask for. ``--points``
takes fewer operating points, evenly, of which there are seven here by default: a quarter of the
work, which grows with their number.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.bundled_bank import fly_all
from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.flight_store import FlightStore
from dogshape.pipeline.diagnose.bank_diagnosis import FLIGHTS, Means, banks_of, plans_of
from dogshape.sim.bundled import bundled_root
from dogshape.sim.effects import load

PUBLISHED = "mq200_stand"
POINTS = 7  #: of the 28, by default; 0 takes all


def unseen() -> Bench:
    """Return the clutch at the published operating points, for the compiled engine."""
    bench = load_bench(PUBLISHED)
    clutch = load_bench(bundled_root() / "blind" / "hub").clutch
    record = replace(bench.record, sense="unknown")
    return replace(bench, clutch=clutch.with_engine("planar"), record=record)


def cpu() -> float:
    """Return the processor time of this process and its workers so far, s."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=0)
    parser.add_argument("--points", type=int, default=POINTS)
    given = parser.parse_args()
    bench, effects = unseen(), load()
    if given.points:
        every = len(bench.cells) / given.points
        cells = tuple(bench.cells[int(k * every)] for k in range(given.points))
        bench = replace(bench, cells=cells)
    shifts = sum(plan.shifts(one) for plan, one in plans_of(bench, effects))
    print(f"{len(bench.cells)} operating points, {shifts} shifts, {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as folder:
        for name, work in (
            ("shifts", lambda: banks_of(bench, effects, Means(Path(folder), jobs=given.jobs))),
            ("flights", lambda: fly_all(bench, effects, FlightStore((Path(folder) / FLIGHTS,)))),
        ):
            start, used = time.monotonic(), cpu()
            work()
            print(
                f"{name:8s} {time.monotonic() - start:6.0f} s, {cpu() - used:6.0f} s of processor "
                "time",
                flush=True,
            )


if __name__ == "__main__":
    main()
