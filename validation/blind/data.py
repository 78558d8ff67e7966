"""Data of a field case: its test series, simulated and written as a stand gives it.

A test series goes through the operating points in the order of the table, or makes all shifts in
random order; ``order`` says the place of each single shift in it. The true force and mismatch of
an operating point are off its nominal ones by an error of their own. Traces have the force that
acts, as a sensor at the actuator measures it: with its delay, its lag, its stages and what a drift
has taken of it.
"""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.units import MM, RPM
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.mujoco_shift import Draw, Shift, signal
from dogshape.validation.blind.stand import Point, Stand, Truth, read_stand
from dogshape.validation.blind.truth_engines import engine_of

Array = NDArray[np.float64]
Times = list[list[float | None]]
_Where = tuple[int, Sequence[int], Sequence[Draw]]

SAMPLING = 2000.0  #: 1/s, of traces
NOISE = (5e-3, 0.3)  #: standard deviation of a trace's displacement in mm and speeds in 1/min
AFTER = 0.005  #: s that a trace goes on after its shift
HEAD = ("mismatch_rpm", "force_N", "force_rise_s", "n_shifts", "shift_time_s", "engaged", "trace")
#: Added to a case's seed for the errors of its nominal values, and for the order of its shifts.
ERRORS, ORDER = 71, 72
FORCE_NOISE = 0.002  #: of the nominal force, standard deviation of a sample of the measured one


def true_points(case: Case, points: Sequence[Point]) -> tuple[Point, ...]:
    """Draw force and mismatch that a series really has at its nominal operating points."""
    generator = np.random.default_rng((case.seed, ERRORS))
    off = generator.normal(size=(len(points), 2)) * (case.force_error, case.speed_error)
    return tuple(
        replace(point, force=point.force * (1.0 + force), mismatch=point.mismatch * (1.0 + speed))
        for point, (force, speed) in zip(points, off.tolist(), strict=True)
    )


def series_places(case: Case) -> list[list[int]]:
    """Draw the place of each shift in the test series from 1 on, point by point."""
    total = sum(case.numbers)
    generator = np.random.default_rng((case.seed, ORDER))
    every = generator.permutation(total) if case.shuffled else np.arange(total)
    parts = np.split(every + 1, np.cumsum(case.numbers)[:-1])
    return [part.tolist() for part in parts]


def draws(truth: Truth, stand: Stand, points: int, each: int, seed: int) -> list[list[Draw]]:
    """Draw angle, waiting and phase of all shifts, point by point."""
    generator = np.random.default_rng(seed)
    found = []
    for _ in range(points):
        mine = []
        for _ in range(each):
            turn = generator.vonmises(2.0 * math.pi * truth.centre, truth.concentration)
            late, phase = generator.exponential(), generator.uniform(0.0, 2.0 * math.pi)
            angle = float(turn % (2.0 * math.pi)) / (2.0 * math.pi) * stand.pitch
            mine.append(Draw(angle, truth.sticking * float(late), float(phase)))
        found.append(mine)
    return found


def series_draws(case: Case, stand: Stand) -> list[list[Draw]]:
    """Draw all shifts of a case, point by point; a drift goes by the place in the series."""
    truth, numbers = case.truth, case.numbers
    every = draws(truth, stand, len(numbers), max(numbers), case.seed)
    last = max(1, sum(numbers) - 1)
    fades = [[1.0 - truth.drift * (k - 1) / last for k in mine] for mine in series_places(case)]
    return [
        [replace(draw, fade=fade) for draw, fade in zip(mine[: len(left)], left, strict=True)]
        for mine, left in zip(every, fades, strict=True)
    ]


def simulated(case: Case, stand: Stand, points: Sequence[Point]) -> list[list[Shift]]:
    """Simulate the shifts of a case, point by point; ``points`` are its nominal ones."""
    engine = engine_of(case.engine, stand, case.truth)
    keep = case.form == "traces"
    return [
        [engine.shift(point, draw, keep) for draw in mine]
        for point, mine in zip(true_points(case, points), series_draws(case, stand), strict=True)
    ]


