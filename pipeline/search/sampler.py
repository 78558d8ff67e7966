"""A sampler of our own, in Optuna's terms: hypervolume improvement within exact constraints.

First come designs that fill the allowed space. Then predictions of the guide are drawn jointly for
candidates and finished designs, and the candidate is proposed that adds most to the front, times
the probability that it keeps the constraints which only the evaluation tells. Proposals that are
still running count as part of the front, so that a batch spreads.

Every proposal depends on the seed, its number and the trials before it alone: the same seed
gives the same trials, interrupted or not. Any storage serves, and ask-and-tell.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler, RandomSampler
from optuna.search_space import IntersectionSearchSpace
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.search.guide import FreeGuide, Guide, Params, Prediction, sound
from dogshape.pipeline.search.unit_cube import Space
from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.hypervolume import added, directions, not_dominated

WIDE = 400  #: candidates of the whole space, where nobody says another number
LISTED = 10_000  #: designs of a space that are listed and not drawn, at most
TRIES = 200  #: draws for a candidate before the allowed space counts as empty
OUTLYING = 1.5  #: ranges of the quartiles above the upper one where outliers begin (Tukey 1977)
BEYOND = 1.1  #: the hypervolume's reference point, of the range of values: their worst still count


@dataclass(frozen=True)
class Breadth:
    """Numbers of candidates and draws for a proposal; its time grows with their square.

    ``wide`` candidates of the whole space and ``near`` the front, joint ``draws`` of
    predictions, ``ways`` directions of the hypervolume.
    """

    wide: int = WIDE
    near: int = 100
    draws: int = 48
    ways: int = 128


@dataclass(frozen=True)
class _Seen:
    """Trials before the one that is asked: finished, still running, and without a finite value."""

    finished: list[FrozenTrial]
    running: list[FrozenTrial]
    spent: list[FrozenTrial]

    @property
    def count(self) -> int:
        return len(self.taken)

    @property
    def taken(self) -> list[dict[str, Any]]:
        """Designs that were proposed already."""
        return [t.params for t in (*self.finished, *self.running, *self.spent)]


class Pool:
    """Allowed designs of the space that was asked for last, the same for every proposal.

    Most draws may not be allowed, so they are drawn once; again only when all were taken.
    """

    def __init__(self, guide: Guide, seed: int, wide: int = WIDE) -> None:
        self._guide = guide
        self._seed = seed
        self._wide = wide
        self._space = ""
        self._listed: list[dict[str, Any]] | None = None
        self._drawn: list[list[dict[str, Any]]] = []

    def untaken(self, space: Space, taken: Sequence[Params]) -> list[dict[str, Any]]:
        """Return up to ``wide`` allowed designs of a space that were not taken.

        None where every one was. Raises InputError where next to none is allowed.
        """
        self._turn_to(space)
        gone = {space.key(params) for params in taken}
        if self._listed is not None:
            return _not_of(gone, space, self._listed)[: self._wide]
        for pool in self._drawn:
            if left := _not_of(gone, space, pool):
                return left
        # Draw more, and keep them if they are new.
        rng = np.random.default_rng([self._seed, len(self._drawn)])
        more = self.drawn(space, rng, self._wide, None)
        known = {space.key(params) for pool in self._drawn for params in pool}
        if _not_of(known, space, more):
            self._drawn.append(more)
        return _not_of(gone, space, more)

    def first(self, space: Space) -> list[dict[str, Any]]:
        """Return up to ``wide`` allowed designs of a space, taken or not."""
        return self.untaken(space, [])

    def drawn(
        self, space: Space, rng: np.random.Generator, size: int, near: Sequence[Params] | None
    ) -> list[dict[str, Any]]:
        """Draw allowed designs: of the whole space, or near some."""
        found: list[dict[str, Any]] = []
        for _ in range(TRIES * size):
            centre = None if near is None else near[int(rng.integers(len(near)))]
            params = space.drawn(rng, centre)
            if self._guide.allows(params):
                found.append(params)
                if len(found) == size:
                    break
        return self._some(found, f"none of {TRIES * size} designs drawn from the search ranges")

    def _turn_to(self, space: Space) -> None:
        """Forget the designs of another space; list those of a small one."""
        if self._space == (name := repr(space.distributions)):
            return
        self._listed, self._drawn = None, []
        rng = np.random.default_rng(self._seed)
        if (every := space.every(LISTED)) is None:
            self._drawn = [self.drawn(space, rng, self._wide, None)]
        else:
            order = [every[place] for place in rng.permutation(len(every))]
            allowed = [params for params in order if self._guide.allows(params)]
            none_of = f"none of the {len(every)} designs of the search ranges"
            self._listed = self._some(allowed, none_of)
        self._space = name

    def _some(self, found: list[dict[str, Any]], none_of: str) -> list[dict[str, Any]]:
        """Require a design; raise InputError where there is none."""
        if not found:
            raise InputError(self._guide.refusal(none_of))
        return found


def _not_of(gone: set[Any], space: Space, pool: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return [params for params in pool if space.key(params) not in gone]


class SurrogateSampler(BaseSampler):
    """Expected hypervolume improvement on Gaussian processes, within exact constraints.

    Parameters
    ----------
    guide : constraints and predictions; None for any study of Optuna's.
    seed : of every proposal, with the trial's number; None draws one.
    startup : designs that fill the allowed space before anything is predicted.
    breadth : numbers of candidates and draws for a proposal.
    """

    def __init__(
        self,
        guide: Guide | None = None,
        seed: int | None = None,
        startup: int = 10,
        breadth: Breadth | None = None,
    ) -> None:
        self._guide = guide if guide is not None else FreeGuide()
        self._seed = seed if seed is not None else int(np.random.default_rng().integers(2**31))
        self._startup = startup
        self._breadth = breadth or Breadth()
        self._shared = IntersectionSearchSpace()
        self._pool = Pool(self._guide, self._seed, self._breadth.wide)
        self._known: tuple[Any, Prediction | None] = (None, None)

    def reseed_rng(self) -> None:
        """Draw another seed, for a process of its own."""
        self._seed = int(np.random.default_rng().integers(2**31))
        self._pool = Pool(self._guide, self._seed, self._breadth.wide)

    def infer_relative_search_space(
        self, study: optuna.Study, trial: FrozenTrial
    ) -> dict[str, BaseDistribution]:
        """Return the guide's search space, else what all finished trials share."""
        if self._guide.distributions is not None:
            return dict(self._guide.distributions)
        return self._shared.calculate(study)

    def sample_relative(
        self,
        study: optuna.Study,
        trial: FrozenTrial,
        search_space: dict[str, BaseDistribution],
    ) -> dict[str, Any]:
        """Propose an allowed design for ``trial``."""
        if not search_space:
            return {}
        space = Space(search_space)
        seen = self._before(study, trial, space)
        rng = np.random.default_rng([self._seed, seen.count])
        signs = np.array([-1.0 if d == StudyDirection.MAXIMIZE else 1.0 for d in study.directions])
        prediction = self._predict(space, seen, signs)
        if prediction is None:
            return self._farthest(space, seen.taken)
        return self._improving(space, seen, prediction, signs, rng)

    def sample_independent(
        self,
        study: optuna.Study,
        trial: FrozenTrial,
        param_name: str,
        param_distribution: BaseDistribution,
    ) -> Any:
        """Sample a parameter that not all trials share, uniformly."""
        sampler = RandomSampler(seed=(self._seed + 7919 * trial.number) % 2**32)
        return sampler.sample_independent(study, trial, param_name, param_distribution)

    def require_allowed(self) -> None:
        """Raise InputError where next to no design of the guide's space is allowed."""
        self._pool.first(Space(self._guide.distributions or {}))

    def exhausted(self, study: optuna.Study) -> bool:
        """Check whether every allowed design of the guide's space was proposed."""
        space = Space(self._guide.distributions or {})
        trials = study.get_trials(deepcopy=False)
        return not self._pool.untaken(space, [t.params for t in trials if space.holds(t.params)])

    def _before(self, study: optuna.Study, trial: FrozenTrial, space: Space) -> _Seen:
        # A trial that was cut off before it had all of its design must not count.
        before = [
            t
            for t in study.get_trials(deepcopy=False)
            if t.number < trial.number and space.holds(t.params)
        ]
        running = [t for t in before if t.state == TrialState.RUNNING]
        complete = [t for t in before if t.state == TrialState.COMPLETE]
        finished = [t for t, kept in zip(complete, sound(complete), strict=True) if kept]
        known = {t.number for t in (*running, *finished)}
        return _Seen(finished, running, [t for t in before if t.number not in known])

    def _predict(self, space: Space, seen: _Seen, signs: Array) -> Prediction | None:
        """Fit a prediction to finished trials, once for a round; None where they are few."""
        if len(seen.finished) < self._startup:
            return None
        key = (tuple(space.distributions), tuple(t.number for t in seen.finished))
        if self._known[0] != key:
            try:
                self._known = key, self._guide.predict(space, seen.finished, signs)
            except InputError:
                self._known = key, None
        return self._known[1]

    def _improving(
        self,
        space: Space,
        seen: _Seen,
        prediction: Prediction,
        signs: Array,
        rng: np.random.Generator,
    ) -> dict[str, Any]:
        """Return the candidate that adds most to the front; none that was proposed already."""
        kept = [t for t in seen.finished if max(t.constraints.values(), default=0.0) <= 0.0]
        values = np.array([t.values for t in kept]).reshape(len(kept), len(signs)) * signs
        best = [t.params for t, good in zip(kept, not_dominated(values), strict=True) if good]
        there = [t.params for t in (*kept, *seen.running)]
        near = self._pool.drawn(space, rng, self._breadth.near, best) if best else []
        gone = {space.key(params) for params in seen.taken}
        untaken = self._pool.untaken(space, seen.taken)
        untaken += [params for params in near if space.key(params) not in gone]
        # Few counts or choices may be all there is, and then they are proposed again.
        untaken = untaken or self._pool.first(space)
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

    def _farthest(self, space: Space, taken: Sequence[Params]) -> dict[str, Any]:
        """Return the design of the pool that is farthest from all that were taken.

        Where every one was, that which was proposed least often.
        """
        pool = self._pool.untaken(space, taken)
        if not taken:
            return pool[0]
        if not pool:
            often = Counter(space.key(params) for params in taken)
            return min(self._pool.first(space), key=lambda params: often[space.key(params)])
        here, there = space.coordinates(pool), space.coordinates(taken)
        apart = np.linalg.norm(here[:, None, :] - there[None, :, :], axis=2).min(axis=1)
        return pool[int(np.argmax(apart))]


def _ends(values: Array, candidates: Array) -> tuple[Array, Array]:
    """Return the range that the hypervolume is scaled by, each (k,).

    From the best of ``values`` (n, k) to the worst that is usual. The front's own range would not
    do: a design beyond a front that is narrow so far would gain nothing. Values that are all alike,
    or none, say nothing of the scale: then the candidates' means (m, k) do.
    """
    known = values if len(values) else candidates
    low, high = known.min(axis=0), _usual_worst(known)
    span = np.where(high > low, high - low, np.ptp(known, axis=0))
    span = np.where(span > 0.0, span, np.ptp(candidates, axis=0))
    return low, low + np.where(span > 0.0, span, 1.0)


def _usual_worst(values: Array) -> Array:
    """Return the worst of values (n, k) but for outliers that are not of the front, (k,).

    Beside an outlier all others would count as equally good in its objective.
    """
    lower, upper = np.quantile(values, [0.25, 0.75], axis=0)
    usual = np.where(values <= upper + OUTLYING * (upper - lower), values, -np.inf)
    worst: Array = np.maximum(usual, np.where(not_dominated(values)[:, None], values, -np.inf))
    return worst.max(axis=0)
