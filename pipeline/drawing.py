"""The section of a pair of dogs as SVG, unrolled at the mean radius."""

from __future__ import annotations

from sim.geometry import Dog, section
from sim.units import DEG, MM


def outline(dog: Dog, dogs: int) -> list[tuple[float, float]]:
    """Return the profile of ``dogs`` neighbouring dogs with their slots, mm."""
    points = []
    for index in range(dogs):
        shift = (index - 0.5 * (dogs - 1)) * dog.pitch
        points += [((x + shift) / MM, z / MM) for x, z in section(dog)]
    return points


def section_svg(dog: Dog, title: str, span: float, width: int = 420) -> str:
    """Draw ``span`` m of both rings at full depth, to scale; equal spans compare."""
    half = 0.5 * span / MM
    depth = dog.height / MM
    dogs = 2 * int(span / dog.pitch) + 3
    lower = outline(dog, dogs)
    upper = [(-x + 0.5 * dog.pitch / MM, -z) for x, z in lower]
    scale = 0.5 * width / half
    height = (depth + 2.4) * scale

    def path(points: list[tuple[float, float]], floor: float) -> str:
        placed = [((x + half) * scale, (0.5 * depth + 1.2 - z) * scale) for x, z in points]
        ends = [(placed[-1][0], floor), (placed[0][0], floor)]
        return "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in placed + ends) + " Z"

    label = (
        f"{title}: chamfer {dog.chamfer / DEG:.1f}°, traction {dog.traction / DEG:.1f}°, "
        f"braking {dog.braking / DEG:.1f}°, height {depth:.2f} mm, {dog.count} dogs"
    )
    bar = 2.0 * scale
    return (
        f'<figure><svg viewBox="0 0 {width} {height:.0f}" width="{width}" role="img" '
        f'aria-label="{label}">'
        f'<path d="{path(lower, height)}" class="ring-a"/>'
        f'<path d="{path(upper, 0.0)}" class="ring-b"/>'
        f'<path d="M10,{height - 10:.1f} h{bar:.1f}" class="bar"/>'
        f'<text x="{16 + bar:.1f}" y="{height - 6:.1f}" class="note">2 mm</text>'
        f"</svg><figcaption>{label}</figcaption></figure>"
    )
