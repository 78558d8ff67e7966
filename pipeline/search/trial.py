"""Designs of a search as values, and what the storage keeps of one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from typing import Any

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import Measured, objectives_of
from dogshape.pipeline.simulate.evaluation import Params, Simulated
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.statistics.estimate import Estimate
from dogshape.sim.strength.landing import Demand
from dogshape.surrogate.covariance import Array

SIMULATION = "simulation"  #: attribute of a trial: what the shifts of its design gave
FAILED = "failed_shifts"  #: attribute of a trial: how many shifts failed, by reason
PROTOTYPE = "prototype"  #: attribute of the trial of the study's own design


@dataclass(frozen=True)
class Trial:
    """A finished design of a search.

    Parameters
    ----------
    number : of the trial.
    params : searched keys, edge units.
    values : objectives in the order of the study.
    prototype : whether it is the study's own design.
    estimates : simulated objectives with their errors, by name; None where it was not simulated.
    measured : values that its checks are judged by; None likewise.
    rows : for the surrogate, one for each operating point.
    shifts : number of simulated shifts; ``failed`` of them to integrate, by reason.
    confirmed : whether the values are those of new angles.
    judged : whether the engines agree at the new angles.
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
        "demand_Pa": list(astuple(measured.demand)),
        "limited": dict(measured.limited),
        "engaged": measured.engaged,
        "rows": row_record(found.rows),
        "shifts": found.shifts,
    }


def trial_of(frozen: FrozenTrial) -> Trial:
    """Read a finished trial of the storage."""
    known = frozen.user_attrs.get(SIMULATION)
    bare = Trial(
        frozen.number,
        dict(frozen.params),
        tuple(frozen.values),
        prototype=bool(frozen.user_attrs.get(PROTOTYPE, False)),
        failed=frozen.user_attrs.get(FAILED, {}),
    )
    if known is None:
        return bare
    return replace(
        bare,
        estimates={name: Estimate(*pair) for name, pair in known["estimates"].items()},
        measured=Measured(Demand(*known["demand_Pa"]), known["limited"], known["engaged"]),
        rows=known["rows"],
        shifts=known["shifts"],
    )


def distinct(trials: Iterable[Trial]) -> list[Trial]:
    """Select the first trial of each design: one that was proposed again is the same."""
    first: dict[tuple[Any, ...], Trial] = {}
    for trial in trials:
        first.setdefault(tuple(sorted(trial.params.items())), trial)
    return list(first.values())


def simulated_rows(trials: Iterable[Trial]) -> list[Sequence[float | None]]:
    """Collect the rows of all trials for the surrogate, in their order."""
    return [row for trial in trials for row in trial.rows]
