r"""Outcome of a bench test as hypotheses predict it, its worth to the decision; plans of shifts.

A hypothesis *h* predicts the outcome *y* by *K* draws of its posterior, each a normal density with
the errors of the test, so the probability after it is

.. math:: P(h | y) \propto \frac{P(h)}{K} \sum_k N(y; \mu_k, \Sigma_k + V_k),

:math:`V_k` the scatter of the nearest draws about it (Breiman, Meisel and Purcell 1977,
Technometrics 19). Beside each effect stands an *imitator*, a cause outside the list that acts on
shift times alike: a test that reads the effect finds of it what it finds of *unknown*.

A *plan* has operating points, numbers and order of shifts, and the pairs that they tell apart. With
the errors that *n* shifts at each operating point leave, two values of hypotheses lie apart by

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
from typing import Any, Literal, Self

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import logsumexp, ndtr, polygamma
from scipy.stats import qmc

from dogshape.diagnosis.inference.verdict import nameable
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.prediction.model import Model, Predicted
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.errors import InputError, number, refusal
from dogshape.sim.units import RPM

NATS = 0.005  #: information of a test from which its chances are stated
OUTCOMES = 256  #: drawn of each test
NEAREST = 8  #: draws that give the width of a density
EDGE = 0.02  #: least share of shifts that engage or fail, and its simulated error
SETUP, TRACING, SHIFT = 0.5, 1.5, 0.02  #: hours for an operating point, for traces, for a shift

Densities = tuple[Array, Array, Array]  #: shares (k,), means (k, d) and covariances (k, d, d)


def smoothed(mean: Array, covariance: Array) -> Densities:
    """Make densities of draws (k, d) with errors (k, d, d), as wide as near draws lie apart."""
    scaled = mean / np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    apart = mean[cdist(scaled, scaled).argsort(axis=1)[:, :NEAREST]] - mean[:, None]
    spread = np.einsum("kni,knj->kij", apart, apart) / apart.shape[1]
    return np.full(len(mean), 1.0 / len(mean)), mean, covariance + spread


@dataclass(frozen=True)
class Outcome:
    """Predicted outcome of a test: normal densities, each a share of a hypothesis' mixture."""

    hypotheses: tuple[Hypothesis, ...]  #: that predict it, *unknown* among them
    owner: np.ndarray  #: place of the hypothesis of each density, ascending, (c,)
    share: Array  #: of its hypothesis, (c,)
    mean: Array  #: of each density, (c, d)
    covariance: Array  #: (c, d, d)
    read: np.ndarray  #: whether the test reads an effect of each hypothesis, (hypotheses,)

    @classmethod
    def of(cls, parts: Mapping[Hypothesis, Densities], reads: Callable[[Hypothesis], bool]) -> Self:
        """Join the densities of several hypotheses."""
        owner = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts.values()])
        share, mean, covariance = (np.concatenate(p) for p in zip(*parts.values(), strict=True))
        read = np.array([h not in (NONE, UNKNOWN) and reads(h) for h in parts])
        return cls(tuple(parts), owner, share, mean, covariance, read)

    @cached_property
    def _roots(self) -> Array:
        return np.asarray(np.linalg.cholesky(self.covariance))

    @property
    def _unknown(self) -> int:
        return self.hypotheses.index(UNKNOWN)

    def log_density(self, outcomes: Array) -> Array:
        """Compute log densities of outcomes (n, d) under each hypothesis, (n, hypotheses)."""
        inverse = np.linalg.inv(self._roots)
        scaled = np.einsum("cij,nj->nci", inverse, outcomes)
        scaled -= np.einsum("cij,cj->ci", inverse, self.mean)
        spread = np.log(np.diagonal(self._roots, axis1=1, axis2=2)).sum(axis=1)
        log = np.log(self.share) - spread - 0.5 * (scaled**2).sum(axis=2)
        log -= 0.5 * self.mean.shape[1] * np.log(2.0 * np.pi)
        starts = np.searchsorted(self.owner, np.arange(len(self.hypotheses)))
        return np.asarray(np.logaddexp.reduceat(log, starts, axis=1))

    def draw(self, which: np.ndarray, generator: np.random.Generator) -> Array:
        """Draw an outcome of each of some hypotheses, by their places (n,), (n, d)."""
        place = np.searchsorted(np.cumsum(self.share), which + generator.random(which.size))
        place = np.minimum(place, np.searchsorted(self.owner, which, side="right") - 1)
        noise = generator.standard_normal((which.size, self.mean.shape[1]))
        return self.mean[place] + np.einsum("nij,nj->ni", self._roots[place], noise)

    def only(self, shown: np.ndarray) -> Outcome:
        """Select the values of the outcome that are shown, (d,) true or false."""
        covariance = self.covariance[:, shown][:, :, shown]
        return replace(self, mean=self.mean[:, shown], covariance=covariance)

    def after(self, before: Array, log: Array, odds: float) -> Array:
        """Update probabilities by log densities (n, hypotheses) and the odds of imitators."""
        odd = np.where(self.read, odds, 0.0)
        like = np.exp(log - log.max(axis=1, keepdims=True))
        own = before / (1.0 + odd) * like
        imitators = before * odd / (1.0 + odd) * like[:, [self._unknown]]
        kept = np.minimum(imitators, odd * own)
        found = own + kept
        found[:, self._unknown] += (imitators - kept).sum(axis=1)
        return np.asarray(found / found.sum(axis=1, keepdims=True))

    def worth(
        self, before: Array, odds: float, settings: Settings, seed: int = 1
    ) -> tuple[float, float, float]:
        """Compute information in nats, and the chances to settle and to mislead.

        A test settles if the truth is named afterwards, and misleads if anything else is. An
        imitator's truth is *unknown*.
        """
        generator, places = np.random.default_rng(seed), np.arange(len(self.hypotheses))
        odd = np.array([0.0 if h in (NONE, UNKNOWN) else odds for h in self.hypotheses])
        weight = np.concatenate([before / (1.0 + odd), before * odd / (1.0 + odd)])
        source = np.concatenate([places, np.where(self.read, self._unknown, places)])
        truth = np.concatenate([places, np.full(places.size, self._unknown)])
        # As many draws of each as its probability: less noise than a random choice of it.
        counts = np.where(weight > 0.0, np.maximum(1, np.round(OUTCOMES * weight)), 0).astype(int)
        every = np.repeat(np.arange(weight.size), counts)
        weights = weight[every] / counts[every]
        log = self.log_density(self.draw(source[every], generator))
        mixed = logsumexp(log[:, source], axis=1, b=weight)
        gain = float(weights @ (log[np.arange(every.size), source[every]] - mixed))
        may = [nameable(h, settings) for h in self.hypotheses]
        sure = (self.after(before, log, odds) > settings.named) & may
        right = sure[np.arange(every.size), truth[every]]
        return max(0.0, gain), float(weights @ right), float(weights @ (sure.any(axis=1) & ~right))


