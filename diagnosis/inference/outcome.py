r"""Outcome of a bench test as hypotheses predict it, its worth to the decision; plans of shifts.

A hypothesis *h* predicts the outcome *y* by *K* draws of its posterior, each a normal density with
the errors of the test, so the probability after it is

.. math:: P(h | y) \propto \frac{P(h)}{K} \sum_k N(y; \mu_k, \Sigma_k + V_k),

:math:`V_k` the scatter of the nearest draws about it (Breiman, Meisel and Purcell 1977,
Technometrics 19). Beside each effect stands an *imitator*, a cause outside the list that acts on
shift times in the same way: a test of the effect reads the imitator as it reads *unknown*.

The *answer* is the named hypothesis, or where none is named the leading one: in both cases the most
probable. The *gain* of a test is the expected rise of the answer's probability by the outcome,

.. math:: G = \int p(y) [P(a_y | y) - P(a_y)] dy, \quad a_y = \operatorname{argmax}_h P(h | y).

It is never negative, since :math:`\int p(y) P(a_y | y) dy \ge \max_h P(h) \ge \int p(y) P(a_y) dy`.
A test that cannot change the answer gains 0; a perfect test gains :math:`1 - \sum P(h)^2`.

A *plan* has operating points, numbers and order of shifts, and the pairs that they distinguish.
With the errors that *n* shifts at each operating point leave, the distance of two values is

.. math:: D = \delta^T (V + A A^T)^{-1} \delta + \sum \delta_s^2 / v_s + \sum \delta_p^2 / v_p,

:math:`\delta`, :math:`\delta_s`, :math:`\delta_p` the differences of means, ln spreads and shares
that engage, *V* the variances of means, *A* all errors in common. A rival imitates a truth by its
nearest value. *D*/2 is about the expected log Bayes factor, :math:`\Phi(\sqrt D / 2)` the
probability to decide a pair; its mean over all pairs and strengths is the worth of a plan. Shifts
go in lots, each to the operating point that adds most.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.distance import cdist
from scipy.special import logsumexp, ndtr, polygamma
from scipy.stats import qmc

from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.prediction.model import Model, Prediction
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.errors import InputError, Refusal, number
from dogshape.sim.units import RPM

MIN_INFORMATION_NATS = 0.005  #: of a test, from which its chances are stated
OUTCOME_DRAWS = 256  #: outcomes drawn of each test
NEAREST_DRAWS = 8  #: draws that give the width of a density
MAX_SIGMAS = 9.0  #: standard errors to the ends of a density
SETUP_HOURS = 0.5  #: h, for an operating point
TRACING_HOURS = 1.5  #: h, for traces
SHIFT_HOURS = 0.02  #: h, for a shift


class Densities(NamedTuple):
    """Mixture of k normal densities of d values."""

    share: Array  #: (k,)
    mean: Array  #: (k, d)
    covariance: Array  #: (k, d, d)

    @classmethod
    def concatenate(cls, parts: Sequence[Densities]) -> Self:
        """Concatenate mixtures."""
        return cls(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


class Worth(NamedTuple):
    """Worth of a test to the decision, over doing nothing."""

    information: float  #: nats
    gain: float  #: expected rise of the answer's probability
    settles: float  #: rise of the chance that the truth is named
    misleads: float  #: rise of the chance that anything else is named


def answer_gain(before: Array, after: Array, weights: Array) -> float:
    """Compute the expected rise of the answer's probability by the outcome of a test.

    ``before`` are the probabilities of h hypotheses, (h,), ``after`` those after n outcomes of
    probabilities ``weights``, (n, h) and (n,).
    """
    leader = before.argmax()
    answer = after.argmax(axis=1)
    # The leader's probability rises by 0 in expectation: without it no outcome counts below 0.
    rise = after.max(axis=1) - after[:, leader] + before[leader] - before[answer]
    return float(weights @ rise)


def smooth_draws(mean: Array, covariance: Array) -> Densities:
    """Build densities of draws (k, d) with errors (k, d, d), as wide as neighbours scatter."""
    scaled = mean / np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    nearest = cdist(scaled, scaled).argsort(axis=1)[:, :NEAREST_DRAWS]
    deviation = mean[nearest] - mean[:, None]
    spread = np.einsum("kni,knj->kij", deviation, deviation) / deviation.shape[1]
    share = np.full(len(mean), 1.0 / len(mean))
    return Densities(share, mean, covariance + spread)


@dataclass(frozen=True)
class PredictedOutcome:
    """Predicted outcome of a test: c normal densities, each a share of a hypothesis' mixture."""

    hypotheses: tuple[Hypothesis, ...]  #: that predict it, *unknown* among them
    hypothesis_index: np.ndarray  #: index of the hypothesis of each density, ascending, (c,)
    share: Array  #: of its hypothesis, (c,)
    mean: Array  #: of each density, (c, d)
    covariance: Array  #: (c, d, d)
    is_read: np.ndarray  #: whether the test reads an effect of each hypothesis, (hypotheses,)

    @classmethod
    def of(cls, parts: Mapping[Hypothesis, Densities], reads: Callable[[Hypothesis], bool]) -> Self:
        """Join the densities of several hypotheses."""
        counts = [len(densities.share) for densities in parts.values()]
        joined = Densities.concatenate([*parts.values()])
        return cls(
            hypotheses=tuple(parts),
            hypothesis_index=np.repeat(np.arange(len(parts)), counts),
            share=joined.share,
            mean=joined.mean,
            covariance=joined.covariance,
            is_read=np.array([h not in (NONE, UNKNOWN) and reads(h) for h in parts]),
        )

    @cached_property
    def _roots(self) -> Array:
        """Cholesky factors of the covariances, (c, d, d)."""
        return np.asarray(np.linalg.cholesky(self.covariance))

    @property
    def _unknown_index(self) -> int:
        """Index of *unknown* among the hypotheses."""
        return self.hypotheses.index(UNKNOWN)

    def log_density(self, outcomes: Array) -> Array:
        """Compute log densities of outcomes (n, d) under each hypothesis, (n, hypotheses)."""
        count, size = self.mean.shape
        inverse = np.linalg.inv(self._roots).swapaxes(0, 1)  # rows of all densities, (d, c, d)
        deviates = (outcomes @ inverse.reshape(-1, size).T).reshape(-1, size, count)
        deviates -= (inverse * self.mean).sum(axis=2)
        log_root = np.log(np.diagonal(self._roots, axis1=1, axis2=2)).sum(axis=1)
        log = np.log(self.share) - log_root - 0.5 * size * np.log(2.0 * np.pi)
        log = log - 0.5 * (deviates**2).sum(axis=1)
        starts = np.searchsorted(self.hypothesis_index, np.arange(len(self.hypotheses)))
        max_log = np.maximum.reduceat(log, starts, axis=1)
        density = np.exp(log - max_log[:, self.hypothesis_index])
        return np.asarray(max_log + np.log(np.add.reduceat(density, starts, axis=1)))

    def draw(self, indices: np.ndarray, generator: np.random.Generator) -> Array:
        """Draw an outcome of each of the hypotheses at indices (n,), (n, d)."""
        position = indices + generator.random(indices.size)
        density = np.searchsorted(np.cumsum(self.share), position)
        last = np.searchsorted(self.hypothesis_index, indices, side="right") - 1
        density = np.minimum(density, last)
        noise = generator.standard_normal((indices.size, self.mean.shape[1]))
        return self.mean[density] + np.einsum("nij,nj->ni", self._roots[density], noise)

    def select(self, is_shown: np.ndarray) -> PredictedOutcome:
        """Select the values of the outcome that are shown, (d,) true or false."""
        covariance = self.covariance[:, is_shown][:, :, is_shown]
        return replace(self, mean=self.mean[:, is_shown], covariance=covariance)

    def update(self, prior: Array, log: Array, odds: float) -> Array:
        """Update probabilities (hypotheses,) by log densities, (n, hypotheses) each.

        ``odds`` are those of an imitator to its hypothesis.
        """
        imitator_odds = np.where(self.is_read, odds, 0.0)
        likelihood = np.exp(log - log.max(axis=1, keepdims=True))
        listed = prior / (1.0 + imitator_odds) * likelihood
        imitators = prior * imitator_odds / (1.0 + imitator_odds)
        imitators = imitators * likelihood[:, [self._unknown_index]]
        # Up to its prior odds an imitator counts with its hypothesis, beyond with unknown.
        indistinct = np.minimum(imitators, imitator_odds * listed)
        posterior = listed + indistinct
        posterior[:, self._unknown_index] += (imitators - indistinct).sum(axis=1)
        return np.asarray(posterior / posterior.sum(axis=1, keepdims=True))

    def worth(
        self,
        prior: Array,
        odds: float,
        settings: Settings,
        seed: int = 1,
        draw_count: int = OUTCOME_DRAWS,
    ) -> Worth:
        """Compute information and gain, and by how much chances to settle and to mislead rise.

        The truth is named afterwards if a test settles, anything else if it misleads. An
        imitator's truth is *unknown*. ``prior`` are the probabilities before the test,
        (hypotheses,), ``odds`` those of an imitator to its hypothesis; ``draw_count`` outcomes are
        drawn.
        """
        generator = np.random.default_rng(seed)
        indices = np.arange(len(self.hypotheses))
        has_imitator = np.array([h not in (NONE, UNKNOWN) for h in self.hypotheses])
        imitator_odds = np.where(has_imitator, odds, 0.0)
        # Causes: each hypothesis, then its imitator.
        listed = prior / (1.0 + imitator_odds)
        probability = np.concatenate([listed, prior * imitator_odds / (1.0 + imitator_odds)])
        source = np.concatenate([indices, np.where(self.is_read, self._unknown_index, indices)])
        truth = np.concatenate([indices, np.full(indices.size, self._unknown_index)])
        # As many draws of each as its probability: less noise than a random choice of it.
        counts = np.maximum(1, np.round(draw_count * probability))
        counts = np.where(probability > 0.0, counts, 0).astype(int)
        causes = np.repeat(np.arange(probability.size), counts)
        weights = probability[causes] / counts[causes]
        log = self.log_density(self.draw(source[causes], generator))
        rows = np.arange(causes.size)
        log_mixture = logsumexp(log[:, source], axis=1, b=probability)
        information = float(weights @ (log[rows, source[causes]] - log_mixture))
        is_truth = truth[:, None] == indices
        after = probability * np.exp(log[:, source] - log_mixture[:, None]) @ is_truth
        before = probability @ is_truth
        nameable = [settings.is_nameable(h) for h in self.hypotheses]
        is_named_before = (prior > settings.named) & nameable
        is_named = (self.update(prior, log, odds) > settings.named) & nameable
        is_right = is_named[rows, truth[causes]]
        is_wrong = is_named.any(axis=1) & ~is_right
        right_before = float(before @ is_named_before)
        wrong_before = float(before.sum() * is_named_before.any()) - right_before
        return Worth(
            information=max(0.0, information),
            gain=answer_gain(before, after, weights),
            settles=float(weights @ is_right) - right_before,
            misleads=float(weights @ is_wrong) - wrong_before,
        )

    def interval(self, hypothesis: Hypothesis, column: int, outside: float) -> tuple[float, float]:
        """Compute the ends of a value of the outcome under a hypothesis.

        The probability ``outside`` lies beyond them, half of it at either end.
        """
        is_member = self.hypothesis_index == self.hypotheses.index(hypothesis)
        share = self.share[is_member]
        mean = self.mean[is_member, column]
        sd = np.sqrt(self.covariance[is_member, column, column])
        low = float((mean - MAX_SIGMAS * sd).min())
        high = float((mean + MAX_SIGMAS * sd).max())

        def excess(value: float, probability: float) -> float:
            return float(share @ ndtr((value - mean) / sd)) - probability

        first = brentq(excess, low, high, args=(0.5 * outside,))
        last = brentq(excess, low, high, args=(1.0 - 0.5 * outside,))
        return float(first), float(last)


