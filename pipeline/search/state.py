"""A search at one moment: finished trials, predicted times, feasible designs and the front.

The storage is listed once for a state (``pipeline.search.search.Search.read``). Everything that
compares designs takes the state, so that all of it speaks of the same trials.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from typing import Any

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import SCREENED, DogGuide, distinct, simulated
from dogshape.pipeline.search.level_front import LEVELS, correction_of, level_times_of, levels_of
from dogshape.pipeline.search.sampler import PLAN
from dogshape.pipeline.simulate.design import (
    MEASURED,
    SIMULATED,
    Design,
    Measured,
    design_of,
    leading,
    losses_of,
    objectives_of,
)
from dogshape.pipeline.simulate.point_plans import Plan, blocks_of, is_whole, whole_plan
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.shift_records import landing_of
from dogshape.sim.strength.landing import Demand, demand_of
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import COLUMNS
from dogshape.surrogate.hypervolume import not_dominated

Times = Mapping[int, tuple[float, float]]  #: expected times and standard errors, s, by trial
CONFIRMED = "confirmed"  #: attribute of a trial whose values are those at new angles


@dataclass(frozen=True)
class Findings:
    """Knowledge of this run that the storage does not hold, by trial number.

    Parameters
    ----------
    renewed : trials with what other shifts say of them; the storage keeps what they were told.
    left_open : trials of which the clock ended a shift, with what this run found. In the storage
        they go on running, so that another run takes them up.
    """

    renewed: Mapping[int, FrozenTrial] = field(default_factory=dict)
    left_open: Mapping[int, FrozenTrial] = field(default_factory=dict)

    def with_renewed(self, trials: Iterable[FrozenTrial]) -> Findings:
        """Add what other shifts say of finished trials."""
        return replace(self, renewed={**self.renewed, **{t.number: t for t in trials}})

    def with_left_open(self, trial: FrozenTrial) -> Findings:
        """Add what this run found of a trial that the next run takes up."""
        return replace(self, left_open={**self.left_open, trial.number: trial})


NOTHING = Findings()  #: of a run that has only begun


@dataclass(frozen=True)
class SearchState:
    """A search at one moment, made by ``state_of``.

    Parameters
    ----------
    study : the study that is searched.
    guide : gives the surrogate of its trials; None for a search without one.
    shared : whether several machines share the search.
    findings : knowledge of this run that the storage does not hold.
    trials : finished trials in the order of their numbers.
    simulated : those of designs that were simulated.
    predicted : expected times and standard errors, s, by trial, as all shifts so far say; empty
        where every operating point was simulated.
    feasible : simulated designs, each once, that pass every check, the landing's too.
    losses : objectives of each simulated trial, by number, all to be minimised, (k,).
    front : feasible designs that no other dominates, best of the first simulated objective first.
    """

    study: Setup
    guide: DogGuide | None
    shared: bool
    findings: Findings
    trials: tuple[FrozenTrial, ...]
    simulated: tuple[FrozenTrial, ...]
    predicted: Times
    feasible: tuple[FrozenTrial, ...]
    losses: Mapping[int, Array]
    front: tuple[FrozenTrial, ...]

    @property
    def best(self) -> FrozenTrial | None:
        """Feasible design that is best in the first simulated objective."""
        return min(self.feasible, key=self.leading_loss, default=None)

    @property
    def spent(self) -> int:
        """Number of shifts of all designs, each design counted once."""
        return sum(sum(self.plan(trial)) for trial in distinct(self.simulated))

    @property
    def rows(self) -> list[list[float | None]]:
        """Rows of all simulated trials for the surrogate, in their order.

        In two levels those of the compiled engine with the mean correction of all designs.
        """
        factor = 1.0
        if self.study.two_levels and self.simulated:
            levels = [levels_of(self.study, trial) for trial in self.simulated]
            factor += correction_of(self.study, levels).mean
        first = len(self.study.variables)
        scaled = [first + COLUMNS.index(name) for name in ("mean_s", "standard_error_s", "sd_s")]
        return [
            [v * factor if v is not None and k in scaled else v for k, v in enumerate(row)]
            for trial in self.simulated
            for row in trial.user_attrs["rows"]
        ]

    def plan(self, trial: FrozenTrial) -> Plan:
        """Give the angles of a trial's design at each operating point (``plan_of``)."""
        return plan_of(self.study, trial)

    def design(self, trial: FrozenTrial) -> Design:
        """Work out the design of a trial with all of its checks (``checked_design``)."""
        return checked_design(self.study, trial)

    def value(self, trial: FrozenTrial, name: str) -> tuple[float, float]:
        """Read the expected time or an objective of a simulated trial, with its standard error."""
        if name == SIMULATED and trial.number in self.predicted:
            return self.predicted[trial.number]
        names, attributes = self.study.file.search.objectives, trial.user_attrs
        errors = attributes.get("standard_errors", {SIMULATED: attributes.get("standard_error_s")})
        known = attributes.get("simulated", {})
        value = known[name] if name in known else trial.values[names.index(name)]
        return float(value), float(errors.get(name) or 0.0)

    def leading_loss(self, trial: FrozenTrial) -> float:
        """Read the first simulated objective of a simulated trial, to be minimised."""
        return _leading(self.study, self.losses[trial.number])

    def renew(self, trials: Iterable[FrozenTrial]) -> SearchState:
        """Make the state with what other shifts say of finished trials."""
        findings = self.findings.with_renewed(trials)
        known = [findings.renewed.get(t.number, t) for t in self.trials]
        return state_of(self.study, self.guide, self.shared, findings, known)

    def shifts(self, known: Iterable[str]) -> int:
        """Count the shifts: those known by their keys and, of a shared search, other machines'."""
        keys = set(known)
        if self.shared:
            settings = self.study.file.expectation
            for trial in self.simulated:
                clutch = self.study.clutch.with_dog(self.study.dog_with(dict(trial.params)))
                plan, seed, base = self.plan(trial), settings.seed, self.study.own_angles
                own = self.study.operated(dict(trial.params))
                blocks = blocks_of(own, clutch, plan, seed, base)
                keys.update(key for block in blocks for key in block.keys)
        return len(keys)


