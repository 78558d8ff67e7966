"""The spline of the ring rubs along the shaft, the more the more torque goes through it.

The spline is taken to lie at 0.8 of the dogs' inner radius; coefficient over radius acts.
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.shift.mechanism import SPLINE


def _change(setting: Setting, values: Values) -> Setting:
    if values["spline_friction"] == 0.0:
        return setting
    radius = SPLINE * setting.clutch.dog.inner_radius
    return setting.with_mechanism(spline_friction=values["spline_friction"], spline_radius=radius)


EFFECT = Effect(
    name="spline_friction",
    title="friction in the loaded spline",
    meaning="the ring's spline rubs along the shaft in proportion to its torque",
    parameters=(
        Parameter(
            "spline_friction",
            neutral=0.0,
            low=0.01,
            high=0.3,
            scale="log-uniform",
            source="oiled steel 0.05 to 0.15, dry or worn 0.3; rolling elements 0.01",
            most=1.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "push of the ring under torque",
        "Hold the output ring, load the sliding ring with a known torque and "
        "measure the force that moves it along its shaft.",
    ),
)
