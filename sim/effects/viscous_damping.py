"""Axial damping of the ring and its fork in oil."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_mechanism(damping=values["damping_Ns_m"])


EFFECT = Effect(
    name="viscous_damping",
    title="oil damping of the sliding ring",
    meaning="oil damps the ring along its shaft",
    parameters=(
        Parameter(
            "damping_Ns_m",
            neutral=0.0,
            low=5.0,
            high=1600.0,
            scale="log-uniform",
            source="shear in a spline of 10 cm2 with gaps of 20 um at 0.1 Pa s gives "
            "5 N s/m; oil that must leave a closed pocket some hundred, a cold one above 1000",
            most=6000.0,
            ordinary=(5.0, "shear of oil in a spline"),
        ),
    ),
    change=_change,
    test=BenchTest(
        "free flight at two forces",
        "Shift with the output ring taken out at two forces and two oil "
        "temperatures and record the displacement.",
    ),
)
