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
from dogshape.sim.statistics.expectation import Estimate, MixExpectation, PointExpectation
from dogshape.sim.statistics.hangs import HangPosterior, HangPrior, pool
from dogshape.sim.strength.landing import Demand

SIMULATION = "simulation"  #: attribute of a trial: what the shifts of its design gave
FAILED = "failed_shifts"  #: attribute of a trial: how many shifts failed, by reason
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
        """Select counts and engaged mean of an expectation."""
        return cls(point.engaged_mean, point.engaged_error, point.hangs, point.n, point.retry_cost)


@dataclass(frozen=True)
class Trial:
    """A finished design of a search; without estimates and ``check_inputs`` it was not simulated.

    ``failed`` are shifts by reason. ``confirmed`` are the values of new angles, where
    ``engines_agree`` is the verdict of Drake on the compiled engine; True without one.
    """

    number: int
    params: Params
    values: tuple[float, ...]
    prototype: bool = False
    estimates: Mapping[str, Estimate] | None = None
    check_inputs: CheckInputs | None = None
    rows: Sequence[Sequence[float | None]] = field(default=(), repr=False)
    shifts: int = 0
    failed: Mapping[str, int] = field(default_factory=dict)
    confirmed: bool = False
    engines_agree: bool = True
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
        estimates = self.estimates or {}
        losses = []
        errors = []
        for objective, value in zip(objectives_of(study), self.values, strict=True):
            estimate = estimates.get(objective.name)
            losses.append(objective.sign * value)
            errors.append(estimate.standard_error if estimate else 0.0)
        return np.array(losses), np.array(errors)


class SimulationRecord(NamedTuple):
    """Simulation of a design as the storage keeps it, by its keys."""

    estimates: dict[str, list[float]]  #: value and standard error of each objective
    demand_Pa: list[float]  #: fields of ``Demand``
    limited: dict[str, float]  #: values of simulated limits
    engaged: float  #: smallest share of an operating point that engages
    rows: list[list[float | None]]  #: of the surrogate (``row_record``)
    shifts: int
    times: Sequence[Sequence[Any]] = ()  #: fields of ``PointTimes``; empty in earlier versions
    reference: Sequence[Sequence[Any]] = ()  #: those of the reference; empty without one


def simulation_record(evaluation: Evaluation) -> SimulationRecord:
    """Record the simulation of a design."""
    check_inputs = evaluation.check_inputs
    estimates = evaluation.estimates.items()
    reference = evaluation.reference
    return SimulationRecord(
        estimates={name: [e.value, e.standard_error] for name, e in estimates},
        demand_Pa=list(check_inputs.demand),
        limited=dict(check_inputs.limited),
        engaged=check_inputs.engaged,
        rows=row_record(evaluation.rows),
        shifts=evaluation.shifts,
        times=[PointTimes.of(point) for point in evaluation.expectation.points],
        reference=[PointTimes.of(point) for point in reference.points] if reference else [],
    )


def trial_of(frozen: FrozenTrial) -> Trial:
    """Read a finished trial of the storage."""
    attributes = frozen.user_attrs
    trial = Trial(
        number=frozen.number,
        params=dict(frozen.params),
        values=tuple(frozen.values),
        prototype=attributes.get(PROTOTYPE, False),
        failed=attributes.get(FAILED, {}),
    )
    keys = attributes.get(SIMULATION)
    if not keys:
        return trial
    record = SimulationRecord(**keys)
    return replace(
        trial,
        estimates={name: Estimate(*pair) for name, pair in record.estimates.items()},
        check_inputs=CheckInputs(Demand(*record.demand_Pa), record.limited, record.engaged),
        rows=record.rows,
        shifts=record.shifts,
        times=[PointTimes(*point) for point in record.times],
        reference=[PointTimes(*point) for point in record.reference],
    )


def expectation_from(study: Setup, times: Sequence[PointTimes]) -> MixExpectation:
    """Build the expectation over the operating points of a study, before any prior of hangs."""
    points = [
        PointExpectation(
            point,
            engaged_mean=point_times.engaged_mean,
            engaged_error=point_times.engaged_error,
            unaided_mean=None,
            sd=0.0,
            engaged=1.0 - point_times.hangs / max(1, point_times.shifts),
            n=point_times.shifts,
            retry_cost=point_times.retry_cost,
            hang=HangPosterior(0.0, 0.0),
        )
        for point, point_times in zip(study.points, times, strict=True)
    ]
    return MixExpectation(tuple(points))


