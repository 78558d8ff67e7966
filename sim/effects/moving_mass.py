"""Masses of actuator, rod and linkage, as they are felt at the sleeve (times ratio squared).

With a linkage they stand on its far side, else they move with the ring.
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    mass = setting.clutch.mechanism.added_mass + values["added_mass_kg"]
    return setting.with_mechanism(added_mass=mass)


EFFECT = Effect(
    name="moving_mass",
    title="mass of actuator and linkage",
    meaning="actuator and linkage move with the ring and add their mass",
    parameters=(
        Parameter(
            "added_mass_kg",
            neutral=0.0,
            low=0.03,
            high=18.0,
            scale="log-uniform",
            source="fork and rod weigh 0.1 to 1 kg; an arm of 0.5 kg behind a ratio "
            "of 3.2 feels like 5 kg, a robot's drive like three times that",
            most=60.0,
            ordinary=(1.0, "fork and rod"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "free flight at the sleeve",
        "Shift with the output ring taken out and record the displacement at "
        "the sleeve: its acceleration under a known force is the mass.",
    ),
)
