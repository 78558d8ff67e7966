"""The pair of rings as solids in a STEP file, for drawing and machining.

Planes and cylinders of one pitch are joined to an open shell that reaches a little beyond inner and
outer radius; a sector of a plain ring is split with it, and the part below is repeated about the
axis and sewn. So the kernel (Open CASCADE, through build123d) never has to make a fillet, its one
operation that fails for small lands. build123d is an optional extra and slow to import.

The file is of AP242 (ISO 10303-242). Diameters of a ring and radii of its roots are dimensions with
tolerances on their faces, which a program reads; height and angles have theirs in the drawing.
"""

from __future__ import annotations

import io
import itertools
import math
import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.sim.files import name_file_in_errors
from dogshape.sim.part import dog_corners, fill_plane, require_room
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import Corner, Lines, Vertices, rotation
from dogshape.sim.shift.pair import Pair
from dogshape.sim.units import MM

SHELL_MARGIN = 0.02e-3  #: reach of the shell beyond the annulus, m; less than a land
FLOOR_MARGIN = 0.01  #: reach of the floors beyond the cut, rad
POLYGON_STEP = math.radians(1.0)  #: of the polygons that end the planes of the shell, rad
CORNER_LINES = 8  #: lines that sample a rounded corner
CUT_TOLERANCE = 1e-9  #: angle within which a face lies in a cut, rad
RADIUS_TOLERANCE = 1e-6  #: within which a cylinder has the radius of a dimension, mm
SCHEMA_KEY = "write.step.schema"  #: of the kernel's settings
SCHEMA = "AP242DIS"
#: A fixed time in the header: the same rings give the same file.
HEADER_TIME = "2000-01-01T00:00:00"


def load_cad() -> Any:
    """Import build123d, an optional extra; InputError with the way to install it."""
    try:
        return import_module("build123d")
    except ImportError as error:
        fault = f"STEP files need build123d, which cannot be loaded ({error})"
        remedy = "install 'dogshape[cad]' with pip, and on Debian the packages libgl1 and libx11-6"
        raise InputError(f"{fault}; {remedy}") from error


def require_all_dogs(pair: Pair, *, step: bool, ring: str = "output") -> None:
    """Raise InputError for a solid or surface of a ring whose dogs are missing or low.

    ``step`` has both rings, a surface the ``ring`` alone.
    """
    rings = {"sliding": pair.sliding_dogs, "output": pair.output_dogs}
    written_rings = rings.values() if step else [rings[ring]]
    if any(dogs.pitches > 1 for dogs in written_rings):
        full_ring = next(name for name, dogs in rings.items() if dogs.pitches == 1)
        raise InputError(
            f"output_dog.slots_per_dog is {pair.slots_per_dog}, but solids and surfaces have equal "
            f"dogs at every pitch; write the {full_ring} ring as a surface, or the section as DXF"
        )


def write_step(
    pair: Pair,
    root_radius: float,
    body: float,
    path: Path,
    tolerances: Mapping[str, float] | None = None,
) -> None:
    """Write both rings in neutral to a STEP file in mm.

    Two solids, ``sliding ring`` and ``output ring``, on the z axis with their crests an
    axial gap apart; dogs face slots, so that an axial move alone leads to full depth.
    The gap is between the sharp crests: with a chamfer, rounded ones stand a little lower.

    Parameters
    ----------
    pair
        Dogs of both rings.
    root_radius
        Radius of fillets and rounded tips, m.
    body
        Thickness of either ring below the floors of its slots, m.
    path
        File to write.
    tolerances
        Largest deviations either way by the names of dimensions (``Tolerances.dimensions``), m;
        those of ``outer_diameter``, ``inner_diameter`` and ``root_radius`` are written.

    Raises
    ------
    InputError
        Without build123d, or where dogs of a ring are missing or low.
    GeometryError
        Where fillets or roundings do not fit, or the body has no thickness.

    """
    require_all_dogs(pair, step=True)
    cad = load_cad()
    sliding_ring = ring_solid(pair.sliding, root_radius, body)
    output_ring = sliding_ring if pair.alike else ring_solid(pair.output, root_radius, body)
    # Transformed, not moved: a moved copy would share the name of the first ring.
    output_ring = output_ring.rotate(cad.Axis.X, 180.0, transform=True)
    half_pitch = math.degrees(0.5 * pair.sliding.pitch_angle)
    output_ring = output_ring.rotate(cad.Axis.Z, half_pitch, transform=True)
    output_ring = output_ring.translate((0.0, 0.0, pair.travel / MM), transform=True)
    sliding_ring.label = "sliding ring"
    output_ring.label = "output ring"
    rings = ((sliding_ring, pair.sliding), (output_ring, pair.output))
    document = _document(cad, rings, root_radius, tolerances or {})
    with name_file_in_errors(path):
        path.write_bytes(_number_parts(_step_content(document)))


