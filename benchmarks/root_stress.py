"""Finite-element stress at the root of a dog against formulas for it.

    python -m benchmarks.root_stress

What the mesh and the surroundings do to it, then a formula with a constant notch factor and the
closed form of ``sim.strength.dog_strength`` on designs spread over the search space: those that its
coefficients were fitted to and others. Takes ten minutes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.geometry import Dog, Flank, flank_contact
from dogshape.sim.strength.checks import feasible
from dogshape.sim.strength.dog_strength import (
    TENSION,
    Load,
    Tension,
    root_tension,
)
from dogshape.sim.strength.manufacture import ManufacturingLimits, manufacturing_checks
from dogshape.sim.units import DEG, MM, MPA
from dogshape.validation.finite_elements.root_mesh import SIDES, RootShape
from dogshape.validation.finite_elements.root_stress import (
    BANDS,
    FINENESS,
    Band,
    Cut,
    RootModel,
    RootStress,
)

FORCE_N = 1666.7  #: the prototype's design load on one dog
LOW = np.array([0.0, 4.0, 4.0, 1.6, 6.0, 0.2])
HIGH = np.array([20.0, 30.0, 30.0, 6.0, 36.0, 0.6])
PROTOTYPE = (8.0, 12.0, 22.0, 3.7, 15, 0.3)
MIN_SHARED_HEIGHT = 0.2  #: of two braking flanks that touch, of the height

#: Chamfer, traction and braking angle in deg, height in mm, dogs, root radius in mm.
Design = tuple[float, float, float, float, int, float]
FINE: Design = (11.4, 7.2, 22.3, 1.95, 34, 0.2)
SIX: Design = (10.0, 20.0, 12.0, 5.0, 6, 0.4)
FIT_DESIGNS = (20, 1)  #: number of fitted designs and seed
TEST_DESIGNS = (14, 2)  #: number of held-out designs and seed
NOTCH_FACTOR = 2.0


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


def draw_designs(count: int, seed: int) -> list[Design]:
    """Draw designs that can be made and whose braking flanks touch."""
    random = np.random.default_rng(seed)
    designs: list[Design] = []
    while len(designs) < count:
        chamfer, traction, braking, height, dogs, root_radius = (
            LOW + (HIGH - LOW) * random.random(6)
        ).tolist()
        angles = (round(chamfer, 1), round(traction, 1), round(braking, 1))
        design = (*angles, round(height, 2), round(dogs), round(root_radius, 2))
        try:
            dog = shape_of(design).dog
        except DogshapeError:
            continue
        if not feasible(manufacturing_checks(dog, ManufacturingLimits())):
            continue
        if flank_contact(dog, 0.0, "braking").height >= MIN_SHARED_HEIGHT * dog.height:
            designs.append(design)
    return designs


def evaluate_design(
    shape: RootShape, fineness: int = FINENESS, cut: Cut = "periodic"
) -> list[Case]:
    """Return both flanks of a design under both bands."""
    model = RootModel(shape, fineness, cut)
    return [
        Case(shape, flank, band, model.stress(flank, band, FORCE_N))
        for flank in SIDES
        for band in BANDS
    ]


def fit_tension(cases: list[Case]) -> Tension:
    """Return coefficients that make the relative error of the tension least."""

    def errors(x: np.ndarray) -> list[float]:
        return [
            root_tension(c.shape.dog, c.shape.root_radius, c.load, Tension(*x)) / c.stress.tension
            - 1.0
            for c in cases
        ]

    return Tension(*least_squares(errors, TENSION).x)


def constant_notch_stress(case: Case) -> float:
    """Return the equivalent stress with a constant notch factor and the load at the tip, Pa."""
    dog = case.shape.dog
    bending = 6.0 * FORCE_N * dog.height / (dog.radial_width * dog.root_width**2)
    shear = 1.5 * FORCE_N / (dog.radial_width * dog.root_width)
    return math.hypot(NOTCH_FACTOR * bending, math.sqrt(3.0) * shear)


def print_convergence() -> None:
    """Print the largest tension on refined meshes."""
    print("Mesh: first principal stress in MPa, traction flank, 1666.7 N; change to the one before")
    for name, design in (("prototype", PROTOTYPE), ("fine", FINE)):
        previous: dict[str, float] = {}
        for fineness in (1, 2, 3):
            model = RootModel(shape_of(design), fineness)
            line = f"  {name:<10} fineness {fineness} {model.reduction.shape[1]:>7} unknowns"
            for band in BANDS:
                stress = model.stress("traction", band, FORCE_N)
                change = 100.0 * (stress.tension / previous.get(band, stress.tension) - 1.0)
                previous[band] = stress.tension
                line += f"  {band} {stress.tension / MPA:7.1f} {change:+5.2f} %"
                line += f" at {stress.radius / MM:.2f} mm, {stress.angle / DEG:.0f} deg"
            print(line, flush=True)


def print_surroundings() -> None:
    """Print the stress by depth, cuts and hub on the coarsest mesh."""
    print("\nSurroundings: first principal stress in MPa on the coarsest mesh,")
    print("traction whole, traction tip, braking whole, braking tip")
    rows: list[tuple[float, Cut, bool]] = [
        *((depth, "periodic", True) for depth in (0.25, 0.5, 1.0, 1.5)),
        (1.0, "free", True),
        (1.0, "fixed", True),
        (0.5, "periodic", False),
        (1.0, "periodic", False),
    ]
    for name, design in (("prototype", PROTOTYPE), ("fine", FINE), ("six", SIX)):
        for depth, cut, hub in rows:
            model = RootModel(shape_of(design, depth), 1, cut, hub)
            tensions = [
                model.stress(f, band, FORCE_N).tension / MPA for f in SIDES for band in BANDS
            ]
            hub_text = "on a hub" if hub else "no hub"
            print(f"  {name:<10} depth {depth:4.2f} pitches, cuts {cut:<8} {hub_text:<8}", end="")
            print("".join(f"{value:8.1f}" for value in tensions), flush=True)


def print_designs(title: str, cases: list[Case]) -> None:
    """Print every design of ``found`` with its numbers."""
    print(f"\n{title}")
    print("  deg: chamfer, traction, braking; mm: height; dogs; mm: root radius, width at root")
    print("  loaded flank and band, lever in mm; tension in MPa;")
    print("  deviation from it in %: today, closed form")
    shape: RootShape | None = None
    for case in cases:
        if case.shape is not shape:
            shape = case.shape
            dog = case.shape.dog
            angles = (dog.chamfer / DEG, dog.traction / DEG, dog.braking / DEG)
            print("  " + " ".join(f"{a:.1f}" for a in angles), end="")
            print(f"  {dog.height / MM:.2f}  {dog.count}  {shape.root_radius / MM:.2f}", end="")
            print(f"  {dog.root_width / MM:.2f}")
        stress = case.stress
        (notch_deviation, deviation) = deviations(case)
        print(f"    {case.flank:<9}{case.band:<6}{stress.lever / MM:5.2f}", end="")
        print(f"{stress.tension / MPA:8.0f}{100 * notch_deviation:+8.1f}{100 * deviation:+7.1f}")


def deviations(case: Case) -> tuple[float, float]:
    """Return how far today's and the closed form are off the tension."""
    dog = case.shape.dog
    rho = case.shape.root_radius
    load = case.load
    stress = case.stress
    return (
        constant_notch_stress(case) / stress.tension - 1.0,
        root_tension(dog, rho, load) / stress.tension - 1.0,
    )


