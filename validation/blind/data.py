"""The data of a case: shifts at random angles as a folder that the diagnosis can read.

Shifts are made in the order of the table, which is the order of the test series.
"""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.units import MM, RPM
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.mujoco_shift import Draw, Shift, signal
from dogshape.validation.blind.stand import Point, Stand, Truth
from dogshape.validation.blind.truth_engines import engine_of

SAMPLING = 2000.0  #: 1/s, of traces
NOISE = (5e-3, 0.3)  #: standard deviation of a trace's displacement in mm and speeds in 1/min
AFTER = 0.005  #: s that a trace goes on after its shift
HEAD = ("mismatch_rpm", "force_N", "force_rise_s", "n_shifts", "shift_time_s", "engaged", "trace")

Rows = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """All shifts of a case, point by point, (points, n)."""

    points: tuple[Point, ...]
    shifts: tuple[tuple[Shift, ...], ...]

    @property
    def times(self) -> list[list[float | None]]:
        """Times in s, None for shifts that did not engage."""
        return [[shift.time for shift in mine] for mine in self.shifts]


def draws(truth: Truth, stand: Stand, points: int, each: int, seed: int) -> list[list[Draw]]:
    """Return the draws of all shifts: angle, waiting, phase, and what a drift has left."""
    generator = np.random.default_rng(seed)
    last = max(1, points * each - 1)
    found = []
    for place in range(points):
        mine = []
        for k in range(each):
            turn = generator.vonmises(2.0 * math.pi * truth.centre, truth.concentration)
            late, phase = generator.exponential(), generator.uniform(0.0, 2.0 * math.pi)
            fade = 1.0 - truth.drift * (place * each + k) / last
            angle = float(turn % (2.0 * math.pi)) / (2.0 * math.pi) * stand.pitch
            mine.append(Draw(angle, truth.sticking * float(late), float(phase), fade))
        found.append(mine)
    return found


def simulate(stand: Stand, points: Sequence[Point], case: Case, name: str = "mujoco") -> Series:
    """Simulate all shifts of a case in an engine."""
    engine = engine_of(name, stand, case.truth)
    every = draws(case.truth, stand, len(points), case.shifts, case.seed)
    keep = case.form == "traces"
    shifts = tuple(
        tuple(engine.shift(point, draw, keep) for draw in mine)
        for point, mine in zip(points, every, strict=True)
    )
    return Series(tuple(points), shifts)


def even_times(
    stand: Stand,
    points: Sequence[Point],
    count: int,
    truth: Truth | None = None,
    name: str = "mujoco",
) -> list[list[float | None]]:
    """Return times at ``count`` even angles of each point, s; without any effect by default."""
    engine = engine_of(name, stand, truth)
    angles = (np.arange(count) + 0.5) / count * stand.pitch
    return [[engine.shift(point, Draw(float(a))).time for a in angles] for point in points]


