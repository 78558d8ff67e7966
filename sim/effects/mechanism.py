"""Effects of the mechanism: linkage, what rubs on the sliding ring, and what turns with it.

The actuator closes the play, fully open at first, before the ring moves. An elastic linkage makes a
reading at the actuator run ahead of the ring by force over stiffness. Masses count as felt at the
sleeve (times ratio squared), on the far side of a linkage; those of both effects add up. The spline
lies at 0.8 of the dogs' inner radius, and coefficient over radius acts. With an elastic input shaft
the inertia behind it grows, and that of the ring alone stays.
"""

from __future__ import annotations

from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.shift.mechanism import SPLINE
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


_SLOW_PUSH = BenchTest(
    "slow push of the free ring",
    "Push the free ring slowly along its shaft, both ways, and record force over displacement: a "
    "level force is dry friction, a hump a detent.",
)


def _with_detent(setting: Setting, values: Values) -> Setting:
    if values["detent_N"] == 0.0:
        return setting
    place = to_si("position_mm", values["position_mm"])
    return setting.with_mechanism(detent=values["detent_N"], detent_position=place)


def _with_spline(setting: Setting, values: Values) -> Setting:
    if values["spline_friction"] == 0.0:
        return setting
    radius = SPLINE * setting.clutch.dog.inner_radius
    return setting.with_mechanism(spline_friction=values["spline_friction"], spline_radius=radius)


def _with_inertia(setting: Setting, values: Values) -> Setting:
    rings = setting.clutch.rings
    heavier = replace(rings, sliding_inertia=rings.sliding_inertia * values["inertia_factor"])
    return replace(setting, clutch=replace(setting.clutch, rings=heavier))


EFFECTS = (
    Effect(
        "free_play", title="free play of the linkage",
        meaning="the actuator has some way to go before it meets the ring",
        parameters=(Parameter(
            "free_play_mm", neutral=0.0, low=0.05, high=2.0, scale="log-uniform", most=6.0,
            ordinary=(0.3, "a new fork in its groove"),
            source="a new fork has 0.1 to 0.3 mm in its groove; worn joints of a linkage add up "
            "to some millimetres",
        ),),
        change=lambda setting, values: setting.with_mechanism(
            free_play=to_si("free_play_mm", values["free_play_mm"])
        ),
        test=BenchTest("hand test of the play",
            "Hold the ring and move the actuator to and fro by hand with a dial gauge on it."),
    ),
    Effect(
        "linkage_compliance", title="elastic linkage",
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
        test=BenchTest("static stiffness of the linkage",
            "Block the ring, raise the force in steps and read the displacement at the actuator; "
            "then strike the actuator and record its swing: frequency and stiffness give the "
            "mass."),
    ),
    Effect(
        "moving_mass", title="mass of actuator and linkage",
        meaning="actuator and linkage move with the ring and add their mass",
        parameters=(Parameter(
            "added_mass_kg", neutral=0.0, low=0.03, high=18.0, scale="log-uniform", most=60.0,
            ordinary=(1.0, "fork and rod"), source=_MASS_SOURCE,
        ),),
        change=_with_mass,
        test=BenchTest("free flight at the sleeve",
            "Shift with the output ring taken out and record the displacement at the sleeve: its "
            "acceleration under a known force is the mass."),
    ),
    Effect(
        "sleeve_friction", title="dry friction of the sliding ring",
        meaning="dry friction of the sliding ring on its shaft",
        parameters=(Parameter(
            "friction_N", neutral=0.0, low=3.0, high=200.0, scale="log-uniform", most=1000.0,
            source="a ring of 3 N on an oiled spline drags with newtons; seals, a tilted fork or "
            "dirt with some ten; above the least shift force nothing would move",
        ),),
        change=lambda setting, values: setting.with_mechanism(friction=values["friction_N"]),
        test=_SLOW_PUSH,
    ),
    Effect(
        "viscous_damping", title="oil damping of the sliding ring",
        meaning="oil damps the ring along its shaft",
        parameters=(Parameter(
            "damping_Ns_m", neutral=0.0, low=5.0, high=1600.0, scale="log-uniform",
            most=6000.0, ordinary=(5.0, "shear of oil in a spline"),
            source="shear in a spline of 10 cm2 with gaps of 20 um at 0.1 Pa s gives 5 N s/m; oil "
            "that must leave a closed pocket some hundred, a cold one above 1000",
        ),),
        change=lambda setting, values: setting.with_mechanism(damping=values["damping_Ns_m"]),
        test=BenchTest("free flight at two forces",
            "Shift with the output ring taken out at two forces and two oil temperatures and "
            "record the displacement."),
    ),
    Effect(
        "detent_force", title="force of a detent",
        meaning="a detent holds the ring over a short part of its way",
        parameters=(
            Parameter(
                "detent_N", neutral=0.0, low=10.0, high=200.0, scale="log-uniform", most=1000.0,
                ordinary=(100.0, "ball detents of passenger cars"),
                source="ball detents of passenger cars take 10 to 100 N at the rod; above the "
                "least shift force nothing would move",
            ),
            Parameter(
                "position_mm", neutral=0.5, low=0.5, high=4.5, scale="uniform",
                least=0.5, most=4.5,
                source="anywhere on the travel; most likely where it leaves neutral",
            ),
        ),
        change=_with_detent,
        test=_SLOW_PUSH,
    ),
    Effect(
        "spline_friction", title="friction in the loaded spline",
        meaning="the ring's spline rubs along the shaft in proportion to its torque",
        parameters=(Parameter(
            "spline_friction", neutral=0.0, low=0.01, high=0.3, scale="log-uniform", most=1.0,
            source="oiled steel 0.05 to 0.15, dry or worn 0.3; rolling elements 0.01",
        ),),
        change=_with_spline,
        test=BenchTest("push of the ring under torque",
            "Hold the output ring, load the sliding ring with a known torque and measure the force "
            "that moves it along its shaft."),
    ),
    Effect(
        "drag_torque", title="drag torque on the sliding ring",
        meaning="the sliding ring is held by a torque against its turning",
        parameters=(Parameter(
            "drag_Nm", neutral=0.0, low=0.02, high=8.0, scale="log-uniform", most=40.0,
            ordinary=(0.5, "bearings and seals of an input shaft"),
            source="bearings and seals of an input shaft take 0.05 to 0.5 N m, cold oil and a "
            "dragging clutch some N m, both together up to 8",
        ),),
        change=lambda setting, values: setting.with_mechanism(drag_torque=values["drag_Nm"]),
        test=BenchTest("run-down of the sliding ring",
            "Turn the free sliding ring and record how its speed falls, or turn it by a torque "
            "wrench."),
    ),
    Effect(
        "sliding_inertia", title="inertia of the sliding side off nominal",
        meaning="what turns with the sliding ring has a factor of the nominal inertia",
        parameters=(Parameter(
            "inertia_factor", neutral=1.0, low=1.1, high=8.0, scale="log-uniform",
            least=0.1, most=50.0, ordinary=(2.0, "other wheels in mesh"),
            source="wheels of other gears in mesh add 10 to 100 percent of an input shaft's "
            "inertia, a clutch disc of 0.003 to 0.008 kg m2 as much as the published 0.01; a "
            "ratio of 2.8 that was left out counts squared, 8",
        ),),
        change=_with_inertia,
        test=BenchTest("run-up of the sliding side",
            "Turn the free sliding side by a weight on a cord and record its speed: torque over "
            "acceleration is its inertia."),
    ),
)  # fmt: skip
