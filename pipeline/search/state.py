"""A search at one moment: its designs, the front, and how sure that is.

For the probability that no other design is better, objectives of all feasible designs are drawn
many times with their standard errors; it is the share of the draws in which no other feasible
design is better in all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.trial import Trial, distinct
from dogshape.pipeline.simulate.design import Design, design_of, leading, objectives_of
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.hypervolume import not_dominated
from dogshape.surrogate.model import interval

DRAWS, PARTS = 2000, 40  #: draws, and parts of them that are compared at once


@dataclass(frozen=True)
class Standing:
    """Interval (95 %) of a design's leading objective, and its probability of the front."""

    low: float
    high: float
    probability: float


@dataclass(frozen=True)
class SearchState:
    """Finished trials of a study in the order of their numbers, and what follows from them."""

    study: Setup
    trials: tuple[Trial, ...]

    @cached_property
    def designs(self) -> Mapping[int, Design]:
        """Designs with all of their checks, by trial."""
        study = self.study
        return {t.number: design_of(study, t.params, t.measured) for t in self.trials}

    @cached_property
    def simulated(self) -> tuple[Trial, ...]:
        """Trials of designs that were simulated."""
        return tuple(trial for trial in self.trials if trial.simulated)

    @cached_property
    def feasible(self) -> tuple[Trial, ...]:
        """Simulated designs, each once, that pass every check and that the engines agree on."""
        return tuple(
            trial
            for trial in distinct(self.simulated)
            if self.designs[trial.number].feasible and trial.judged
        )

    @cached_property
    def losses(self) -> Mapping[int, Array]:
        """Objectives of simulated trials, all to be minimised, (k,), by number."""
        return {trial.number: trial.losses(self.study)[0] for trial in self.simulated}

    @cached_property
    def front(self) -> tuple[Trial, ...]:
        """Feasible designs that no other dominates, best of the leading objective first."""
        if not self.feasible:
            return ()
        kept = not_dominated(np.array([self.losses[t.number] for t in self.feasible]))
        front = [trial for trial, keep in zip(self.feasible, kept, strict=True) if keep]
        return tuple(sorted(front, key=self.leading_loss))

    @property
    def best(self) -> Trial | None:
        """Feasible design that is best in the leading objective."""
        return min(self.feasible, key=self.leading_loss, default=None)

    @property
    def shifts(self) -> int:
        """Number of shifts of all designs, each design counted once."""
        return sum(trial.shifts for trial in distinct(self.simulated))

    def leading_loss(self, trial: Trial) -> float:
        """Give the leading objective of a simulated trial, to be minimised."""
        place = objectives_of(self.study).index(leading(self.study))
        return float(self.losses[trial.number][place])

    def renew(self, trials: Iterable[Trial]) -> SearchState:
        """Replace trials by those of the same numbers."""
        new = {trial.number: trial for trial in trials}
        return replace(self, trials=tuple(new.get(t.number, t) for t in self.trials))


def standings(state: SearchState) -> dict[int, Standing]:
    """Compute interval and probability of each feasible design, by its trial."""
    if not state.feasible:
        return {}
    rng = np.random.default_rng(state.study.file.search.seed)
    pairs = [trial.losses(state.study) for trial in state.feasible]
    means, errors = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    losses = means + errors * rng.standard_normal((DRAWS, *means.shape))
    on_front = np.concatenate([not_dominated(part) for part in np.array_split(losses, PARTS)])
    name = leading(state.study).name
    found = {}
    for trial, probability in zip(state.feasible, on_front.mean(axis=0).tolist(), strict=True):
        known = (trial.estimates or {})[name]
        value, error = known.value, known.standard_error
        low, high = value - 1.96 * error, value + 1.96 * error
        if value > 0.0:
            low, high = (float(end[0]) for end in interval(np.array([value]), np.array([error])))
        found[trial.number] = Standing(low, high, probability)
    return found
