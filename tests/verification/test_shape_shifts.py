"""Shifts of dogs with a ridge, backlash and undercut: both engines, mirror images, play."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, MM
from tests.conftest import Point
from tests.verification.test_planar import force_of
from tests.verification.test_shapes import ALL, ROOFS, SHAPES, mirrored, shaped


def _clutch(clutch: Clutch, name: str, radius: float = 0.0) -> Clutch:
    return clutch.with_dog(replace(shaped(clutch.dog, name, ALL), edge_radius=radius))


@pytest.mark.parametrize("radius", [0.0, 5e-5])
@pytest.mark.parametrize("name", ALL)
def test_shifts_follow_drake(clutch: Clutch, point: Point, name: str, radius: float) -> None:
    """Same outcome and events, times within 0.1 % of Drake, the engine's own accuracy refined."""
    own = _clutch(clutch, name, radius)
    mine = own.with_engine("planar").refined()
    for rpm, force, share in ((50, 469.0, 0.1), (-50, 469.0, 0.35), (5, 315.5, 0.93)):
        angle = share * own.dog.pitch_angle
        one, other = engage(own, point(rpm, force), angle), engage(mine, point(rpm, force), angle)
        assert one.outcome is other.outcome
        assert one.events.face_contacts == other.events.face_contacts
        assert one.events.slots_skipped == other.events.slots_skipped
        if one.shift_time is not None:
            assert other.shift_time == pytest.approx(one.shift_time, rel=1e-3)


@pytest.mark.parametrize("engine", ["planar", "drake"])
@pytest.mark.parametrize("name", ["symmetric", "ridge aside", "play alone", "undercut"])
def test_the_mirror_image_shifts_alike_at_the_other_sign(
    clutch: Clutch, point: Point, name: str, engine: str
) -> None:
    """Opposite mismatch and angle; a symmetric roof is its own mirror image."""
    here = _clutch(clutch, name).with_engine(engine).refined()
    there = here.with_dog(mirrored(here.dog))
    for rpm, share in ((25.0, 0.55), (-100.0, 0.3)):
        angle = share * here.dog.pitch_angle
        one = engage(here, point(rpm, 469.0), angle)
        other = engage(there, point(-rpm, 469.0), -angle)
        assert one.outcome is other.outcome is Outcome.ENGAGED
        assert one.shift_time == pytest.approx(other.shift_time, rel=1e-4)
        assert one.events.face_contacts == other.events.face_contacts
        assert one.events.slots_skipped == other.events.slots_skipped


def test_a_symmetric_roof_has_one_expected_time_for_both_signs(
    clutch: Clutch, point: Point
) -> None:
    own = _clutch(clutch, "symmetric").with_engine("planar")
    angles = (np.arange(24) + 0.5) / 24 * own.dog.pitch_angle
    one, other = (
        [engage(own, point(rpm, 469.0), float(a)).shift_time for a in angles] for rpm in (50, -50)
    )
    assert np.sort(np.array(one, dtype=float)) == pytest.approx(
        np.sort(np.array(other, dtype=float)), rel=1e-5
    )


@pytest.mark.parametrize("name", SHAPES)
def test_rings_have_the_play_of_the_closed_form_at_every_depth(clutch: Clutch, name: str) -> None:
    """Flanks touch where half of the play and D tan is turned, at the radius where that is first.

    D is the distance of the median planes, down from where the edges of that flank have passed all
    along; rings that are turned towards each other are not quite parallel there.
    """
    plant = PlanarClutch(_clutch(clutch, name))
    dog = plant.clutch.dog
    middle, (back, edge) = 0.5 * dog.pitch_angle, dog.drops_at(dog.outer_radius)
    for sign, angle, drop in ((1.0, dog.traction, back), (-1.0, dog.braking, edge)):
        for share in (0.05, 0.4, 0.95):
            distance = share * (dog.height - 2.0 * drop)
            lean = distance * np.tan(angle)
            radius = dog.outer_radius if lean > 0.0 else dog.inner_radius
            exact = 0.5 * dog.backlash_angle + np.arcsin(lean / radius)
            low, high = 0.0, 0.5 * middle
            while high - low > 1e-9:
                turned = 0.5 * (low + high)
                force = force_of(plant, middle + sign * turned, distance, 0.0, 0.0)
                low, high = (low, turned) if any(force) else (turned, high)
            assert low == pytest.approx(exact, abs=1e-4)


@pytest.mark.parametrize("angle", [12.0, -4.0])
def test_flanks_lie_on_each_other_once_the_play_is_turned(clutch: Clutch, angle: float) -> None:
    """Pressed 30 um into each other they bear the same over the whole flank, whatever the play."""
    found = []
    for backlash in (1.2, 2.4, 4.0):
        own = {"count": 6, "traction": angle * DEG, "backlash": backlash * MM}
        plant = PlanarClutch(clutch.with_dog(replace(clutch.dog, chamfer=0.0, **own)))
        dog = plant.clutch.dog
        closed = 0.5 * (dog.pitch_angle + dog.backlash_angle)
        found.append(force_of(plant, closed + 30e-6 / dog.mean_radius, 0.0, 0.0, 0.0))
    area = dog.height * dog.radial_width
    assert found[1] == pytest.approx(found[0], rel=1e-5)
    assert found[2] == pytest.approx(found[0], rel=1e-5)
    assert abs(found[0][1]) == pytest.approx(
        clutch.contact.stiffness * 30e-6 * np.cos(angle * DEG) * area * dog.mean_radius, rel=0.02
    )


@pytest.mark.parametrize("name", ALL)
def test_no_overlap_is_passed_over(clutch: Clutch, name: str) -> None:
    """The force at random places is the same where every dog is looked at."""
    plant = PlanarClutch(_clutch(clutch, name))
    every = (*plant.surfaces[:3], np.array([-1e9, -1e9, 0.0]), *plant.surfaces[4:])
    everything: Any = SimpleNamespace(surfaces=every, law=plant.law)
    dog, rng, touched = plant.clutch.dog, np.random.default_rng(5), 0
    for _ in range(3000):
        angle, distance = rng.uniform(-1.0, 1.0) * dog.pitch_angle, rng.uniform(0.0, dog.height)
        here, there = (force_of(one, angle, distance, 3.0, 0.1) for one in (plant, everything))
        assert here == there
        touched += here[0] != 0.0
    assert touched > 1000


def test_ridges_meet_at_the_axial_gap(clutch: Clutch) -> None:
    """Ridge on ridge at the mean radius: apart above, in touch 0.01 um below."""
    for name in ROOFS:
        plant = PlanarClutch(_clutch(clutch, name))
        dog = plant.clutch.dog
        angle = -dog.crest_overlap / dog.mean_radius
        assert force_of(plant, angle, dog.height + 1e-9, 0.0, 0.0) == (0.0, 0.0)
        assert force_of(plant, angle, dog.height - 1e-8, 0.0, 0.0)[0] > 0.0
