"""Five assumed data sheets, each entered by options alone: draft, verdict, figures by hand.

No number of the sheets is measured. The real actuators, a drum cam and its lever spring, a
pneumatic cylinder, a solenoid, an electric actuator and a cam, are the nearest rise over time.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.config.toml_text import toml_value
from dogshape.pipeline.drafts.study_folder import WrittenStudy, write_study
from dogshape.pipeline.simulate.design import design_of
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.strength.dog_strength import strike_torque
from dogshape.sim.units import DEG, RPM

STRIKE = ("flank_strike", "strike.ring_inertia_kgm2 and strike.input_stiffness_Nm_rad")
RETENTION = (
    "retention", "load.separating_force_limit_N, or mechanism.detent_N and mechanism.detent_seat_mm"
)  # fmt: skip
#: The hand figures have 0.10 in the toothing, where the interval of friction ends at 0.12.
TOOTHING = {"load.spline_friction_release": 0.10}
HAND_STIFFNESS = 25e9  #: of a pair of dogs in the hand figures, N/m a m of width


def _stiff_dogs(study: Setup) -> dict[str, float]:
    """Return the key with which the dogs of a study have the stiffness of the hand figures."""
    dog = study.clutch.dog
    stiffness = HAND_STIFFNESS * dog.radial_width
    return {"load.dog_stiffness_factor": stiffness / study.limits.load.stiffness(dog)}


def _between(low: float, high: float) -> dict[str, Any]:
    return {"distribution": "uniform", "low": low, "high": high}


@dataclass(frozen=True)
class Sheet:
    """A data sheet: kind to begin with, values, and the verdict and hand figures in the end.

    ``failed`` are checks that fail without a simulation. Figures in N, MPa and s.
    """

    kind: str
    values: Mapping[str, Any]
    failed: tuple[str, ...]
    not_judged: tuple[tuple[str, str], ...]
    pull_out: float
    shear: float | None = None
    flight: float | None = None


SHEETS = {
    "motorcycle gear": Sheet("motorcycle", {
        "dog.count": 6, "dog.chamfer_deg": 0.0, "dog.traction_deg": -3.0, "dog.braking_deg": -3.0,
        "dog.height_mm": 5.0, "dog.backlash_deg": 25.0, "dog.outer_diameter_mm": 60.0,
        "dog.inner_diameter_mm": 40.0, "dog.axial_gap_mm": 0.8, "sliding.mass_kg": 0.42,
        "mechanism.added_mass_kg": 0.15, "sliding.inertia_kgm2": 0.0025, "output.inertia_kgm2": 1.0,
        "actuation.force_N": 250.0, "actuation.rise_s": 0.04, "operating.force_N": 250.0,
        "operating.mismatch_rpm": _between(-500.0, 800.0), "drive.shaft_speed_rpm": 5000.0,
        "load.torque_Nm": 150.0, "mechanism.drag_torque_Nm": 0.4,
        "load.separating_force_limit_N": 60.0, "material.set": "18CrNiMo7-6",
        "mechanism.spline_radius_mm": 14.0,
    }, (), (STRIKE,), pull_out=105.7, shear=76.0),
    "truck sleeve": Sheet("amt", {
        "dog.count": 36, "dog.chamfer_deg": 15.0, "dog.chamfer_back_deg": 15.0,
        "dog.traction_deg": -3.0, "dog.braking_deg": -3.0, "dog.height_mm": 6.0,
        "dog.backlash_mm": 0.75, "tolerance.backlash_mm": 0.15, "dog.outer_diameter_mm": 122.0,
        "dog.inner_diameter_mm": 110.0, "dog.axial_gap_mm": 1.0, "sliding.mass_kg": 3.1,
        "sliding.inertia_kgm2": 0.35, "output.inertia_kgm2": 45.0, "actuation.force_N": 1500.0,
        "actuation.rise_s": 0.04, "operating.force_N": 1500.0,
        "operating.mismatch_rpm": _between(-60.0, 60.0), "drive.shaft_speed_rpm": 1200.0,
        "load.torque_Nm": 3200.0, "load.coast_share": 1500.0 / 3200.0,
        "mechanism.drag_torque_Nm": 4.0, "load.separating_force_limit_N": 120.0,
        "material.set": "16MnCr5", "dog.mount": "sleeve",
    }, ("pull_out_force", "root_fatigue"),
        (STRIKE, ("sleeve_hoop", "manufacturing.rim_mm")), pull_out=3369.0),
    "electric disconnect": Sheet("ev_disconnect", {
        "dog.count": 60, "dog.chamfer_deg": 0.0, "dog.chamfer_back_deg": 0.0,
        "dog.traction_deg": 5.0, "dog.braking_deg": 5.0, "dog.height_mm": 2.0,
        "dog.backlash_mm": 0.4, "dog.outer_diameter_mm": 110.0, "dog.inner_diameter_mm": 94.0,
        "dog.axial_gap_mm": 0.6, "sliding.mass_kg": 0.35, "sliding.inertia_kgm2": 0.12,
        "output.inertia_kgm2": 9.0, "actuation.force_N": 180.0, "actuation.rise_s": 0.025,
        "operating.force_N": 180.0, "operating.mismatch_rpm": _between(-25.0, 25.0),
        "drive.shaft_speed_rpm": 6000.0, "load.torque_Nm": 1500.0, "mechanism.drag_torque_Nm": 0.3,
        "material.set": "42CrMo4", "mechanism.spline_radius_mm": 52.0,
        "load.pull_out_share": 0.1,
    }, ("tip_core", "pull_out_force"), (STRIKE, RETENTION), pull_out=383.1,
        flight=7.6e-3),
    "rally gear": Sheet("motorcycle", {
        "dog.count": 6, "dog.chamfer_deg": 0.0, "dog.traction_deg": -2.0, "dog.braking_deg": -2.0,
        "dog.height_mm": 6.5, "dog.backlash_mm": 13.0, "dog.outer_diameter_mm": 86.0,
        "dog.inner_diameter_mm": 58.0, "dog.axial_gap_mm": 1.0, "sliding.mass_kg": 0.75,
        "sliding.inertia_kgm2": 0.006, "output.inertia_kgm2": 0.9, "actuation.force_N": 450.0,
        "actuation.rise_s": 0.02, "operating.force_N": 450.0,
        "operating.mismatch_rpm": _between(-300.0, 900.0), "drive.shaft_speed_rpm": 5500.0,
        "load.torque_Nm": 600.0, "mechanism.drag_torque_Nm": 0.8, "material.set": "18CrNiMo7-6",
        "mechanism.spline_radius_mm": 22.0, "load.pull_out_share": 0.1,
        "strike.ring_inertia_kgm2": 0.0059, "strike.input_stiffness_Nm_rad": 2e4,
    }, ("pull_out_force", "flank_strike_root"), (RETENTION,), pull_out=532.0, shear=72.0,
        flight=7.5e-3),
    "outboard": Sheet("mq200", {
        "dog.count": 3, "dog.chamfer_deg": 10.0, "dog.traction_deg": -5.0, "dog.braking_deg": 30.0,
        "dog.height_mm": 7.0, "dog.backlash_deg": 20.0, "dog.outer_diameter_mm": 48.0,
        "dog.inner_diameter_mm": 30.0, "dog.axial_gap_mm": 1.5, "sliding.mass_kg": 0.35,
        "sliding.inertia_kgm2": 0.012, "output.inertia_kgm2": 0.65,
        "actuation.force_N": [150.0, 250.0], "actuation.rise_s": [0.03, 0.03],
        "operating.force_N": [150.0, 250.0], "operating.mismatch_rpm": _between(250.0, 450.0),
        "drive.shaft_speed_rpm": 0.0, "drive.engine_side": "output", "load.torque_Nm": 250.0,
        "load.pull_out_share": 1.0, "mechanism.drag_torque_Nm": 0.5, "material.set": "16MnCr5",
    }, ("chamfer_share", "pull_out_force", "flank_pressure_braking", "root_fatigue",
        "contact_ratio"), (STRIKE, RETENTION), pull_out=4771.0),
}  # fmt: skip


def _entered(sheet: Sheet, folder: Path, **more: float) -> tuple[Setup, WrittenStudy]:
    draft = write_study(folder / "own", sheet.kind, {**sheet.values, **more}, force=True)
    return load_study(str(folder / "own")), draft


def _values(study: Setup) -> dict[str, float]:
    return {check.name: check.value for check in design_of(study, {}).checks}


@pytest.mark.parametrize("name", SHEETS)
def test_the_verdict_names_what_is_missing(name: str, tmp_path: Path) -> None:
    """Checks without a simulation; landing and engagement are named as missing too."""
    sheet = SHEETS[name]
    _entered(sheet, tmp_path)
    verdict = ds.Study(tmp_path / "own").strength(simulate=False).verdict
    missing = {(one.check, one.key) for one in verdict.not_judged}
    simulated = {one for one in missing if one[0] in ("landing", "engagement")}
    assert len(simulated) == 2
    assert missing - simulated == set(sheet.not_judged)
    assert set(verdict.failed) - {"smallest_margin_statistical"} == set(sheet.failed)
    assert verdict.state == ("fails" if sheet.failed else "not_judged")
    for check, key in sheet.not_judged:
        assert f"{check.replace('_', ' ')} (give {key})" in verdict.line


@pytest.mark.parametrize("name", SHEETS)
def test_every_number_of_the_kind_is_listed(name: str, tmp_path: Path) -> None:
    """A key of the file is given, follows from what is given, or is listed with its value."""
    sheet = SHEETS[name]
    _, draft = _entered(sheet, tmp_path)
    file = tomllib.loads((tmp_path / "own" / "study.toml").read_text())
    listed = "\n".join(draft.assumed)
    del file["assumed"]  # lists keys of other tables
    for section, table in file.items():
        for key, value in table.items() if isinstance(table, dict) else ():
            dotted = f"{section}.{key}"
            if dotted not in draft.values:
                texts = f"{dotted} = {toml_value(value)}", f"{dotted} {value}"
                assert any(text in listed for text in texts), dotted
    # No range of the search leaves out the own dog.
    assert not any(warning.startswith("variables.") for warning in draft.warnings)


@pytest.mark.parametrize("name", SHEETS)
def test_pull_out_by_hand(name: str, tmp_path: Path) -> None:
    """T/r tan(rho - side angle) of the worse flank and mu_t T/r_t of the toothing."""
    sheet = SHEETS[name]
    study, _ = _entered(sheet, tmp_path, **TOOTHING)
    pull_out = _values(study)["pull_out_force"]
    assert pull_out == pytest.approx(sheet.pull_out, rel=2e-3)
    load, dog = study.limits.load, study.clutch.dog
    torque = load.pull_out_share * load.torque
    flank = math.tan(math.atan(0.12) - min(dog.traction, dog.braking))
    by_hand = torque * (flank / dog.mean_radius + 0.10 / load.spline_radius)
    assert pull_out == pytest.approx(by_hand, rel=1e-6)


@pytest.mark.parametrize("name", [name for name in SHEETS if SHEETS[name].shear])
def test_shear_by_hand(name: str, tmp_path: Path) -> None:
    """1.5 F/(b s); the share K_s of the most loaded dog follows the stiffness of the dogs.

    F = K_A T/(r N K_s). Dogs as soft as by finite elements share the torque better.
    """
    sheet = SHEETS[name]
    soft, _ = _entered(sheet, tmp_path)
    study, _ = _entered(sheet, tmp_path, **_stiff_dogs(soft))
    assert _values(study)["shear_stress"] == pytest.approx(sheet.shear, rel=0.01)
    assert _values(soft)["shear_stress"] < 0.83 * _values(study)["shear_stress"]


@pytest.mark.parametrize("name", [name for name in SHEETS if SHEETS[name].flight])
def test_free_flight_by_hand(name: str, tmp_path: Path) -> None:
    """x = F T²/m (s⁴/4 - s⁵/10) over the gap, in closed form and by the compiled engine.

    Without drag: it rubs in the toothing, mu_t T/r_t = 3.6 N of the rally ring, 0.2 ms.
    """
    sheet = SHEETS[name]
    study, _ = _entered(sheet, tmp_path, **{"mechanism.drag_torque_Nm": 0.0})
    gap, profile = study.clutch.dog.axial_gap, study.points[0].profile
    time = profile.free_flight_time(gap, study.clutch.rings.mass)
    assert time == pytest.approx(sheet.flight, rel=5e-3)
    share = time / profile.rise
    by_hand = profile.force * profile.rise**2 / study.clutch.rings.mass
    assert by_hand * (share**4 / 4 - share**5 / 10) == pytest.approx(gap, rel=1e-6)
    shift = engage(PlanarClutch(study.clutch.with_engine("planar")), study.points[0], 0.0)
    flown = shift.phases[0]
    assert flown.end - flown.start == pytest.approx(time, rel=2e-3)


def test_direct_share_of_the_disconnect_by_hand(tmp_path: Path) -> None:
    """(h (tan beta + tan gamma) + j)/pitch is 14.0 % at the mean radius, 13.6 % at the outer one.

    The flanks of a dog are planes, so that their play is the same length at each radius, and the
    backlash the same angle: the window is least at the outer end.
    """
    study, _ = _entered(SHEETS["electric disconnect"], tmp_path)
    dog = study.clutch.dog
    lean = dog.height * (math.tan(5.0 * DEG) + math.tan(5.0 * DEG))
    pitch = dog.pitch_angle * dog.mean_radius
    assert (lean + dog.backlash) / pitch == pytest.approx(0.1404, rel=1e-3)
    at_end = (lean * dog.mean_radius / dog.outer_radius + dog.backlash) / pitch
    found = ds.Study(tmp_path / "own").expect(mismatch_rpm=0.5, force_N=180.0, angles=3)
    share = found.to_dict()["points"][0]["shiftability"]["direct_closed_form"]
    assert share == pytest.approx(at_end, rel=5e-3)


def test_strike_of_the_rally_ring_by_hand(tmp_path: Path) -> None:
    """Δω sqrt(k J) over the radius, 332 kN with dogs of 25 N/(mm um)."""
    sheet = SHEETS["rally gear"]
    soft, _ = _entered(sheet, tmp_path)
    study, _ = _entered(sheet, tmp_path, **_stiff_dogs(soft))
    dog, (strike,) = study.clutch.dog, study.limits.strikes
    assert strike.speed("traction") == pytest.approx(900 * RPM)
    torque = strike_torque(dog, study.limits, strike, "traction")
    assert torque / dog.mean_radius == pytest.approx(332e3, rel=0.02)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"mechanism.spline_radius_mm": 65.0}, "outside the dogs"),
        ({"sliding.inertia_kgm2": 5e-5}, "a ring of sliding.mass_kg"),
        ({"load.shifts": 5.0}, "is it in shifts?"),
    ],
)
def test_a_slip_in_the_sheet_is_asked(more: dict[str, float], words: str, tmp_path: Path) -> None:
    _, draft = _entered(SHEETS["truck sleeve"], tmp_path, **more)
    assert words in "\n".join(draft.warnings)
