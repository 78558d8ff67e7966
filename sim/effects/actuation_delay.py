"""The force starts later than the record: dead time of valve and pipe, or a shifted time zero.

Nothing else moves meanwhile, so every time grows by the same; no simulation is needed.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    return replace(setting, delay=setting.delay + values["delay_s"])


EFFECT = Effect(
    name="actuation_delay",
    title="dead time of the actuation",
    meaning="the force starts some time after time zero",
    parameters=(
        Parameter(
            "delay_s",
            neutral=0.0,
            low=0.0,
            high=0.4,
            scale="uniform",
            source="valve, pipe and filling of a pneumatic cylinder take 10 to 150 "
            "ms; a time zero set by hand or by another clock errs by as much again; uniform, "
            "since a shifted zero has no scale",
            least=0.0,
            most=1.0,
            ordinary=(0.15, "valve, pipe and filling of a cylinder"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "force at the sleeve over time",
        "Record the trigger and the force at the shift fork on one clock: the "
        "force must begin to rise at time zero.",
    ),
    aliases=("a shifted time zero of the record",),
)
