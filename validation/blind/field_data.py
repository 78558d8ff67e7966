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
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.units import RPM
from dogshape.validation.blind.data import (
    HEAD,
    SAMPLING,
    bench_text,
    draws,
    mean_rows,
    swapped,
    trace_rows,
)
from dogshape.validation.blind.field_cases import FieldCase
from dogshape.validation.blind.mujoco_shift import Draw, Shift, signal
from dogshape.validation.blind.stand import Point, Stand, Truth, read_stand
from dogshape.validation.blind.truth_engines import engine_of

Array = NDArray[np.float64]
Times = list[list[float | None]]
_Where = tuple[int, Sequence[int], Sequence[Draw]]

#: Added to a case's seed for the errors of its nominal values, and for the order of its shifts.
ERRORS, ORDER = 71, 72
FORCE_NOISE = 0.002  #: of the nominal force, standard deviation of a sample of the measured one


def true_points(case: FieldCase, points: Sequence[Point]) -> tuple[Point, ...]:
    """Draw force and mismatch that a series really has at its nominal operating points."""
    generator = np.random.default_rng((case.case.seed, ERRORS))
    off = generator.normal(size=(len(points), 2)) * (case.force_error, case.speed_error)
    return tuple(
        replace(point, force=point.force * (1.0 + force), mismatch=point.mismatch * (1.0 + speed))
        for point, (force, speed) in zip(points, off.tolist(), strict=True)
    )


def series_places(case: FieldCase) -> list[list[int]]:
    """Draw the place of each shift in the test series from 1 on, point by point."""
    total = sum(case.numbers)
    generator = np.random.default_rng((case.case.seed, ORDER))
    every = generator.permutation(total) if case.shuffled else np.arange(total)
    parts = np.split(every + 1, np.cumsum(case.numbers)[:-1])
    return [part.tolist() for part in parts]


def series_draws(case: FieldCase, stand: Stand) -> list[list[Draw]]:
    """Draw all shifts of a case, point by point; a drift goes by the place in the series."""
    truth, numbers = case.case.truth, case.numbers
    steady = replace(truth, drift=0.0)
    every = draws(steady, stand, len(numbers), max(numbers), case.case.seed)
    last = max(1, sum(numbers) - 1)
    fades = [[1.0 - truth.drift * (k - 1) / last for k in mine] for mine in series_places(case)]
    return [
        [replace(draw, fade=fade) for draw, fade in zip(mine[: len(left)], left, strict=True)]
        for mine, left in zip(every, fades, strict=True)
    ]


def simulated(case: FieldCase, stand: Stand, points: Sequence[Point]) -> list[list[Shift]]:
    """Simulate the shifts of a case, point by point; ``points`` are its nominal ones."""
    engine = engine_of(case.engine, stand, case.case.truth)
    keep = case.case.form == "traces"
    return [
        [engine.shift(point, draw, keep) for draw in mine]
        for point, mine in zip(true_points(case, points), series_draws(case, stand), strict=True)
    ]


def write_field_case(
    folder: Path, base: Path, case: FieldCase, points: Sequence[Point], shifts: list[list[Shift]]
) -> Times:
    """Write the data of a case; nothing of its truth is in them.

    Return the times in s as they stand beside the operating points, None for shifts that did not
    engage.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_stand_file(folder, base, case)
    ordered = case.case.form != "means"
    order = swapped(points) if case.case.swapped else list(range(len(points)))
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


def write_stand_file(folder: Path, base: Path, case: FieldCase) -> None:
    """Write ``bench.toml`` of a case, with the errors of its nominal values."""
    text = bench_text(base, folder.name, (case.force_error, case.speed_error))
    (folder / "bench.toml").write_text(text, encoding="utf-8")


def _single_rows(
    folder: Path, case: FieldCase, point: Point, shifts: Sequence[Shift], where: _Where
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
    path: Path, case: FieldCase, point: Point, shift: Shift, which: tuple[int, float]
) -> None:
    """Write a time series with the force that acted, sampled and with noise."""
    number, fade = which
    path.parent.mkdir(exist_ok=True)
    generator = np.random.default_rng((case.case.seed, number))
    rows = measured_rows(case.case.truth, point, shift, fade, generator)
    if rows is None:
        return
    head = "t_s,displacement_mm,force_N,sliding_speed_rpm,output_speed_rpm"
    np.savetxt(path, rows, fmt="%.6g", delimiter=",", header=head, comments="")


def measured_rows(
    truth: Truth, point: Point, shift: Shift, fade: float, generator: np.random.Generator
) -> Array | None:
    """Return a sampled trace with the force that a sensor at the actuator measures, (n, 5).

    ``fade`` is what a drift has left of the force. Columns and None are those of ``trace_rows``.
    """
    rows = trace_rows(point, shift, generator)
    if rows is None or shift.motion is None:
        return None
    begin = float(shift.motion[0, 0])  # the motion begins with the force
    force = fade * acting(truth, point, rows[:, 0] - begin)
    rows[:, 2] = force + FORCE_NOISE * point.force * generator.normal(size=len(force))
    return rows


def acting(truth: Truth, point: Point, times: Array) -> Array:
    """Return the force in N at times (n,) in s from its start: staged, lagged and scaled."""
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