def _document(
    cad: Any,
    rings: Sequence[tuple[Any, Dog]],
    root_radius: float,
    tolerances: Mapping[str, float],
) -> Any:
    """Build the document of an assembly of rings with their dimensions."""
    framework = import_module("OCP.TDocStd")
    tools = import_module("OCP.XCAFDoc").XCAFDoc_DocumentTool
    application = import_module("OCP.XCAFApp").XCAFApp_Application.GetApplication_s()
    document = framework.TDocStd_Document(_text("XmlOcaf"))
    application.NewDocument(_text("MDTV-XCAF"), document)
    application.InitDocument(document)
    tools.SetLengthUnit_s(document, MM)
    shapes = tools.ShapeTool_s(document.Main())
    assembly = shapes.NewShape()
    _name(assembly, "dog clutch")
    place = import_module("OCP.TopLoc").TopLoc_Location()
    for ring, dog in rings:
        part = shapes.AddShape(ring.wrapped, False)
        _name(part, ring.label)
        _name(shapes.AddComponent(assembly, part, place), ring.label)
        _add_dimensions(cad, document, part, ring, _dimensions(dog, root_radius, tolerances))
    shapes.UpdateAssemblies()
    return document


def _text(words: str) -> Any:
    """Convert a text to one of the kernel."""
    return import_module("OCP.TCollection").TCollection_ExtendedString(words)


def _name(label: Any, words: str) -> None:
    import_module("OCP.TDataStd").TDataStd_Name.Set_s(label, _text(words))


class _Dimension(NamedTuple):
    """Size of cylinders: their radius, its kind by the kernel, and the tolerance, mm."""

    radius: float
    kind: str
    size: float
    tolerance: float


def _dimensions(dog: Dog, root_radius: float, tolerances: Mapping[str, float]) -> list[_Dimension]:
    """List the dimensions of a ring that have a tolerance."""
    dimensions = []
    for name in ("outer_diameter", "inner_diameter"):
        diameter = getattr(dog, name) / MM
        tolerance = tolerances.get(name, 0.0) / MM
        dimensions.append(_Dimension(0.5 * diameter, "Size_Diameter", diameter, tolerance))
    radius = root_radius / MM
    tolerance = tolerances.get("root_radius", 0.0) / MM
    dimensions.append(_Dimension(radius, "Size_Radius", radius, tolerance))
    return [dimension for dimension in dimensions if dimension.tolerance > 0.0]


def _add_dimensions(
    cad: Any, document: Any, part: Any, ring: Any, dimensions: Sequence[_Dimension]
) -> None:
    """Add each dimension to the cylinders of a ring that have its radius."""
    xde = import_module("OCP.XCAFDoc")
    objects = import_module("OCP.XCAFDimTolObjects")
    shapes = xde.XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    table = xde.XCAFDoc_DocumentTool.DimTolTool_s(document.Main())
    labels_of = import_module("OCP.OCP.collections").Sequence_TDF_Label
    kinds = objects.XCAFDimTolObjects_DimensionType
    cylinders = [face for face in ring.faces() if face.geom_type == cad.GeomType.CYLINDER]
    for dimension in dimensions:
        faces = [
            face for face in cylinders if abs(face.radius - dimension.radius) < RADIUS_TOLERANCE
        ]
        if not faces:
            continue
        first_labels, second_labels = labels_of(), labels_of()
        for face in faces:
            first_labels.Append(shapes.AddSubShape(part, face.wrapped))
        label = table.AddDimension()
        table.SetDimension(first_labels, second_labels, label)
        size = objects.XCAFDimTolObjects_DimensionObject()
        size.SetType(getattr(kinds, f"XCAFDimTolObjects_DimensionType_{dimension.kind}"))
        size.SetValue(dimension.size)
        size.SetLowerTolValue(dimension.tolerance)
        size.SetUpperTolValue(dimension.tolerance)
        xde.XCAFDoc_Dimension.Set_s(label).SetObject(size)


