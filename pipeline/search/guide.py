"""Knowledge of the sampler about dogs: search space, exact constraints and predictions.

What an exact constraint forbids is never proposed. Expected times come from the surrogate, fitted
to every row so far; each other simulated objective or limit, and the worst of landing and
engagement, has a process over designs of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial
from scipy.special import ndtr

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.state import distinct, trial_of
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    SIMULATED,
    exact_losses,
    none_passes,
    objectives_of,
    simulated_limits,
    worth_simulating,
)
from dogshape.pipeline.train.training_rows import with_rows
from dogshape.sim.errors import InputError
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.surrogate.covariance import Array, Term, first_parameters
from dogshape.surrogate.model import Surrogate, fit
from dogshape.surrogate.process import Effort, Process, draw_jointly, fit_process

Params = dict[str, Any]  #: searched keys of a design, edge units
EFFORT = Effort(designs=200, steps=30)  #: of a process, fitted again in each round
NONE = Effort(steps=0)
#: a smooth part, and a rough one that no other design predicts
TERMS = (Term(), Term(scales=(0.1, 0.1), first=0.1))
MIN_VALUES = 10  #: values below which a process has parameters of its own and not the likeliest
MIN_NOISE = 1e-6  #: variance of noise where none is known, of values scaled to one
#: standard deviation of the constraint of the hardest landing (load over its limit, less one) over
#: designs, at least: 0.19 in each of three sets of 12 to 16 designs that fill the default space
LANDING_SPREAD = 0.2
#: Checks that a process over designs predicts: of the worst of them.
LANDING = {*(rule.name for rule in LANDING_RULES), ENGAGEMENT.name}
NEAR = 0.08  #: of the range, standard deviation of a draw near a design


class Space:
    """Search ranges as a unit cube, by name; that of the whole count is half a step wider."""

    def __init__(self, variables: Mapping[str, tuple[float, float]]) -> None:
        self.distributions: dict[str, BaseDistribution] = {
            name: IntDistribution(int(low), int(high))
            if name == "count"
            else FloatDistribution(low, high)
            for name, (low, high) in variables.items()
        }
        self.variables = dict(sorted(variables.items()))
        half = np.array([0.5 if name == "count" else 0.0 for name in self.variables])
        ends = np.array(list(self.variables.values()), dtype=float).reshape(-1, 2)
        self._low, self._high = ends[:, 0] - half, ends[:, 1] + half

    def coordinates(self, designs: Sequence[Params]) -> Array:
        """Return points of the unit cube for designs, (m, d)."""
        rows = [[design[name] for name in self.variables] for design in designs]
        values = np.array(rows, dtype=float).reshape(len(designs), len(self.variables))
        cube: Array = (values - self._low) / (self._high - self._low)
        return cube

    def holds(self, params: Params) -> bool:
        """Check whether a design has every variable, within its range."""
        pairs = self.variables.items()
        return all(name in params and low <= params[name] <= high for name, (low, high) in pairs)

    def key(self, params: Params) -> tuple[float, ...]:
        """Return a hashable key of a design; equal ones have equal keys."""
        return tuple(float(params[name]) for name in self.variables)

    def draw(self, rng: np.random.Generator, near: Params | None = None) -> Params:
        """Draw a design: evenly, or normal about one with a deviation of ``NEAR`` of the range."""
        middle = None if near is None else self.coordinates([near])[0]
        found: Params = {}
        for k, (name, (low, high)) in enumerate(self.variables.items()):
            unit = rng.random() if middle is None else middle[k] + rng.normal(0.0, NEAR)
            unit = min(max(float(unit), 0.0), 1.0)
            value = float(self._low[k]) + unit * float(self._high[k] - self._low[k])
            value = min(max(round(value) if name == "count" else value, low), high)
            found[name] = round(value) if name == "count" else value
        return found


@dataclass(frozen=True)
class Response:
    """A process over designs of one objective or constraint."""

    process: Process

    @classmethod
    def fitted(
        cls, x: Array, values: Array, errors: Array | None = None, least: float = 0.0
    ) -> Response:
        """Fit values (n,) at coordinates (n, c); ``errors`` are their standard errors, (n,).

        ``least`` is a standard deviation that values of other designs have at least. Parameters of
        fewer than ``MIN_VALUES`` values are given. InputError where there is none.
        """
        if not len(values):
            raise InputError("no design was simulated yet")
        scale = max(float(values.std()), least) or abs(float(values.mean())) or 1.0
        unsure = np.zeros(len(values)) if errors is None else errors
        noise = MIN_NOISE * scale**2 + unsure[:, None] ** 2
        theta, effort = None, EFFORT
        if len(values) < MIN_VALUES:
            theta, effort = first_parameters(TERMS, x.shape[1])[0], NONE
            theta[[0, -1]] = np.log([1.0, 0.1])  # variances of the smooth part and the rough one
        given: dict[str, Any] = {"start": theta, "effort": effort, "scale": np.array([scale])}
        return cls(fit_process(TERMS, x, values[:, None], noise, **given))

    def draws(self, x: Array, rng: np.random.Generator, count: int) -> Array:
        """Draw values at coordinates (m, c) jointly, (count, m)."""
        return draw_jointly(*self.process.joint(x), rng, count)

    def below(self, x: Array, limit: float = 0.0) -> Array:
        """Return the probability that values at coordinates (m, c) are below a limit, (m,).

        The process takes the mean of its values for its level, which few of them know badly.
        """
        mean, variance = (found[:, 0] for found in self.process.predict(x))
        level = (1.0 / len(self.process.targets) + MIN_NOISE) * self.process.scale[0] ** 2
        chance: Array = ndtr((limit - mean) / np.sqrt(variance + level))
        return chance


class Guide:
    """Search space, exact constraints and predictions of a study."""

    def __init__(self, study: Setup) -> None:
        self.study = study
        self.space = Space(study.variables)
        self._exact: dict[tuple[float, ...], Array] = {}

    def allows(self, params: Params) -> bool:
        """Check whether a design passes every check that needs no simulation."""
        return worth_simulating(self.study, params)

    def refusal(self, none_of: str) -> str:
        """Explain why nothing is allowed, after words such as *none of 80000 designs*."""
        return none_passes(self.study, none_of)

    def predict(self, trials: Sequence[FrozenTrial]) -> Prediction:
        """Fit the surrogate to the rows of all trials, and a process to their landings.

        InputError where too few were simulated.
        """
        study, constraints = self.study, {t.number: t.constraints for t in trials}
        every = [trial for trial in map(trial_of, trials) if trial.simulated]
        different = distinct(every)
        if not different:
            raise InputError("no design was simulated yet")
        x = self.space.coordinates([trial.params for trial in different])
        # The constraint value of the hardest landing, feasible at or below zero.
        landed = [
            [v for n, v in constraints[trial.number].items() if n in LANDING] for trial in different
        ]
        hardest = np.array([max(values, default=-1.0) for values in landed])
        limits = [
            # A loss may be fifty times its limit: far from it the size says little.
            Response.fitted(x, np.arcsinh([constraints[t.number][name] for t in different]))
            for name in simulated_limits(study)
        ]
        found = [trial.losses(study) for trial in different]
        losses, errors = (np.array([pair[i] for pair in found]) for i in (0, 1))
        landing = Response.fitted(x, hardest, least=LANDING_SPREAD)
        timed, others = None, {}
        for column, objective in enumerate(objectives_of(study)):
            if objective.name == SIMULATED:
                rows = [row for trial in every for row in trial.rows]
                data = with_rows(study, np.array(rows, dtype=float))
                timed = column, fit(data, replace(EFFORT, seed=study.file.search.seed), NONE)
            elif objective.simulated:
                others[column] = Response.fitted(x, losses[:, column], errors[:, column])
        return Prediction(self, timed, others, (landing, *limits))

    def exact(self, params: Sequence[Params]) -> Array:
        """Return the objectives as losses, (m, k): NaN where a simulation has to say."""
        keys = [self.space.key(p) for p in params]
        new = {k: p for k, p in zip(keys, params, strict=True) if k not in self._exact}
        self._exact |= dict(zip(new, exact_losses(self.study, list(new.values())), strict=True))
        return np.array([self._exact[key] for key in keys])


@dataclass(frozen=True)
class Prediction:
    """Surrogate of the expected time with its column, processes of other columns and limits."""

    guide: Guide
    timed: tuple[int, Surrogate] | None
    others: dict[int, Response]
    limits: tuple[Response, ...]

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        """Draw all objectives of designs jointly, to be minimised, (count, m, k).

        The rough part of times is left out, as no draw of it would last.
        """
        losses: Array = np.repeat(self.guide.exact(params)[None], count, axis=0)
        if self.timed is not None:
            column, surrogate = self.timed
            expected = surrogate.joint(self.guide.study.rows(params))
            losses[:, :, column] = draw_jointly(*expected, rng, count)
        x = self.guide.space.coordinates(params)
        for column, response in self.others.items():
            losses[:, :, column] = response.draws(x, rng, count)
        return losses

    def chances(self, params: Sequence[Params]) -> Array:
        """Return the probability that designs keep each limit, as if independent, (m,)."""
        x = self.guide.space.coordinates(params)
        return np.asarray(np.prod([one.below(x) for one in self.limits], axis=0), dtype=float)
