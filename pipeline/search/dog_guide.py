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
from dogshape.pipeline.search.trial import distinct, simulated_rows, trial_of
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
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.sim.errors import InputError
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import once
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.learning import fit

ROWS, STEPS = 400, 30  #: effort of the surrogate that is fitted again in each round
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
                data = with_rows(study, once(np.array(simulated_rows(every), dtype=float)))
                effort = Effort(ROWS, STEPS, study.file.search.seed)
                timed = column, Over(fit(data, effort=effort), study_mix(study))
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
