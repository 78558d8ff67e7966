"""Teeth of a sleeve against hand figures, limit cases and a published sample; its layers.

Hand figures: 36 teeth of 122/110 mm, pressure angle 30 degrees, play 0.75 mm, 3200 N m on half of
them, 4 mm engaged, fillets of 0.8 mm, a rim of 8 mm at 1800 1/min.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dogshape as ds
from dogshape.app.live_page import open_live_page
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.export.drawing import dimensioned_svg, open_section_svg
from dogshape.pipeline.reports.data_sheet import provenance_of
from dogshape.sim.shift.geometry import FLANKS, Dog, Dogs
from dogshape.sim.strength.dog_strength import (
    Limits,
    engaged_length,
    flank_pressure,
    root_load,
    root_of,
    strength_checks,
)
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits
from dogshape.sim.strength.materials import DENSITY
from dogshape.sim.strength.spline import (
    Sleeve,
    bending,
    fillet_room,
    hoop_stress,
    pitch_shear,
    root_thickness,
    stress_correction,
    tooth_thickness,
)
from dogshape.sim.strength.verdict import missing_checks
from dogshape.sim.units import DEG, MM, MPA, RPM
from tests.conftest import Call

EXAMPLE = Path(__file__).parents[2] / "examples" / "sleeve.toml"
ROOF = {"crest": 0.5, "chamfer_back": 15 * DEG, "backlash": 0.75e-3}
TRUCK = Dog(36, 15 * DEG, -3 * DEG, -3 * DEG, 6e-3, 122e-3, 110e-3, axial_gap=1e-3, **ROOF)
RADIAL = Sleeve(pressure_angle=0.0)  #: teeth with radial flanks, as wide as they are simulated
FORCE = 3200 / (0.058 * 36 * 0.5)  #: N on a tooth
LENGTH = 4 * MM
ONLY_HALF = LoadCase(torque=3200.0, application_factor=1.0, load_sharing=0.5)


def test_thickness_bending_and_shear_by_hand() -> None:
    """Pitch 10.123 mm, 4.686 mm thick; 4.444 + 2 3 tan 30 = 7.908 mm at the root circle."""
    sleeve = Sleeve()
    assert ONLY_HALF.force_per_dog(TRUCK) == pytest.approx(FORCE) == pytest.approx(3065, abs=0.5)
    assert tooth_thickness(TRUCK, TRUCK.mean_radius) / MM == pytest.approx(4.686, abs=1e-3)
    assert root_thickness(TRUCK, sleeve) / MM == pytest.approx(7.908, abs=1e-3)
    assert bending(TRUCK, sleeve, FORCE, LENGTH) / MPA == pytest.approx(220.6, rel=0.002)
    assert pitch_shear(TRUCK, FORCE, LENGTH) / MPA == pytest.approx(163.5, rel=0.002)
    # 1.2 + 0.13 2.636 = 1.5427, q = 4.943, exponent 1/(1.21 + 2.3/2.636) = 0.4802
    assert stress_correction(TRUCK, sleeve, 0.8 * MM) == pytest.approx(3.323, rel=0.002)
    # Floor 9.599 - 7.908 mm, of which a fillet takes tan 30 of its radius on either side.
    assert fillet_room(TRUCK, sleeve) / MM == pytest.approx(1.464, rel=0.002)


def test_hoop_stress_by_hand() -> None:
    """55,172 N tan 30 over 2 pi 8 4 mm2 are 158.4 MPa; 188.5 rad/s at 61 to 69 mm 1.28 MPa."""
    still, turning = Sleeve(), Sleeve(speed=1800 * RPM)
    stress = hoop_stress(TRUCK, still, 8 * MM, 3200.0, LENGTH) / MPA
    assert stress == pytest.approx(158.4, rel=0.001)
    total = hoop_stress(TRUCK, turning, 8 * MM, 3200.0, LENGTH) / MPA
    assert total - stress == pytest.approx(1.28, rel=0.005)


def test_the_checks_have_the_closed_forms() -> None:
    sleeve = Sleeve(tooth_height=6.6 * MM)
    rim = ManufacturingLimits(rim=8 * MM, root_radius=0.8 * MM)
    limits = Limits(load=ONLY_HALF, manufacturing=rim, sleeve=sleeve)
    checks = {check.name: check.value for check in strength_checks(TRUCK, limits)}
    length = engaged_length(TRUCK, limits, "traction")
    tension = stress_correction(TRUCK, sleeve, 0.8 * MM) * bending(TRUCK, sleeve, FORCE, length)
    assert checks["tooth_bending_traction"] == pytest.approx(tension / MPA)
    assert checks["root_fatigue"] == pytest.approx(tension / MPA)
    assert checks["tooth_shear"] == pytest.approx(pitch_shear(TRUCK, FORCE, length) / MPA)
    hoop = hoop_stress(TRUCK, sleeve, 8 * MM, 3200.0, length)
    assert checks["sleeve_hoop"] == pytest.approx(hoop / MPA)
    assert checks["root_radius"] == pytest.approx(fillet_room(TRUCK, sleeve) / MM)
    face_only = {"root_bending_traction", "root_bending_braking", "shear_stress", "rim"}
    assert not checks.keys() & {*face_only, "cutter_reach", "edge_clearance"}


def test_pressure_is_that_of_a_face_dog_with_the_same_area() -> None:
    """And the published sample of DIN 5466-1: 112,970.71 N on 648 mm2, k_l 1.03, k 3.00."""
    face, sleeve = Limits(load=ONLY_HALF), Limits(load=ONLY_HALF, sleeve=Sleeve())
    for flank in FLANKS:
        on_face, in_sleeve = (
            flank_pressure(TRUCK, limits, flank, FORCE) for limits in (face, sleeve)
        )
        assert in_sleeve == on_face
    # 24 splines of 3 mm by 9 mm; the roundings of 0.02 mm take as much of either end.
    sample = Dog(24, 0.0, 0.0, 0.0, 9.04e-3, 63e-3, 57e-3, axial_gap=1e-3, backlash=0.1e-3)
    load = LoadCase(
        torque=112970.71 * 30e-3, application_factor=1.0, load_sharing=1.0 / (1.03 * 3.00)
    )
    sharp = ManufacturingLimits(root_radius=0.02 * MM)
    limits = Limits(load=load, manufacturing=sharp, sleeve=Sleeve())
    pressure = flank_pressure(sample, limits, "traction", load.force_per_dog(sample))
    assert pressure / MPA == pytest.approx(538.7, rel=1e-3)


def test_bending_vanishes_with_the_radial_height() -> None:
    """In proportion to it: half of the height has half of the stress, to the thinner root."""

    def of_height(height: float) -> float:
        mean = 2.0 * TRUCK.mean_radius
        dog = replace(TRUCK, outer_diameter=mean + height, inner_diameter=mean - height)
        return bending(dog, RADIAL, FORCE, LENGTH)

    heights = np.array([0.4, 0.2, 0.1, 0.05]) * MM
    stresses = np.array([of_height(height) for height in heights])
    assert stresses[:-1] / stresses[1:] == pytest.approx(2.0, rel=0.01)
    thickness = tooth_thickness(TRUCK, TRUCK.mean_radius)
    slope = 6.0 * FORCE * 0.5 / (LENGTH * thickness**2)
    assert stresses[-1] / heights[-1] == pytest.approx(slope, rel=2e-3)


def test_shear_has_two_thirds_of_the_peak_of_a_face_dog_on_the_same_section() -> None:
    """The parabola of a rectangle has 1.5 times the mean; upright flanks have one thickness."""
    dog = replace(TRUCK, traction=0.0, braking=0.0)
    face = root_of(dog, Limits(load=ONLY_HALF), root_load(dog, Limits(load=ONLY_HALF), "traction"))
    mean = pitch_shear(dog, ONLY_HALF.force_per_dog(dog), dog.radial_width)
    assert mean == pytest.approx(face.shear / 1.5)


def test_limits_of_the_hoop_stress() -> None:
    """No radial force at 0 degrees; a thin ring that turns has rho (w r)^2 (Timoshenko)."""
    assert hoop_stress(TRUCK, RADIAL, 8 * MM, 3200.0, LENGTH) == 0.0
    turning = replace(RADIAL, speed=6000 * RPM)
    thin = hoop_stress(TRUCK, turning, 1e-6, 3200.0, LENGTH)
    assert thin == pytest.approx(DENSITY * (6000 * RPM * 61e-3) ** 2, rel=1e-4)
    # A rim far thicker than the bore: a disc with a small hole has (3 + nu)/4 rho (w r_o)^2 there.
    disc = hoop_stress(TRUCK, turning, 100.0, 3200.0, LENGTH)
    assert disc == pytest.approx(3.3 / 4 * DENSITY * (6000 * RPM * 100.061) ** 2, rel=1e-4)


def test_radial_flanks_have_the_thickness_of_the_simulated_teeth() -> None:
    assert root_thickness(TRUCK, RADIAL) == pytest.approx(
        0.5 * (TRUCK.tip_width_at(55e-3) + TRUCK.root_width_at(55e-3))
    )


def test_many_designs_have_the_checks_of_each() -> None:
    heights = np.array([5.0e-3, 6.0e-3, 7.0e-3])
    rim = ManufacturingLimits(rim=8 * MM)
    limits = Limits(load=ONLY_HALF, manufacturing=rim, sleeve=Sleeve())
    fields = {**vars(TRUCK), "height": heights}
    names = Dog.__dataclass_fields__
    together = strength_checks(Dogs(**{n: v for n, v in fields.items() if n in names}), limits)
    for place, height in enumerate(heights):
        single = strength_checks(replace(TRUCK, height=float(height)), limits)
        for many, one in zip(together, single, strict=True):
            assert many.name == one.name
            assert np.broadcast_to(many.value, 3)[place] == pytest.approx(one.value), one.name


def _sleeve(*settings: str) -> Setup:
    return load_study("mq200", ['dog.mount="sleeve"', *settings])


def test_the_mount_moves_no_shift_and_no_hash_at_its_default() -> None:
    face, sleeve = load_study("mq200"), _sleeve()
    assert load_study("mq200", ['dog.mount="face"']).config_hash == face.config_hash
    assert sleeve.config_hash != face.config_hash
    assert sleeve.physics_hash == face.physics_hash
    assert sleeve.clutch == face.clutch


def test_a_sleeve_without_its_rim_is_not_judged() -> None:
    def keys(study: Setup) -> dict[str, str]:
        dog, limits = study.clutch.dog, study.limits
        names = [check.name for check in strength_checks(dog, limits)]
        return {missing.check: missing.key for missing in missing_checks(dog, limits, names)}

    assert keys(_sleeve())["sleeve_hoop"] == "manufacturing.rim_mm"
    assert "sleeve_hoop" not in keys(_sleeve("manufacturing.rim_mm=8"))
    assert "sleeve_hoop" not in keys(load_study("mq200"))


def test_mistakes_of_a_sleeve_are_sentences(dogshape: Call, tmp_path: Path) -> None:
    mount = ("--set", "dog.mount=sleeve")
    for settings, words in (
        (("--set", "sleeve.speed_rpm=2000"), "[sleeve] belongs to dog.mount = 'sleeve'"),
        ((*mount, "--set", "sleeve.tooth_height_mm=3"), "(outer - inner diameter)/2 = 4 mm of it"),
        ((*mount, "--set", "sleeve.pressure_angle_deg=60"), "between 0 and 45 deg"),
        (("--set", "dog.mount=bore"), "dog.mount is 'bore', but it must be one of 'face' or"),
        ((*mount, "--fem"), "--fem has dogs on a face"),
    ):
        assert words in dogshape("strength", "mq200", "--no-simulate", *settings).sentence
    stl = str(tmp_path / "ring.stl")
    assert (
        "STL and STEP have dogs on a face"
        in dogshape("export", "mq200", *mount, "--stl", stl).sentence
    )


def test_sheet_console_and_live_page_state_the_mount(dogshape: Call, tmp_path: Path) -> None:
    words = "sleeve, teeth 4 mm high, pressure angle 30°"
    settings = {"dog.mount": "sleeve", "sleeve.speed_rpm": 2000}
    study = ds.Study("mq200", settings)
    assert study.dog == ds.Study("mq200").dog
    assert "mq200: count=15" in repr(study)
    assert provenance_of(study.config, None)["mount"] == f"{words}, 2000 1/min"
    assert "mount" not in provenance_of(load_study("mq200"), None)
    said = dogshape("strength", "mq200", "--no-simulate", "--set", "dog.mount=sleeve")
    assert f"mount: {words}\n" in said.out
    assert "mount:" not in dogshape("strength", "mq200", "--no-simulate").out
    page = open_live_page(study)
    texts = page.start_texts()
    page.write("dog.svg", texts, "", tmp_path / "dog.svg")
    assert "teeth of a sleeve" in (tmp_path / "dog.svg").read_text("utf-8")
    with pytest.raises(ds.InputError, match="STL and STEP have dogs on a face"):
        page.write("rings.step", texts, "", tmp_path / "rings.step")


def test_the_drawing_has_teeth_without_a_floor() -> None:
    study = _sleeve("manufacturing.rim_mm=8")
    drawing = dimensioned_svg(study.clutch.dog, study.limits)
    assert "teeth of a sleeve, rooted at Ø52.00, and of its mate, at Ø44.00 mm" in drawing
    assert drawing.count('class="part"') == 5
    face = dimensioned_svg(study.clutch.dog, replace(study.limits, sleeve=None))
    assert "both rings alike, one turned over" in face
    assert face.count('class="part"') == 1
    pair = study.clutch.pair
    rings = [open_section_svg(pair, pair, is_sleeve=is_sleeve) for is_sleeve in (False, True)]
    on_face, in_sleeve = (ring.count('class="ring-a"') for ring in rings)
    assert on_face == 1
    assert in_sleeve == rings[1].count('class="ring-b"') > 4


def test_the_example_engages_and_holds_itself() -> None:
    """Its back-taper pulls in with T K_A/r tan(3 - 1 deg of wear) without friction."""
    checked = ds.Study(EXAMPLE, {"expectation.angles": 4}).check()
    checks = {check.name: check for check in checked.design.checks}
    assert checked.engaged == 1.0
    pull = 300 * 1.25 / 28e-3 * math.tan(2 * DEG)
    assert checks["retention_traction"].value == pytest.approx(-pull)
    loads = [check for check in checks.values() if check.rule.group == "load"]
    assert all(check.passed for check in loads)
    assert {"tooth_bending_traction", "tooth_shear", "sleeve_hoop"} <= checks.keys()
