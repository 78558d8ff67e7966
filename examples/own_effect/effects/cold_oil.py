"""Cold oil: it damps the sliding ring along its shaft more than warm oil does."""

from __future__ import annotations

from collections.abc import Mapping

from dogshape import Effect
from dogshape.sim.effect import BenchTest, Parameter
from dogshape.sim.setting import Setting


def change(setting: Setting, values: Mapping[str, float]) -> Setting:
    """Make the setting with damping along the shaft, N s/m."""
    return setting.with_mechanism(damping=values["damping_Ns_m"])


EFFECT = Effect(
    name="cold_oil",
    title="cold oil",
    meaning="the oil is thicker than at the temperature that was measured",
    parameters=(
        Parameter(
            "damping_Ns_m",
            neutral=0.0,
            low=50.0,
            high=5000.0,
            scale="log-uniform",
            source="viscosity at 0 and 80 deg C",
        ),
    ),
    change=change,
    test=BenchTest("warm and cold", "Repeat the free flight with cold oil."),
)
