"""Pictures of the documentation, from the geometry of the prototype.

    python -m benchmarks.drawings mismatch > docs/mismatch.svg
    python -m benchmarks.drawings dog > docs/dog.svg

``mismatch``: what the sign of the mismatch means. Sections at the mean radius, unrolled: before the
touch, and when the first flank touches. The output ring moves relative to the sliding one; angles
grow to the right. ``dog``: both rings in neutral with the name of each quantity, for the glossary.
"""

from __future__ import annotations

import math
import sys

from benchmarks.common import paper_study
from dogshape.pipeline.export import svg
from dogshape.pipeline.export.drawing import outline
from dogshape.pipeline.export.svg import Point
from dogshape.sim.shift.geometry import Dog, section
from dogshape.sim.units import DEG, MM

WIDTH, HEIGHT = 980.0, 560.0  #: px
SCALE = 24.0  #: px for a mm
PANEL = 450.0  #: px, width of a section
APART = 0.5  #: mm between faces before the touch
LEFT = 1.4  #: mm before the end of the travel at which a flank touches
FLANK = "#c0392b"
NAMED_HEIGHT = 640.0  #: px
PITCHES = 1.5  #: that the drawing shows
REACH = 0.32 * WIDTH  #: of the rings either way, px
RIM = 46.0  #: of a ring below its slots, px


def _section(dog: Dog, middle: float, level: float, shift: float, lift: float) -> list[str]:
    """Draw both rings in a panel; ``shift`` and ``lift`` in mm are those of the sliding ring."""
    lower = outline(dog, 7)
    upper = [(shift - x, lift - z) for x, z in lower]
    frame = (middle - 0.5 * PANEL, middle + 0.5 * PANEL)
    found = []
    for points, floor in ((lower, level + 70.0), (upper, level - 400.0)):
        placed = [(middle + x * SCALE, level - z * SCALE) for x, z in points]
        ends = [(placed[-1][0], floor), (placed[0][0], floor)]
        commands = "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in placed + ends) + " Z"
        found.append(svg.path(commands, "part"))
    left, right = frame
    box = f'<rect x="{left:.0f}" y="{level - 115:.0f}" width="{right - left:.0f}" height="185"/>'
    name = f"clip{middle:.0f}-{level:.0f}"
    body = "".join(found)
    return [f'<clipPath id="{name}">{box}</clipPath><g clip-path="url(#{name})">{body}</g>']


def _arrow(start: tuple[float, float], length: float, words: str) -> list[str]:
    tip = (start[0] + length, start[1])
    at = (start[0] + 0.5 * length, start[1] - 7.0)
    return [svg.line(start, tip, "edge"), svg.arrow(tip, start), svg.text(at, words)]


def _panel(dog: Dog, middle: float, sign: int) -> list[str]:
    """Draw one sign of the mismatch: faces before the touch, then the flanks that touch."""
    pitch, travel = dog.pitch / MM, (dog.height + dog.axial_gap) / MM
    name = "positive: traction flanks meet" if sign > 0 else "negative: braking flanks meet"
    found = [svg.text((middle, 24.0), f"Mismatch {name}", kind="title")]
    # Faces that overlap by half a face are parallel, and touch at a depth of L tan(chamfer).
    overlap = dog.face_width / MM
    deep = dog.axial_gap / MM + overlap * math.tan(dog.chamfer) - APART
    place = dog.crest_overlap / MM - overlap
    found += _section(dog, middle, 160.0, place, travel - deep)
    leads = "faces fall away from each other" if sign > 0 else "faces come towards each other"
    found += _arrow((middle - sign * 70.0, 258.0), sign * 140.0, f"output ring: {leads}")
    flank = dog.traction if sign > 0 else dog.braking
    aside = 0.5 * pitch - sign * LEFT * math.tan(flank)
    found += _section(dog, middle, 395.0, aside, LEFT)
    side = "traction" if sign > 0 else "braking"
    found += _marks(dog, middle, sign)
    found += _arrow((middle - sign * 70.0, 492.0), sign * 140.0, f"output ring: {side} flank leads")
    who = "faster" if sign > 0 else "slower"
    found.append(
        svg.text((middle, 516.0), f"the ring on the engine's side is {who}:", kind="small")
    )
    drives = "upshift, drive torque" if sign > 0 else "downshift, overrun; dogs are thrown back"
    found.append(svg.text((middle, 534.0), drives, kind="small"))
    return found


