r"""A sampler of our own, in Optuna's terms: hypervolume improvement within exact constraints.

First come designs that fill the allowed space. Then predictions are drawn jointly for candidates
and for finished and running designs, and the candidate is proposed that adds most hypervolume,
times the probability that it keeps the simulated constraints. A proposal depends on the seed, its
number and the trials before it alone. Hypervolume below a reference *r* is, but for a constant, the
mean over random directions :math:`\lambda` of the largest :math:`s_\lambda(y) = \min_i
\left(\max(0, r_i - y_i) / \lambda_i\right)^k` among designs (Deng and Zhang 2019).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.search.guide import Guide, Params, Prediction
from dogshape.pipeline.search.state import not_dominated
from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array

TRIES = 200  #: draws for a candidate before the allowed space counts as empty
OUTLYING = 1.5  #: ranges of the quartiles above the upper one where outliers begin (Tukey 1977)
BEYOND = 1.1  #: the hypervolume's reference point, of the range of values: their worst still count


@dataclass(frozen=True)
class Breadth:
    """Numbers of candidates and draws for a proposal; its time grows with their square.

    ``wide`` candidates of the whole space and ``near`` the front, joint ``draws`` of
    predictions, ``ways`` directions of the hypervolume.
    """

    wide: int = 400
    near: int = 100
    draws: int = 48
    ways: int = 128


class Pool:
    """Allowed designs of the guide's space, drawn once and again when all were taken."""

    def __init__(self, guide: Guide, seed: int, wide: int) -> None:
        self._guide = guide
        self._seed = seed
        self._wide = wide
        self._drawn: list[list[Params]] = []

    def untaken(self, taken: Sequence[Params]) -> list[Params]:
        """Return up to ``wide`` allowed designs that were not taken; none where every one was."""
        self.first()
        key = self._guide.space.key
        gone = {key(params) for params in taken}
        for pool in self._drawn:
            if left := [params for params in pool if key(params) not in gone]:
                return left
        more = self.draw(np.random.default_rng([self._seed, len(self._drawn)]), self._wide)
        if left := [params for params in more if key(params) not in gone]:
            self._drawn.append(more)
        return left

    def first(self) -> list[Params]:
        """Return ``wide`` allowed designs; InputError where next to none is allowed."""
        if not self._drawn:
            self._drawn.append(self.draw(np.random.default_rng(self._seed), self._wide))
        return self._drawn[0]

    def draw(
        self, rng: np.random.Generator, size: int, near: Sequence[Params] | None = None
    ) -> list[Params]:
        """Draw allowed designs: of the whole space, or near some."""
        found: list[Params] = []
        for _ in range(TRIES * size):
            centre = None if near is None else near[int(rng.integers(len(near)))]
            params = self._guide.space.draw(rng, centre)
            if self._guide.allows(params):
                found.append(params)
                if len(found) == size:
                    break
        if not found:
            none_of = f"none of {TRIES * size} designs drawn from the search ranges"
            raise InputError(self._guide.refusal(none_of))
        return found


