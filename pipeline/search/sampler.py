"""A sampler of our own, in Optuna's terms: hypervolume improvement within exact constraints.

First come designs that fill the allowed space. Then predictions of the guide are drawn jointly for
candidates and finished designs, and the candidate is proposed that adds most to the front, times
the probability that it keeps the constraints which only the evaluation tells. Proposals that are
still running count as part of the front, so that a batch spreads.

Every proposal depends on the seed, its number and the trials before it alone: the same seed
gives the same trials, interrupted or not.
"""

from __future__ import annotations

from collections import Counter
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
from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.hypervolume import added, directions, not_dominated

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
    """Allowed designs of the guide's space, the same for every proposal.

    Most draws may not be allowed, so they are drawn once; again only when all were taken.
    """

    def __init__(self, guide: Guide, seed: int, wide: int) -> None:
        self._guide = guide
        self._seed = seed
        self._wide = wide
        self._drawn: list[list[Params]] = []

    def untaken(self, taken: Sequence[Params]) -> list[Params]:
        """Return up to ``wide`` allowed designs that were not taken.

        None where every one was. Raises InputError where next to none is allowed.
        """
        self.first()
        space = self._guide.space
        gone = {space.key(params) for params in taken}
        for pool in self._drawn:
            if left := [params for params in pool if space.key(params) not in gone]:
                return left
        more = self.draw(np.random.default_rng([self._seed, len(self._drawn)]), self._wide)
        known = {space.key(params) for pool in self._drawn for params in pool}
        if any(space.key(params) not in known for params in more):
            self._drawn.append(more)
        return [params for params in more if space.key(params) not in gone]

    def first(self) -> list[Params]:
        """Return ``wide`` allowed designs, taken or not."""
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
            t
            for t in before
            if t.state == TrialState.COMPLETE and bool(np.isfinite(t.values).all())
        ]
        signs = np.array([-1.0 if d == StudyDirection.MAXIMIZE else 1.0 for d in study.directions])
        prediction = self._predict(finished)
        if prediction is None:
            return self._farthest([t.params for t in before])
        return self._improving(before, finished, prediction, signs)

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
        trials = study.get_trials(deepcopy=False)
        holds = self._guide.space.holds
        return not self._pool.untaken([t.params for t in trials if holds(t.params)])

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
        before: list[FrozenTrial],
        finished: list[FrozenTrial],
        prediction: Prediction,
        signs: Array,
    ) -> Params:
        """Return the candidate that adds most to the front; none that was proposed already."""
        space, rng = self._guide.space, np.random.default_rng([self._seed, len(before)])
        kept = [t for t in finished if max(t.constraints.values(), default=0.0) <= 0.0]
        running = [t.params for t in before if t.state == TrialState.RUNNING]
        taken = [t.params for t in before]
        values = np.array([t.values for t in kept]).reshape(len(kept), len(signs)) * signs
        best = [t.params for t, good in zip(kept, not_dominated(values), strict=True) if good]
        there = [*(t.params for t in kept), *running]
        near = self._pool.draw(rng, self._breadth.near, best) if best else []
        gone = {space.key(params) for params in taken}
        untaken = self._pool.untaken(taken)
        untaken += [params for params in near if space.key(params) not in gone]
        # A few counts may be all there is, and then they are proposed again.
        untaken = untaken or self._pool.first()
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

    def _farthest(self, taken: list[Params]) -> Params:
        """Return the design of the pool that is farthest from all that were taken.

        Where every one was, that which was proposed least often.
        """
        space, pool = self._guide.space, self._pool.untaken(taken)
        if not taken:
            return pool[0]
        if not pool:
            often = Counter(space.key(params) for params in taken)
            return min(self._pool.first(), key=lambda params: often[space.key(params)])
        here, there = space.coordinates(pool), space.coordinates(taken)
        apart = np.linalg.norm(here[:, None, :] - there[None, :, :], axis=2).min(axis=1)
        return pool[int(np.argmax(apart))]


def _ends(values: Array, candidates: Array) -> tuple[Array, Array]:
    """Return the range that the hypervolume is scaled by, each (k,).

    From the best of ``values`` (n, k) to the worst that is no outlier, or is of the front: beside
    an outlier all others would count as equally good. The front's own range would not do: a design
    beyond a front that is narrow so far would gain nothing. Values that are all alike, or none, say
    nothing of the scale: then the candidates' means (m, k) do.
    """
    known = values if len(values) else candidates
    lower, upper = np.quantile(known, [0.25, 0.75], axis=0)
    usual = (known <= upper + OUTLYING * (upper - lower)) | not_dominated(known)[:, None]
    low, high = known.min(axis=0), np.where(usual, known, -np.inf).max(axis=0)
    span = np.where(high > low, high - low, np.ptp(known, axis=0))
    span = np.where(span > 0.0, span, np.ptp(candidates, axis=0))
    return low, low + np.where(span > 0.0, span, 1.0)