def _marks(dog: Dog, middle: float, sign: int) -> list[str]:
    """Mark where flanks touch."""
    half, quarter = 0.5 * dog.height / MM, 0.25 * dog.pitch / MM
    flank = dog.traction if sign > 0 else dog.braking
    top = half if sign > 0 else half - dog.edge_drop / MM
    low = LEFT - half if sign > 0 else LEFT - half + dog.edge_drop / MM
    found = []
    for dogs in (-1, 0, 1):
        ends = [
            (middle + (dogs * 4 * quarter + sign * (quarter - z * math.tan(flank))) * SCALE, z)
            for z in (low, top)
        ]
        (a, b), (c, d) = ends
        if max(abs(a - middle), abs(c - middle)) < 0.5 * PANEL:
            commands = f"M{a:.1f},{395.0 - b * SCALE:.1f} L{c:.1f},{395.0 - d * SCALE:.1f}"
            found.append(f'<path d="{commands}" stroke="{FLANK}" stroke-width="4" fill="none"/>')
    return found


def picture(dog: Dog) -> str:
    """Draw both signs beside each other as an SVG document."""
    elements = [f'<rect width="{WIDTH:.0f}" height="{HEIGHT:.0f}" fill="#fff"/>']
    for middle, sign in ((245.0, 1), (735.0, -1)):
        elements += _panel(dog, middle, sign)
    for level, words in ((60.0, "sliding ring"), (222.0, "output ring")):
        elements.append(svg.text((28.0, level), words, anchor="start"))
    return svg.document(WIDTH, HEIGHT, elements, "What the sign of the mismatch means")


def named_svg(dog: Dog, title: str = "Dogs in neutral, with their quantities") -> str:
    """Draw the section of both rings at the mean radius, unrolled, as an SVG document.

    The upper ring is the sliding one, turned by half a pitch less a bit, so that both crests stand
    free. Shape and axial gap are to scale.
    """
    rings = _Rings(dog)
    elements = [rings.part(), rings.other(), *rings.angles(), *rings.lengths(), *rings.words(title)]
    return svg.document(WIDTH, NAMED_HEIGHT, elements, title)


