"""Data of a field case: its test series, simulated and written as a stand gives it.

Its expected data are mean times and spreads of a truth without scatter, at even relative angles.

A test series goes through the operating points in the order of the table, or makes all shifts in
random order; ``order`` is the place of each single shift in it. The true force and mismatch of an
operating point are off its nominal ones by an error of their own. Traces have the force that acts,
as a sensor at the actuator measures it: with its delay, its lag, its stages and the share that a
drift has left.
"""

from __future__ import annotations

import csv
import json
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.units import MM, RPM
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.mujoco_shift import Draw, Engine, Shift, signal
from dogshape.validation.blind.planar_shift import PlanarEngine
from dogshape.validation.blind.stand import Point, Stand, Truth, read_stand

Array = NDArray[np.float64]

SAMPLING_RATE = 2000.0  #: of traces, 1/s
NOISE = (5e-3, 0.3)  #: standard deviation of a trace's displacement in mm and speeds in 1/min
TRACE_END_S = 0.005  #: duration of a trace after its shift
HEAD = ("mismatch_rpm", "force_N", "force_rise_s", "n_shifts", "shift_time_s", "engaged")
TRACE_HEAD = "t_s,displacement_mm,force_N,sliding_speed_rpm,output_speed_rpm"
ERROR_SEED = 71  #: beside a case's seed, of the errors of its nominal values
ORDER_SEED = 72  #: beside a case's seed, of the order of its shifts
FORCE_NOISE = 0.002  #: standard deviation of a sample of the measured force, of the nominal one
ANGLE_COUNTS = {"planar": 48, "mujoco": 20}  #: even angles of expected data, by engine
LATE_QUANTILES = 8.0  #: of a late shift: delay over the distance of 10 % quantile and median
LATE_SLOTS = 0.5  #: of a late shift: delay over the time in which a slot passes
MIN_LATE_DELAY_S = 8e-3  #: of a late shift behind the median


def engine_of(name: str, stand: Stand, truth: Truth) -> Engine | PlanarEngine:
    """Build a stand with its truth in an engine, ``planar`` or ``mujoco``."""
    return PlanarEngine(stand, truth) if name == "planar" else Engine(stand, truth)


def true_points(case: Case, points: Sequence[Point]) -> tuple[Point, ...]:
    """Draw the true operating points of a series at nominal ones."""
    generator = np.random.default_rng((case.seed, ERROR_SEED))
    errors = generator.normal(size=(len(points), 2)) * (case.force_error, case.speed_error)
    return tuple(
        replace(point, force=point.force * (1.0 + force), mismatch=point.mismatch * (1.0 + speed))
        for point, (force, speed) in zip(points, errors.tolist(), strict=True)
    )


def series_places(case: Case) -> list[list[int]]:
    """Draw the position of each shift in the test series, from 1, by operating point."""
    total = sum(case.numbers)
    generator = np.random.default_rng((case.seed, ORDER_SEED))
    order = generator.permutation(total) if case.shuffled else np.arange(total)
    return [places.tolist() for places in np.split(order + 1, np.cumsum(case.numbers)[:-1])]


def draw_shifts(
    truth: Truth, stand: Stand, *, point_count: int, shift_count: int, seed: int
) -> list[list[Draw]]:
    """Draw angle, delay and phase of the shifts of each operating point."""
    generator = np.random.default_rng(seed)
    return [
        [_draw_shift(truth, stand, generator) for _ in range(shift_count)]
        for _ in range(point_count)
    ]


def _draw_shift(truth: Truth, stand: Stand, generator: np.random.Generator) -> Draw:
    turn = generator.vonmises(2.0 * math.pi * truth.centre, truth.concentration)
    sticking = generator.exponential()
    phase = generator.uniform(0.0, 2.0 * math.pi)
    angle = float(turn % (2.0 * math.pi)) / (2.0 * math.pi) * stand.pitch
    delay = truth.sticking * float(sticking)
    if generator.random() < truth.hang:
        delay += truth.hang_time
    return Draw(angle, delay, float(phase))


