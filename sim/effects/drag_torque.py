"""A torque that holds the sliding ring against turning: bearings, seals, oil, a clutch."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_mechanism(drag_torque=values["drag_Nm"])


EFFECT = Effect(
    name="drag_torque",
    title="drag torque on the sliding ring",
    meaning="the sliding ring is held by a torque against its turning",
    parameters=(
        Parameter(
            "drag_Nm",
            neutral=0.0,
            low=0.02,
            high=8.0,
            scale="log-uniform",
            source="bearings and seals of an input shaft take 0.05 to 0.5 N m, cold "
            "oil and a dragging clutch some N m, both together up to 8",
            most=40.0,
            ordinary=(0.5, "bearings and seals of an input shaft"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "run-down of the sliding ring",
        "Turn the free sliding ring and record how its speed falls, or turn it by a torque wrench.",
    ),
)