@dataclass(frozen=True)
class NextTest:
    """Bench test with its cost in hours and its worth."""

    name: str
    how: str
    kind: Literal["direct", "shifts", "traces", "record"]
    hours: float
    effects: tuple[str, ...] = ()  #: that a direct test reads
    parameters: tuple[str, ...] = ()  #: its parameters, in the order of its outcome
    cell: int | None = None  #: index of the operating point
    point: tuple[float, float] | None = None  #: its mismatch in rad/s and force in N
    shifts: int = 0  #: number of shifts there
    question: str = ""  #: key of the record in question
    #: Values in the parameters' units; or mean, s, and share engaged; or marks, s.
    outcome: PredictedOutcome | None = None
    information: float = 0.0  #: nats
    gain: float = 0.0  #: expected rise of the answer's probability
    settles: float = 0.0  #: rise of the chance that the truth is named
    misleads: float = 0.0  #: rise of the chance that anything else is named
    refutes: str = ""  #: sentence with the result that refutes the answer, '' for none

    @property
    def gain_per_hour(self) -> float:
        """Gain for each hour of work."""
        return self.gain / self.hours

    @property
    def why(self) -> str:
        """Sentences of the test, its gain, its cost and the result that refutes the answer."""
        sentences = [self.how]
        if self.information >= MIN_INFORMATION_NATS:
            gain = f"{100.0 * self.gain:.0f} %"
            sentences.append(f"Expected rise of the answer's probability: {gain}.")
        sentences.append(f"Work: {number(self.hours)} h.")
        if self.refutes:
            sentences.append(self.refutes)
        return " ".join(sentences)

    def to_dict(self) -> dict[str, Any]:
        """Write the record ``next_test``."""
        record: dict[str, Any] = {
            "name": self.name,
            "why": self.why,
            "kind": self.kind,
            "information_nats": self.information,
            "gain": self.gain,
            "chance_to_settle": self.settles,
            "misleads": self.misleads,
            "hours": self.hours,
            "refutes": self.refutes,
        }
        if self.kind == "direct":
            record["parameters"] = list(self.parameters)
        if self.point is not None:
            mismatch, force = self.point
            record |= {"mismatch_rpm": mismatch / RPM, "force_N": force, "shifts": self.shifts}
        return record