def series_draws(case: Case, stand: Stand) -> list[list[Draw]]:
    """Draw the shifts of a case by operating point, in the order of the series."""
    truth = case.truth
    draws = draw_shifts(
        truth,
        stand,
        point_count=len(case.numbers),
        shift_count=max(case.numbers),
        seed=case.seed,
    )
    series = []
    for point_draws, shares in zip(draws, series_progress(case), strict=True):
        pairs = zip(point_draws, shares, strict=False)
        series.append([replace(draw, progress=share) for draw, share in pairs])
    return series


def series_progress(case: Case) -> list[list[float]]:
    """Compute the share of the series before each shift, by operating point."""
    last = max(1, sum(case.numbers) - 1)
    return [[(place - 1) / last for place in places] for places in series_places(case)]


def simulate_case(case: Case, stand: Stand, points: Sequence[Point]) -> list[list[Shift]]:
    """Simulate the shifts of a case at its nominal operating points, by point."""
    engine = engine_of(case.engine, stand, case.truth)
    keep = case.form == "traces"
    shifts = []
    for point, draws in zip(true_points(case, points), series_draws(case, stand), strict=True):
        shifts.append([engine.shift(point, draw, keep) for draw in draws])
    return shifts


def write_case(
    folder: Path, base: Path, case: Case, points: Sequence[Point], shifts: list[list[Shift]]
) -> list[list[float | None]]:
    """Write the data of a case without its truth.

    ``points`` are the nominal operating points, ``shifts`` those of each. Returns the times beside
    each operating point, s, None for shifts that did not engage.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "bench.toml").write_text(bench_text(base, folder.name, case), encoding="utf-8")
    order = table_order(case, points)
    series = series_places(case)
    draws = series_draws(case, read_stand(base))
    with (folder / "shifts.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, _columns(case), restval="", lineterminator="\n")
        table.writeheader()
        for point, place in zip(points, order, strict=True):
            inputs = {
                "mismatch_rpm": f"{point.mismatch / RPM:.10g}",
                "force_N": f"{point.force:.10g}",
                "force_rise_s": f"{point.rise:.10g}",
            }
            if case.form == "means":
                rows = _mean_rows(shifts[place], spread=case.spreads)
            else:
                rows = _single_rows(shifts[place], series[place])
            if case.form == "traces":
                names = _write_traces(
                    folder,
                    case,
                    place=place,
                    point=points[place],
                    shifts=shifts[place],
                    draws=draws[place],
                )
                for row, name in zip(rows, names, strict=True):
                    if name:
                        row["trace"] = name
            table.writerows(inputs | row for row in rows)
    return [[shift.time for shift in shifts[place]] for place in order]


def _columns(case: Case) -> tuple[str, ...]:
    """List the columns of a case's table of shifts."""
    if case.form == "traces":
        return (*HEAD, "trace", "order")
    if case.form == "singles":
        return (*HEAD, "order")
    return (*HEAD, "shift_time_sd_s") if case.spreads else HEAD


def _write_traces(
    folder: Path,
    case: Case,
    *,
    place: int,
    point: Point,
    shifts: Sequence[Shift],
    draws: Sequence[Draw],
) -> list[str]:
    """Write the traces at an index of points; return the path of each, '' without a trace."""
    names = []
    for k, (shift, draw) in enumerate(zip(shifts, draws, strict=True)):
        generator = np.random.default_rng((case.seed, place * 100 + k))
        rows = measured_rows(case.truth, point, shift, progress=draw.progress, generator=generator)
        if rows is None:
            names.append("")
            continue
        names.append(f"traces/{place:02d}_{k}.csv")
        (folder / "traces").mkdir(exist_ok=True)
        np.savetxt(folder / names[-1], rows, "%.6g", ",", header=TRACE_HEAD, comments="")
    return names


def _engagement(shifts: Sequence[Shift]) -> dict[str, Any]:
    """Write ``shift_time_s`` and ``engaged`` of shifts of which all or none engaged."""
    times = [shift.time for shift in shifts if shift.time is not None]
    return {
        "shift_time_s": f"{np.mean(times):.6f}" if times else "",
        "engaged": "true" if times else "false",
    }


