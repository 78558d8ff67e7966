"""How likely dogs enter a slot: closed forms of kinematics and of Coulomb friction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Rings
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, RPM
from tests.verification.test_mismatch import first_touch


def _flat(clutch: Clutch) -> Clutch:
    return clutch.with_dog(replace(clutch.dog, chamfer=0.0))


@pytest.mark.parametrize("mismatch_rpm", [100.0, -100.0, 250.0, 400.0])
def test_kinematic_entry_without_touching(clutch: Clutch, mismatch_rpm: float) -> None:
    r"""Flat faces at 0.2 m/s, 0.5 mm deep: P = (N/2 pi)(Phi - |dw| x/v - x tan/r).

    The last term is the lean of the flank that is run towards; the other one is
    run away from faster than it closes. At the mean radius and without that term the
    prototype has 0.164 at 100 1/min and a limit of 363 1/min. Play and lean are
    lengths, the same all along the dog, so the outer end has the least angle.
    """
    depth, speed = 0.5e-3, 0.2
    heavy = replace(_flat(clutch), rings=Rings(mass=50.0, sliding_inertia=0.01, output_inertia=0.6))
    dog, plant = heavy.dog, ClutchPlant(heavy)
    swept = abs(mismatch_rpm) * RPM * depth / speed
    if mismatch_rpm == 100.0:
        simple = (dog.entry_play / dog.mean_radius - swept) / dog.pitch_angle
        assert simple == pytest.approx(0.164, abs=5e-4)
    lean = math.tan(dog.traction if mismatch_rpm > 0 else dog.braking) * depth
    free = (dog.entry_play - lean) / dog.outer_radius
    exact = max(0.0, (free - swept) / dog.pitch_angle)
    angles = (np.arange(300) + 0.5) / 300 * dog.pitch_angle
    start, until = dog.axial_gap - 1e-9, depth / speed
    share = np.mean(
        [first_touch(plant, (a, start), mismatch_rpm * RPM, speed, until) is None for a in angles]
    )
    assert share == pytest.approx(exact, abs=1.5 / 300)


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
    flat, force = _flat(clutch), 235.0
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
