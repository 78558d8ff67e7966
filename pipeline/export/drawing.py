"""Drawings of the dogs as SVG: both rings before the shift, and one dog with its dimensions.

Both are sections at the mean radius, unrolled. Points are complex numbers x + iy in pixels, y
downwards; every stroke is the text of an element.
"""

from __future__ import annotations

import cmath
import math
import re
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from html import escape

import numpy as np

from dogshape.sim.shift.geometry import Dog, crest_loss, section, tip_radius
from dogshape.sim.shift.pair import Pair, RingDogs, sparse_ring
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.units import DEG, MM, from_si

WIDTH = 980.0  #: of the dimensioned section, px
HEIGHT = 592.0  #: of the dimensioned section with notes of ``NOTE_LINES``, px
NOTE_LINES = 5
NOTE_LINE_HEIGHT = 18.0  #: px
MARGIN = 36.0  #: left and right of title and notes, px
NOTE_LETTER_WIDTH = 6.4  #: of a character of a note, px; wider than the mean of common fonts
HEAD_LENGTH = 8.0  #: of an arrow, px
LETTER_WIDTH = 7.2  #: of a character, px; close enough for a background
DATUM = "A"  #: letter of the plane that heights are measured from
DATUM_SIZE = 18.0  #: of the frame of a datum's letter, px
TEXTURE_HEIGHT = 18.0  #: of a symbol of surface texture, px
PITCHES_IN_VIEW = (-2, -1, 0, 1, 2)  #: of the dimensioned section, from its dog
MIN_REACH = 0.775  #: reach of the dimensioned section either side of the dog, in pitches
STYLE = """
.drawing .part{fill:#dbe5f0;stroke:#1b2733;stroke-width:1.6}
.drawing .thin{fill:none;stroke:#55626f;stroke-width:.9}
.drawing .axis{fill:none;stroke:#55626f;stroke-width:.9;stroke-dasharray:12 3 2 3}
.drawing .ring-a{fill:#f3ddcb;stroke:#c8590c;stroke-width:2}
.drawing .ring-b{fill:#c9d8ea;stroke:#1f5fa8;stroke-width:2}
.drawing .ghost{fill:none;stroke:#1b2733;stroke-width:1.2;stroke-dasharray:5 4}
.drawing .bar{stroke:#1b2733;stroke-width:3}
.drawing .head{fill:#1b2733;stroke:none}
.drawing text{font:13px system-ui,sans-serif;fill:#1b2733}
.drawing text.title{font-size:16px;font-weight:600}
.drawing text.small{font-size:12px;fill:#55626f}
.drawing .back{fill:#fff;fill-opacity:.85;stroke:none}
"""


def _document(width: float, height: float, elements: Sequence[str], title: str) -> str:
    """Write an SVG document of elements, ``width`` by ``height`` px."""
    body = "\n".join(elements)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" class="drawing" role="img" '
        f'aria-label="{escape(title)}">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n{body}\n</svg>\n"
    )


def _coordinates(point: complex) -> str:
    return f"{point.real:.2f},{point.imag:.2f}"


def _path(commands: str, kind: str) -> str:
    """Draw a path in the style of a class."""
    return f'<path d="{commands}" class="{kind}"/>'


def _line(*points: complex, kind: str = "thin", closed: bool = False) -> str:
    """Draw straight lines through points."""
    end = " Z" if closed else ""
    return _path("M" + " L".join(map(_coordinates, points)) + end, kind)


def _text(
    place: complex, words: str, anchor: str = "middle", kind: str = "", turn: float = 0
) -> str:
    """Write a text turned by ``turn`` degrees, on a white ground unless it has a class."""
    x = place.real
    y = place.imag
    width = LETTER_WIDTH * len(words) + 4.0
    ground_x = {"middle": x - 0.5 * width, "start": x - 2.0, "end": x - width + 2.0}[anchor]
    ground = ""
    if not kind:
        ground = (
            f'<rect x="{ground_x:.1f}" y="{y - 12:.1f}" width="{width:.1f}" height="16" '
            'class="back"/>'
        )
    transform = f' transform="rotate({turn:.1f} {x:.1f} {y:.1f})"' if turn else ""
    return (
        f'<g{transform}>{ground}<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" '
        f'class="{kind}">{escape(words)}</text></g>'
    )


