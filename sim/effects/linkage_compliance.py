"""The linkage gives like a spring, such as a Bowden cable.

Where the displacement is read at the actuator, that reading runs ahead of the ring by force
over stiffness. Damping is a fixed share of the critical one.
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_mechanism(compliance=to_si("compliance_mm_kN", values["compliance_mm_kN"]))


EFFECT = Effect(
    name="linkage_compliance",
    title="elastic linkage",
    meaning="the linkage between actuator and ring is elastic",
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
        ),
    ),
    change=_change,
    test=BenchTest(
        "static stiffness of the linkage",
        "Block the ring, raise the force in steps and read the displacement at the actuator.",
    ),
)
