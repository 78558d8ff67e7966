"""Stiffness of a dog at flank and face by finite elements against closed forms.

    python -m benchmarks.dog_stiffness

Three-dimensional elements of one pitch (``validation.finite_elements.root_stress``) for flanks, and
graded elements of its section in plane strain (``validation.finite_elements.face_model``) for
narrow strips of the face. Closed forms are those of ``sim.strength.dog_stiffness``; designs are
those of ``benchmarks.root_stress``, fitted and held out. Takes two minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.root_stress import (
    FINE,
    FIT_DESIGNS,
    PROTOTYPE,
    SIX,
    TEST_DESIGNS,
    Design,
    draw_designs,
    shape_of,
)
from dogshape.sim.shift.geometry import Dog, Flank
from dogshape.sim.strength.dog_stiffness import (
    FACE,
    FLANK,
    PLANE_MODULUS,
    SHORT_DOG,
    FaceFit,
    FlankFit,
    FlankLoad,
    Strip,
    face_compliance,
    flank_compliance,
    wedge_compliance,
)
from dogshape.sim.units import MM
from dogshape.validation.finite_elements.face_model import FaceModel
from dogshape.validation.finite_elements.root_mesh import SIDES, RootShape
from dogshape.validation.finite_elements.root_stress import BANDS, Band, RootModel

FINENESS = 1  #: of the three-dimensional mesh
FIT_DEPTHS = (0.5, 1.0)  #: of the body, pitches
DEEP = 2.0  #: of the body, pitches, of no fitted design
STRIPS_MM = (0.02, 0.05, 0.15, 0.3, 0.6, 1.0, 1.5, 2.5, 4.0)
FACE_SHARES = (0.5, 0.8, 1.0)
SOLID_SHARES = (0.5, 1.0)
PRINTED_STRIPS = tuple(width * MM for width in (0.05, 0.3, 1.0))  #: m
WIDTHS_MM = (2.0, 8.0, 16.0)
BACKLASHES = (0.1, 0.2, 0.3)  #: pitches
RADII_MM = (0.0, 0.1, 0.3)  #: of the crest
NAMED_DESIGNS = (("prototype", PROTOTYPE), ("fine", FINE), ("six", SIX))
MICRON_MM = 1e-9  #: N/m a m in N/(um mm)

Values = NDArray[np.float64]


@dataclass(frozen=True)
class FlankCase:
    """Compliance of a design at a flank by finite elements."""

    dog: Dog
    depth: float  #: of the body, pitches
    flank: Flank
    band: Band
    compliance: float  #: m/N
    load: FlankLoad

    def closed_form(self, fit: FlankFit = FLANK) -> float:
        """Compute the compliance by closed form, m/N."""
        return flank_compliance(self.dog, self.flank, self.load, self.depth, fit)


@dataclass(frozen=True)
class FaceCase:
    """Compliance of a section under a strip of the face by finite elements in plane strain."""

    dog: Dog
    depth: float  #: of the body, pitches
    edge_radius: float  #: of the crest, m
    strip: Strip
    share: float  #: of the face that the strip takes
    compliance: float  #: m/N

    def closed_form(self, fit: FaceFit = FACE) -> float:
        """Compute the compliance in plane strain by closed form, m/N."""
        return face_compliance(self.dog, self.strip, self.depth, fit, short_dog=1.0)


def flank_cases(design: Design, depth: float, fineness: int = FINENESS) -> list[FlankCase]:
    """Compute a design at both flanks under both bands."""
    shape = shape_of(design, depth)
    model = RootModel(shape, fineness)
    return [
        FlankCase(shape.dog, depth, flank, band, *model.flank_compliance(flank, band))
        for flank in SIDES
        for band in BANDS
    ]


def face_cases(design: Design, depth: float, edge_radius: float = 0.0) -> list[FaceCase]:
    """Compute a design under strips of its face."""
    shape = shape_of(design, depth)
    model = FaceModel(shape, edge_radius)
    start = edge_radius * shape.dog.crest_cut
    flat_width = model.face_width - start
    widths = {width * MM for width in STRIPS_MM} | {share * flat_width for share in FACE_SHARES}
    cases = []
    for width in sorted(width for width in widths if width <= flat_width):
        number = model.compliance(start, start + width)
        compliance = number / (PLANE_MODULUS * shape.dog.radial_width)
        strip = Strip(start, width)
        share = width / model.face_width
        cases.append(FaceCase(shape.dog, depth, edge_radius, strip, share, compliance))
    return cases


class Deviations(NamedTuple):
    """Deviations of the closed form from finite elements, %."""

    count: int
    mean: float
    rms: float
    largest: float


def deviations(cases: Iterable[FlankCase] | Iterable[FaceCase]) -> Deviations:
    """Compute the deviations of stiffness of cases."""
    values = np.array([case.compliance / case.closed_form() - 1.0 for case in cases]) * 100.0
    largest = float(values[np.abs(values).argmax()])
    return Deviations(len(values), values.mean(), math.sqrt(np.mean(values**2)), largest)


def fit(residuals: Callable[[Values], list[float]], start: tuple[float, ...]) -> list[float]:
    """Fit coefficients to relative deviations."""
    return [float(value) for value in least_squares(residuals, start).x]


def fit_flank(cases: list[FlankCase]) -> FlankFit:
    """Fit the closed form of a flank."""
    return FlankFit(
        *fit(lambda x: [c.closed_form(FlankFit(*x)) / c.compliance - 1.0 for c in cases], FLANK)
    )


def fit_face(cases: list[FaceCase]) -> FaceFit:
    """Fit the closed form of a face."""
    return FaceFit(
        *fit(lambda x: [c.closed_form(FaceFit(*x)) / c.compliance - 1.0 for c in cases], FACE)
    )


def pair_stiffness(compliance: float, dog: Dog) -> float:
    """Convert the compliance of one dog to the stiffness of a pair over its width, N/(um mm)."""
    return MICRON_MM / (2.0 * compliance * dog.radial_width)


def print_narrow_strips() -> None:
    """Print how the compliance of narrow strips grows, beside the closed form of a wedge."""
    print(
        "\nNarrow strips of the section: compliance times E b/(1 - nu2) over the logarithm of the"
    )
    print("width, 10 to 40 um, and W of the wedge of the crest")
    for name, design in NAMED_DESIGNS:
        dog = shape_of(design).dog
        model = FaceModel(shape_of(design))
        slope = (model.compliance(0.0, 1e-5) - model.compliance(0.0, 4e-5)) / math.log(4.0)
        wedge = (1.0 + dog.tangents[0] ** 2) * wedge_compliance(dog.crest_cut)
        print(f"  {name:<10} {slope:6.3f} {wedge:6.3f} {100.0 * (slope / wedge - 1.0):+5.2f} %")


def print_mesh() -> None:
    """Print the stiffness of flanks and faces on refined meshes."""
    print("Mesh: stiffness of one dog of the prototype in N/um on meshes of fineness 1 and 2;")
    print("traction flank whole and tip, braking flank whole and tip, whole face")
    for fineness in (1, 2):
        cases = flank_cases(PROTOTYPE, 1.0, fineness)
        face = RootModel(shape_of(PROTOTYPE), fineness).face_compliance()
        stiffnesses = [1e-6 / compliance for compliance in (*(c.compliance for c in cases), face)]
        print(f"  {fineness} " + "".join(f"{value:8.1f}" for value in stiffnesses), flush=True)


def print_designs() -> None:
    """Print the stiffness of a pair of dogs by body depth, with the closed form."""
    print(
        "\nStiffness of a pair of like dogs over its radial width, N/(um mm): elements, closed form"
    )
    print(
        "  body in pitches; traction flank whole, tip; strip of 0.05, 0.3 and 1 mm of the face in"
    )
    print("  plane strain; whole face in three dimensions")
    for name, design in NAMED_DESIGNS:
        for depth in (*FIT_DEPTHS, DEEP):
            dog = shape_of(design).dog
            solid = RootModel(shape_of(design, depth), FINENESS).face_compliance()
            formula = face_compliance(dog, Strip(0.0, dog.face_width), depth)
            faces = [c for c in face_cases(design, depth) if c.strip.width in PRINTED_STRIPS]
            cases = [*flank_cases(design, depth)[:2], *faces]
            pairs = [(case.compliance, case.closed_form()) for case in cases]
            print(f"  {name:<10} {depth:4.1f}", end="")
            for compliances in [*pairs, (solid, formula)]:
                elements, closed_form = (pair_stiffness(c, dog) for c in compliances)
                print(f"   {elements:5.1f} {closed_form:5.1f}", end="")
            print(flush=True)


def print_other_rings() -> None:
    """Print deviations of the prototype with other radial widths, and with backlash."""
    print(
        "\nPrototype on other rings: deviation of the stiffness in %, traction flank whole and tip,"
    )
    print("braking flank whole and tip, whole face")
    prototype = shape_of(PROTOTYPE).dog
    mean_diameter = 2.0 * prototype.mean_radius
    rings = {f"{width:g} mm along the radius": {"width": width * MM} for width in WIDTHS_MM}
    rings |= {f"backlash of {share:g} pitches": {"backlash": share} for share in BACKLASHES}
    for name, change in rings.items():
        width = change.get("width", prototype.radial_width)
        dog = replace(
            prototype,
            outer_diameter=mean_diameter + width,
            inner_diameter=mean_diameter - width,
            backlash=change.get("backlash", 0.0) * prototype.pitch,
        )
        model = RootModel(RootShape(dog, PROTOTYPE[-1] * MM, dog.pitch), FINENESS)
        ratios = []
        for flank in SIDES:
            for band in BANDS:
                compliance, load = model.flank_compliance(flank, band)
                ratios.append(compliance / flank_compliance(dog, flank, load))
        face = face_compliance(dog, Strip(0.0, dog.face_width))
        ratios.append(model.face_compliance() / face)
        print(f"  {name:<24}" + "".join(f"{100.0 * (r - 1.0):+7.1f}" for r in ratios), flush=True)


def print_three_dimensions(designs: list[Design]) -> None:
    """Print the compliance of a face in three dimensions over that in plane strain."""
    print("\nCompliance of the face in three dimensions over plane strain: mean, sd, ends")
    for depth in (*FIT_DEPTHS, DEEP):
        ratios: dict[float, list[float]] = {share: [] for share in SOLID_SHARES}
        for design in designs:
            shape = shape_of(design, depth)
            section = FaceModel(shape)
            solid = RootModel(shape, FINENESS)
            for share, row in ratios.items():
                width = share * shape.dog.face_width
                compliance = solid.face_compliance(None if share == 1.0 else width)
                number = compliance * PLANE_MODULUS * shape.dog.radial_width
                row.append(number / section.compliance(0.0, width))
        for share, row in ratios.items():
            print(
                f"  body {depth:3.1f} pitches, strip {share:3.1f} of the face: {np.mean(row):5.3f} "
                f"{np.std(row):5.3f} {min(row):5.3f} {max(row):5.3f}",
                flush=True,
            )
    print(f"  in the closed form: {SHORT_DOG}")


def print_fit(title: str, fitted: NamedTuple, coefficients: NamedTuple) -> None:
    """Print the coefficients of a closed form beside those fitted again."""
    print(f"\nCoefficients of the {title}, and fitted again")
    for name, value, again in zip(coefficients._fields, coefficients, fitted, strict=True):
        print(f"  {name:<10}{value:8.3f}{again:9.4f}")


def print_deviations(title: str, groups: dict[str, list[FlankCase] | list[FaceCase]]) -> None:
    """Print the deviations of the closed form by group."""
    print(f"\n{title}: cases; mean, rms and largest deviation of the stiffness in %")
    for name, cases in groups.items():
        if cases:
            row = deviations(cases)
            print(f"  {name:<34}{row.count:5d}{row.mean:+7.1f}{row.rms:6.1f}{row.largest:+7.1f}")


def flank_groups(cases: list[FlankCase]) -> dict[str, list[FlankCase] | list[FaceCase]]:
    """Group cases of flanks by band and depth."""
    return {
        f"{band}, body {depth:g} pitches": [
            case for case in cases if case.band == band and case.depth == depth
        ]
        for band in BANDS
        for depth in (*FIT_DEPTHS, DEEP)
    }


def face_groups(cases: list[FaceCase]) -> dict[str, list[FlankCase] | list[FaceCase]]:
    """Group cases of faces by strip, depth and rounding."""
    sharp = [case for case in cases if case.edge_radius == 0.0]
    groups: dict[str, list[FlankCase] | list[FaceCase]] = {
        "strips below 0.1 of the face": [c for c in sharp if c.share < 0.1],
        "strips of 0.1 to 0.6": [c for c in sharp if 0.1 <= c.share < 0.6],
        "strips from 0.6 on": [c for c in sharp if c.share >= 0.6],
    }
    for depth in (*FIT_DEPTHS, DEEP):
        groups[f"body {depth:g} pitches"] = [c for c in sharp if c.depth == depth]
    for radius in RADII_MM[1:]:
        groups[f"beside a rounding of {radius} mm"] = [
            c for c in cases if c.edge_radius == radius * MM
        ]
    return groups


def main() -> None:
    """Print everything."""
    fit_designs = draw_designs(*FIT_DESIGNS)
    test_designs = draw_designs(*TEST_DESIGNS)
    print_mesh()
    print_narrow_strips()
    print_three_dimensions([PROTOTYPE, FINE, SIX, *test_designs])
    print_designs()
    print_other_rings()
    flank_fit = [c for depth in FIT_DEPTHS for d in fit_designs for c in flank_cases(d, depth)]
    face_fit = [c for depth in FIT_DEPTHS for d in fit_designs for c in face_cases(d, depth)]
    rounded = [r * MM for r in RADII_MM[1:]]
    face_fit += [c for r in rounded for d in fit_designs[:6] for c in face_cases(d, 1.0, r)]
    print_fit("flank", fit_flank(flank_fit), FLANK)
    print_fit("face", fit_face(face_fit), FACE)
    depths = (*FIT_DEPTHS, DEEP)
    flank_test = [c for depth in depths for d in test_designs for c in flank_cases(d, depth)]
    face_test = [c for depth in depths for d in test_designs for c in face_cases(d, depth)]
    face_test += [c for r in rounded for d in test_designs for c in face_cases(d, 1.0, r)]
    print_deviations("Flanks, fitted designs", flank_groups(flank_fit))
    print_deviations(f"Flanks, held out, {TEST_DESIGNS[0]} designs", flank_groups(flank_test))
    print_deviations("Faces, fitted designs", face_groups(face_fit))
    print_deviations(f"Faces, held out, {TEST_DESIGNS[0]} designs", face_groups(face_test))


if __name__ == "__main__":
    main()