def _step_content(document: Any) -> bytes:
    """Write a document as a STEP file of AP242."""
    control = import_module("OCP.STEPControl")
    settings = import_module("OCP.Interface").Interface_Static
    gravity = import_module("OCP.Message").Message_Gravity.Message_Fail
    for printer in import_module("OCP.Message").Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(gravity)
    control.STEPControl_Controller.Init_s()
    previous_schema = settings.CVal_s(SCHEMA_KEY)
    settings.SetCVal_s(SCHEMA_KEY, SCHEMA)
    try:
        writer = import_module("OCP.STEPCAFControl").STEPCAFControl_Writer()
        writer.SetNameMode(True)
        writer.SetDimTolMode(True)
        writer.Transfer(document, control.STEPControl_StepModelType.STEPControl_AsIs)
        header = import_module("OCP.APIHeaderSection").APIHeaderSection_MakeHeader(
            writer.ChangeWriter().Model()
        )
        ascii_text = import_module("OCP.TCollection").TCollection_HAsciiString
        header.SetName(ascii_text("dog clutch"))
        header.SetTimeStamp(ascii_text(HEADER_TIME))
        buffer = io.BytesIO()
        writer.WriteStream(buffer)
    finally:
        settings.SetCVal_s(SCHEMA_KEY, previous_schema)
    return buffer.getvalue()


def _number_parts(content: bytes) -> bytes:
    """Number the parts of a STEP file from 1; the kernel goes on counting from file to file."""
    numbers = itertools.count(1)
    pattern = rb"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\(')\d+'"
    return re.sub(pattern, lambda match: b"%b%d'" % (match[1], next(numbers)), content)


def ring_solid(dog: Dog, root_radius: float, body: float) -> Any:
    """Build one ring in its own frame (``sim.shift.mesh``) as a build123d solid in mm.

    Parameters and errors are those of ``write_step``.
    """
    require_room(dog, root_radius)
    cad = load_cad()
    corners = dog_corners(dog, root_radius)
    cut_angle = _floor_angle(dog, corners)
    shell = cad.Shell(_toothed_side(cad, dog, corners, cut_angle=cut_angle))
    halves = _sector(cad, dog, body, cut_angle=cut_angle).split(shell, keep=cad.Keep.ALL)
    pitch = min(halves, key=lambda half: half.center().Z)
    faces = []
    for face in pitch.faces():
        angle = math.atan2(face.center().Y, face.center().X)
        is_cut = abs(math.remainder(angle - cut_angle, dog.pitch_angle)) <= CUT_TOLERANCE
        if not is_cut:
            faces.append(face)
    ring_faces = []
    for index in range(dog.count):
        turn = math.degrees(index * dog.pitch_angle)
        ring_faces += [face.rotate(cad.Axis.Z, turn) for face in faces]
    return cad.Solid(cad.Shell(ring_faces)).clean()


def _floor_angle(dog: Dog, corners: Sequence[Corner]) -> float:
    """Compute the angle of the radial plane through the middle of the slot's floor, rad.

    The middle is that at the inner radius, where the floor is narrowest: the plane stays on the
    floor all the way out.
    """
    begin = corners[-1].lines(1)[-1:].at(dog.inner_radius)[0]
    end = corners[0].lines(1)[:1].turned(dog.pitch_angle).at(dog.inner_radius)[0]
    x, y, _ = begin / math.hypot(*begin[:2]) + end / math.hypot(*end[:2])
    return math.atan2(y, x)


def _toothed_side(cad: Any, dog: Dog, corners: Sequence[Corner], cut_angle: float) -> list[Any]:
    """Build the faces of one pitch, floor to floor, a little larger than the annulus."""
    floor = np.array([[0.0, 0.0, -dog.dedendum]])
    radii = _shell_radii(dog)
    floor_edges = []
    for angle in (cut_angle - dog.pitch_angle - FLOOR_MARGIN, cut_angle + FLOOR_MARGIN):
        ray = Lines(floor, rotation(angle)[:, :1].T)
        inner, outer = (ray.at(radius)[0] for radius in radii)
        floor_edges.append(_Edge(ray, inner, outer))
    first_edge, last_edge = floor_edges
    previous_edge = first_edge
    faces = []
    for corner in corners:
        begin, end = _corner_edges(corner, radii)
        faces.append(_plane(cad, dog, previous_edge, begin))
        if corner.radius:
            faces.append(_cylinder(cad, corner, begin, end))
        previous_edge = end
    return [*faces, _plane(cad, dog, previous_edge, last_edge)]


