"""Stiffness of dogs against limit cases and finite elements; elastic landings against motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import dogshape as ds
from dogshape.sim.shift.clutch import CONTACT_SETS
from dogshape.sim.shift.geometry import FLANKS, Dog, Dogs, Flank, flank_contact
from dogshape.sim.shift.pair import OutputDog
from dogshape.sim.strength.dog_stiffness import (
    HALF_PLANE,
    PLANE_MODULUS,
    SHORT_DOG,
    FlankLoad,
    Strip,
    face_compliance,
    flank_compliance,
    wedge_compliance,
)
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.landing import (
    EVEN_WIDTH,
    MODULUS,
    bedding_of,
    blow_energies,
    class_middles,
    crests_of,
    demands_of,
    edge_pressure,
    elastic_loads,
    landing_stiffness,
)
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.units import MM
from dogshape.validation.finite_elements.face_model import FaceModel
from dogshape.validation.finite_elements.root_mesh import SIDES, RootShape
from dogshape.validation.finite_elements.root_stress import BANDS, RootModel, fem_available
from dogshape.validation.finite_elements.stiffness import LOAD_WORDS, stiffness_checks
from tests.conftest import require_program

WIDTH = 4 * MM
ALONE = Limits(load=LoadCase(load_sharing=1.0))  #: all dogs land alike


def test_wedges_of_known_energy() -> None:
    """Half plane 2/pi; right angle loaded along a face, both parts of Flamant's force alike."""
    assert wedge_compliance(1e-12) == pytest.approx(HALF_PLANE)
    quarter = 0.25 * math.pi
    along = 0.5 / (quarter + 0.5)
    across = 0.5 / (quarter - 0.5)
    assert wedge_compliance(1.0) == pytest.approx(along + across)


def test_a_slender_dog_is_a_cantilever(prototype: Dog) -> None:
    """Force at the tip of a straight bar of 20 widths: 4 l^3/s^3, shear and root below 5 %."""
    slender = replace(
        prototype, chamfer=0.0, traction=0.0, braking=0.0, height=100 * MM, axial_gap=1 * MM
    )
    width = slender.root_width
    load = FlankLoad(level=100 * MM, top=100 * MM + 0.5 * width)
    number = flank_compliance(slender, "traction", load) * PLANE_MODULUS * slender.radial_width
    assert number == pytest.approx(SHORT_DOG * 4.0 * (100 * MM / width) ** 3, rel=0.05)


def test_a_flat_dog_is_a_column(prototype: Dog) -> None:
    """Straight flanks and a flat tip: height over thickness for another height."""
    straight = replace(prototype, chamfer=0.0, traction=0.0, braking=0.0)
    dogs = [replace(straight, height=height * MM) for height in (2.0, 5.0)]
    strip = Strip(0.0, straight.face_width)
    low, high = (face_compliance(dog, strip, short_dog=1.0) for dog in dogs)
    number = (high - low) * PLANE_MODULUS * straight.radial_width
    assert number == pytest.approx(3 * MM / straight.root_width, rel=1e-9)


@pytest.fixture
def _skfem() -> None:
    require_program(fem_available(), "scikit-fem")


@pytest.mark.usefixtures("_skfem")
@pytest.mark.parametrize("edge_radius", [0.0, 0.3 * MM])
def test_faces_are_those_of_graded_elements(prototype: Dog, edge_radius: float) -> None:
    model = FaceModel(RootShape(prototype, 0.3 * MM, prototype.pitch), edge_radius)
    start = edge_radius * prototype.crest_cut
    for width in (0.02 * MM, 0.1 * MM, 0.5 * MM, 2.0 * MM):
        formula = face_compliance(prototype, Strip(start, width), short_dog=1.0)
        number = formula * PLANE_MODULUS * prototype.radial_width
        assert number == pytest.approx(model.compliance(start, start + width), rel=0.05)
    if edge_radius == 0.0:
        slope = (model.compliance(0.0, 1e-5) - model.compliance(0.0, 4e-5)) / math.log(4.0)
        tilt = 1.0 + prototype.tangents[0] ** 2
        assert slope == pytest.approx(tilt * wedge_compliance(prototype.crest_cut), rel=0.01)


@pytest.mark.usefixtures("_skfem")
def test_flanks_and_whole_faces_are_those_of_solid_elements(prototype: Dog) -> None:
    shape = RootShape(prototype, 0.3 * MM, prototype.pitch)
    model = RootModel(shape, 1)
    for flank in SIDES:
        for band in BANDS:
            compliance, load = model.flank_compliance(flank, band)
            assert flank_compliance(prototype, flank, load) == pytest.approx(compliance, rel=0.06)
    for width in (prototype.face_width, 0.5 * prototype.face_width):
        overlap = None if width == prototype.face_width else width
        formula = face_compliance(prototype, Strip(0.0, width))
        assert formula == pytest.approx(model.face_compliance(overlap), rel=0.08)


