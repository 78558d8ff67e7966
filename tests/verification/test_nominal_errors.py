"""Errors of gaps, of nominal values and by drift: derivatives, variances, and verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from dogshape.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.bench.stand_file import NominalErrors, Tolerance
from dogshape.diagnosis.comparison import compare
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import Drift, estimate_drift, observe
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import RPM
from tests.analytic import flight_time, mean_time, select_cells, simulate_analytic
from tests.diagnoses import EFFECTS, FEW_EFFECTS, simulated_bench, simulated_diagnosis
from tests.toy import bench_of, points_of

POINTS = points_of()
BOTH = Tolerance(force_percent=2.0, force_N=3.0, mismatch_percent=1.0, mismatch_rpm=0.5)
PLAIN = np.zeros((1, 0))


def _smooth(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate the mean times of the closed form, with a spread of a tenth over the angles."""
    found = []
    for block in blocks:
        whole, count = mean_time(block.clutch, block.point), len(block.angles)
        wave = 1.0 + 0.1 * np.sin(2.0 * np.pi * np.arange(count) / count)
        found.append([{"outcome": "engaged", "shift_time_s": float(time)} for time in whole * wave])
    return found


def _likelihood(bench: Bench) -> Likelihood:
    effects = {name: EFFECTS[name] for name in FEW_EFFECTS}
    (model,) = build_models(bench, effects, USUAL, _smooth).values()
    return Likelihood(bench, observe(bench, model), model, USUAL)


def test_the_likelihood_takes_slopes_of_the_simulated_force_and_mismatch() -> None:
    """The closed form: a flight over the fourth root of the force, a wait over the mismatch."""
    bench = simulated_bench({})
    force, mismatch = _likelihood(bench).sensitivity
    for k, cell in enumerate(bench.cells):
        mean = mean_time(bench.clutch, cell.point)
        free = flight_time(bench.clutch, cell.point)
        assert force[k] == pytest.approx(-0.25 * free / mean, rel=0.1)
        slip = cell.point.mismatch
        # Levels err by their angles, so a slope by a hundredth of the time over that of mismatch.
        assert mismatch[k] * slip == pytest.approx((free - mean) / mean, rel=0.1, abs=0.01)


def test_errors_add_up_as_asme_says() -> None:
    """u_input^2 is the sum of (dT/dX u_X)^2: in the variance, or in columns in common."""
    plain = simulated_bench({})
    bench = replace(plain, errors=NominalErrors(systematic=BOTH, each_point=BOTH))
    exact, stated = _likelihood(plain), _likelihood(bench)
    slope, speed = stated.sensitivity
    force = np.array([cell.point.profile.force for cell in bench.cells])
    slip = np.array([cell.point.mismatch for cell in bench.cells])
    p = stated.model.predict(NONE, PLAIN)
    shares = [slope * 0.02, slope / force * 3.0, speed * slip * 0.01, speed * 0.5 * RPM]
    parts = [p.mean[0] * share for share in shares]
    more = (stated.mean_variance(p) - exact.mean_variance(p))[0]
    assert more == pytest.approx(sum(part**2 for part in parts))
    both = [one.common_errors(p)[0] for one in (stated, exact)]
    covariance = both[0] @ both[0].T - both[1] @ both[1].T
    assert covariance == pytest.approx(sum(np.outer(c, c) for c in parts), rel=1e-6, abs=1e-12)


def test_a_force_within_its_tolerance_is_no_effect_and_one_beyond_it_is() -> None:
    """Half the force, where its error is a share of it."""
    plain = simulated_bench({"force_scale": {"force_factor": 0.5}})
    (parameter,) = _likelihood(plain).model.space(("force_scale",)).parameters
    half = np.array([[parameter.share(0.5)]])
    gains = []
    for error in (0.0, 0.02, 0.25):
        stated = NominalErrors(systematic=Tolerance(force_percent=100.0 * error))
        likelihood = _likelihood(replace(plain, errors=stated))
        assert likelihood.model.space(("force_scale",)).values(half) == pytest.approx(0.5)
        parts = ((("force_scale",), half), (NONE, PLAIN))
        logs = [
            likelihood.terms(likelihood.model.predict(*part)).log_likelihood[0] for part in parts
        ]
        gains.append(float(logs[0] - logs[1]))
    exact, tight, loose = gains
    assert exact > 5.0
    assert tight == pytest.approx(exact, rel=0.05)
    assert loose < 0.7 * exact


def test_single_readings_that_scatter_more_than_the_simulation_count() -> None:
    """Five readings of a long tail that no simulated angle shows."""
    bench = select_cells(load_bench("mq200_adams"), [(100, 235.2)])
    (cell,) = bench.cells
    times = [0.07, 0.08, 0.09, 0.1, 0.26]
    single = tuple(Reading(k, cell.point, 1, time, True) for k, time in enumerate(times, 2))
    alone = replace(bench, cells=(replace(cell, readings=single),))
    sd = float(np.std(times, ddof=1))
    told = (Reading(2, cell.point, 5, float(np.mean(times)), True, sd=sd),)
    beside = replace(bench, cells=(replace(cell, readings=told),))
    mean, found, same = (
        compare(one, simulate_analytic, 8).differences[0].standard_error
        for one in (bench, alone, beside)
    )
    # What the simulation adds is within the error of a mean with the simulated spread.
    assert 0.0 < found**2 - sd**2 / 5 < mean**2 < found**2
    assert same == pytest.approx(found)


def test_errors_of_nominal_values_join_those_of_the_gaps() -> None:
    bench = select_cells(
        load_bench("mq200_adams"), [(n, f) for n in (50, 100) for f in (235.2, 641.5)]
    )
    size = Tolerance(force_percent=2.0, mismatch_rpm=2.0)
    errors = {
        "none": NominalErrors(),
        "one": NominalErrors(systematic=size),
        "both": NominalErrors(systematic=size, each_point=size),
        "force": NominalErrors(each_point=Tolerance(force_percent=2.0)),
        "mismatch": NominalErrors(each_point=Tolerance(mismatch_rpm=2.0)),
    }
    squares = {
        name: np.array(
            [
                d.standard_error**2
                for d in compare(replace(bench, errors=e), simulate_analytic, 8).differences
            ]
        )
        for name, e in errors.items()
    }
    more = {name: one - squares["none"] for name, one in squares.items()}
    assert (more["force"] > 0.0).all()
    assert (more["mismatch"] > 0.0).all()
    assert more["one"] == pytest.approx(more["force"] + more["mismatch"])
    assert more["both"] == pytest.approx(2.0 * more["one"])


NEVER = 10.0  #: s behind the median, from which a shift is late


def _drift(bench: Bench) -> Drift | None:
    return estimate_drift(bench.cells, np.full(len(bench.cells), NEVER), USUAL.drift)


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
    for true in generator.normal(0.0, USUAL.drift, 600).tolist():
        order, rows = generator.permutation(np.repeat(np.arange(points), shifts)), []
        for place, k in enumerate(order):
            off = true * (place / (order.size - 1.0) - 0.5) + 0.03 * generator.standard_normal()
            time = 0.2 * (1.0 + k) * (1.0 + off)
            rows.append(Reading(place + 2, POINTS[k], 1, time, True, place=float(place)))
        found = estimate_drift(gather(rows), np.full(points, NEVER), USUAL.drift)
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
    matrix[-1, -1] += USUAL.drift**-2.0
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
    assert (found.mean, found.sd, found.informed) == pytest.approx((0.0, USUAL.drift, 0.0))
    assert abs(found.offsets).max() < USUAL.drift * max(cell.time or 0.0 for cell in once.cells)
