"""Stiffness of the dogs' contact: pressure over penetration."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_contact(stiffness=values["stiffness_Pa_m"])


def _own(setting: Setting) -> float:
    return setting.clutch.contact.stiffness


EFFECT = Effect(
    name="contact_stiffness",
    title="other stiffness of the dogs",
    meaning="dogs and their bodies give more or less than assumed",
    parameters=(
        Parameter(
            "stiffness_Pa_m",
            neutral=_own,
            low=100000000000.0,
            high=20000000000000.0,
            scale="log-uniform",
            source="4.5e12 for teeth of steel after ISO 6336-1; bodies, bearings and "
            "edge contact make it softer by up to a factor of 30, a full flank "
            "stiffer by 4",
            least=1e10,
            most=1e14,
        ),
    ),
    change=_change,
    test=BenchTest(
        "static stiffness of the engaged pair",
        "Load the engaged pair with a torque and measure the twist between both rings.",
    ),
)
