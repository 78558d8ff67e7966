"""Evidence, priors and predictions against quadrature and refits; probabilities that hold."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import kstest

from benchmarks.self_consistency import cause_of, draw_and_diagnose, in_credible_set
from dogshape.diagnosis.inference import ranking
from dogshape.diagnosis.inference.fit import Sample, cross_validate, fit, refine, screen, widen
from dogshape.diagnosis.inference.ranking import (
    HypothesisSearch,
    Ranking,
    log_prior,
    rank,
)
from dogshape.diagnosis.inference.verdict import (
    NoneEvidence,
    decide,
    excluded_share,
    invisible_shares,
)
from dogshape.diagnosis.likelihood.likelihood import NODES, WEIGHTS, Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.flights import Flights
from dogshape.diagnosis.prediction.simulations import Level
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, REVERSED, UNKNOWN, Array, Hypothesis
from tests.analytic import ANALYTIC_EFFECTS, mean_time, small_model
from tests.verification.test_likelihood import world

MASS, LAG = ("moving_mass",), ("actuation_lag",)
BOTH = (*LAG, *MASS)


def nothing(_: Hypothesis, shares: Array) -> Array:
    """Know nothing beside the shifts."""
    return np.zeros(len(shares))


def likelihood_with(share: float, *, scatter: float = 1.0) -> Likelihood:
    """Build the likelihood of means of five shifts with a mass at a share of its range."""
    bench, model = world()
    p = model.predict(MASS, np.array([[share]]))
    noise = np.random.default_rng(1).normal(size=model.cell_count)
    mean = p.mean[0] + scatter * noise * p.sd[0] / 5.0**0.5
    free = np.zeros(model.cell_count)
    seen = replace(observe(bench, model), mean=mean, freedom=free, hides_late=free.astype(bool))
    return Likelihood(bench, seen, model, USUAL)


def search_of(likelihood: Likelihood) -> HypothesisSearch:
    """Begin a ranking with nothing beside the shifts."""
    return HypothesisSearch(likelihood, nothing, 0.0, log_side_unknown=0.0, log_meaning=0.0)


def sample_of(likelihood: Likelihood, hypothesis: Hypothesis) -> Sample:
    """Sample a hypothesis as the ranking does."""
    search = search_of(likelihood)
    (one,) = screen(likelihood, [hypothesis], nothing, search.distance)
    return refine(likelihood, one, nothing, 4)


def grid(size: int, count: int) -> Array:
    """List the middles of even cells of a unit cube, (count^size, size)."""
    if size == 0:
        return np.zeros((1, 0))
    ticks = (np.arange(count) + 0.5) / count
    return np.stack(np.meshgrid(*[ticks] * size, indexing="ij"), axis=-1).reshape(-1, size)


@pytest.mark.parametrize(("hypothesis", "count"), [(MASS, 600), (LAG, 600), (BOTH, 40)])
@pytest.mark.parametrize("share", [0.3, 0.75])
def test_evidence_is_that_of_quadrature(hypothesis: Hypothesis, count: int, share: float) -> None:
    likelihood = likelihood_with(share)
    shares = grid(len(hypothesis), count)
    log = likelihood.terms(likelihood.model.predict(hypothesis, shares)).log_likelihood
    exact = float(logsumexp(log)) - math.log(len(shares))
    one = sample_of(likelihood, hypothesis)
    assert one.log_evidence == pytest.approx(exact, abs=max(3.0 * one.error, 0.1))
    weights = np.exp(log - logsumexp(log))
    mean = one.weights @ one.shares
    spread = np.sqrt(weights @ (shares - weights @ shares) ** 2)
    assert mean == pytest.approx(weights @ shares, abs=0.25 * spread.max())


@pytest.mark.parametrize("share", [0.3, 0.75])
def test_evidence_around_the_parts_is_that_of_quadrature(share: float) -> None:
    likelihood = likelihood_with(share)
    log = likelihood.terms(likelihood.model.predict(BOTH, grid(2, 40))).log_likelihood
    parts = [sample_of(likelihood, LAG), sample_of(likelihood, MASS)]
    exact = float(logsumexp(log)) - math.log(len(log))
    seeds = [replace(likelihood, settings=replace(USUAL, seed=seed)) for seed in range(60)]
    few = [next(widen(one, {BOTH: parts}, nothing)) for one in seeds]
    # A few draws around the parts are right on average, their refinement within its errors.
    ratios = np.exp([one.log_evidence - exact for one in few])
    assert ratios.mean() == pytest.approx(1.0, abs=3.0 * ratios.std() / len(few) ** 0.5)
    refined = [refine(*one, nothing, 4) for one in zip(seeds[:8], few, strict=False)]
    deviates = np.array([(one.log_evidence - exact) / one.error for one in refined])
    assert abs(deviates.mean()) < 3.0 / len(deviates) ** 0.5
    assert abs(deviates).max() < 4.0


@pytest.mark.slow
def test_evidence_is_that_of_nested_sampling() -> None:
    dynesty = pytest.importorskip("dynesty")
    likelihood = likelihood_with(0.75)

    def log(shares: Array) -> float:
        return float(
            likelihood.terms(likelihood.model.predict(BOTH, shares[None])).log_likelihood[0]
        )

    rng = np.random.default_rng(1)
    sampler = dynesty.NestedSampler(log, lambda u: u, 2, nlive=100, rstate=rng)
    sampler.run_nested(dlogz=0.05, print_progress=False)
    one = sample_of(likelihood, BOTH)
    error = math.hypot(one.error, sampler.results.logzerr[-1])
    assert one.log_evidence == pytest.approx(sampler.results.logz[-1], abs=3.0 * error)


def test_prior_probabilities_of_all_sets_are_one() -> None:
    _, model = world()
    sets = [h for k in range(USUAL.most + 1) for h in itertools.combinations(ANALYTIC_EFFECTS, k)]
    logs = [log_prior(h, model, USUAL, 0.0) for h in (*sets, UNKNOWN)]
    assert np.exp(logs).sum() == pytest.approx(1.0)
    odds = log_prior(MASS, model, USUAL, 0.0) - log_prior(NONE, model, USUAL, 0.0)
    assert odds == pytest.approx(math.log(USUAL.rare / (1.0 - USUAL.rare)))


def test_a_point_left_out_is_predicted_as_by_a_fit_without_it() -> None:
    """Without an effect: a Gaussian of each amplitude, all amplitudes summed."""
    likelihood = likelihood_with(0.1)
    flights = Flights(likelihood.model.effects, likelihood.model.settings, USUAL)
    one = fit(likelihood, sample_of(likelihood, NONE), flights, emulation_error=0.0)
    mean, sd, gap, _ = cross_validate(likelihood, one)
    p = one.predicted.select([0])
    found = likelihood.terms(p)
    residual, own = found.residual[0], np.diag(found.variance[0])
    exact = []
    for k in range(len(residual)):
        others = np.delete(np.arange(len(residual)), k)
        logs, means, variances = [], [], []
        for size, weight in zip(NODES, WEIGHTS, strict=True):
            root = (
                USUAL.discrepancy
                * size
                * (p.mean - p.delay)[0][:, None]
                * likelihood.discrepancy_root
            )
            columns = np.hstack([root, likelihood.common_errors(p)[0]])
            whole = columns @ columns.T + own
            inner = whole[np.ix_(others, others)]
            pull = np.linalg.solve(inner, whole[others, k])
            left = residual[others]
            square = left @ np.linalg.solve(inner, left)
            logs.append(math.log(weight) - 0.5 * (np.linalg.slogdet(inner)[1] + square))
            means.append(pull @ left)
            variances.append(whole[k, k] - pull @ whole[others, k])
        shares = np.exp(np.array(logs) - logsumexp(logs))
        middle = shares @ means
        spread = math.sqrt(shares @ (np.array(variances) + (np.array(means) - middle) ** 2))
        exact.append((p.mean[0, k] + middle, spread))
    exact_mean, exact_sd = np.array(exact).T
    assert abs(mean - exact_mean).max() < 0.2 * exact_sd.min()
    assert sd == pytest.approx(exact_sd, rel=0.15)
    assert mean + gap == pytest.approx(likelihood.observed.mean)


def test_evidence_of_something_unlisted_is_that_of_quadrature() -> None:
    """On top of no effect and of one, each by its prior."""
    likelihood = likelihood_with(0.75, scatter=3.0)
    search = search_of(likelihood)
    logs = []
    for h in (NONE, MASS):
        search.samples[h] = sample_of(likelihood, h)
        search.priors[h] = log_prior(h, likelihood.model, USUAL, 0.0)
        p = likelihood.model.predict(h, grid(len(h), 300))
        gaps = [*itertools.product(USUAL.unlisted_sizes, USUAL.unlisted_lengths)]
        found = [
            terms.log_likelihood
            for stretch in (1.0, 2.0)
            for terms in likelihood.unlisted_terms(replace(p, sd=stretch * p.sd), gaps)
        ]
        logs.append(search.priors[h] + logsumexp(found) - math.log(np.size(found)))
    exact = logsumexp(logs) - logsumexp(list(search.priors.values()))
    assert search.log_unlisted() == pytest.approx(exact, abs=0.25)


SETS = 100


def test_probabilities_hold_what_they_say() -> None:
    """Bounds are three standard errors of 100 sets."""
    bench, model = small_model()
    found = [draw_and_diagnose(bench, model, seed) for seed in range(SETS)]
    held = np.mean([in_credible_set(one) for one in found])
    assert abs(held - 0.9) < 3.0 * (0.9 * 0.1 / SETS) ** 0.5
    said = np.array([one.leads for one in found])
    right = np.array([tuple(one.leading) == cause_of(one) for one in found])
    assert abs((said - right).mean()) < 3.0 * np.sqrt((said * (1.0 - said)).sum()) / SETS
    ranks = [rank for one in found for rank in one.ranks]
    assert kstest(ranks, "uniform").pvalue > 0.003
    # P-values of draws and parts together are too sure by a factor of two at most.
    low = np.mean([one.p < 0.01 for one in found if one.p is not None])
    assert low < 0.02 + 3.0 * (0.02 * 0.98 / SETS) ** 0.5


def test_a_plausible_pair_is_simulated_together() -> None:
    """A mass with lag of the actuator, which single effects predict up to 35 % wrong."""
    bench, model = world()
    model = replace(model, effects={name: model.effects[name] for name in BOTH})
    share, flat = np.array([[0.4, 0.9]]), np.zeros(model.cell_count)
    level = Level(BOTH, tuple(model.space(BOTH).values(share)[0].tolist()))
    benches = [level.setting(model.effects, setting) for setting in model.settings]
    exact = np.array([mean_time(one.clutch, one.point) for one in benches])
    seen = replace(observe(bench, model), mean=exact, freedom=flat, hides_late=flat.astype(bool))
    alone, both = (
        rank([search_of(Likelihood(bench, seen, one, USUAL))])[0]
        for one in (replace(model, runner=None), model)
    )
    error, less = (
        abs(one.likelihood.model.predict(BOTH, share).mean[0] / exact - 1.0).max()
        for one in (alone, both)
    )
    assert error > 0.3
    assert less < 0.15
    assert both.samples[BOTH].log_evidence > alone.samples[BOTH].log_evidence + 1.0


class FakeModel:
    """Model whose further benches change no prediction; a dead time needs none."""

    def __init__(self) -> None:
        self.simulated: list[Hypothesis] = []

    def simulate(self, hypothesis: Hypothesis, *_: Any, **__: Any) -> FakeModel:
        """Note what is simulated."""
        self.simulated.append(hypothesis)
        return self

    def new_effects(self, _: object) -> set[str]:
        """Return an effect that no hypothesis has."""
        return {"nothing"}

    def contact_effects(self, hypothesis: Hypothesis) -> Hypothesis:
        """List all effects but the dead time."""
        return tuple(name for name in hypothesis if name != "delay")


def fake_search(
    monkeypatch: pytest.MonkeyPatch,
    log_evidence: dict[Hypothesis, float],
    gain: float,
    unknown_value: float = -np.inf,
) -> HypothesisSearch:
    """Begin a search with samples of known evidence, whose first simulation gains some nats."""
    model = FakeModel()

    def refined(_: Any, sample: SimpleNamespace, *__: Any, **___: Any) -> SimpleNamespace:
        rise = gain if len(model.simulated) == 1 else 0.0
        return SimpleNamespace(**{**vars(sample), "log_evidence": sample.log_evidence + rise})

    monkeypatch.setattr(ranking, "refine", refined)
    monkeypatch.setattr(HypothesisSearch, "unknown_value", unknown_value)
    monkeypatch.setattr(HypothesisSearch, "uncertain_draws", lambda *_: np.zeros(1, dtype=int))
    likelihood: Any = replace(likelihood_with(0.3), model=cast(Any, model))
    search = search_of(likelihood)
    shares = np.zeros((1, 2))
    for h, log in log_evidence.items():
        sample = SimpleNamespace(log_evidence=log, shares=shares, log_likelihood=shares)
        search.samples[h] = cast(Any, sample)
        search.priors[h] = 0.0
    return search


def simulated_by(search: HypothesisSearch) -> list[Hypothesis]:
    """Simulate what is plausible, and return it in order."""
    ranking._simulate_plausible([search])
    return cast(Any, search.likelihood.model).simulated


def test_what_is_at_stake_is_simulated_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first bench of the leading pair is worth 10 nats: its rival is out of the question."""
    first, second, far = ("a", "b"), ("a", "c"), ("b", "c")
    search = fake_search(monkeypatch, {first: 0.0, second: -1.0, far: -9.0}, gain=10.0)
    simulated = simulated_by(search)
    assert simulated[0] == first
    assert second not in simulated[1:]
    assert far not in simulated


