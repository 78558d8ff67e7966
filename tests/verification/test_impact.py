"""One impact of face on face against its closed form, and the laws of Adams as IMPACT has them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.framework import Context
from scipy.special import beta

from dogshape.sim import kernel
from dogshape.sim.kernel_layout import (
    AXIAL_SPEED,
    DISPLACEMENT,
    STATE_SIZE,
    STEP_MODE,
    StepLimits,
    shift_model,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import (
    CONTACT_SETS,
    Clutch,
    ContactSet,
    ImpactLaw,
    OperatingPoint,
    Solver,
    contact_set,
)
from dogshape.sim.shift.mesh import rigid_dog
from dogshape.sim.shift.planar import NO_LOOK, PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, RPM
from dogshape.validation.impact import Impact, impact, published_impact

ADAMS = contact_set("adams_impact")
DRAKES = sorted(name for name, one in CONTACT_SETS.items() if one.impact is None)


def flat_dogs(clutch: Clutch, contact: ContactSet) -> Clutch:
    """Rectangular dogs of equal side angles: at zero angle face lies on face all over."""
    dog = replace(clutch.dog, chamfer=0.0, traction=15 * DEG, braking=15 * DEG)
    fine = Solver(accuracy=1e-7, max_step=1e-6)
    return replace(clutch, dog=dog, contact=contact, solver=fine)


def face_area(clutch: Clutch) -> float:
    mesh = rigid_dog(clutch.dog)
    a, b, c = np.moveaxis(mesh.vertices[mesh.cells[2:4]], 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def _simulated(clutch: Clutch, speed: float) -> tuple[float, float, float]:
    """Throw the ring at the other; return penetration, restitution, time in contact."""
    plant = ClutchPlant(clutch)
    point = OperatingPoint(0.0, ForceProfile(1.0, 10.0))
    simulator = plant.start(point, 0.0)
    gap = clutch.dog.axial_gap
    plant.plant.SetPositions(plant.plant_context, [0.0, gap - 1e-9, 0.0])
    plant.plant.SetVelocities(plant.plant_context, [0.0, speed, 0.0])
    simulator.Initialize()
    seen: list[tuple[float, float, float]] = []

    def watch(context: Context) -> None:
        state = plant.state()
        seen.append((context.get_time(), state[1] - gap, state[4]))

    simulator.set_monitor(watch)
    simulator.AdvanceTo(4.0 * impact(clutch.contact, face_area(clutch), 0.02, speed).duration)
    time, depth, rate = np.array(seen).T
    inside = depth > 0.0
    return float(depth.max()), float(-rate[-1] / speed), float(np.ptp(time[inside]))


@pytest.mark.parametrize("name", DRAKES)
@pytest.mark.parametrize("speed", [0.05, 0.4])
def test_single_impact_against_the_closed_form(clutch: Clutch, name: str, speed: float) -> None:
    """Penetration, restitution and duration of one dog's share of the ring to 1 %."""
    flat = flat_dogs(clutch, CONTACT_SETS[name])
    exact = impact(flat.contact, face_area(flat), clutch.rings.mass / 15, speed)
    depth, restitution, duration = _simulated(flat, speed)
    assert depth == pytest.approx(exact.penetration, rel=0.01)
    assert restitution == pytest.approx(exact.restitution, rel=0.01)
    assert duration == pytest.approx(exact.duration, rel=0.01)


def test_closed_form_has_its_limits() -> None:
    """Without dissipation half a period of a spring; restitution 1 - 2/3 d v and 1/(d v)."""
    soft = ContactSet("soft", 0.0, 0.0, 1e-3, 1e12, 1e-2)
    area, mass, speed = 1e-5, 0.02, 0.3
    rate = math.sqrt(1e12 * area / mass)
    result = impact(soft, area, mass, speed)
    assert result.penetration == pytest.approx(speed / rate, rel=2e-3)
    assert result.duration == pytest.approx(math.pi / rate, rel=1e-4)
    assert 1 - result.restitution == pytest.approx(2 / 3 * 1e-2 * speed, rel=3e-3)
    dead = replace(soft, dissipation=1e3)
    assert impact(dead, area, mass, speed).restitution == pytest.approx(1 / 300, rel=0.01)


def test_adams_set_stops_an_impact_where_the_published_contact_does() -> None:
    """A dog's share of the ring at 0.2 m/s: the damper decides, whatever the unit of K.

    Penetration within 20 %, next to no restitution in both.
    """
    ours = impact(CONTACT_SETS["adams2019"], 12.6e-6, 0.02, 0.2)
    for stiffness in (1e8, 3.16e9):
        theirs = published_impact(ImpactLaw(stiffness), 0.02, 0.2)
        assert ours.penetration == pytest.approx(theirs.penetration, rel=0.2)
        assert theirs.restitution < 0.12
    assert ours.restitution == pytest.approx(0.05, abs=0.01)


