"""One shift: its words, whether it is converged, and within the checked range."""

from __future__ import annotations

from typing import Any

import pytest

import dogshape as ds

COMPILED = {"solver.engine": "planar"}
PLAY = {
    **COMPILED,
    "mechanism.ring_inertia_kgm2": 0.002,
    "mechanism.input_stiffness_Nm_rad": 5000,
    "mechanism.spline_backlash_deg": 0.3,
}
TWO_SHAFTS = {
    **PLAY, "mechanism.wheel_inertia_kgm2": 0.05, "mechanism.output_stiffness_Nm_rad": 3000
}  # fmt: skip


@pytest.mark.parametrize(
    ("settings", "speed", "angle"),
    [(PLAY, -249.0, 1.0), (TWO_SHAFTS, -249.0, 7.0), (COMPILED, -900.0, 7.0)],
    ids=["play", "two shafts", "fast"],
)
def test_a_shift_says_whether_finer_steps_move_it(
    settings: dict[str, Any], speed: float, angle: float
) -> None:
    study = ds.Study("mq200_paper", settings)
    found = study.shift(mismatch_rpm=speed, force_N=469, angle_deg=angle)
    assert found.engagement.events.slots_skipped + found.engagement.events.face_contacts > 1
    assert found.to_dict()["solver"]["converged"] is found.converged
    moved = abs((found.refined.shift_time or 1.0) / (found.time_s or 1.0) - 1.0)
    assert found.converged is (moved <= 0.01)
    assert any("not converged: engaged in" in one for one in found.warnings) is not found.converged


@pytest.mark.parametrize(
    ("speed", "force", "words"),
    [
        (1000.0, 3000.0, []),
        (-1500.0, 4000.0, ["mismatch of 1500", "shift force of 4000 N is beyond 3000 N"]),
    ],
)
def test_a_shift_beyond_the_checked_range_says_so(
    speed: float, force: float, words: list[str]
) -> None:
    study = ds.Study("mq200_paper", COMPILED)
    found = study.shift(mismatch_rpm=speed, force_N=force, angle_deg=10, force_rise_s=0.05)
    said = [one for one in found.to_dict()["warnings"] if "beyond" in one]
    assert all(word in one for one, word in zip(said, words, strict=True))


@pytest.mark.parametrize(
    ("settings", "engine", "accuracy"),
    [
        ({}, "drake", 1e-7),
        ({"contact.set": "adams_impact"}, "planar", 1e-4),
        ({"mechanism.compliance_mm_kN": 0.3}, "planar", 1e-4),
        ({"mechanism.compliance_mm_kN": 0.3, "solver.engine": "drake"}, "drake", 1e-9),
        ({"mechanism.compliance_mm_kN": 0.3, "solver.accuracy": 1e-8}, "planar", 1e-8),
    ],
)
def test_forces_of_a_mechanism_with_two_coefficients_and_impact_are_the_compiled_engines(
    settings: dict[str, Any], engine: str, accuracy: float
) -> None:
    solver = ds.Study("mq200_paper", {"contact.set": "adams2019", **settings}).config.clutch.solver
    assert (solver.engine, solver.accuracy) == (engine, accuracy)
