"""The chamfer of the faces differs from the nominal one."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _change(setting: Setting, values: Values) -> Setting:
    chamfer = setting.clutch.dog.chamfer + to_si("chamfer_offset_deg", values["chamfer_offset_deg"])
    return setting.with_dog(chamfer=chamfer)


EFFECT = Effect(
    name="chamfer_angle",
    title="chamfer angle off nominal",
    meaning="the faces are steeper or flatter than nominal",
    parameters=(
        Parameter(
            "chamfer_offset_deg",
            neutral=0.0,
            low=-4.0,
            high=4.0,
            scale="uniform",
            source="made to half a degree; worn or hand-dressed faces are off by two, faces of "
            "another drawing by four",
        ),
    ),
    change=_change,
    test=BenchTest(
        "chamfer by profile",
        "Measure the profile of some dogs of either ring on a measuring machine or an imprint.",
    ),
)
