"""Effects that may explain why a bench differs from the simulation: the package's, and a user's.

A user's file ``NAME.py`` defines ``EFFECT``, an ``Effect`` of that name. Those of the package are
of the dogs, of the mechanism, of the operating point. ``docs/effects.md`` has the meaning of each,
and the source of each range; all are judged. Masses count as felt at the sleeve (times ratio
squared), on the far side of a linkage, and add up; a force that is scaled or reduced keeps its rise
time; an offset of the mismatch counts along the nominal one.
"""

from __future__ import annotations

import math
import runpy
from collections.abc import Callable
from dataclasses import replace
from operator import add, attrgetter, mul
from pathlib import Path
from typing import Any

from dogshape.sim.effect import BenchTest, Effect, Parameter, Scale, Values
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.units import to_si

Change = Callable[[Setting, Values], Setting]
LOG: Scale = "log-uniform"
EVEN: Scale = "uniform"


def _changed(part: str, law: Callable[[float, float], float], **names: str) -> Change:
    """Return a change of fields of a part by the values of parameters, each in SI units."""

    def change(setting: Setting, values: Values) -> Setting:
        own: Any = setting.point.profile if part == "profile" else getattr(setting.clutch, part)
        new = {f: law(getattr(own, f), to_si(name, values[name])) for f, name in names.items()}
        if part == "profile":
            return setting.with_point(profile=replace(own, **new))
        return replace(setting, clutch=replace(setting.clutch, **{part: replace(own, **new)}))

    return change


def _new(_: float, value: float) -> float:
    return value


def _with_elastic_linkage(setting: Setting, values: Values) -> Setting:
    mass = setting.clutch.mechanism.added_mass + values["mass_behind_kg"]
    compliance = to_si("compliance_mm_kN", values["compliance_mm_kN"])
    return setting.with_mechanism(compliance=compliance, added_mass=mass)