def _single_rows(shifts: Sequence[Shift], series: Sequence[int]) -> list[dict[str, Any]]:
    """Write a row of each shift with its position in the series."""
    return [
        {"n_shifts": 1, **_engagement([shift]), "order": position}
        for shift, position in zip(shifts, series, strict=True)
    ]


def _mean_rows(shifts: Sequence[Shift], *, spread: bool) -> list[dict[str, Any]]:
    """Write the rows of a mean: shifts that engaged, then those that did not."""
    engaged = [shift for shift in shifts if shift.time is not None]
    failed = [shift for shift in shifts if shift.time is None]
    rows = [{"n_shifts": len(group), **_engagement(group)} for group in (engaged, failed) if group]
    if spread and len(engaged) > 1:
        times = [shift.time for shift in engaged if shift.time is not None]
        rows[0]["shift_time_sd_s"] = f"{np.std(times, ddof=1):.6f}"
    return rows


def bench_text(base: Path, name: str, case: Case | None = None) -> str:
    """Write the ``bench.toml`` of a base under a new name, with record and errors of a case."""
    data: dict[str, Any] = tomllib.loads((base / "bench.toml").read_text(encoding="utf-8"))
    tables: dict[str, dict[str, Any]] = {
        "": {
            "name": name,
            "source": "withheld",
            "timeout_s": data["timeout_s"],
            "shift_travel_mm": data["shift_travel_mm"],
        },
        **{table: data[table] for table in ("dog", "sliding", "output", "contact")},
    }
    if case is not None:
        tables["record"] = {
            "time_zero": case.time_zero,
            "displacement_at": case.displacement_at,
            "empty_cells": "failed",
        }
        tables["errors.each_point"] = {
            "force_percent": round(100.0 * case.force_error, 3),
            "mismatch_percent": round(100.0 * case.speed_error, 3),
        }
    lines = []
    for head, keys in tables.items():
        if head:
            lines.append(f"[{head}]")
        # JSON and TOML write numbers and simple strings alike.
        lines += [f"{key} = {json.dumps(value)}" for key, value in keys.items()]
        lines.append("")
    return "\n".join(lines)


def table_order(case: Case, points: Sequence[Point]) -> list[int]:
    """List the index of the shifts beside each operating point of the table.

    A case with swapped forces has those at each mismatch in reverse order, one with swapped speeds
    the mismatches at each force.
    """
    order = list(range(len(points)))
    if "swapped_forces" in case.outside:
        common, reversed_key = "mismatch", "force"
    elif "swapped_speeds" in case.outside:
        common, reversed_key = "force", "mismatch"
    else:
        return order
    for value in {getattr(point, common) for point in points}:
        group = [k for k, point in enumerate(points) if getattr(point, common) == value]
        group.sort(key=lambda k: getattr(points[k], reversed_key))
        for place, source in zip(group, reversed(group), strict=True):
            order[place] = source
    return order


def measured_rows(
    truth: Truth, point: Point, shift: Shift, *, progress: float, generator: np.random.Generator
) -> Array | None:
    """Sample a trace with the force at a sensor of the actuator, with noise, (n, 5).

    The columns are time, s, displacement, mm, force, N, and speeds of sliding and output ring,
    1/min. None for a shift that did not engage, or without motion. ``progress`` is the share of
    the series that is past.
    """
    motion = shift.motion
    if motion is None or shift.time is None:
        return None
    times = np.arange(0.0, shift.time + TRACE_END_S, 1.0 / SAMPLING_RATE)
    displacement, sliding, output = (
        np.interp(times, motion[:, 0], motion[:, k]) for k in (1, 3, 4)
    )
    noise = generator.normal(size=(3, len(times)))
    force_start = float(motion[0, 0])
    force = acting_force(truth, truth.apply(point, progress), times - force_start)
    force += FORCE_NOISE * point.force * generator.normal(size=len(force))
    columns = [
        times,
        displacement / MM + NOISE[0] * noise[0],
        force,
        sliding / RPM + NOISE[1] * noise[1],
        output / RPM + NOISE[1] * noise[2],
    ]
    return np.stack(columns, axis=1)