@pytest.mark.parametrize("flank", FLANKS)
def test_a_pair_is_two_dogs_in_series(prototype: Dog, flank: Flank) -> None:
    """Each dog with the part of its flank that touches; many dogs element by element."""
    mate = OutputDog(height=3.2 * MM).beside(prototype)
    load = LoadCase(mate=mate)
    compliances = []
    for dog, other in ((prototype, mate), (mate, prototype)):
        contact = flank_contact(dog, 0.0, flank, other)
        compliances.append(
            flank_compliance(dog, flank, FlankLoad(contact.level(0.9), contact.high))
        )
    assert 1.0 / load.stiffness(prototype, flank) == pytest.approx(sum(compliances), rel=1e-12)
    half = replace(load, dog_stiffness_factor=0.5)
    assert half.stiffness(prototype, flank) == pytest.approx(0.5 * load.stiffness(prototype, flank))
    heights = np.array([3.0, 3.7, 4.2]) * MM
    many = Dogs(**{**vars_of(prototype), "height": heights})
    each = [LoadCase().stiffness(replace(prototype, height=h), flank) for h in heights.tolist()]
    assert LoadCase().stiffness(many, flank) == pytest.approx(each, rel=1e-12)


def vars_of(dog: Dog) -> dict[str, float]:
    """Return the fields of a dog."""
    return {name: getattr(dog, name) for name in dog.__dataclass_fields__}


def test_teeth_of_a_sleeve_have_the_stiffness_of_gears(prototype: Dog) -> None:
    """14 N/(mm um) of what touches along the shaft, ISO 6336-1."""
    load = LoadCase(mount="sleeve")
    length = flank_contact(prototype, 0.0, "traction").height
    assert load.stiffness(prototype) == pytest.approx(14e9 * length)


def test_an_even_pressure_of_this_width_is_as_compliant_as_that_of_hertz() -> None:
    """Mean of -ln|x - y| over both pressures on [-1, 1]: half an ellipse, and 1.745 wide."""
    points, weights = np.polynomial.chebyshev.chebgauss(400)
    ellipse = 2.0 / math.pi * (1.0 - points**2) * weights  # of the weight 1/sqrt(1 - x^2)
    # Potential of half an ellipse at x: ln 2 + 1/2 - x^2 (Johnson 1985, 2.42).
    hertz = float(ellipse @ (math.log(2.0) + 0.5 - points**2))
    even = quad(
        lambda gap: -2.0 * (EVEN_WIDTH - gap) / EVEN_WIDTH**2 * math.log(gap), 0, EVEN_WIDTH
    )
    assert even[0] == pytest.approx(hertz, rel=1e-5)


def test_a_bedded_edge_bears_the_limit() -> None:
    """The pressure of Hertz on the new radius is the limit; below it an edge stays."""
    radius, limit, load = 0.3 * MM, 5.28e9, 5e5
    edge = bedding_of(edge_pressure(load, 2.0 / radius), radius, radius, limit)
    assert edge_pressure(load, 2.0 / edge.radius) == pytest.approx(limit)
    half_width = math.sqrt(4.0 * load * 0.5 * edge.radius / (math.pi * MODULUS))
    assert edge.depth == pytest.approx(0.5 * half_width**2 * (1.0 / radius - 1.0 / edge.radius))
    assert bedding_of(0.99 * limit, radius, radius, limit) == (0.0, radius)
    plane = bedding_of(edge_pressure(load, 1.0 / radius), radius, math.inf, limit)
    assert edge_pressure(load, 1.0 / plane.radius) == pytest.approx(limit)
    assert plane.depth == pytest.approx(0.5 * half_width**2 * (1.0 / radius - 1.0 / plane.radius))


def test_a_contact_as_stiff_as_the_dogs_changes_no_load(prototype: Dog) -> None:
    crests = crests_of(prototype, ALONE)
    overlap = class_middles(crests)[None, 15:16]
    load = np.array([[2e5]])
    stiffness = float(landing_stiffness(crests, overlap, load)[0, 0])
    landing = np.zeros((1, 22))
    landing[0, 15] = 2e5
    for factor in (1.0, 4.0):
        contact = replace(
            CONTACT_SETS["lubricated_steel"],
            stiffness=factor * stiffness / float(overlap[0, 0]),
        )
        limits = Limits(load=LoadCase(load_sharing=1.0, contact=contact))
        elastic = elastic_loads(crests, landing, limits)
        assert elastic[0, 15] == pytest.approx(2e5 / math.sqrt(factor), rel=1e-9)
        assert np.count_nonzero(elastic) == 1


BLOWS = [
    (number, 10.0**exponent)
    for number, exponent in zip(
        (0, 2, 4, 5, 6, 9, 13, 17, 19, 20), (3.8, 4.0, 4.2, 4.4, 4.6, 4.8, 5.0, 5.2, 5.3, 5.5),
        strict=True,
    )
]  # fmt: skip


