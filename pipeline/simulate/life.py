"""Drift of a design over its life: times and margins as it is new, half worn and worn.

At each stage the worn shape (``sim.strength.wear``) is simulated at every operating point and at
angles that the search did not use. Wear by a rate follows the energy of the stage before. What
bends the root counts as the worse of worn and new: a worn dog is loaded lower above its root. The
share of the height that touches is that of the new height. Checks of manufacture are those of a new
dog, and are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, demand_over, expectation_of
from dogshape.pipeline.simulate.executor import Executor
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.blocks import even_blocks
from dogshape.sim.statistics.expectation import mean_over
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.strength.checks import Check, smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import demand_checks
from dogshape.sim.strength.manufacture import CONTACT_RULE
from dogshape.sim.strength.wear import Wear, worn
from dogshape.sim.units import DEG, MM

STAGES = (0.0, 0.5, 1.0)  #: shares of the life
#: The part ``life`` of result.json, whose schema is ``pipeline.store.result_schema``.
Row = dict[str, Any]


def life_of(study: Setup, params: Mapping[str, float], wear: Wear, executor: Executor) -> list[Row]:
    """Simulate a design over its life, a row for each of ``STAGES``.

    Raises GeometryError where a worn dog cannot be.
    """
    own, new = study.operated(params), study.dog_with(dict(params))
    loss, found, before = 0.0, list[Row](), 0.0
    for stage in STAGES:
        share = stage - before
        if found:
            energy, friction = found[-1]["energy_J"], study.clutch.contact.dynamic_friction
            shifts = share * study.limits.load.shifts
            loss += wear.loss(worn(new, loss), energy, friction, shifts)
        if wear.crest_loss is not None:
            loss = stage * wear.crest_loss
        edges = wear.edges(new, stage)
        dog = replace(worn(new, loss) if loss else new, edge_radius=edges)
        worn_so_far = {"life": stage, "crest_loss_mm": loss / MM, "edge_radius_mm": edges / MM}
        found.append({**worn_so_far, **_stage(own, new, dog, executor)})
        before = stage
    return found


def _stage(study: Setup, new: Dog, dog: Dog, executor: Executor) -> Row:
    settings, clutch = study.file.expectation, study.clutch.with_dog(dog)
    seed, unsure = settings.seed + NEW_ANGLES, study.uncertainty
    blocks = even_blocks(clutch, study.points, settings.angles, seed, uncertainty=unsure)
    rows = executor.run(blocks)
    expectation = expectation_of(study, [b.point for b in blocks], rows)
    demand = demand_over(study, dog, expectation, rows)
    checks = (*life_checks(study, new, dog), *demand_checks(demand, study.limits))
    weakest = smallest_margin(checks)
    return {
        "chamfer_deg": dog.chamfer / DEG,
        "expected_shift_time_s": expectation.mean,
        "standard_error_s": expectation.standard_error,
        "engaged": expectation.engaged,
        "energy_J": _energy(study, rows),
        "smallest_margin": weakest.margin,
        "weakest_check": weakest.name,
        "margins": {check.name: check.margin for check in checks},
    }


def life_checks(study: Setup, new: Dog, dog: Dog) -> tuple[Check, ...]:
    """Return the closed-form checks of a worn ``dog`` that was ``new``, without manufacture."""
    fresh = {check.name: check for check in strength_checks(new, study.limits)}
    found = []
    for check in strength_checks(dog, study.limits):
        if check.rule.group == "load":
            found.append(min(check, fresh[check.name], key=lambda one: one.margin))
        elif check.rule is CONTACT_RULE:
            found.append(replace(check, value=check.value * dog.height / new.height))
        elif check.rule.group != "make":
            found.append(check)
    return tuple(found)


def _energy(study: Setup, rows: Sequence[Sequence[Record]]) -> float:
    """Compute the mean over the mix of the energy that the contact takes, J."""
    values = [
        [float(r["energy_dissipated_J"]) for r in mine if r["outcome"] != Outcome.DIVERGED.value]
        for mine in rows
    ]
    return mean_over([point.weight for point in study.points], values).value
