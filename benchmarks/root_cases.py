"""Designs spread over the search space, and the finite-element stress at their roots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.flank import Flank, flank_contact
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.manufacture import ManufacturingLimits, require_makeable
from dogshape.sim.strength.notch import (
    PRESSED,
    TENSION,
    Load,
    Pressed,
    Tension,
    mises_opposite,
    root_tension,
)
from dogshape.sim.units import DEG, MM
from dogshape.validation.finite_elements.root_mesh import SIDES, RootShape
from dogshape.validation.finite_elements.root_stress import (
    BANDS,
    FINENESS,
    Band,
    Cut,
    RootModel,
    RootStress,
)

FORCE = 1666.7  #: N, the prototype's design load on one dog
LOW = np.array([0.0, 4.0, 4.0, 1.6, 6.0, 0.2])
HIGH = np.array([20.0, 30.0, 30.0, 6.0, 36.0, 0.6])
PROTOTYPE = (8.0, 12.0, 22.0, 3.7, 15, 0.3)
SHARED = 0.2  #: least part of the height on which two braking flanks touch

#: Chamfer, traction and braking angle in deg, height in mm, dogs, root radius in mm.
Design = tuple[float, float, float, float, int, float]


@dataclass(frozen=True)
class Case:
    """A design under a load and the stress that it has, Pa."""

    shape: RootShape
    flank: Flank
    band: Band
    stress: RootStress

    @property
    def load(self) -> Load:
        """The load in the terms of the closed form."""
        return Load(self.stress.force, self.flank, self.stress.lever)


def shape_of(design: Design, depth: float = 1.0) -> RootShape:
    """Return the dog on rings of 52/44 mm with a body ``depth`` pitches deep."""
    chamfer, traction, braking, height, count, root_radius = design
    dog = Dog(
        count=int(count),
        chamfer=chamfer * DEG,
        traction=traction * DEG,
        braking=braking * DEG,
        height=height * MM,
        outer_diameter=52.0 * MM,
        inner_diameter=44.0 * MM,
        axial_gap=1.0 * MM,
    )
    return RootShape(dog, root_radius * MM, depth * dog.pitch)


def designs(count: int, seed: int) -> list[Design]:
    """Draw designs that can be made and whose braking flanks touch."""
    random = np.random.default_rng(seed)
    found: list[Design] = []
    while len(found) < count:
        chamfer, traction, braking, height, dogs, root_radius = (
            LOW + (HIGH - LOW) * random.random(6)
        ).tolist()
        angles = (round(chamfer, 1), round(traction, 1), round(braking, 1))
        design = (*angles, round(height, 2), round(dogs), round(root_radius, 2))
        try:
            dog = shape_of(design).dog
            require_makeable(dog, ManufacturingLimits())
        except DogshapeError:
            continue
        if flank_contact(dog, 0.0, "braking").height >= SHARED * dog.height:
            found.append(design)
    return found


def cases(shape: RootShape, fineness: int = FINENESS, cut: Cut = "periodic") -> list[Case]:
    """Return both flanks of a design under both bands."""
    model = RootModel(shape, fineness, cut)
    return [
        Case(shape, flank, band, model.stress(flank, band, FORCE))
        for flank in SIDES
        for band in BANDS
    ]


def fit_tension(found: list[Case]) -> Tension:
    """Return coefficients that make the relative error of the tension least."""

    def errors(x: np.ndarray) -> list[float]:
        return [
            root_tension(c.shape.dog, c.shape.root_radius, c.load, Tension(*x)) / c.stress.tension
            - 1.0
            for c in found
        ]

    return Tension(*least_squares(errors, TENSION).x)


def fit_pressed(found: list[Case]) -> Pressed:
    """Return coefficients that make the relative error in the pressed fillet least."""

    def errors(x: np.ndarray) -> list[float]:
        return [
            mises_opposite(c.shape.dog, c.shape.root_radius, c.load, Pressed(*x))
            / c.stress.mises_opposite
            - 1.0
            for c in found
        ]

    return Pressed(*least_squares(errors, PRESSED).x)