def _arrow(tip: complex, tail: complex) -> str:
    """Draw an arrow head at ``tip`` that points away from ``tail``."""
    direction = (tip - tail) / (abs(tip - tail) or 1.0)
    base = tip - HEAD_LENGTH * direction
    half_width = 2.6j * direction
    return _line(tip, base + half_width, base - half_width, kind="head", closed=True)


def _leader(tip: complex, place: complex, content: str, anchor: str = "start") -> str:
    """Draw a leader from the words at ``place`` to ``tip``."""
    offset = 5.0 if anchor == "start" else -5.0
    words = _text(place + offset + 4.0j, content, anchor)
    return _line(tip, place) + _arrow(tip, place) + words


def _datum(foot: complex) -> str:
    """Draw the symbol of the datum (ISO 5459) below the point ``foot`` of its plane."""
    frame = foot + 18.0j
    corners = [
        frame + 0.5 * DATUM_SIZE * x + DATUM_SIZE * y * 1j
        for x, y in ((-1, 0), (1, 0), (1, 1), (-1, 1))
    ]
    return "".join(
        [
            _line(foot - 5.0, foot + 5.0, foot + 8.0j, kind="head", closed=True),
            _line(foot, frame),
            _text(frame + 14.0j, DATUM),
            _line(*corners, closed=True),
        ]
    )


def _texture(tip: complex, place: complex, content: str) -> str:
    """Draw a symbol of surface texture (ISO 21920-1) on a leader from ``place`` to ``tip``.

    The line below the symbol begins at ``place`` and leads away from ``tip``.
    """
    width = LETTER_WIDTH * len(content) + 14.0
    begin = place if place.real >= tip.real else place - width
    foot = begin + 8.0
    height = TEXTURE_HEIGHT
    long_end = foot + height * (math.tan(math.pi / 6.0) - 1.0j)
    short_end = foot - 0.5 * height * (math.tan(math.pi / 6.0) + 1.0j)
    return "".join(
        [
            _text(foot + 9.0 - 4.0j, content, "start"),
            _line(tip, place),
            _line(begin, begin + width),
            _arrow(tip, place),
            _line(short_end, foot, long_end, begin + width - height * 1.0j),
        ]
    )


def _dimension(a: complex, b: complex, level: float, content: str, upright: bool = False) -> str:
    """Draw a dimension from ``a`` to ``b`` with its extension lines.

    The dimension line lies at height ``level``, or ``upright`` at that x. Where it is too short
    for two arrow heads, they stand outside, as an upright text does that is longer.
    """
    if upright:
        ends = [complex(level, a.imag), complex(level, b.imag)]
    else:
        ends = [complex(a.real, level), complex(b.real, level)]
    first, last = sorted(ends, key=lambda end: (end.real, end.imag))
    length = abs(last - first)
    is_tight = length < 3.0 * HEAD_LENGTH
    overhang = 0.0 + 0.0j
    if is_tight:
        overhang = 2.2 * HEAD_LENGTH * (last - first) / (length or 1.0)
    strokes = [
        _line(a, ends[0]),
        _line(b, ends[1]),
        _line(first - overhang, last + overhang),
        _arrow(first, first - overhang if is_tight else last),
        _arrow(last, last + overhang if is_tight else first),
    ]
    middle = 0.5 * (first + last)
    if upright and (is_tight or length < LETTER_WIDTH * len(content)):
        strokes.append(_text(first - overhang - 5.0j, content))
    elif upright:
        strokes.append(_text(middle - 6.0, content, turn=-90.0))
    elif is_tight:
        strokes.append(_text(last + overhang + 5.0 + 4.0j, content, "start"))
    else:
        strokes.append(_text(middle - 5.0j, content))
    return "".join(strokes)


