"""Contact set and solver of a study."""

from __future__ import annotations

from dataclasses import replace

from dogshape.pipeline.config.schema import ContactSection, SolverSection
from dogshape.sim.clutch_tables import si_fields
from dogshape.sim.shift.clutch import PLANAR_ACCURACY, SCHEMES, Solver, solver_for
from dogshape.sim.shift.contact import ContactSet, contact_set


def contact_of(section: ContactSection) -> ContactSet:
    """Build the named contact set with what is to differ from it; InputError for mistakes."""
    return replace(contact_set(section.set), **own_contact(section))  # type: ignore[arg-type]


def own_contact(section: ContactSection) -> dict[str, float]:
    """Give the fields of the contact set that the file has beside its name, SI."""
    return si_fields(section.model_dump(exclude={"set"}, exclude_none=True))


def solver_of(section: SolverSection, contact: ContactSet) -> Solver:
    """Build the solver that a contact set needs, with what is to differ; or raise InputError."""
    solver = solver_for(contact)
    if section.scheme is not None:
        solver = Solver(section.scheme, SCHEMES.get(section.scheme, solver.accuracy))
    if section.engine is not None:
        planar = section.engine == "planar"
        accuracy = PLANAR_ACCURACY if planar else solver.accuracy
        solver = replace(solver, engine=section.engine, accuracy=accuracy)
    if section.accuracy is not None:
        solver = replace(solver, accuracy=section.accuracy)
    if section.max_step_s is not None:
        solver = replace(solver, max_step=section.max_step_s)
    if section.max_steps is not None:
        solver = replace(solver, max_steps=section.max_steps)
    if section.time_limit_s is not None:
        solver = replace(solver, time_limit=section.time_limit_s)
    return solver
