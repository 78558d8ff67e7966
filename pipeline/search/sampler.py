r"""Proposals of a search: hypervolume improvement within exact constraints.

What an exact constraint forbids is never proposed. First come designs that fill the allowed space.
Then the surrogate and processes over designs, one for each other simulated objective or limit and
for the worst of landing and engagement, are drawn jointly for candidates and for finished and
running designs. The candidate is proposed that adds most hypervolume, times the probability that it
keeps the simulated constraints; by the seed, its number and the trials before it alone. The last
designs polish the best: those with the largest expected gain in the leading objective, about the
designs that the prediction has for the best, ever nearer to these.

A proposal is the same on another processor, whose last digits differ: one thread of linear algebra,
parameters and gains of few digits, and draws that change with the predictions by as little as
these.
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
from threadpoolctl import threadpool_limits

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.state import Trial, not_dominated, pool_trials, trial_of
from dogshape.pipeline.simulate.design import (
    ENGAGEMENT,
    SIMULATED,
    SUMMARIES,
    Design,
    design_of,
    explain_infeasible,
    leading_objective,
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
from dogshape.sim.strength.checks import LimitCheck
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.surrogate.covariance import Term, first_parameters
from dogshape.surrogate.model import Surrogate, fit
from dogshape.surrogate.process import Effort, Process, draw_jointly, fit_process

Trials = Sequence[FrozenTrial]
#: of a process, fitted again in each round; an optimiser carries the last digits into the third
EFFORT = Effort(designs=200, steps=30, digits=2)
NO_EFFORT = Effort(steps=0)
#: a smooth part, and a rough one that no other design predicts
TERMS = (Term(), Term(scales=(0.1, 0.1), first=0.1))
MIN_VALUES = 10  #: values below which a process has parameters of its own and not the likeliest
MIN_NOISE = 1e-6  #: variance of noise where none is known, of values scaled to one
#: standard deviation of the constraint of the hardest landing (load over its limit, less one) over
#: designs, at least: 0.19 in each of three sets of 12 to 16 designs that fill the default space
LANDING_SPREAD = 0.2
#: Checks that a process over designs predicts: of the worst of them.
LANDING = {*(rule.name for rule in LANDING_RULES), ENGAGEMENT.name}
NEAR_DEVIATION = 0.08  #: of the range, standard deviation of a draw near a design
POLISH_DEVIATIONS = (0.04, 0.02, 0.01)  #: that of each step of a polish
POLISH_CANDIDATES = 128  #: candidates that each step adds
POLISH_CENTRES = 2  #: designs that a step draws about
POLISH_DRAWS = 256  #: joint draws of a polish, in which most designs are no better than the best
LIKELY_CHANCE = 0.5  #: probability of a permitted landing from which a design counts as allowed
SPACE_CANDIDATES = 400  #: candidates of the whole space
FRONT_CANDIDATES = 100  #: candidates near the front
DRAWS = 48  #: joint draws of candidates
DIRECTIONS = 128  #: directions of the hypervolume
DRAWS_TOGETHER = 4  #: draws for each wanted candidate, which are checked together
MAX_DRAWS = 200  #: draws for a candidate before the allowed space counts as empty
OUTLIER_RANGES = 1.5  #: quartile ranges above the upper quartile where outliers begin (Tukey 1977)
#: Reference point of the hypervolume over the range of values: the worst of these still count.
REFERENCE_SHARE = 1.1
MAX_POOLS = 4  #: sets of trials that are kept with their times
GAIN_DIGITS = 6  #: of a gain over the largest, so that no last digit decides between equal ones
DISTANCE_DIGITS = 9  #: of a distance in the unit cube, for the same reason


class Space:
    """Search ranges scaled to a unit cube, by name; the range of the count is a step wider."""

    def __init__(self, variables: Mapping[str, tuple[float, float]]) -> None:
        self.names = tuple(variables)
        self.variables = dict(sorted(variables.items()))
        half = np.array([0.5 if name == "count" else 0.0 for name in self.variables])
        ends = np.array(list(self.variables.values()), dtype=float).reshape(-1, 2)
        self._low = ends[:, 0] - half
        self._high = ends[:, 1] + half

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
            state=TrialState.RUNNING,
            params={name: params[name] for name in distributions},
            distributions=distributions,
            user_attrs=attributes,
        )

    def draw(
        self,
        rng: np.random.Generator,
        centre: Params | None = None,
        deviation: float = NEAR_DEVIATION,
    ) -> Params:
        """Draw a design: evenly, or normal about ``centre`` by a ``deviation`` of the range."""
        middle = None if centre is None else self.coordinates([centre])[0]
        params: Params = {}
        for k, (name, (low, high)) in enumerate(self.variables.items()):
            coordinate = rng.random() if middle is None else middle[k] + rng.normal(0.0, deviation)
            coordinate = min(max(float(coordinate), 0.0), 1.0)
            value = float(self._low[k]) + coordinate * float(self._high[k] - self._low[k])
            rounded = round(value) if name == "count" else value
            params[name] = min(max(rounded, low), high)
        return params


def fit_response(
    x: Array, values: Array, errors: Array | float = 0, min_deviation: float = 0
) -> Process:
    """Fit an objective or constraint (n,) at coordinates (n, c), with its standard errors, (n,).

    ``min_deviation`` is the least standard deviation of values over designs. Parameters of fewer
    than ``MIN_VALUES`` values are fixed.
    """
    deviation = max(float(values.std()), min_deviation)
    scale = deviation or abs(float(values.mean())) or 1.0
    noise = np.broadcast_to(MIN_NOISE * scale**2 + np.square(errors), values.shape)[:, None]
    start = None
    effort = EFFORT
    if len(values) < MIN_VALUES:
        effort = NO_EFFORT
        start = first_parameters(TERMS, x.shape[1])[0]
        start[[0, -1]] = np.log([1.0, 0.1])  # variances of the smooth part and the rough one
    return fit_process(
        TERMS, x, values[:, None], noise, start=start, effort=effort, scale=np.array([scale])
    )


def chance_below_zero(response: Process, x: Array) -> Array:
    """Compute the probability of values below zero, (m,), with the error of their level."""
    means, variances = response.predict(x)
    mean = means[:, 0]
    variance = variances[:, 0]
    level = (1.0 / len(response.targets) + MIN_NOISE) * response.scale[0] ** 2
    return ndtr(-mean / np.sqrt(variance + level))


class Guide:
    """Search space, exact constraints and predictions of a study."""

    def __init__(self, study: Setup) -> None:
        self.study = study
        self.space = Space(study.variables)
        self.objectives = objectives_of(study)
        self.signs = np.array([objective.sign for objective in self.objectives])
        #: place of the leading one among the objectives
        self.leading = self.objectives.index(leading_objective(study))
        # Most follow from the dog; its checks take most of the time of a whole design.
        exact = [objective for objective in self.objectives if objective.exact]
        self._needs_checks = any(objective.name in SUMMARIES for objective in exact)
        self._cached_losses = cache(self._compute_exact_losses)
        self._pools: dict[tuple[int, ...], tuple[Trial, ...]] = {}  # by the numbers of trials

    def allowed(self, params: Sequence[Params]) -> Mask:
        """Mark designs that pass every check that needs no simulation, (m,)."""
        return mark_worthy(self.study, params)

    def predict(self, trials: Trials) -> GoalPrediction:
        """Fit the surrogate of the time, and processes of other objectives and limits, to trials.

        InputError where too few were simulated.
        """
        study = self.study
        constraints = self.constraints(trials)
        pooled_trials = [trial for trial in self._pooled(trials) if trial.simulated]
        x = self.space.coordinates([trial.params for trial in pooled_trials])
        trial_constraints = [constraints[trial.number] for trial in pooled_trials]
        # The constraint value of the hardest landing, feasible at or below zero.
        hardest = []
        for values in trial_constraints:
            landings = [value for name, value in values.items() if name in LANDING]
            hardest.append(max(landings, default=-1.0))
        limits = [
            # A loss may be fifty times its limit: far from it the size says little.
            fit_response(x, np.arcsinh([values[name] for values in trial_constraints]))
            for name in simulated_limits(study)
        ]
        losses_and_errors = [trial.losses(study) for trial in pooled_trials]
        losses = np.array([trial_losses for trial_losses, _ in losses_and_errors])
        errors = np.array([trial_errors for _, trial_errors in losses_and_errors])
        landing = fit_response(x, np.array(hardest), min_deviation=LANDING_SPREAD)
        time_column = None
        responses = {}
        for column, objective in enumerate(self.objectives):
            if objective.name == SIMULATED:
                rows = [row for trial in pooled_trials for row in trial.rows]
                effort = replace(EFFORT, seed=study.file.search.seed)
                time_column = column, fit(with_rows(study, rows), effort, NO_EFFORT)
            elif objective.simulated:
                responses[column] = fit_response(x, losses[:, column], errors[:, column])
        return GoalPrediction(self, time_column, responses, (landing, *limits))

    def _pooled(self, trials: Trials) -> tuple[Trial, ...]:
        """Read finished trials with times by the prior of hangs that is fitted to all of them.

        The proposals of a round ask for the same trials: the last few answers are kept.
        """
        numbers = tuple(trial.number for trial in trials)
        if numbers not in self._pools:
            while len(self._pools) >= MAX_POOLS:
                del self._pools[next(iter(self._pools))]
            self._pools[numbers], _ = pool_trials(self.study, list(map(trial_of, trials)))
        return self._pools[numbers]

    def constraints(self, trials: Trials) -> dict[int, dict[str, float]]:
        """Return the constraints of trials by number, limits on times with pooled hangs."""
        constraints = {trial.number: dict(trial.constraints) for trial in trials}
        limits = limits_of(self.study)
        for trial in self._pooled(trials) if limits else ():
            limited = {} if trial.check_inputs is None else trial.check_inputs.limited
            for quantity, limit in limits:
                if quantity.name in limited:
                    check = LimitCheck(quantity.rule, limited[quantity.name], limit)
                    constraints[trial.number][quantity.name] = -check.margin
        return constraints

    def losses(self, trials: Trials) -> Array:
        """Return the objectives of finished trials as losses, hangs by their posterior, (m, k)."""
        values = np.array([trial.values for trial in self._pooled(trials)])
        return values.reshape(len(trials), len(self.signs)) * self.signs

    def exact_losses(self, designs: Sequence[Params]) -> Array:
        """Compute the objectives of designs as losses, (m, k); infinite for simulated ones."""
        return np.array([self._cached_losses(tuple(params.items())) for params in designs])

    def _compute_exact_losses(self, items: tuple[tuple[str, float], ...]) -> Array:
        """Compute the objectives of a design, given by its searched keys, as losses, (k,)."""
        params = dict(items)
        if self._needs_checks:
            return self.signs * values_of(design_of(self.study, params))
        study = self.study.with_design(params)
        return self.signs * values_of(Design(study, params, study.dog_with(params), (), ""))


@dataclass(frozen=True)
class GoalPrediction:
    """Surrogate of the expected time, and processes of other objectives and of limits."""

    guide: Guide
    time_column: tuple[int, Surrogate] | None  #: place among the objectives, and surrogate
    responses: dict[int, Process]  #: of other objectives, by place
    limits: tuple[Process, ...]

    def draws(self, params: Sequence[Params], rng: np.random.Generator, count: int) -> Array:
        """Draw all objectives of designs jointly, to be minimised, (count, m, k).

        The rough part of times is left out, as no draw of it would last.
        """
        losses: Array = np.repeat(self.guide.exact_losses(params)[None], count, axis=0)
        if self.time_column is not None:
            column, surrogate = self.time_column
            expected = surrogate.predict_jointly(self.guide.study.rows(params))
            losses[:, :, column] = draw_jointly(*expected, rng, count)
        x = self.guide.space.coordinates(params)
        for column, response in self.responses.items():
            losses[:, :, column] = draw_jointly(*response.predict_jointly(x), rng, count)
        return losses

    def chances(self, params: Sequence[Params]) -> Array:
        """Return the probability that designs keep each limit, as if independent, (m,)."""
        x = self.guide.space.coordinates(params)
        chances = [chance_below_zero(limit, x) for limit in self.limits]
        return np.asarray(np.prod(chances, axis=0), dtype=float)


class Pool:
    """Allowed designs of the guide's space, drawn once and again when all were proposed.

    Where next to none is allowed, ``refusal`` is the reason, and the pool has the designs that fail
    by least, as many as the search tries.
    """

    def __init__(self, guide: Guide, seed: int, size: int) -> None:
        self._guide = guide
        self._seed = seed
        self._size = size
        self._draws = [self.draw(np.random.default_rng(seed), size)]
        self.refusal = ""
        if not self._draws[0]:
            study = guide.study
            nearest = nearest_filling(study)
            self.refusal = explain_infeasible(study, MAX_DRAWS * size, nearest)
            designs = nearest[: study.file.search.trials]
            self._draws = [[design.params for design, _ in designs]]

    def remaining(self, proposed: Sequence[Params]) -> list[Params]:
        """Return allowed designs that were not proposed, up to ``size``; empty without any."""
        key = self._guide.space.key
        proposed_keys = {key(params) for params in proposed}
        for designs in self._draws:
            remaining = [params for params in designs if key(params) not in proposed_keys]
            if remaining:
                return remaining
        if self.refusal:
            return []
        rng = np.random.default_rng([self._seed, len(self._draws)])
        designs = self.draw(rng, self._size)
        remaining = [params for params in designs if key(params) not in proposed_keys]
        if remaining:
            self._draws.append(designs)
        return remaining

    def draw(
        self,
        rng: np.random.Generator,
        size: int,
        centres: Sequence[Params] | None = None,
        deviation: float = NEAR_DEVIATION,
    ) -> list[Params]:
        """Draw allowed designs of the whole space or near ``centres``; empty without any."""
        designs: list[Params] = []
        for _ in range(MAX_DRAWS // DRAWS_TOGETHER):
            draws = []
            for _ in range(DRAWS_TOGETHER * size):
                centre = None if centres is None else centres[int(rng.integers(len(centres)))]
                params = self._guide.space.draw(rng, centre, deviation)
                draws.append((params, rng.bit_generator.state))
            allowed = self._guide.allowed([params for params, _ in draws])
            for place in np.flatnonzero(allowed)[: size - len(designs)]:
                params, last_state = draws[place]
                designs.append(params)
            if len(designs) == size:
                rng.bit_generator.state = last_state  # as if nothing had been drawn beyond it
                break
        return designs


@dataclass(frozen=True)
class Standing:
    """Trials of a search at a proposal."""

    feasible: list[FrozenTrial]  #: finished ones that keep all constraints
    rivals: list[Params]  #: designs of feasible and running trials
    proposed: set[tuple[float, ...]]  #: keys of designs
    count: int  #: number of trials within the space


class SurrogateSampler:
    """Expected hypervolume improvement on Gaussian processes, within exact constraints.

    ``startup`` designs fill the allowed space before anything is predicted. From trial
    ``polish_start`` on, None for never, designs polish the leading objective.
    """

    def __init__(
        self, guide: Guide, seed: int, startup: int, polish_start: int | None = None
    ) -> None:
        self._guide = guide
        self._seed = seed
        self._startup = startup
        self._polish_start = polish_start
        self._pool = Pool(guide, seed, SPACE_CANDIDATES)
        self._prediction: GoalPrediction | None = None
        self._predicted_trials: list[int] = []  # numbers of those that the prediction is fitted to

    @property
    def refusal(self) -> str:
        """Reason why no design passes the checks before a simulation; empty where some do."""
        return self._pool.refusal

    def propose(self, trials: Trials) -> Params | None:
        """Propose an allowed design that no trial has; None where every design was proposed.

        Where none is allowed, one that fails by least.
        """
        # More threads take longer for matrices of some hundred rows, and sum in another order.
        with threadpool_limits(limits=1, user_api="blas"):
            return self._propose(trials)

    def _propose(self, trials: Trials) -> Params | None:
        """Propose a design by the threads of linear algebra that are set."""
        proposed, finished = self._split_trials(trials)
        designs = self._pool.remaining([trial.params for trial in proposed])
        if not designs:
            return None
        prediction = self._predict(finished)
        if prediction is not None:
            return self._best_candidate(designs, self._sort_trials(proposed, finished), prediction)
        if not proposed:
            return designs[0]
        coordinates = self._guide.space.coordinates(designs)
        proposed_coordinates = self._guide.space.coordinates([trial.params for trial in proposed])
        differences = coordinates[:, None, :] - proposed_coordinates[None, :, :]
        distances = np.linalg.norm(differences, axis=2).min(axis=1)
        # The farthest from all that were proposed.
        return designs[int(np.argmax(distances.round(DISTANCE_DIGITS)))]

    def _split_trials(self, trials: Trials) -> tuple[list[FrozenTrial], list[FrozenTrial]]:
        """Select the trials within the space, and of these the finished ones with values."""
        proposed = [trial for trial in trials if self._guide.space.holds(trial.params)]
        complete = [trial for trial in proposed if trial.state == TrialState.COMPLETE]
        return proposed, [trial for trial in complete if np.isfinite(trial.values).all()]

    def _predict(self, finished: Trials) -> GoalPrediction | None:
        """Fit a prediction to finished trials, once a round; None for fewer than ``startup``."""
        if len(finished) < self._startup:
            return None
        numbers = [trial.number for trial in finished]
        if self._predicted_trials != numbers:
            try:
                self._prediction = self._guide.predict(finished)
            except InputError:
                self._prediction = None
            self._predicted_trials = numbers
        return self._prediction

    def _sort_trials(self, proposed: Trials, finished: Trials) -> Standing:
        """Sort the trials of a search by what a proposal needs of them."""
        constraints = self._guide.constraints(finished)
        feasible = [
            trial
            for trial in finished
            if max(constraints[trial.number].values(), default=0.0) <= 0.0
        ]
        running = [trial.params for trial in proposed if trial.state == TrialState.RUNNING]
        return Standing(
            feasible=feasible,
            rivals=[*(trial.params for trial in feasible), *running],
            proposed={self._guide.space.key(trial.params) for trial in proposed},
            count=len(proposed),
        )

    def _best_candidate(
        self, designs: list[Params], standing: Standing, prediction: GoalPrediction
    ) -> Params:
        """Select the candidate that adds most to the front, or in a polish to its best end.

        Candidates are ``designs`` of the pool, and designs near the front that are not proposed.
        """
        rng = np.random.default_rng([self._seed, standing.count])
        if self._polish_start is not None and standing.count >= self._polish_start:
            candidates = self._draw_near_best(standing, prediction, rng)
            if candidates:
                return candidates[0]
        feasible = standing.feasible
        rivals = standing.rivals
        values = self._guide.losses(feasible)
        marks = zip(feasible, not_dominated(values), strict=True)
        front = [trial.params for trial, on_front in marks if on_front]
        neighbours = self._pool.draw(rng, FRONT_CANDIDATES, front) if front else []
        designs += self._select_new(neighbours, standing)
        draws = prediction.draws([*designs, *rivals], rng, DRAWS)
        candidate_draws = draws[:, : len(designs)]
        rival_draws = draws[:, len(designs) :]
        low, high = _ends(values, candidate_draws.mean(axis=0))
        objective_count = len(self._guide.signs)
        gains = added_volume(
            (candidate_draws - low) / (high - low),
            (rival_draws - low) / (high - low),
            np.full(objective_count, REFERENCE_SHARE),
            draw_directions(rng, DIRECTIONS, objective_count),
        )
        expected_gains = gains * prediction.chances(designs)
        if expected_gains.max() > 0.0:
            return designs[order_descending(expected_gains)[0]]
        # No draw adds anything: the candidate nearest to adding something, by its means.
        means = ((candidate_draws.mean(axis=0) - low) / (high - low)).max(axis=1)
        return designs[order_descending(-means)[0]]

    def _select_new(self, designs: Sequence[Params], standing: Standing) -> list[Params]:
        """Select the designs that no trial has."""
        key = self._guide.space.key
        return [params for params in designs if key(params) not in standing.proposed]

    def _draw_near_best(
        self, standing: Standing, prediction: GoalPrediction, rng: np.random.Generator
    ) -> list[Params]:
        """Draw new allowed designs ever nearer to the best of the leading objective.

        Each step draws about the designs with the largest expected gains so far, the first about
        feasible ones with the best predicted means. Largest gain first; empty without any.
        """
        if not standing.feasible:
            return []
        leading = self._guide.leading
        feasible = [trial.params for trial in standing.feasible]
        means = prediction.draws(feasible, rng, POLISH_DRAWS)[:, :, leading].mean(axis=0)
        centres = [feasible[place] for place in np.argsort(means)[:POLISH_CENTRES]]
        candidates: list[Params] = []
        for deviation in POLISH_DEVIATIONS:
            neighbours = self._pool.draw(rng, POLISH_CANDIDATES, centres, deviation)
            candidates += self._select_new(neighbours, standing)
            if not candidates:
                return []
            draws = prediction.draws([*candidates, *standing.rivals], rng, POLISH_DRAWS)
            losses = draws[:, : len(candidates), leading]
            best_losses = draws[:, len(candidates) :, leading].min(axis=1)
            gains = np.maximum(best_losses[:, None] - losses, 0.0).mean(axis=0)
            expected_gains = gains * prediction.chances(candidates)
            if expected_gains.max() <= 0.0:  # no draw is better: the best means
                expected_gains = losses.mean(axis=0).max() - losses.mean(axis=0)
            candidates = [candidates[place] for place in order_descending(expected_gains)]
            centres = candidates[:POLISH_CENTRES]
        return candidates

    def draw_remaining_gain(self, trials: Trials, chosen: Params) -> Array:
        """Draw the gain in the leading objective of the best allowed design over a chosen one.

        Candidates are those of a proposal in a polish, and of the whole space. Returns the draws,
        (``POLISH_DRAWS``,); none where nothing is predicted.
        """
        with threadpool_limits(limits=1, user_api="blas"):
            proposed, finished = self._split_trials(trials)
            prediction = self._predict(finished)
            if prediction is None:
                return np.zeros(0)
            standing = self._sort_trials(proposed, finished)
            rng = np.random.default_rng([self._seed, standing.count])
            candidates = self._draw_near_best(standing, prediction, rng)
            candidates += self._pool.remaining([trial.params for trial in proposed])
            is_likely = prediction.chances(candidates) >= LIKELY_CHANCE
            likely = [candidates[place] for place in np.flatnonzero(is_likely)]
            draws = prediction.draws([chosen, *likely], rng, POLISH_DRAWS)[
                :, :, self._guide.leading
            ]
            return np.asarray(draws[:, 0] - draws.min(axis=1))


def order_descending(values: Array) -> list[int]:
    """Order values (m,) by size, those that agree to ``GAIN_DIGITS`` of the largest by place."""
    size = np.abs(values).max()
    shares = (values / size if size > 0.0 else values).round(GAIN_DIGITS)
    return np.argsort(-shares, kind="stable").tolist()


def _ends(values: Array, candidates: Array) -> tuple[Array, Array]:
    """Compute the range that the hypervolume is scaled by, each (k,).

    From the best of ``values`` (n, k) to the worst that is no outlier, or is of the front; that of
    the candidates' means (m, k) where all values are equal, or there is none.
    """
    scaled = values if len(values) else candidates
    lower, upper = np.quantile(scaled, [0.25, 0.75], axis=0)
    within_range = scaled <= upper + OUTLIER_RANGES * (upper - lower)
    counted = within_range | not_dominated(scaled)[:, None]
    low = scaled.min(axis=0)
    high = np.where(counted, scaled, -np.inf).max(axis=0)
    span = np.where(high > low, high - low, np.ptp(scaled, axis=0))
    span = np.where(span > 0.0, span, np.ptp(candidates, axis=0))
    return low, low + np.where(span > 0.0, span, 1.0)


def draw_directions(rng: np.random.Generator, count: int, objectives: int) -> Array:
    """Draw directions with positive coordinates, evenly over the sphere, (count, k)."""
    vectors = np.abs(rng.standard_normal((count, objectives)))
    return np.maximum(vectors / np.linalg.norm(vectors, axis=1, keepdims=True), 1e-6)


def scales(values: Array, reference: Array, directions: Array) -> Array:
    r"""Compute the scales :math:`s_\lambda` of values (s, m, k) below a reference (k,), (s, m, w).

    ``directions`` (w, k) are the :math:`\lambda`.
    """
    gain = np.maximum(reference - values, 0.0)
    smallest = np.full((*values.shape[:2], len(directions)), np.inf)
    for k in range(values.shape[2]):
        np.minimum(smallest, gain[:, :, k, None] / directions[:, k], out=smallest)
    return smallest ** values.shape[2]


def added_volume(candidates: Array, front: Array, reference: Array, directions: Array) -> Array:
    """Compute the hypervolume that each candidate adds to a front, mean over draws, (m,).

    ``candidates`` (s, m, k) and ``front`` (s, f, k) are drawn values, ``directions`` are (w, k).
    """
    k = candidates.shape[2]
    volumes = scales(candidates, reference, directions)
    if front.shape[1]:
        front_volumes = scales(front, reference, directions).max(axis=1)
        volumes = np.maximum(volumes - front_volumes[:, None, :], 0.0)
    # Volume of the part of the unit ball with positive coordinates.
    ball = math.pi ** (k / 2) / (2**k * math.gamma(k / 2 + 1))
    return volumes.mean(axis=(0, 2)) * ball
