r"""Outcome of a bench test as hypotheses predict it, and its worth to the decision.

A hypothesis *h* predicts the outcome *y* by *K* draws of its posterior, each a normal density with
the errors of the test, so the probability after it is

.. math:: P(h | y) \propto \frac{P(h)}{K} \sum_k N(y; a \mu_k + (1 - a) \bar\mu,
          \Sigma_k + (1 - a^2) V),

*V* the covariance of the means :math:`\mu_k`, :math:`\sqrt{1 - a^2}` the kernel width of Silverman
(1986; West 1993). Beside each effect stands an *imitator*, a cause outside the list that acts on
shift times alike: a test that reads the effect finds of it what it finds of *unknown*.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from scipy.special import logsumexp

from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.errors import number
from dogshape.sim.units import RPM

OUTCOMES = 256  #: drawn of each test
EDGE = 0.02  #: least share of shifts that engage or fail, and its simulated error
SETUP, TRACING, SHIFT = 0.5, 1.5, 0.02  #: hours for an operating point, for traces, for a shift

Densities = tuple[Array, Array, Array]  #: shares (k,), means (k, d) and covariances (k, d, d)


def smoothed(mean: Array, covariance: Array) -> Densities:
    """Make densities of draws (k, d) with errors (k, d, d) that keep the draws' covariance."""
    count, size = mean.shape
    square = min(1.0, (4.0 / ((size + 2.0) * count)) ** (2.0 / (size + 4.0)))
    centre = mean.mean(axis=0)
    spread = (mean - centre).T @ (mean - centre) / count
    shrunk = centre + np.sqrt(1.0 - square) * (mean - centre)
    return np.full(count, 1.0 / count), shrunk, covariance + square * spread


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
        self, before: Array, odds: float, named: float, seed: int = 1
    ) -> tuple[float, float, float]:
        """Compute information in nats, and the chances to settle and to mislead.

        A test settles if the truth has more than ``named`` afterwards, and misleads if anything
        else has. An imitator's truth is *unknown*.
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
        sure = self.after(before, log, odds) > named
        right = sure[np.arange(every.size), truth[every]]
        wrong = sure.any(axis=1) & ~right
        return max(0.0, gain), float(weights @ right), float(weights @ wrong)


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
        chance = f"Chance to settle the cause: {100.0 * self.settles:.0f} %"
        return f"{self.how} {chance} ({number(self.hours)} h of work)."

    def to_dict(self) -> dict[str, Any]:
        """Give the record ``next_test``."""
        record: dict[str, Any] = {
            "name": self.name,
            "why": self.why,
            "kind": self.kind,
            "information_nats": self.information,
            "chance_to_settle": self.settles,
            "misleads": self.misleads,
            "hours": self.hours,
        }
        if self.kind == "direct":
            record["parameters"] = list(self.parameters)
        if self.point is not None:
            record["mismatch_rpm"], record["force_N"] = self.point[0] / RPM, self.point[1]
            record["shifts"] = self.shifts
        return record