@dataclass(frozen=True)
class NextTest:
    """Bench test with its cost in hours and its worth."""

    name: str
    how: str
    kind: Literal["direct", "shifts", "traces", "record"]
    hours: float
    effects: tuple[str, ...] = ()  #: that a direct test reads
    parameters: tuple[str, ...] = ()  #: its parameters, in the order of its outcome
    cell: int | None = None  #: place of the operating point
    point: tuple[float, float] | None = None  #: its mismatch in rad/s and force in N
    shifts: int = 0  #: number of shifts there
    question: str = ""  #: key of the record in question
    outcome: Outcome | None = None  #: shares of ranges; or mean, s, and share engaged; or marks, s
    information: float = 0.0  #: nats
    settles: float = 0.0  #: chance
    misleads: float = 0.0  #: chance

    @property
    def why(self) -> str:
        """Sentences of the test, its chance to settle the cause and its cost."""
        chance = f" Chance to settle the cause: {100.0 * self.settles:.0f} %."
        return f"{self.how}{chance * (self.information >= NATS)} Work: {number(self.hours)} h."

    def to_dict(self) -> dict[str, Any]:
        """Give the record ``next_test``."""
        record: dict[str, Any] = {
            "name": self.name, "why": self.why, "kind": self.kind,
            "information_nats": self.information, "chance_to_settle": self.settles,
            "misleads": self.misleads, "hours": self.hours,
        }  # fmt: skip
        if self.kind == "direct":
            record["parameters"] = list(self.parameters)
        if self.point is not None:
            mismatch, force = self.point
            record |= {"mismatch_rpm": mismatch / RPM, "force_N": force, "shifts": self.shifts}
        return record