MIN_LOT = 5  #: shifts that a plan adds at once
MAX_LOTS = 20  #: of a plan
REFERENCE_VISITS = 3  #: to the reference point: at the beginning, in the middle, at the end
MAX_SHIFTS = 1_000_000  #: of a plan
TRUTHS = 32  #: values of each effect that may be true
RIVALS = 256  #: values of each effect that may imitate a truth
DISTINCT_LOG_ODDS = 1.5  #: expected log Bayes factor that distinguishes a pair, 4.5 : 1


@dataclass(frozen=True)
class Field:
    """Predictions of all hypotheses at some operating points."""

    hypotheses: tuple[Hypothesis, ...]  #: none, then each effect
    truths: tuple[Array, ...]  #: values that may be true, (m, 4, cells) of each hypothesis
    rivals: tuple[Array, ...]  #: values that imitate them, as many of each
    baseline: Prediction  #: without any effect, (1, cells)
    error: Array  #: standard errors of its means, s, (cells,)
    log_sd_error: Array  #: standard errors of ln of its spreads, (cells,)
    common: Array  #: covariance of the means, s^2, (cells, cells)
    engaged_error: float  #: of a simulated share that engages

    def distances(self, shifts: Array) -> list[Array]:
        """Compute squared distances of truths from all at numbers of shifts, (truths, h)."""
        cells = np.flatnonzero(shifts > 0)
        n = shifts[cells]
        variance = self.baseline.sd[0, cells] ** 2 / n + self.error[cells] ** 2
        covariance = np.diag(variance) + self.common[np.ix_(cells, cells)]
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        error = self.engaged_error
        share = np.clip(self.baseline.engaged_share[0, cells], error, 1.0 - error)
        share_error = np.sqrt(share * (1.0 - share) / n + error**2)
        # One shift has no spread.
        freedom = np.where(n >= 2.0, n - 1.0, 1e-9)
        log_sd_variance = 0.25 * polygamma(1, 0.5 * freedom)
        log_sd_error = np.sqrt(log_sd_variance + self.log_sd_error[cells] ** 2)

        def scale(values: Array) -> tuple[Array, Array]:
            """Scale values (m, 4, cells) to unit errors, (m, d), with their variance, (m,)."""
            mean, log_sd, engaged, emulation = np.moveaxis(values[:, :, cells], 1, 0)
            points = np.hstack([mean @ root.T, log_sd / log_sd_error, engaged / share_error])
            return points, emulation @ (root**2).sum(axis=0)

        rivals = [scale(values) for values in self.rivals]
        distances = []
        for truth_points, truth_noise in map(scale, self.truths):
            columns = []
            for rival_points, rival_noise in rivals:
                cross = -2.0 * truth_points @ rival_points.T + (rival_points**2).sum(axis=1)
                # The nearest with its noise: values of large error are else near to anything.
                nearest = cross.argmin(axis=1)
                square = ((truth_points - rival_points[nearest]) ** 2).sum(axis=1)
                columns.append(square - truth_noise - rival_noise[nearest])
            distances.append(np.maximum(0.0, np.stack(columns, axis=1)))
        return distances

    def worth(self, shifts: Array) -> float:
        """Compute the mean probability to decide a pair rightly; half where nothing is."""
        rows = [ndtr(0.5 * np.sqrt(distance)).mean(axis=0) for distance in self.distances(shifts)]
        is_pair = ~np.eye(len(rows), dtype=bool)
        return float(np.array(rows)[is_pair].mean())


