"""The shift force rises in another time than nominal, to the same final value."""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    profile = setting.point.profile
    return setting.with_point(profile=replace(profile, rise=profile.rise * values["rise_factor"]))


EFFECT = Effect(
    name="force_rise",
    title="rise time of the shift force off nominal",
    meaning="the force rises to its final value in a factor of the nominal time",
    parameters=(
        Parameter(
            "rise_factor",
            neutral=1.0,
            low=0.4,
            high=2.5,
            scale="log-uniform",
            source="a rise read from 10 to 90 percent of a cubic step is 0.61 of the whole, up to "
            "another threshold down to 0.4; a supply or throttle of half the flow takes twice as "
            "long, a longer hose some ten percent more",
            least=0.05,
            most=20.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "force at the sleeve over time",
        "Record the force at the shift fork while the ring is blocked: from its first rise to its "
        "final value is the rise time.",
    ),
)
