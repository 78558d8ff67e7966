"""What must not change when the description of a shift does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dogshape.sim.shift.mesh
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import Mesh
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, UNITS, from_si, to_si, unit_of
from tests.conftest import Point


@pytest.mark.parametrize("pitches", [1, 7, -3])
def test_a_whole_pitch_changes_nothing(plant: ClutchPlant, point: Point, pitches: int) -> None:
    pitch = plant.clutch.dog.pitch_angle
    here = engage(plant, point(50, 469.0), 4 * DEG)
    there = engage(plant, point(50, 469.0), 4 * DEG + pitches * pitch)
    assert here.shift_time == pytest.approx(there.shift_time, rel=1e-5)


def _mirrored(make: Callable[[Dog], Mesh]) -> Callable[[Dog], Mesh]:
    """Reflect what a mesh function makes in the plane of the axis and the x direction."""

    def reflected(dog: Dog) -> Mesh:
        mesh = make(dog)
        cells = mesh.cells.copy()
        cells[:, [0, 1]] = cells[:, [1, 0]]  # a reflection turns every cell inside out
        return Mesh(mesh.vertices * [1.0, -1.0, 1.0], cells)

    return reflected


@pytest.mark.parametrize(("mismatch", "angle"), [(10, 14), (50, 3), (-50, 18), (149, 9)])
def test_mirrored_rings_and_mismatch_give_the_mirrored_motion(
    clutch: Clutch, point: Point, monkeypatch: pytest.MonkeyPatch, mismatch: float, angle: float
) -> None:
    """Same displacement, opposite angles and speeds; same events.

    Mirrored meshes are no dogs of the clutch, in whose sections steps are looked at.
    """
    monkeypatch.setattr("dogshape.sim.shift.conclusion.MAX_MISSED_OVERLAP_M", np.inf)
    here = engage(ClutchPlant(clutch), point(mismatch, 469.0), angle * DEG)
    for name in ("rigid_dog", "compliant_dog"):
        mirrored = _mirrored(getattr(dogshape.sim.shift.mesh, name))
        monkeypatch.setattr(f"dogshape.sim.shift.plant.{name}", mirrored)
    there = engage(ClutchPlant(clutch), point(-mismatch, 469.0), -angle * DEG)
    assert here.shift_time == pytest.approx(there.shift_time, rel=1e-4)
    seen = np.linspace(0.0, 0.9 * here.trace.time[-1], 50)
    for name, sign in (("displacement", 1), ("relative_angle", -1), ("relative_speed", -1)):
        one = np.interp(seen, here.trace.time, getattr(here.trace, name))
        other = np.interp(seen, there.trace.time, getattr(there.trace, name))
        assert one == pytest.approx(sign * other, abs=2e-3 * np.abs(one).max())


@given(st.sampled_from(sorted(UNITS)), st.floats(-1e6, 1e6))
def test_units_go_there_and_back(suffix: str, value: float) -> None:
    name = f"quantity{suffix}"
    assert from_si(name, to_si(name, value)) == pytest.approx(value, rel=1e-12, abs=1e-300)
    assert bool(unit_of(name)) == bool(suffix)


def test_units_of_names() -> None:
    assert to_si("height_mm", 3.7) == pytest.approx(3.7e-3)
    assert to_si("mismatch_rpm", 60.0) == pytest.approx(6.283185307)
    assert to_si("stiction_velocity_m_s", 2.0) == 2.0
    assert to_si("count", 15) == 15
    assert unit_of("proof_stress_MPa") == "MPa"