def test_nothing_is_simulated_where_an_unlisted_cause_has_all_the_probability(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log_evidence: dict[Hypothesis, float] = {("a",): 0.0, ("b",): 0.0}
    assert simulated_by(fake_search(monkeypatch, log_evidence, 0.0, unknown_value=0.0))
    assert not simulated_by(fake_search(monkeypatch, log_evidence, 0.0, unknown_value=12.0))


@pytest.mark.parametrize(("rival", "is_decided"), [(-5.5, True), (-4.0, False)])
def test_no_bench_follows_a_sure_name(
    monkeypatch: pytest.MonkeyPatch, rival: float, is_decided: bool
) -> None:
    """Two errors of 2 nats raise a rival of 0.4 % to 18 %, one of 1.8 % to a half."""
    first, second = ("a",), ("b",)
    search = fake_search(monkeypatch, {first: 0.0, second: rival}, gain=0.0)
    search.rounds = {first: 9}
    assert (second not in simulated_by(search)) is is_decided


def test_two_equal_hypotheses_are_simulated_until_the_error_of_half_is_small(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The probability of one half moves by a quarter of a small error of the log evidence."""
    first, second = ("a",), ("b",)
    search = fake_search(monkeypatch, {first: 0.0, second: 0.0}, gain=0.0)
    search.likelihood = replace(
        search.likelihood, settings=replace(USUAL, converged=0.03, simulations_each=50)
    )
    simulated_by(search)
    error = math.hypot(4.0 * 0.03, USUAL.emulated_floor)
    rounds = (USUAL.emulated_nats / error) ** (1.0 / USUAL.emulated_decay) - 1.0
    for h in (first, second):
        assert search.rounds[h] == pytest.approx(rounds, abs=1.0)


def test_an_evidence_that_still_moves_is_simulated_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two equal hypotheses the one whose evidence moved by 3 nats keeps that as its error."""
    still, moving = ("a",), ("b",)
    search = fake_search(monkeypatch, {still: 0.0, moving: 0.0}, gain=0.0)
    search.rounds = {still: 4, moving: 4}
    search.moves = {still: [3.0, 0.1, 0.1], moving: [0.1, 3.0, 0.1]}
    assert search.emulation_error(moving) == 3.0
    assert search.reducible_error(moving) == pytest.approx(math.sqrt(9.0 - USUAL.emulated_floor**2))
    # The spread between sets of benches remains.
    assert search.emulation_error(still) == USUAL.emulated_floor
    assert search.reducible_error(still) == 0.0
    assert simulated_by(search)[0] == moving


def test_prospects_are_sought_where_two_parameters_act_on_the_shift(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two effects, or one whose levels fill a plane; a dead time beside a line does not count."""
    line, pair, plane, delayed = ("line",), ("line", "other"), ("plane",), ("delay", "line")
    search = fake_search(monkeypatch, dict.fromkeys((line, pair, plane, delayed), 0.0), gain=0.0)
    counts = {"line": 1, "other": 1, "plane": 2, "delay": 1}
    effects = {name: SimpleNamespace(parameters=(None,) * count) for name, count in counts.items()}
    monkeypatch.setattr(search.likelihood.model, "effects", effects, raising=False)
    monkeypatch.setattr(HypothesisSearch, "_prospect", lambda _self, h: h)
    search.find_prospects()
    assert set(search.prospects) == {pair, plane}


def test_a_dead_time_is_never_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    search = fake_search(monkeypatch, {("delay",): 0.0, ("a",): -20.0}, gain=0.0)
    assert simulated_by(search) == []


def test_an_effect_that_only_traces_show_is_not_taken_as_absent() -> None:
    """A small mass moves no mean beyond its error; traces that lose by its absence show it."""
    likelihood = likelihood_with(0.02)
    flights = Flights({}, likelihood.model.settings, USUAL)
    one = fit(likelihood, sample_of(likelihood, MASS), flights, emulation_error=0.0)
    one = replace(one, shares=0.0 * one.shares + 0.02)
    one = replace(one, predicted=likelihood.model.predict(MASS, one.shares))

    def traces(h: Hypothesis, shares: Array) -> Array:
        return np.full(len(shares), 0.0 if MASS[0] in h else -10.0)

    unshown = Ranking(likelihood, nothing, {}, {}, {}, 0.0)
    assert invisible_shares(unshown, one, {NONE}) == {NONE: 1.0}
    assert invisible_shares(replace(unshown, side_likelihood=traces), one, {NONE}) == {}


@pytest.mark.parametrize(("posterior", "none", "kind"), [
    ({NONE: 0.85, LAG: 0.1, UNKNOWN: 0.05}, (0.9, 0.1), "none"),  # the gap is within its margin
    ({NONE: 0.85, LAG: 0.1, UNKNOWN: 0.05}, (0.6, 0.9), "none"),  # or nothing acts
    ({NONE: 0.75, LAG: 0.2, UNKNOWN: 0.05}, (0.6, 0.9), "ambiguous"),
    ({NONE: 0.85, LAG: 0.1, UNKNOWN: 0.05}, (0.6, 0.1), "ambiguous"),  # it would not show
    ({MASS: 0.5, UNKNOWN: 0.35, LAG: 0.1, NONE: 0.05}, (0.1, 0.9), "unknown"),
    ({LAG: 0.85, UNKNOWN: 0.1, NONE: 0.05}, (0.1, 0.9), "effect"),
    ({("a",): 0.85, ("a", *MASS): 0.1, UNKNOWN: 0.05, NONE: 0.0}, (0.1, 0.9), "unknown"),
])  # fmt: skip
def test_verdict(posterior: dict[Hypothesis, float], none: tuple[float, float], kind: str) -> None:
    """The added mass fails its predictive check, alone or with one that is not fitted alone."""
    fitted = {*posterior} - {UNKNOWN, ("a",)}
    fits: Any = {h: SimpleNamespace(p=0.001 if MASS[0] in h else 0.5) for h in fitted}
    assert decide(posterior, fits, NoneEvidence(*none), USUAL).kind == kind


@pytest.mark.parametrize(("triple", "kind", "causes"), [
    (0.85, "unknown", ()),
    (0.70, "ambiguous", ()),  # the triple is unknown for its parts
    (0.02, "ambiguous", ("actuation_lag",)),
])  # fmt: skip
def test_three_effects_name_nothing(triple: float, kind: str, causes: tuple[str, ...]) -> None:
    rest = 1.0 - triple
    pairs = {(*LAG, name): 0.5 * rest for name in ("axial_gap", "drag_torque")}
    posterior = {(*LAG, "axial_gap", "drag_torque"): triple, **pairs, UNKNOWN: 0.0, NONE: 0.0}
    fits: Any = {h: SimpleNamespace(p=0.5) for h in posterior}
    verdict = decide(posterior, fits, NoneEvidence(0.1, 0.9), USUAL)
    assert (verdict.kind, verdict.causes) == (kind, causes)


def test_a_probable_none_that_fails_its_check_is_unknown() -> None:
    posterior = {NONE: 0.85, LAG: 0.1, UNKNOWN: 0.05}
    fits: Any = {NONE: SimpleNamespace(p=0.001), LAG: SimpleNamespace(p=0.5)}
    assert decide(posterior, fits, NoneEvidence(0.1, 0.9), USUAL).kind == "unknown"


def test_the_share_of_effects_that_data_exclude() -> None:
    """Nothing by data without information, whatever they say on the sense of rotation."""
    prior = {NONE: 0.2, LAG: 0.3, MASS: 0.1, (REVERSED,): 0.2, UNKNOWN: 0.2}
    assert excluded_share(prior, prior) == 0.0
    same_sense = prior | {NONE: 0.4, (REVERSED,): 0.0}
    assert excluded_share(prior, same_sense) == pytest.approx(0.0)
    less_likely = prior | {LAG: 0.03, MASS: 0.01, UNKNOWN: 0.9}
    assert excluded_share(prior, less_likely) == pytest.approx(0.9)
    assert excluded_share(prior, prior | {LAG: 0.9}) < 0.0