class _Rings:
    """Places the rings on the sheet: metres to pixels, the dog in the middle."""

    def __init__(self, dog: Dog) -> None:
        self.dog = dog
        self.scale = 2.0 * REACH / (PITCHES * dog.pitch)
        self.low = 470.0 - 0.5 * dog.height * self.scale
        self.lift = dog.height + dog.axial_gap

    def at(self, x: float, z: float) -> Point:
        """Place a point of the output ring, m, above its median plane."""
        return 0.5 * WIDTH + x * self.scale, self.low - z * self.scale

    def facing(self, x: float, z: float) -> Point:
        """Place a point of the sliding ring, which is alike and turned over."""
        return self.at(-x + 0.36 * self.dog.pitch, self.lift - z)

    def _profile(self) -> list[tuple[float, float]]:
        return [(x + i * self.dog.pitch, z) for i in range(-2, 3) for x, z in section(self.dog)]

    def part(self) -> str:
        """Draw the output ring."""
        points = [self.at(*p) for p in self._profile()]
        return self._ring(points, self.at(0.0, -0.5 * self.dog.height)[1] + RIM, "a")

    def other(self) -> str:
        """Draw the sliding ring."""
        points = [self.facing(*p) for p in self._profile()]
        return self._ring(points, self.facing(0.0, -0.5 * self.dog.height)[1] - RIM, "b")

    def _ring(self, points: list[Point], back: float, name: str) -> str:
        ends = [*points, (points[-1][0], back), (points[0][0], back)]
        outline = "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in ends) + " Z"
        frame = 0.5 * WIDTH - REACH, 0.5 * WIDTH + REACH
        return svg.clipped(svg.path(outline, "part"), frame, NAMED_HEIGHT, f"ring-{name}")

    def angles(self) -> list[str]:
        """Draw chamfer and side angles."""
        dog = self.dog
        _, edge, crest, _ = (self.at(*p) for p in section(dog))
        reach = 0.7 * dog.height * self.scale
        return [
            svg.angle(crest, (180.0, 180.0 + dog.chamfer / DEG),
                      0.6 * dog.tip_width * self.scale, "chamfer \u03b1",
                      (crest[0] - 120.0, crest[1] + 64.0)),
            svg.angle(crest, (-90.0, -90.0 + dog.traction / DEG), reach,
                      "traction flank \u03b2", (crest[0] + 74.0, crest[1] + 70.0)),
            svg.angle(edge, (-90.0 - dog.braking / DEG, -90.0), 0.8 * reach,
                      "braking flank \u03b3", (edge[0] - 60.0, edge[1] + 96.0)),
        ]  # fmt: skip

    def lengths(self) -> list[str]:
        """Draw height, gap, widths and pitch by name."""
        dog, at, half = self.dog, self.at, 0.5 * self.dog.height
        root_b, edge, crest, root_t = section(dog)
        tip_b = crest[0] - dog.tip_width, half
        base, right = at(0.0, -half)[1], 0.5 * WIDTH + REACH
        left = 0.5 * WIDTH - REACH
        upper = crest[0], half + dog.axial_gap
        return [
            svg.dimension(at(*crest), at(crest[0], -half), right + 30.0, "height h", True),
            svg.dimension(at(*crest), at(*upper), right + 70.0, "", True),
            svg.text((right + 78.0, 0.5 * (at(*crest)[1] + at(*upper)[1]) + 4.0), "axial gap",
                     "start"),
            svg.dimension(at(*edge), at(edge[0], -half), left - 24.0, "flank height", True),
            svg.dimension(at(*tip_b), at(*crest), at(*crest)[1] - 14.0, "tip width"),
            svg.dimension(at(*root_b), at(*root_t), base + RIM + 22.0, "root width"),
            svg.dimension(at(root_t[0] - dog.pitch, -half), at(*root_t), base + RIM + 52.0,
                          "pitch (one of N)"),
        ]  # fmt: skip

    def words(self, title: str) -> list[str]:
        """Write the names of surfaces and rings."""
        dog, half = self.dog, 0.5 * self.dog.height
        _, edge, crest, _ = section(dog)
        face = self.at(0.7 * edge[0] + 0.3 * crest[0], 0.7 * edge[1] + 0.3 * crest[1])
        top = self.facing(0.0, -half)[1] - RIM
        slot = self.at(0.5 * dog.pitch, -half)
        return [
            svg.text((36.0, 30.0), title, "start", "title"),
            svg.leader(self.at(*crest), (self.at(*crest)[0] + 60.0, self.at(*crest)[1] - 26.0),
                       "crest"),
            svg.leader(face, (face[0] - 66.0, face[1] - 30.0), "face", "end"),
            svg.text((slot[0], slot[1] - 10.0), "slot"),
            svg.text((0.5 * WIDTH, self.at(0.0, -half)[1] + 28.0), "output ring", kind="small"),
            svg.text((0.5 * WIDTH, top + 24.0), "sliding ring, pushed by the shift force",
                     kind="small"),
            svg.line((0.5 * WIDTH, top - 46.0), (0.5 * WIDTH, top - 6.0)),
            svg.arrow((0.5 * WIDTH, top - 2.0), (0.5 * WIDTH, top - 46.0)),
            svg.text((0.5 * WIDTH + 8.0, top - 28.0), "shift force", "start"),
            svg.text((36.0, NAMED_HEIGHT - 12.0), "Section at the mean radius, unrolled; the axis "
                     "of the rings is upright. Mismatch: the rings pass each other to the left and "
                     "right.", "start", "small"),
        ]  # fmt: skip


if __name__ == "__main__":
    draw = {"mismatch": picture, "dog": named_svg}[sys.argv[1]]
    print(draw(paper_study().clutch.dog), end="")
