"""Strokes of a technical drawing as SVG: lines, dimensions, angles, leaders.

Points are (x, y) in pixels, y downwards; every function returns one element.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

Point = tuple[float, float]

STYLE = """
.drawing .part{fill:#dbe5f0;stroke:#1b2733;stroke-width:1.6}
.drawing .edge{fill:none;stroke:#1b2733;stroke-width:1.2}
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

HEAD = 8.0  #: length of an arrow head, px
WIDTH = 7.2  #: of a character, px; close enough for a background


def document(width: float, height: float, elements: Sequence[str], title: str) -> str:
    """Write a whole SVG document."""
    body = "\n".join(elements)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" class="drawing" role="img" '
        f'aria-label="{escape(title)}">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n{body}\n</svg>\n"
    )


def path(commands: str, kind: str) -> str:
    """Draw a path with the class ``kind``."""
    return f'<path d="{commands}" class="{kind}"/>'


def clipped(element: str, frame: tuple[float, float], height: float, name: str = "frame") -> str:
    """Clip an element to the range between two x; each clip of a drawing has its own ``name``."""
    left, right = frame
    shape = f'<rect x="{left:.2f}" y="0" width="{right - left:.2f}" height="{height:.0f}"/>'
    return f'<clipPath id="{name}">{shape}</clipPath><g clip-path="url(#{name})">{element}</g>'


def line(a: Point, b: Point, kind: str = "thin") -> str:
    """Draw a straight line."""
    return path(f"M{a[0]:.2f},{a[1]:.2f} L{b[0]:.2f},{b[1]:.2f}", kind)


def text(at: Point, content: str, anchor: str = "middle", kind: str = "", turn: float = 0.0) -> str:
    """Write a text on a white ground, turned by ``turn`` degrees about its place."""
    x, y = at
    width = WIDTH * len(content) + 4.0
    left = {"middle": x - 0.5 * width, "start": x - 2.0, "end": x - width + 2.0}[anchor]
    ground = f'<rect x="{left:.1f}" y="{y - 12:.1f}" width="{width:.1f}" height="16" class="back"/>'
    words = (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" class="{kind}">'
        f"{escape(content)}</text>"
    )
    turned = f' transform="rotate({turn:.1f} {x:.1f} {y:.1f})"' if turn else ""
    return f"<g{turned}>{'' if kind else ground}{words}</g>"


def arrow(tip: Point, towards: Point) -> str:
    """Draw an arrow head at ``tip`` that points away from ``towards``."""
    length = math.dist(tip, towards) or 1.0
    ux, uy = (tip[0] - towards[0]) / length, (tip[1] - towards[1]) / length
    base = (tip[0] - HEAD * ux, tip[1] - HEAD * uy)
    left, right = (base[0] - 2.6 * uy, base[1] + 2.6 * ux), (base[0] + 2.6 * uy, base[1] - 2.6 * ux)
    points = " L".join(f"{x:.2f},{y:.2f}" for x, y in (tip, left, right))
    return path(f"M{points} Z", "head")


def dimension(a: Point, b: Point, at: float, content: str, upright: bool = False) -> str:
    """Draw a dimension from ``a`` to ``b`` with its extension lines.

    The dimension line is level at height ``at``, or ``upright`` at that x. Where it is too
    short for two arrow heads, they stand outside.
    """
    ends = [(at, p[1]) if upright else (p[0], at) for p in (a, b)]
    ends.sort()
    parts = [line(p, (at, p[1]) if upright else (p[0], at)) for p in (a, b)]
    first, last = ends
    length = math.dist(first, last)
    tight = length < 3.0 * HEAD
    ux, uy = ((last[0] - first[0]) / max(length, 1e-9), (last[1] - first[1]) / max(length, 1e-9))
    reach = 2.2 * HEAD if tight else 0.0
    start = (first[0] - reach * ux, first[1] - reach * uy)
    stop = (last[0] + reach * ux, last[1] + reach * uy)
    parts.append(line(start, stop))
    inner = ((first, start), (last, stop)) if tight else ((first, last), (last, first))
    parts += [arrow(tip, towards) for tip, towards in inner]
    middle = (0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1]))
    if upright:
        parts.append(text((at - 6.0, middle[1]), content, turn=-90.0))
    elif tight:
        parts.append(text((stop[0] + 5.0, at + 4.0), content, "start"))
    else:
        parts.append(text((middle[0], at - 5.0), content))
    return "".join(parts)


def angle(
    corner: Point, between: tuple[float, float], radius: float, content: str, place: Point
) -> str:
    """Draw an angle about a corner between two directions, degrees anticlockwise from x.

    A leader joins the arc's middle with the words at ``place``.
    """
    start, stop = between

    def at(degrees: float, reach: float) -> Point:
        turn = math.radians(degrees)
        return corner[0] + reach * math.cos(turn), corner[1] - reach * math.sin(turn)

    rays = [line(corner, at(degrees, radius * 1.15)) for degrees in (start, stop)]
    a, b = at(start, radius), at(stop, radius)
    sweep = 0 if stop > start else 1
    arc = f"M{a[0]:.2f},{a[1]:.2f} A{radius:.1f},{radius:.1f} 0 0 {sweep} {b[0]:.2f},{b[1]:.2f}"
    anchor = "start" if place[0] > corner[0] else "end"
    middle = at(0.5 * (start + stop), radius)
    return "".join([*rays, path(arc, "thin"), leader(middle, place, content, anchor)])


def leader(tip: Point, place: Point, content: str, anchor: str = "start") -> str:
    """Draw a leader from the words at ``place`` to ``tip``."""
    shift = 5.0 if anchor == "start" else -5.0
    words = text((place[0] + shift, place[1] + 4.0), content, anchor)
    return line(tip, place) + arrow(tip, place) + words
