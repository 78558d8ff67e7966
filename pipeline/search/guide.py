"""Guides of the sampler: constraints that are known beforehand, and predictions.

``Guide`` is the interface. ``FreeGuide`` serves any study of Optuna's; a study of dogs has its
own (``pipeline.search.dog_guide``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from optuna.distributions import BaseDistribution
from optuna.trial import FrozenTrial
from scipy.special import ndtr

from dogshape.pipeline.search.unit_cube import Space
from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array, Mask, Term, starting
from dogshape.surrogate.fitting import Effort, fit_process
from dogshape.surrogate.process import Process, root_of

Params = Mapping[str, Any]  #: parameters of an Optuna trial
EFFORT = Effort(rows=200, steps=30)  #: of a process over designs alone
#: a smooth part, and a rough one that no other design predicts
TERMS = (
    Term(design=True, point=False),
    Term(design=True, point=False, scales=(0.1, 0.1), first=0.1),
)
FEW = 10  #: values below which a process has parameters of its own and not the likeliest
LEAST = 1e-6  #: variance of noise where none is known, of values scaled to one


class Prediction(Protocol):
    """Prediction of other designs from finished trials."""

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        """Draw all objectives of designs jointly, to be minimised, (count, m, k)."""

    def chances(self, params: Sequence[Params]) -> Array:
        """Return the probability that constraints hold which are known afterwards only, (m,)."""


class Guide(Protocol):
    """Search space, known constraints, and predictions from finished trials."""

    distributions: Mapping[str, BaseDistribution] | None

    def allows(self, params: Params) -> bool:
        """Check whether a design keeps the constraints that are known beforehand."""

    def refusal(self, none_of: str) -> str:
        """Explain why nothing is allowed, after words such as *none of 80000 designs*."""

    def predict(self, space: Space, trials: Sequence[FrozenTrial], signs: Array) -> Prediction:
        """Fit a prediction to finished trials; ``signs`` (k,) is -1 for maximised objectives.

        Raises InputError where they are too few to say anything.
        """


class FreeGuide:
    """A guide that knows nothing beforehand: any search space, objectives and constraints."""

    distributions: Mapping[str, BaseDistribution] | None = None

    def allows(self, params: Params) -> bool:
        """Allow everything."""
        return True

    def refusal(self, none_of: str) -> str:
        """Write that nothing is allowed."""
        return f"{none_of} is allowed"

    def predict(self, space: Space, trials: Sequence[FrozenTrial], signs: Array) -> Prediction:
        """Fit a process to each objective and to each constraint."""
        x = space.coordinates([trial.params for trial in trials])
        values = np.array([trial.values for trial in trials]) * signs
        names = sorted({name for trial in trials for name in trial.constraints})
        limits = []
        for name in names:
            kept = [name in trial.constraints for trial in trials]
            known = np.array([t.constraints[name] for t in trials if name in t.constraints])
            # A few values alike do not bound others: those may be as far off as the limit.
            least = abs(float(known.mean())) / len(known) ** 0.5
            limits.append(Response.fitted(x[kept], known, least=least))
        return _Free(space, [Response.fitted(x, y) for y in values.T], limits)


@dataclass(frozen=True)
class Response:
    """A process over designs alone, of values scaled to a standard deviation of one."""

    process: Process
    scale: float

    @classmethod
    def fitted(
        cls, x: Array, values: Array, errors: Array | None = None, least: float = 0.0
    ) -> Response:
        """Fit values (n,) at coordinates (n, c); ``errors`` are their standard errors, (n,).

        ``least`` is a standard deviation that values of other designs have at least. Fewer than
        ``FEW`` values have the process of a standard deviation of one, over the whole range: their
        likelihood says nothing. InputError where there is none.
        """
        if not len(values):
            raise InputError("no design was simulated yet")
        scale = max(float(values.std()), least) or abs(float(values.mean())) or 1.0
        noise = np.full(len(values), LEAST) if errors is None else (errors / scale) ** 2 + LEAST
        data, size = (x, values / scale, noise), x.shape[1]
        if len(values) < FEW:
            theta: Array = starting(TERMS, size, 0)[0]
            theta[[0, -1]] = np.log([1.0, 0.1])  # variances of the smooth part and the rough one
            return cls(fit_process(TERMS, size, data, theta, Effort(steps=0)), scale)
        return cls(fit_process(TERMS, size, data, effort=EFFORT), scale)

    def draws(self, x: Array, rng: np.random.Generator, count: int) -> Array:
        """Draw values at coordinates (m, c) jointly, (count, m)."""
        return drawn(*self.joint(x), rng, count)

    def joint(self, x: Array) -> tuple[Array, Array]:
        """Return mean (m,) and covariance (m, m) of values at coordinates (m, c)."""
        mean, covariance = self.process.joint(x)
        return mean * self.scale, covariance * self.scale**2

    def below(self, x: Array, limit: float = 0.0) -> Array:
        """Return the probability that values at coordinates (m, c) are below a limit, (m,).

        The process takes the mean of its values for its level, which few of them know badly.
        """
        mean, variance = self.process.predict(x)
        level = 1.0 / len(self.process.targets)
        chance: Array = ndtr((limit / self.scale - mean) / np.sqrt(variance + level + LEAST))
        return chance


@dataclass(frozen=True)
class _Free:
    space: Space
    objectives: list[Response]
    limits: list[Response]

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        """Draw each objective on its own: their errors are taken as independent."""
        x = self.space.coordinates(params)
        return np.stack([one.draws(x, rng, count) for one in self.objectives], axis=2)

    def chances(self, params: Sequence[Params]) -> Array:
        """Multiply the probabilities of the constraints."""
        x, chance = self.space.coordinates(params), np.ones(len(params))
        for limit in self.limits:
            chance *= limit.below(x)
        return chance


def drawn(mean: Array, covariance: Array, rng: np.random.Generator, count: int) -> Array:
    """Draw from a normal distribution with mean (m,) and covariance (m, m), (count, m)."""
    draws: Array = mean + rng.standard_normal((count, len(mean))) @ root_of(covariance).T
    return draws


def sound(trials: Sequence[FrozenTrial]) -> Mask:
    """Mark the trials with finite values, (n,) of bool."""
    return np.array([bool(np.isfinite(trial.values).all()) for trial in trials], dtype=bool)