def print_summary(title: str, cases: list[Case]) -> None:
    """Print mean, rms and largest deviation by band."""
    print(f"\n{title}: mean, rms and largest deviation in %")
    for band in (*BANDS, "both"):
        rows = np.array([deviations(c) for c in cases if band in (c.band, "both")]) * 100.0
        print(f"  {band:<6}", end="")
        names = ("today against tension", "closed form")
        for name, column in zip(names, rows.T, strict=True):
            rms = math.sqrt(np.mean(column**2))
            largest = column[np.abs(column).argmax()]
            print(f"  {name} {column.mean():+6.1f} {rms:5.1f} {largest:+6.1f}", end="")
        print()


def evaluate_designs(designs: list[Design]) -> list[Case]:
    """Return the cases of designs."""
    return [case for design in designs for case in evaluate_design(shape_of(design))]


def print_comparison(fit_cases: list[Case], test_cases: list[Case]) -> None:
    """Print the held-out designs, the fit and its errors."""
    print_designs(f"Held out, {TEST_DESIGNS[0]} designs", test_cases)
    print("\nCoefficients of the closed form, and fitted again")
    for name, value, fit_value in zip(
        TENSION._fields, TENSION, fit_tension(fit_cases), strict=True
    ):
        print(f"  {name:<10}{value:8.3f}{fit_value:9.4f}")
    print_summary("Fitted", fit_cases)
    print_summary("Held out", test_cases)


def main() -> None:
    """Print everything."""
    print_convergence()
    print_surroundings()
    print_comparison(
        evaluate_designs(draw_designs(*FIT_DESIGNS)), evaluate_designs(draw_designs(*TEST_DESIGNS))
    )


if __name__ == "__main__":
    main()
