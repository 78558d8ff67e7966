"""Effects that may explain why a bench differs from the simulation: of the package and of a user.

A user's file ``NAME.py`` defines ``EFFECT``, an ``Effect`` of that name. Effects of the package
concern the dogs, the mechanism or the operating point; all their ranges are judged. Masses are
referred to the sleeve (times ratio squared), on the actuator's side of a linkage, and add up; a
force that is scaled or reduced keeps its rise time; an offset of the mismatch counts along the
nominal one.
"""

from __future__ import annotations

import math
import runpy
from collections.abc import Callable
from dataclasses import replace
from operator import add, attrgetter, mul
from pathlib import Path
from typing import Any

from dogshape.sim.effect import (
    BenchTest,
    Effect,
    InstrumentError,
    Ordinary,
    Parameter,
    Scale,
    Values,
)
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.drive import EngineSide
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.units import suffix_of, to_si

Change = Callable[[Setting, Values], Setting]
LOG: Scale = "log-uniform"
LINEAR: Scale = "uniform"


def _change_of(
    part: str, law: Callable[[float, float], float], *parameters: str, **parameters_by_field: str
) -> Change:
    """Return a change of fields of a part of the clutch, or of the force profile.

    ``law`` maps old value and parameter, both SI, to the new value. ``parameters`` are named as
    their fields with a unit, ``parameters_by_field`` otherwise.
    """
    names = {name.removesuffix(suffix_of(name)): name for name in parameters} | parameters_by_field

    def change(setting: Setting, values: Values) -> Setting:
        old: Any = setting.point.profile if part == "profile" else getattr(setting.clutch, part)
        new = {f: law(getattr(old, f), to_si(name, values[name])) for f, name in names.items()}
        if part == "profile":
            return setting.with_point(profile=replace(old, **new))
        return replace(setting, clutch=replace(setting.clutch, **{part: replace(old, **new)}))

    return change


def _set_value(_: float, value: float) -> float:
    return value


def _unless_zero(name: str, change: Change) -> Change:
    """Return ``change``, skipped if the parameter ``name`` is zero."""
    return lambda setting, values: change(setting, values) if values[name] else setting


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


def _with_spline(setting: Setting, values: Values) -> Setting:
    radius = SPLINE * setting.clutch.dog.inner_radius
    return setting.with_mechanism(spline_friction=values["spline_friction"], spline_radius=radius)


def _with_mismatch(setting: Setting, values: Values) -> Setting:
    nominal = setting.point.mismatch
    offset = to_si("offset_rpm", values["offset_rpm"]) * math.copysign(1.0, nominal)
    return setting.with_point(mismatch=values["mismatch_factor"] * nominal + offset)


def _with_reversed_sense(setting: Setting, _: Values) -> Setting:
    """Reverse the sense of rotation of mismatch and shafts."""
    # Zero stays +0, so that the point keeps its key.
    reversed_setting = setting.with_point(mismatch=0.0 - setting.point.mismatch)
    drive = setting.clutch.drive
    if not drive.turns:
        return reversed_setting
    side: EngineSide = "output" if drive.engine_side == "sliding" else "sliding"
    clutch = replace(reversed_setting.clutch, drive=replace(drive, engine_side=side))
    return replace(reversed_setting, clutch=clutch)


def _with_angles(setting: Setting, values: Values) -> Setting:
    centre = values["centre_pitch"] % 1.0
    return replace(setting, concentration=values["concentration"], centre=centre)