def field_of(likelihood: Likelihood) -> Field:
    """Predict none and each effect alone at the operating points of a likelihood."""
    model = likelihood.model
    settings = likelihood.settings
    base = model.predict(NONE, np.zeros((1, 0)))
    hypotheses = (NONE, *((name,) for name in sorted(model.effects)))
    time = (base.mean - base.delay)[0]
    discrepancy = settings.discrepancy * time[:, None] * likelihood.discrepancy_root
    common = np.hstack([discrepancy, likelihood.common_errors(base)[0]])
    relative_error = settings.spread_error * time / base.sd[0]
    return Field(
        hypotheses=hypotheses,
        truths=tuple(_range_values(model, h, TRUTHS, base) for h in hypotheses),
        rivals=tuple(_range_values(model, h, RIVALS, base) for h in hypotheses),
        baseline=base,
        error=np.sqrt(likelihood.mean_variance(base)[0]),
        log_sd_error=np.hypot(settings.spread_share, np.log1p(relative_error)),
        common=common @ common.T,
        engaged_error=settings.engaged_error,
    )


def _range_values(model: Model, hypothesis: Hypothesis, count: int, base: Prediction) -> Array:
    """Predict mean, ln sd, share engaged, variance of emulation over the range, (m, 4, cells)."""
    size = len(model.space(hypothesis).parameters)
    if size == 0:
        shares = np.zeros((1, 0))
    elif size == 1:
        shares = ((np.arange(count) + 0.5) / count)[:, None]
    else:
        shares = np.asarray(qmc.Sobol(size, seed=1).random(count))
    p = model.predict(hypothesis, shares[model.possible(hypothesis, shares)])
    emulation = np.maximum(0.0, p.error**2 - base.error**2)
    # Where nothing engages the share says so, and there is no mean to compare.
    return np.nan_to_num(np.stack([p.mean, np.log(p.sd), p.engaged_share, emulation], axis=1))


