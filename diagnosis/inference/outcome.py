r"""Predicted outcome of a bench test, and what the test is worth to the decision.

Each hypothesis predicts the outcome by a mixture of normal densities. *Unknown* does so too. Beside
every hypothesis stands its *imitator*: something outside the list that looks like it in all shifts
seen so far. Together imitators have ``IMITATED`` of the probability that *unknown* has before, each
as its hypothesis. Where a test reads what the hypothesis consists of, its imitator predicts the
same as *unknown*, else the same as the hypothesis.

An imitator counts with its hypothesis, as it does in the diagnosis, until an outcome tells them
apart: what it then has beyond its odds is *unknown*. So an outcome that excludes a hypothesis does
not hand all of its probability to the next one.

A test is worth

- its *information*, the mutual information of cause and outcome, :math:`H(p) - E_y H(p | y)`, nats;
- the chance that it *settles* the decision: the truth or a member of its class has more than 0.8
  afterwards, or each of its effects is part of the cause with more than 0.95;
- the chance that it *misleads*: something else passes one of these limits.

Outcomes are drawn from all hypotheses and their imitators.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.bench.sense import forward
from dogshape.diagnosis.inference.classes import Confusion
from dogshape.diagnosis.inference.verdict import MODEL_FORM, MOST, NAMED, PART
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis

DRAWN = 400  #: outcomes drawn
#: Share of things outside the list that look like something on it: 11 of the 18 that the diagnosis
#: neither recognised nor refused in an earlier sealed set.
IMITATED = 0.61
#: Odds of an imitator to its hypothesis, with the prior probability of *unknown*.
ODDS = USUAL.priors.unlisted * IMITATED / (1.0 - USUAL.priors.unlisted)


@dataclass(frozen=True)
class Outcome:
    """Predicted outcome of a test: normal densities, each a share of a hypothesis' mixture.

    Parameters
    ----------
    owner : place of the hypothesis of each density, ascending, (c,).
    share : of its hypothesis, (c,).
    mean, covariance : of each density, (c, d) and (c, d, d).
    read : whether the test reads what each hypothesis consists of, (hypotheses,).
    """

    owner: np.ndarray
    share: Array
    mean: Array
    covariance: Array
    read: np.ndarray

    @classmethod
    def normal(cls, mean: Array, variance: Array, read: np.ndarray | None = None) -> Self:
        """Make an outcome of one density a hypothesis; mean and variance (hypotheses, d)."""
        count, size = mean.shape
        reads = np.zeros(count, dtype=bool) if read is None else read
        squares = variance[:, None, :] * np.eye(size)
        return cls(np.arange(count), np.ones(count), mean, squares, reads)

    @cached_property
    def _roots(self) -> Array:
        return np.asarray(np.linalg.cholesky(self.covariance), dtype=np.float64)

    def log_density(self, outcomes: Array) -> Array:
        """Return the log density of outcomes (n, d) under each hypothesis, (n, hypotheses)."""
        inverse = np.linalg.inv(self._roots)
        gaps = outcomes[:, None, :] - self.mean
        scaled = np.einsum("cij,ncj->nci", inverse, gaps)
        spread = np.log(np.diagonal(self._roots, axis1=1, axis2=2)).sum(axis=1)
        log = np.log(self.share) - spread - 0.5 * (scaled**2).sum(axis=2)
        log = log - 0.5 * self.mean.shape[1] * np.log(2.0 * np.pi)
        starts = np.searchsorted(self.owner, np.arange(self.read.size))
        return np.logaddexp.reduceat(log, starts, axis=1)

    def draw(self, which: np.ndarray, generator: np.random.Generator) -> Array:
        """Return an outcome of each of some hypotheses, by their places (n,), (n, d)."""
        # The densities of a hypothesis stand one after the other, with shares that add to one.
        ends = np.cumsum(self.share)
        place = np.searchsorted(ends, which + generator.random(which.size) * (1.0 - 1e-9))
        place = np.minimum(place, self.share.size - 1)
        noise = generator.standard_normal((which.size, self.mean.shape[1]))
        return self.mean[place] + np.einsum("nij,nj->ni", self._roots[place], noise)


@dataclass(frozen=True)
class Worth:
    """Worth of a test: information in nats, chance to settle, chance to mislead."""

    information: float
    settles: float
    misleads: float


@dataclass(frozen=True)
class Decision:
    """Probabilities of hypotheses, and the limits by which the diagnosis decides.

    Parameters
    ----------
    hypotheses : that take part, *unknown* among them.
    probabilities : of each, imitators counted with their hypotheses, (h,).
    alike : whether two are one class, (h, h).
    measured : effects that a direct test has shown.
    odds : of an imitator to its hypothesis; none and *unknown* have none.
    """

    hypotheses: tuple[Hypothesis, ...]
    probabilities: Array
    alike: np.ndarray
    measured: frozenset[str] = frozenset()
    odds: float = ODDS

    @classmethod
    def of(
        cls,
        hypotheses: Sequence[Hypothesis],
        probabilities: Array,
        confusion: Confusion,
        measured: Collection[str] = (),
    ) -> Self:
        """Make the decision over some hypotheses; their probabilities are made to add to one."""
        groups = [confusion.class_of(h) for h in hypotheses]
        alike = np.array([[other in group for other in hypotheses] for group in groups])
        whole = probabilities / probabilities.sum()
        return cls(tuple(hypotheses), whole, alike, frozenset(measured))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All effects of the hypotheses."""
        return tuple(dict.fromkeys(n for h in self.hypotheses if h != UNKNOWN for n in forward(h)))

    @cached_property
    def parts(self) -> Array:
        """Mark the effects of each hypothesis, 1 or 0, (h, effects)."""
        rows = [[n in h and h != UNKNOWN for n in self.names] for h in self.hypotheses]
        return np.array(rows, dtype=float).reshape(len(self.hypotheses), len(self.names))

    @cached_property
    def imitated(self) -> Array:
        """Odds of the imitator of each hypothesis, (h,)."""
        return np.array([0.0 if h in (NONE, UNKNOWN) else self.odds for h in self.hypotheses])

    @property
    def unknown(self) -> int:
        """Place of *unknown*."""
        return self.hypotheses.index(UNKNOWN)

    def settled(self, shows: Collection[str] = ()) -> bool:
        """Test that the probabilities already settle the most probable hypothesis."""
        top = np.array([int(np.argmax(self.probabilities))])
        return bool(self.judged(self.probabilities[None], top, shows)[0][0])

    def judged(
        self, after: Array, truth: np.ndarray, shows: Collection[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Judge probabilities (n, h) by the place of each truth (n,): settled, and misleading.

        ``shows`` are the effects that the test reads itself, with which it may name what shifts
        alone cannot (``diagnosis.inference.verdict.MODEL_FORM``).
        """
        form = MODEL_FORM - set(shows) - self.measured
        may = [not form & set(h) and len(forward(h)) <= MOST for h in self.hypotheses]
        named = (after > NAMED) & np.array(may)
        alike = self.alike[truth]
        sure = np.array([name not in form for name in self.names], dtype=bool)
        included = (after @ self.parts > PART) & sure
        own = self.parts[truth] > 0.0
        known = own.any(axis=1) & np.where(own, included, True).all(axis=1)
        # What is said to be part of the cause may be an effect of any member of the class.
        right = (self.alike.astype(float) @ self.parts > 0.0)[truth]
        wrong = (named & ~alike).any(axis=1) | (included & ~right).any(axis=1)
        return ((named & alike).any(axis=1) | known) & ~wrong, wrong

    def after(self, log: Array, read: np.ndarray) -> Array:
        """Return the probabilities after outcomes of log densities (n, h), (n, h)."""
        odds = np.where(read, self.imitated, 0.0)
        return probabilities_after(self.probabilities, log, odds, self.unknown)

    def worth(self, outcome: Outcome, shows: Collection[str] = (), seed: int = 1) -> Worth:
        """Compute the worth of a test by outcomes that are drawn."""
        generator = np.random.default_rng(seed)
        odds, size = self.imitated, len(self.hypotheses)
        true, false = (self.probabilities * part / (1.0 + odds) for part in (1.0, odds))
        weight = np.concatenate([true, false])
        # An imitator's outcome is that of *unknown* where the test reads what it imitates.
        source = np.concatenate(
            [np.arange(size), np.where(outcome.read, self.unknown, np.arange(size))]
        )
        truth = np.concatenate([np.arange(size), np.full(size, self.unknown)])
        # As many draws of each as its probability: less noise than drawing which.
        counts = np.where(weight > 0.0, np.maximum(1, np.round(DRAWN * weight)), 0).astype(int)
        every = np.repeat(np.arange(2 * size), counts)
        weights = weight[every] / counts[every]
        log = outcome.log_density(outcome.draw(source[every], generator))
        mixed = np.concatenate([log, log[:, source[size:]]], axis=1)
        whole = logsumexp(mixed, axis=1, b=weight)
        gain = float(weights @ (log[np.arange(every.size), source[every]] - whole))
        after = self.after(log, outcome.read)
        settled, wrong = self.judged(after, truth[every], shows)
        return Worth(max(0.0, gain), float(weights @ settled), float(weights @ wrong))


def probabilities_after(probabilities: Array, log: Array, odds: Array, unknown: int) -> Array:
    """Update probabilities (h,) by outcomes of log densities (n, h), (n, h).

    ``odds`` (h,) are those of imitators that predict what the hypothesis at the place ``unknown``
    predicts, 0 where they predict the same as theirs. What an imitator has beyond its odds goes to
    *unknown*.
    """
    like = np.exp(log - log.max(axis=1, keepdims=True))
    own = probabilities / (1.0 + odds) * like
    imitators = probabilities * odds / (1.0 + odds) * like[:, [unknown]]
    kept = np.minimum(imitators, odds * own)
    found = own + kept
    found[:, unknown] += (imitators - kept).sum(axis=1)
    whole: Array = found / found.sum(axis=1, keepdims=True)
    return whole