LOT, LOTS = 5, 20  #: shifts given at once, at least; lots of a plan, at most
VISITS = 3  #: to the reference point: at the beginning, in the middle, at the end
TRUTHS, RIVALS = 32, 256  #: values of each effect that may be true, and that may imitate
APART = 1.5  #: expected log Bayes factor from which two hypotheses are told apart, 4.5 : 1


@dataclass(frozen=True)
class Field:
    """Predictions of all hypotheses at some operating points."""

    hypotheses: tuple[Hypothesis, ...]  #: none, then each effect
    truths: tuple[Array, ...]  #: values that may be true, (m, 4, cells) of each hypothesis
    rivals: tuple[Array, ...]  #: values that imitate them, as many of each
    baseline: Predicted  #: without any effect, (1, cells)
    error: Array  #: standard errors of its means, s, (cells,)
    spread: Array  #: standard errors of ln of its spreads, (cells,)
    common: Array  #: covariance of the means, s^2, (cells, cells)

    def distances(self, shifts: Array) -> list[Array]:
        """Compute squared distances of truths from all at numbers of shifts, (truths, h)."""
        used, base = np.flatnonzero(shifts > 0), self.baseline
        n = shifts[used]
        variance = base.sd[0, used] ** 2 / n + self.error[used] ** 2
        covariance = np.diag(variance) + self.common[np.ix_(used, used)]
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        share = np.clip(base.engaged[0, used], EDGE, 1.0 - EDGE)
        engaged = np.sqrt(share * (1.0 - share) / n + EDGE**2)
        # One shift has no spread.
        freedom = np.where(n >= 2.0, n - 1.0, 1e-9)
        spread = np.sqrt(0.25 * polygamma(1, 0.5 * freedom) + self.spread[used] ** 2)

        def placed(values: Array) -> tuple[Array, Array]:
            mean, log_sd, part, own = np.moveaxis(values[:, :, used], 1, 0)
            points = np.hstack([mean @ root.T, log_sd / spread, part / engaged])
            return points, own @ (root**2).sum(axis=0)

        rivals, found = [placed(values) for values in self.rivals], []
        for mine, noise in map(placed, self.truths):
            columns = []
            for theirs, other in rivals:
                cross = -2.0 * mine @ theirs.T + (theirs**2).sum(axis=1)
                # The nearest with its noise: values of large error are else near to anything.
                near = cross.argmin(axis=1)
                columns.append(((mine - theirs[near]) ** 2).sum(axis=1) - noise - other[near])
            found.append(np.maximum(0.0, np.stack(columns, axis=1)))
        return found

    def worth(self, shifts: Array) -> float:
        """Compute the mean probability to decide a pair rightly; half where nothing is."""
        right = [ndtr(0.5 * np.sqrt(one)).mean(axis=0) for one in self.distances(shifts)]
        return float(np.array(right)[~np.eye(len(right), dtype=bool)].mean())


def field_of(likelihood: Likelihood) -> Field:
    """Predict none and each effect alone at the operating points of a likelihood."""
    model, settings = likelihood.model, likelihood.settings
    base = model.predict(NONE, np.zeros((1, 0)))
    hypotheses = (NONE, *((name,) for name in sorted(model.effects)))
    time = (base.mean - base.delay)[0]
    smooth = settings.discrepancy * time[:, None] * likelihood.smooth
    common = np.hstack([smooth, likelihood.columns(base)[0]])
    spread = np.hypot(settings.spread_share, np.log1p(settings.spread_error * time / base.sd[0]))
    truths, rivals = (
        tuple(_values(model, h, count, base) for h in hypotheses) for count in (TRUTHS, RIVALS)
    )
    error = np.sqrt(likelihood.own_variance(base)[0])
    return Field(hypotheses, truths, rivals, base, error, spread, common @ common.T)


