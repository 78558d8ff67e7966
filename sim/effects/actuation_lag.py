"""The pressure follows its command by a lag of first order, on top of the nominal rise."""

from __future__ import annotations

from dataclasses import fields

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import LaggedProfile


def _change(setting: Setting, values: Values) -> Setting:
    lag, profile = values["lag_s"], setting.point.profile
    if lag == 0.0:
        return setting
    own = {field.name: getattr(profile, field.name) for field in fields(profile)}
    return setting.with_point(profile=LaggedProfile(**{**own, "lag": lag}))


EFFECT = Effect(
    name="actuation_lag",
    title="slow rise of the shift force",
    meaning="the force nears its nominal course with a lag of first order",
    parameters=(
        Parameter(
            "lag_s",
            neutral=0.0,
            low=0.003,
            high=0.45,
            scale="log-uniform",
            source="a cylinder of 0.1 to 1 litre behind a valve of some hundred "
            "litres a minute fills with time constants of 10 to 300 ms; a throttled one up to "
            "half a second",
            most=1.0,
            ordinary=(0.3, "a cylinder behind its valve"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "force at the sleeve over time",
        "Record the force at the shift fork while the ring is blocked: its "
        "course after the nominal rise shows the lag.",
    ),
)
