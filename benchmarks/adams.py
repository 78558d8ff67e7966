"""The published Adams table beside the simulation, with the present contact and with its own laws.

    python -m benchmarks.adams

Root-mean-square deviation and bias of simulation over table less one, for the 25 cells that have a
time, for the rows up to 25 1/min and from 100 1/min: with the ten angles of the table, over all
angles, and with the origin and sense of the ten angles, in half degrees, that deviate least. Then
the twelve cells from 100 1/min, mean, standard deviation and range: the table over free flight, and
shifts that skip no slot over the table, by the way at which a shift ends. Takes a minute.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, Cell, load_bench
from dogshape.diagnosis.bench.comparison import Comparison, compare
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.kernel import crossing
from dogshape.sim.shift.clutch import Clutch, ImpactLaw, contact_set
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, MM, RPM

ALL = 192  #: even angles that stand for all: twice as many move no figure by 0.5 %
GRID = 48  #: angles of half a degree in a pitch
SLOW, FAST = 26.0, 99.0  #: 1/min, to and from which rows are slow and fast
ENDS = (4.65, 4.70, 4.72)  #: ways at which a shift may end, mm: as here, full travel, beyond


def laws(bench: Bench) -> dict[str, Clutch]:
    """Return the clutch of the compiled engine by its contact, the last with K in N/mm^1.5."""
    present, impact = bench.clutch.with_engine("planar"), contact_set("adams_impact")
    stiff = replace(impact, impact=ImpactLaw(1e5 / MM**1.5))
    return {
        "adams2019": present,
        "adams_impact": replace(present, contact=impact),
        "adams_impact in mm": replace(present, contact=stiff),
    }


def deviations(found: Comparison) -> dict[float, list[float]]:
    """Return simulation over table less one of each cell with a time, by mismatch in 1/min."""
    rows: dict[float, list[float]] = {}
    for d in found.differences:
        if d.gap is not None and d.cell.time is not None:
            rows.setdefault(round(d.cell.point.mismatch / RPM), []).append(-d.gap / d.cell.time)
    return rows


def fast_cells(bench: Bench) -> list[Cell]:
    """List the cells of the fast rows."""
    return [c for c in bench.cells if c.time and c.point.mismatch > FAST * RPM]


def free_flights(bench: Bench) -> list[float]:
    """Return the table's times over those of free flight, for each fast cell."""
    way, mass = bench.clutch.shift_travel, bench.clutch.rings.mass
    return [c.time / c.point.profile.free_flight_time(way, mass) for c in fast_cells(bench)]


def unhindered(bench: Bench, clutch: Clutch, end: float) -> list[float]:
    """Return mean times to a way in m of shifts that skip no slot over the table's, fast cells."""
    # Beyond full travel a shift counts as diverged; its trace goes on to the end.
    clutch, found = replace(clutch, seated_tolerance=clutch.dog.travel - end), []
    for cell in fast_cells(bench):
        turns = (np.arange(GRID) + 0.5) / GRID * clutch.dog.pitch_angle
        shifts = [engage(clutch, cell.point, float(turn)) for turn in turns]
        traces = [s.trace for s in shifts if not s.events.slots_skipped]
        times = [crossing(t.time, t.displacement, t.axial_speed, end) for t in traces]
        found.append(float(np.nanmean(times)) / cell.time)
    return found


def best_origin(bench: Bench, clutch: Clutch) -> float:
    """Return the least deviation that any origin and sense of the ten angles leaves, percent."""
    cells = [cell for cell in bench.cells if cell.time]
    half = np.round(np.array(bench.relative_angles) / (0.5 * DEG)).astype(int)
    turns = np.arange(GRID) * 0.5 * DEG
    ends = [[engage(clutch, c.point, float(t)).shift_time for t in turns] for c in cells]
    times = np.array(ends, dtype=float)  # nan of one that hangs on crossed crests
    table = np.array([cell.time for cell in cells])
    return min(
        rms(np.nanmean(times[:, (sense * half + origin) % GRID], axis=1) / table - 1.0)
        for sense in (1, -1)
        for origin in range(GRID)
    )


def main() -> None:
    """Print the tables."""
    bench = load_bench("mq200_adams")
    print(f"{'contact, angles':<30}{'all: rms, %':>12}{'bias, %':>9}"
          f"{'to 25 1/min: rms, %':>21}{'bias, %':>9}"
          f"{'from 100 1/min: rms, %':>24}{'bias, %':>9}")  # fmt: skip
    line("adams2019, Drake, ten", bench)
    for name, clutch in laws(bench).items():
        own = replace(bench, clutch=clutch)
        line(f"{name}, ten", own)
        line(f"{name}, all", own, ALL)
        print(f"{f'{name}, best origin':<30}{best_origin(bench, clutch):12.1f}", flush=True)
    print(f"\n{'from 100 1/min':<30}{'mean':>8}{'sd':>8}{'least':>8}{'most':>8}")
    spread("table over free flight", free_flights(bench))
    for name, clutch in laws(bench).items():
        for end in ENDS if name == "adams_impact" else ENDS[:1]:
            spread(f"{name}, {end:.2f} mm", unhindered(bench, clutch, end * MM))


def spread(name: str, values: Sequence[float]) -> None:
    """Print mean, standard deviation and range."""
    mean, sd = np.mean(values), np.std(values, ddof=1)
    print(f"{name:<30}{mean:8.3f}{sd:8.3f}{min(values):8.3f}{max(values):8.3f}", flush=True)


def rms(values: Iterable[float]) -> float:
    """Give the root mean square, percent."""
    return 100.0 * float(np.sqrt(np.mean(np.square(list(values)))))


def bias(values: Iterable[float]) -> float:
    """Give the mean, percent."""
    return 100.0 * float(np.mean(list(values)))


def line(name: str, bench: Bench, angles: int | None = None) -> None:
    """Print one row."""
    rows = deviations(compare(bench, scratch_executor().run, angles))
    text = ""
    for low, high, width in ((0.0, np.inf, 12), (0.0, SLOW, 21), (FAST, np.inf, 24)):
        part = [v for speed, values in rows.items() if low < speed < high for v in values]
        text += f"{rms(part):{width}.1f}{bias(part):9.1f}"
    print(f"{name:<30}{text}", flush=True)


if __name__ == "__main__":
    main()
