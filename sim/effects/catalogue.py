"""The effects of the package: of the dogs, of the mechanism, of the operating point.

``docs/effects.md`` has the meaning of each, and the source of each range; all are judged.

*Dogs.* The explicit scheme knows the dynamic coefficient alone; ``cenic`` both. Another axial gap
changes the travel with it. *Mechanism.* The actuator closes the play, fully open at first, before
the ring moves. Masses count as felt at the sleeve (times ratio squared), on the far side of a
linkage; those of several effects add up. *Operating point.* A dead time moves nothing meanwhile.
A loss acts at rest as in motion. Scaled or reduced, the force keeps its rise time. An offset of the
mismatch counts along the nominal one. Relative angles that are not uniform are weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from operator import add, mul

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.units import to_si

Change = Callable[[Setting, Values], Setting]


def _changed(part: str, law: Callable[[float, float], float], **names: str) -> Change:
    """Return a change of fields of a part by the values of parameters, each in SI units."""

    def change(setting: Setting, values: Values) -> Setting:
        profile = setting.point.profile
        own = profile if part == "profile" else getattr(setting.clutch, part)
        new = {f: law(getattr(own, f), to_si(name, values[name])) for f, name in names.items()}
        if part == "profile":
            return setting.with_point(profile=replace(profile, **new))
        changed: Setting = getattr(setting, f"with_{part}")(**new)
        return changed

    return change


def _new(_: float, value: float) -> float:
    return value


def _new_if_any(old: float, value: float) -> float:
    return value or old


def _with_elastic_linkage(setting: Setting, values: Values) -> Setting:
    mass = setting.clutch.mechanism.added_mass + values["mass_behind_kg"]
    compliance = to_si("compliance_mm_kN", values["compliance_mm_kN"])
    return setting.with_mechanism(compliance=compliance, added_mass=mass)


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
        "contact_friction", title="other friction between the dogs",
        parameters=(
            Parameter(
                "static_friction", neutral=lambda setting: setting.clutch.contact.static_friction,
                low=0.05, high=0.45, scale="uniform", least=0.01, most=1.0,
            ),
            Parameter(
                "dynamic_friction", neutral=lambda setting: setting.clutch.contact.dynamic_friction,
                low=0.03, high=0.35, scale="uniform", least=0.01, most=1.0,
            ),
        ),
        change=_changed(
            "contact", _new, static_friction="static_friction", dynamic_friction="dynamic_friction"
        ),
        test=BenchTest("tilt test of the dogs",
            "Press two dog faces on each other under a known load and measure the tangential "
            "force, at rest and while sliding, oiled as on the bench."),
    ),
    Effect(
        "contact_stiffness", title="other stiffness of the dogs",
        parameters=(Parameter(
            "stiffness_Pa_m", neutral=lambda setting: setting.clutch.contact.stiffness,
            low=1e11, high=2e13, scale="log-uniform", least=1e10, most=1e14,
        ),),
        change=_changed("contact", _new, stiffness="stiffness_Pa_m"),
        test=BenchTest("static stiffness of the engaged pair",
            "Load the engaged pair with a torque and measure the twist between both rings."),
    ),
    Effect(
        "contact_dissipation", title="other rebound of the dogs",
        parameters=(Parameter(
            "dissipation_s_m", neutral=lambda setting: setting.clutch.contact.dissipation,
            low=1.0, high=300.0, scale="log-uniform", least=0.1, most=3000.0,
        ),),
        change=_changed("contact", _new, dissipation="dissipation_s_m"),
        test=BenchTest("drop test of the ring",
            "Drop the ring on the fixed output ring, dog on dog, from some millimetres and record "
            "the rebound."),
    ),
    Effect(
        "chamfer_angle", title="chamfer angle off nominal",
        parameters=(Parameter(
            "chamfer_offset_deg", neutral=0.0, low=-4.0, high=4.0, scale="uniform",
        ),),
        change=_changed("dog", add, chamfer="chamfer_offset_deg"),
        test=BenchTest("chamfer by profile",
            "Measure the profile of some dogs of either ring on a measuring machine or an "
            "imprint."),
    ),
    Effect(
        "axial_gap", title="axial gap off nominal",
        parameters=(Parameter(
            "gap_offset_mm", neutral=0.0, low=-0.8, high=0.8, scale="uniform",
        ),),
        change=_changed("dog", add, axial_gap="gap_offset_mm"),
        test=BenchTest("gap by feeler or travel",
            "Push the ring from neutral until dogs meet dogs, face on face, and read the "
            "displacement."),
    ),
    Effect(
        "free_play", title="free play of the linkage",
        parameters=(Parameter(
            "free_play_mm", neutral=0.0, low=0.05, high=2.0, scale="log-uniform", most=6.0,
            ordinary=(0.3, "a new fork in its groove"),
        ),),
        change=_changed("mechanism", _new, free_play="free_play_mm"),
        test=BenchTest("hand test of the play",
            "Hold the ring and move the actuator to and fro by hand with a dial gauge on it."),
    ),
    Effect(
        "linkage_compliance", title="elastic linkage",
        parameters=(
            Parameter(
                "compliance_mm_kN", neutral=0.0, low=0.3, high=35.0, scale="log-uniform",
                most=120.0, ordinary=(4.3, "Bowden cables"),
            ),
            Parameter(
                "mass_behind_kg", neutral=0.0, low=0.03, high=18.0, scale="log-uniform", most=60.0,
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
        parameters=(Parameter(
            "added_mass_kg", neutral=0.0, low=0.03, high=18.0, scale="log-uniform", most=60.0,
            ordinary=(1.0, "fork and rod"),
        ),),
        change=_changed("mechanism", add, added_mass="added_mass_kg"),
        test=BenchTest("free flight at the sleeve",
            "Shift with the output ring taken out and record the displacement at the sleeve: its "
            "acceleration under a known force is the mass."),
    ),
    Effect(
        "sleeve_friction", title="dry friction of the sliding ring",
        parameters=(Parameter(
            "friction_N", neutral=0.0, low=3.0, high=200.0, scale="log-uniform", most=1000.0,
        ),),
        change=_changed("mechanism", _new, friction="friction_N"),
        test=_SLOW_PUSH,
    ),
    Effect(
        "viscous_damping", title="oil damping of the sliding ring",
        parameters=(Parameter(
            "damping_Ns_m", neutral=0.0, low=5.0, high=1600.0, scale="log-uniform",
            most=6000.0, ordinary=(5.0, "shear of oil in a spline"),
        ),),
        change=_changed("mechanism", _new, damping="damping_Ns_m"),
        test=BenchTest("free flight at two forces",
            "Shift with the output ring taken out at two forces and two oil temperatures and "
            "record the displacement."),
    ),
    Effect(
        "detent_force", title="force of a detent",
        parameters=(
            Parameter(
                "detent_N", neutral=0.0, low=10.0, high=200.0, scale="log-uniform", most=1000.0,
                ordinary=(100.0, "ball detents of passenger cars"),
            ),
            Parameter(
                "position_mm", neutral=0.5, low=0.5, high=4.5, scale="uniform",
                least=0.5, most=4.5,
            ),
        ),
        change=_with_detent,
        test=_SLOW_PUSH,
    ),
    Effect(
        "spline_friction", title="friction in the loaded spline",
        parameters=(Parameter(
            "spline_friction", neutral=0.0, low=0.01, high=0.3, scale="log-uniform", most=1.0,
        ),),
        change=_with_spline,
        test=BenchTest("push of the ring under torque",
            "Hold the output ring, load the sliding ring with a known torque and measure the force "
            "that moves it along its shaft."),
    ),
    Effect(
        "drag_torque", title="drag torque on the sliding ring",
        parameters=(Parameter(
            "drag_Nm", neutral=0.0, low=0.02, high=8.0, scale="log-uniform", most=40.0,
            ordinary=(0.5, "bearings and seals of an input shaft"),
        ),),
        change=_changed("mechanism", _new, drag_torque="drag_Nm"),
        test=BenchTest("run-down of the sliding ring",
            "Turn the free sliding ring and record how its speed falls, or turn it by a torque "
            "wrench."),
    ),
    Effect(
        "sliding_inertia", title="inertia of the sliding side off nominal",
        parameters=(Parameter(
            "inertia_factor", neutral=1.0, low=1.1, high=8.0, scale="log-uniform",
            least=0.1, most=50.0, ordinary=(2.0, "other wheels in mesh"),
        ),),
        change=_with_inertia,
        test=BenchTest("run-up of the sliding side",
            "Turn the free sliding side by a weight on a cord and record its speed: torque over "
            "acceleration is its inertia."),
    ),
    Effect(
        "actuation_delay", title="dead time of the actuation",
        parameters=(Parameter(
            "delay_s", neutral=0.0, low=0.0, high=0.4, scale="uniform", least=0.0, most=1.0,
            ordinary=(0.15, "valve, pipe and filling of a cylinder"),
        ),),
        change=lambda setting, values: replace(setting, delay=setting.delay + values["delay_s"]),
        test=BenchTest("force at the sleeve over time",
            "Record the trigger and the force at the shift fork on one clock: the force must begin "
            "to rise at time zero."),
        aliases=("a shifted time zero of the record",),
    ),
    Effect(
        "actuation_lag", title="slow rise of the shift force",
        parameters=(Parameter(
            "lag_s", neutral=0.0, low=0.003, high=0.45, scale="log-uniform", most=1.0,
            ordinary=(0.3, "a cylinder behind its valve"),
        ),),
        change=_changed("profile", _new_if_any, lag="lag_s"),
        test=BenchTest("force at the sleeve over time",
            "Record the force at the shift fork while the ring is blocked: its course after the "
            "nominal rise shows the lag."),
    ),
    Effect(
        "force_rise", title="rise time of the shift force off nominal",
        parameters=(Parameter(
            "rise_factor", neutral=1.0, low=0.4, high=2.5, scale="log-uniform",
            least=0.05, most=20.0,
        ),),
        change=_changed("profile", mul, rise="rise_factor"),
        test=BenchTest("force at the sleeve over time",
            "Record the force at the shift fork while the ring is blocked: from its first rise to "
            "its final value is the rise time."),
    ),
    Effect(
        "force_scale", title="shift force off nominal",
        parameters=(Parameter(
            "force_factor", neutral=1.0, low=0.5, high=1.5, scale="uniform",
            least=0.05, most=3.0,
        ),),
        change=_changed("profile", mul, force="force_factor"),
        test=BenchTest("static force at the sleeve",
            "Block the ring and measure the force at the shift fork with a load cell at each "
            "pressure."),
    ),
    Effect(
        "force_loss", title="constant loss of shift force",
        parameters=(Parameter(
            "loss_N", neutral=0.0, low=2.0, high=150.0, scale="log-uniform", most=1000.0,
            ordinary=(50.0, "return spring and seals of a cylinder"),
        ),),
        change=_changed("profile", add, loss="loss_N"),
        test=BenchTest("static force at the sleeve",
            "Block the ring and measure the force at the shift fork with a load cell at each "
            "pressure: the same difference from nominal at all of them is a loss."),
    ),
    Effect(
        "mismatch_speed", title="mismatch off nominal",
        parameters=(
            Parameter(
                "offset_rpm", neutral=0.0, low=-4.0, high=4.0, scale="uniform",
            ),
            Parameter(
                "mismatch_factor", neutral=1.0, low=0.75, high=1.25, scale="uniform",
                least=0.05, most=3.0,
            ),
        ),
        change=_with_mismatch,
        test=BenchTest("both speeds at the first touch",
            "Record the speeds of both rings with encoders on the clock of the displacement and "
            "read them at the first touch."),
    ),
    Effect(
        "reversed_mismatch", title="reversed sense of rotation",
        parameters=(),
        # Nought stays +0, so that the point keeps its key.
        change=lambda setting, _: setting.with_point(mismatch=0.0 - setting.point.mismatch),
        test=BenchTest("sense of rotation at the rig",
            "Look which way the driven ring turns, or which flanks of the dogs are marked after "
            "some shifts: the traction flanks where the mismatch has the sign of the table."),
    ),
    Effect(
        "relative_angle", title="uneven relative angles",
        parameters=(
            Parameter(
                "concentration", neutral=0.0, low=0.1, high=10.0, scale="log-uniform", most=100.0,
            ),
            Parameter(
                "centre_pitch", neutral=0.0, low=0.0, high=1.0, scale="uniform",
                least=0.0, most=1.0,
            ),
        ),
        change=_with_angles,
        test=BenchTest("angle of each shift",
            "Record the relative angle at the trigger with encoders of both rings, for some thirty "
            "shifts."),
    ),
)  # fmt: skip
