"""One design of a search: its dog, its checks and its objectives.

Most constraints cost nothing and are known before anything is simulated; the hardest
landing comes with the simulation. A constraint is a check's margin with its sign
turned, feasible at or below zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.config import Study
from sim.checks import Check, feasible
from sim.errors import GeometryError, InputError, did_you_mean
from sim.expectation import Expectation
from sim.flank import FLANKS
from sim.geometry import Dog
from sim.landing import LANDING_RULES, landing_checks
from sim.loads import Landing
from sim.locking import separating_force
from sim.notch import outside_fit
from sim.strength import keeps_limits, strength_checks
from sim.units import MM
from surrogate.covariance import Array, Mask

SIMULATED = "expected_shift_time_s"  #: the one objective that needs a simulation


@dataclass(frozen=True)
class Design:
    """Searched keys in edge units with what follows from them.

    ``dog`` is None where the shape is impossible, and ``refusal`` says why.
    """

    params: dict[str, float]
    dog: Dog | None
    checks: tuple[Check, ...]
    refusal: str

    @property
    def feasible(self) -> bool:
        """Whether the shape exists and passes every check."""
        return self.dog is not None and feasible(self.checks)

    @property
    def constraints(self) -> dict[str, float]:
        """Constraint values by name, feasible at or below zero."""
        if self.dog is None:
            return {"geometry": 1.0}
        return {"geometry": -1.0, **{c.name: -c.margin for c in self.checks}}

    @property
    def failed(self) -> list[str]:
        """Names of the checks that fail."""
        if self.dog is None:
            return ["geometry"]
        return [check.name for check in self.checks if not check.passed]

    @property
    def not_checked(self) -> list[str]:
        """Names of the checks that a simulation would add."""
        known = {check.name for check in self.checks}
        return [rule.name for rule in LANDING_RULES if rule.name not in known]


def design_of(study: Study, params: dict[str, float], landing: Landing | None = None) -> Design:
    """Work out a design; an impossible shape is a design that is not feasible.

    ``landing`` is the hardest one that was simulated, None before that.
    """
    try:
        dog = study.dog_with(params)
    except GeometryError as error:
        return Design(params, None, (), str(error))
    checks = strength_checks(dog, study.limits)
    if landing is not None:
        checks += landing_checks(dog, landing, study.limits)
    return Design(params, dog, checks, "")


def root_notes(study: Study) -> list[str]:
    """Return warnings where the root of the study's own dog lies outside its formula's fit."""
    return outside_fit(study.clutch.dog, study.limits.root_radius)


def worth_simulating(study: Study, params: dict[str, float]) -> bool:
    """Tell whether a design passes every check that needs no simulation, cheap ones first."""
    try:
        return keeps_limits(study.dog_with(params), study.limits)
    except GeometryError:
        return False


@dataclass(frozen=True)
class Objective:
    """Something to minimise: label and unit for reports, and its exact value if known."""

    name: str
    label: str
    unit: str
    exact: Callable[[Study, Design, Dog], float] | None


def _separating_force(study: Study, _: Design, dog: Dog) -> float:
    return max(separating_force(dog, study.limits.load, flank) for flank in FLANKS)


OBJECTIVES = {
    objective.name: objective
    for objective in (
        Objective(SIMULATED, "expected shift time", "s", None),
        Objective(
            "axial_length_mm",
            "axial length, root to root",
            "mm",
            lambda _study, _design, dog: dog.axial_length / MM,
        ),
        Objective("separating_force_N", "axial separating force", "N", _separating_force),
        Objective(
            "utilisation",
            "utilisation of the most loaded check",
            "",
            lambda _study, design, _dog: max(check.utilisation for check in design.checks),
        ),
    )
}


def objectives_of(study: Study) -> list[Objective]:
    """Return the study's objectives; an unknown name raises InputError."""
    names = study.file.search.objectives
    for name in names:
        if name not in OBJECTIVES:
            hint = did_you_mean(name, OBJECTIVES)
            raise InputError(f"search.objectives has '{name}', which is not an objective; {hint}")
    if SIMULATED not in names:
        raise InputError(f"search.objectives lacks '{SIMULATED}', which a search is for; add it")
    if len(set(names)) != len(names):
        raise InputError("search.objectives names an objective twice; remove one of the two")
    return [OBJECTIVES[name] for name in names]


def exact_values(study: Study, design: Design) -> dict[str, float]:
    """Return the objectives that need no simulation, by name."""
    dog = design.dog
    if dog is None:
        return {}
    return {o.name: o.exact(study, design, dog) for o in objectives_of(study) if o.exact}


def values_of(study: Study, design: Design, expectation: Expectation | None) -> list[float]:
    """Return all objective values in the study's order.

    What is unknown, because the design is infeasible and was not simulated, is infinite.
    """
    exact = exact_values(study, design)
    time = expectation.mean if expectation is not None else float("inf")
    return [
        exact.get(o.name, time if o.exact is None else float("inf")) for o in objectives_of(study)
    ]


def objective_rows(study: Study, designs: Sequence[dict[str, float]], times: Array) -> Array:
    """Return all objectives of designs, (m, k), with their expected shift times given, (m,), s."""
    names = study.file.search.objectives
    rows = []
    for params, time in zip(designs, times.tolist(), strict=True):
        exact = exact_values(study, design_of(study, params))
        rows.append([time if name == SIMULATED else exact[name] for name in names])
    return np.array(rows)


def not_dominated(values: Array) -> Mask:
    """Tell which rows (n, k), all to be minimised, no other row dominates, (n,) of bool."""
    better = (values[:, None, :] <= values[None, :, :]).all(axis=2)
    strictly = (values[:, None, :] < values[None, :, :]).any(axis=2)
    kept: Mask = np.logical_not((better & strictly).any(axis=0)).astype(bool)
    return kept
