"""Samplers of the search, by name.

``surrogate`` is a sampler of our own. It knows the constraints, which are exact
and free, and proposes feasible designs only: first some that fill the feasible
space, then such as a draw from the Gaussian process of the expected shift time
finds best for random weights of the objectives (Thompson sampling on an
augmented Tchebycheff scale; Knowles 2006, Kandasamy et al. 2018). The draws
differ, so a batch needs no further device to spread.

Every proposal depends on the seed, its number and the finished trials alone:
the same seed gives the same trials, interrupted or not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.samplers import BaseSampler, NSGAIISampler, RandomSampler, TPESampler
from optuna.trial import FrozenTrial, TrialState

from pipeline.config import Study
from pipeline.design import (
    SIMULATED,
    exact_losses,
    losses_of,
    not_dominated,
    objectives_of,
    worth_simulating,
)
from pipeline.rows import study_mix, with_rows
from sim.errors import InputError, did_you_mean
from surrogate.covariance import Array, Term
from surrogate.dataset import Dataset
from surrogate.fitting import Effort, fit_process
from surrogate.learning import fit
from surrogate.model import MIN_DESIGNS
from surrogate.over import Over

SAMPLERS = ("surrogate", "space_filling", "tpe", "nsga2", "random")
POOL = 400  #: feasible candidates of the whole space; half as many again near the front
QUICK = Effort(rows=400, steps=30)  #: of the process that is fitted anew in each round
DRAWS = 1000  #: draws for a candidate before the feasible space counts as empty


def search_space(study: Study) -> dict[str, BaseDistribution]:
    """Return the search ranges as Optuna's distributions."""
    return {
        key: IntDistribution(int(low), int(high))
        if key == "count"
        else FloatDistribution(low, high)
        for key, (low, high) in study.variables.items()
    }


def sampler_factory(study: Study) -> Callable[[int], BaseSampler]:
    """Return a function that gives the sampler for a round, by the round's first trial.

    Optuna's samplers are made and seeded afresh for each round, which makes a
    resumed search equal to an uninterrupted one.
    """
    search = study.file.search
    if search.sampler in ("surrogate", "space_filling"):
        startup = search.startup if search.sampler == "surrogate" else search.trials
        own = SurrogateSampler(study, search.seed, startup)
        own.require_feasible_space()
        return lambda _: own
    kinds: dict[str, Callable[[int], BaseSampler]] = {
        "tpe": lambda seed: TPESampler(seed=seed, n_startup_trials=search.startup),
        "nsga2": lambda seed: NSGAIISampler(seed=seed, population_size=search.startup),
        "random": lambda seed: RandomSampler(seed=seed),
    }
    if search.sampler not in kinds:
        hint = did_you_mean(search.sampler, SAMPLERS)
        raise InputError(f"search.sampler is '{search.sampler}', which is not a sampler; {hint}")
    make = kinds[search.sampler]
    return lambda first: make(int(np.random.default_rng([search.seed, first]).integers(2**31)))


@dataclass(frozen=True)
class _Space:
    names: tuple[str, ...]
    low: Array
    high: Array
    whole: Array  # (d,) of bool: counts are whole numbers


