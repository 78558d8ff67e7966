"""Drawings of the dogs as SVG: the pair meshed, and one dog with its dimensions.

Both are sections at the mean radius, unrolled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dogshape.pipeline.export import svg
from dogshape.pipeline.export.svg import Point
from dogshape.sim.shift.geometry import Dog, crest_loss, section, tip_radius
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.units import DEG, MM

WIDTH, HEIGHT = 980.0, 592.0  #: of the dimensioned section, px


def outline(dog: Dog, dogs: int) -> list[Point]:
    """Trace the profile of ``dogs`` neighbouring dogs with their slots, mm."""
    points = []
    for index in range(dogs):
        shift = (index - 0.5 * (dogs - 1)) * dog.pitch
        points += [((x + shift) / MM, z / MM) for x, z in section(dog)]
    return points


def section_svg(dog: Dog, title: str, span: float, width: int = 420) -> str:
    """Draw ``span`` m of both rings at full depth, to scale; equal spans compare."""
    half, depth = 0.5 * span / MM, dog.height / MM
    lower = outline(dog, 2 * int(span / dog.pitch) + 3)
    upper = [(-x + 0.5 * dog.pitch / MM, -z) for x, z in lower]
    scale = 0.5 * width / half
    height, bar = (depth + 2.4) * scale, 2.0 * scale

    def ring(points: list[Point], floor: float, kind: str) -> str:
        placed = [((x + half) * scale, (0.5 * depth + 1.2 - z) * scale) for x, z in points]
        ends = [(placed[-1][0], floor), (placed[0][0], floor)]
        return svg.path("M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in placed + ends) + " Z", kind)

    label = (
        f"{title}: chamfer {dog.chamfer / DEG:.1f}°, traction {dog.traction / DEG:.1f}°, "
        f"braking {dog.braking / DEG:.1f}°, height {depth:.2f} mm, {dog.count} dogs"
    )
    return (
        f'<figure><svg viewBox="0 0 {width} {height:.0f}" width="{width}" role="img" '
        f'aria-label="{label}">{ring(lower, height, "ring-a")}{ring(upper, 0.0, "ring-b")}'
        f"{svg.path(f'M10,{height - 10:.1f} h{bar:.1f}', 'bar')}"
        f'<text x="{16 + bar:.1f}" y="{height - 6:.1f}" class="note">2 mm</text>'
        f"</svg><figcaption>{label}</figcaption></figure>"
    )


def open_section_svg(dog: Dog, other: Dog) -> str:
    """Draw both rings before the shift, dogs over slots, to scale; ``other`` is dashed below."""
    width, height = 860.0, 250.0
    gap = dog.axial_gap / MM
    tall = max(dog.height, other.height) / MM
    scale = min(width / (4.3 * other.pitch / MM), (height - 70.0) / (2.0 * tall + gap))
    face = 0.5 * (height + gap * scale)  # of the output ring's crests

    def ring(one: Dog, turned: bool, edge: float | None, kind: str) -> str:
        points = outline(one, 2 * int(0.5 * width / scale / (one.pitch / MM)) + 5)
        depth = 0.5 * one.height / MM
        if turned:
            half = 0.5 * one.pitch / MM
            placed = [(-x + half, face - (gap + depth - z) * scale) for x, z in points]
        else:
            placed = [(x, face + (depth - z) * scale) for x, z in points]
        line = [(0.5 * width + x * scale, y) for x, y in placed]
        ends = [] if edge is None else [(line[-1][0], edge), (line[0][0], edge)]
        words = " L".join(f"{x:.2f},{y:.2f}" for x, y in (*line, *ends))
        return svg.path(f"M{words}{' Z' if ends else ''}", kind)

    bar, y = 5.0 * scale, height - 14.0
    elements = [
        ring(dog, True, -5.0, "ring-b"), ring(dog, False, height + 5.0, "ring-a"),
        ring(other, False, None, "ghost"),
        svg.line((width - 16.0 - bar, y), (width - 16.0, y), "bar"),
        svg.text((width - 24.0 - bar, y + 4.0), "5 mm", "end", "small"),
        svg.text((10.0, 18.0), "sliding ring", "start", "small"),
        svg.text((10.0, y + 4.0), "output ring, unrolled at the mean radius; dashed: the design "
                 "begun with", "start", "small"),
    ]  # fmt: skip
    return svg.document(width, height, elements, "Section of both rings")


def rounded(points: Sequence[Point], radii: Sequence[float]) -> str:
    """Write path commands through ``points`` with each inner corner rounded, px."""
    places = np.array(points)
    commands = ["M{:.2f},{:.2f}".format(*places[0])]
    corners = zip(places[:-2], places[1:-1], places[2:], radii, strict=True)
    for before, here, after, radius in corners:
        u, v = ((side - here) / math.dist(side, here) for side in (before, after))
        cut = radius / math.tan(0.5 * math.acos(np.clip(u @ v, -1.0, 1.0)))
        sweep = int(u[0] * v[1] < u[1] * v[0])
        commands.append("L{:.2f},{:.2f}".format(*(here + cut * u)))
        end = "{:.2f},{:.2f}".format(*(here + cut * v))
        commands.append(f"A{radius:.2f},{radius:.2f} 0 0 {sweep} {end}")
    return " ".join([*commands, "L{:.2f},{:.2f}".format(*places[-1])])


class _Sheet:
    """Places the section on the sheet: metres to pixels, dog in the middle."""

    def __init__(self, dog: Dog, limits: Limits) -> None:
        self.dog, self.limits = dog, limits
        self.scale = min(0.62 * WIDTH / (1.55 * dog.pitch), 0.33 * HEIGHT / dog.height)
        self.centre = (0.5 * WIDTH, 0.5 * HEIGHT - 30.0)
        self.underside = -0.5 * dog.height - 84.0 / self.scale

    def at(self, x: float, z: float) -> Point:
        return self.centre[0] + x * self.scale, self.centre[1] - z * self.scale

    def size(self, name: str, value: float, mark: str = "") -> str:
        """Print a length with its tolerance, mm."""
        return f"{mark}{value / MM:.2f}{self._tolerance(name, MM, '')}"

    def slope(self, name: str, word: str) -> str:
        """Print an angle with its tolerance, degrees."""
        value = getattr(self.dog, name) / DEG
        return f"{word} {value:.2f}°{self._tolerance(name, DEG, '°')}"

    def _tolerance(self, name: str, unit: float, sign: str) -> str:
        tolerance = self.limits.tolerances.dimensions.get(name)
        return f" ±{tolerance / unit:.2f}{sign}" if tolerance else ""

    def part(self) -> str:
        """Draw the dog with the slots beside it and the ends of its neighbours."""
        dog, reach = self.dog, 0.775 * self.dog.pitch
        points = [(x + i * dog.pitch, z) for i in (-2, -1, 0, 1, 2) for x, z in section(dog)]
        root = self.limits.root_radius
        radii = [root, *(2 * [tip_radius(dog, root)]), root] * 5
        curve = rounded([self.at(*p) for p in points], [r * self.scale for r in radii[1:-1]])
        right, left = self.at(points[-1][0], self.underside), self.at(points[0][0], self.underside)
        closing = f"L{right[0]:.2f},{right[1]:.2f} L{left[0]:.2f},{left[1]:.2f} Z"
        frame = (self.at(-reach, 0.0)[0], self.at(reach, 0.0)[0])
        return svg.clipped(svg.path(f"{curve} {closing}", "part"), frame, HEIGHT)

    def lengths(self) -> list[str]:
        """Draw the dimensions of widths and heights."""
        dog, half = self.dog, 0.5 * self.dog.height
        root_b, edge, crest, root_t = section(dog)
        tip_b = (crest[0] - dog.tip_width, half)
        below = self.at(0.0, -half)[1]
        right, left = self.at(0.775 * dog.pitch, 0.0)[0], self.at(-0.775 * dog.pitch, 0.0)[0]
        at, next_root = self.at, (root_t[0] - dog.pitch, -half)
        over = (dog.height - crest_loss(dog, tip_radius(dog, self.limits.root_radius))) / MM
        level = (
            (tip_b, crest, at(*crest)[1] - 42.0, _follows("tip", dog.tip_width)),
            (root_b, root_t, below + 36.0, _follows("root", dog.root_width)),
            (next_root, root_t, below + 68.0, _follows("pitch", dog.pitch, 3)),
        )
        height, flank = self.size("height", dog.height), dog.braking_flank_height
        upright = [
            (crest, (crest[0], -half), right + 40.0, "h " + height),
            (edge, (edge[0], -half), left - 20.0, _follows("flank", flank)),
        ]
        if dog.edge_drop > 0.0:
            drop = _follows("drop", dog.edge_drop)
            upright.append(((crest[0], half), edge, left - 54.0, drop))
        drawn = [svg.dimension(at(*a), at(*b), x, words, True) for a, b, x, words in upright]
        rounding = right + 52.0, at(*crest)[1]
        return [
            svg.line(at(*edge), at(*tip_b)),
            *(svg.dimension(at(*a), at(*b), place, words) for a, b, place, words in level),
            drawn[0],
            svg.text((rounding[0], rounding[1] + 4.0), f"{over:.2f} over", "start", "small"),
            svg.text((rounding[0], rounding[1] + 18.0), "the rounding", "start", "small"),
            *drawn[1:],
        ]

    def angles(self) -> list[str]:
        """Draw chamfer, side angles and the root radius."""
        dog, half = self.dog, 0.5 * self.dog.height
        root_b, edge, crest, _ = section(dog)
        corner, low = self.at(*crest), self.at(*edge)
        top = self.at(0.0, half)[1] - 96.0
        reach = 0.72 * dog.height * self.scale
        radius = self.limits.root_radius
        # Middle of the fillet's arc: out of the corner along its bisector.
        opening = 0.25 * math.pi + 0.5 * dog.braking
        way = radius * (1.0 / math.sin(opening) - 1.0)
        fillet = self.at(root_b[0] - way * math.cos(opening), -half + way * math.sin(opening))
        below = self.at(0.0, self.underside)[1] + 24.0
        place = self.at(-0.775 * dog.pitch, 0.0)[0] + 60.0, below
        chamfer = (180.0, 180.0 + dog.chamfer / DEG)
        traction, braking = (-90.0, -90.0 + dog.traction / DEG), (-90.0 - dog.braking / DEG, -90.0)
        radius_words = "roots and tip edges R " + self.size("root_radius", radius)
        if dog.edge_radius > 0.0:
            edges = f"tip edges R {dog.edge_radius / MM:.2f}"
            radius_words = f"roots R {self.size('root_radius', radius)}, {edges}"
        return [
            svg.angle(corner, chamfer, 0.55 * dog.tip_width * self.scale,
                      self.slope("chamfer", "chamfer \u03b1"), (self.centre[0] - 90.0, top)),
            svg.angle(corner, traction, reach,
                      self.slope("traction", "traction flank \u03b2"), (corner[0] + 70.0, top)),
            svg.angle(low, braking, 0.8 * reach,
                      self.slope("braking", "braking flank \u03b3"), (low[0] - 110.0, top + 34.0)),
            svg.leader(fillet, place, radius_words, "end"),
        ]  # fmt: skip

    def words(self, title: str) -> list[str]:
        """Write title and the numbers that the section does not show."""
        dog, material = self.dog, self.limits.material
        diameters = (
            f"{self.size('outer_diameter', dog.outer_diameter, 'Ø')} / "
            f"{self.size('inner_diameter', dog.inner_diameter, 'Ø')}"
        )
        lines = (
            f"{dog.count} dogs on {diameters} mm, both rings alike, one turned over",
            f"axial gap before the shift {self.size('axial_gap', dog.axial_gap)} mm, "
            f"travel {dog.travel / MM:.2f} mm; {material.name}, surface "
            f"{material.surface_hardness:.0f} HV, case {material.case_depth / MM:.1f} mm",
            "Lengths in mm, to the intersection of faces; in brackets what follows from the "
            "others. Widths along the circumference at the mean radius,",
            f"{dog.mean_radius / MM:.2f} mm, where the section is unrolled. In the median plane "
            "dog and slot are equally wide, flanks are planes through radial",
            "lines; tips are narrower inside: "
            f"{dog.tip_width_at(dog.inner_radius) / MM:.2f} mm at the inner radius. General "
            "tolerances ISO 2768-f.",
        )
        left = 36.0
        return [
            svg.text((left, 34.0), title, "start", "title"),
            *(
                svg.text((left, HEIGHT - 88.0 + 18.0 * i), words, "start", "small")
                for i, words in enumerate(lines)
            ),
        ]


def _follows(name: str, length: float, digits: int = 2) -> str:
    """Return a length in brackets, mm: it follows from the others."""
    return f"{name} ({length / MM:.{digits}f})"


def dimensioned_svg(dog: Dog, limits: Limits, title: str = "Dog, dimensioned section") -> str:
    """Draw the dimensioned section of one dog as an SVG document.

    ``limits`` brings root radius, tolerances and material.
    """
    sheet = _Sheet(dog, limits)
    left, right = (sheet.at(side * 0.775 * dog.pitch, 0.0) for side in (-1.0, 1.0))
    axis = svg.line((left[0] - 8.0, left[1]), (right[0] + 8.0, right[1]), "axis")
    name = svg.text((right[0] + 60.0, right[1] + 4.0), "median plane", "start", "small")
    elements = [sheet.part(), axis, name, *sheet.lengths(), *sheet.angles(), *sheet.words(title)]
    return svg.document(WIDTH, HEIGHT, elements, title)