def _angle(
    corner: complex,
    directions: tuple[float, float],
    radius: float,
    content: str,
    place: complex,
) -> str:
    """Draw an angle about a corner between two directions, degrees anticlockwise from x.

    A leader joins the middle of the arc, of a ``radius`` in px, with the words at ``place``.
    """

    def polar(degrees: float, distance: float) -> complex:
        return corner + cmath.rect(distance, -math.radians(degrees))

    start, stop = directions
    arc = (
        f"M{_coordinates(polar(start, radius))} "
        f"A{radius:.1f},{radius:.1f} 0 0 {int(stop < start)} {_coordinates(polar(stop, radius))}"
    )
    rays = [_line(corner, polar(degrees, radius * 1.15)) for degrees in directions]
    anchor = "start" if place.real > corner.real else "end"
    middle = polar(0.5 * (start + stop), radius)
    return "".join([*rays, _path(arc, "thin"), _leader(middle, place, content, anchor)])


def _rounded_path(points: Sequence[complex], radii: Sequence[float]) -> str:
    """Write path commands through points, (n,), with inner corners of radii in px, (n - 2,)."""
    commands = [f"M{_coordinates(points[0])}"]
    corners = zip(points[:-2], points[1:-1], points[2:], radii, strict=True)
    for previous, corner, following, radius in corners:
        u = (previous - corner) / abs(previous - corner)
        v = (following - corner) / abs(following - corner)
        turn = cmath.phase(v / u)
        cut = radius / math.tan(0.5 * abs(turn))
        commands.append(f"L{_coordinates(corner + cut * u)}")
        end = _coordinates(corner + cut * v)
        commands.append(f"A{radius:.2f},{radius:.2f} 0 0 {int(turn < 0.0)} {end}")
    return " ".join([*commands, f"L{_coordinates(points[-1])}"])


