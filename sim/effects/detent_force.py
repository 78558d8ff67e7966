"""A detent that the ring has to pass: a hump of force over a millimetre of its way."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _change(setting: Setting, values: Values) -> Setting:
    if values["detent_N"] == 0.0:
        return setting
    place = to_si("position_mm", values["position_mm"])
    return setting.with_mechanism(detent=values["detent_N"], detent_position=place)


EFFECT = Effect(
    name="detent_force",
    title="force of a detent",
    meaning="a detent holds the ring over a short part of its way",
    parameters=(
        Parameter(
            "detent_N",
            neutral=0.0,
            low=10.0,
            high=200.0,
            scale="log-uniform",
            source="ball detents of passenger cars take 10 to 100 N at the rod; above "
            "the least shift force nothing would move",
            most=1000.0,
            ordinary=(100.0, "ball detents of passenger cars"),
        ),
        Parameter(
            "position_mm",
            neutral=0.5,
            low=0.5,
            high=4.5,
            scale="uniform",
            source="anywhere on the travel; most likely where it leaves neutral",
            least=0.5,
            most=4.5,
        ),
    ),
    change=_change,
    test=BenchTest(
        "slow push of the free ring",
        "Push the free ring slowly along its shaft, both ways, and record force over "
        "displacement: a level force is dry friction, a hump a detent.",
    ),
)
