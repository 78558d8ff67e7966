"""Guides of the sampler: constraints that are known beforehand, and predictions.

``Guide`` is the interface. ``FreeGuide`` serves any study of Optuna's.

``DogGuide`` is that of a study of dogs. Constraints that cost nothing are known exactly: what they
forbid is never proposed. Expected times come from the surrogate over designs and operating points,
fitted to every row so far; each other objective that needs a simulation has a process over designs,
fitted to its values with their standard errors. How hard dogs land on each other, and how many
shifts engage, is known after the simulation only; another process over designs predicts that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial
from scipy.special import ndtr

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.state import distinct, simulated_rows, trial_of
from dogshape.pipeline.search.unit_cube import Space
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    SIMULATED,
    exact_losses,
    objectives_of,
    simulated_limits,
    worth_simulating,
)
from dogshape.pipeline.simulate.failing import none_passes
from dogshape.pipeline.train.training_rows import with_rows
from dogshape.sim.errors import InputError
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.surrogate.covariance import Array, Mask, Term, first_parameters
from dogshape.surrogate.model import Surrogate, fit
from dogshape.surrogate.process import Effort, Process, draw_jointly, fit_process

Params = Mapping[str, Any]  #: parameters of an Optuna trial
EFFORT = Effort(designs=200, steps=30)  #: of a process, fitted again in each round
NONE = Effort(steps=0)
#: a smooth part, and a rough one that no other design predicts
TERMS = (Term(), Term(scales=(0.1, 0.1), first=0.1))
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
    """A process over designs of one objective or constraint."""

    process: Process

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
        unsure = np.zeros(len(values)) if errors is None else errors
        noise = LEAST * scale**2 + unsure[:, None] ** 2
        theta, effort = None, EFFORT
        if len(values) < FEW:
            theta, effort = first_parameters(TERMS, x.shape[1])[0], NONE
            theta[[0, -1]] = np.log([1.0, 0.1])  # variances of the smooth part and the rough one
        targets = values[:, None]
        return cls(
            fit_process(
                TERMS, x, targets, noise, start=theta, effort=effort, scale=np.array([scale])
            )
        )

    def draws(self, x: Array, rng: np.random.Generator, count: int) -> Array:
        """Draw values at coordinates (m, c) jointly, (count, m)."""
        return draw_jointly(*self.process.joint(x), rng, count)

    def below(self, x: Array, limit: float = 0.0) -> Array:
        """Return the probability that values at coordinates (m, c) are below a limit, (m,).

        The process takes the mean of its values for its level, which few of them know badly.
        """
        mean, variance = (found[:, 0] for found in self.process.predict(x))
        level = (1.0 / len(self.process.targets) + LEAST) * self.process.scale[0] ** 2
        chance: Array = ndtr((limit - mean) / np.sqrt(variance + level))
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


def sound(trials: Sequence[FrozenTrial]) -> Mask:
    """Mark the trials with finite values, (n,) of bool."""
    return np.array([bool(np.isfinite(trial.values).all()) for trial in trials], dtype=bool)


#: standard deviation of the constraint of the hardest landing (load over its limit, less one) over
#: designs, at least: 0.19 in each of three sets of 12 to 16 designs that fill the default space
LANDING_SPREAD = 0.2
#: Checks that a process over designs predicts: of the worst of them.
LANDING = {*(rule.name for rule in LANDING_RULES), ENGAGEMENT.name}


def search_space(study: Setup) -> dict[str, BaseDistribution]:
    """Return the search ranges as Optuna's distributions."""
    return {
        key: IntDistribution(int(low), int(high))
        if key == "count"
        else FloatDistribution(low, high)
        for key, (low, high) in study.variables.items()
    }


class DogGuide:
    """Search space, exact constraints and the surrogate of a study."""

    def __init__(self, study: Setup) -> None:
        self.study = study
        self._exact: dict[tuple[Any, ...], Array] = {}
        self.distributions: Mapping[str, BaseDistribution] | None = search_space(study)

    def allows(self, params: Params) -> bool:
        """Check whether a design passes every check that needs no simulation."""
        return worth_simulating(self.study, dict(params))

    def refusal(self, none_of: str) -> str:
        """Explain which checks the designs of the space fail, and what would help."""
        return none_passes(self.study, none_of)

    def predict(self, space: Space, trials: Sequence[FrozenTrial], signs: Array) -> Prediction:
        """Fit the surrogate to the rows of all trials, and a process to their landings.

        InputError where too few were simulated.
        """
        study, constraints = self.study, {t.number: t.constraints for t in trials}
        every = [trial for trial in map(trial_of, trials) if trial.simulated]
        told = distinct(every)
        if not told:
            raise InputError("no design was simulated yet")
        x = space.coordinates([trial.params for trial in told])
        # The constraint value of the hardest landing, feasible at or below zero.
        landed = [
            [v for n, v in constraints[trial.number].items() if n in LANDING] for trial in told
        ]
        hardest = np.array([max(values, default=-1.0) for values in landed])
        limits = [
            # A loss may be fifty times its limit: far from it the size says little.
            Response.fitted(x, np.arcsinh([constraints[t.number][name] for t in told]))
            for name in simulated_limits(study)
        ]
        found = [trial.losses(study) for trial in told]
        losses, errors = (np.array([pair[i] for pair in found]) for i in (0, 1))
        landing = Response.fitted(x, hardest, least=LANDING_SPREAD)
        timed, others = None, {}
        for column, objective in enumerate(objectives_of(study)):
            if objective.name == SIMULATED:
                data = with_rows(study, np.array(simulated_rows(every), dtype=float))
                timed = column, fit(data, replace(EFFORT, seed=study.file.search.seed), NONE)
            elif objective.simulated:
                others[column] = Response.fitted(x, losses[:, column], errors[:, column])
        return _DogPrediction(self, space, timed, others, (landing, *limits))

    def exact(self, params: Sequence[Params]) -> Array:
        """Return the objectives as losses, (m, k): NaN where a simulation has to say."""
        keys = [tuple(p[name] for name in self.study.variables) for p in params]
        new = {k: dict(p) for k, p in zip(keys, params, strict=True) if k not in self._exact}
        self._exact |= dict(zip(new, exact_losses(self.study, list(new.values())), strict=True))
        return np.array([self._exact[key] for key in keys])


@dataclass(frozen=True)
class _DogPrediction:
    """Surrogate of the expected time with its column, processes of other columns and of limits."""

    guide: DogGuide
    space: Space
    timed: tuple[int, Surrogate] | None
    others: dict[int, Response]
    limits: tuple[Response, ...]

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        """Draw losses jointly; the rough part of times is left out, as no draw of it would last."""
        losses: Array = np.repeat(self.guide.exact(params)[None], count, axis=0)
        if self.timed is not None:
            column, surrogate = self.timed
            expected = surrogate.joint(self.guide.study.rows(params))
            losses[:, :, column] = draw_jointly(*expected, rng, count)
        x = self.space.coordinates(params)
        for column, response in self.others.items():
            losses[:, :, column] = response.draws(x, rng, count)
        return losses

    def chances(self, params: Sequence[Params]) -> Array:
        """Return the probability that designs land softly enough and keep each limit, (m,).

        Each is taken as independent of the others.
        """
        x = self.space.coordinates(params)
        chances: Array = np.prod([one.below(x) for one in self.limits], axis=0)
        return chances
