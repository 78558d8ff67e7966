"""Sign of the mismatch (``docs/scope.md``), and how likely dogs enter a slot: closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.framework import Context, EventStatus

from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Rings
from dogshape.sim.shift.conclusion import Outcome, engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, MM, RPM


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
def test_positive_mismatch_closes_the_traction_flanks(heavy: Clutch, mismatch_rpm: float) -> None:
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


@pytest.mark.parametrize(
    ("mismatch_rpm", "change"),
    [
        *((100.0, {}), (-100.0, {}), (250.0, {}), (400.0, {})),
        *((100.0, {"backlash": 0.6e-3}), (-250.0, {"backlash": 1.2e-3})),
        (-100.0, {"traction": -4 * DEG, "braking": -3 * DEG, "backlash": 1.5e-3}),
    ],
)
def test_kinematic_entry_without_touching(
    clutch: Clutch, mismatch_rpm: float, change: dict[str, float]
) -> None:
    r"""Flat faces at 0.2 m/s, 0.5 mm deep: P = (N/2 pi)(Phi - |dw| x/v - x tan/r).

    The last term is the lean of the flank that is run towards, nothing of an undercut one; the
    other one is run away from faster than it closes. Phi is the angle of the backlash and the lean
    of both flanks over the radius. At the mean radius and without the last term the prototype has
    0.164 at 100 1/min and a limit of 363 1/min. Leans are lengths, the same all along the dog: the
    outer end has the least angle of them, the inner one the most undercut.
    """
    depth, speed = 0.5e-3, 0.2
    heavy = replace(clutch, rings=HEAVY, dog=replace(clutch.dog, chamfer=0.0, **change))
    dog, plant = heavy.dog, ClutchPlant(heavy)
    swept = abs(mismatch_rpm) * RPM * depth / speed
    if mismatch_rpm == 100.0 and not change:
        simple = (dog.entry_play / dog.mean_radius - swept) / dog.pitch_angle
        assert simple == pytest.approx(0.164, abs=5e-4)
    lean = max(0.0, math.tan(dog.traction if mismatch_rpm > 0 else dog.braking)) * depth
    leans = dog.height * dog.lean - lean
    free = dog.backlash_angle + leans / (dog.outer_radius if leans > 0.0 else dog.inner_radius)
    exact = max(0.0, (free - swept) / dog.pitch_angle)
    angles = (np.arange(300) + 0.5) / 300 * dog.pitch_angle
    start, until = dog.axial_gap - 1e-9, depth / speed
    touched = [first_touch(plant, (a, start), mismatch_rpm * RPM, speed, until) for a in angles]
    assert np.mean([one is None for one in touched]) == pytest.approx(exact, abs=1.5 / 300)


def test_chamfered_dogs_enter_by_themselves_in_what_their_tips_leave(clutch: Clutch) -> None:
    """Without mismatch, until the edges of both flanks have passed: play over pitch.

    Angle of the backlash and ``D (tan(beta) + tan(gamma))/r`` with ``D = h - 2 d``, *d* the larger
    depth of both edges, at the outer radius, where it is least.
    """
    for change in (
        {},
        {"crest": 0.4, "chamfer": 14 * DEG, "chamfer_back": 9 * DEG},
        {"crest": 0.6, "chamfer": 16 * DEG, "chamfer_back": 16 * DEG, "backlash": 0.7e-3},
        {"crest": 0.0, "chamfer": 0.0, "chamfer_back": 10 * DEG, "backlash": 0.3e-3},
    ):
        dog = replace(clutch.dog, **change)
        drop = max(dog.drops_at(dog.outer_radius))
        leans = (dog.height - 2.0 * drop) * dog.lean / dog.outer_radius
        exact = (dog.backlash_angle + leans) / dog.pitch_angle
        plant = ClutchPlant(replace(clutch, dog=dog, rings=HEAVY))
        angles = (np.arange(200) + 0.5) / 200 * dog.pitch_angle
        start, until = dog.axial_gap - 1e-9, (2.0 * drop + 1e-5) / 0.2
        touched = [first_touch(plant, (a, start), 1e-9, 0.2, until) for a in angles]
        assert np.mean([one is None for one in touched]) == pytest.approx(exact, abs=1.5 / 200)


@pytest.mark.parametrize(
    ("mismatch_rpm", "published"), [(5.0, 0.233), (10.0, 0.250), (25.0, 0.370), (50.0, 0.797)]
)
def test_rectangular_dogs_engage_as_often_as_in_bokas_form(
    clutch: Clutch, mismatch_rpm: float, published: float
) -> None:
    """P = min(1, (Phi + J dw2/(2 mu F r))/pitch): slide until friction has used up the mismatch.

    Constant 235 N, friction 0.10. Thirty evenly spaced angles resolve a thirtieth. What does
    not engage stands still, dog on dog.
    """
    flat, force = replace(clutch, dog=replace(clutch.dog, chamfer=0.0)), 235.0
    dog, friction = flat.dog, flat.contact.dynamic_friction
    slide = flat.rings.reduced_inertia * (mismatch_rpm * RPM) ** 2
    slide /= 2.0 * friction * force * dog.mean_radius
    exact = min(1.0, (dog.entry_play / dog.mean_radius + slide) / dog.pitch_angle)
    assert exact == pytest.approx(published, abs=1e-3)
    plant = ClutchPlant(flat)
    point = OperatingPoint(mismatch_rpm * RPM, ForceProfile(force, 1e-3))
    results = [engage(plant, point, (k + 0.37) / 30 * 24 * DEG) for k in range(30)]
    assert {r.outcome for r in results} <= {Outcome.ENGAGED, Outcome.BLOCKED}
    share = np.mean([r.outcome is Outcome.ENGAGED for r in results])
    assert share == pytest.approx(exact, abs=1.6 / 30)
