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

SAMPLING = 2000.0  #: 1/s, of traces
NOISE = (5e-3, 0.3)  #: standard deviation of a trace's displacement in mm and speeds in 1/min
AFTER = 0.005  #: s that a trace goes on after its shift
HEAD = ("mismatch_rpm", "force_N", "force_rise_s", "n_shifts", "shift_time_s", "engaged")
#: Added to a case's seed for the errors of its nominal values, and for the order of its shifts.
ERRORS, ORDER = 71, 72
FORCE_NOISE = 0.002  #: of the nominal force, standard deviation of a sample of the measured one
ANGLES = {"planar": 48, "mujoco": 20}  #: even ones, by engine
FAR, LEAST_FAR, SLOT = 8.0, 8e-3, 0.5  #: behind the median, from which a shift is late


def engine_of(name: str, stand: Stand, truth: Truth) -> Engine | PlanarEngine:
    """Make a stand with its truth in an engine, ``planar`` or ``mujoco``."""
    return PlanarEngine(stand, truth) if name == "planar" else Engine(stand, truth)


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
            hangs = truth.hang_time * bool(generator.random() < truth.hang)
            mine.append(Draw(angle, truth.sticking * float(late) + hangs, float(phase)))
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


def write_case(
    folder: Path, base: Path, case: Case, points: Sequence[Point], shifts: list[list[Shift]]
) -> list[list[float | None]]:
    """Write the data of a case; nothing of its truth is in them.

    Return the times in s as they stand beside the operating points, None for shifts that did not
    engage.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "bench.toml").write_text(bench_text(base, folder.name, case), encoding="utf-8")
    order, series = swapped(case, points), series_places(case)
    drawn = series_draws(case, read_stand(base))
    more = {"means": ["shift_time_sd_s"] if case.spreads else [], "traces": ["trace", "order"]}
    columns = (*HEAD, *more.get(case.form, ["order"]))
    with (folder / "shifts.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        table.writeheader()
        for point, place in zip(points, order, strict=True):
            given = {
                "mismatch_rpm": f"{point.mismatch / RPM:.10g}",
                "force_N": f"{point.force:.10g}",
                "force_rise_s": f"{point.rise:.10g}",
            }
            rows = (
                _mean_rows(shifts[place], spread=case.spreads)
                if case.form == "means"
                else [
                    {"n_shifts": 1, **_timed([shift]), "order": at}
                    for shift, at in zip(shifts[place], series[place], strict=True)
                ]
            )
            if case.form == "traces":
                for k, shift in enumerate(shifts[place]):
                    generator = np.random.default_rng((case.seed, place * 100 + k))
                    seen = measured_rows(
                        case.truth, points[place], shift, drawn[place][k].fade, generator
                    )
                    if seen is not None:
                        rows[k]["trace"] = f"traces/{place:02d}_{k}.csv"
                        (folder / "traces").mkdir(exist_ok=True)
                        head = "t_s,displacement_mm,force_N,sliding_speed_rpm,output_speed_rpm"
                        path = folder / rows[k]["trace"]
                        np.savetxt(path, seen, "%.6g", ",", header=head, comments="")
            table.writerows(given | row for row in rows)
    return [[shift.time for shift in shifts[place]] for place in order]


def _timed(shifts: Sequence[Shift]) -> dict[str, Any]:
    """Write ``shift_time_s`` and ``engaged`` of shifts of which all or none engaged."""
    times = [shift.time for shift in shifts if shift.time is not None]
    return {
        "shift_time_s": f"{np.mean(times):.6f}" if times else "",
        "engaged": "true" if times else "false",
    }


def _mean_rows(shifts: Sequence[Shift], *, spread: bool) -> list[dict[str, Any]]:
    """Write the rows of a mean: shifts that engaged, then those that did not."""
    having = [shift for shift in shifts if shift.time is not None]
    failed = [shift for shift in shifts if shift.time is None]
    rows = [{"n_shifts": len(some), **_timed(some)} for some in (having, failed) if some]
    if spread and len(having) > 1:
        times = [shift.time for shift in having if shift.time is not None]
        rows[0]["shift_time_sd_s"] = f"{np.std(times, ddof=1):.6f}"
    return rows


def bench_text(base: Path, name: str, case: Case | None = None) -> str:
    """Write the base's ``bench.toml`` with another name, and record and errors of a case."""
    data: dict[str, Any] = tomllib.loads((base / "bench.toml").read_text(encoding="utf-8"))
    tables: dict[str, dict[str, Any]] = {
        "": {
            "name": name,
            "source": "withheld",
            **{k: data[k] for k in ("timeout_s", "shift_travel_mm")},
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
    lines = list[str]()
    for head, keys in tables.items():
        lines += [f"[{head}]"] if head else []
        # Numbers and plain words, of which JSON and TOML write the same.
        lines += [*(f"{key} = {json.dumps(value)}" for key, value in keys.items()), ""]
    return "\n".join(lines)


def swapped(case: Case, points: Sequence[Point]) -> list[int]:
    """List the place whose shifts stand beside each point.

    It is its own, but for forces in reverse order at each mismatch, or mismatches at each force.
    """
    found = list(range(len(points)))
    if "swapped_forces" in case.outside:
        kept, turned = "mismatch", "force"
    elif "swapped_speeds" in case.outside:
        kept, turned = "force", "mismatch"
    else:
        return found
    for value in {getattr(point, kept) for point in points}:
        mine = [k for k, point in enumerate(points) if getattr(point, kept) == value]
        mine.sort(key=lambda k: getattr(points[k], turned))
        for place, source in zip(mine, reversed(mine), strict=True):
            found[place] = source
    return found


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
    force = acting(truth, truth.given(point, fade), times - begin)
    force += FORCE_NOISE * point.force * generator.normal(size=len(force))
    return np.stack([times, way, force, *speeds], axis=1)


def acting(truth: Truth, point: Point, times: Array) -> Array:
    """Compute the force in N at times (n,) in s from its start: staged, then lagged.

    ``point`` is the true one.
    """
    step = 1.0 / SAMPLING
    fine = np.arange(0.0, float(times.max()) + step, step)
    force = np.array([signal(truth, point, t) for t in fine])
    if truth.lag:
        held, kept = 0.0, math.exp(-step / truth.lag)
        for k, now in enumerate(force.tolist()):
            held = now + (held - now) * kept
            force[k] = held
    return np.interp(times, fine, force, left=0.0)


@dataclass(frozen=True)
class Expected:
    """Mean times and spreads of an engine without scatter, s, (points,); late shifts left out."""

    mean: Array
    sd: Array


def expected_of(case: Case, stand: Stand, points: Sequence[Point]) -> Expected:
    """Simulate the means that the engine of a case expects of its truth, as the table has them."""
    found, order = expected(case.engine, stand, points, case.truth), swapped(case, points)
    return Expected(found.mean[order], found.sd[order])


def expected(name: str, stand: Stand, points: Sequence[Point], truth: Truth) -> Expected:
    """Simulate even angles of nominal operating points, weighted as the truth draws them.

    A valve that sticks or hangs delays by its mean, and its own spread joins that of the angles.
    """
    engine, count = engine_of(name, stand, truth), ANGLES[name]
    turns = (np.arange(count) + 0.5) / count
    late, spread = truth.waiting
    # Phases of a ripple go round several times while the angles go round once.
    draws = [Draw(turn * stand.pitch, late, 2.0 * np.pi * (7.0 * turn % 1.0)) for turn in turns]
    times = np.array([[engine.shift(point, d).time for d in draws] for point in points], float)
    waits = np.array([min(stand.timeout, stand.pitch / abs(point.mismatch)) for point in points])
    weights = np.exp(truth.concentration * (np.cos(2.0 * np.pi * (turns - truth.centre)) - 1.0))
    return moments(timely(times, waits), weights, spread)


def timely(times: Array, waits: Array) -> Array:
    """Replace late shifts among times (points, n) by NaN.

    A late shift lies behind the median by half the time in which a slot passes, ``waits`` (points,)
    in s, and by ``FAR`` distances of the 10 % quantile from it.
    """
    known = np.isfinite(times).any(axis=1)
    fast, middle = np.full((2, len(times)), np.nan)
    fast[known], middle[known] = np.nanquantile(times[known], (0.1, 0.5), axis=1)
    far = np.maximum(FAR * (middle - fast), np.maximum(SLOT * waits, LEAST_FAR))
    return np.where(times > (middle + far)[:, None], np.nan, times)


def moments(times: Array, weights: Array, more: float = 0.0) -> Expected:
    """Compute mean and spread of times (points, n) with weights (n,); NaN stands for no shift.

    ``more`` is the standard deviation of a further delay, s.
    """
    having = np.isfinite(times)
    share = np.where(having.any(axis=1), (having * weights).sum(axis=1), np.nan)
    mean = (np.where(having, times, 0.0) * weights).sum(axis=1) / share
    apart = np.where(having, times - mean[:, None], 0.0)
    return Expected(mean, np.sqrt((apart**2 * weights).sum(axis=1) / share + more**2))
