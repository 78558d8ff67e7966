"""Contact set and solver of a study."""

from __future__ import annotations

from dataclasses import replace

from dogshape.pipeline.config.schema import ContactSection, SolverSection
from dogshape.sim.clutch_tables import si_fields
from dogshape.sim.shift.clutch import PLANAR_ACCURACY, SCHEMES, Solver, accuracy_of, solver_for
from dogshape.sim.shift.contact import ContactSet, contact_set
from dogshape.sim.shift.mechanism import NOTHING, Mechanism


def contact_of(section: ContactSection) -> ContactSet:
    """Build the named contact set with what is to differ from it; InputError for mistakes."""
    return replace(contact_set(section.set), **own_contact(section))  # type: ignore[arg-type]


def own_contact(section: ContactSection) -> dict[str, float]:
    """Give the fields of the contact set that the file has beside its name, SI."""
    return si_fields(section.model_dump(exclude={"set"}, exclude_none=True))


def solver_of(
    section: SolverSection, contact: ContactSet, mechanism: Mechanism = NOTHING
) -> Solver:
    """Build the solver of a contact set and a mechanism, with own keys; InputError for mistakes.

    Forces of a mechanism with two coefficients of friction are the compiled engine's, unless the
    section names another: Drake's ``cenic`` takes a thousand times the processor time for them
    and is off its limit by percents (``docs/planar.md``).
    """
    solver = solver_for(contact, mechanism)
    if mechanism.has_forces and solver.scheme == "cenic" and section.engine is None:
        section = section.model_copy(update={"engine": "planar"})
    if section.scheme is not None:
        known = section.scheme in SCHEMES
        accuracy = accuracy_of(section.scheme, mechanism) if known else solver.accuracy
        solver = Solver(section.scheme, accuracy)
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
