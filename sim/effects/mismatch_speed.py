"""The true mismatch is a factor of the nominal one, and an offset that all operating points share.

A factor: teeth counted wrongly, a belt or wheel of another diameter, a drive that falls short of
its set speed under load. An offset: a flywheel that runs down by dry friction loses the same speed
between reading and touch, a ring at rest is dragged along by its bearing, and a speed set by hand
errs by what can be set. The offset counts along the nominal mismatch: a negative one makes it
smaller.
"""

from __future__ import annotations

import math

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _change(setting: Setting, values: Values) -> Setting:
    nominal = setting.point.mismatch
    offset = to_si("offset_rpm", values["offset_rpm"]) * math.copysign(1.0, nominal)
    return setting.with_point(mismatch=values["mismatch_factor"] * nominal + offset)


EFFECT = Effect(
    name="mismatch_speed",
    title="mismatch off nominal",
    meaning="the true mismatch is a factor of the nominal one, and an offset",
    parameters=(
        Parameter(
            "offset_rpm",
            neutral=0.0,
            low=-4.0,
            high=4.0,
            scale="uniform",
            source="a flywheel with 5 to 20 N m of friction loses 0.5 to 3 1/min "
            "within a shift; speeds are set to a few 1/min, below the least "
            "nominal one",
        ),
        Parameter(
            "mismatch_factor",
            neutral=1.0,
            low=0.75,
            high=1.25,
            scale="uniform",
            source="a tooth miscounted in a ratio of some ten to twenty gives 5 to 10 percent, a "
            "neighbouring ratio of a gearbox or a slipping belt up to 25",
            least=0.05,
            most=3.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "both speeds at the first touch",
        "Record the speeds of both rings with encoders on the clock of the "
        "displacement and read them at the first touch.",
    ),
)
