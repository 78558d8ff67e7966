"""Drawings of the dogs as SVG: both rings before the shift, and one dog with its dimensions.

Both are sections at the mean radius, unrolled. Points are complex numbers x + iy in pixels, y
downwards; every stroke is the text of an element.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from html import escape

from dogshape.sim.shift.geometry import Dog, crest_loss, section, tip_radius
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.units import DEG, MM

WIDTH, HEIGHT = 980.0, 592.0  #: of the dimensioned section, px
HEAD = 8.0  #: length of an arrow head, px
LETTER = 7.2  #: width of a character, px; close enough for a background
REACH = 0.775  #: least reach of the dimensioned section either side of the dog, in pitches
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
    body = "\n".join(elements)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" class="drawing" role="img" '
        f'aria-label="{escape(title)}">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n{body}\n</svg>\n"
    )


def _at(point: complex) -> str:
    return f"{point.real:.2f},{point.imag:.2f}"


def _path(commands: str, kind: str) -> str:
    return f'<path d="{commands}" class="{kind}"/>'


def _line(*points: complex, kind: str = "thin", closed: bool = False) -> str:
    return _path("M" + " L".join(map(_at, points)) + (" Z" if closed else ""), kind)


def _text(at: complex, words: str, anchor: str = "middle", kind: str = "", turn: float = 0) -> str:
    """Write a text, without a ``kind`` on a white ground, turned by ``turn`` degrees."""
    x, y, width = at.real, at.imag, LETTER * len(words) + 4.0
    left = {"middle": x - 0.5 * width, "start": x - 2.0, "end": x - width + 2.0}[anchor]
    ground = f'<rect x="{left:.1f}" y="{y - 12:.1f}" width="{width:.1f}" height="16" class="back"/>'
    turned = f' transform="rotate({turn:.1f} {x:.1f} {y:.1f})"' if turn else ""
    return (
        f'<g{turned}>{"" if kind else ground}<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" '
        f'class="{kind}">{escape(words)}</text></g>'
    )


def _arrow(tip: complex, towards: complex) -> str:
    """Draw an arrow head at ``tip`` that points away from ``towards``."""
    way = (tip - towards) / (abs(tip - towards) or 1.0)
    base = tip - HEAD * way
    return _line(tip, base + 2.6j * way, base - 2.6j * way, kind="head", closed=True)


def _leader(tip: complex, place: complex, content: str, anchor: str = "start") -> str:
    """Draw a leader from the words at ``place`` to ``tip``."""
    words = _text(place + (5.0 if anchor == "start" else -5.0) + 4.0j, content, anchor)
    return _line(tip, place) + _arrow(tip, place) + words


def _dimension(a: complex, b: complex, at: float, content: str, upright: bool = False) -> str:
    """Draw a dimension from ``a`` to ``b`` with its extension lines.

    The dimension line is level at height ``at``, or ``upright`` at that x. Where it is too short
    for two arrow heads, they stand outside, as an upright text does that is longer.
    """
    ends = [complex(at, p.imag) if upright else complex(p.real, at) for p in (a, b)]
    first, last = sorted(ends, key=lambda p: (p.real, p.imag))
    tight = abs(last - first) < 3.0 * HEAD
    out = 2.2 * HEAD * (last - first) / (abs(last - first) or 1.0) if tight else 0.0
    strokes = [_line(p, end) for p, end in zip((a, b), ends, strict=True)]
    strokes += [_line(first - out, last + out), _arrow(first, first - out if tight else last)]
    strokes.append(_arrow(last, last + out if tight else first))
    middle = 0.5 * (first + last)
    if upright and (tight or abs(last - first) < LETTER * len(content)):
        strokes.append(_text(first - out - 5.0j, content))
    elif upright:
        strokes.append(_text(middle - 6.0, content, turn=-90.0))
    elif tight:
        strokes.append(_text(last + out + 5.0 + 4.0j, content, "start"))
    else:
        strokes.append(_text(middle - 5.0j, content))
    return "".join(strokes)


def _angle(
    corner: complex, between: tuple[float, float], radius: float, content: str, place: complex
) -> str:
    """Draw an angle about a corner between two directions, degrees anticlockwise from x.

    A leader joins the arc's middle with the words at ``place``.
    """

    def at(degrees: float, reach: float) -> complex:
        return corner + cmath.rect(reach, -math.radians(degrees))

    start, stop = between
    arc = f"M{_at(at(start, radius))} A{radius:.1f},{radius:.1f} 0 0 {int(stop < start)} "
    rays = [_line(corner, at(degrees, radius * 1.15)) for degrees in between]
    anchor = "start" if place.real > corner.real else "end"
    middle = at(0.5 * (start + stop), radius)
    drawn = _path(arc + _at(at(stop, radius)), "thin")
    return "".join([*rays, drawn, _leader(middle, place, content, anchor)])


def _rounded(points: Sequence[complex], radii: Sequence[float]) -> str:
    """Write path commands through ``points`` with each inner corner rounded, px."""
    commands = [f"M{_at(points[0])}"]
    corners = zip(points[:-2], points[1:-1], points[2:], radii, strict=True)
    for before, here, after, radius in corners:
        u, v = ((side - here) / abs(side - here) for side in (before, after))
        turn = cmath.phase(v / u)
        cut = radius / math.tan(0.5 * abs(turn))
        commands.append(f"L{_at(here + cut * u)}")
        commands.append(f"A{radius:.2f},{radius:.2f} 0 0 {int(turn < 0.0)} {_at(here + cut * v)}")
    return " ".join([*commands, f"L{_at(points[-1])}"])


def outline(dog: Dog, dogs: int) -> list[tuple[float, float]]:
    """Trace the profile of ``dogs`` neighbouring dogs with their slots, mm."""
    shifts = [(index - 0.5 * (dogs - 1)) * dog.pitch for index in range(dogs)]
    return [((x + shift) / MM, z / MM) for shift in shifts for x, z in section(dog)]


def open_section_svg(dog: Dog, other: Dog, name: str = "initial design") -> str:
    """Draw both rings before the shift, dogs over slots, to scale; ``other`` is dashed below."""
    width, height = 860.0, 250.0
    gap, tall = dog.axial_gap / MM, max(dog.height, other.height) / MM
    scale = min(width / (4.3 * other.pitch / MM), (height - 70.0) / (2.0 * tall + gap))
    face = 0.5 * (height + gap * scale)  # of the output ring's crests

    def ring(one: Dog, turned: bool, edge: float | None, kind: str) -> str:
        points = outline(one, 2 * int(0.5 * width / scale / (one.pitch / MM)) + 5)
        depth, half = 0.5 * one.height / MM, 0.5 * one.pitch / MM
        line = [
            complex(0.5 * width + (half - x) * scale, face - (gap + depth - z) * scale)
            if turned
            else complex(0.5 * width + x * scale, face + (depth - z) * scale)
            for x, z in points
        ]
        ends = [] if edge is None else [complex(p.real, edge) for p in (line[-1], line[0])]
        return _line(*line, *ends, kind=kind, closed=bool(ends))

    words, corner = "output ring, unrolled at the mean radius; dashed: ", width - 16 + 1j * height
    elements = [
        ring(dog, True, -5.0, "ring-b"),
        ring(dog, False, height + 5.0, "ring-a"),
        ring(other, False, None, "ghost"),
        _line(corner - 5.0 * scale - 14.0j, corner - 14.0j, kind="bar"),
        _text(corner - 8.0 - 5.0 * scale - 10.0j, "5 mm", "end", "small"),
        _text(10.0 + 18.0j, "sliding ring", "start", "small"),
        _text(10.0 + 1j * (height - 10.0), words + name, "start", "small"),
    ]
    return _document(width, height, elements, "Section of both rings")


def dimensioned_svg(dog: Dog, limits: Limits, title: str = "Dog, dimensioned section") -> str:
    """Draw the dimensioned section of one dog as an SVG document.

    ``limits`` brings root radius, tolerances and material.
    """
    reach = max(REACH * dog.pitch, 1.03 * dog.pitch - 0.5 * dog.root_width)  # the pitch is in it
    scale = min(0.62 * WIDTH / (2.0 * reach), 0.33 * HEIGHT / dog.height)
    radius, half = limits.root_radius, 0.5 * dog.height
    top_radius = tip_radius(dog, radius)

    def at(x: float, z: float) -> complex:
        return complex(0.5 * WIDTH + x * scale, 0.5 * HEIGHT - 30.0 - z * scale)

    def within(name: str, unit: float = MM, sign: str = "") -> str:
        tolerance = limits.tolerances.dimensions.get(name)
        return f" ±{tolerance / unit:.2f}{sign}" if tolerance else ""

    def size(name: str, length: float) -> str:
        return f"{length / MM:.2f}{within(name)}"

    def slope(name: str, words: str) -> str:
        angle = f"{getattr(dog, name) / DEG:.2f}".replace("-", "\N{MINUS SIGN}")
        return f"{words} {angle}°{within(name, DEG, '°')}"

    # The dog with the slots beside it and the ends of its neighbours.
    profile = [at(x + i * dog.pitch, z) for i in (-2, -1, 0, 1, 2) for x, z in section(dog)]
    corners = [at(x, z) for x, z in section(dog)]
    radii = [r * scale for r in 5 * [radius, *(len(corners) - 2) * [top_radius], radius]]
    left, right = at(-reach, 0.0), at(reach, 0.0)
    low = at(0.0, -half).imag + 84.0
    ends = " L".join(_at(complex(p.real, low)) for p in (profile[-1], profile[0]))
    part = _path(f"{_rounded(profile, radii[1:-1])} L{ends} Z", "part")
    frame = f'x="{left.real:.2f}" y="0" width="{(right - left).real:.2f}" height="{HEIGHT:.0f}"'
    root_b, edge, *_, back, root_t = corners
    crest = min(corners, key=lambda corner: (corner.imag, -corner.real))
    below, pitch, middle = root_t.imag, dog.pitch * scale, 0.25 * (dog.pitch - dog.backlash)
    tip_t = at(middle - half * dog.tangents[1], half)
    tip_b = tip_t - dog.tip_width * scale
    over = (dog.height - crest_loss(dog, top_radius)) / MM

    def follows(name: str, length: float, digits: int = 2) -> str:
        return f"{name} ({length / MM:.{digits}f})"

    lengths = [
        _line(edge, tip_b),
        _line(back, tip_t),
        _dimension(tip_b, tip_t, crest.imag - 42.0, follows("tip", dog.tip_width)),
        _dimension(root_b, root_t, below + 36.0, follows("root", dog.root_width)),
        _dimension(root_t - pitch, root_t, below + 68.0, follows("pitch", dog.pitch, 3)),
        _dimension(crest, root_t, right.real + 46.0, "h " + size("height", dog.height), True),
        _text(complex(right.real + 52.0, below + 4.0), f"{over:.2f} over", "start", "small"),
        _text(complex(right.real + 52.0, below + 18.0), "the rounding", "start", "small"),
        _dimension(
            edge, root_b, left.real - 20.0, follows("flank", dog.height - dog.edge_drop), True
        ),
    ]
    if dog.back_drop > 0.0:
        flank = follows("flank", dog.height - dog.back_drop)
        lengths.append(_dimension(back, root_t, right.real + 22.0, flank, True))
    if dog.edge_drop > 0.0:
        drop = follows("drop", dog.edge_drop)
        lengths.append(_dimension(crest, edge, left.real - 54.0, drop, True))

    # Middle of the fillet's arc: out of the corner along its bisector.
    opening = 0.25 * math.pi + 0.5 * dog.traction
    fillet = root_t + cmath.rect(radius * scale * (1.0 / math.sin(opening) - 1.0), -opening)
    edges = f"roots and tip edges R {size('root_radius', radius)}"
    if dog.edge_radius > 0.0:
        edges = f"roots R {size('root_radius', radius)}, tip edges R {dog.edge_radius / MM:.2f}"
    top, deep = crest.imag - 96.0, 0.72 * dog.height * scale
    lean_t, lean_b = (sorted((-90.0, -90.0 + lean / DEG)) for lean in (dog.traction, -dog.braking))
    # Beside the tip, so that no leader crosses its dimension.
    falls = [
        ("chamfer", (180.0, 180.0 + dog.chamfer / DEG), "chamfer \u03b1", edge - 60.0),
        ("chamfer_back", (-dog.chamfer_back / DEG, 0.0), "back \u03b1\u2082", back + 60.0),
    ][dog.crest == 0.0 : 1 + (dog.crest < 1.0)]
    angles = [
        *(
            _angle(crest, ends, abs(crest - end) - 40.0, slope(name, words), complex(end.real, top))
            for name, ends, words, end in falls
        ),
        _angle(
            back,
            (lean_t[0], lean_t[1]),
            deep,
            slope("traction", "traction flank \u03b2"),
            complex(tip_t.real + 70.0, top + (34.0 if dog.crest < 1.0 else 0.0)),
        ),
        _angle(
            edge,
            (lean_b[0], lean_b[1]),
            0.8 * deep,
            slope("braking", "braking flank \u03b3"),
            complex(edge.real - 110.0, top + 34.0),
        ),
        _leader(fillet, complex(right.real - 100.0, low + 24.0), edges),
    ]
    material, wide = limits.material, "dog and slot are equally wide"
    if dog.backlash > 0.0:
        wide = f"a slot is wider than a dog by the backlash {size('backlash', dog.backlash)}"
    ridge = f" The ridge stands at {dog.crest:.3g} of the tip from the braking edge." * dog.has_back
    lines = (
        f"{dog.count} dogs on Ø{size('outer_diameter', dog.outer_diameter)} / "
        f"Ø{size('inner_diameter', dog.inner_diameter)} mm, both rings alike, one turned over",
        f"axial gap before the shift {size('axial_gap', dog.axial_gap)} mm, "
        f"travel {dog.travel / MM:.2f} mm; {material.name}, surface "
        f"{material.surface_hardness:.0f} HV, case {material.case_depth / MM:.1f} mm",
        "Lengths in mm to the intersection of faces, auxiliary ones in brackets; widths at mean",
        f"radius {dog.mean_radius / MM:.2f} mm (section unrolled). In the median plane {wide},",
        f"flanks are planes along radial lines; tip {dog.tip_width_at(dog.inner_radius) / MM:.2f}"
        f" mm at the inner radius.{ridge} General tolerances ISO 2768-f.",
    )
    elements = [
        f'<clipPath id="frame"><rect {frame}/></clipPath><g clip-path="url(#frame)">{part}</g>',
        _line(left - 8.0, right + 8.0, kind="axis"),
        _text(right + 60.0 + 4.0j, "median plane", "start", "small"),
        *lengths,
        *angles,
        _text(36.0 + 34.0j, title, "start", "title"),
        *(
            _text(36.0 + 1j * (HEIGHT - 88.0 + 18.0 * i), words, "start", "small")
            for i, words in enumerate(lines)
        ),
    ]
    return _document(WIDTH, HEIGHT, elements, title)
