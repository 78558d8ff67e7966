r"""Proposals of a search: hypervolume improvement within exact constraints.

What an exact constraint forbids is never proposed. First come designs that fill the allowed space.
Then the surrogate and processes over designs, one for each other simulated objective or limit and
for the worst of landing and engagement, are drawn jointly for candidates and for finished and
running designs. The candidate is proposed that adds most hypervolume, times the probability that it
keeps the simulated constraints; by the seed, its number and the trials before it alone.
Hypervolume below a reference *r* is, but for a constant, the mean over random directions
:math:`\lambda` of the largest :math:`s_\lambda(y) = \min_i \left(\max(0, r_i - y_i) /
\lambda_i\right)^k` among designs (Deng and Zhang 2019).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial, TrialState, create_trial
from scipy.special import ndtr

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.state import not_dominated, pooled, trial_of
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    SIMULATED,
    SUMMARIES,
    Design,
    design_of,
    explain_infeasible,
    limits_of,
    mark_worthy,
    nearest_filling,
    objectives_of,
    simulated_limits,
    values_of,
)
from dogshape.pipeline.simulate.evaluation import Params
from dogshape.pipeline.train.training_rows import with_rows
from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.errors import InputError
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.surrogate.covariance import Term, first_parameters
from dogshape.surrogate.model import Surrogate, fit
from dogshape.surrogate.process import Effort, Process, draw_jointly, fit_process

Trials = Sequence[FrozenTrial]
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
WIDE, BESIDE = 400, 100  #: candidates of the whole space, and near the front
DRAWS, WAYS = 48, 128  #: joint draws of candidates, and directions of the hypervolume
TOGETHER = 4  #: draws for each candidate that is wanted, which are checked together
TRIES = 200  #: draws for a candidate before the allowed space counts as empty
OUTLYING = 1.5  #: ranges of the quartiles above the upper one where outliers begin (Tukey 1977)
BEYOND = 1.1  #: the hypervolume's reference point, of the range of values: their worst still count


class Space:
    """Search ranges as a unit cube, by name; that of the whole count is half a step wider."""

    def __init__(self, variables: Mapping[str, tuple[float, float]]) -> None:
        self.names = tuple(variables)
        self.variables = dict(sorted(variables.items()))
        half = np.array([0.5 if name == "count" else 0.0 for name in self.variables])
        ends = np.array(list(self.variables.values()), dtype=float).reshape(-1, 2)
        self._low, self._high = ends[:, 0] - half, ends[:, 1] + half

    def coordinates(self, designs: Sequence[Params]) -> Array:
        """Return points of the unit cube for designs, (m, d)."""
        rows = [[design[name] for name in self.variables] for design in designs]
        values = np.array(rows, dtype=float).reshape(len(designs), len(self.variables))
        return (values - self._low) / (self._high - self._low)

    def holds(self, params: Params) -> bool:
        """Check whether a design has every variable, within its range."""
        pairs = self.variables.items()
        return all(name in params and low <= params[name] <= high for name, (low, high) in pairs)

    def key(self, params: Params) -> tuple[float, ...]:
        """Return a hashable key of a design; equal ones have equal keys."""
        return tuple(float(params[name]) for name in self.variables)

    def trial(self, params: Params, **attributes: Any) -> FrozenTrial:
        """Make the running trial of a design, which may lie outside the ranges."""
        distributions: dict[str, BaseDistribution] = {}
        for name in self.names:
            ends: tuple[Any, ...] = (*self.variables[name], params[name])
            kind = IntDistribution if name == "count" else FloatDistribution
            distributions[name] = kind(min(ends), max(ends))
        return create_trial(
            state=TrialState.RUNNING, params={name: params[name] for name in distributions},
            distributions=distributions, user_attrs=attributes,
        )  # fmt: skip

    def draw(self, rng: np.random.Generator, near: Params | None = None) -> Params:
        """Draw a design: evenly, or normal about one with a deviation of ``NEAR`` of the range."""
        middle = None if near is None else self.coordinates([near])[0]
        found: Params = {}
        for k, (name, (low, high)) in enumerate(self.variables.items()):
            unit = rng.random() if middle is None else middle[k] + rng.normal(0.0, NEAR)
            unit = min(max(float(unit), 0.0), 1.0)
            value = float(self._low[k]) + unit * float(self._high[k] - self._low[k])
            found[name] = min(max(round(value) if name == "count" else value, low), high)
        return found


def fit_response(x: Array, values: Array, errors: Array | float = 0, least: float = 0) -> Process:
    """Fit an objective or constraint (n,) at coordinates (n, c), with its standard errors, (n,).

    ``least`` is a standard deviation that values of other designs have at least. Parameters of
    fewer than ``MIN_VALUES`` values are given.
    """
    scale = max(float(values.std()), least) or abs(float(values.mean())) or 1.0
    noise = np.broadcast_to(MIN_NOISE * scale**2 + np.square(errors), values.shape)[:, None]
    theta, effort = None, EFFORT
    if len(values) < MIN_VALUES:
        theta, effort = first_parameters(TERMS, x.shape[1])[0], NONE
        theta[[0, -1]] = np.log([1.0, 0.1])  # variances of the smooth part and the rough one
    given: dict[str, Any] = {"start": theta, "effort": effort, "scale": np.array([scale])}
    return fit_process(TERMS, x, values[:, None], noise, **given)


def chance_below_zero(response: Process, x: Array) -> Array:
    """Return the probability of values below zero, (m,), their level being as unsure."""
    mean, variance = (found[:, 0] for found in response.predict(x))
    level = (1.0 / len(response.targets) + MIN_NOISE) * response.scale[0] ** 2
    return ndtr(-mean / np.sqrt(variance + level))


class Guide:
    """Search space, exact constraints and predictions of a study."""

    def __init__(self, study: Setup) -> None:
        self.study = study
        self.space = Space(study.variables)
        self.signs = np.array([objective.sign for objective in objectives_of(study)])
        # Most follow from the dog; its checks take most of the time of a whole design.
        self._checked = any(o.exact and o.name in SUMMARIES for o in objectives_of(study))
        self._exact = cache(self._losses)

    def allowed(self, params: Sequence[Params]) -> Mask:
        """Mark designs that pass every check that needs no simulation, (m,)."""
        return mark_worthy(self.study, params)

    def predict(self, trials: Trials) -> Prediction:
        """Fit surrogate and processes to trials; InputError where too few were simulated."""
        study, constraints = self.study, self.constraints(trials)
        simulated = [trial for trial in map(trial_of, trials) if trial.simulated]
        every, _ = pooled(study, simulated)
        x = self.space.coordinates([trial.params for trial in every])
        # The constraint value of the hardest landing, feasible at or below zero.
        landed = [[v for n, v in constraints[t.number].items() if n in LANDING] for t in every]
        hardest = np.array([max(values, default=-1.0) for values in landed])
        limits = [
            # A loss may be fifty times its limit: far from it the size says little.
            fit_response(x, np.arcsinh([constraints[t.number][name] for t in every]))
            for name in simulated_limits(study)
        ]
        found = [trial.losses(study) for trial in every]
        losses, errors = (np.array([pair[i] for pair in found]) for i in (0, 1))
        landing = fit_response(x, hardest, least=LANDING_SPREAD)
        timed, others = None, {}
        for column, objective in enumerate(objectives_of(study)):
            if objective.name == SIMULATED:
                rows = [row for trial in every for row in trial.rows]
                effort = replace(EFFORT, seed=study.file.search.seed)
                timed = column, fit(with_rows(study, rows), effort, NONE)
            elif objective.simulated:
                others[column] = fit_response(x, losses[:, column], errors[:, column])
        return Prediction(self, timed, others, (landing, *limits))

    def constraints(self, trials: Trials) -> dict[int, dict[str, float]]:
        """Return the constraints of trials by number, limits on times with pooled hangs."""
        found = {trial.number: dict(trial.constraints) for trial in trials}
        known, _ = pooled(self.study, [trial_of(trial) for trial in trials])
        limits = limits_of(self.study)
        for trial in known:
            limited = {} if trial.measured is None else trial.measured.limited
            for quantity, limit in limits:
                if quantity.name in limited:
                    check = Check(quantity.rule, limited[quantity.name], limit)
                    found[trial.number][quantity.name] = -check.margin
        return found

    def losses(self, trials: Trials) -> Array:
        """Return the objectives of finished trials as losses, hangs by their posterior, (m, k)."""
        known, _ = pooled(self.study, [trial_of(trial) for trial in trials])
        values = np.array([trial.values for trial in known])
        return values.reshape(len(trials), len(self.signs)) * self.signs

    def exact(self, params: Sequence[Params]) -> Array:
        """Return the objectives of dogs as losses, (m, k): infinite where simulation says them."""
        return np.array([self._exact(tuple(one.items())) for one in params])

    def _losses(self, items: tuple[tuple[str, float], ...]) -> Array:
        params = dict(items)
        if self._checked:
            return self.signs * values_of(design_of(self.study, params))
        study = self.study.with_operation(params)
        return self.signs * values_of(Design(study, params, study.dog_with(params), (), ""))


@dataclass(frozen=True)
class Prediction:
    """Surrogate of the expected time with its column, processes of other columns and limits."""

    guide: Guide
    timed: tuple[int, Surrogate] | None
    others: dict[int, Process]
    limits: tuple[Process, ...]

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
            losses[:, :, column] = draw_jointly(*response.joint(x), rng, count)
        return losses

    def chances(self, params: Sequence[Params]) -> Array:
        """Return the probability that designs keep each limit, as if independent, (m,)."""
        x = self.guide.space.coordinates(params)
        chances = [chance_below_zero(one, x) for one in self.limits]
        return np.asarray(np.prod(chances, axis=0), dtype=float)


class Pool:
    """Allowed designs of the guide's space, drawn once and again when all were taken.

    Where next to none is allowed, ``refusal`` is the reason, and the pool has the designs that fail
    by least, as many as the search tries.
    """

    def __init__(self, guide: Guide, seed: int, wide: int) -> None:
        self._guide, self._seed, self._wide = guide, seed, wide
        self._drawn = [self.draw(np.random.default_rng(seed), wide)]
        self.refusal = ""
        if not self._drawn[0]:
            study = guide.study
            nearest = nearest_filling(study)
            self.refusal = explain_infeasible(study, TRIES * wide, nearest)
            tried = nearest[: study.file.search.trials]
            self._drawn = [[design.params for design, _ in tried]]

    def untaken(self, taken: Sequence[Params]) -> list[Params]:
        """Return up to ``wide`` allowed designs that were not taken; none where every one was."""
        key = self._guide.space.key
        gone = {key(params) for params in taken}
        for pool in self._drawn:
            if left := [params for params in pool if key(params) not in gone]:
                return left
        if self.refusal:
            return []
        more = self.draw(np.random.default_rng([self._seed, len(self._drawn)]), self._wide)
        if left := [params for params in more if key(params) not in gone]:
            self._drawn.append(more)
        return left

    def draw(
        self, rng: np.random.Generator, size: int, near: Sequence[Params] | None = None
    ) -> list[Params]:
        """Draw allowed designs, of the whole space or near some; none where none is allowed."""
        found: list[Params] = []
        for _ in range(TRIES // TOGETHER):
            drawn = []
            for _ in range(TOGETHER * size):
                centre = None if near is None else near[int(rng.integers(len(near)))]
                params = self._guide.space.draw(rng, centre)
                drawn.append((params, rng.bit_generator.state))
            fit = self._guide.allowed([params for params, _ in drawn])
            for place in np.flatnonzero(fit)[: size - len(found)]:
                params, after = drawn[place]
                found.append(params)
            if len(found) == size:
                rng.bit_generator.state = after  # as if nothing had been drawn beyond the last one
                break
        return found


class SurrogateSampler:
    """Expected hypervolume improvement on Gaussian processes, within exact constraints.

    ``startup`` designs fill the allowed space before anything is predicted.
    """

    def __init__(self, guide: Guide, seed: int, startup: int) -> None:
        self._guide, self._seed, self._startup = guide, seed, startup
        self._pool = Pool(guide, seed, WIDE)
        self._known: tuple[list[int], Prediction | None] = ([], None)

    @property
    def refusal(self) -> str:
        """Reason why no design passes the checks before a simulation; empty where some do."""
        return self._pool.refusal

    def propose(self, trials: Trials) -> Params | None:
        """Propose an allowed design beside those of trials; None where every one was proposed.

        Where none is allowed, one that fails by least.
        """
        before = [trial for trial in trials if self._guide.space.holds(trial.params)]
        ended = [t for t in before if t.state == TrialState.COMPLETE]
        finished = [t for t in ended if np.isfinite(t.values).all()]
        untaken = self._pool.untaken([t.params for t in before])
        if not untaken:
            return None
        prediction = self._predict(finished)
        if prediction is None:
            if not before:
                return untaken[0]
            places = self._guide.space.coordinates
            here, there = places(untaken), places([t.params for t in before])
            apart = np.linalg.norm(here[:, None, :] - there[None, :, :], axis=2).min(axis=1)
            return untaken[int(np.argmax(apart))]  # farthest from all that were proposed
        return self._improving(untaken, before, finished, prediction)

    def _predict(self, finished: Trials) -> Prediction | None:
        """Fit a prediction to finished trials, once for a round; None where they are few."""
        if len(finished) < self._startup:
            return None
        numbers = [t.number for t in finished]
        if self._known[0] != numbers:
            try:
                self._known = numbers, self._guide.predict(finished)
            except InputError:
                self._known = numbers, None
        return self._known[1]

    def _improving(
        self, untaken: list[Params], before: Trials, finished: Trials, prediction: Prediction
    ) -> Params:
        """Return the candidate that adds most to the front; none that was proposed already."""
        signs = self._guide.signs
        key, rng = self._guide.space.key, np.random.default_rng([self._seed, len(before)])
        constraints = self._guide.constraints(finished)
        kept = [t for t in finished if max(constraints[t.number].values(), default=0.0) <= 0.0]
        running = [t.params for t in before if t.state == TrialState.RUNNING]
        values = self._guide.losses(kept)
        best = [t.params for t, good in zip(kept, not_dominated(values), strict=True) if good]
        there = [*(t.params for t in kept), *running]
        near = self._pool.draw(rng, BESIDE, best) if best else []
        gone = {key(t.params) for t in before}
        untaken += [params for params in near if key(params) not in gone]
        draws = prediction.draws([*untaken, *there], rng, DRAWS)
        candidates, front = draws[:, : len(untaken)], draws[:, len(untaken) :]
        low, high = _ends(values, candidates.mean(axis=0))
        gained = added((candidates - low) / (high - low), (front - low) / (high - low),
                       np.full(len(signs), BEYOND), directions(rng, WAYS, len(signs)))  # fmt: skip
        likely = gained * prediction.chances(untaken)
        if likely.max() > 0.0:
            return untaken[int(np.argmax(likely))]
        # No draw adds anything: the candidate nearest to adding something, by its means.
        mean = ((candidates.mean(axis=0) - low) / (high - low)).max(axis=1)
        return untaken[int(np.argmin(mean))]


def _ends(values: Array, candidates: Array) -> tuple[Array, Array]:
    """Return the range that the hypervolume is scaled by, each (k,).

    From the best of ``values`` (n, k) to the worst that is no outlier, or is of the front; that of
    the candidates' means (m, k) where all values are alike, or none is known.
    """
    known = values if len(values) else candidates
    lower, upper = np.quantile(known, [0.25, 0.75], axis=0)
    usual = (known <= upper + OUTLYING * (upper - lower)) | not_dominated(known)[:, None]
    low, high = known.min(axis=0), np.where(usual, known, -np.inf).max(axis=0)
    span = np.where(high > low, high - low, np.ptp(known, axis=0))
    span = np.where(span > 0.0, span, np.ptp(candidates, axis=0))
    return low, low + np.where(span > 0.0, span, 1.0)


def directions(rng: np.random.Generator, count: int, objectives: int) -> Array:
    """Draw directions with positive coordinates, evenly over the sphere, (count, k)."""
    drawn = np.abs(rng.standard_normal((count, objectives)))
    return np.maximum(drawn / np.linalg.norm(drawn, axis=1, keepdims=True), 1e-6)


def scales(values: Array, reference: Array, ways: Array) -> Array:
    """Compute the scale of values (s, m, k) below a reference (k,) in directions, (s, m, w)."""
    gain = np.maximum(reference - values, 0.0)
    least = np.full((*values.shape[:2], len(ways)), np.inf)
    for k in range(values.shape[2]):
        np.minimum(least, gain[:, :, k, None] / ways[:, k], out=least)
    return least ** values.shape[2]


def added(candidates: Array, front: Array, reference: Array, ways: Array) -> Array:
    """Compute the hypervolume that each candidate adds to a front, mean over draws, (m,).

    ``candidates`` (s, m, k) and ``front`` (s, f, k) are drawn values.
    """
    own, k = scales(candidates, reference, ways), candidates.shape[2]
    if front.shape[1]:
        best = scales(front, reference, ways).max(axis=1)
        own = np.maximum(own - best[:, None, :], 0.0)
    # Volume of the part of the unit ball with positive coordinates.
    ball = math.pi ** (k / 2) / (2**k * math.gamma(k / 2 + 1))
    return own.mean(axis=(0, 2)) * ball
