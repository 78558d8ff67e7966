"""The sampler's guide for a study of dogs.

Constraints that cost nothing are known exactly: what they forbid is never proposed. Expected times
come from the surrogate over designs and operating points, fitted to every row so far; each other
objective that needs a simulation has a process over designs, fitted to its values with their
standard errors. How hard dogs land on each other, and how many shifts engage, is known after the
simulation only; another process over designs predicts that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.guide import Params, Prediction, Response, drawn
from dogshape.pipeline.search.point_choice import first_plan, telling_plan
from dogshape.pipeline.search.unit_cube import Space
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    MEASURED,
    SIMULATED,
    exact_losses,
    losses_of,
    objectives_of,
    simulated_limits,
    worth_simulating,
)
from dogshape.pipeline.simulate.failing import none_passes
from dogshape.pipeline.simulate.point_plans import Plan
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.sim.errors import InputError
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset, once
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.learning import fit

QUICK = Effort(rows=400, steps=30)  #: of the process that is fitted anew in each round
OWN = ("surrogate", "space_filling")  #: samplers that say what to simulate of a design
#: standard deviation of the constraint of the hardest landing (load over its limit, less one) over
#: designs, at least: 0.19 in each of three sets of 12 to 16 designs that fill the default space
LANDING_SPREAD = 0.2
SCREENED = "screened"  #: attribute of a trial: rows of the compiled engine, where Drake has none
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


def simulated(trial: FrozenTrial) -> bool:
    """Check whether the design of a finished trial was simulated."""
    return "standard_error_s" in trial.user_attrs


def distinct(trials: Sequence[FrozenTrial]) -> list[FrozenTrial]:
    """Select the first trial of each design: one that was proposed again is the same."""
    first: dict[tuple[Any, ...], FrozenTrial] = {}
    for trial in trials:
        first.setdefault(tuple(sorted(trial.params.items())), trial)
    return list(first.values())


def dataset_of_trials(study: Setup, trials: Sequence[FrozenTrial]) -> Dataset:
    """Collect the rows that simulated trials carry, each once."""
    rows = [row for trial in trials for row in trial.user_attrs["rows"]]
    return with_rows(study, once(np.array(rows, dtype=float)))


class DogGuide:
    """Search space, exact constraints and the surrogate of a study."""

    def __init__(self, study: Setup) -> None:
        self.study = study
        self._over: tuple[list[tuple[int, Any]], Over] | None = None
        self._exact: dict[tuple[Any, ...], Array] = {}
        self.distributions: Mapping[str, BaseDistribution] | None = search_space(study)

    def allows(self, params: Params) -> bool:
        """Check whether a design passes every check that needs no simulation."""
        return worth_simulating(self.study, dict(params))

    def refusal(self, none_of: str) -> str:
        """Explain which checks the designs of the space fail, and what would help."""
        return none_passes(self.study, none_of)

    def predict(self, space: Space, trials: Sequence[FrozenTrial], signs: Array) -> Prediction:
        """Fit the surrogate to the rows of all trials, and a process to their landings."""
        every = [trial for trial in trials if simulated(trial)]
        told = distinct([t for t in trials if simulated(t) or SCREENED in t.user_attrs])
        x = space.coordinates([trial.params for trial in told])
        # The constraint value of the hardest landing, feasible at or below zero.
        judged = distinct([t for t in trials if simulated(t) or MEASURED in t.user_attrs])
        places = space.coordinates([trial.params for trial in judged])
        landed = [[v for n, v in trial.constraints.items() if n in LANDING] for trial in judged]
        hardest = np.array([max(values, default=-1.0) for values in landed])
        limits = [
            # A loss may be fifty times its limit: far from it the size says little.
            Response.fitted(places, np.arcsinh([t.constraints[name] for t in judged]))
            for name in simulated_limits(self.study)
        ]
        found = [losses_of(self.study, trial.values, trial.user_attrs) for trial in told]
        losses, errors = (np.array([pair[i] for pair in found]) for i in (0, 1))
        landing = Response.fitted(places, hardest, least=LANDING_SPREAD)
        timed, others = None, {}
        for column, objective in enumerate(objectives_of(self.study)):
            if objective.name == SIMULATED:
                timed = column, self._proposing(trials, every)
            elif objective.simulated:
                others[column] = Response.fitted(x, losses[:, column], errors[:, column])
        return _DogPrediction(self, space, timed, others, (landing, *limits))

    def _proposing(self, trials: Sequence[FrozenTrial], every: Sequence[FrozenTrial]) -> Over:
        """Return the surrogate that proposals follow: that of ``over``, and screened designs.

        The compiled engine is off Drake by less than either's standard error. What is told of a
        design never rests on it.
        """
        quick = [t for t in distinct(trials) if SCREENED in t.user_attrs]
        if not quick:
            return self.over(every)
        rows = [row for t in every for row in t.user_attrs["rows"]]
        rows += [row for t in quick for row in t.user_attrs[SCREENED]]
        data = with_rows(self.study, once(np.array(rows, dtype=float)))
        effort = Effort(QUICK.rows, QUICK.steps, self.study.file.search.seed)
        return Over(fit(data, effort=effort), study_mix(self.study))

    def over(self, trials: Sequence[FrozenTrial]) -> Over:
        """Return the surrogate of the expected time that simulated trials give, fitted once.

        Raises InputError where they are too few.
        """
        key = [(t.number, t.user_attrs["rows"]) for t in sorted(trials, key=lambda t: t.number)]
        if self._over is None or self._over[0] != key:
            if not trials:
                raise InputError("no design was simulated yet")
            effort = Effort(QUICK.rows, QUICK.steps, self.study.file.search.seed)
            fitted = fit(dataset_of_trials(self.study, trials), effort=effort)
            self._over = key, Over(fitted, study_mix(self.study))
        return self._over[1]

    @property
    def partial(self) -> bool:
        """Whether designs are simulated at some operating points only, and predicted at the others.

        That needs a surrogate over operating points that predicts every simulated objective.
        """
        search, predicted = self.study.file.search, {SIMULATED, "smallest_margin"}
        simulated = {o.name for o in objectives_of(self.study) if o.simulated}
        few = search.points is not None and search.points < len(self.study.points)
        if self.study.two_levels or (simulated_limits(self.study) and search.screen_angles is None):
            return False
        return few and simulated <= predicted and search.sampler in OWN

    def times(self, trials: Sequence[FrozenTrial]) -> tuple[Array, Array]:
        """Predict the expected times of trials from their rows, with errors, (m,), s."""
        return self.over(trials).predict(self.study.rows([trial.params for trial in trials]))

    def joint(
        self, trials: Sequence[FrozenTrial], asked: Sequence[FrozenTrial]
    ) -> tuple[Array, Array]:
        """Predict the times of trials asked jointly from rows of trials, (m,), (m, m)."""
        return self.over(trials).joint(self.study.rows([t.params for t in asked]), rough=True)

    def plan(self, prediction: Prediction | None, params: Params, number: int) -> Plan | None:
        """Return the angles of a chosen design at each operating point; None for all."""
        study, points = self.study, self.study.file.search.points
        if points is None or not self.partial:
            return None
        if not isinstance(prediction, _DogPrediction) or prediction.timed is None:
            return first_plan(study, points, number)
        return telling_plan(study, points, prediction.timed[1], self.study.rows([params])[0])

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
    timed: tuple[int, Over] | None
    others: dict[int, Response]
    limits: tuple[Response, ...]

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        """Draw losses jointly; the rough part of times is left out, as no draw of it would last."""
        losses: Array = np.repeat(self.guide.exact(params)[None], count, axis=0)
        if self.timed is not None:
            column, over = self.timed
            losses[:, :, column] = drawn(*over.joint(self.guide.study.rows(params)), rng, count)
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
