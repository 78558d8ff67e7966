"""The rings turn past each other the other way round: every mismatch has the other sign.

It has no strength, so it has no parameter: dogs that were to meet with their traction flanks meet
with their braking flanks, and faces that were to fall away come towards each other.
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    # Nought stays +0, so that the point keeps its key.
    return setting.with_point(mismatch=0.0 - setting.point.mismatch)


EFFECT = Effect(
    name="reversed_mismatch",
    title="reversed sense of rotation",
    meaning="the rings turn past each other the other way round than the table says",
    parameters=(),
    change=_change,
    test=BenchTest(
        "sense of rotation at the rig",
        "Look which way the driven ring turns, or which flanks of the dogs are marked after some "
        "shifts: the traction flanks where the mismatch has the sign of the table.",
    ),
)
