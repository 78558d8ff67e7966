"""A search at one moment: its designs as values, and the front."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import Design, Measured, design_of, leading, objectives_of
from dogshape.pipeline.simulate.evaluation import Params, Simulated
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.statistics.expectation import Estimate
from dogshape.sim.strength.landing import Demand

SIMULATION = "simulation"  #: attribute of a trial: what the shifts of its design gave
FAILED = "failed_shifts"  #: attribute of a trial: how many shifts failed, by reason
PROTOTYPE = "prototype"  #: attribute of the trial of the study's own design


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
    measured: Measured | None = None
    rows: Sequence[Sequence[float | None]] = field(default=(), repr=False)
    shifts: int = 0
    failed: Mapping[str, int] = field(default_factory=dict)
    confirmed: bool = False
    judged: bool = True

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


def simulation_record(found: Simulated) -> dict[str, Any]:
    """Record the simulation of a design as the storage keeps it."""
    measured = found.measured
    return {
        "estimates": {name: [e.value, e.standard_error] for name, e in found.estimates.items()},
        "demand_Pa": list(measured.demand),
        "limited": dict(measured.limited),
        "engaged": measured.engaged,
        "rows": row_record(found.rows),
        "shifts": found.shifts,
    }


def trial_of(frozen: FrozenTrial) -> Trial:
    """Read a finished trial of the storage."""
    attrs, found = frozen.user_attrs, dict[str, Any]()
    if known := attrs.get(SIMULATION):
        found = {
            "estimates": {name: Estimate(*pair) for name, pair in known["estimates"].items()},
            "measured": Measured(Demand(*known["demand_Pa"]), known["limited"], known["engaged"]),
            **{name: known[name] for name in ("rows", "shifts")},
        }
    return Trial(
        frozen.number, dict(frozen.params), tuple(frozen.values), attrs.get(PROTOTYPE, False),
        failed=attrs.get(FAILED, {}), **found,
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
        place = objectives_of(self.study).index(leading(self.study))
        return float(self.losses[trial.number][place])

    def renew(self, trials: Iterable[Trial]) -> SearchState:
        """Replace trials by those of the same numbers."""
        new = {trial.number: trial for trial in trials}
        known = {number: one for number, one in self.known.items() if number not in new}
        return replace(self, trials=tuple(new.get(t.number, t) for t in self.trials), known=known)
