"""Effects of the dogs: friction, stiffness and rebound of their contact, chamfer and axial gap.

The explicit scheme knows the dynamic coefficient alone; ``cenic`` both (``sim.shift.clutch``). A
gap between the crests that differs from the nominal changes the travel with it.
"""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _with_friction(setting: Setting, values: Values) -> Setting:
    return setting.with_contact(
        static_friction=values["static_friction"], dynamic_friction=values["dynamic_friction"]
    )


def _with_chamfer(setting: Setting, values: Values) -> Setting:
    chamfer = setting.clutch.dog.chamfer + to_si("chamfer_offset_deg", values["chamfer_offset_deg"])
    return setting.with_dog(chamfer=chamfer)


def _with_gap(setting: Setting, values: Values) -> Setting:
    gap = setting.clutch.dog.axial_gap + to_si("gap_offset_mm", values["gap_offset_mm"])
    return setting.with_dog(axial_gap=gap)


EFFECTS = (
    Effect(
        "contact_friction", title="other friction between the dogs",
        meaning="dogs rub on each other with other coefficients",
        parameters=(
            Parameter(
                "static_friction", neutral=lambda setting: setting.clutch.contact.static_friction,
                low=0.05, high=0.45, scale="uniform", least=0.01, most=1.0,
                source="oiled hardened steel 0.08 to 0.16, dry steel up to 0.4; the dynamic one "
                "must not exceed it",
            ),
            Parameter(
                "dynamic_friction", neutral=lambda setting: setting.clutch.contact.dynamic_friction,
                low=0.03, high=0.35, scale="uniform", least=0.01, most=1.0,
                source="oiled hardened steel 0.05 to 0.12, dry steel up to 0.3",
            ),
        ),
        change=_with_friction,
        test=BenchTest("tilt test of the dogs",
            "Press two dog faces on each other under a known load and measure the tangential "
            "force, at rest and while sliding, oiled as on the bench."),
    ),
    Effect(
        "contact_stiffness", title="other stiffness of the dogs",
        meaning="dogs and their bodies give more or less than assumed",
        parameters=(Parameter(
            "stiffness_Pa_m", neutral=lambda setting: setting.clutch.contact.stiffness,
            low=1e11, high=2e13, scale="log-uniform", least=1e10, most=1e14,
            source="4.5e12 for teeth of steel after ISO 6336-1; bodies, bearings and edge contact "
            "make it softer by up to a factor of 30, a full flank stiffer by 4",
        ),),
        change=lambda setting, values: setting.with_contact(stiffness=values["stiffness_Pa_m"]),
        test=BenchTest("static stiffness of the engaged pair",
            "Load the engaged pair with a torque and measure the twist between both rings."),
    ),
    Effect(
        "contact_dissipation", title="other rebound of the dogs",
        meaning="dogs rebound more or less than assumed",
        parameters=(Parameter(
            "dissipation_s_m", neutral=lambda setting: setting.clutch.contact.dissipation,
            low=1.0, high=300.0, scale="log-uniform", least=0.1, most=3000.0,
            source="restitution at 0.2 m/s from 0.88 (dry, elastic) to 0.02 (flooded with oil); "
            "validation.impact has the law",
        ),),
        change=lambda setting, values: setting.with_contact(dissipation=values["dissipation_s_m"]),
        test=BenchTest("drop test of the ring",
            "Drop the ring on the fixed output ring, dog on dog, from some millimetres and record "
            "the rebound."),
    ),
    Effect(
        "chamfer_angle", title="chamfer angle off nominal",
        meaning="the faces are steeper or flatter than nominal",
        parameters=(Parameter(
            "chamfer_offset_deg", neutral=0.0, low=-4.0, high=4.0, scale="uniform",
            source="made to half a degree; worn or hand-dressed faces are off by two, faces of "
            "another drawing by four",
        ),),
        change=_with_chamfer,
        test=BenchTest("chamfer by profile",
            "Measure the profile of some dogs of either ring on a measuring machine or an "
            "imprint."),
    ),
    Effect(
        "axial_gap", title="axial gap off nominal",
        meaning="the gap before the shift is larger or smaller than nominal",
        parameters=(Parameter(
            "gap_offset_mm", neutral=0.0, low=-0.8, high=0.8, scale="uniform",
            source="axial positions of two gears on a shaft add up to some tenths; neutral of a "
            "shift mechanism without a stop is off by half a millimetre",
        ),),
        change=_with_gap,
        test=BenchTest("gap by feeler or travel",
            "Push the ring from neutral until dogs meet dogs, face on face, and read the "
            "displacement."),
    ),
)  # fmt: skip
