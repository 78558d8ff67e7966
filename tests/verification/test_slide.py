"""Energy of faces that slide without friction, and its loss against the closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from dogshape.sim.kernel_layout import (
    AXIAL_SPEED,
    DISPLACEMENT,
    INPUT_SIDE_ANGLE,
    INPUT_SIDE_SPEED,
    OUTPUT_ANGLE,
    OUTPUT_SPEED,
    SLIDING_ANGLE,
    SLIDING_SPEED,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Rings, contact_set, solver_for
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.slide import (
    AVERAGED_SHARES,
    LOSS_LIMIT,
    START_SHARE,
    slide_loss,
    sliding_faces,
    stiffness_for_loss,
    wedge_depth,
)
from dogshape.sim.units import DEG, MM

FORCE = 500.0  #: N


class Slide(NamedTuple):
    """Roof tips on a light ring that slide without friction; SI units, angles in degrees."""

    slope_deg: float = 34.0
    count: int = 27
    width: float = 1.0 * MM
    inertia: float = 3.51e-4
    dissipation: float = 20.0
    stiffness: float = 5e12

    @property
    def clutch(self) -> Clutch:
        """The clutch in the compiled engine: 56 mm in the mean, ring of 0.05 kg, heavy wheel."""
        slope, radius, half = self.slope_deg * DEG, 28.0 * MM, 0.5 * self.width
        diameters = 2.0 * (radius + half), 2.0 * (radius - half)
        dog = Dog(
            self.count, slope, 0.0, 0.0, 4.0 * MM, *diameters, 0.5 * MM,
            crest=0.5, chamfer_back=slope,
        )  # fmt: skip
        contact = replace(
            contact_set("lubricated_steel"), static_friction=0.0, dynamic_friction=0.0,
            dissipation=self.dissipation, stiffness=self.stiffness,
        )  # fmt: skip
        rings = Rings(0.05, self.inertia, 20.0)
        return Clutch(dog, rings, contact, solver_for(contact)).with_engine("planar")


def lost_share(clutch: Clutch, force: float = FORCE) -> float:
    """Simulate a slide; give the axial power that the turning ring does not get, as a share."""
    face, dog, rings = sliding_faces(clutch)[0], clutch.dog, clutch.rings
    start = (START_SHARE * face.width - dog.crest_overlap) / dog.mean_radius
    engine = ClutchPlant if clutch.solver.engine == "drake" else PlanarClutch
    point = OperatingPoint(0.0, ForceProfile(force, 1e-4))
    states = engage(engine(clutch), point, start).run.states
    turned = np.abs(states[:, OUTPUT_ANGLE] - states[:, SLIDING_ANGLE] - start) * dog.mean_radius
    first, last = np.searchsorted(turned, (np.array(AVERAGED_SHARES) - START_SHARE) * face.width)
    before, after = states[first], states[last]
    near = clutch.shafts[0]
    turning = 0.5 * near.ring_inertia * (after[SLIDING_SPEED] ** 2 - before[SLIDING_SPEED] ** 2)
    output_squares = after[OUTPUT_SPEED] ** 2 - before[OUTPUT_SPEED] ** 2
    turning += 0.5 * rings.output_inertia * output_squares
    if near.side_inertia:
        side_squares = after[INPUT_SIDE_SPEED] ** 2 - before[INPUT_SIDE_SPEED] ** 2
        turning += 0.5 * near.side_inertia * side_squares
        twists = (state[SLIDING_ANGLE] - state[INPUT_SIDE_ANGLE] for state in (after, before))
        turning += 0.5 * near.stiffness * np.subtract(*(twist**2 for twist in twists))
    moving = 0.5 * rings.mass * (after[AXIAL_SPEED] ** 2 - before[AXIAL_SPEED] ** 2)
    return float(1.0 - turning / (force * (after[DISPLACEMENT] - before[DISPLACEMENT]) - moving))


def bounded(clutch: Clutch, force: float) -> Clutch:
    """Return the clutch with the stiffness that bounds the loss of its slide."""
    face = sliding_faces(clutch)[0]
    stiffness = stiffness_for_loss(clutch, force, face, LOSS_LIMIT)
    return replace(clutch, contact=replace(clutch.contact, stiffness=stiffness))


@pytest.mark.parametrize(
    "slide",
    [
        *(Slide(dissipation=value) for value in (5.0, 20.0, 40.0)),
        *(Slide(stiffness=value) for value in (5e13, 1e14)),
        *(Slide(slope_deg=10.0, stiffness=5e13, dissipation=100.0), Slide(slope_deg=20.0)),
        *(Slide(count=15), Slide(width=4.0 * MM), Slide(inertia=3.51e-2)),
    ],
)
def test_the_loss_of_a_slide_is_the_closed_form(slide: Slide) -> None:
    """An upper estimate, as its speed is that without loss."""
    clutch = slide.clutch
    estimate = slide_loss(clutch, FORCE, sliding_faces(clutch)[0])
    assert 0.8 * estimate < lost_share(clutch) < 1.02 * estimate


@pytest.mark.parametrize("periods", [0.1, 8.0])
def test_a_shaft_takes_its_side_along_in_a_long_slide(periods: float) -> None:
    """Periods of ring against side in a slide of the ring alone; a stiff shaft is one piece."""
    ring, whole = 3.51e-4, 3.51e-3
    face = sliding_faces(Slide().clutch)[0]
    way, arm = (
        (AVERAGED_SHARES[1] - START_SHARE) * face.width * math.tan(face.slope),
        28.0 * MM * math.tan(34 * DEG),
    )
    period = math.sqrt(2.0 * way * (0.05 + ring / arm**2) / FORCE) / periods
    reduced = ring * (whole - ring) / whole
    shaft = Mechanism(ring_inertia=ring, input_stiffness=reduced * (2.0 * math.pi / period) ** 2)
    clutch = replace(Slide(inertia=whole).clutch, mechanism=shaft)
    rigid = Slide(inertia=ring if periods < 1.0 else whole).clutch
    estimate = slide_loss(clutch, FORCE, face)
    assert estimate == pytest.approx(slide_loss(rigid, FORCE, face), rel=1e-9)
    assert 0.8 * estimate < lost_share(clutch) < 1.02 * estimate


def test_the_loss_of_the_prototype_is_the_closed_form(clutch: Clutch) -> None:
    """One face up to the edge of the traction flank, parallel where the slide ends."""
    smooth = replace(clutch.contact, static_friction=0.0, dynamic_friction=0.0, dissipation=60.0)
    slippery = replace(clutch, contact=smooth).with_engine("planar")
    (face,) = sliding_faces(slippery)
    assert face.ridge_turn == pytest.approx(86.0 * DEG)
    assert lost_share(slippery) == pytest.approx(slide_loss(slippery, FORCE, face), rel=0.15)


@pytest.mark.parametrize("force", [500.0, 2000.0])
@pytest.mark.parametrize("engine", ["planar", "drake"])
def test_a_slide_keeps_its_power_on_the_stiffness_that_bounds_it(engine: str, force: float) -> None:
    """Torque times angle over axial force times way, without friction: 0.98 and more."""
    soft = Slide().clutch
    assert lost_share(soft, force) > 5.0 * LOSS_LIMIT
    assert 0.0 < lost_share(bounded(soft, force).with_engine(engine), force) < LOSS_LIMIT


def test_a_slide_without_dissipation_keeps_its_power() -> None:
    assert abs(lost_share(Slide(dissipation=0.0).clutch)) < 2e-3


def test_a_wedge_has_the_depth_of_a_quadrature() -> None:
    """Depth over the width by the balance of the load, with contact on part of it and on all."""
    width, layer, wedge = 4.0 * MM, np.array([5e9, 5e9, 5e9]), np.array([0.0, 1e-3, 0.05])
    place = (np.arange(20_000) + 0.5) / 20_000 * width
    for deepest, share in ((2e-6, 0), (8e-6, 1), (8e-6, 2)):
        depth = np.maximum(deepest - wedge[share] * place, 0.0)
        load = layer[share] * depth.mean() * width
        mean = wedge_depth(load, layer, wedge, width)[share]
        assert mean == pytest.approx((depth**2).sum() / depth.sum(), rel=1e-3)


def test_the_loss_follows_dissipation_and_stiffness() -> None:
    """Linear in the dissipation; with the inverse root of the stiffness where faces are wedges."""
    losses = []
    for slide in (Slide(), Slide(dissipation=60.0), Slide(stiffness=5e14)):
        clutch = slide.clutch
        losses.append(slide_loss(clutch, FORCE, sliding_faces(clutch)[0]))
    assert losses[1:] == pytest.approx([3.0 * losses[0], 0.1 * losses[0]], rel=1e-3)


def test_a_flat_tip_has_no_face_that_slides(clutch: Clutch) -> None:
    assert sliding_faces(replace(clutch, dog=replace(clutch.dog, chamfer=0.0))) == []


def test_a_loss_that_no_stiffness_bounds_has_none() -> None:
    clutch = Slide(dissipation=1e4).clutch
    assert math.isnan(stiffness_for_loss(clutch, FORCE, sliding_faces(clutch)[0], 1e-4))
