"""The sliding side has a larger inertia than stated: what turns with the ring adds to it.

More shaft, gear wheels in mesh or a disc not disengaged turn with the ring. With an elastic input
shaft the inertia behind it grows, and that of the ring alone stays.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    rings = setting.clutch.rings
    heavier = replace(rings, sliding_inertia=rings.sliding_inertia * values["inertia_factor"])
    return replace(setting, clutch=replace(setting.clutch, rings=heavier))


EFFECT = Effect(
    name="sliding_inertia",
    title="inertia of the sliding side off nominal",
    meaning="what turns with the sliding ring has a factor of the nominal inertia",
    parameters=(
        Parameter(
            "inertia_factor",
            neutral=1.0,
            low=1.1,
            high=8.0,
            scale="log-uniform",
            source="wheels of other gears in mesh add 10 to 100 percent of an input shaft's "
            "inertia, a clutch disc of 0.003 to 0.008 kg m2 as much as the published 0.01; "
            "a ratio of 2.8 that was left out counts squared, 8",
            least=0.1,
            most=50.0,
            ordinary=(2.0, "other wheels in mesh"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "run-up of the sliding side",
        "Turn the free sliding side by a weight on a cord and record its speed: torque over "
        "acceleration is its inertia.",
    ),
)