class SurrogateSampler(BaseSampler):
    """Expected hypervolume improvement on Gaussian processes, within exact constraints.

    Parameters
    ----------
    guide : search space, constraints and predictions of a study.
    seed : of every proposal, with the number of trials before it.
    startup : designs that fill the allowed space before anything is predicted.
    breadth : numbers of candidates and draws for a proposal.
    """

    def __init__(
        self, guide: Guide, seed: int, startup: int, breadth: Breadth | None = None
    ) -> None:
        self._guide = guide
        self._seed = seed
        self._startup = startup
        self._breadth = breadth or Breadth()
        self._pool = Pool(guide, seed, self._breadth.wide)
        self._known: tuple[list[int], Prediction | None] = ([], None)

    def infer_relative_search_space(
        self, study: optuna.Study, trial: FrozenTrial
    ) -> dict[str, BaseDistribution]:
        """Return the guide's search space."""
        return self._guide.space.distributions

    def sample_relative(
        self, study: optuna.Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        """Propose an allowed design for ``trial``."""
        # A trial that was cut off before it had all of its design must not count.
        before = [
            t
            for t in study.get_trials(deepcopy=False)
            if t.number < trial.number and self._guide.space.holds(t.params)
        ]
        finished = [
            t for t in before if t.state == TrialState.COMPLETE and np.isfinite(t.values).all()
        ]
        untaken = self._pool.untaken([t.params for t in before])
        if not untaken:
            raise InputError("every design that passes the checks was tried")
        prediction = self._predict(finished)
        if prediction is None:
            return self._farthest(untaken, [t.params for t in before])
        signs = np.array([-1.0 if d == StudyDirection.MAXIMIZE else 1.0 for d in study.directions])
        return self._improving(untaken, before, finished, prediction, signs)

    def sample_independent(
        self,
        study: optuna.Study,
        trial: FrozenTrial,
        param_name: str,
        param_distribution: BaseDistribution,
    ) -> Any:
        """Refuse a parameter that is no variable of the study."""
        raise ValueError(f"{param_name} is no variable of the study")

    def require_allowed(self) -> None:
        """Raise InputError where next to no design of the space is allowed."""
        self._pool.first()

    def exhausted(self, study: optuna.Study) -> bool:
        """Check whether every allowed design of the space was proposed."""
        proposed = [t.params for t in study.get_trials(deepcopy=False)]
        return not self._pool.untaken(list(filter(self._guide.space.holds, proposed)))

    def _predict(self, finished: list[FrozenTrial]) -> Prediction | None:
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
        self,
        untaken: list[Params],
        before: list[FrozenTrial],
        finished: list[FrozenTrial],
        prediction: Prediction,
        signs: Array,
    ) -> Params:
        """Return the candidate that adds most to the front; none that was proposed already."""
        key, rng = self._guide.space.key, np.random.default_rng([self._seed, len(before)])
        kept = [t for t in finished if max(t.constraints.values(), default=0.0) <= 0.0]
        running = [t.params for t in before if t.state == TrialState.RUNNING]
        values = np.array([t.values for t in kept]).reshape(len(kept), len(signs)) * signs
        best = [t.params for t, good in zip(kept, not_dominated(values), strict=True) if good]
        there = [*(t.params for t in kept), *running]
        near = self._pool.draw(rng, self._breadth.near, best) if best else []
        gone = {key(t.params) for t in before}
        untaken += [params for params in near if key(params) not in gone]
        draws = prediction.draws([*untaken, *there], rng, self._breadth.draws)
        candidates, front = draws[:, : len(untaken)], draws[:, len(untaken) :]
        low, high = _ends(values, candidates.mean(axis=0))
        ways = directions(rng, self._breadth.ways, len(signs))
        gained = added((candidates - low) / (high - low), (front - low) / (high - low),
                       np.full(len(signs), BEYOND), ways)  # fmt: skip
        likely = gained * prediction.chances(untaken)
        if likely.max() > 0.0:
            return untaken[int(np.argmax(likely))]
        # No draw adds anything: the candidate nearest to adding something, by its means.
        mean = ((candidates.mean(axis=0) - low) / (high - low)).max(axis=1)
        return untaken[int(np.argmin(mean))]

    def _farthest(self, pool: list[Params], taken: list[Params]) -> Params:
        """Return the design of the pool that is farthest from all that were taken."""
        if not taken:
            return pool[0]
        here, there = map(self._guide.space.coordinates, (pool, taken))
        apart = np.linalg.norm(here[:, None, :] - there[None, :, :], axis=2).min(axis=1)
        return pool[int(np.argmax(apart))]


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
    own = scales(candidates, reference, ways)
    if front.shape[1]:
        best = scales(front, reference, ways).max(axis=1)
        own = np.maximum(own - best[:, None, :], 0.0)
    return own.mean(axis=(0, 2)) * volume_of(candidates.shape[2])


def volume_of(objectives: int) -> float:
    """Compute the volume of the part of the unit ball with positive coordinates."""
    k = objectives
    return float(math.pi ** (k / 2) / (2**k * math.gamma(k / 2 + 1)))
