"""The gap between the crests before the shift differs from the nominal, and the travel with it."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _change(setting: Setting, values: Values) -> Setting:
    gap = setting.clutch.dog.axial_gap + to_si("gap_offset_mm", values["gap_offset_mm"])
    return setting.with_dog(axial_gap=gap)


EFFECT = Effect(
    name="axial_gap",
    title="axial gap off nominal",
    meaning="the gap before the shift is larger or smaller than nominal",
    parameters=(
        Parameter(
            "gap_offset_mm",
            neutral=0.0,
            low=-0.8,
            high=0.8,
            scale="uniform",
            source="axial positions of two gears on a shaft add up to some tenths; "
            "neutral of a shift mechanism without a stop is off by half a millimetre",
        ),
    ),
    change=_change,
    test=BenchTest(
        "gap by feeler or travel",
        "Push the ring from neutral until dogs meet dogs, face on face, and read the displacement.",
    ),
)
