"""Emulator of an effect's changes, and modes of uneven angles, against second methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logit
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.prediction.emulator import AMPLITUDES, LENGTHS, Emulator, Kernel
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.prediction.moments import Angles, mask_late, modes_of
from dogshape.diagnosis.prediction.simulations import Level, simulate_benches
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, Array
from dogshape.sim.effects import load
from dogshape.sim.setting import angle_weights
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.planar import PlanarClutch, touch_time
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from tests.analytic import RECORD, select_cells
from tests.verification.test_likelihood import world

NOISE = 0.05
X = np.linspace(0.0, 1.0, 9)[:, None]
NOWHERE = np.zeros((0, 1))


def _fitted(values: Array, plain: Array = NOWHERE, common: float = 1e-9) -> Emulator:
    found = np.append(values, 0.0)[None]
    return Emulator.fit(X, (plain,), found, np.array([[NOISE]]), np.array([common]))


def test_the_process_is_that_of_scikit_learn() -> None:
    """Without neutral values and common errors: mean and error with the same amplitude."""
    values = np.sin(3.0 * X[:, 0]) + NOISE * np.random.default_rng(1).standard_normal(9)
    places = np.array([[0.03], [0.41], [0.77]])
    emulator = _fitted(values)
    mean, error = replace(emulator, misfit=np.ones((1, 9))).predict(places, 1)
    kernel = ConstantKernel(emulator.amplitude[0], "fixed") * Matern(
        emulator.kernel.length, "fixed", nu=1.5
    )
    process = GaussianProcessRegressor(kernel, alpha=NOISE**2).fit(X, values)
    exact_mean, exact_error = process.predict(places, return_std=True)
    assert mean[:, 0] == pytest.approx(exact_mean, abs=1e-8)
    assert error[:, 0] == pytest.approx(exact_error, rel=1e-5)
    squares = np.empty(9)
    for k in range(9):
        others = np.arange(9) != k
        process = GaussianProcessRegressor(kernel, alpha=NOISE**2).fit(X[others], values[others])
        expected, sd = process.predict(X[[k]], return_std=True)
        squares[k] = (values[k] - expected[0]) ** 2 / (sd[0] ** 2 + NOISE**2)
    assert emulator.misfit[0] == pytest.approx(np.maximum(squares, max(1.0, squares.mean())))


def test_the_amplitude_is_more_likely_than_any_of_the_grid() -> None:
    values = np.sin(3.0 * X[:, 0]) + NOISE * np.random.default_rng(1).standard_normal(9)
    emulator = _fitted(values)
    length = emulator.kernel.length

    def log_likelihood(amplitude: float) -> float:
        kernel = ConstantKernel(amplitude**2, "fixed") * Matern(length, "fixed", nu=1.5)
        process = GaussianProcessRegressor(kernel, alpha=NOISE**2, optimizer=None).fit(X, values)
        return float(process.log_marginal_likelihood_value_)

    best_of_grid = max(log_likelihood(NOISE * factor) for factor in AMPLITUDES)
    assert log_likelihood(float(emulator.amplitude[0]) ** 0.5) > best_of_grid
    assert LENGTHS[0] <= length <= LENGTHS[-1]


def test_a_change_is_zero_and_certain_at_neutral_values() -> None:
    plain = np.array([[0.25]])
    mean, error = _fitted(X[:, 0] - 0.25, plain).predict(plain, 1)
    assert abs(mean[0, 0]) < 1e-6
    assert error[0, 0] < 1e-4
    both = Kernel((plain, plain), 0.5)
    for one in ([0.25, 0.9], [0.9, 0.25]):
        assert both.variance(np.array([one])) == pytest.approx(0.0, abs=1e-6)
        assert both.covariance(np.array([one]), np.array([[0.8, 0.8]])) == pytest.approx(
            0.0, abs=1e-6
        )


def test_one_chaotic_level_does_not_bend_the_others() -> None:
    """A level off by four errors is taken as noise; an interpolation would go through it."""
    line = 0.3 * X[:, 0]
    off = line.copy()
    off[4] += 4.0 * NOISE
    mean, _ = _fitted(off, X[:1]).predict(X, 1)
    assert abs(mean[:, 0] - line).max() < 1.3 * NOISE


def _compiled(blocks: Sequence[Block]) -> list[list[Record]]:
    every = [
        [engage(PlanarClutch(one.clutch), one.point, angle) for angle in one.angles]
        for one in blocks
    ]
    return [[{"outcome": e.outcome.value, "shift_time_s": e.shift_time} for e in row]
            for row in every]  # fmt: skip


@pytest.fixture(scope="module")
def simulated() -> Model:
    bench = select_cells(load_bench("mq200_adams"), [(50.0, 235.2), (149.0, 235.2), (249.0, 641.5)])
    bench = replace(bench, clutch=bench.clutch.with_engine("planar"), record=RECORD)
    names = ("sleeve_friction", "actuation_lag", "relative_angle", "actuation_delay")
    every = load(None)
    return build_models(bench, {name: every[name] for name in names}, USUAL, _compiled)["sleeve"]


@pytest.mark.parametrize("force", [180.0, 520.0])
def test_the_gap_closes_as_in_closed_form(simulated: Model, force: float) -> None:
    clutch, profile = simulated.setting.clutch, simulated.setting.point.profile
    profile = replace(profile, force=force)
    found = touch_time(clutch, profile)
    exact = profile.free_flight_time(clutch.dog.axial_gap, clutch.rings.mass)
    assert found == pytest.approx(exact, rel=1e-4)
    held = replace(clutch, mechanism=replace(clutch.mechanism, friction=force + 1.0))
    assert touch_time(held, profile) == clutch.timeout


@pytest.mark.parametrize(("effect", "share"), [("sleeve_friction", 0.5), ("actuation_lag", 0.7)])
@pytest.mark.parametrize("centre", [0.2, 0.7])
def test_uneven_angles_weigh_the_times_with_the_other_effect(
    simulated: Model, effect: str, share: float, centre: float
) -> None:
    """A longer flight and uneven angles together, against 240 shifts with both at each point."""
    hypothesis = effect, "relative_angle"
    space = simulated.space(hypothesis)
    own, concentration, _ = space.parameters
    shares = np.array([[share, concentration.share(6.0), centre]])
    p, further = simulated.predict(hypothesis, shares), simulated.simulate(hypothesis, shares)
    assert further is not None
    assert further.simulate(hypothesis, shares) is None
    there = further.predict(hypothesis, shares)
    for k, setting in enumerate(simulated.settings):
        changed = space.effects[0].apply(setting, {own.name: own.at(share)})
        turns = (np.arange(240) + 0.5) / 240
        angles = turns * setting.clutch.dog.pitch_angle
        weights = angle_weights(turns, 6.0, centre)
        times = [
            engage(PlanarClutch(changed.clutch), changed.point, angle).shift_time
            for angle in angles
        ]
        (soon,) = mask_late(
            np.array([times], dtype=float), simulated.baseline.min_late_delay[k : k + 1]
        )
        exact = np.average(soon[known := np.isfinite(soon)], weights=weights[known])
        assert p.mean[0, k] == pytest.approx(exact, abs=2.5 * p.error[0, k])
        # The 48 angles themselves err by up to 3.3 % at this concentration.
        assert there.mean[0, k] == pytest.approx(exact, rel=0.03)


def test_the_law_of_an_effect_errs_by_no_more_than_its_change(simulated: Model) -> None:
    """Squared errors differ as the squares of two laws do; other effects keep theirs.

    A law above the change counts as the change.
    """
    shares = np.array([[0.8]])
    predictions = []
    for law in (0.0, 0.02, 9.0):
        constants = replace(USUAL, laws={"sleeve_friction": law})
        model = replace(simulated, constants=constants)
        predictions.append(model.predict(("sleeve_friction",), shares))
    none, low, high = predictions
    change = abs(np.log(low.mean / simulated.baseline.mean))
    assert (change > 0.02).any()
    for p, error in ((low, np.minimum(change, 0.02)), (high, change)):
        growth = (p.error / p.mean) ** 2 - (none.error / none.mean) ** 2
        assert growth == pytest.approx(error**2, rel=1e-9, abs=1e-12)
    other_laws = replace(USUAL, laws={**USUAL.laws, "sleeve_friction": 0.4})
    other_model = replace(simulated, constants=other_laws)
    usual_error = simulated.predict(("actuation_lag",), shares).error
    assert (other_model.predict(("actuation_lag",), shares).error == usual_error).all()


def test_two_effects_simulated_together_correct_the_rule(simulated: Model) -> None:
    """Mean times of two benches on the grid that were simulated, and of one between."""
    pair = "actuation_lag", "sleeve_friction"
    shares = np.array([[0.8125, 0.625], [0.625, 0.625], [0.7, 0.7]])
    rows = [Level(pair, tuple(v)) for v in simulated.space(pair).values(shares).tolist()]
    settings, given = simulated.settings, simulated.effects
    benches = [[level.setting(given, one) for one in settings] for level in rows]
    times = simulate_benches(benches, simulated.baseline.simulated, _compiled)
    exact = np.nanmean(mask_late(times, simulated.baseline.min_late_delay), axis=2)
    model = simulated
    for share in shares[:2]:
        model = model.simulate(pair, share[None]) or model
    ruled, p = simulated.predict(pair, shares), model.predict(pair, shares)
    assert abs(ruled.mean / exact - 1.0).max() > 0.1
    assert p.mean[:2] == pytest.approx(exact[:2], rel=0.01)
    stated_error = np.hypot(p.common_error, p.error)
    assert (abs(p.mean - exact) < 1.5 * stated_error).all()
    # A further bench of one of them changes the rule, so what it misses too.
    denser = model.simulate(("actuation_lag", "relative_angle"), np.array([[0.8, 0.5, 0.5]]))
    assert denser is not None
    assert denser.predict(pair, shares[:2]).mean == pytest.approx(exact[:2], rel=0.01)
    assert model.simulate(("actuation_delay", "relative_angle"), np.full((1, 3), 0.5)) is None


def test_two_modes_have_the_moments_of_all_times() -> None:
    """Times around 50 and 150 ms, a late one and one that did not engage, by hand."""
    times = np.array([[0.049, 0.050, 0.051, 0.150, 0.400, np.inf]])
    kept, late = np.array([[1, 1, 1, 1, 0, 0]], dtype=bool), np.array([[0, 0, 0, 0, 1, 0]], bool)
    weights = np.array([[2.0, 5.0, 2.0, 1.0, 3.0, 7.0]])
    apart, share = times[0, :4] - 0.06, weights[0, :4] / 10.0
    variance, fourth = (share @ apart**k for k in (2, 4))
    narrow = (0.4 / 0.9 * 1e-6 / variance) ** 0.5
    expected = 0.1, 0.05 / 0.06, narrow, fourth / variance**2 - 3.0
    assert np.ravel(modes_of(times[0], kept[0], weights)) == pytest.approx(expected)
    even = np.array([0.075, np.var(times[0, :4]) ** 0.5])
    angles, shares = Angles(times[None], late[None]), np.ones((1, 1))
    changes = angles.changes(0, weights, shares)
    given = np.log([0.06, variance**0.5] / even), [3.0 / 13.0 - 0.2, logit(0.65) - logit(5.0 / 6.0)]
    expected = [*np.concatenate(given), 0.0]  # kurtosis: the modes'
    assert changes.ravel() == pytest.approx(expected)
    errors = angles.errors(0, weights, shares)
    assert errors.inverse_square.item() == pytest.approx((92.0 / 400.0) ** 2)


def test_shifts_with_and_without_the_rare_mode_have_the_moments_of_all() -> None:
    bench, model = world()
    likelihood = Likelihood(bench, observe(bench, model), model, USUAL)
    p = model.predict(NONE, np.zeros((1, 0)))
    one = np.ones_like(p.mean)
    p = replace(p, minor_share=0.1 * one, main_offset=-0.2 * p.sd, main_sd=0.5 * p.sd)
    q = p.select((slice(None), likelihood.measured_points))
    log, offset, variance = likelihood._mode_options(q)
    assert log[1] == pytest.approx(
        likelihood.observed.count[likelihood.measured_points][None] * np.log(0.9)
    )
    shares = np.exp(log)
    assert shares.sum(axis=0) == pytest.approx(1.0)
    assert (shares * offset).sum(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert (shares * variance).sum(axis=0) == pytest.approx(q.sd**2)


def test_misses_that_all_points_share_are_told_from_those_of_each() -> None:
    generator = np.random.default_rng(2)
    x, plain = np.linspace(0.1, 1.0, 9)[:, None], (np.zeros((1, 1)),)
    shared, each = np.tile(generator.normal(size=10), (12, 1)), generator.normal(size=(12, 10))
    own, common = np.full((12, 1), 0.1), np.full(12, 0.01)
    alike = [Emulator.fit(x, plain, one, own, common).miss_correlation(1) for one in (shared, each)]
    assert alike[0] == pytest.approx(1.0, abs=1e-6)
    assert alike[1] < 0.3
