"""Gain of a design over the prototype under other contact, by the compiled engine.

Friction of dogs and dissipation of a blow are seldom known; a standard error counts neither. So
both designs are simulated again at the ends of what contact may be: friction a third less and a
third more (oiled steel 0.08 to 0.16, VDI 2230-1), dissipation 1 s/m of dry steel and 60 s/m of
faces that meet through oil (``docs/simulation.md``). What the study draws stays drawn about that.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, Params, design_blocks, expectation_of
from dogshape.pipeline.simulate.executor import Executor
from dogshape.sim.shift.contact import ContactSet
from dogshape.sim.statistics.expectation import Expectation

ANGLES = 32  #: of each operating point, for either design
FRICTION, DISSIPATION = (2.0 / 3.0, 4.0 / 3.0), (1.0, 60.0)  #: factors; s/m


def gains_by_contact(study: Setup, params: Params, executor: Executor) -> list[dict[str, Any]]:
    """Simulate the gain in expected shift time under each contact, a row each.

    None where either design engages in too few shifts to have a time.
    """
    named = _contacts(study.clutch.contact)
    designs = [study.prototype, params]
    seed = study.file.expectation.seed + NEW_ANGLES
    asked = []
    for contact in named.values():
        clutch = replace(study.clutch.with_engine("planar"), contact=contact)
        quick = replace(study, clutch=clutch)
        asked += [design_blocks(quick, one, ANGLES, seed) for one in designs]
    with executor.apart() as running:
        rows = iter(running.run([block for blocks in asked for block in blocks]))
    found = [
        expectation_of(study, [b.point for b in blocks], [next(rows) for _ in blocks])
        for blocks in asked
    ]
    pairs = zip(named, found[::2], found[1::2], strict=True)
    return [_row(name, before, after) for name, before, after in pairs]


def _contacts(own: ContactSet) -> dict[str, ContactSet]:
    """Make the contact sets at the ends of friction and dissipation, by what they are called."""
    frictions = {
        f"friction {own.dynamic_friction * factor:.3g}": replace(
            own,
            static_friction=own.static_friction * factor,
            dynamic_friction=own.dynamic_friction * factor,
        )
        for factor in FRICTION
    }
    blows = {f"dissipation {d:g} s/m": replace(own, dissipation=d) for d in DISSIPATION}
    return frictions | blows


def _row(name: str, before: Expectation, after: Expectation) -> dict[str, Any]:
    known = before.engages and after.engages
    gain = before.mean - after.mean
    error = math.hypot(before.standard_error, after.standard_error)
    return {
        "contact": name,
        "gain_s": gain if known else None,
        "gain_standard_error_s": error if known else None,
        "gain_share": gain / before.mean if known else None,
    }