class _Edge(NamedTuple):
    """A line of the shell with its two ends (3,), m."""

    line: Lines
    inner: Vertices
    outer: Vertices


def _corner_edges(corner: Corner, radii: tuple[float, float]) -> tuple[_Edge, _Edge]:
    """Return the two edges of a rounded corner, cut at right angles to its axis.

    The cuts lie beyond the ``radii`` of the shell, m.
    """
    lines = corner.lines(CORNER_LINES)
    inner_radius, outer_radius = radii
    inner_cuts = (lines.at(inner_radius) - corner.axis) @ corner.direction
    outer_cuts = (lines.at(outer_radius) - corner.axis) @ corner.direction
    inner_way = float(inner_cuts.min())
    outer_way = float(outer_cuts.max())
    begin, end = (
        _Edge(
            line,
            line.points[0] + inner_way * line.directions[0],
            line.points[0] + outer_way * line.directions[0],
        )
        for line in (lines[:1], lines[-1:])
    )
    return begin, end


def _shell_radii(dog: Dog) -> tuple[float, float]:
    """Return inner and outer radius of the shell, m."""
    return dog.inner_radius - SHELL_MARGIN, dog.outer_radius + SHELL_MARGIN


def _plane(cad: Any, dog: Dog, begin: _Edge, end: _Edge) -> Any:
    """Build the plane face between two edges; many points keep its ends off the annulus."""
    inner_radius, outer_radius = _shell_radii(dog)
    lines = fill_plane(begin.line, end.line, (inner_radius, outer_radius), POLYGON_STEP)
    inner = [*lines.at(inner_radius)] if len(lines.points) else []
    outer = [*lines.at(outer_radius)] if len(lines.points) else []
    points = [begin.inner, *inner, end.inner, end.outer, *outer[::-1], begin.outer]
    return cad.Face(cad.Wire.make_polygon([_mm(point) for point in points], close=True))


def _cylinder(cad: Any, corner: Corner, begin: _Edge, end: _Edge) -> Any:
    """Build the cylinder of a corner: an arc across its axis, extruded along it."""
    middle = corner.radius * corner.normals(np.array([0.5]))[0]
    offset = begin.inner - corner.axis
    centre = corner.axis + (offset @ corner.direction) * corner.direction
    arc = cad.Edge.make_three_point_arc(_mm(begin.inner), _mm(centre + middle), _mm(end.inner))
    return cad.Face.extrude(arc, _mm(begin.outer - begin.inner))


def _sector(cad: Any, dog: Dog, body: float, cut_angle: float) -> Any:
    """Build one pitch of a plain ring that ends above the crests."""
    bottom = -dog.dedendum - body
    top = dog.addendum + 1.0 * MM
    angles = (cut_angle - dog.pitch_angle, cut_angle - 0.5 * dog.pitch_angle, cut_angle)

    def rim(radius: float) -> list[tuple[float, float, float]]:
        return [
            _mm(np.array([radius * math.cos(angle), radius * math.sin(angle), bottom]))
            for angle in angles
        ]

    inner_rim = rim(dog.inner_radius)
    outer_rim = rim(dog.outer_radius)
    inner_arc = cad.Edge.make_three_point_arc(*inner_rim)
    outer_arc = cad.Edge.make_three_point_arc(*outer_rim)
    begin_side = cad.Edge.make_line(inner_rim[0], outer_rim[0])
    end_side = cad.Edge.make_line(inner_rim[-1], outer_rim[-1])
    outline = cad.Face(cad.Wire([inner_arc, begin_side, outer_arc, end_side]))
    return cad.Solid.extrude(outline, cad.Vector(0.0, 0.0, (top - bottom) / MM))


def _mm(point: Vertices) -> tuple[float, float, float]:
    """Convert a point (3,) from m to mm."""
    x, y, z = point / MM
    return float(x), float(y), float(z)
