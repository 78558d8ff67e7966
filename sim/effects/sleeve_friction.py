"""Coulomb friction of the sliding ring on its shaft, the same at every load."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_mechanism(friction=values["friction_N"])


EFFECT = Effect(
    name="sleeve_friction",
    title="dry friction of the sliding ring",
    meaning="dry friction of the sliding ring on its shaft",
    parameters=(
        Parameter(
            "friction_N",
            neutral=0.0,
            low=3.0,
            high=200.0,
            scale="log-uniform",
            source="a ring of 3 N on an oiled spline drags with newtons; seals, a "
            "tilted fork or dirt with some ten; above the least shift force "
            "nothing would move",
            most=1000.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "slow push of the free ring",
        "Push the free ring slowly along its shaft, both ways, and record force over "
        "displacement: a level force is dry friction, a hump a detent.",
    ),
)