@dataclass(frozen=True)
class ShiftPlan:
    """Plan of shifts and the pairs that it distinguishes."""

    field: Field
    shifts: tuple[int, ...]  #: at each operating point, (cells,), whole numbers
    order: tuple[tuple[int, int], ...]  #: visits: index of the point, number of shifts
    reference: int  #: index of the point that is visited three times
    worth: float  #: mean probability to decide a pair rightly
    log_odds: Array  #: mean expected log Bayes factors of truth (row) and rival, (h, h)
    distinct_share: Array  #: share of a truth's strengths that differ from a rival, (h, h)

    @property
    def hours(self) -> float:
        """Hours of work: each visit is set up."""
        return len(self.order) * SETUP_HOURS + sum(self.shifts) * SHIFT_HOURS


def shift_plan(field: Field, count: int, seed: int = 1, max_points: int | None = None) -> ShiftPlan:
    """Plan ``count`` shifts in random order, at up to ``max_points`` operating points.

    Raises InputError where they are too few for the reference point and one more lot, or too many.
    """
    min_count = (REFERENCE_VISITS + 1) * MIN_LOT
    if not min_count <= count <= MAX_SHIFTS:
        rule = (
            f"it must lie between {min_count} and {MAX_SHIFTS}: a reference point is visited "
            f"{REFERENCE_VISITS} times with {MIN_LOT} shifts each, and {MIN_LOT} more are needed "
            "at another"
        )
        raise InputError(Refusal("number of shifts", count, "", rule, "plan more shifts"))
    # Where single shifts scatter least a drift shows first.
    scatter = np.where(field.baseline.engaged_share[0] > 0.5, field.baseline.sd[0], np.nan)
    reference = int(np.nanargmin(scatter))
    shifts = _distribute_shifts(field, count, reference, max_points or len(field.common))
    numbers = tuple(int(n) for n in shifts)
    log_odds = [0.5 * distance for distance in field.distances(shifts)]
    distinct = [(odds > DISTINCT_LOG_ODDS).mean(axis=0) for odds in log_odds]
    return ShiftPlan(
        field=field,
        shifts=numbers,
        order=visits(numbers, reference, seed),
        reference=reference,
        worth=field.worth(shifts),
        log_odds=np.array([odds.mean(axis=0) for odds in log_odds]),
        distinct_share=np.array(distinct),
    )


