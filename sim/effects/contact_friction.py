"""Friction of the dogs on each other.

The explicit scheme knows the dynamic coefficient alone; ``cenic`` both (``sim.shift.contact``).
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_contact(
        static_friction=values["static_friction"], dynamic_friction=values["dynamic_friction"]
    )


def _static(setting: Setting) -> float:
    return setting.clutch.contact.static_friction


def _dynamic(setting: Setting) -> float:
    return setting.clutch.contact.dynamic_friction


EFFECT = Effect(
    name="contact_friction",
    title="other friction between the dogs",
    meaning="dogs rub on each other with other coefficients",
    parameters=(
        Parameter(
            "static_friction",
            neutral=_static,
            low=0.05,
            high=0.45,
            scale="uniform",
            source="oiled hardened steel 0.08 to 0.16, dry steel up to 0.4; the "
            "dynamic one must not exceed it",
            least=0.01,
            most=1.0,
        ),
        Parameter(
            "dynamic_friction",
            neutral=_dynamic,
            low=0.03,
            high=0.35,
            scale="uniform",
            source="oiled hardened steel 0.05 to 0.12, dry steel up to 0.3",
            least=0.01,
            most=1.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "tilt test of the dogs",
        "Press two dog faces on each other under a known load and measure the "
        "tangential force, at rest and while sliding, oiled as on the bench.",
    ),
)