def _bounced(clutch: Clutch, law: ImpactLaw, speed: float) -> Impact:
    """Throw the compiled ring at the other, flat face on flat face, until it flies back."""
    flat = flat_dogs(clutch, replace(ADAMS, impact=law)).with_engine("planar")
    plant, gap = PlanarClutch(flat), flat.dog.axial_gap
    state = np.zeros(STATE_SIZE)
    times, states = np.empty(30_000), np.empty((30_000, STATE_SIZE))
    state[DISPLACEMENT], state[AXIAL_SPEED] = gap, speed
    knots = ForceProfile(1.0, 10.0).knots
    progress = kernel.advance(
        0.0,
        1e-7,
        state,
        look_state=NO_LOOK,
        pause=0.02,
        timeout=0.02,
        model=shift_model(flat.numbers, knots, plant.surfaces, plant.law),
        limits=StepLimits(speed_error=1e-6, place_error=1e-12, max_step=1e-6),
        mode=np.zeros(1, STEP_MODE),
        times=times,
        states=states,
    )
    time = times[: progress.recorded]
    depth = states[: progress.recorded, DISPLACEMENT] - gap
    out = int(np.argmax(depth < 0.0))
    share = depth[out - 1] / (depth[out - 1] - depth[out])
    end = float(time[out - 1] + share * (time[out] - time[out - 1]))
    return Impact(float(depth.max()), -float(states[out, AXIAL_SPEED]) / speed, end)


@pytest.mark.parametrize("speed", [0.05, 0.4])
def test_bounce_on_impact_against_an_independent_integration(clutch: Clutch, speed: float) -> None:
    """A dog's share of the ring: penetration, restitution and time in contact to 0.2 %."""
    found = _bounced(clutch, ImpactLaw(), speed)
    exact = published_impact(ImpactLaw(), clutch.rings.mass / clutch.dog.count, speed)
    assert 0.0 < exact.restitution < 0.02
    for name in ("penetration", "restitution", "duration"):
        assert getattr(found, name) == pytest.approx(getattr(exact, name), rel=2e-3)


def test_undamped_bounce_on_impact_in_closed_form(clutch: Clutch) -> None:
    """d^2.5 = 5 m v^2 / 4 K, and time 4 d / 5 v B(2/5, 1/2); all of the speed comes back."""
    law, mass, speed = ImpactLaw(damping=0.0), clutch.rings.mass / clutch.dog.count, 0.2
    found = _bounced(clutch, law, speed)
    deepest = (1.25 * mass * speed**2 / law.stiffness) ** 0.4
    assert found.penetration == pytest.approx(deepest, rel=1e-3)
    assert found.restitution == pytest.approx(1.0, abs=1e-4)
    time = 0.8 * deepest / speed * float(beta(0.4, 0.5))
    assert found.duration == pytest.approx(time, rel=1e-3)


def test_friction_of_adams_at_its_knots(clutch: Clutch) -> None:
    """Zero at rest, static at 0.1 m/s, dynamic from 1 m/s; cubic steps with level ends between."""
    law = PlanarClutch(replace(clutch, contact=ADAMS)).law
    for slip, coefficient in (
        (0.0, 0.0), (0.05, 0.30 * 0.6875), (0.1, 0.30), (0.55, 0.23), (1.0, 0.16), (5.0, 0.16),
    ):  # fmt: skip
        assert kernel.impact_friction_at(slip, law) == pytest.approx(coefficient, abs=1e-12)
    for knot in (0.1, 1.0):
        sides = [kernel.impact_friction_at(knot + side, law) for side in (-1e-6, 0.0, 1e-6)]
        assert np.ptp(sides) < 1e-9


@pytest.mark.parametrize(("stiffness", "force"), [(1e8, 20.0), (1e11, 641.5)])
def test_faces_creep_where_the_friction_of_adams_is_the_chamfer(
    clutch: Clutch, stiffness: float, force: float
) -> None:
    """mu(v) = tan alpha: v = 2 v_s sin(asin(tan alpha / mu_s) / 3), 32 mm/s whatever the force.

    Narrow rings, whose contact is at the mean radius, and a light one, which is soon as fast. Deep
    overlaps of the soft law reach round the crest; a light force or a stiff law keeps them flat.
    """
    dog = replace(clutch.dog, outer_diameter=48.5e-3, inner_diameter=47.5e-3)
    rings = replace(clutch.rings, sliding_inertia=1e-5)
    law = replace(ADAMS, impact=ImpactLaw(stiffness))
    own = replace(clutch, dog=dog, rings=rings, contact=law).with_engine("planar")
    creep = 0.2 * math.sin(math.asin(math.tan(8 * DEG) / 0.30) / 3.0)
    found = engage(own, OperatingPoint(5 * RPM, ForceProfile(force, 0.01)), 4 * DEG)
    (slide,) = (one for one in found.phases if one.name == "face contact")
    middle = np.searchsorted(found.trace.time, 0.5 * (slide.start + slide.end))
    slip = found.trace.relative_speed[middle] * dog.mean_radius / math.cos(8 * DEG)
    assert slip == pytest.approx(creep, rel=5e-3)
