"""The force at the sleeve is another share of the actuator's: ratio or efficiency of the linkage.

The rise keeps its time.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    profile = setting.point.profile
    scaled = replace(profile, force=profile.force * values["force_factor"])
    return setting.with_point(profile=scaled)


EFFECT = Effect(
    name="force_scale",
    title="shift force off nominal",
    meaning="the force at the sleeve is a factor of the nominal one",
    parameters=(
        Parameter(
            "force_factor",
            neutral=1.0,
            low=0.5,
            high=1.5,
            scale="uniform",
            source="an assumed efficiency of 0.8 may be 0.5 to 1 with a bent or dry cable; ratios "
            "from a static calibration err by up to 10 percent more, a piston's area by 15",
            least=0.05,
            most=3.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "static force at the sleeve",
        "Block the ring and measure the force at the shift fork with a load cell at each pressure.",
    ),
)
