"""A constant part of the shift force never reaches the sleeve: the rest rises in the same time.

It acts at rest as in motion, and does not change with its direction, unlike Coulomb friction.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    profile = setting.point.profile
    return setting.with_point(profile=replace(profile, loss=profile.loss + values["loss_N"]))


EFFECT = Effect(
    name="force_loss",
    title="constant loss of shift force",
    meaning="the force at the sleeve is smaller than nominal by a constant",
    parameters=(
        Parameter(
            "loss_N",
            neutral=0.0,
            low=2.0,
            high=150.0,
            scale="log-uniform",
            source="a gauge read to 10 mbar on a piston of 20 cm2 errs by 2 N; return springs and "
            "preloaded seals of such cylinders hold 10 to 50 N, springs of a fork up to 150 N",
            most=1000.0,
            ordinary=(50.0, "return spring and seals of a cylinder"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "static force at the sleeve",
        "Block the ring and measure the force at the shift fork with a load cell at each pressure: "
        "the same difference from nominal at all of them is a loss.",
    ),
)
