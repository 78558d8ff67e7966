"""Drawing of both rings in neutral with the name of each quantity instead of its size."""

from __future__ import annotations

from dogshape.pipeline.export import svg
from dogshape.pipeline.export.svg import Point
from dogshape.sim.shift.geometry import Dog, section

WIDTH, HEIGHT = 980.0, 640.0  #: px
PITCHES = 1.5  #: that the drawing shows
REACH = 0.32 * WIDTH  #: of the rings either way, px
RIM = 46.0  #: of a ring below its slots, px


def named_svg(dog: Dog, title: str = "Dogs in neutral, with their quantities") -> str:
    """Draw the section of both rings at the mean radius, unrolled, as an SVG document.

    The upper ring is the sliding one, turned by half a pitch less a bit, so that both crests stand
    free. Shape and axial gap are to scale.
    """
    rings = _Rings(dog)
    elements = [rings.part(), rings.other(), *rings.angles(), *rings.lengths(), *rings.words(title)]
    return svg.document(WIDTH, HEIGHT, elements, title)


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
        return svg.clipped(svg.path(outline, "part"), frame, HEIGHT, f"ring-{name}")

    def angles(self) -> list[str]:
        """Draw chamfer and side angles."""
        dog = self.dog
        _, edge, crest, _ = (self.at(*p) for p in section(dog))
        reach, degree = 0.7 * dog.height * self.scale, 57.29577951308232
        return [
            svg.angle(crest, (180.0, 180.0 + dog.chamfer * degree),
                      0.6 * dog.tip_width * self.scale, "chamfer \u03b1",
                      (crest[0] - 120.0, crest[1] + 64.0)),
            svg.angle(crest, (-90.0, -90.0 + dog.traction * degree), reach,
                      "traction flank \u03b2", (crest[0] + 74.0, crest[1] + 70.0)),
            svg.angle(edge, (-90.0 - dog.braking * degree, -90.0), 0.8 * reach,
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
            svg.text((36.0, HEIGHT - 12.0), "Section at the mean radius, unrolled; the axis of the "
                     "rings is upright. Mismatch: the rings pass each other to the left and right.",
                     "start", "small"),
        ]  # fmt: skip