def pool_trials(
    study: Setup, trials: Sequence[Trial]
) -> tuple[tuple[Trial, ...], tuple[HangPrior, ...]]:
    """Estimate times of trials by a prior of hangs that is fitted to all of them.

    Returns the trials, and the prior of each operating point; none where no trial was simulated.
    """
    counts = [trial.counts for trial in trials if trial.times]
    if not counts:
        return tuple(trials), ()
    priors = pool(counts)
    pooled = [replace_priors(study, trial, priors) if trial.times else trial for trial in trials]
    return tuple(pooled), priors


def replace_priors(study: Setup, trial: Trial, priors: Sequence[HangPrior]) -> Trial:
    """Estimate the times of a simulated trial by priors of the operating points."""
    assert trial.estimates is not None
    assert trial.check_inputs is not None
    expectation = expectation_from(study, trial.times).replace_priors(priors)
    reference = None
    if trial.reference:
        reference = expectation_from(study, trial.reference).replace_priors(priors)
    times = time_estimates(trial.estimates, expectation, reference)
    values = tuple(
        times[name].value if name in times else value
        for name, value in zip(study.file.search.objectives, trial.values, strict=True)
    )
    return replace(
        trial,
        estimates={**trial.estimates, **times},
        values=values,
        check_inputs=replace_limited(trial.check_inputs, times),
    )


def not_dominated(values: Array) -> Mask:
    """Mark the rows (..., n, k), all to be minimised, that no row dominates, (..., n)."""
    rows = values[..., :, None, :]
    rivals = values[..., None, :, :]
    not_worse = np.all(rows <= rivals, axis=-1)
    better_somewhere = np.any(rows < rivals, axis=-1)
    dominated = np.any(not_worse & better_somewhere, axis=-2)
    return np.logical_not(dominated).astype(bool)


@dataclass(frozen=True)
class SearchState:
    """Finished trials of a study by number, with their designs, losses and front.

    ``design_cache`` holds designs of earlier states, by trial; a state adds its own.
    """

    study: Setup
    trials: tuple[Trial, ...]
    design_cache: dict[int, Design] = field(default_factory=dict, repr=False)
    priors: tuple[HangPrior, ...] = ()  #: of hangs, by operating point

    @cached_property
    def designs(self) -> Mapping[int, Design]:
        """Designs with all of their checks, by trial."""
        for trial in self.trials:
            if trial.number not in self.design_cache:
                design = design_of(self.study, trial.params, trial.check_inputs)
                self.design_cache[trial.number] = design
        return {trial.number: self.design_cache[trial.number] for trial in self.trials}

    @cached_property
    def simulated(self) -> tuple[Trial, ...]:
        """Trials of designs that were simulated."""
        return tuple(trial for trial in self.trials if trial.simulated)

    @cached_property
    def feasible(self) -> tuple[Trial, ...]:
        """Simulated designs that pass every check and that the engines agree on."""
        return tuple(
            trial
            for trial in self.simulated
            if self.designs[trial.number].feasible and trial.engines_agree
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
        losses = np.array([self.losses[trial.number] for trial in self.feasible])
        marks = zip(self.feasible, not_dominated(losses), strict=True)
        front = [trial for trial, on_front in marks if on_front]
        return tuple(sorted(front, key=self.leading_loss))

    @property
    def best(self) -> Trial | None:
        """Design of the front that is best in the leading objective."""
        return next(iter(self.front), None)

    def leading_loss(self, trial: Trial) -> float:
        """Return the leading objective of a simulated trial, to be minimised."""
        place = objectives_of(self.study).index(leading_objective(self.study))
        return float(self.losses[trial.number][place])

    def renew(self, trials: Iterable[Trial]) -> SearchState:
        """Replace each trial that has the number of a new trial."""
        renewed = {trial.number: trial for trial in trials}
        designs = {
            number: design for number, design in self.design_cache.items() if number not in renewed
        }
        all_trials = tuple(renewed.get(trial.number, trial) for trial in self.trials)
        return replace(self, trials=all_trials, design_cache=designs)