@pytest.mark.parametrize(("number", "load"), BLOWS)
def test_elastic_loads_are_those_of_an_integrated_blow(
    prototype: Dog, number: int, load: float
) -> None:
    """A mass on the layer of the simulation, then as fast on the dogs' own nonlinear spring.

    The spring's travel follows from its energy, dx = dU/F with U = F^2/2 k(F).
    """
    crests = crests_of(prototype, ALONE)
    overlap = float(class_middles(crests)[number])
    mass = 0.02 / WIDTH  # of a dog per length
    layer = ALONE.load.contact.stiffness * overlap
    speed = load / math.sqrt(layer * mass)
    assert _peak(lambda x: layer * x, mass, speed) == pytest.approx(load, rel=1e-4)

    loads = np.geomspace(1e-6, 30.0, 4000) * load
    stiffness = landing_stiffness(crests, np.full_like(loads, overlap), loads)
    energies = 0.5 * loads**2 / stiffness
    middles = 0.5 * (loads[1:] + loads[:-1])
    first = loads[0] / stiffness[0]
    travels = first + np.concatenate([[0.0], np.cumsum(np.diff(energies) / middles)])
    peak = _peak(lambda x: float(np.interp(x, travels, loads)), mass, speed)
    landing = np.zeros((1, 22))
    landing[0, number] = load
    assert elastic_loads(crests, landing, ALONE)[0, number] == pytest.approx(peak, rel=5e-3)


def _peak(spring: object, mass: float, speed: float) -> float:
    """Integrate a mass on a spring up to its rest; return the largest force per length, N/m."""
    assert callable(spring)

    def motion(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -spring(state[0]) / mass]

    def rest(_: float, state: np.ndarray) -> float:
        return float(state[1])

    rest.terminal = True  # type: ignore[attr-defined]
    rest.direction = -1.0  # type: ignore[attr-defined]
    run = solve_ivp(motion, (0.0, 1.0), [0.0, speed], events=rest, rtol=1e-7, atol=1e-13,
                    max_step=1e-5)  # fmt: skip
    return float(spring(run.y[0, -1]))


@pytest.mark.parametrize(("name", "largest_excess"), [("motorcycle", 0.02), ("amt", 0.2)])
def test_simulated_landings_on_a_stiff_layer_confirm_the_upper_estimate(
    name: str, largest_excess: float
) -> None:
    """Nine times the stiffness of the layer: loads near three times, the same for elastic dogs.

    Hunt and Crossley's dissipation, and slip in the longer blow, make the soft layer's estimate
    too high where the ring lands fast, as that of ``amt``.
    """
    demands = []
    for factor in (1.0, 9.0):
        stiffness = factor * ALONE.load.contact.stiffness
        study = ds.Study(name, {"contact.stiffness_Pa_m": stiffness})
        landings = study.strength(jobs=1).design.landings
        assert landings is not None
        demands.append(landings.demand(study.config.clutch.dog, study.config.limits))
    soft, stiff = demands
    for estimate, closer_estimate in zip(soft[:2], stiff[:2], strict=True):
        assert -0.01 < estimate / closer_estimate - 1.0 < largest_excess


def test_energy_under_the_law_impact() -> None:
    """K d^1.5 of a dog: two fifths of force times depth."""
    contact = CONTACT_SETS["adams_impact"]
    assert contact.impact is not None
    depth = 20e-6
    force = contact.impact.stiffness * depth**1.5
    (energy,) = blow_energies(np.array([force / WIDTH]), np.array([MM]), WIDTH, contact)
    work = quad(lambda x: contact.impact.stiffness * x**1.5, 0.0, depth)[0]
    assert energy == pytest.approx(work / WIDTH)


def test_stiffer_dogs_land_harder_by_the_root(prototype: Dog) -> None:
    """On faces, whose strip is that of the overlap whatever the load."""
    landing = np.zeros((1, 22))
    landing[0, 18] = 1e5
    stiff = replace(ALONE, load=replace(ALONE.load, dog_stiffness_factor=4.0))
    face, core, *_ = demands_of(prototype, landing, ALONE)[0]
    stiff_face, stiff_core, *_ = demands_of(prototype, landing, stiff)[0]
    assert stiff_face == pytest.approx(2.0 * face)
    assert stiff_core == pytest.approx(2.0 * core)


@pytest.mark.usefixtures("_skfem")
def test_stiffness_on_request(prototype: Dog) -> None:
    checks = stiffness_checks(prototype, 0.3 * MM)
    assert [check.place for check in checks] == [*LOAD_WORDS.values()]
    for check in checks:
        assert check.closed_form_N_um == pytest.approx(check.finite_elements_N_um, rel=0.12)
    roof = replace(prototype, crest=0.5, chamfer_back=prototype.chamfer)
    assert len(stiffness_checks(roof, 0.3 * MM)) == 4