def state_of(
    study: Setup,
    guide: DogGuide | None,
    shared: bool,
    findings: Findings,
    trials: Sequence[FrozenTrial],
) -> SearchState:
    """Work out times, feasible designs and the front of finished trials, each once."""
    known = [trial for trial in trials if simulated(trial)]
    predicted = _predicted(study, guide, known)
    losses = {trial.number: _losses(study, trial, predicted) for trial in known}
    feasible = [t for t in distinct(known) if checked_design(study, t).feasible]
    front: list[FrozenTrial] = []
    if feasible:
        kept = not_dominated(np.array([losses[t.number] for t in feasible]))
        front = [trial for trial, keep in zip(feasible, kept, strict=True) if keep]
        front.sort(key=lambda t: _leading(study, losses[t.number]))
    return SearchState(
        study=study,
        guide=guide,
        shared=shared,
        findings=findings,
        trials=tuple(trials),
        simulated=tuple(known),
        predicted=predicted,
        feasible=tuple(feasible),
        losses=losses,
        front=tuple(front),
    )


def plan_of(study: Setup, trial: FrozenTrial) -> Plan:
    """Read how many angles a trial's design has, or is to have, at each operating point."""
    plan: Plan = trial.system_attrs.get(PLAN) or whole_plan(study)
    return plan


def checked_design(study: Setup, trial: FrozenTrial) -> Design:
    """Work out the design of a trial with all of its checks, the measured ones too if there are."""
    return design_of(study, dict(trial.params), measured_of(study, trial))


def measured_record(measured: Measured) -> dict[str, Any]:
    """Record what checks are judged by as an attribute of a trial."""
    return {
        "demand_Pa": list(astuple(measured.demand)),
        "limited": dict(measured.limited),
        "engaged": measured.engaged,
    }


def measured_of(study: Setup, trial: FrozenTrial) -> Measured | None:
    """Read what was measured of a trial's design; None where it was not simulated."""
    record = trial.user_attrs.get(MEASURED)
    if record is not None:
        return Measured(Demand(*record["demand_Pa"]), record["limited"], record.get("engaged", 1.0))
    if not simulated(trial):
        return None
    # Storages of earlier versions have the hardest landing itself.
    dog = study.dog_with(dict(trial.params))
    return Measured(demand_of(dog, landing_of(trial.user_attrs), study.limits))


def compiled_shifts(study: Setup, trials: Iterable[FrozenTrial]) -> int:
    """Count the compiled shifts that trials of a study in two levels rest on, each design once."""
    return sum(compiled_of(study, trial) for trial in distinct([*trials]))


def compiled_of(study: Setup, trial: FrozenTrial) -> int:
    """Count the compiled shifts that a trial of a study in two levels rests on."""
    if LEVELS in trial.user_attrs:
        return int(levels_of(study, trial).cheap.size)
    screen = study.file.search.screen_angles or 0
    return len(study.points) * screen if SCREENED in trial.user_attrs else 0


def confirmed(trial: FrozenTrial) -> bool:
    """Check whether the values of a trial are those at the new angles of the confirmation."""
    return CONFIRMED in trial.user_attrs


def _predicted(study: Setup, guide: DogGuide | None, trials: Sequence[FrozenTrial]) -> Times:
    """Work out expected times that the shifts of other designs tell of too.

    That is so where some operating points were left out, or times rest on two levels. A confirmed
    design has its own.
    """
    found = _jointly(study, guide, trials)
    return {t.number: found[t.number] for t in trials if t.number in found and not confirmed(t)}


def _jointly(study: Setup, guide: DogGuide | None, trials: Sequence[FrozenTrial]) -> Times:
    if study.two_levels:
        if not trials:
            return {}
        found = (values.tolist() for values in level_times_of(study, trials))
        return dict(zip((t.number for t in trials), zip(*found, strict=True), strict=True))
    if guide is None or all(is_whole(plan_of(study, trial)) for trial in trials):
        return {}
    try:
        times, errors = (values.tolist() for values in guide.times(trials))
    except InputError:  # too few so far: each has what it was told
        return {}
    numbers = [trial.number for trial in trials]
    return dict(zip(numbers, zip(times, errors, strict=True), strict=True))


def _losses(study: Setup, trial: FrozenTrial, predicted: Times) -> Array:
    found, _ = losses_of(study, trial.values, trial.user_attrs)
    if trial.number in predicted:
        for place, objective in enumerate(objectives_of(study)):
            if objective.name == SIMULATED:
                found[place] = predicted[trial.number][0]
    return found


def _leading(study: Setup, losses: Array) -> float:
    return float(losses[objectives_of(study).index(leading(study))])
