"""Own clutches of four kinds, from data-sheet numbers: each ends in a usable answer."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.drafts.study_folder import write_study


def _points(mismatch_rpm: list[float], force_N: float, rise_s: float) -> dict[str, Any]:
    return {
        "operating.mismatch_rpm": mismatch_rpm, "operating.force_N": force_N,
        "actuation.force_N": force_N, "actuation.rise_s": rise_s,
    }  # fmt: skip


def _ring(count: int, outer: float, inner: float, height: float, side: float) -> dict[str, Any]:
    return {
        "dog.count": count, "dog.outer_diameter_mm": outer, "dog.inner_diameter_mm": inner,
        "dog.height_mm": height, "dog.traction_deg": side, "dog.braking_deg": side,
    }  # fmt: skip


#: The bundled study to begin with, and the numbers of a data sheet.
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "motorcycle": ("motorcycle", {
        **_ring(6, 58.0, 40.0, 4.0, -3.0), **_points([200.0, 400.0, -200.0], 200.0, 0.04),
        "dog.backlash_deg": 20.0, "load.torque_Nm": 90.0, "sliding.mass_kg": 0.3,
    }),
    "truck": ("amt", {
        **_ring(30, 140.0, 120.0, 6.0, 8.0), **_points([30.0, 60.0, -40.0], 900.0, 0.1),
        "load.torque_Nm": 2600.0, "sliding.mass_kg": 3.2, "output.inertia_kgm2": 40.0,
    }),
    "electric disconnect": ("ev_disconnect", {
        **_ring(40, 110.0, 96.0, 3.0, 8.0), **_points([-15.0, -5.0, 5.0, 15.0], 400.0, 0.02),
        "load.torque_Nm": 1600.0, "sliding.mass_kg": 0.9, "sliding.inertia_kgm2": 0.35,
    }),
    # Engaged at standstill or nearly so, by a weak actuator.
    "differential lock": ("mq200", {
        **_ring(12, 96.0, 70.0, 6.0, 10.0), **_points([-10.0, -3.0, 3.0, 10.0], 250.0, 0.05),
        "dog.chamfer_deg": 9.0, "dog.backlash_deg": 1.0, "load.torque_Nm": 1800.0,
        "sliding.mass_kg": 0.7, "sliding.inertia_kgm2": 0.3, "output.inertia_kgm2": 3.0,
        "load.pull_out_share": 0.05,
    }),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_an_own_clutch_ends_in_a_usable_answer(kind: str, tmp_path: Path) -> None:
    """Between the free flight and that with the time in which two pitches pass by."""
    name, keys = KINDS[kind]
    assumed = write_study(tmp_path / "own", name, keys).assumed
    assert assumed[0].startswith(f"as in '{name}', decides the shift time: shift.timeout_s = 1.0")
    study = ds.Study(tmp_path / "own")
    found, load = study.check(), study.config.limits.load
    clutch, points = study.config.clutch, study.config.points
    mass = clutch.rings.mass + clutch.mechanism.added_mass
    flights = [p.profile.free_flight_time(clutch.shift_travel, mass) for p in points]
    passes = [min(2.0 * clutch.dog.pitch_angle / abs(p.mismatch), clutch.timeout) for p in points]
    free, longest = (sum(times) / len(points) for times in (flights, passes))
    assert found.time_s is not None
    assert free < found.time_s < free + longest
    assert found.engaged > 0.9
    checks = {check.name: check for check in found.design.checks}
    assert {"pull_out_force", "root_fatigue", "face_pressure_impact", "clearance"} <= checks.keys()
    assert all(math.isfinite(check.margin) for check in checks.values())
    # What latch or detent hold is not known: the force is printed, and not judged by itself.
    assert load.separating_force_limit is None
    assert "retention_traction" not in checks
    printed = "\n".join(part for part in found.to_parts() if isinstance(part, str))
    assert f"has to hold {found.blocking_force_N:.0f} N" in printed
    assert "each costs shift.timeout_s and shift.retraction_s, 1.2 s" in printed
    for check in found.design.faults:
        assert f"{check.name}: {check.fault}; {check.remedy}" in printed
        assert check.rule.key in check.remedy
