"""Clearance between linkage and ring: the actuator closes it before the ring moves.

The ring is free within it afterwards too. The play begins fully open.
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_mechanism(free_play=to_si("free_play_mm", values["free_play_mm"]))


EFFECT = Effect(
    name="free_play",
    title="free play of the linkage",
    meaning="the actuator has some way to go before it meets the ring",
    parameters=(
        Parameter(
            "free_play_mm",
            neutral=0.0,
            low=0.05,
            high=2.0,
            scale="log-uniform",
            source="a new fork has 0.1 to 0.3 mm in its groove; worn joints of a "
            "linkage add up to some millimetres",
            most=6.0,
            ordinary=(0.3, "a new fork in its groove"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "hand test of the play",
        "Hold the ring and move the actuator to and fro by hand with a dial gauge on it.",
    ),
)
