"""Evidence against closed forms and nested sampling; the likelihood against its own samples."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.inference.classes import Confusion
from dogshape.diagnosis.inference.evidence import Sum, evidence, quadrature, sampled
from dogshape.diagnosis.inference.outcome import Decision, Outcome
from dogshape.diagnosis.likelihood.cell_likelihood import log_times
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy, Slopes
from dogshape.diagnosis.likelihood.observations import Observed, observe
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Problem, Rows
from dogshape.diagnosis.likelihood.signature import squared
from dogshape.diagnosis.likelihood.time_parts import sample_spread
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN, spaces_of
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import USUAL, Rules
from dogshape.diagnosis.terms import Array
from dogshape.validation.nested_sampling import nested, nested_evidence
from tests.toy import CLUTCH, EFFECTS, Toy, bench_of, points_of

NO_DISCREPANCY = Discrepancy((np.zeros((1, 1)),), np.zeros(1), np.ones((1, 1)))
CENTRE, WIDTH = (0.37, 0.8, 0.5, 0.2), (0.01, 0.05, 0.02, 0.1)


def _gaussian(size: int) -> tuple[float, Array, Array]:
    """Return the log evidence of a Gaussian likelihood cut off by the cube, centre and width."""
    centre, width = np.array(CENTRE[:size]), np.array(WIDTH[:size])
    inside = norm.cdf((1.0 - centre) / width) - norm.cdf(-centre / width)
    return float(np.log(inside).sum()), centre, width


def _rows(shares: Array, size: int) -> Rows:
    _, centre, width = _gaussian(size)
    log = norm.logpdf(shares, centre, width).sum(axis=1)
    nothing = np.zeros((len(shares), 1))
    slopes = Slopes(nothing, nothing)
    said = PredictionSummary(*([nothing] * 10))
    return Rows(shares, log[:, None], nothing, said, slopes, NO_DISCREPANCY, nothing)


@pytest.mark.parametrize("size", [1, 2])
def test_quadrature_finds_the_evidence_of_a_gaussian(size: int) -> None:
    found: Sum = quadrature(lambda shares: _rows(shares, size), size)
    exact, centre, _ = _gaussian(size)
    assert found.log_evidence == pytest.approx(exact, abs=5e-3)
    assert found.error < 0.01
    weights = np.exp(found.log_prior + found.rows.log_likelihood[:, 0] - found.log_evidence)
    assert weights @ found.rows.shares == pytest.approx(centre, abs=2e-3)


@pytest.mark.parametrize("size", [2, 3, 4])
def test_importance_sampling_finds_it_within_four_errors(size: int) -> None:
    found = sampled(lambda shares: _rows(shares, size), size)
    exact, _, _ = _gaussian(size)
    assert found.error < 0.12
    assert abs(found.log_evidence - exact) < 4.0 * found.error


def test_nested_sampling_finds_it_too() -> None:
    exact, centre, width = _gaussian(2)
    found, error = nested(lambda u: float(norm.logpdf(u, centre, width).sum()), 2)
    assert abs(found - exact) < 4.0 * error


@pytest.mark.parametrize("names", [("actuation_delay",), ("contact_friction",)], ids=str)
def test_quadrature_agrees_with_nested_sampling_on_the_toy(names: tuple[str, ...]) -> None:
    points = points_of()[::5]
    bench = bench_of({"delay_s": 0.05}, np.random.default_rng(1), points=points)
    problem = Problem(observe(bench), Toy(points), USUAL)
    effects = {name: EFFECTS[name] for name in names}
    space = spaces_of(effects, setting_of(bench), pairs=[])[1]
    found = evidence(problem, space)
    other, error = nested_evidence(problem, space)
    # Values that give no bench have no likelihood there, and no prior here.
    share = space.possible(
        space.values(np.random.default_rng(0).random((2000, len(space.parameters))))
    ).mean()
    assert abs(found.log_evidence + math.log(share) - other) < 4.0 * math.hypot(error, 0.03)


@pytest.mark.parametrize("place", [0, 8, 24])
def test_the_density_of_single_shifts_has_the_volume_of_one(place: int) -> None:
    points = points_of()[place : place + 1]
    bench = bench_of({}, np.random.default_rng(1), points=points, single=True, shifts=1)
    seen = observe(bench)
    one = np.ones(1)
    rare = {"outlier_share": 0.05 * one, "behind": 0.12 * one, "behind_sd": 0.03 * one}
    spread = replace(Toy(points).at((), np.zeros((1, 0)), 0), **rare)
    grid = np.linspace(-10.0, 10.0, 80_000)
    said = CellPredictions.of([spread], Rules())
    volume = np.exp(log_times(seen, said.moved(-grid[None]))[0])
    # Nothing tells that one shift alone is late, so its density has that, too.
    assert float(np.trapezoid(volume, grid)) == pytest.approx(1.0, abs=1e-3)


def test_the_spread_of_single_shifts_has_the_density_of_drawn_samples() -> None:
    """Bias and variance of the logarithm of a sample's spread, and its normal density."""
    generator = np.random.default_rng(3)
    for count in (3, 5, 10, 40):
        drawn = np.log(generator.normal(0.0, 2.0, (40_000, count)).std(axis=1, ddof=1) / 2.0)
        bias, variance = sample_spread(np.array([count - 1.0]))
        assert drawn.mean() == pytest.approx(bias[0], abs=0.01)
        assert drawn.var() == pytest.approx(variance[0], rel=0.05)


