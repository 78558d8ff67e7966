"""The picture of what the sign of the mismatch means, from the geometry of the prototype.

    python -m benchmarks.mismatch > docs/mismatch.svg

Sections at the mean radius, unrolled: before the touch, and when the first flank touches. The
output ring moves relative to the sliding one; angles grow to the right.
"""

from __future__ import annotations

import math

from benchmarks.common import paper_study
from dogshape.pipeline.export import svg
from dogshape.pipeline.export.drawing import outline
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.units import MM

WIDTH, HEIGHT = 980.0, 560.0  #: px
SCALE = 24.0  #: px for a mm
PANEL = 450.0  #: px, width of a section
APART = 0.5  #: mm between faces before the touch
LEFT = 1.4  #: mm before the end of the travel at which a flank touches
FLANK = "#c0392b"


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


if __name__ == "__main__":
    print(picture(paper_study().clutch.dog), end="")
