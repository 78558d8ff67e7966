"""Drift over the series: a regression in closed form, intervals, and verdicts with one planted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from dogshape.diagnosis.bench.bench_data import Bench, Reading, gather
from dogshape.diagnosis.likelihood.observed import DRIFT, Drift, drift_of
from tests.diagnosed import simulated_bench, simulated_diagnosis
from tests.toy import bench_of, points_of

POINTS = points_of()
NEVER = 10.0  #: s behind the median, from which a shift is late


def _drift(bench: Bench) -> Drift | None:
    return drift_of(bench.cells, np.full(len(bench.cells), NEVER))


def _ordered(bench: Bench, places: Sequence[float], drift: float) -> Bench:
    """Return a bench whose readings have places, and times that drift over the series."""
    ends = min(places), max(places)
    middle = np.mean(places)
    rows = []
    for reading, place in zip(bench.readings, places, strict=True):
        assert reading.time is not None
        off = drift * (place - middle) / (ends[1] - ends[0])
        rows.append(replace(reading, place=float(place), time=reading.time * (1.0 + off)))
    return replace(bench, cells=gather(rows))


def _random(bench: Bench, drift: float, seed: int = 5) -> Bench:
    places = np.random.default_rng(seed).permutation(len(bench.readings))
    return _ordered(bench, places.tolist(), drift)


@pytest.mark.parametrize(("points", "shifts"), [(2, 4), (1, 6), (4, 3)])
def test_few_repeats_are_no_surer_of_a_drift_than_they_can_be(points: int, shifts: int) -> None:
    """The 90 % interval holds the drift drawn."""
    generator, held = np.random.default_rng(1), []
    for true in generator.normal(0.0, DRIFT, 600).tolist():
        order, rows = generator.permutation(np.repeat(np.arange(points), shifts)), []
        for place, k in enumerate(order):
            off = true * (place / (order.size - 1.0) - 0.5) + 0.03 * generator.standard_normal()
            time = 0.2 * (1.0 + k) * (1.0 + off)
            rows.append(Reading(place + 2, POINTS[k], 1, time, True, place=float(place)))
        found = drift_of(gather(rows), np.full(points, NEVER))
        assert found is not None
        held.append(abs(found.mean - true) / found.sd < norm.ppf(0.95))
    assert np.mean(held) == pytest.approx(0.88, abs=0.04)


def test_what_repeated_points_say_is_a_regression_with_a_level_of_each() -> None:
    """Against generalised least squares with a free level of each point and the prior of d."""
    generator = np.random.default_rng(2)
    rows = [
        Reading(2, point, 1, float(time), True)
        for point, mean in zip(POINTS[12:16], (0.03, 0.04, 0.05, 0.06), strict=True)
        for time in generator.normal(mean, 0.1 * mean, 12)
    ]
    bench = _random(replace(bench_of({}, generator), cells=gather(rows)), 0.08)
    seen, cells = _drift(bench), bench.cells
    assert seen is not None
    columns, values, freedom = [], [], -1.0
    for k, cell in enumerate(cells):
        time, places = float(cell.times.mean()), seen.places[k]
        freedom += cell.times.size - 1.0
        for one, place in zip(cell.times, places, strict=True):
            columns.append([float(k == j) for j in range(len(cells))] + [place])
            values.append(one / time)
    design = np.array(columns)
    fitted = np.linalg.lstsq(design, np.array(values), rcond=None)[0]
    left = float(((np.array(values) - design @ fitted) ** 2).sum())
    sigma = (student.ppf(0.95, freedom) / norm.ppf(0.95)) ** 2 * left / freedom
    matrix = design.T @ design / sigma
    matrix[-1, -1] += DRIFT**-2.0
    covariance = np.linalg.inv(matrix)
    found = covariance @ (design.T @ np.array(values)) / sigma
    assert seen.mean == pytest.approx(found[-1], rel=1e-6)
    assert seen.sd == pytest.approx(covariance[-1, -1] ** 0.5, rel=1e-6)


def _repeated(cause: Mapping[str, Mapping[str, float]]) -> Bench:
    """Visit each operating point three times, each time with a mean of its own."""
    every = [simulated_bench(cause, seed) for seed in (1, 2, 3)]
    rows = [r for bench in every for r in bench.readings]
    return replace(every[0], cells=gather([replace(r, row=k) for k, r in enumerate(rows, 2)]))


@pytest.mark.parametrize(("delay", "planted"), [(0.0, 0.2), (0.08, 0.15)])
def test_a_planted_drift_is_found_and_leaves_an_effect_its_name(
    delay: float, planted: float
) -> None:
    found = simulated_diagnosis(
        _random(_repeated({"actuation_delay": {"delay_s": delay}}), planted)
    )
    share = found.to_dict()["drift"]["share"]
    assert 0.0 < share["low"] < planted < share["high"]
    assert found.verdict.causes == (("actuation_delay",) if delay else ())
    if delay:
        size = found.sizes["actuation_delay"]["delay_s"]
        assert size.low - 0.005 < delay < size.high + 0.005


def test_without_an_order_or_repeats_nothing_is_known_of_a_drift() -> None:
    """The prior is all that is known, and an error that all points have in common."""
    bench = simulated_bench({"actuation_delay": {"delay_s": 0.03}})
    assert simulated_diagnosis(bench).to_dict()["drift"] is None
    same = [replace(r, place=3.0) for r in bench.readings]
    assert _drift(replace(bench, cells=gather(same))) is None
    once = simulated_bench({})
    found = _drift(_random(once, 0.0))
    assert found is not None
    assert (found.mean, found.sd, found.informed) == pytest.approx((0.0, DRIFT, 0.0))
    assert abs(found.offsets).max() < DRIFT * max(cell.time or 0.0 for cell in once.cells)