_FORCE = "force at the sleeve over time"
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
        "contact_friction", (
            Parameter("static_friction", attrgetter("clutch.contact.static_friction"),
                      0.05, 0.45, EVEN, least=0.01, most=1.0),
            Parameter("dynamic_friction", attrgetter("clutch.contact.dynamic_friction"),
                      0.03, 0.35, EVEN, least=0.01, most=1.0)),
        _changed("contact", _new, static_friction="static_friction",
                 dynamic_friction="dynamic_friction"),
        BenchTest("tilt test of the dogs", "Press two dog faces on each other under a known load "
                  "and measure the tangential force, at rest and while sliding, oiled as on the "
                  "bench."),
        title="other friction between the dogs"),
    Effect(
        "contact_stiffness", (Parameter("stiffness_Pa_m", attrgetter("clutch.contact.stiffness"),
                      1e11, 2e13, LOG, least=1e10, most=1e14),),
        _changed("contact", _new, stiffness="stiffness_Pa_m"),
        BenchTest("static stiffness of the engaged pair",
                  "Load the engaged pair with a torque and measure the twist between both rings."),
        title="other stiffness of the dogs"),
    Effect(
        "contact_dissipation", (
            Parameter("dissipation_s_m", attrgetter("clutch.contact.dissipation"),
                      1.0, 300.0, LOG, least=0.1, most=3000.0),),
        _changed("contact", _new, dissipation="dissipation_s_m"),
        BenchTest("drop test of the ring", "Drop the ring on the fixed output ring, dog on dog, "
                  "from some millimetres and record the rebound."),
        title="other rebound of the dogs"),
    Effect(
        "contact_creep", (Parameter("stiction_factor", 1.0, 0.5, 2.0, LOG, least=0.5, most=2.0),),
        _changed("contact", mul, stiction_velocity="stiction_factor"),
        BenchTest("creep of held faces", "Press two dog faces on each other under a known load, "
                  "pull with half the friction and record how fast they slip."),
        title="other creep of held faces"),
    Effect(
        "chamfer_angle", (Parameter("chamfer_offset_deg", 0.0, -4.0, 4.0, EVEN),),
        _changed("dog", add, chamfer="chamfer_offset_deg"),
        BenchTest("chamfer by profile", "Measure the profile of some dogs of either ring on a "
                  "measuring machine or an imprint."),
        title="chamfer angle off nominal"),
    Effect(
        "axial_gap", (Parameter("gap_offset_mm", 0.0, -0.8, 0.8, EVEN),),
        _changed("dog", add, axial_gap="gap_offset_mm"),
        BenchTest("gap by feeler or travel", "Push the ring from neutral until dogs meet dogs, "
                  "face on face, and read the displacement."),
        title="axial gap off nominal"),
    Effect(
        "free_play", (Parameter("free_play_mm", 0.0, 0.05, 2.0, LOG, most=6.0,
                      ordinary=(0.3, "a new fork in its groove")),),
        _changed("mechanism", _new, free_play="free_play_mm"),
        BenchTest("hand test of the play", "Hold the ring and move the actuator to and fro by hand "
                  "with a dial gauge on it."),
        title="free play of the linkage"),
    Effect(
        "linkage_compliance", (Parameter("compliance_mm_kN", 0.0, 0.3, 35.0, LOG, most=120.0,
                      ordinary=(4.3, "Bowden cables")),
            Parameter("mass_behind_kg", 0.0, 0.03, 18.0, LOG, most=60.0,
                      ordinary=(1.0, "fork and rod"))),
        _with_elastic_linkage,
        BenchTest("static stiffness of the linkage", "Block the ring, raise the force in steps and "
                  "read the displacement at the actuator; then strike the actuator and record its "
                  "swing: frequency and stiffness give the mass."),
        title="elastic linkage"),
    Effect(
        "moving_mass", (Parameter("added_mass_kg", 0.0, 0.03, 18.0, LOG, most=60.0,
                      ordinary=(1.0, "fork and rod")),),
        _changed("mechanism", add, added_mass="added_mass_kg"),
        BenchTest("free flight at the sleeve", "Shift with the output ring taken out and record "
                  "the displacement at the sleeve: its acceleration under a known force is the "
                  "mass."),
        title="mass of actuator and linkage"),
    Effect(
        "sleeve_friction", (Parameter("friction_N", 0.0, 3.0, 200.0, LOG, most=1000.0),),
        _changed("mechanism", _new, friction="friction_N"), _SLOW_PUSH,
        title="dry friction of the sliding ring"),
    Effect(
        "viscous_damping", (Parameter("damping_Ns_m", 0.0, 5.0, 1600.0, LOG, most=6000.0,
                      ordinary=(5.0, "shear of oil in a spline")),),
        _changed("mechanism", _new, damping="damping_Ns_m"),
        BenchTest("free flight at two forces", "Shift with the output ring taken out at two forces "
                  "and two oil temperatures and record the displacement."),
        title="oil damping of the sliding ring"),
    Effect(
        "detent_force", (Parameter("detent_N", 0.0, 10.0, 200.0, LOG, most=1000.0,
                      ordinary=(100.0, "ball detents of passenger cars")),
            Parameter("position_mm", 0.5, 0.5, 4.5, EVEN, least=0.5, most=4.5)),
        _with_detent, _SLOW_PUSH, title="force of a detent"),
    Effect(
        "spline_friction", (Parameter("spline_friction", 0.0, 0.01, 0.3, LOG, most=1.0),),
        _with_spline,
        BenchTest("push of the ring under torque", "Hold the output ring, load the sliding ring "
                  "with a known torque and measure the force that moves it along its shaft."),
        title="friction in the loaded spline"),
    Effect(
        "drag_torque", (Parameter("drag_Nm", 0.0, 0.02, 8.0, LOG, most=40.0,
                      ordinary=(0.5, "bearings and seals of an input shaft")),),
        _changed("mechanism", _new, drag_torque="drag_Nm"),
        BenchTest("run-down of the sliding ring", "Turn the free sliding ring and record how its "
                  "speed falls, or turn it by a torque wrench."),
        title="drag torque on the sliding ring"),
    Effect(
        "sliding_inertia", (Parameter("inertia_factor", 1.0, 1.1, 8.0, LOG, least=0.1, most=50.0,
                      ordinary=(2.0, "other wheels in mesh")),),
        _changed("rings", mul, sliding_inertia="inertia_factor"),
        BenchTest("run-up of the sliding side", "Turn the free sliding side by a weight on a cord "
                  "and record its speed: torque over acceleration is its inertia."),
        title="inertia of the sliding side off nominal"),
    Effect(
        "actuation_delay", (Parameter("delay_s", 0.0, 0.0, 0.4, EVEN, least=0.0, most=1.0,
                      ordinary=(0.15, "valve, pipe and filling of a cylinder")),),
        lambda setting, values: replace(setting, delay=setting.delay + values["delay_s"]),
        BenchTest(_FORCE, "Record the trigger and the force at the shift fork on one clock: the "
                  "force must begin to rise at time zero."),
        aliases=("a shifted time zero of the record",), title="dead time of the actuation"),
    Effect(
        "actuation_lag", (Parameter("lag_s", 0.0, 0.003, 0.45, LOG, most=1.0,
                      ordinary=(0.3, "a cylinder behind its valve")),),
        _changed("profile", lambda old, value: value or old, lag="lag_s"),
        BenchTest(_FORCE, "Record the force at the shift fork while the ring is blocked: its "
                  "course after the nominal rise shows the lag."),
        title="slow rise of the shift force"),
    Effect(
        "force_rise", (Parameter("rise_factor", 1.0, 0.4, 2.5, LOG, least=0.05, most=20.0),),
        _changed("profile", mul, rise="rise_factor"),
        BenchTest(_FORCE, "Record the force at the shift fork while the ring is blocked: from its "
                  "first rise to its final value is the rise time."),
        title="rise time of the shift force off nominal"),
    Effect(
        "force_scale", (Parameter("force_factor", 1.0, 0.5, 1.5, EVEN, least=0.05, most=3.0),),
        _changed("profile", mul, force="force_factor"),
        BenchTest("static force at the sleeve", "Block the ring and measure the force at the shift "
                  "fork with a load cell at each pressure."),
        title="shift force off nominal"),
    Effect(
        "force_loss", (Parameter("loss_N", 0.0, 2.0, 150.0, LOG, most=1000.0,
                      ordinary=(50.0, "return spring and seals of a cylinder")),),
        _changed("profile", add, loss="loss_N"),
        BenchTest("static force at the sleeve", "Block the ring and measure the force at the shift "
                  "fork with a load cell at each pressure: the same difference from nominal at all "
                  "of them is a loss."),
        title="constant loss of shift force"),
    Effect(
        "mismatch_speed", (Parameter("offset_rpm", 0.0, -4.0, 4.0, EVEN),
            Parameter("mismatch_factor", 1.0, 0.75, 1.25, EVEN, least=0.05, most=3.0)),
        _with_mismatch,
        BenchTest("both speeds at the first touch", "Record the speeds of both rings with encoders "
                  "on the clock of the displacement and read them at the first touch."),
        title="mismatch off nominal"),
    Effect(
        "reversed_mismatch", (),
        # Zero stays +0, so that the point keeps its key.
        lambda setting, _: setting.with_point(mismatch=0.0 - setting.point.mismatch),
        BenchTest("sense of rotation at the rig", "Look which way the driven ring turns, or which "
                  "flanks of the dogs are marked after some shifts: the traction flanks where the "
                  "mismatch has the sign of the table."),
        title="reversed sense of rotation"),
    Effect(
        "relative_angle", (Parameter("concentration", 0.0, 0.1, 10.0, LOG, most=100.0),
            Parameter("centre_pitch", 0.0, 0.0, 1.0, EVEN, least=0.0, most=1.0)),
        _with_angles,
        BenchTest("angle of each shift", "Record the relative angle at the trigger with encoders "
                  "of both rings, for some thirty shifts."),
        title="uneven relative angles"),
)  # fmt: skip


