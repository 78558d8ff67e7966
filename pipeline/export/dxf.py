"""The developed section of both rings as a DXF file (R2010, mm), in the position before the shift.

The section at the mean radius is unrolled: along x the whole circumference, along y the axis, with
the crests of the output ring at 0 and those of the sliding ring an axial gap above. Fillets and
roundings are arcs of the polylines. ezdxf is an optional extra.
"""

from __future__ import annotations

import cmath
import io
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from dogshape.pipeline.export.drawing import DATUM, notes_of, size_text, slope_text
from dogshape.sim.errors import InputError
from dogshape.sim.files import name_file_in_errors
from dogshape.sim.shift.geometry import section, tip_radius
from dogshape.sim.shift.pair import Pair, RingDogs
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.units import MM

VERSION = "R2010"
SLIDING_LAYER = "SLIDING_RING"
OUTPUT_LAYER = "OUTPUT_RING"
AXIS_LAYER = "PITCH_PLANES"
DIMENSION_LAYER = "DIMENSIONS"
NOTE_LAYER = "NOTES"
#: Colour by the index of AutoCAD, and line type, by layer.
LAYERS = {
    SLIDING_LAYER: (5, "CONTINUOUS"),
    OUTPUT_LAYER: (30, "CONTINUOUS"),
    AXIS_LAYER: (8, "CENTER"),
    DIMENSION_LAYER: (7, "CONTINUOUS"),
    NOTE_LAYER: (7, "CONTINUOUS"),
}
TEXT_SHARE = 0.1  #: height of a text over that of the lower dog
NOTE_WIDTH = 70.0  #: of the notes, in heights of their text
MIDDLE_CENTER = 5  #: attachment point of a text, DXF


def load_dxf() -> Any:
    """Import ezdxf, an optional extra; InputError with the way to install it."""
    try:
        return import_module("ezdxf")
    except ImportError as error:
        fault = f"DXF files need ezdxf, which cannot be loaded ({error})"
        raise InputError(f"{fault}; install 'dogshape[dxf]' with pip") from error


class _Corner(NamedTuple):
    """Corner of an outline with the radius of its arc, mm."""

    place: complex
    radius: float


def ring_outlines(
    ring: RingDogs,
    limits: Limits,
    body: float,
    *,
    first: int = 0,
    teeth: bool = False,
) -> list[list[tuple[float, float, float]]]:
    """Trace a ring, dogs up, its crests at 0: corners (x, y, bulge) in mm, by closed polyline.

    A bulge is the tangent of a quarter of the arc that follows its corner. The first pitch is about
    x = 0, and a high dog stands at that of number ``first``. ``teeth`` of a sleeve are polylines of
    their own; ``body`` is the depth below the floors, m.
    """
    dog = ring.dog
    rise = dog.addendum / MM
    floor = -(dog.addendum + dog.dedendum) / MM
    back = floor - body / MM
    tip = tip_radius(dog, limits.root_radius) / MM
    root = 0.0 if teeth else limits.root_radius / MM
    pitch = dog.pitch / MM
    dogs = []
    for index in range(dog.count):
        pitch_dog = ring.low if (index - first) % ring.pitches else dog
        if pitch_dog is None:
            continue
        profile = [complex(x / MM, z / MM - rise) for x, z in section(pitch_dog)]
        radii = [root, *(len(profile) - 2) * [tip], root]
        dogs.append(
            [
                _Corner(place + index * pitch, radius)
                for place, radius in zip(profile, radii, strict=True)
            ]
        )
    if teeth:
        return [_polyline(_closed(tooth, floor=back, back=back)) for tooth in dogs]
    ends = [complex(-0.5 * pitch, floor), complex((dog.count - 0.5) * pitch, floor)]
    corners = [_Corner(ends[0], 0.0), *(corner for dog in dogs for corner in dog)]
    corners.append(_Corner(ends[1], 0.0))
    return [_polyline(_closed(corners, floor=floor, back=back))]


def _closed(corners: Sequence[_Corner], *, floor: float, back: float) -> list[_Corner]:
    """Add the corners of the back to the outline of dogs, mm."""
    last = _Corner(complex(corners[-1].place.real, back), 0.0)
    first = _Corner(complex(corners[0].place.real, back), 0.0)
    return [*corners, last, first]