def write_field_case(
    folder: Path, base: Path, case: Case, points: Sequence[Point], shifts: list[list[Shift]]
) -> Times:
    """Write the data of a case; nothing of its truth is in them.

    Return the times in s as they stand beside the operating points, None for shifts that did not
    engage.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_stand_file(folder, base, case)
    ordered = case.form != "means"
    order = swapped(points) if case.swapped else list(range(len(points)))
    drawn = series_draws(case, read_stand(base))
    series = series_places(case)
    with (folder / "shifts.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow((*HEAD, *(["order"] if ordered else [])))
        for point, place in zip(points, order, strict=True):
            given = (f"{point.mismatch / RPM:.10g}", f"{point.force:.10g}", f"{point.rise:.10g}")
            where = place, series[place], drawn[place]
            rows = (
                _single_rows(folder, case, points[place], shifts[place], where)
                if ordered
                else mean_rows(shifts[place])
            )
            for row in rows:
                table.writerow((*given, *row))
    return [[shift.time for shift in shifts[place]] for place in order]


def bench_text(base: Path, name: str, errors: tuple[float, float] | None = None) -> str:
    """Write the base's ``bench.toml`` with another name and the sensor at the actuator.

    ``errors`` are the standard deviations of true over nominal force and mismatch, where the stand
    says them.
    """
    data: dict[str, Any] = tomllib.loads((base / "bench.toml").read_text(encoding="utf-8"))
    plain = {"name": name, "source": "withheld", **{k: data[k] for k in _PLAIN}}
    lines = [f"{key} = {_toml(value)}" for key, value in plain.items()]
    for table in ("dog", "sliding", "output", "contact"):
        lines += ["", f"[{table}]"]
        lines += [f"{key} = {_toml(value)}" for key, value in data[table].items()]
    record = {**data.get("record", {}), "displacement_at": "actuator"}
    lines += ["", "[record]", *(f"{key} = {_toml(value)}" for key, value in record.items()), ""]
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
    """List the place whose shifts stand beside each point: forces in reverse order."""
    found = list(range(len(points)))
    for mismatch in {point.mismatch for point in points}:
        mine = [k for k, point in enumerate(points) if point.mismatch == mismatch]
        mine.sort(key=lambda k: points[k].force)
        for place, source in zip(mine, reversed(mine), strict=True):
            found[place] = source
    return found


def write_stand_file(folder: Path, base: Path, case: Case) -> None:
    """Write ``bench.toml`` of a case, with the errors of its nominal values."""
    text = bench_text(base, folder.name, (case.force_error, case.speed_error))
    (folder / "bench.toml").write_text(text, encoding="utf-8")


def mean_rows(shifts: Sequence[Shift]) -> list[tuple[str, ...]]:
    """Write ``n_shifts``, ``shift_time_s``, ``engaged`` and ``trace`` of a mean's rows."""
    times = [shift.time for shift in shifts if shift.time is not None]
    failed = len(shifts) - len(times)
    found: list[tuple[str, ...]] = []
    if times:
        found.append((str(len(times)), f"{np.mean(times):.6f}", "true", ""))
    if failed:
        found.append((str(failed), "", "false", ""))
    return found


def _single_rows(
    folder: Path, case: Case, point: Point, shifts: Sequence[Shift], where: _Where
) -> list[tuple[str, ...]]:
    """Write ``n_shifts``, ``shift_time_s``, ``engaged``, ``trace`` and ``order`` of single shifts.

    ``where`` has the operating point's place, those of its shifts in the series, and its draws.
    """
    place, series, drawn = where
    found: list[tuple[str, ...]] = []
    for k, shift in enumerate(shifts):
        trace = ""
        if shift.motion is not None and shift.time is not None:
            trace = f"traces/{place:02d}_{k}.csv"
            _write_trace(folder / trace, case, point, shift, (place * 100 + k, drawn[k].fade))
        time = "" if shift.time is None else f"{shift.time:.6f}"
        engaged = "false" if shift.time is None else "true"
        found.append(("1", time, engaged, trace, str(series[k])))
    return found


def _write_trace(
    path: Path, case: Case, point: Point, shift: Shift, which: tuple[int, float]
) -> None:
    """Write a time series with the force that acted, sampled and with noise."""
    number, fade = which
    path.parent.mkdir(exist_ok=True)
    generator = np.random.default_rng((case.seed, number))
    rows = measured_rows(case.truth, point, shift, fade, generator)
    if rows is None:
        return
    head = "t_s,displacement_mm,force_N,sliding_speed_rpm,output_speed_rpm"
    np.savetxt(path, rows, fmt="%.6g", delimiter=",", header=head, comments="")


def measured_rows(
    truth: Truth, point: Point, shift: Shift, fade: float, generator: np.random.Generator
) -> Array | None:
    """Sample a trace with the force that a sensor at the actuator measures, with noise.

    The columns are s, mm, N and both speeds in 1/min, (n, 5). None for a shift that did not engage,
    or whose motion was not kept. ``fade`` is the share of the force that a drift has left.
    """
    motion, end = shift.motion, shift.time
    if motion is None or end is None:
        return None
    times = np.arange(0.0, end + AFTER, 1.0 / SAMPLING)
    columns = [np.interp(times, motion[:, 0], motion[:, k]) for k in (1, 3, 4)]
    noise = generator.normal(size=(3, len(times)))
    way = columns[0] / MM + NOISE[0] * noise[0]
    speeds = [one / RPM + NOISE[1] * noise[k] for k, one in enumerate(columns[1:], 1)]
    begin = float(motion[0, 0])  # the motion begins with the force
    force = fade * acting(truth, point, times - begin)
    force += FORCE_NOISE * point.force * generator.normal(size=len(force))
    return np.stack([times, way, force, *speeds], axis=1)


def acting(truth: Truth, point: Point, times: Array) -> Array:
    """Compute the force in N at times (n,) in s from its start: staged, lagged and scaled."""
    step = 1.0 / SAMPLING
    fine = np.arange(0.0, float(times.max()) + step, step)
    factor = truth.force_factor + truth.force_offset / point.force
    force = factor * np.array([signal(truth, point, t) for t in fine])
    if truth.lag:
        held, kept = 0.0, math.exp(-step / truth.lag)
        for k, now in enumerate(force.tolist()):
            held = now + (held - now) * kept
            force[k] = held
    return np.interp(times, fine, force, left=0.0)
