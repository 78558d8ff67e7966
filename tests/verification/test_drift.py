"""Drift over the series: closed forms against joint normals, and verdicts with a planted one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm
from scipy.stats import t as student

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.likelihood.discrepancy import (
    Discrepancy,
    Slopes,
    beside_draws,
    discrepancy_prior,
    marginals,
    posterior_draws,
)
from dogshape.diagnosis.likelihood.drift import drift_of
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM
from tests.toy import EFFECTS, Toy, bench_of, points_of

SLIPS = np.array([5.0, 5.0, 25.0, 249.0]) * RPM
FORCES = np.array([235.2, 641.5, 235.2, 315.0])
MEANS = np.array([0.15, 0.12, 0.09, 0.05])
BESIDE = np.array([[0.01, -0.004], [0.002, 0.003], [-0.006, 0.002], [-0.004, 0.005]])
SD = np.array([0.004, 0.01, 0.002, 0.001])
NAMES = ("actuation_delay", "force_scale", "moving_mass", "sleeve_friction", "drag_torque")
POINTS = points_of()


def _prior() -> Discrepancy:
    return replace(discrepancy_prior(SLIPS, FORCES, MEANS, Rules()), beside=BESIDE)


def _members(prior: Discrepancy) -> list[tuple[float, Array]]:
    """Return probability and covariance of each member, without the errors beside."""
    return [
        (chance, size**2 * root @ root.T)
        for root, chances in zip(prior.roots, prior.prior, strict=True)
        for chance, size in zip(chances, prior.amplitudes, strict=True)
    ]


@pytest.mark.parametrize("own", [0.0, 0.003])
def test_errors_beside_the_discrepancy_have_the_density_of_joint_normals(own: float) -> None:
    generator, prior = np.random.default_rng(3), _prior()
    gaps = generator.normal(0.0, 0.01, (6, 4))
    joint = generator.normal(0.0, 1.0, (6, 4)) * own
    slopes = Slopes(gaps / SD**2, np.broadcast_to(SD**-2.0, gaps.shape))
    found = norm.logpdf(gaps, 0.0, SD).sum(axis=1) + marginals(slopes, prior, joint).log
    for row, mine, value in zip(gaps, joint, found, strict=True):
        whole = np.diag(SD**2) + np.outer(mine, mine) + BESIDE @ BESIDE.T
        density = sum(c * multivariate_normal(cov=whole + k).pdf(row) for c, k in _members(prior))
        assert value == pytest.approx(np.log(density), abs=1e-8)
    some = np.array([True, False, True, True])
    part = prior.of(some)
    assert part.covariance == pytest.approx(prior.covariance[np.ix_(some, some)])


def test_coefficients_given_the_data_are_those_of_joint_normals() -> None:
    prior, gaps, count = _prior(), np.array([0.012, 0.01, 0.006, 0.003]), 40_000
    slopes = Slopes(np.tile(gaps / SD**2, (count, 1)), np.tile(SD**-2.0, (count, 1)))
    generator, joint = np.random.default_rng(1), np.zeros((count, 4))
    off, _ = posterior_draws(slopes, prior, joint, generator)
    drawn = beside_draws(slopes, prior, joint, off, generator)
    weights, means, squares, offsets = [], [], [], []
    for chance, kernel in _members(prior):
        whole = kernel + np.diag(SD**2) + BESIDE @ BESIDE.T
        weights.append(chance * multivariate_normal(cov=whole).pdf(gaps))
        gain = np.linalg.solve(whole, BESIDE).T
        means.append(gain @ gaps)
        squares.append(means[-1] ** 2 + 1.0 - (gain * BESIDE.T).sum(axis=1))
        offsets.append(kernel @ np.linalg.solve(whole, gaps))
    share = np.array(weights) / np.sum(weights)
    assert drawn.mean(axis=0) == pytest.approx(share @ means, abs=0.02)
    assert (drawn**2).mean(axis=0) == pytest.approx(share @ squares, rel=0.03)
    assert off.mean(axis=0) == pytest.approx(share @ offsets, abs=2e-4)


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


def _diagnosed(bench: Bench) -> Diagnosis:
    points = tuple(cell.point for cell in bench.cells)
    return diagnose(bench, Toy(points), {n: EFFECTS[n] for n in NAMES}, pairs=[])


@pytest.mark.parametrize(("points", "shifts"), [(2, 2), (1, 3), (3, 2)])
def test_few_repeats_are_no_surer_of_a_drift_than_they_can_be(points: int, shifts: int) -> None:
    """Its 90 % interval holds the drift drawn, and of no drift a sign is rarely sure."""
    generator, rules = np.random.default_rng(1), Rules()
    held, said = [], []
    for true in [*generator.normal(0.0, rules.drift, 600).tolist(), *[0.0] * 600]:
        order = generator.permutation(np.repeat(np.arange(points), shifts))
        rows = []
        for place, k in enumerate(order):
            off = true * (place / (order.size - 1.0) - 0.5) + 0.03 * generator.standard_normal()
            time = 0.2 * (1.0 + k) * (1.0 + off)
            rows.append(Reading(place + 2, POINTS[k], 1, time, True, place=float(place)))
        found = drift_of(gather(rows), rules)
        assert found is not None
        score = abs(found.mean - true) / found.sd
        (held if true else said).append(score)
    assert np.mean(np.array(held) < norm.ppf(0.95)) == pytest.approx(0.88, abs=0.04)
    assert np.mean(np.array(said) > norm.ppf(0.99)) < 0.06


def test_what_repeated_points_say_is_a_regression_with_a_level_of_each() -> None:
    """Against generalised least squares with a free level of each point and the prior of d."""
    generator = np.random.default_rng(2)
    rows = [
        Reading(2, point, 1, float(time), True)
        for point, mean in zip(POINTS[12:16], (0.03, 0.04, 0.05, 0.06), strict=True)
        for time in generator.normal(mean, 0.1 * mean, 12)
    ]
    bench = _random(replace(bench_of({}, generator), cells=gather(rows)), 0.08)
    seen, cells = observe(bench).drift, bench.cells
    assert seen is not None
    assert not any(np.isnan(bulk(cell.times)).any() for cell in cells)
    columns, times, weights = [], [], []
    for k, cell in enumerate(cells):
        time = float(cell.times.mean())
        places = seen.places(cell.readings)
        fitted = cell.times - time - seen.mean * time * (places - places.mean())
        weights.append((float((fitted**2).sum()) / time**2, time, cell.times.size))
        for one, place in zip(cell.times, places, strict=True):
            columns.append([float(k == j) for j in range(len(cells))] + [time * place])
            times.append((one, k))
    common = sum(w[0] for w in weights) / (sum(w[2] - 1.0 for w in weights) - 1.0)
    # The slope has Student's distribution: its variance is raised to that 90 % interval.
    freedom = sum(w[2] - 1.0 for w in weights) - 1.0
    raised = (student.ppf(0.95, freedom) / norm.ppf(0.95)) ** 2
    sigmas = [raised * t**2 * (s + 4.0 * common) / (n + 3.0) for s, t, n in weights]
    precision = np.array([1.0 / sigmas[k] for _, k in times])
    design, values = np.array(columns), np.array([t for t, _ in times])
    matrix = design.T @ (precision[:, None] * design)
    matrix[-1, -1] += Rules().drift ** -2.0
    covariance = np.linalg.inv(matrix)
    found = covariance @ (design.T @ (precision * values))
    assert seen.mean == pytest.approx(found[-1], rel=1e-3, abs=1e-5)
    assert seen.sd == pytest.approx(covariance[-1, -1] ** 0.5, rel=1e-3)


def test_the_drift_of_true_sets_lies_within_its_interval() -> None:
    scores = []
    for seed in range(40):
        generator = np.random.default_rng(seed)
        drift = 0.1 * generator.standard_normal()
        bench = bench_of({}, generator, shifts=9, single=True, points=POINTS[::3])
        seen = observe(_random(bench, drift, seed)).drift
        assert seen is not None
        scores.append((seen.mean - drift) / seen.sd)
    assert 0.7 < np.std(scores) < 1.4
    assert abs(np.mean(scores)) < 0.5


@pytest.mark.parametrize(("single", "shifts"), [(True, 40), (False, 100)])
def test_a_planted_drift_is_found_and_no_effect_is_named(single: bool, shifts: int) -> None:
    bench = bench_of({}, np.random.default_rng(1), shifts=shifts, single=single)
    found = _diagnosed(_random(bench, 0.2))
    drift = found.drift
    assert drift is not None
    assert found.verdict.kind in ("none", "ambiguous")
    assert not found.verdict.causes
    assert drift.share.low < 0.2 < drift.share.high
    assert drift.significant
    assert found.as_dict()["drift"]["slope_s"]["median"] == pytest.approx(drift.slope.median)
    assert f"drift by {1e3 * drift.slope.median:+.2g} ms" in found.as_dict()["summary"]
    assert "repeat a reference point" in drift.sentence
    assert not drift.in_order_of


def test_an_effect_beside_a_drift_keeps_its_name_and_size() -> None:
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(1), shifts=10, single=True)
    found = _diagnosed(_random(bench, 0.15))
    assert found.verdict.causes == ("actuation_delay",)
    size = found.intervals[("actuation_delay",)]["delay_s"]
    assert size.low < 0.085
    assert size.high > 0.075
    assert found.drift is not None
    assert found.drift.share.low < 0.15 < found.drift.share.high


def test_points_in_the_order_of_their_mismatch_are_told_and_a_reference_mends_it() -> None:
    bench = bench_of({}, np.random.default_rng(1), shifts=10)
    sorted_ = _ordered(bench, range(len(bench.readings)), 0.0)
    found = _diagnosed(sorted_).drift
    assert found is not None
    assert found.in_order_of == ("mismatch",)
    assert "cannot be told from an effect over mismatch" in found.sentence
    assert not found.significant
    # The same with three visits to a reference point of small scatter.
    places = [float(k) for k in range(len(bench.readings))]
    visits = [(r, p) for r, p in zip(bench.readings, places, strict=True)]
    point = POINTS[-1]
    generator = np.random.default_rng(4)
    for place in (-1.0, 13.5, 28.0):
        own = bench_of({}, generator, shifts=10, single=True, points=[point])
        visits += [(r, place) for r in own.readings]
    rows = [replace(r, row=k + 2, place=p) for k, (r, p) in enumerate(visits)]
    mended = _diagnosed(replace(bench, cells=gather(rows))).drift
    assert mended is not None
    assert mended.in_order_of == ()
    assert mended.share.high - mended.share.low < found.share.high - found.share.low


def test_without_an_order_nothing_is_said_of_a_drift() -> None:
    bench = bench_of({"delay_s": 0.03}, np.random.default_rng(1), shifts=10)
    plain = _diagnosed(bench)
    assert plain.drift is None
    assert "drift" not in plain.as_dict()
    assert drift_of(bench.cells, Rules()) is None
    same = [replace(r, place=3.0) for r in bench.readings]
    assert drift_of(gather(same), Rules()) is None
    assert drift_of(_random(bench, 0.1).cells, Rules(drift=0.0)) is None


def test_a_trend_that_no_time_could_have_leaves_times_above_zero() -> None:
    point = POINTS[0]
    rows = [
        Reading(k + 2, point, 1, 0.5 if k < 3 else 0.01, True, place=float(k)) for k in range(6)
    ]
    seen = observe(replace(bench_of({}, np.random.default_rng(0)), cells=gather(rows)))
    assert np.isfinite(seen.mean).all()
    assert seen.mean[0] > 0.0
