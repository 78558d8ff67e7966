"""The linkage gives like a spring, such as a Bowden cable.

Where the displacement is read at the actuator, that reading runs ahead of the ring by force
over stiffness. Damping is a fixed share of the critical one. The mass behind the compliance, of
actuator, arm and cable, counts as felt at the sleeve (times ratio squared). As the compliance goes
to 0 that mass moves with the ring, as in ``moving_mass``; with both effects the masses add up.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.effects.moving_mass import EFFECT as MOVING_MASS
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si

(_MASS,) = MOVING_MASS.parameters


def _change(setting: Setting, values: Values) -> Setting:
    mass = setting.clutch.mechanism.added_mass + values["mass_behind_kg"]
    compliance = to_si("compliance_mm_kN", values["compliance_mm_kN"])
    return setting.with_mechanism(compliance=compliance, added_mass=mass)


EFFECT = Effect(
    name="linkage_compliance",
    title="elastic linkage",
    meaning="the linkage between actuator and ring is elastic, with the actuator's mass behind it",
    parameters=(
        Parameter(
            "compliance_mm_kN",
            neutral=0.0,
            low=0.3,
            high=35.0,
            scale="log-uniform",
            source="a steel fork and rod give 0.3 mm/kN; Bowden cables, the published "
            "stand among them, 3.4 to 4.3 at the sleeve; long or worn ones ten times as much",
            most=120.0,
            ordinary=(4.3, "Bowden cables"),
        ),
        replace(_MASS, name="mass_behind_kg", ordinary=None),
    ),
    change=_change,
    test=BenchTest(
        "static stiffness of the linkage",
        "Block the ring, raise the force in steps and read the displacement at the actuator; then "
        "strike the actuator and record its swing: frequency and stiffness give the mass.",
    ),
)