def test_the_error_of_the_simulation_does_not_average_out() -> None:
    one = np.ones(1)
    points = points_of()[8:9]
    bench = bench_of({}, np.random.default_rng(0), points=points, single=True, shifts=400)
    seen = observe(bench)
    half = math.sqrt(3.0) * math.exp(seen.log_sd[0])
    times = np.linspace(-half, half, 16)[None]
    curve = []
    for offset in (0.0, 0.01):
        moved = Prediction.plain(times + seen.mean[0] - offset, one, 0.01 * one, 0.02 * one)
        curve.append(log_times(seen, CellPredictions.of([moved], Rules(0.0)))[0, 0])
    # One standard error of the simulation, however many shifts there are.
    assert curve[0] - curve[1] == pytest.approx(0.5, abs=0.3)


def test_one_odd_shift_does_not_decide_nor_an_odd_cell() -> None:
    times = np.broadcast_to(np.linspace(0.052, 0.072, 16), (1, 16))
    one = np.ones(1)
    spread = Prediction.plain(times, one, 1e-3 * one, 0.02 * one)
    said = CellPredictions.of([spread], Rules())
    usual = np.linspace(0.054, 0.070, 10)
    odd = np.append(usual[:-1], 0.269)
    log = [log_times(_with_singles(t), said)[0, 0] for t in (usual, odd)]
    assert 0.0 < log[0] - log[1] < 9.0
    # One cell in two hundred may be odd: that costs a few nats, wherever the cell lies.
    logs = [log_times(_with_singles(usual + t), said)[0, 0] for t in (0.0, 0.02, 0.03)]
    assert 5.0 < logs[0] - logs[1] < 11.0
    assert abs(logs[1] - logs[2]) < 1.0
    never = CellPredictions.of([spread], Rules(odd_share=0.0))
    far = [log_times(_with_singles(usual + t), never)[0, 0] for t in (0.0, 0.03)]
    assert far[0] == pytest.approx(logs[0], abs=0.05)
    assert far[0] - far[1] > 15.0


def _with_singles(times: np.ndarray) -> Observed:
    """Return what single shifts of such times are at one operating point."""
    (point,) = points_of()[17:18]
    readings = [Reading(k + 2, point, 1, float(t), True) for k, t in enumerate(times)]
    return observe(Bench("toy", "made up", CLUTCH, gather(readings), None, Sensor()))


def test_information_of_a_perfect_test_is_the_entropy_and_of_none_nothing() -> None:
    shares = np.array([0.2, 0.3, 0.5])
    entropy = -float((shares * np.log(shares)).sum())
    names = (("axial_gap",), ("free_play",), UNKNOWN)
    # Without imitators, which a test of shifts cannot tell from what they imitate.
    decision = replace(Decision.of(names, shares, Confusion((), np.zeros((0, 0)), ())), odds=0.0)
    far = decision.worth(Outcome.normal(np.array([[0.0], [100.0], [200.0]]), np.ones((3, 1))))
    assert (far.information, far.settles) == pytest.approx((entropy, 1.0), rel=1e-6)
    same = decision.worth(Outcome.normal(np.zeros((3, 1)), np.ones((3, 1))))
    assert (same.information, same.settles) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert far.misleads == same.misleads == 0.0


def test_squared_distances() -> None:
    one, other = np.array([[0.0, 3.0]]), np.array([[4.0, 0.0], [0.0, 3.0]])
    assert squared(one, other) == pytest.approx(np.array([[25.0, 0.0]]))
