"""Effects of the linkage between actuator and sliding ring: its play, elasticity and mass.

The actuator closes the play, fully open at first, before the ring moves; the ring is free within it
afterwards too. Where the displacement is read at the actuator, an elastic linkage (such as a Bowden
cable, damped by a fixed share of the critical damping) makes that reading run ahead of the ring by
force over stiffness. Masses of actuator, rod, arm and cable count as felt at the sleeve (times
ratio squared). They stand on the far side of a linkage; as the compliance goes to 0 they move with
the ring. The masses of both effects add up.
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si

_MASS_SOURCE = (
    "fork and rod weigh 0.1 to 1 kg; an arm of 0.5 kg behind a ratio of 3.2 feels like 5 kg, a "
    "robot's drive like three times that"
)


def _with_elastic_linkage(setting: Setting, values: Values) -> Setting:
    mass = setting.clutch.mechanism.added_mass + values["mass_behind_kg"]
    compliance = to_si("compliance_mm_kN", values["compliance_mm_kN"])
    return setting.with_mechanism(compliance=compliance, added_mass=mass)


def _with_mass(setting: Setting, values: Values) -> Setting:
    mass = setting.clutch.mechanism.added_mass + values["added_mass_kg"]
    return setting.with_mechanism(added_mass=mass)


EFFECTS = (
    Effect(
        "free_play",
        title="free play of the linkage",
        meaning="the actuator has some way to go before it meets the ring",
        parameters=(
            Parameter(
                "free_play_mm", neutral=0.0, low=0.05, high=2.0, scale="log-uniform", most=6.0,
                ordinary=(0.3, "a new fork in its groove"),
                source="a new fork has 0.1 to 0.3 mm in its groove; worn joints of a linkage add "
                "up to some millimetres",
            ),
        ),
        change=lambda setting, values: setting.with_mechanism(
            free_play=to_si("free_play_mm", values["free_play_mm"])
        ),
        test=BenchTest(
            "hand test of the play",
            "Hold the ring and move the actuator to and fro by hand with a dial gauge on it.",
        ),
    ),
    Effect(
        "linkage_compliance",
        title="elastic linkage",
        meaning="the linkage between actuator and ring is elastic, with the actuator's mass behind "
        "it",
        parameters=(
            Parameter(
                "compliance_mm_kN", neutral=0.0, low=0.3, high=35.0, scale="log-uniform",
                most=120.0, ordinary=(4.3, "Bowden cables"),
                source="a steel fork and rod give 0.3 mm/kN; Bowden cables, the published stand "
                "among them, 3.4 to 4.3 at the sleeve; long or worn ones ten times as much",
            ),
            Parameter(
                "mass_behind_kg", neutral=0.0, low=0.03, high=18.0, scale="log-uniform", most=60.0,
                source=_MASS_SOURCE,
            ),
        ),
        change=_with_elastic_linkage,
        test=BenchTest(
            "static stiffness of the linkage",
            "Block the ring, raise the force in steps and read the displacement at the actuator; "
            "then strike the actuator and record its swing: frequency and stiffness give the mass.",
        ),
    ),
    Effect(
        "moving_mass",
        title="mass of actuator and linkage",
        meaning="actuator and linkage move with the ring and add their mass",
        parameters=(
            Parameter(
                "added_mass_kg", neutral=0.0, low=0.03, high=18.0, scale="log-uniform", most=60.0,
                ordinary=(1.0, "fork and rod"), source=_MASS_SOURCE,
            ),
        ),
        change=_with_mass,
        test=BenchTest(
            "free flight at the sleeve",
            "Shift with the output ring taken out and record the displacement at the sleeve: its "
            "acceleration under a known force is the mass.",
        ),
    ),
)  # fmt: skip