_EFFECTS = (
    Effect(
        "contact_friction",
        title="other friction between the dogs",
        meaning="dogs rub on each other with other coefficients",
        parameters=(
            Parameter(
                "static_friction",
                neutral=attrgetter("clutch.contact.static_friction"),
                low=0.05,
                high=0.45,
                scale=LINEAR,
                source=(
                    "oiled hardened steel 0.08 to 0.16, dry steel up to 0.4; the dynamic one must "
                    "not exceed it"
                ),
                least=0.01,
                most=1.0,
                ordinary=Ordinary("steel, from oiled to dry", low=0.08, high=0.4),
            ),
            Parameter(
                "dynamic_friction",
                neutral=attrgetter("clutch.contact.dynamic_friction"),
                low=0.03,
                high=0.35,
                scale=LINEAR,
                source="oiled hardened steel 0.05 to 0.12, dry steel up to 0.3",
                least=0.01,
                most=1.0,
                ordinary=Ordinary("steel, from oiled to dry", low=0.05, high=0.3),
            ),
        ),
        change=_change_of("contact", _set_value, "static_friction", "dynamic_friction"),
        test=BenchTest(
            "tilt test of the dogs",
            "Press two dog faces on each other under a known load and measure the tangential "
            "force, at rest and while sliding, oiled as on the bench.",
            errors=(
                InstrumentError(
                    "static_friction",
                    0.05,
                    0.01,
                    source="assumption: two push scales, and a film of oil that no two runs share",
                ),
                InstrumentError(
                    "dynamic_friction",
                    0.05,
                    0.01,
                    source="assumption: two push scales, and a film of oil that no two runs share",
                ),
            ),
        ),
    ),
    Effect(
        "contact_stiffness",
        title="other stiffness of the dogs",
        meaning="dogs and their bodies give more or less than assumed",
        parameters=(
            Parameter(
                "stiffness_Pa_m",
                neutral=attrgetter("clutch.contact.stiffness"),
                low=1e11,
                high=2e13,
                scale=LOG,
                source=(
                    "4.5e12 for teeth of steel after ISO 6336-1; bodies, bearings and edge contact"
                    " make it softer by up to a factor of 30, a full flank stiffer by 4"
                ),
                least=1e10,
                most=1e14,
                ordinary=Ordinary(
                    "flanks of steel after ISO 6336-1, down to edges", low=1.5e11, high=1.8e13
                ),
            ),
        ),
        change=_change_of("contact", _set_value, "stiffness_Pa_m"),
        test=BenchTest(
            "static stiffness of the engaged pair",
            "Load the engaged pair with a torque and measure the twist between both rings.",
            errors=(
                InstrumentError(
                    "stiffness_Pa_m", 0.1, 1e10, source="assumption: torque wrench and dial gauge"
                ),
            ),
        ),
    ),
    Effect(
        "contact_dissipation",
        title="other rebound of the dogs",
        meaning="dogs rebound more or less than assumed",
        parameters=(
            Parameter(
                "dissipation_s_m",
                neutral=attrgetter("clutch.contact.dissipation"),
                low=1.0,
                high=300.0,
                scale=LOG,
                source=(
                    "restitution at 0.2 m/s from 0.88 (dry, elastic) to 0.02 (flooded with oil); "
                    "dogshape.validation.impact has the law"
                ),
                least=0.1,
                most=3000.0,
                ordinary=Ordinary("dogs from dry to flooded with oil", low=1.0, high=300.0),
            ),
        ),
        change=_change_of("contact", _set_value, "dissipation_s_m"),
        test=BenchTest(
            "drop test of the ring",
            "Drop the ring on the fixed output ring, dog on dog, from some millimetres and record "
            "the rebound.",
            errors=(
                InstrumentError(
                    "dissipation_s_m",
                    0.2,
                    0.5,
                    source="assumption: rebound read from a recording of the displacement",
                ),
            ),
        ),
    ),
    Effect(
        "contact_creep",
        title="other creep of held faces",
        meaning="faces that friction holds slip faster or slower than assumed",
        parameters=(
            Parameter(
                "stiction_factor",
                neutral=1.0,
                low=0.5,
                high=2.0,
                scale=LOG,
                source=(
                    "the stiction velocity regularises the law of friction and belongs to the "
                    "contact set; 0.1 m/s of the published one is no property of steel, which "
                    "holds"
                ),
                least=0.5,
                most=2.0,
                ordinary=Ordinary("a stated contact set (assumption)", low=0.87, high=1.15),
            ),
        ),
        change=_change_of("contact", mul, stiction_velocity="stiction_factor"),
        test=BenchTest(
            "creep of held faces",
            "Press two dog faces on each other under a known load, pull with half the friction "
            "and record how fast they slip.",
            errors=(
                InstrumentError(
                    "stiction_factor", 0.1, 0.05, source="assumption: dial gauge and stopwatch"
                ),
            ),
        ),
    ),
    Effect(
        "chamfer_angle",
        title="chamfer angle off nominal",
        meaning="the faces are steeper or flatter than nominal",
        parameters=(
            Parameter(
                "chamfer_offset_deg",
                neutral=0.0,
                low=-4.0,
                high=4.0,
                scale=LINEAR,
                source=(
                    "made to half a degree; worn or hand-dressed faces are off by two, faces of "
                    "another drawing by four"
                ),
                ordinary=Ordinary("worn or hand-dressed faces", low=-2.0, high=2.0),
            ),
        ),
        change=_change_of("dog", add, chamfer="chamfer_offset_deg"),
        test=BenchTest(
            "chamfer by profile",
            "Measure the profile of some dogs of either ring on a measuring machine or an imprint.",
            errors=(
                InstrumentError(
                    "chamfer_offset_deg",
                    0.0,
                    0.1,
                    source="assumption: profile projector, and the scatter between dogs",
                ),
            ),
        ),
    ),
    Effect(
        "axial_gap",
        title="axial gap off nominal",
        meaning="the gap before the shift is larger or smaller than nominal",
        parameters=(
            Parameter(
                "gap_offset_mm",
                neutral=0.0,
                low=-0.8,
                high=0.8,
                scale=LINEAR,
                source=(
                    "axial positions of two gears on a shaft add up to some tenths; neutral of a "
                    "shift mechanism without a stop is off by half a millimetre"
                ),
                ordinary=Ordinary("a neutral position without a stop", low=-0.5, high=0.5),
            ),
        ),
        change=_change_of("dog", add, axial_gap="gap_offset_mm"),
        test=BenchTest(
            "gap by feeler or travel",
            "Push the ring from neutral until dogs meet dogs, face on face, and read the "
            "displacement.",
            errors=(InstrumentError("gap_offset_mm", 0.0, 0.02, source="assumption: caliper"),),
        ),
    ),
    Effect(
        "free_play",
        title="free play of the linkage",
        meaning="the actuator has some way to go before it meets the ring",
        parameters=(
            Parameter(
                "free_play_mm",
                neutral=0.0,
                low=0.05,
                high=2.0,
                scale=LOG,
                source=(
                    "a new fork has 0.1 to 0.3 mm in its groove; worn joints of a linkage add up "
                    "to some millimetres"
                ),
                most=6.0,
                ordinary=Ordinary("a new fork in its groove", high=0.3),
            ),
        ),
        change=_change_of("mechanism", _set_value, "free_play_mm"),
        test=BenchTest(
            "hand test of the play",
            "Hold the ring and move the actuator to and fro by hand with a dial gauge on it.",
            errors=(
                InstrumentError(
                    "free_play_mm", 0.0, 0.02, source="assumption: dial gauge, read like a caliper"
                ),
            ),
        ),
    ),
    Effect(
        "linkage_compliance",
        title="elastic linkage",
        meaning=(
            "the linkage between actuator and ring is elastic, with the actuator's mass behind it"
        ),
        parameters=(
            Parameter(
                "compliance_mm_kN",
                neutral=0.0,
                low=0.3,
                high=35.0,
                scale=LOG,
                source=(
                    "a steel fork and rod give 0.3 mm/kN; Bowden cables, the published stand among"
                    " them, 3.4 to 4.3 at the sleeve; long or worn ones ten times as much"
                ),
                most=120.0,
                ordinary=Ordinary("Bowden cables", high=4.3),
            ),
            Parameter(
                "mass_behind_kg",
                neutral=0.0,
                low=0.03,
                high=18.0,
                scale=LOG,
                source=(
                    "fork and rod weigh 0.1 to 1 kg; an arm of 0.5 kg behind a ratio of 3.2 feels "
                    "like 5 kg, a robot's drive like three times that"
                ),
                most=60.0,
                ordinary=Ordinary("fork and rod", high=1.0),
            ),
        ),
        change=_with_elastic_linkage,
        test=BenchTest(
            "static stiffness of the linkage",
            "Block the ring, raise the force in steps and read the displacement at the actuator; "
            "then strike the actuator and record its swing: frequency and stiffness give the mass.",
            errors=(
                InstrumentError(
                    "compliance_mm_kN",
                    0.03,
                    0.05,
                    source="assumption: push scale, and dial gauge at some hundred newtons",
                ),
                InstrumentError(
                    "mass_behind_kg",
                    0.05,
                    0.02,
                    source="assumption: stiffness by a push scale, frequency by a recording",
                ),
            ),
        ),
    ),
    Effect(
        "moving_mass",
        title="mass of actuator and linkage",
        meaning="actuator and linkage move with the ring and add their mass",
        parameters=(
            Parameter(
                "added_mass_kg",
                neutral=0.0,
                low=0.03,
                high=18.0,
                scale=LOG,
                source=(
                    "fork and rod weigh 0.1 to 1 kg; an arm of 0.5 kg behind a ratio of 3.2 feels "
                    "like 5 kg, a robot's drive like three times that"
                ),
                most=60.0,
                ordinary=Ordinary("fork and rod", high=1.0),
            ),
        ),
        change=_change_of("mechanism", add, "added_mass_kg"),
        test=BenchTest(
            "free flight at the sleeve",
            "Shift with the output ring taken out and record the displacement at the sleeve: its "
            "acceleration under a known force is the mass.",
            errors=(
                InstrumentError(
                    "added_mass_kg",
                    0.03,
                    0.02,
                    source="assumption: load cell, and acceleration from a recording",
                ),
            ),
        ),
    ),
    Effect(
        "sleeve_friction",
        title="dry friction of the sliding ring",
        meaning="dry friction of the sliding ring on its shaft",
        parameters=(
            Parameter(
                "friction_N",
                neutral=0.0,
                low=3.0,
                high=200.0,
                scale=LOG,
                source=(
                    "a ring of 3 N on an oiled spline drags with newtons; seals, a tilted fork or "
                    "dirt with some ten; above the least shift force nothing would move"
                ),
                most=1000.0,
                ordinary=Ordinary("seals and a tilted fork", high=50.0),
            ),
        ),
        change=_change_of("mechanism", _set_value, "friction_N"),
        test=replace(
            _SLOW_PUSH,
            errors=(
                InstrumentError("friction_N", 0.02, 0.5, source="assumption: push scale of 2 %"),
            ),
        ),
    ),
    Effect(
        "viscous_damping",
        title="oil damping of the sliding ring",
        meaning="oil damps the ring along its shaft",
        parameters=(
            Parameter(
                "damping_Ns_m",
                neutral=0.0,
                low=5.0,
                high=1600.0,
                scale=LOG,
                source=(
                    "shear in a spline of 10 cm2 with gaps of 20 um at 0.1 Pa s gives 5 N s/m; oil"
                    " that must leave a closed pocket some hundred, a cold one above 1000"
                ),
                most=6000.0,
                ordinary=Ordinary("shear of oil in a spline", high=5.0),
            ),
        ),
        change=_change_of("mechanism", _set_value, "damping_Ns_m"),
        test=BenchTest(
            "free flight at two forces",
            "Shift with the output ring taken out at two forces and two oil temperatures and "
            "record the displacement.",
            errors=(
                InstrumentError(
                    "damping_Ns_m",
                    0.1,
                    2.0,
                    source="assumption: load cell, and speed from a recording",
                ),
            ),
        ),
    ),
    Effect(
        "detent_force",
        title="force of a detent",
        meaning=(
            "a detent holds the ring over a short part of its way; the pull into the next seat is "
            "left out"
        ),
        parameters=(
            Parameter(
                "detent_N",
                neutral=0.0,
                low=10.0,
                high=200.0,
                scale=LOG,
                source=(
                    "ball detents of passenger cars take 10 to 100 N at the rod; above the least "
                    "shift force nothing would move"
                ),
                most=1000.0,
                ordinary=Ordinary("ball detents of passenger cars", high=100.0),
            ),
            Parameter(
                "position_mm",
                neutral=0.5,
                low=0.5,
                high=4.5,
                scale=LINEAR,
                source="anywhere on the travel; most likely where it leaves neutral",
                least=0.5,
                most=4.5,
            ),
        ),
        change=_unless_zero(
            "detent_N",
            _change_of("mechanism", _set_value, "detent_N", detent_position="position_mm"),
        ),
        test=replace(
            _SLOW_PUSH,
            errors=(
                InstrumentError("detent_N", 0.02, 0.5, source="assumption: push scale of 2 %"),
                InstrumentError(
                    "position_mm",
                    0.0,
                    0.1,
                    source="assumption: displacement at the peak of the force",
                ),
            ),
        ),
    ),
    Effect(
        "spline_friction",
        title="friction in the loaded spline",
        meaning="the ring's spline rubs along the shaft in proportion to its torque",
        parameters=(
            Parameter(
                "spline_friction",
                neutral=0.0,
                low=0.01,
                high=0.3,
                scale=LOG,
                source="oiled steel 0.05 to 0.15, dry or worn 0.3; rolling elements 0.01",
                most=1.0,
                ordinary=Ordinary("oiled steel", high=0.15),
            ),
        ),
        change=_unless_zero("spline_friction", _with_spline),
        test=BenchTest(
            "push of the ring under torque",
            "Hold the output ring, load the sliding ring with a known torque and measure the "
            "force that moves it along its shaft.",
            errors=(
                InstrumentError(
                    "spline_friction",
                    0.06,
                    0.005,
                    source="assumption: torque wrench of 5 % and push scale of 2 %",
                ),
            ),
        ),
    ),
    Effect(
        "drag_torque",
        title="drag torque on the sliding ring",
        meaning="the sliding ring is held by a torque against its turning",
        parameters=(
            Parameter(
                "drag_Nm",
                neutral=0.0,
                low=0.02,
                high=8.0,
                scale=LOG,
                source=(
                    "bearings and seals of an input shaft take 0.05 to 0.5 N m, cold oil and a "
                    "dragging clutch some N m, both together up to 8"
                ),
                most=40.0,
                ordinary=Ordinary("bearings and seals of an input shaft", high=0.5),
            ),
        ),
        change=_change_of("mechanism", _set_value, drag_torque="drag_Nm"),
        test=BenchTest(
            "run-down of the sliding ring",
            "Turn the free sliding ring and record how its speed falls, or turn it by a torque "
            "wrench.",
            errors=(
                InstrumentError(
                    "drag_Nm",
                    0.05,
                    0.02,
                    source="assumption: torque wrench of 5 %, or tachometer and inertia",
                ),
            ),
        ),
    ),
    Effect(
        "sliding_inertia",
        title="inertia of the sliding side off nominal",
        meaning="what turns with the sliding ring has a factor of the nominal inertia",
        parameters=(
            Parameter(
                "inertia_factor",
                neutral=1.0,
                low=1.1,
                high=8.0,
                scale=LOG,
                source=(
                    "wheels of other gears in mesh add 10 to 100 percent of an input shaft's "
                    "inertia, a clutch disc of 0.003 to 0.008 kg m2 as much as the published 0.01;"
                    " a ratio of 2.8 that was left out counts squared, 8"
                ),
                least=0.1,
                most=50.0,
                ordinary=Ordinary("other wheels in mesh", high=2.0),
            ),
        ),
        change=_change_of("rings", mul, sliding_inertia="inertia_factor"),
        test=BenchTest(
            "run-up of the sliding side",
            "Turn the free sliding side by a weight on a cord and record its speed: torque over "
            "acceleration is its inertia.",
            errors=(
                InstrumentError(
                    "inertia_factor",
                    0.03,
                    0.02,
                    source="assumption: weight on a cord and tachometer",
                ),
            ),
        ),
    ),
    Effect(
        "actuation_delay",
        title="dead time of the actuation",
        meaning="the force starts some time after time zero",
        parameters=(
            Parameter(
                "delay_s",
                neutral=0.0,
                low=0.0,
                high=0.4,
                scale=LINEAR,
                source=(
                    "valve, pipe and filling of a pneumatic cylinder take 10 to 150 ms; a time "
                    "zero set by hand or by another clock errs by as much again; uniform, since a "
                    "shifted zero has no scale"
                ),
                least=0.0,
                most=1.0,
                ordinary=Ordinary("valve, pipe and filling of a cylinder", high=0.15),
            ),
        ),
        change=lambda setting, values: replace(setting, delay=setting.delay + values["delay_s"]),
        test=BenchTest(
            _FORCE,
            "Record the trigger and the force at the shift fork on one clock: the force must "
            "begin to rise at time zero.",
            errors=(
                InstrumentError(
                    "delay_s", 0.0, 0.001, source="assumption: clock of a recording of 1 ms"
                ),
            ),
        ),
        aliases=("a shifted time zero of the record",),
    ),
    Effect(
        "actuation_lag",
        title="slow rise of the shift force",
        meaning="the force nears its nominal course with a lag of first order",
        parameters=(
            Parameter(
                "lag_s",
                neutral=0.0,
                low=0.003,
                high=0.45,
                scale=LOG,
                source=(
                    "a cylinder of 0.1 to 1 litre behind a valve of some hundred litres a minute "
                    "fills with time constants of 10 to 300 ms; a throttled one up to half a "
                    "second"
                ),
                most=1.0,
                ordinary=Ordinary("a cylinder behind its valve", high=0.3),
            ),
        ),
        change=_change_of("profile", lambda old, value: value or old, "lag_s"),
        test=BenchTest(
            _FORCE,
            "Record the force at the shift fork while the ring is blocked: its course after the "
            "nominal rise shows the lag.",
            errors=(
                InstrumentError(
                    "lag_s",
                    0.05,
                    0.001,
                    source="assumption: load cell, and clock of a recording of 1 ms",
                ),
            ),
        ),
    ),
    Effect(
        "force_rise",
        title="rise time of the shift force off nominal",
        meaning="the force rises to its final value in a factor of the nominal time",
        parameters=(
            Parameter(
                "rise_factor",
                neutral=1.0,
                low=0.4,
                high=2.5,
                scale=LOG,
                source=(
                    "a rise read from 10 to 90 percent of a cubic step is 0.61 of the whole, up to"
                    " another threshold down to 0.4; a supply or throttle of half the flow takes "
                    "twice as long, a longer hose some ten percent more"
                ),
                least=0.05,
                most=20.0,
                ordinary=Ordinary(
                    "another threshold of the reading, or half of the flow", low=0.6, high=2.0
                ),
            ),
        ),
        change=_change_of("profile", mul, rise="rise_factor"),
        test=BenchTest(
            _FORCE,
            "Record the force at the shift fork while the ring is blocked: from its first rise to "
            "its final value is the rise time.",
            errors=(
                InstrumentError(
                    "rise_factor",
                    0.03,
                    0.02,
                    source="assumption: load cell, and clock of a recording of 1 ms",
                ),
            ),
        ),
    ),
    Effect(
        "force_scale",
        title="shift force off nominal",
        meaning="the force at the sleeve is a factor of the nominal one",
        parameters=(
            Parameter(
                "force_factor",
                neutral=1.0,
                low=0.5,
                high=1.5,
                scale=LINEAR,
                source=(
                    "an assumed efficiency of 0.8 may be 0.5 to 1 with a bent or dry cable; ratios"
                    " from a static calibration err by up to 10 percent more, a piston's area by "
                    "15"
                ),
                least=0.05,
                most=3.0,
                ordinary=Ordinary("an assumed efficiency of a cable", low=0.63, high=1.25),
            ),
        ),
        change=_change_of("profile", mul, force="force_factor"),
        test=BenchTest(
            "static force at the sleeve",
            "Block the ring and measure the force at the shift fork with a load cell at each "
            "pressure.",
            errors=(
                InstrumentError("force_factor", 0.02, 0.005, source="assumption: load cell of 2 %"),
            ),
        ),
    ),
    Effect(
        "force_loss",
        title="constant loss of shift force",
        meaning="the force at the sleeve is smaller than nominal by a constant",
        parameters=(
            Parameter(
                "loss_N",
                neutral=0.0,
                low=2.0,
                high=150.0,
                scale=LOG,
                source=(
                    "a gauge read to 10 mbar on a piston of 20 cm2 errs by 2 N; return springs and"
                    " preloaded seals of such cylinders hold 10 to 50 N, springs of a fork up to "
                    "150 N"
                ),
                most=1000.0,
                ordinary=Ordinary("return spring and seals of a cylinder", high=50.0),
            ),
        ),
        change=_change_of("profile", add, loss="loss_N"),
        test=BenchTest(
            "static force at the sleeve",
            "Block the ring and measure the force at the shift fork with a load cell at each "
            "pressure: the same difference from nominal at all of them is a loss.",
            errors=(
                InstrumentError(
                    "loss_N",
                    0.02,
                    2.0,
                    source="assumption: load cell, line through the forces at each pressure",
                ),
            ),
        ),
    ),
    Effect(
        "mismatch_speed",
        title="mismatch off nominal",
        meaning="the true mismatch is a factor of the nominal one, and an offset",
        parameters=(
            Parameter(
                "offset_rpm",
                neutral=0.0,
                low=-4.0,
                high=4.0,
                scale=LINEAR,
                source=(
                    "a flywheel with 5 to 20 N m of friction loses 0.5 to 3 1/min within a shift; "
                    "speeds are set to a few 1/min, below the least nominal one"
                ),
                ordinary=Ordinary("run-down of a flywheel within a shift", low=-3.0, high=3.0),
            ),
            Parameter(
                "mismatch_factor",
                neutral=1.0,
                low=0.75,
                high=1.25,
                scale=LINEAR,
                source=(
                    "a tooth miscounted in a ratio of some ten to twenty gives 5 to 10 percent, a "
                    "neighbouring ratio of a gearbox or a slipping belt up to 25"
                ),
                least=0.05,
                most=3.0,
                ordinary=Ordinary("a miscounted tooth", low=0.9, high=1.1),
            ),
        ),
        change=_with_mismatch,
        test=BenchTest(
            "both speeds at the first touch",
            "Record the speeds of both rings with encoders on the clock of the displacement and "
            "read them at the first touch.",
            errors=(
                InstrumentError(
                    "offset_rpm",
                    0.0,
                    0.1,
                    source="assumption: encoders, line through the speeds at each mismatch",
                ),
                InstrumentError(
                    "mismatch_factor",
                    0.0,
                    0.002,
                    source="assumption: encoders, line through the speeds at each mismatch",
                ),
            ),
        ),
    ),
    Effect(
        "reversed_mismatch",
        title="reversed sense of rotation",
        meaning="the rings turn past each other the other way round than the table says",
        parameters=(),
        change=_with_reversed_sense,
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
                "concentration",
                neutral=0.0,
                low=0.1,
                high=10.0,
                scale=LOG,
                source=(
                    "from a preference that hardly shows (0.1) to all within a tenth of the pitch "
                    "(10), as with a stand that stops at one place"
                ),
                most=100.0,
                ordinary=Ordinary("a ring that coasts to rest (assumption)", high=1.0),
            ),
            Parameter(
                "centre_pitch",
                neutral=0.0,
                low=0.0,
                high=1.0,
                scale=LINEAR,
                source="any place in the pitch; 0 is dogs facing dogs",
                least=0.0,
                most=1.0,
            ),
        ),
        change=_unless_zero("concentration", _with_angles),
        test=BenchTest(
            "angle of each shift",
            "Record the relative angle at the trigger with encoders of both rings, for some thirty "
            "shifts.",
            errors=(
                InstrumentError(
                    "concentration", 0.2, 0.25, source="assumption: angles of thirty shifts"
                ),
                InstrumentError(
                    "centre_pitch", 0.0, 0.05, source="assumption: angles of thirty shifts"
                ),
            ),
        ),
    ),
)
#: By name, as files have it.
EFFECTS = {effect.name: effect for effect in _EFFECTS}


def load(folder: Path | None = None) -> dict[str, Effect]:
    """Return all effects, sorted by name.

    ``folder`` holds effects of the user; files that begin with an underscore are no effects. Raises
    InputError if the folder is missing, a file cannot be run, has no ``EFFECT`` or another name
    than its effect, or a name is taken.
    """
    effects = dict(EFFECTS)
    paths = effect_files(folder) if folder else {}
    for path in paths.values():
        effect = _load_effect(path)
        if effect.name in effects:
            raise InputError(
                f"{path} defines the effect '{effect.name}', but there is one of that name; "
                "rename file and effect"
            )
        effects[effect.name] = effect
    return dict(sorted(effects.items()))


def effect_files(folder: Path) -> dict[str, Path]:
    """Return the effect files of a user's folder by the names of their effects."""
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}; give one with effects as Python files")
    paths = sorted(path for path in folder.glob("*.py") if not path.name.startswith("_"))
    return {path.stem: path for path in paths}


def _load_effect(path: Path) -> Effect:
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