def _distribute_shifts(field: Field, count: int, reference: int, max_points: int) -> Array:
    """Distribute shifts in lots, each to the point that adds most, numbers of shifts (cells,)."""
    cells = len(field.common)
    shifts = np.zeros(cells)
    shifts[reference] = REFERENCE_VISITS * MIN_LOT
    lot = max(MIN_LOT, -(-(count - REFERENCE_VISITS * MIN_LOT) // MAX_LOTS))
    remaining = count - int(shifts.sum())
    while remaining:
        step = remaining
        if remaining >= 2 * MIN_LOT and remaining - lot >= MIN_LOT:
            step = lot
        is_full = np.count_nonzero(shifts) >= max_points
        is_open = (shifts > 0) | (not is_full)
        options = shifts + step * np.eye(cells)[is_open]
        shifts = options[int(np.argmax([field.worth(option) for option in options]))]
        remaining = count - int(shifts.sum())
    return shifts


def visits(shifts: Sequence[int], reference: int, seed: int) -> tuple[tuple[int, int], ...]:
    """Order the visits of a plan at random, those to the reference first, amid and last.

    ``shifts`` are the numbers at each operating point; a visit is its index and a number.
    """
    points = [(k, n) for k, n in enumerate(shifts) if n and k != reference]
    mixed = [points[k] for k in np.random.default_rng(seed).permutation(len(points))]
    third, remainder = divmod(shifts[reference], REFERENCE_VISITS)
    first, middle, last = ((reference, third + (k < remainder)) for k in range(REFERENCE_VISITS))
    half = len(mixed) // 2
    return (first, *mixed[:half], middle, *mixed[half:], last)
