"""Stiffness of one dog of a study by finite elements beside the closed form."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dogshape.pipeline.record import Record, Table
from dogshape.sim.clutch_tables import key
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.dog_stiffness import (
    PLANE_MODULUS,
    Strip,
    face_compliance,
    flank_compliance,
)
from dogshape.sim.units import MM, from_si
from dogshape.validation.finite_elements.face_model import FaceModel
from dogshape.validation.finite_elements.root_mesh import SIDES, RootShape
from dogshape.validation.finite_elements.root_stress import BANDS, RootModel

FINENESS = 1  #: of the solid mesh; a finer one is 1 % softer
NARROW_STRIP = 0.1 * MM  #: m
#: Words of the loads, flanks first.
LOAD_WORDS = {
    ("traction", "whole"): "traction flank, all that touches",
    ("traction", "tip"): "traction flank, top fifth",
    ("braking", "whole"): "braking flank, all that touches",
    ("braking", "tip"): "braking flank, top fifth",
    ("face", "whole"): "face",
    ("face", "strip"): "strip of 0.1 mm beside the crest, plane strain",
}


class StiffnessCheck(Record):
    """Stiffness of one dog with its sector, by finite elements and by closed form."""

    place: str = key("pressed part of the dog")
    finite_elements_N_um: float = key("stiffness by finite elements", "N/um")
    closed_form_N_um: float = key("stiffness by closed form", "N/um")


def stiffness_checks(dog: Dog, root_radius: float) -> list[StiffnessCheck]:
    """Check flanks, and faces of a ridge on the traction edge, of a body one pitch deep.

    ``root_radius`` in m. Takes some seconds; InputError where scikit-fem is missing.
    """
    shape = RootShape(dog, root_radius, dog.pitch)
    return [
        StiffnessCheck(
            place=place,
            finite_elements_N_um=from_si("_N_um", 1.0 / elements),
            closed_form_N_um=from_si("_N_um", 1.0 / closed_form),
        )
        for place, elements, closed_form in _compliances(shape)
    ]


def _compliances(shape: RootShape) -> Iterator[tuple[str, float, float]]:
    """Yield the compliances of each load by both methods, m/N."""
    dog = shape.dog
    solid = RootModel(shape, FINENESS)
    for flank in SIDES:
        for band in BANDS:
            compliance, load = solid.flank_compliance(flank, band)
            yield LOAD_WORDS[flank, band], compliance, flank_compliance(dog, flank, load)
    if dog.crest != 1.0:  # the mesh has no ridge between two faces
        return
    whole = face_compliance(dog, Strip(0.0, dog.face_width))
    yield LOAD_WORDS["face", "whole"], solid.face_compliance(), whole
    number = FaceModel(shape).compliance(0.0, NARROW_STRIP)
    plane = number / (PLANE_MODULUS * dog.radial_width)
    closed_form = face_compliance(dog, Strip(0.0, NARROW_STRIP), short_dog=1.0)
    yield LOAD_WORDS["face", "strip"], plane, closed_form


def stiffness_table(checks: Sequence[StiffnessCheck]) -> Table:
    """Tabulate the stiffness by finite elements beside the closed form."""
    heads = "stiffness of one dog", "finite elements, N/um", "closed form, N/um", "ratio"
    rows = []
    for check in checks:
        ratio = check.closed_form_N_um / check.finite_elements_N_um
        row = (
            check.place,
            f"{check.finite_elements_N_um:.0f}",
            f"{check.closed_form_N_um:.0f}",
            f"{ratio:.2f}",
        )
        rows.append(row)
    return Table(heads, rows)
