"""Effects of the operating point as it is recorded: mismatch, its sense, relative angles.

*Mismatch.* A factor: teeth counted wrongly, a belt or wheel of another diameter, a drive that falls
short of its set speed under load. An offset: a flywheel that runs down by dry friction loses the
same speed between reading and touch, a ring at rest is dragged along by its bearing, and a speed
set by hand errs by what can be set. The offset counts along the nominal mismatch: a negative one
makes it smaller.

*Sense.* Turned the other way round, every mismatch has the other sign. That has no strength, so it
has no parameter: dogs that were to meet with their traction flanks meet with their braking flanks,
and faces that were to fall away come towards each other.

*Relative angles* at the start of the force that are not uniform change no shift, only how often
each angle comes: weights, and no simulation.
"""

from __future__ import annotations

import math
from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _with_mismatch(setting: Setting, values: Values) -> Setting:
    nominal = setting.point.mismatch
    offset = to_si("offset_rpm", values["offset_rpm"]) * math.copysign(1.0, nominal)
    return setting.with_point(mismatch=values["mismatch_factor"] * nominal + offset)


def _with_angles(setting: Setting, values: Values) -> Setting:
    if values["concentration"] == 0.0:
        return setting
    centre = values["centre_pitch"] % 1.0
    return replace(setting, concentration=values["concentration"], centre=centre)


EFFECTS = (
    Effect(
        "mismatch_speed",
        title="mismatch off nominal",
        meaning="the true mismatch is a factor of the nominal one, and an offset",
        parameters=(
            Parameter(
                "offset_rpm", neutral=0.0, low=-4.0, high=4.0, scale="uniform",
                source="a flywheel with 5 to 20 N m of friction loses 0.5 to 3 1/min within a "
                "shift; speeds are set to a few 1/min, below the least nominal one",
            ),
            Parameter(
                "mismatch_factor", neutral=1.0, low=0.75, high=1.25, scale="uniform",
                least=0.05, most=3.0,
                source="a tooth miscounted in a ratio of some ten to twenty gives 5 to 10 percent, "
                "a neighbouring ratio of a gearbox or a slipping belt up to 25",
            ),
        ),
        change=_with_mismatch,
        test=BenchTest(
            "both speeds at the first touch",
            "Record the speeds of both rings with encoders on the clock of the displacement and "
            "read them at the first touch.",
        ),
    ),
    Effect(
        "reversed_mismatch",
        title="reversed sense of rotation",
        meaning="the rings turn past each other the other way round than the table says",
        parameters=(),
        # Nought stays +0, so that the point keeps its key.
        change=lambda setting, _: setting.with_point(mismatch=0.0 - setting.point.mismatch),
        test=BenchTest(
            "sense of rotation at the rig",
            "Look which way the driven ring turns, or which flanks of the dogs are marked after "
            "some shifts: the traction flanks where the mismatch has the sign of the table.",
        ),
    ),
    Effect(
        "relative_angle",
        title="uneven relative angles",
        meaning="some relative angles come more often than others",
        parameters=(
            Parameter(
                "concentration", neutral=0.0, low=0.1, high=10.0, scale="log-uniform", most=100.0,
                source="from a preference that hardly shows (0.1) to all within a tenth of the "
                "pitch (10), as with a stand that stops at one place",
            ),
            Parameter(
                "centre_pitch", neutral=0.0, low=0.0, high=1.0, scale="uniform",
                least=0.0, most=1.0, source="any place in the pitch; 0 is dogs facing dogs",
            ),
        ),
        change=_with_angles,
        test=BenchTest(
            "angle of each shift",
            "Record the relative angle at the trigger with encoders of both rings, for some thirty "
            "shifts.",
        ),
    ),
)  # fmt: skip