def write_case(
    folder: Path, name: str, base: Path, case: Case, series: Series
) -> list[list[float | None]]:
    """Write the data of a case; nothing of its truth is in them.

    Return the times in s as they stand beside the operating points, None for shifts that did not
    engage.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "bench.toml").write_text(bench_text(base, name), encoding="utf-8")
    places = swapped(series.points) if case.swapped else range(len(series.points))
    with (folder / "shifts.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEAD)
        for point, place in zip(series.points, places, strict=True):
            given = (f"{point.mismatch / RPM:.10g}", f"{point.force:.10g}", f"{point.rise:.10g}")
            for row in _rows(folder, case, series, place):
                table.writerow((*given, *row))
    return [series.times[place] for place in places]


def bench_text(base: Path, name: str, errors: tuple[float, float] | None = None) -> str:
    """Return the base's ``bench.toml`` with another name and the sensor at the actuator.

    ``errors`` are the standard deviations of true over nominal force and mismatch, where the stand
    says them.
    """
    data: dict[str, Any] = tomllib.loads((base / "bench.toml").read_text(encoding="utf-8"))
    plain = {"name": name, "source": "withheld", **{k: data[k] for k in _PLAIN}}
    if "mismatch_sense" in data:
        plain["mismatch_sense"] = data["mismatch_sense"]
    lines = [f"{key} = {_toml(value)}" for key, value in plain.items()]
    for table in ("dog", "sliding", "output", "contact"):
        lines += ["", f"[{table}]"]
        lines += [f"{key} = {_toml(value)}" for key, value in data[table].items()]
    lines += ["", "[sensor]", 'displacement_at = "actuator"', ""]
    if errors is not None:
        force, mismatch = (f"{100.0 * one:.3g}" for one in errors)
        lines += [
            "[errors.each_point]",
            f"force_percent = {force}",
            f"mismatch_percent = {mismatch}",
        ]
        lines += [""]
    return "\n".join(lines)


_PLAIN = ("timeout_s", "shift_travel_mm")


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def swapped(points: Sequence[Point]) -> list[int]:
    """Return whose shifts stand beside each point: those of the forces in reverse order."""
    found = list(range(len(points)))
    for mismatch in {point.mismatch for point in points}:
        mine = [k for k, point in enumerate(points) if point.mismatch == mismatch]
        mine.sort(key=lambda k: points[k].force)
        for place, source in zip(mine, reversed(mine), strict=True):
            found[place] = source
    return found


def _rows(folder: Path, case: Case, series: Series, place: int) -> list[tuple[str, ...]]:
    """Return ``n_shifts``, ``shift_time_s``, ``engaged`` and ``trace`` of one point's rows."""
    mine = series.shifts[place]
    found: list[tuple[str, ...]] = []
    if case.form == "means":
        return mean_rows(mine)
    for k, shift in enumerate(mine):
        trace = ""
        if shift.motion is not None and shift.time is not None:
            trace = f"traces/{place:02d}_{k}.csv"
            _write_trace(folder / trace, case, series.points[place], shift, place * 100 + k)
        time = "" if shift.time is None else f"{shift.time:.6f}"
        found.append(("1", time, "false" if shift.time is None else "true", trace))
    return found


def mean_rows(shifts: Sequence[Shift]) -> list[tuple[str, ...]]:
    """Return ``n_shifts``, ``shift_time_s``, ``engaged`` and ``trace`` of a mean's rows."""
    times = [shift.time for shift in shifts if shift.time is not None]
    failed = len(shifts) - len(times)
    found: list[tuple[str, ...]] = []
    if times:
        found.append((str(len(times)), f"{np.mean(times):.6f}", "true", ""))
    if failed:
        found.append((str(failed), "", "false", ""))
    return found


def _write_trace(path: Path, case: Case, point: Point, shift: Shift, number: int) -> None:
    """Write a time series from time zero on, sampled and with noise; the force is the signal's."""
    path.parent.mkdir(exist_ok=True)
    generator = np.random.default_rng((case.seed, number))
    rows = trace_rows(point, shift, generator)
    if rows is None:
        return
    head = "t_s,displacement_mm,force_N,sliding_speed_rpm,output_speed_rpm"
    np.savetxt(path, rows, fmt="%.6g", delimiter=",", header=head, comments="")


def trace_rows(point: Point, shift: Shift, generator: np.random.Generator) -> Rows | None:
    """Return a sampled trace with noise: s, mm, N and both speeds in 1/min, (n, 5).

    None for a shift that did not engage, or whose motion was not kept.
    """
    motion, end = shift.motion, shift.time
    if motion is None or end is None:
        return None
    times = np.arange(0.0, end + AFTER, 1.0 / SAMPLING)
    columns = [np.interp(times, motion[:, 0], motion[:, k]) for k in (1, 3, 4)]
    noise = generator.normal(size=(3, len(times)))
    way = columns[0] / MM + NOISE[0] * noise[0]
    speeds = [one / RPM + NOISE[1] * noise[k] for k, one in enumerate(columns[1:], 1)]
    force = [signal(Truth(), point, time) for time in times]
    return np.stack([times, way, np.array(force), *speeds], axis=1)