class SurrogateSampler(BaseSampler):
    """Thompson sampling on a Gaussian process, within exact constraints.

    Parameters
    ----------
    study : says what a design is and which checks it must pass.
    seed : of every proposal, with the trial's number.
    startup : designs that fill the feasible space before the process is used.
    """

    def __init__(self, study: Study, seed: int, startup: int) -> None:
        self._study = study
        self._seed = seed
        self._startup = max(startup, MIN_DESIGNS)
        self._distributions = search_space(study)
        self._process: tuple[int, Over] | None = None
        bounds = np.array(list(study.variables.values()), dtype=float).reshape(-1, 2)
        names = tuple(study.variables)
        whole = np.array([name == "count" for name in names])
        self._space = _Space(names, bounds[:, 0], bounds[:, 1], whole)

    def require_feasible_space(self) -> None:
        """Raise InputError where next to no design of the search ranges is feasible."""
        _ = self._wide

    def infer_relative_search_space(
        self, study: optuna.Study, trial: FrozenTrial
    ) -> dict[str, BaseDistribution]:
        """Return the whole search space: all variables are chosen together."""
        return dict(self._distributions)

    def sample_relative(
        self,
        study: optuna.Study,
        trial: FrozenTrial,
        search_space: dict[str, BaseDistribution],
    ) -> dict[str, Any]:
        """Propose a feasible design for ``trial``."""
        before = [t for t in study.get_trials(deepcopy=False) if t.number < trial.number]
        # A trial that was cut off before it had a design has failed; it must not count.
        seen = [t for t in before if t.state != TrialState.FAIL]
        rng = np.random.default_rng([self._seed, len(seen)])
        finished = [t for t in seen if _simulated(t)]
        taken = self._points(t for t in seen if _simulated(t) or t.state == TrialState.RUNNING)
        started = len(finished) >= self._startup
        timed = SIMULATED in self._study.file.search.objectives
        over = self._over(finished) if started and timed else None
        if not started or (timed and over is None):
            pool = self._wide
            return self._study.named(pool[_farthest(self._scaled(pool), self._scaled(taken))])
        return self._study.named(self._thompson(rng, over, finished, taken))

    def sample_independent(
        self,
        study: optuna.Study,
        trial: FrozenTrial,
        param_name: str,
        param_distribution: BaseDistribution,
    ) -> Any:
        """Sample a parameter that is not of the study, uniformly."""
        sampler = RandomSampler(seed=self._seed + trial.number)
        return sampler.sample_independent(study, trial, param_name, param_distribution)

    @cached_property
    def _wide(self) -> Array:
        """Feasible designs from the whole space, drawn once: most draws are infeasible."""
        return self._pool(np.random.default_rng(self._seed), POOL)

    def _points(self, trials: Any) -> Array:
        names = self._space.names
        rows = [[t.params[n] for n in names] for t in trials if all(n in t.params for n in names)]
        return np.array(rows, dtype=float).reshape(-1, len(names))

    def _scaled(self, points: Array) -> Array:
        space = self._space
        scaled: Array = (points - space.low) / (space.high - space.low)
        return scaled

    def _pool(self, rng: np.random.Generator, size: int, around: Array | None = None) -> Array:
        """Draw feasible designs (size, d): uniform, or normal about rows of ``around``."""
        space = self._space
        found: list[Array] = []
        for _ in range(DRAWS * size):
            if around is None:
                unit = rng.random(len(space.names))
            else:
                centre = around[rng.integers(len(around))]
                unit = np.clip(centre + rng.normal(0.0, 0.08, len(centre)), 0.0, 1.0)
            point = space.low + unit * (space.high - space.low)
            point = np.where(space.whole, np.round(point), point)
            if worth_simulating(self._study, self._study.named(point)):
                found.append(point)
                if len(found) == size:
                    return np.array(found)
        if found:
            return np.array(found)
        raise InputError(
            f"none of {DRAWS * size} designs drawn from the search ranges passes every check; "
            "widen [variables] or relax [load], [material] or [manufacturing]"
        )

    def _thompson(
        self,
        rng: np.random.Generator,
        over: Over | None,
        finished: Sequence[FrozenTrial],
        taken: Array,
    ) -> Array:
        """Return the candidate that a draw from the process finds best; none twice."""
        designs = self._points(finished)
        reference, errors = self._losses(finished)
        front = self._scaled(designs[not_dominated(reference)])
        pool = np.concatenate([self._wide, self._pool(rng, POOL // 2, front)])
        known = (pool[:, None, :] == taken[None, :, :]).all(axis=2).any(axis=1)
        pool = pool if known.all() else pool[~known]  # few counts may be all there is
        values = exact_losses(self._study, [self._study.named(p) for p in pool])
        for column, objective in enumerate(objectives_of(self._study)):
            if objective.name == SIMULATED and over is not None:
                values[:, column] = over.sample(pool, rng)
            elif objective.simulated:
                told = self._scaled(designs), reference[:, column], errors[:, column]
                values[:, column] = _drawn(rng, told, self._scaled(pool))
        low, span = reference.min(axis=0), np.ptp(reference, axis=0)
        unit = (values - low) / np.where(span > 0.0, span, 1.0)
        weights = rng.dirichlet(np.ones(values.shape[1]))
        weighted = unit * weights
        scale = weighted.max(axis=1) + 0.05 * weighted.sum(axis=1)
        best: Array = pool[np.argmin(scale)]
        return best

    def _over(self, finished: Sequence[FrozenTrial]) -> Over | None:
        """Return the process of the expected time, fitted once for all proposals of a round.

        None where too few designs engage to fit one.
        """
        count = len(finished)
        if self._process is None or self._process[0] != count:
            data = dataset_of_trials(self._study, finished)
            try:
                model = fit(data, effort=Effort(QUICK.rows, QUICK.steps, self._seed))
            except InputError:
                return None
            self._process = count, Over(model, study_mix(self._study))
        return self._process[1]

    def _losses(self, finished: Sequence[FrozenTrial]) -> tuple[Array, Array]:
        """Return losses of finished trials and their standard errors, each (n, k)."""
        found = [losses_of(self._study, t.values, t.user_attrs) for t in finished]
        return np.array([f[0] for f in found]), np.array([f[1] for f in found])


def _drawn(rng: np.random.Generator, told: tuple[Array, Array, Array], pool: Array) -> Array:
    """Return a draw, (m,), of a process over designs alone at ``pool``, (m, d), scaled.

    ``told`` are scaled designs (n, d) with losses and standard errors, each (n,).
    """
    designs, losses, errors = told
    centre, scale = losses.mean(), losses.std() or 1.0
    noise = (errors / scale) ** 2 + 1e-6
    # A process wants a coordinate of the operating point, which the term leaves out.
    inputs, asked = (np.column_stack([x, np.zeros(len(x))]) for x in (designs, pool))
    data = inputs, (losses - centre) / scale, noise
    term = Term(design=True, point=False)
    process = fit_process((term,), designs.shape[1], data, effort=QUICK)
    draw = rng.multivariate_normal(*process.joint(asked), method="eigh")
    scaled: Array = centre + scale * draw
    return scaled


def _simulated(trial: FrozenTrial) -> bool:
    return trial.state == TrialState.COMPLETE and "standard_error_s" in trial.user_attrs


def _farthest(pool: Array, taken: Array) -> int:
    """Return the row of ``pool`` that is farthest from all rows of ``taken``."""
    if len(taken) == 0:
        return 0
    distance = np.linalg.norm(pool[:, None, :] - taken[None, :, :], axis=2).min(axis=1)
    return int(np.argmax(distance))


def dataset_of_trials(study: Study, trials: Sequence[FrozenTrial]) -> Dataset:
    """Return the rows that simulated trials carry."""
    rows = [row for trial in trials for row in trial.user_attrs["rows"]]
    return with_rows(study, np.array(rows, dtype=float))
