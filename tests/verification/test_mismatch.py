"""What the sign of the mismatch means: which flanks meet, and whether faces fall away.

``docs/mismatch.md`` defines it; either test fails with the other sign.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from pydrake.systems.framework import Context, EventStatus

from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Rings
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import MM, RPM


def first_touch(
    plant: ClutchPlant, place: tuple[float, float], mismatch: float, speed: float, until: float
) -> tuple[float, float] | None:
    """Run from angle and displacement with the sliding ring not turning.

    Return time and angle at the first touch, None before ``until`` in s.
    """
    angle, way = place
    simulator = plant.start(OperatingPoint(mismatch, ForceProfile(1.0, 10.0)), angle)
    plant.plant.SetPositions(plant.plant_context, [angle, way, 0.0])
    output, _, sliding = plant.plant.GetVelocities(plant.plant_context)
    plant.plant.SetVelocities(plant.plant_context, [output, speed, sliding])
    simulator.Initialize()
    found = []

    def watch(context: Context) -> EventStatus | None:
        state = plant.state()
        if abs(state[5]) > 1e-9 or state[4] < 0.999 * speed:
            found.append((context.get_time(), float(state[0])))
            return EventStatus.ReachedTermination(plant.plant, "touched")
        return None

    simulator.set_monitor(watch)
    simulator.AdvanceTo(until)
    return found[0] if found else None


#: Rings of which the sliding one keeps its axial speed.
HEAVY = Rings(mass=50.0, sliding_inertia=0.01, output_inertia=0.6)


@pytest.fixture
def heavy(clutch: Clutch) -> Clutch:
    """The prototype with such rings."""
    return replace(clutch, rings=HEAVY)


@pytest.mark.parametrize("mismatch_rpm", [5.0, -5.0])
def test_positive_mismatch_runs_the_traction_flanks_together(
    heavy: Clutch, mismatch_rpm: float
) -> None:
    """From the middle of the slot, a way d before the end, a flank is d tan(its angle) away.

    The traction flanks lean by 12 degrees, the braking ones by 22. Play and lean are lengths, the
    same all along the dog, so the outer end has the least angle.
    """
    dog, left = heavy.dog, 1.0 * MM
    middle = 0.5 * dog.pitch_angle
    flank = dog.traction if mismatch_rpm > 0.0 else dog.braking
    apart = left * math.tan(flank) / dog.outer_radius
    place = (middle, dog.travel - left)
    found = first_touch(ClutchPlant(heavy), place, mismatch_rpm * RPM, 1e-9, 0.1)
    assert found is not None
    assert found[1] - middle == pytest.approx(math.copysign(apart, mismatch_rpm), rel=0.03)


@pytest.mark.parametrize(("mismatch_rpm", "touches"), [(60.0, False), (-60.0, True)])
def test_faces_fall_away_from_each_other_at_positive_mismatch(
    heavy: Clutch, mismatch_rpm: float, touches: bool
) -> None:
    """Where |dw| r tan(chamfer) exceeds the axial speed, they never touch; else they close."""
    dog, speed, apart = heavy.dog, 0.01, 0.1 * MM
    assert 60.0 * RPM * dog.mean_radius * math.tan(dog.chamfer) > 2.0 * speed
    overlap = kernel.face_overlap(0.0, heavy.numbers)
    place = (0.0, dog.axial_gap + overlap * math.tan(dog.chamfer) - apart)
    # For as long as the faces stand opposite each other.
    until = 0.5 * dog.face_width / (60.0 * RPM * dog.mean_radius)
    assert speed * until > apart  # by its axial way alone the ring would touch
    found = first_touch(ClutchPlant(heavy), place, mismatch_rpm * RPM, speed, until)
    assert (found is not None) is touches
    if found is not None:
        closing = speed + 60.0 * RPM * dog.outer_radius * math.tan(dog.chamfer)
        # Faces that are turned against each other touch sooner, at their ends.
        assert 0.2 * apart < closing * found[0] < apart