def _values(model: Model, hypothesis: Hypothesis, count: int, base: Predicted) -> Array:
    """Predict mean, ln sd, share engaged, variance of emulation over the range, (m, 4, cells)."""
    size = len(model.space(hypothesis).parameters)
    shares = ((np.arange(count) + 0.5) / count)[:, None] if size == 1 else np.zeros((1, 0))
    if size > 1:
        shares = np.asarray(qmc.Sobol(size, seed=1).random(count))
    one = model.predict(hypothesis, shares[model.possible(hypothesis, shares)])
    own = np.maximum(0.0, one.error**2 - base.error**2)
    # Where nothing engages the share says so, and there is no mean to compare.
    return np.nan_to_num(np.stack([one.mean, np.log(one.sd), one.engaged, own], axis=1))


@dataclass(frozen=True)
class ShiftPlan:
    """Plan of shifts and the pairs that it tells apart."""

    field: Field
    shifts: tuple[int, ...]  #: at each operating point, (cells,), whole numbers
    order: tuple[tuple[int, int], ...]  #: visits: place of the point, number of shifts
    reference: int  #: place of the point that is visited three times
    worth: float  #: mean probability to decide a pair rightly
    log_odds: Array  #: mean expected log Bayes factors of truth (row) and rival, (h, h)
    apart: Array  #: share of a truth's strengths that differ from a rival, (h, h)

    @property
    def hours(self) -> float:
        """Hours of work: each visit is set up."""
        return len(self.order) * SETUP + sum(self.shifts) * SHIFT


def shift_plan(field: Field, count: int, seed: int = 1, most: int | None = None) -> ShiftPlan:
    """Plan ``count`` shifts in random order, at ``most`` operating points.

    Raises InputError where they are too few for the reference point and one more lot, or too many.
    """
    least = (VISITS + 1) * LOT
    if not least <= count <= 1_000_000:
        rule = f"it must lie between {least} and 1000000: a reference point is visited {VISITS} "
        rule += f"times with {LOT} shifts each, and {LOT} more are needed at another"
        raise InputError(refusal("number of shifts", count, "", rule, "plan more shifts"))
    # Where single shifts scatter least a drift shows first.
    engaging = np.where(field.baseline.engaged[0] > 0.5, field.baseline.sd[0], np.nan)
    reference = int(np.nanargmin(engaging))
    shifts = np.zeros(len(field.common))
    shifts[reference] = VISITS * LOT
    lot = max(LOT, -(-(count - VISITS * LOT) // LOTS))
    while left := count - int(shifts.sum()):
        step = lot if left >= 2 * LOT and left - lot >= LOT else left
        full = np.count_nonzero(shifts) >= (most or shifts.size)
        more = shifts + step * np.eye(shifts.size)[(shifts > 0) | (not full)]
        shifts = more[int(np.argmax([field.worth(one) for one in more]))]
    whole = tuple(int(n) for n in shifts)
    half = [0.5 * one for one in field.distances(shifts)]
    odds = np.array([one.mean(axis=0) for one in half])
    apart = np.array([(one > APART).mean(axis=0) for one in half])
    order = visits(whole, reference, seed)
    return ShiftPlan(field, whole, order, reference, field.worth(shifts), odds, apart)


def visits(shifts: Sequence[int], reference: int, seed: int) -> tuple[tuple[int, int], ...]:
    """Order the visits of a plan: others at random, the reference first, amid and last."""
    others = [(k, n) for k, n in enumerate(shifts) if n and k != reference]
    mixed = [others[k] for k in np.random.default_rng(seed).permutation(len(others))]
    third, more = divmod(shifts[reference], VISITS)
    first, middle, last = ((reference, third + (k < more)) for k in range(VISITS))
    half = len(mixed) // 2
    return (first, *mixed[:half], middle, *mixed[half:], last)