def _polyline(corners: Sequence[_Corner]) -> list[tuple[float, float, float]]:
    """Replace the corners of a closed outline by arcs of their radius."""
    points = []
    for index, (corner, radius) in enumerate(corners):
        if radius == 0.0:
            points.append((corner.real, corner.imag, 0.0))
            continue
        before = corner - corners[index - 1].place
        after = corners[(index + 1) % len(corners)].place - corner
        turn = cmath.phase(after / before)
        cut = radius * math.tan(0.5 * abs(turn))
        begin = corner - cut * before / abs(before)
        end = corner + cut * after / abs(after)
        points.append((begin.real, begin.imag, math.tan(0.25 * turn)))
        points.append((end.real, end.imag, 0.0))
    return points


def write_dxf(pair: Pair, limits: Limits, body: float, title: str, path: Path) -> None:
    """Write the developed section of both rings with dimensions and notes.

    Parameters
    ----------
    pair
        Dogs of both rings.
    limits
        Root radius, tolerances, material and, of teeth rooted radially, the sleeve.
    body
        Depth of either ring below the floors of its slots, m.
    title
        Words above the notes.
    path
        File to write.

    Raises
    ------
    InputError
        Without ezdxf.

    """
    ezdxf = load_dxf()
    buffer = io.StringIO()
    with _fixed_header(ezdxf):
        document = ezdxf.new(VERSION, setup=True, units=ezdxf.units.MM)
        _draw(document, pair, limits, body, title)
        document.write(buffer)
    with name_file_in_errors(path):
        path.write_text(buffer.getvalue(), encoding=document.output_encoding, newline="\n")


@contextmanager
def _fixed_header(ezdxf: Any) -> Iterator[None]:
    """Write headers without time of day and random numbers: the same rings give the same file."""
    was_fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = was_fixed


def _draw(document: Any, pair: Pair, limits: Limits, body: float, title: str) -> None:
    """Draw outlines, pitch planes, dimensions and notes on their layers."""
    for name, (color, linetype) in LAYERS.items():
        document.layers.add(name, color=color, linetype=linetype)
    space = document.modelspace()
    gap = pair.sliding.axial_gap / MM
    half_pitch = 0.5 * pair.sliding.pitch / MM
    has_teeth = limits.sleeve is not None
    for outline in ring_outlines(pair.output_dogs, limits, body, teeth=has_teeth):
        space.add_lwpolyline(outline, format="xyb", close=True, dxfattribs={"layer": OUTPUT_LAYER})
    last = pair.sliding.count - 1  # where the turned ring begins
    for outline in ring_outlines(pair.sliding_dogs, limits, body, first=last, teeth=has_teeth):
        # Turned over: the first dog stands half a pitch ahead of the output ring's.
        turned = [(half_pitch - x, gap - y, bulge) for x, y, bulge in outline]
        shifted = [(x + 2.0 * half_pitch * last, y, b) for x, y, b in turned]
        space.add_lwpolyline(shifted, format="xyb", close=True, dxfattribs={"layer": SLIDING_LAYER})
    _add_pitch_planes(space, pair, gap)
    text_height = TEXT_SHARE * min(pair.sliding.height, pair.output.height) / MM
    _add_dimensions(space, pair, limits, gap, text_height)
    _add_datums(space, pair, gap, text_height, has_floors=not has_teeth)
    bottom = -pair.output.height / MM - body / MM
    place = (0.0, bottom - 6.0 * text_height)
    _add_notes(space, pair, limits, title, place=place, text_height=text_height)


def _add_pitch_planes(space: Any, pair: Pair, gap: float) -> None:
    """Draw the pitch plane of either ring along its dogs."""
    end = pair.output.count * pair.output.pitch / MM
    half_pitch = 0.5 * pair.output.pitch / MM
    for y in (-pair.output.addendum / MM, gap + pair.sliding.addendum / MM):
        line = ((-half_pitch, y), (end, y))
        space.add_line(*line, dxfattribs={"layer": AXIS_LAYER})


def _add_datums(
    space: Any, pair: Pair, gap: float, text_height: float, *, has_floors: bool
) -> None:
    """Draw the symbol of the datum (ISO 5459) of either ring.

    It stands on the extension line of the floors, of teeth without floors on the pitch plane.
    """
    output = pair.output
    sliding = pair.sliding
    x = -0.5 * output.pitch / MM - 2.0 * text_height
    if has_floors:
        levels = (-output.height / MM, gap + sliding.height / MM)
    else:
        levels = (-output.addendum / MM, gap + sliding.addendum / MM)
        for y in levels:
            end = (x - text_height, y)
            space.add_line((0.0, y), end, dxfattribs={"layer": AXIS_LAYER})
    layer = {"layer": DIMENSION_LAYER}
    for y, away in zip(levels, (-1.0, 1.0), strict=True):
        unit = away * text_height
        triangle = [(x - 0.3 * text_height, y), (x + 0.3 * text_height, y), (x, y + 0.5 * unit)]
        space.add_solid(triangle, dxfattribs=layer)
        frame_y = y + 1.2 * unit
        space.add_line((x, y), (x, frame_y), dxfattribs=layer)
        left = x - 0.8 * text_height
        right = x + 0.8 * text_height
        frame = [(left, frame_y), (right, frame_y), (right, frame_y + 1.6 * unit),
                 (left, frame_y + 1.6 * unit)]  # fmt: skip
        space.add_lwpolyline(frame, close=True, dxfattribs=layer)
        letter = space.add_mtext(DATUM, dxfattribs={**layer, "char_height": text_height})
        letter.set_location((x, frame_y + 0.8 * unit), attachment_point=MIDDLE_CENTER)


