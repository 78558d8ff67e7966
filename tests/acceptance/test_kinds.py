"""Kinds of clutches: each has a plausible time and every check that its keys ask for."""

from __future__ import annotations

import math
from typing import Any

import pytest

import dogshape as ds

#: An axle's differential lock: 12 dogs, engaged at standstill or nearly so, by a weak actuator.
LOCK: dict[str, Any] = {
    "dog.count": 12, "dog.chamfer_deg": 9.0, "dog.traction_deg": 8.0, "dog.braking_deg": 8.0,
    "dog.height_mm": 6.0, "dog.outer_diameter_mm": 90.0, "dog.inner_diameter_mm": 70.0,
    "dog.backlash_mm": 0.5, "sliding.mass_kg": 0.8, "sliding.inertia_kgm2": 0.05,
    "output.inertia_kgm2": 4.0, "mechanism.spline_radius_mm": 28.0,
    "operating": {"mismatch_rpm": [-10.0, -2.0, 2.0, 10.0], "force_N": [235.2, 315.5]},
    "load.torque_Nm": 900.0, "load.pull_out_share": 0.1,
}  # fmt: skip
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "motorcycle": ("motorcycle", {}),
    "truck": ("amt", {}),
    "electric disconnect": ("ev_disconnect", {}),
    "differential lock": ("mq200", LOCK),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_clutch_has_a_plausible_answer(kind: str) -> None:
    """Between the free flight and that with the time in which two pitches pass by."""
    name, keys = KINDS[kind]
    study = ds.Study(name, keys)
    found = study.check()
    clutch, points = study.config.clutch, study.config.points
    mass = clutch.rings.mass + clutch.mechanism.added_mass
    weights = [point.weight / sum(p.weight for p in points) for point in points]
    flights = [p.profile.free_flight_time(clutch.shift_travel, mass) for p in points]
    passes = [min(2.0 * clutch.dog.pitch_angle / abs(p.mismatch), clutch.timeout) for p in points]
    free, longest = (
        sum(w * t for w, t in zip(weights, times, strict=True)) for times in (flights, passes)
    )
    assert found.time_s is not None
    assert free < found.time_s < free + longest
    assert found.engaged > 0.9
    names = {check.name for check in found.design.checks}
    assert {"pull_out_force", "root_fatigue", "face_pressure_impact", "clearance"} <= names
    assert all(math.isfinite(check.margin) for check in found.design.checks)
    assert found.blocking_force_N == 0.0 or kind != "motorcycle"
