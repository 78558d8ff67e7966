"""A search at one moment: its designs as values, and the front."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import (
    CheckInputs,
    Design,
    design_of,
    leading_objective,
    objectives_of,
)
from dogshape.pipeline.simulate.evaluation import (
    Evaluation,
    Params,
    replace_limited,
    time_estimates,
)
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.statistics.expectation import Estimate, Expectation, PointExpectation
from dogshape.sim.statistics.hangs import HangPosterior, HangPrior, pool
from dogshape.sim.strength.landing import Demand

SIMULATION = "simulation"  #: attribute of a trial: what the shifts of its design gave
FAILED = "failed_shifts"  #: attribute of a trial: how many shifts failed, by reason
TIMES = ("times", "reference")  #: parts of it that searches of earlier versions lack
PROTOTYPE = "prototype"  #: attribute of the trial of the study's own design


class PointTimes(NamedTuple):
    """Shift counts and engaged mean of an operating point, to which a prior of hangs is added."""

    engaged_mean: float  #: s
    engaged_error: float  #: s
    hangs: int
    shifts: int
    retry_cost: float  #: s

    @classmethod
    def of(cls, point: PointExpectation) -> PointTimes:
        """Select them from an expectation."""
        return cls(point.engaged_mean, point.engaged_error, point.hangs, point.n, point.retry_cost)


@dataclass(frozen=True)
class Trial:
    """A finished design of a search; without estimates and ``measured`` it was not simulated.

    ``failed`` are shifts by reason. Those ``confirmed`` are of new angles; ``judged`` where the
    engines agree there.
    """

    number: int
    params: Params
    values: tuple[float, ...]
    prototype: bool = False
    estimates: Mapping[str, Estimate] | None = None
    measured: CheckInputs | None = None
    rows: Sequence[Sequence[float | None]] = field(default=(), repr=False)
    shifts: int = 0
    failed: Mapping[str, int] = field(default_factory=dict)
    confirmed: bool = False
    judged: bool = True
    times: Sequence[PointTimes] = field(default=(), repr=False)  #: by operating point
    reference: Sequence[PointTimes] = field(default=(), repr=False)  #: of the study's own dog

    @property
    def counts(self) -> list[tuple[int, int]]:
        """Numbers of hangs and shifts by operating point."""
        return [(point.hangs, point.shifts) for point in self.times]

    @property
    def simulated(self) -> bool:
        """Whether the design was simulated."""
        return self.estimates is not None

    def losses(self, study: Setup) -> tuple[Array, Array]:
        """Return objectives, all to be minimised, and their standard errors, each (k,)."""
        known, objectives = self.estimates or {}, objectives_of(study)
        losses = [o.sign * value for o, value in zip(objectives, self.values, strict=True)]
        errors = [known[o.name].standard_error if o.name in known else 0.0 for o in objectives]
        return np.array(losses), np.array(errors)


def simulation_record(found: Evaluation) -> dict[str, Any]:
    """Record the simulation of a design as the storage keeps it."""
    measured = found.measured
    return {
        "estimates": {name: [e.value, e.standard_error] for name, e in found.estimates.items()},
        "demand_Pa": list(measured.demand),
        "limited": dict(measured.limited),
        "engaged": measured.engaged,
        "rows": row_record(found.rows),
        "shifts": found.shifts,
        "times": [PointTimes.of(point) for point in found.expectation.points],
        "reference": [PointTimes.of(p) for p in found.reference.points] if found.reference else [],
    }


def trial_of(frozen: FrozenTrial) -> Trial:
    """Read a finished trial of the storage."""
    attrs, found = frozen.user_attrs, dict[str, Any]()
    if known := attrs.get(SIMULATION):
        found = {
            "estimates": {name: Estimate(*pair) for name, pair in known["estimates"].items()},
            "measured": CheckInputs(
                Demand(*known["demand_Pa"]), known["limited"], known["engaged"]
            ),
            **{name: known[name] for name in ("rows", "shifts")},
            **{k: [PointTimes(*point) for point in known.get(k, ())] for k in TIMES},
        }
    return Trial(
        frozen.number, dict(frozen.params), tuple(frozen.values), attrs.get(PROTOTYPE, False),
        failed=attrs.get(FAILED, {}), **found,
    )  # fmt: skip


def expectation_from(study: Setup, times: Sequence[PointTimes]) -> Expectation:
    """Make an expectation over the operating points of a study, before any prior of hangs."""
    return Expectation(tuple(
        PointExpectation(
            point, engaged_mean=one.engaged_mean, engaged_error=one.engaged_error,
            mean_engaged=None, sd=0.0, engaged=1.0 - one.hangs / max(1, one.shifts), n=one.shifts,
            retry_cost=one.retry_cost, hang=HangPosterior(0.0, 0.0),
        )
        for point, one in zip(study.points, times, strict=True)
    ))  # fmt: skip


def pooled(
    study: Setup, trials: Sequence[Trial]
) -> tuple[tuple[Trial, ...], tuple[HangPrior, ...]]:
    """Estimate times of trials by a prior of hangs that is fitted to all of them.

    Give the trials, and the prior of each operating point; none where no trial was simulated.
    """
    counts = [trial.counts for trial in trials if trial.times]
    if not counts:
        return tuple(trials), ()
    priors = pool(counts)
    return tuple(under_priors(study, t, priors) if t.times else t for t in trials), priors


def under_priors(study: Setup, trial: Trial, priors: Sequence[HangPrior]) -> Trial:
    """Estimate the times of a simulated trial by priors of the operating points."""
    assert trial.estimates is not None
    assert trial.measured is not None
    expectation = expectation_from(study, trial.times).under(priors)
    reference = None
    if trial.reference:
        reference = expectation_from(study, trial.reference).under(priors)
    times = time_estimates(trial.estimates, expectation, reference)
    objectives = [objective.name for objective in objectives_of(study)]
    values = tuple(
        times[name].value if name in times else value
        for name, value in zip(objectives, trial.values, strict=True)
    )
    return replace(
        trial, estimates={**trial.estimates, **times}, values=values,
        measured=replace_limited(trial.measured, times),
    )  # fmt: skip


def not_dominated(values: Array) -> Mask:
    """Mark the rows (..., n, k), all to be minimised, that no row dominates, (..., n)."""
    one, other = values[..., :, None, :], values[..., None, :, :]
    better, strictly = np.all(one <= other, axis=-1), np.any(one < other, axis=-1)
    return np.logical_not(np.any(better & strictly, axis=-2)).astype(bool)


@dataclass(frozen=True)
class SearchState:
    """Finished trials of a study in the order of their numbers, and what follows from them.

    ``known`` designs were worked out before, and hold those that this state adds.
    """

    study: Setup
    trials: tuple[Trial, ...]
    known: dict[int, Design] = field(default_factory=dict, repr=False)
    priors: tuple[HangPrior, ...] = ()  #: of hangs, by operating point

    @cached_property
    def designs(self) -> Mapping[int, Design]:
        """Designs with all of their checks, by trial."""
        for trial in self.trials:
            if trial.number not in self.known:
                self.known[trial.number] = design_of(self.study, trial.params, trial.measured)
        return {trial.number: self.known[trial.number] for trial in self.trials}

    @cached_property
    def simulated(self) -> tuple[Trial, ...]:
        """Trials of designs that were simulated."""
        return tuple(trial for trial in self.trials if trial.simulated)

    @cached_property
    def feasible(self) -> tuple[Trial, ...]:
        """Simulated designs that pass every check and that the engines agree on."""
        return tuple(t for t in self.simulated if self.designs[t.number].feasible and t.judged)

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
        """Design of the front that is best in the leading objective."""
        return next(iter(self.front), None)

    def leading_loss(self, trial: Trial) -> float:
        """Give the leading objective of a simulated trial, to be minimised."""
        place = objectives_of(self.study).index(leading_objective(self.study))
        return float(self.losses[trial.number][place])

    def renew(self, trials: Iterable[Trial]) -> SearchState:
        """Replace trials by those of the same numbers."""
        new = {trial.number: trial for trial in trials}
        known = {number: one for number, one in self.known.items() if number not in new}
        return replace(self, trials=tuple(new.get(t.number, t) for t in self.trials), known=known)