def acting_force(truth: Truth, point: Point, times: Array) -> Array:
    """Compute the force at a true operating point, staged, then lagged, N, (n,).

    ``times`` (n,) are from the start of the force, s.
    """
    step = 1.0 / SAMPLING_RATE
    samples = np.arange(0.0, float(times.max()) + step, step)
    force = np.array([signal(truth, point, t) for t in samples])
    if truth.lag:
        lagged = 0.0
        decay = math.exp(-step / truth.lag)
        for k, target in enumerate(force.tolist()):
            lagged = target + (lagged - target) * decay
            force[k] = lagged
    return np.interp(times, samples, force, left=0.0)


@dataclass(frozen=True)
class Expected:
    """Mean times and spreads of an engine without scatter and late shifts, s, (points,)."""

    mean: Array
    sd: Array


def expect_case(case: Case, stand: Stand, points: Sequence[Point]) -> Expected:
    """Simulate the expected data of a case's truth in the order of its table."""
    expected = expect(case.engine, stand, points, case.truth, mean_progress(case))
    order = table_order(case, points)
    return Expected(expected.mean[order], expected.sd[order])


def mean_progress(case: Case) -> list[float]:
    """Compute the mean share of the series that is past at each operating point."""
    return [float(np.mean(shares)) for shares in series_progress(case)]


def expect(
    name: str, stand: Stand, points: Sequence[Point], truth: Truth, progress: Sequence[float]
) -> Expected:
    """Simulate nominal operating points at even angles, weighted by the truth.

    ``progress`` is the share of the series that is past at each point.
    A valve that sticks or hangs delays by its mean; its spread is added to that of the angles.
    """
    engine = engine_of(name, stand, truth)
    count = ANGLE_COUNTS[name]
    turns = (np.arange(count) + 0.5) / count
    delay, delay_sd = truth.delay_moments
    # Phases of a ripple go round several times while the angles go round once.
    draws = [Draw(turn * stand.pitch, delay, 2.0 * np.pi * (7.0 * turn % 1.0)) for turn in turns]
    times = np.empty((len(points), count))
    for row, point, share in zip(times, points, progress, strict=True):
        point_draws = [replace(draw, progress=share) for draw in draws]
        row[:] = np.array([engine.shift(point, draw).time for draw in point_draws], dtype=float)
    waits = np.array([min(stand.timeout, stand.pitch / abs(point.mismatch)) for point in points])
    weights = np.exp(truth.concentration * (np.cos(2.0 * np.pi * (turns - truth.centre)) - 1.0))
    return moments(mask_late(times, waits), weights, delay_sd)


def mask_late(times: Array, waits: Array) -> Array:
    """Replace late shifts among times (points, n) by NaN.

    ``waits`` are the times in which a slot passes, s, (points,). A late shift is behind the median
    by ``LATE_SLOTS`` of it and by ``LATE_QUANTILES`` distances of the 10 % quantile.
    """
    engaged = np.isfinite(times).any(axis=1)
    fast, median = np.full((2, len(times)), np.nan)
    fast[engaged], median[engaged] = np.nanquantile(times[engaged], (0.1, 0.5), axis=1)
    min_delay = np.maximum(LATE_SLOTS * waits, MIN_LATE_DELAY_S)
    late_delay = np.maximum(LATE_QUANTILES * (median - fast), min_delay)
    return np.where(times > (median + late_delay)[:, None], np.nan, times)


def moments(times: Array, weights: Array, delay_sd: float = 0.0) -> Expected:
    """Compute mean and spread of times (points, n), NaN without a shift, with weights (n,).

    ``delay_sd`` is the standard deviation of an independent delay, s.
    """
    engaged = np.isfinite(times)
    share = np.where(engaged.any(axis=1), (engaged * weights).sum(axis=1), np.nan)
    mean = (np.where(engaged, times, 0.0) * weights).sum(axis=1) / share
    deviation = np.where(engaged, times - mean[:, None], 0.0)
    return Expected(mean, np.sqrt((deviation**2 * weights).sum(axis=1) / share + delay_sd**2))
