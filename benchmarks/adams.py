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

from dogshape.bench.bench_data import Bench, Cell, load_bench
from dogshape.diagnosis.comparison import PointGaps, compare
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.kernel import crossing
from dogshape.sim.shift.clutch import Clutch, ImpactLaw, contact_set
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, MM, RPM

DENSE_ANGLES = 192  #: even angles that stand for all: twice as many move no figure by 0.5 %
GRID_ANGLES = 48  #: angles of half a degree in a pitch
MAX_SLOW_RPM = 26.0  #: of slow rows
MIN_FAST_RPM = 99.0  #: of fast rows
END_DISPLACEMENTS_MM = (4.65, 4.70, 4.72)  #: ends of a shift: as here, full travel, beyond


def laws(bench: Bench) -> dict[str, Clutch]:
    """Build clutches of the compiled engine by contact, the last with K in N/mm^1.5."""
    present = bench.clutch.with_engine("planar")
    impact = contact_set("adams_impact")
    stiff = replace(impact, impact=ImpactLaw(1e5 / MM**1.5))
    return {
        "adams2019": present,
        "adams_impact": replace(present, contact=impact),
        "adams_impact in mm": replace(present, contact=stiff),
    }


def deviations(comparison: PointGaps) -> dict[float, list[float]]:
    """Compute simulation over table less one of cells with a time, by mismatch in 1/min."""
    rows: dict[float, list[float]] = {}
    for difference in comparison.differences:
        if difference.gap is not None and difference.cell.time is not None:
            rows.setdefault(round(difference.cell.point.mismatch / RPM), []).append(
                -difference.gap / difference.cell.time
            )
    return rows


def fast_cells(bench: Bench) -> list[Cell]:
    """List the cells of the fast rows."""
    return [c for c in bench.cells if c.time and c.point.mismatch > MIN_FAST_RPM * RPM]


def free_flights(bench: Bench) -> list[float]:
    """Compute the ratio of the table to free flight for each fast cell."""
    travel = bench.clutch.shift_travel
    mass = bench.clutch.rings.mass
    return [c.time / c.point.profile.free_flight_time(travel, mass) for c in fast_cells(bench)]


def ratios_without_skips(bench: Bench, clutch: Clutch, end: float) -> list[float]:
    """Compute the ratio of simulated to published times of fast cells, without slots skipped.

    A shift ends at a displacement of ``end`` m.
    """
    # Beyond full travel a shift counts as diverged; its trace goes on to the end.
    clutch = replace(clutch, seated_tolerance=clutch.dog.travel - end)
    ratios = []
    for cell in fast_cells(bench):
        angles = (np.arange(GRID_ANGLES) + 0.5) / GRID_ANGLES * clutch.dog.pitch_angle
        shifts = [engage(clutch, cell.point, float(angle)) for angle in angles]
        traces = [s.trace for s in shifts if not s.events.slots_skipped]
        times = [crossing(t.time, t.displacement, t.axial_speed, end) for t in traces]
        ratios.append(float(np.nanmean(times)) / cell.time)
    return ratios


def best_origin(bench: Bench, clutch: Clutch) -> float:
    """Compute the smallest deviation over origins and senses of the ten angles, percent."""
    cells = [cell for cell in bench.cells if cell.time]
    half_degrees = np.round(np.array(bench.relative_angles) / (0.5 * DEG)).astype(int)
    angles = np.arange(GRID_ANGLES) * 0.5 * DEG
    times = np.empty((len(cells), len(angles)))  # nan of a shift that hangs on crossed crests
    for row, cell in zip(times, cells, strict=True):
        shifts = [engage(clutch, cell.point, float(angle)) for angle in angles]
        row[:] = np.array([shift.shift_time for shift in shifts], dtype=float)
    table = np.array([cell.time for cell in cells])
    best = np.inf
    for sense in (1, -1):
        for origin in range(GRID_ANGLES):
            columns = (sense * half_degrees + origin) % GRID_ANGLES
            best = min(best, rms(np.nanmean(times[:, columns], axis=1) / table - 1.0))
    return best


def main() -> None:
    """Print the tables."""
    bench = load_bench("mq200_adams")
    print(
        f"{'contact, angles':<30}{'all: rms, %':>12}{'bias, %':>9}"
        f"{'to 25 1/min: rms, %':>21}{'bias, %':>9}"
        f"{'from 100 1/min: rms, %':>24}{'bias, %':>9}"
    )
    print_row("adams2019, Drake, ten", bench)
    for name, clutch in laws(bench).items():
        other_bench = replace(bench, clutch=clutch)
        print_row(f"{name}, ten", other_bench)
        print_row(f"{name}, all", other_bench, DENSE_ANGLES)
        print(f"{f'{name}, best origin':<30}{best_origin(bench, clutch):12.1f}", flush=True)
    print(f"\n{'from 100 1/min':<30}{'mean':>8}{'sd':>8}{'least':>8}{'most':>8}")
    print_spread("table over free flight", free_flights(bench))
    for name, clutch in laws(bench).items():
        ends = END_DISPLACEMENTS_MM if name == "adams_impact" else END_DISPLACEMENTS_MM[:1]
        for end in ends:
            print_spread(f"{name}, {end:.2f} mm", ratios_without_skips(bench, clutch, end * MM))


def print_spread(name: str, values: Sequence[float]) -> None:
    """Print mean, standard deviation and range."""
    mean = np.mean(values)
    sd = np.std(values, ddof=1)
    print(f"{name:<30}{mean:8.3f}{sd:8.3f}{min(values):8.3f}{max(values):8.3f}", flush=True)


def rms(values: Iterable[float]) -> float:
    """Compute the root mean square, percent."""
    return 100.0 * float(np.sqrt(np.mean(np.square(list(values)))))


def bias(values: Iterable[float]) -> float:
    """Compute the mean, percent."""
    return 100.0 * float(np.mean(list(values)))


def print_row(name: str, bench: Bench, angles: int | None = None) -> None:
    """Print root mean square and bias of all, slow and fast rows."""
    rows = deviations(compare(bench, scratch_executor().run, angles))
    text = ""
    for low, high, width in (
        (0.0, np.inf, 12),
        (0.0, MAX_SLOW_RPM, 21),
        (MIN_FAST_RPM, np.inf, 24),
    ):
        sample = []
        for speed, values in rows.items():
            if low < speed < high:
                sample += values
        text += f"{rms(sample):{width}.1f}{bias(sample):9.1f}"
    print(f"{name:<30}{text}", flush=True)


if __name__ == "__main__":
    main()