def _add_dimensions(space: Any, pair: Pair, limits: Limits, gap: float, text_height: float) -> None:
    """Draw pitch, root, heights and gap beside the first dogs, with tolerances."""
    output = pair.output
    sliding = pair.sliding
    pitch = output.pitch / MM
    floor = -output.height / MM
    sliding_floor = gap + sliding.height / MM
    (root_begin, _), *_, (root_end, _) = section(output)
    left = -0.5 * pitch - 4.0 * text_height
    further_left = left - 4.0 * text_height  # of the gap, whose text is longer than the gap
    roots = [(root_begin / MM, floor), (root_end / MM, floor)]
    style = {
        "dimtxt": text_height,
        "dimasz": 0.8 * text_height,
        "dimexe": 0.4 * text_height,
        "dimexo": 0.2 * text_height,
        "dimgap": 0.3 * text_height,
        "dimdec": 2,
        "dimtad": 1,
    }

    def add(begin: tuple[float, float], end: tuple[float, float], base: tuple[float, float],
            text: str, angle: float = 0.0) -> None:  # fmt: skip
        space.add_linear_dim(
            base=base,
            p1=begin,
            p2=end,
            angle=angle,
            text=text,
            override=style,
            dxfattribs={"layer": DIMENSION_LAYER},
        ).render()

    add(roots[0], roots[1], (0.0, floor - 2.0 * text_height), f"({output.root_width / MM:.2f})")
    way = pair.output_dogs.pitches * pitch
    second_root = (roots[1][0] + way, floor)
    add(roots[1], second_root, (0.0, floor - 5.0 * text_height), f"({way:.3f})")
    height = size_text(limits, "height", output.height)
    add((-0.5 * pitch, floor), (0.0, 0.0), (left, 0.0), height, 90.0)
    if pair.low is not None:
        low_height = size_text(limits, "height", pair.low.height)
        shortening = pair.shortening / MM
        begin, low_crest = (0.5 * pitch, floor), (pitch, -shortening)
        if pair.is_sliding_sparse:
            begin, low_crest = (pitch, sliding_floor), (1.5 * pitch, gap + shortening)
        add(begin, low_crest, (begin[0], 0.0), low_height, 90.0)
    axial_gap = size_text(limits, "axial_gap", sliding.axial_gap)
    add((0.0, 0.0), (0.5 * pitch, gap), (further_left, 0.0), axial_gap, 90.0)
    height = size_text(limits, "height", sliding.height)
    add((0.5 * pitch, gap), (0.0, sliding_floor), (left, 0.0), height, 90.0)


def _add_notes(
    space: Any,
    pair: Pair,
    limits: Limits,
    title: str,
    *,
    place: tuple[float, float],
    text_height: float,
) -> None:
    """Write angles and notes of the dogs, a paragraph each."""
    paragraphs = [title]
    rings = {"both rings": pair.sliding}
    if not pair.alike:
        rings = {"sliding ring": pair.sliding, "output ring": pair.output}
    for name, dog in rings.items():
        words = {"traction": "traction flank", "braking": "braking flank", "chamfer": "chamfer"}
        if dog.has_back:
            words["chamfer_back"] = "back chamfer"
        angles = [slope_text(limits, dog, key, word) for key, word in words.items()]
        root = size_text(limits, "root_radius", limits.root_radius)
        tip = f"{tip_radius(dog, limits.root_radius) / MM:.2f}"
        paragraphs.append(f"{name}: {', '.join(angles)}; roots R {root}, tip edges R {tip}")
    paragraphs += notes_of(pair.sliding, limits.beside(pair.output))
    text = "\\P".join(paragraph.replace("\\", "/") for paragraph in paragraphs)
    space.add_mtext(
        text,
        dxfattribs={
            "layer": NOTE_LAYER,
            "char_height": text_height,
            "width": NOTE_WIDTH * text_height,
            "insert": place,
        },
    )