def outline(ring: RingDogs, count: int) -> list[tuple[float, float]]:
    """Trace the profile of ``count`` neighbouring pitches with their slots, mm, (n, 2).

    There is a high dog in the middle.
    """
    points = []
    for index in range(count):
        pitch_dog = ring.low if (index - count // 2) % ring.pitches else ring.dog
        if pitch_dog is None:
            continue
        offset = (index - 0.5 * (count - 1)) * ring.dog.pitch
        points += [((x + offset) / MM, z / MM) for x, z in section(pitch_dog)]
    return points


def open_section_svg(
    pair: Pair, ghost: Pair, name: str = "initial design", *, is_sleeve: bool = False
) -> str:
    """Draw both rings before the shift, dogs over slots, to scale.

    The output dogs of ``ghost``, a design of this ``name``, are dashed. Teeth of a sleeve have no
    floor between them.
    """
    width = 860.0
    height = 250.0
    gap = pair.sliding.axial_gap / MM
    heights = max(design.sliding.height + design.output.height for design in (pair, ghost)) / MM
    pitch = ghost.sliding.pitch / MM
    scale = min(width / (4.3 * pitch), (height - 70.0) / (heights + gap))  # px/mm
    crest_level = 0.5 * (height + gap * scale)  # of the output ring

    def output_profile(ring: RingDogs) -> list[complex]:
        rise = ring.dog.addendum / MM
        return [
            complex(0.5 * width + x * scale, crest_level + (rise - z) * scale)
            for x, z in outline(ring, _dogs_in_view(ring, 0.5 * width / scale))
        ]

    def sliding_profile(ring: RingDogs) -> list[complex]:
        depth = gap + ring.dog.addendum / MM
        half_pitch = 0.5 * ring.dog.pitch / MM
        return [
            complex(0.5 * width + (half_pitch - x) * scale, crest_level - (depth - z) * scale)
            for x, z in outline(ring, _dogs_in_view(ring, 0.5 * width / scale))
        ]

    corners = len(section(pair.output)) if is_sleeve else 0
    ghost_corners = len(section(ghost.output)) if is_sleeve else 0
    ghost_teeth = _teeth(output_profile(ghost.output_dogs), ghost_corners)
    words = "output ring, unrolled at the mean radius; dashed: "
    corner = width - 16 + 1j * height
    elements = [
        _ring(sliding_profile(pair.sliding_dogs), -5.0, "ring-b", corners),
        _ring(output_profile(pair.output_dogs), height + 5.0, "ring-a", corners),
        *(_line(*part, kind="ghost") for part in ghost_teeth),
        _line(corner - 5.0 * scale - 14.0j, corner - 14.0j, kind="bar"),
        _text(corner - 8.0 - 5.0 * scale - 10.0j, "5 mm", "end", "small"),
        _text(10.0 + 18.0j, "sliding ring", "start", "small"),
        _text(10.0 + 1j * (height - 10.0), words + name, "start", "small"),
    ]
    return _document(width, height, elements, "Section of both rings")


def _dogs_in_view(ring: RingDogs, half_width: float) -> int:
    """Count the pitches that cover the view, of a half width in mm, and dogs beyond its ends."""
    return 2 * int(half_width / (ring.dog.pitch / MM)) + 5 + 2 * (ring.pitches - 1)


def _teeth(profile: Sequence[complex], corners: int) -> list[Sequence[complex]]:
    """Split a profile into teeth of so many ``corners``; 0 for one part with floors."""
    length = corners or len(profile)
    return [profile[first : first + length] for first in range(0, len(profile), length)]


def _ring(profile: Sequence[complex], back: float, kind: str, corners: int) -> str:
    """Draw a ring from its profile (``_teeth``) to a back line at height ``back``, px."""
    parts = []
    for part in _teeth(profile, corners):
        ends = [complex(part[-1].real, back), complex(part[0].real, back)]
        parts.append(_line(*part, *ends, kind=kind, closed=True))
    return "".join(parts)


class _DogSection:
    """Dimensioned section of a dog: scale, points in px, and texts of sizes with tolerances."""

    def __init__(self, dog: Dog, limits: Limits) -> None:
        self.dog = dog
        self.limits = limits
        # The section shows a whole pitch.
        reach = max(MIN_REACH * dog.pitch, 1.03 * dog.pitch - 0.5 * dog.root_width)  # m
        self.scale = min(0.62 * WIDTH / (2.0 * reach), 0.33 * HEIGHT / dog.height)  # px/m
        self.root_radius = limits.root_radius  # m
        self.top_radius = tip_radius(dog, self.root_radius)  # m
        self.left = self.point(-reach, 0.0)
        self.right = self.point(reach, 0.0)
        self.bottom = self.point(0.0, -dog.dedendum).imag + 84.0  # of the ring, px
        self.corners = [self.point(x, z) for x, z in section(dog)]
        self.braking_root, self.edge, *_, self.back, self.traction_root = self.corners
        self.crest = min(self.corners, key=lambda corner: (corner.imag, -corner.real))
        middle = 0.25 * (dog.pitch - dog.backlash)
        #: intersection of the traction flank with the plane of the tip
        rise = dog.addendum
        self.traction_tip = self.point(middle - rise * dog.tangents[1], rise)

    def point(self, x: float, z: float) -> complex:
        """Place a point of the section, m from the middle of the dog, in px."""
        return complex(0.5 * WIDTH + x * self.scale, 0.5 * HEIGHT - 30.0 - z * self.scale)

    def size(self, name: str, length: float) -> str:
        """Write a length in mm with the tolerance of the dimension."""
        return size_text(self.limits, name, length)

    def slope(self, name: str, words: str) -> str:
        """Write an angle of the dog in degrees with its tolerance."""
        return slope_text(self.limits, self.dog, name, words)


def _tolerance_text(limits: Limits, name: str, unit: float = MM, sign: str = "") -> str:
    """Write the tolerance of a dimension, or an empty text."""
    tolerance = limits.tolerances.dimensions.get(name)
    return f" ±{tolerance / unit:.2f}{sign}" if tolerance else ""


def size_text(limits: Limits, name: str, length: float) -> str:
    """Write a length in mm with the tolerance of the dimension."""
    return f"{length / MM:.2f}{_tolerance_text(limits, name)}"


def slope_text(limits: Limits, dog: Dog, name: str, words: str) -> str:
    """Write an angle of a dog in degrees with its tolerance."""
    angle = f"{getattr(dog, name) / DEG:.2f}".replace("-", "\N{MINUS SIGN}")
    return f"{words} {angle}°{_tolerance_text(limits, name, DEG, '°')}"


def _auxiliary(name: str, length: float, digits: int = 2) -> str:
    """Write an auxiliary length, which follows from others, in mm."""
    return f"{name} ({length / MM:.{digits}f})"


def _part(drawing: _DogSection) -> str:
    """Draw the dog with the slots beside it and the ends of its neighbours."""
    dog = drawing.dog
    if drawing.limits.sleeve is not None:
        return _frame(drawing, "".join(map(partial(_tooth, drawing), PITCHES_IN_VIEW)))
    profile = []
    for index in PITCHES_IN_VIEW:
        profile += [drawing.point(x + index * dog.pitch, z) for x, z in section(dog)]
    tips = (len(drawing.corners) - 2) * [drawing.top_radius]
    radii = 5 * [drawing.root_radius, *tips, drawing.root_radius]
    inner_radii = [radius * drawing.scale for radius in radii][1:-1]
    ends = [complex(point.real, drawing.bottom) for point in (profile[-1], profile[0])]
    back = " L".join(map(_coordinates, ends))
    return _frame(drawing, _path(f"{_rounded_path(profile, inner_radii)} L{back} Z", "part"))


def _tooth(drawing: _DogSection, index: int) -> str:
    """Draw the end of a sleeve's tooth, ``index`` pitches from the middle; it has no floor."""
    dog = drawing.dog
    end = [drawing.point(x + index * dog.pitch, z) for x, z in section(dog)]
    points = [complex(end[0].real, drawing.bottom), *end, complex(end[-1].real, drawing.bottom)]
    tips = (len(end) - 2) * [drawing.top_radius * drawing.scale]
    radii = [0.0, *tips, 0.0]
    return _path(f"{_rounded_path(points, radii)} Z", "part")


def _datum_plane(drawing: _DogSection) -> str:
    """Draw the datum: the floor of the slots, of teeth without one the plane of equal widths."""
    if drawing.limits.sleeve is None:
        return _datum(complex(drawing.right.real + 34.0, drawing.traction_root.imag))
    foot = drawing.left - 88.0
    return _line(drawing.left - 8.0, foot - 10.0, kind="axis") + _datum(foot)


def _textures(drawing: _DogSection, level: float) -> list[str]:
    """Draw the required roughness of flanks and crest, of the crest at height ``level``."""
    manufacturing = drawing.limits.manufacturing
    symbols = []
    if manufacturing.flank_roughness is not None:
        content = _roughness_text(manufacturing.flank_roughness)
        traction = _between(drawing.traction_root, drawing.back, 0.3)
        braking = _between(drawing.braking_root, drawing.edge, 0.3)
        symbols.append(_texture(traction, traction + 14.0, content))
        symbols.append(_texture(braking, braking - 14.0, content))
    if manufacturing.crest_roughness is not None:
        content = _roughness_text(manufacturing.crest_roughness)
        # The leader crosses the dimension of the tip between arrow head and number.
        tip = drawing.traction_tip.real - 0.85 * drawing.dog.tip_width * drawing.scale
        face = sorted(drawing.corners[1:-1], key=lambda corner: corner.real)
        height = np.interp(tip, [c.real for c in face], [c.imag for c in face])
        symbols.append(_texture(complex(tip, float(height)), complex(tip, level), content))
    return symbols


def _between(begin: complex, end: complex, share: float) -> complex:
    """Place a point between two at a share of the way."""
    return begin + share * (end - begin)


def _roughness_text(roughness: float) -> str:
    """Write the mean roughness depth in micrometres, as drawings state it."""
    return f"Rz {from_si('_um', roughness):g}"


def _frame(drawing: _DogSection, part: str) -> str:
    """Clip a part to the width of the section."""
    width = (drawing.right - drawing.left).real
    frame = f'x="{drawing.left.real:.2f}" y="0" width="{width:.2f}" height="{HEIGHT:.0f}"'
    return f'<clipPath id="frame"><rect {frame}/></clipPath><g clip-path="url(#frame)">{part}</g>'


def _lengths(drawing: _DogSection) -> list[str]:
    """Draw the dimensions of lengths."""
    dog = drawing.dog
    crest = drawing.crest
    edge = drawing.edge
    root = drawing.traction_root
    tip = drawing.traction_tip
    left = drawing.left.real
    right = drawing.right.real
    braking_tip = tip - dog.tip_width * drawing.scale
    previous_root = root - dog.pitch * drawing.scale
    height = "h " + drawing.size("height", dog.height)
    rounded_height = (dog.height - crest_loss(dog, drawing.top_radius)) / MM
    lengths = [
        _line(edge, braking_tip),
        _line(drawing.back, tip),
        _dimension(braking_tip, tip, crest.imag - 42.0, _auxiliary("tip", dog.tip_width)),
        _dimension(
            drawing.braking_root, root, root.imag + 36.0, _auxiliary("root", dog.root_width)
        ),
        _dimension(previous_root, root, root.imag + 68.0, _auxiliary("pitch", dog.pitch, 3)),
        _dimension(crest, root, right + 46.0, height, upright=True),
        _text(
            complex(right + 52.0, root.imag + 4.0), f"{rounded_height:.2f} over", "start", "small"
        ),
        _text(complex(right + 52.0, root.imag + 18.0), "the rounding", "start", "small"),
    ]
    flank = _auxiliary("flank", dog.height - dog.edge_drop)
    lengths.append(_dimension(edge, drawing.braking_root, left - 20.0, flank, upright=True))
    if dog.back_drop > 0.0:
        flank = _auxiliary("flank", dog.height - dog.back_drop)
        lengths.append(_dimension(drawing.back, root, right + 22.0, flank, upright=True))
    if dog.edge_drop > 0.0:
        drop = _auxiliary("drop", dog.edge_drop)
        lengths.append(_dimension(crest, edge, left - 54.0, drop, upright=True))
    return lengths


def _face_angles(drawing: _DogSection, level: float) -> list[str]:
    """Draw the angles of the faces, with words at height ``level``."""
    dog = drawing.dog
    faces = []
    # Words stand beside the tip, so that no leader crosses its dimension.
    if dog.crest != 0.0:
        chamfer = drawing.slope("chamfer", "chamfer \u03b1")
        faces.append((180.0, 180.0 + dog.chamfer / DEG, chamfer, drawing.edge - 60.0))
    if dog.crest < 1.0:
        back = drawing.slope("chamfer_back", "back \u03b1\u2082")
        faces.append((-dog.chamfer_back / DEG, 0.0, back, drawing.back + 60.0))
    angles = []
    for start, stop, content, end in faces:
        radius = abs(drawing.crest - end) - 40.0
        place = complex(end.real, level)
        angles.append(_angle(drawing.crest, (start, stop), radius, content, place))
    return angles


def _flank_angles(drawing: _DogSection, level: float) -> list[str]:
    """Draw the angles of the flanks, with words about height ``level``."""
    dog = drawing.dog
    radius = 0.72 * dog.height * drawing.scale
    traction_low, traction_high = sorted((-90.0, -90.0 + dog.traction / DEG))
    braking_low, braking_high = sorted((-90.0, -90.0 + -dog.braking / DEG))
    traction_level = level + (34.0 if dog.crest < 1.0 else 0.0)
    return [
        _angle(
            drawing.back,
            (traction_low, traction_high),
            radius,
            drawing.slope("traction", "traction flank \u03b2"),
            place=complex(drawing.traction_tip.real + 70.0, traction_level),
        ),
        _angle(
            drawing.edge,
            (braking_low, braking_high),
            0.8 * radius,
            drawing.slope("braking", "braking flank \u03b3"),
            place=complex(drawing.edge.real - 110.0, level + 34.0),
        ),
    ]


def _radii(drawing: _DogSection) -> str:
    """Draw the leader to the fillet with the radii of roots and edges."""
    dog = drawing.dog
    # Middle of the fillet's arc: out of the corner along its bisector.
    opening = 0.25 * math.pi + 0.5 * dog.traction
    radius = drawing.root_radius * drawing.scale
    fillet = drawing.traction_root + cmath.rect(radius * (1.0 / math.sin(opening) - 1.0), -opening)
    root = drawing.size("root_radius", drawing.root_radius)
    if drawing.limits.sleeve is not None:
        words = f"tip edges R {drawing.top_radius / MM:.2f}, radial roots R {root}"
        return _leader(
            drawing.back, complex(drawing.right.real - 100.0, drawing.bottom + 24.0), words
        )
    words = f"roots and tip edges R {root}"
    if dog.edge_radius > 0.0:
        words = f"roots R {root}, tip edges R {dog.edge_radius / MM:.2f}"
    return _leader(fillet, complex(drawing.right.real - 100.0, drawing.bottom + 24.0), words)


def notes_of(dog: Dog, limits: Limits) -> list[str]:
    """Write the notes of a drawing of a dog, a paragraph each."""
    material = limits.material
    widths = "dog and slot are equally wide"
    if dog.backlash > 0.0:
        backlash = size_text(limits, "backlash", dog.backlash)
        widths = f"a slot is wider than a dog by the backlash {backlash}"
    ridge = ""
    if dog.has_back:
        ridge = f" The ridge stands at {dog.crest:.3g} of the tip from the braking edge."
    outer_diameter = size_text(limits, "outer_diameter", dog.outer_diameter)
    inner_diameter = size_text(limits, "inner_diameter", dog.inner_diameter)
    axial_gap = size_text(limits, "axial_gap", dog.axial_gap)
    inner_tip_width = dog.tip_width_at(dog.inner_radius) / MM
    ring = f"{dog.count} dogs on Ø{outer_diameter} / Ø{inner_diameter} mm"
    pair = f"{ring}, both rings alike, one turned over"
    slots_per_dog = limits.load.slots_per_dog
    low_height = limits.output_dog.low_height
    if slots_per_dog > 1:
        high_count = limits.load.touching(dog)
        sparse = sparse_ring(is_sliding=limits.output_dog.is_sliding_sparse)
        pair = (
            f"{ring}; of these the {sparse} has {high_count}, at every pitch number {slots_per_dog}"
        )
        if low_height is not None:
            pair = (
                f"{ring}; on the {sparse} {high_count} of these, at every pitch number "
                f"{slots_per_dog}, have full height, the others {low_height / MM:.2f} mm"
            )
    flanks = "flanks are planes along radial lines"
    if limits.sleeve is not None:
        flanks = "flanks are simulated along radial lines"
        lever = limits.sleeve.lever(dog)
        root, mate_root = (2.0 * (dog.mean_radius + way) / MM for way in (lever, -lever))
        pair = (
            f"{ring}: teeth of a sleeve, rooted at Ø{root:.2f}, and of its mate, at "
            f"Ø{mate_root:.2f} mm; pressure angle {limits.sleeve.pressure_angle / DEG:g}°"
        )
    mate = limits.load.mate or dog
    travel = dog.axial_gap + min(dog.height, mate.height)
    datum = "floors of the slots, from which the height is measured"
    if limits.sleeve is not None:
        datum = f"{_widths_plane(dog)}, for which the widths hold"
    return [
        pair,
        f"axial gap before the shift {axial_gap} mm, travel {travel / MM:.2f} mm; "
        f"datum {DATUM} (ISO 5459): {datum}",
        f"{material.name}, {material.heat_treatment} (ISO 15787){_texture_note(limits)}",
        "Lengths in mm to the intersection of faces, auxiliary ones in brackets; widths at mean "
        f"radius {dog.mean_radius / MM:.2f} mm (section unrolled). In the median plane {widths}, "
        f"{flanks}; tip {inner_tip_width:.2f}"
        f" mm at the inner radius.{ridge} General tolerances ISO 2768-f.",
    ]


def _widths_plane(dog: Dog) -> str:
    """Name the plane that the widths of dog and slot are given for."""
    return "median plane" if dog.root_depth is None else "pitch plane"


def _texture_note(limits: Limits) -> str:
    """Write the required roughness of flanks and crest, or an empty text."""
    faces = {
        "flanks": limits.manufacturing.flank_roughness,
        "crests": limits.manufacturing.crest_roughness,
    }
    words = [
        f"{face} {_roughness_text(roughness)}"
        for face, roughness in faces.items()
        if roughness is not None
    ]
    return f"; surface texture {', '.join(words)} µm (ISO 21920-1)" if words else ""


def _note_lines(notes: Sequence[str]) -> list[str]:
    """Break notes into lines within the margins; a number keeps its tolerance and unit."""
    letters = int((WIDTH - 2.0 * MARGIN) / NOTE_LETTER_WIDTH)
    lines = []
    for note in notes:
        joined_note = re.sub(r"(?<=ISO) | (?=±|mm\b|HV\b|µm\b)", "\N{NO-BREAK SPACE}", note)
        lines += textwrap.wrap(joined_note, letters, break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def ring_drawings(pair: Pair, limits: Limits, title: str) -> list[str]:
    """Draw the dimensioned section of the dog of both rings, or of either where they are unlike."""
    if not limits.has_unlike_rings:
        return [dimensioned_svg(pair.sliding, limits, title)]
    output_limits = replace(limits, material=limits.output_material or limits.material)
    return [
        dimensioned_svg(pair.sliding, limits.beside(pair.output), f"{title}, sliding ring"),
        dimensioned_svg(pair.output, output_limits.beside(pair.sliding), f"{title}, output ring"),
    ]


def dimensioned_svg(dog: Dog, limits: Limits, title: str = "Dog, dimensioned section") -> str:
    """Draw the dimensioned section of one dog as an SVG document.

    ``limits`` has root radius, tolerances and material.
    """
    drawing = _DogSection(dog, limits)
    angle_level = drawing.crest.imag - 96.0
    plane = _widths_plane(dog)
    elements = [
        _part(drawing),
        _line(drawing.left - 8.0, drawing.right + 8.0, kind="axis"),
        _text(drawing.right + 60.0 + 4.0j, plane, "start", "small"),
        _datum_plane(drawing),
        *_textures(drawing, angle_level),
        *_lengths(drawing),
        *_face_angles(drawing, angle_level),
        *_flank_angles(drawing, angle_level),
        _radii(drawing),
        _text(MARGIN + 34.0j, title, "start", "title"),
    ]
    lines = _note_lines(notes_of(dog, limits))
    for index, line in enumerate(lines):
        place = MARGIN + 1j * (HEIGHT - 88.0 + NOTE_LINE_HEIGHT * index)
        elements.append(_text(place, line, "start", "small"))
    height = HEIGHT + NOTE_LINE_HEIGHT * max(0, len(lines) - NOTE_LINES)
    return _document(WIDTH, height, elements, title)
