"""Relative angles at the start of the force are not uniform over the pitch.

No shift changes, only how often each angle comes: weights, and no simulation.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    if values["concentration"] == 0.0:
        return setting
    return replace(
        setting, concentration=values["concentration"], centre=values["centre_pitch"] % 1.0
    )


EFFECT = Effect(
    name="relative_angle",
    title="uneven relative angles",
    meaning="some relative angles come more often than others",
    parameters=(
        Parameter(
            "concentration",
            neutral=0.0,
            low=0.1,
            high=10.0,
            scale="log-uniform",
            source="from a preference that hardly shows (0.1) to all within a tenth "
            "of the pitch (10), as with a stand that stops at one place",
            most=100.0,
        ),
        Parameter(
            "centre_pitch",
            neutral=0.0,
            low=0.0,
            high=1.0,
            scale="uniform",
            source="any place in the pitch; 0 is dogs facing dogs",
            least=0.0,
            most=1.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "angle of each shift",
        "Record the relative angle at the trigger with encoders of both rings, "
        "for some thirty shifts.",
    ),
)