def load(folder: Path | None = None) -> dict[str, Effect]:
    """Return all effects by name, in the order of their names.

    ``folder`` is one with effects of the user's. Files that begin with an underscore are no
    effects. Raises InputError where the folder is missing, a file cannot be run, has no
    ``EFFECT`` or another name than the effect, or a name is taken.
    """
    effects = {effect.name: effect for effect in EFFECTS}
    for path in own_files(folder).values() if folder else ():
        effect = _own_effect(path)
        if effect.name in effects:
            raise InputError(
                f"{path} defines the effect '{effect.name}', but there is one of that name; "
                "rename file and effect"
            )
        effects[effect.name] = effect
    return dict(sorted(effects.items()))


def own_files(folder: Path) -> dict[str, Path]:
    """Return the files of a folder that ``load`` takes effects from, by the effects' names."""
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}; give one with effects as Python files")
    paths = sorted(path for path in folder.glob("*.py") if not path.name.startswith("_"))
    return {path.stem: path for path in paths}


def _own_effect(path: Path) -> Effect:
    try:
        module = runpy.run_path(str(path), run_name=f"user_effect_{path.stem}")
    except Exception as error:
        remedy = "correct it or take it away"
        if isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] == "sim":
            remedy = "write 'from dogshape import Effect, Parameter, BenchTest'"
        raise InputError(
            f"{path} cannot be run ({type(error).__name__}: {error}); {remedy}"
        ) from error
    effect = module.get("EFFECT")
    if not isinstance(effect, Effect):
        raise InputError(f"{path} defines no EFFECT; define one of the type dogshape.Effect")
    if effect.name != path.stem:
        raise InputError(
            f"{path} defines the effect '{effect.name}', but an effect has the name of its file; "
            "rename one of the two"
        )
    return effect
