"""Draw the pictures of the docs that come from kept results, and the sketches of a dog.

    python -m benchmarks.drawings

``DRAWINGS`` has the function that draws each file. Coordinates are px, y downwards.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape
from statistics import fmean

from benchmarks.figures import ROOT, effect_title, gap, measured_points, numbers

Point = tuple[float, float]

INK = "#1b2733"
QUIET = "#55626f"
BLUE = "#1f5fa8"
ORANGE = "#c8590c"
STYLE = f"""
text{{font:13px system-ui,sans-serif;fill:{INK}}}
text.title{{font-size:15px;font-weight:600}}
text.small{{font-size:12px;fill:{QUIET}}}
.thin{{fill:none;stroke:{QUIET};stroke-width:.9}}
.grid{{fill:none;stroke:#d7dde3;stroke-width:.8}}
.axis{{fill:none;stroke:{QUIET};stroke-width:.9;stroke-dasharray:12 3 2 3}}
.output{{fill:#f3ddcb;stroke:{ORANGE};stroke-width:2}}
.sliding{{fill:#c9d8ea;stroke:{BLUE};stroke-width:2}}
.mark{{fill:{INK};stroke:none}}
.bar{{fill:#9cc3ee;stroke:{BLUE};stroke-width:1}}
"""


def document(width: int, height: int, title: str, elements: Sequence[str]) -> str:
    """Write an SVG document of elements."""
    body = "\n".join(elements)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" role="img" aria-label="{escape(title)}">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n"
        f'<rect width="{width}" height="{height}" fill="#fff"/>\n{body}\n</svg>\n'
    )


def text(place: Point, words: str, anchor: str = "middle", kind: str = "") -> str:
    """Write words at a place."""
    look = f' class="{kind}"' if kind else ""
    return (
        f'<text x="{place[0]:.1f}" y="{place[1]:.1f}" text-anchor="{anchor}"{look}>'
        f"{escape(words)}</text>"
    )


def line(points: Sequence[Point], kind: str = "thin", closed: bool = False, look: str = "") -> str:
    """Draw straight lines through points."""
    path = "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in points) + (" Z" if closed else "")
    return f'<path d="{path}" class="{kind}"{look}/>'


def pointer(tip: Point, place: Point, words: str, anchor: str = "middle") -> str:
    """Write words at a place, with a line to what they name."""
    return line([place, tip]) + dot(tip, 2.5) + text((place[0], place[1] - 5), words, anchor)


def dot(place: Point, radius: float, colour: str = INK, opacity: float = 1.0) -> str:
    """Draw a dot."""
    return (
        f'<circle cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="{radius}" fill="{colour}" '
        f'fill-opacity="{opacity}"/>'
    )


def shifted(element: str, right: float, down: float = 0.0) -> str:
    """Move an element."""
    return f'<g transform="translate({right:.0f} {down:.0f})">{element}</g>'


# Measured beside simulated

CHART = (70.0, 44.0, 620.0, 300.0)  #: left, top, width and height of the axes
MAX_TIME_MS = 500.0


def measured_times() -> str:
    """Draw shift times of bench, published model and simulation over the mismatch."""
    points = measured_points()
    speeds = sorted({point.mismatch_rpm for point in points})
    left, top, width, height = CHART
    low = math.log(speeds[0] / 1.3)
    high = math.log(speeds[-1] * 1.3)

    def place(speed: float, seconds: float) -> Point:
        share = (math.log(speed) - low) / (high - low)
        return left + share * width, top + height * (1.0 - 1e3 * seconds / MAX_TIME_MS)

    elements = [text((left, 24), "Shift times of the published bench", "start", "title")]
    for time_ms in range(0, int(MAX_TIME_MS) + 1, 100):
        y = place(speeds[0], 1e-3 * time_ms)[1]
        elements += [
            line([(left, y), (left + width, y)], "grid"),
            text((left - 8, y + 4), f"{time_ms} ms", "end", "small"),
        ]
    for speed in speeds:
        x = place(speed, 0.0)[0]
        elements.append(text((x, top + height + 18), f"{speed:.0f}", kind="small"))
    elements.append(text((left + 0.5 * width, top + height + 38), "mismatch, 1/min", kind="small"))
    series: tuple[tuple[str, str, Callable[..., float], int], ...] = (
        ("measured on the bench", INK, lambda point: point.measured, 10),
        ("published Adams model", ORANGE, lambda point: point.model, 10),
        ("simulated", BLUE, lambda point: point.measured - point.gap, -6),
    )
    for index, (words, colour, time, _) in enumerate(series):
        elements += [
            dot(place(point.mismatch_rpm, time(point)), 3, colour, 0.35) for point in points
        ]
        means = [
            place(speed, fmean(time(point) for point in points if point.mismatch_rpm == speed))
            for speed in speeds
        ]
        look = f' style="stroke:{colour};stroke-width:2.5"'
        elements += [line(means, "thin", look=look), *(dot(mean, 4, colour) for mean in means)]
        y = top + 20 + 22 * index
        x = left + width - 190
        elements += [line([(x, y), (x + 28, y)], "thin", look=look), dot((x + 14, y), 4, colour)]
        elements.append(text((x + 36, y + 4), words, "start"))
    note = "lines: means over the shift forces; dots: single operating points"
    elements.append(text((left, top + height + 58), note, "start", "small"))
    return document(740, 410, "Shift times measured and simulated over the mismatch", elements)


# From a gap to a cause

BAR_HEIGHT = 22
ROW_HEIGHT = 34
MIN_INCLUSION = 0.01  #: effects below have no bar


def cause_steps() -> str:
    """Draw how effects close the gap of the stand, and the probability of each effect."""
    record = gap("stand")["gap"]
    steps = [("as simulated", record["baseline_rmse_s"])]
    for step in record["steps"]:
        steps.append((f"with {effect_title(step['effect'])}", step["rmse_s"]))
    steps.append(("chance alone", record["floor_rmse_s"]))
    inclusion = sorted(gap("stand")["inclusion"].items(), key=lambda pair: -pair[1])
    unknown = sum(
        hypothesis["probability"]
        for hypothesis in gap("stand")["hypotheses"]
        if hypothesis["effects"] == ["unknown"]
    )
    chances = [(effect_title(name), share) for name, share in inclusion if share >= MIN_INCLUSION]
    chances.append(("unknown cause", unknown))
    longest = max(value for _, value in steps)
    gap_rows = [(words, value / longest, f"{1e3 * value:.0f} ms") for words, value in steps]
    chance_rows = [(words, share, f"{100 * share:.0f} %") for words, share in chances]
    elements = [
        shifted(_bars("1. Gap of the mean times, root mean square", gap_rows), 0),
        shifted(_bars("2. Probability to be part of the cause", chance_rows), 490),
    ]
    height = 70 + ROW_HEIGHT * max(len(gap_rows), len(chance_rows))
    return document(980, height, "Gap of the published bench, and probability of causes", elements)


def _bars(title: str, rows: Sequence[tuple[str, float, str]]) -> str:
    """Draw rows of words, a bar of the share of the whole width, and a value."""
    start = 250
    width = 160
    elements = [text((16, 30), title, "start", "title")]
    for index, (words, share, value) in enumerate(rows):
        y = 50 + ROW_HEIGHT * index
        end = start + max(1.0, share * width)
        corners = [(start, y), (end, y), (end, y + BAR_HEIGHT), (start, y + BAR_HEIGHT)]
        elements += [
            text((start - 8, y + 16), words, "end"),
            line(corners, "bar", closed=True),
            text((end + 8, y + 16), value, "start"),
        ]
    return "".join(elements)


# Deviations, from the equations to the bench

MIN_DEVIATION = 0.01  #: left end of the axis, %
DECADES = 4  #: of the axis
DECADE_WIDTH = 100.0  #: px


def deviations() -> str:
    """Draw how far mean shift times deviate, from the equations to the bench, on a log axis."""
    points = measured_points()
    measured_ms = 1e3 * fmean(point.measured for point in points)
    stand = gap("stand")["gap"]
    rows = [
        (
            "1. solution of the equations",
            "accuracy 30 times tighter, largest",
            numbers("convergence", "largest error of a mean, %")[3],
        ),
        (
            "2. another program, same model",
            "compiled engine against Drake, median",
            numbers("engines", "all ")[6],
        ),
        (
            "another contact search and law",
            "MuJoCo against Drake, mean",
            numbers("second_engine", "all: means")[0],
        ),
        (
            "3. published model, its contact law",
            "all relative angles, root mean square",
            numbers("adams", "adams_impact, all")[0],
        ),
        (
            "the same, contact of the engines",
            "all relative angles, root mean square",
            numbers("adams", "adams2019, all")[0],
        ),
        (
            "published bench, with probable causes",
            "held-out points, root mean square",
            1e5 * stand["heldout_rmse_s"] / measured_ms,
        ),
        (
            "published bench, as simulated",
            "root mean square over the mean time",
            1e5 * stand["baseline_rmse_s"] / measured_ms,
        ),
    ]
    start = 560.0
    bottom = 50.0 + ROW_HEIGHT * len(rows)
    elements = [text((16, 30), "Deviation of mean shift times", "start", "title")]
    for decade in range(DECADES + 1):
        x = start + DECADE_WIDTH * decade
        elements += [
            line([(x, 44), (x, bottom)], "grid"),
            text((x, bottom + 18), f"{MIN_DEVIATION * 10**decade:g} %", kind="small"),
        ]
    for index, (question, measure, percents) in enumerate(rows):
        y = 50 + ROW_HEIGHT * index
        end = start + DECADE_WIDTH * math.log10(percents / MIN_DEVIATION)
        corners = [(start, y), (end, y), (end, y + BAR_HEIGHT), (start, y + BAR_HEIGHT)]
        elements += [
            text((268, y + 16), question, "end"),
            text((280, y + 16), measure, "start", "small"),
            line(corners, "bar", closed=True),
            text((end + 6, y + 16), f"{percents:.2g} %", "start"),
        ]
    height = 80 + ROW_HEIGHT * len(rows)
    return document(1040, height, "Deviations from the equations to the bench", elements)


# Sketches of a dog

PANEL_WIDTH = 190
BODY_END = 186.0  #: end of the output ring's body, px
FLOOR = 160.0


def sketches() -> str:
    """Draw crest, ridge, backlash, undercut and mount."""
    panels = (_crest(), _ridge(), _backlash(), _undercut(), _mount())
    names = ("crest", "ridge (roof tip)", "backlash", "undercut", "mount")
    elements = []
    for index, (name, panel) in enumerate(zip(names, panels, strict=True)):
        heading = text((92, 22), name, kind="title")
        elements.append(shifted(heading + panel, 6 + (PANEL_WIDTH + 4) * index))
    note = (
        "Sections at the mean radius, unrolled; axis upright. Orange: output ring, blue: sliding "
        "ring. Mount: sections along the axis."
    )
    elements.append(text((10, 244), note, "start", "small"))
    return document(980, 256, "Crest, ridge, backlash, undercut and mount of dogs", elements)


def _output_ring(profile: Sequence[Point]) -> str:
    """Draw the output ring with one dog."""
    left = [(0.0, BODY_END), (0.0, FLOOR)]
    right = [(184.0, FLOOR), (184.0, BODY_END)]
    return line([*left, *profile, *right], "output", closed=True)


def _sliding_ring(slot: Sequence[Point]) -> str:
    """Draw the sliding ring with one slot."""
    tip = 150.0
    left = [(0.0, 56.0), (0.0, tip)]
    right = [(184.0, tip), (184.0, 56.0)]
    return line([*left, *slot, *right], "sliding", closed=True)


def _crest() -> str:
    """Draw a dog with its crest at the traction flank."""
    return (
        _output_ring([(46, FLOOR), (62, 108), (118, 92), (130, FLOOR)])
        + pointer((118, 92), (140, 62), "crest")
        + pointer((90, 100), (60, 62), "chamfer \u03b1")
        + text((132, 128), "traction β", "start")
        + text((2, 104), "braking \u03b3", "start")
        + text((92, 205), "dog.crest = 1, or without it", kind="small")
    )


def _ridge() -> str:
    """Draw a dog whose tip falls to both sides of a ridge."""
    return (
        _output_ring([(46, FLOOR), (58, 112), (102, 90), (124, 104), (134, FLOOR)])
        + pointer((102, 90), (102, 60), "ridge")
        + pointer((76, 103), (40, 84), "chamfer")
        + pointer((115, 98), (142, 84), "back", "start")
        + text((92, 205), "dog.crest, chamfer_back_deg", kind="small")
    )


def _backlash() -> str:
    """Draw engaged dogs with play."""
    return (
        _output_ring([(56, FLOOR), (66, 96), (118, 96), (128, FLOOR)])
        + _sliding_ring([(43.6, 150), (53.6, 86), (116.4, 86), (126.4, 150)])
        + line([(48.2, 120), (62.3, 120)], "thin", look=' style="stroke-width:2.5"')
        + pointer((55, 120), (40, 48), "play")
        + text((92, 205), "dog.backlash_mm or _deg", kind="small")
    )


def _undercut() -> str:
    """Draw engaged dogs that narrow towards their roots."""
    return (
        _output_ring([(70, FLOOR), (58, 96), (126, 96), (114, FLOOR)])
        + _sliding_ring([(58.1, 150), (46.1, 86), (127.9, 86), (115.9, 150)])
        + line([(120, 128), (120, 76)], "axis")
        + pointer((120, 128), (150, 48), "angle < 0")
        + text((92, 205), "traction_deg, braking_deg < 0", kind="small")
    )


def _mount() -> str:
    """Draw dogs rooted on a face, and teeth of a sleeve rooted radially."""

    def box(left: float, top: float, right: float, bottom: float, kind: str) -> str:
        corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
        return line(corners, kind, closed=True)

    return (
        box(14, 58, 50, 102, "output")
        + box(50, 64, 68, 90, "output")
        + box(86, 58, 122, 102, "sliding")
        + box(68, 64, 86, 90, "sliding")
        + text((130, 84), "face", "start")
        + line([(4, 112), (180, 112)], "axis")
        + box(14, 154, 68, 176, "output")
        + box(44, 144, 68, 154, "output")
        + box(52, 124, 122, 136, "sliding")
        + box(70, 136, 122, 146, "sliding")
        + text((130, 138), "sleeve", "start")
        + line([(4, 188), (180, 188)], "axis")
        + text((92, 205), "dog.mount", kind="small")
    )


# Symbols of a clutch, for the questions of a new study


def symbols() -> str:
    """Draw the symbols of a clutch: both rings before the shift, play, ring and mount."""
    panels = {
        8: ("before the shift", _open_rings()),
        470: ("seated", _play()),
        690: ("ring along the axis", _ring_view()),
        900: ("mount", _mount() + pointer((58, 130), (30, 130), "t")),
    }
    elements = []
    for right, (name, panel) in panels.items():
        elements.append(shifted(text((0, 22), name, "start", "title") + panel, right))
    note = (
        "Not to scale. Orange: output ring, blue: sliding ring. Left: sections at the mean radius, "
        "unrolled."
    )
    elements.append(text((8, 318), note, "start", "small"))
    return document(1100, 328, "Symbols of a clutch", elements)


def _span(start: Point, end: Point, words: str, place: Point, anchor: str = "middle") -> str:
    """Draw a dimension from a point to another with its words at a place."""
    across = (0.0, 4.0) if start[1] == end[1] else (4.0, 0.0)
    ticks = [
        line([(x - across[0], y - across[1]), (x + across[0], y + across[1])])
        for x, y in (start, end)
    ]
    return line([start, end]) + "".join(ticks) + text(place, words, anchor)


def _open_rings() -> str:
    """Draw dogs over slots, with the angles of a roof tip."""
    floor, top = 250.0, 60.0
    profile = [(110.0, floor), (134.0, 204.0), (176.0, 178.0), (212.0, 192.0), (226.0, floor)]
    mirrored = [(472.0 - x, top + floor - y) for x, y in reversed(profile)]
    output = [(30.0, floor), *profile, (342.0, floor), (366.0, 204.0), (380.0, 195.3)]
    output += [(380.0, 276.0), (30.0, 276.0)]
    sliding = [(30.0, top), *mirrored, (380.0, top), (380.0, 36.0), (30.0, 36.0)]
    crest = profile[2]
    return (
        line(output, "output", closed=True)
        + line(sliding, "sliding", closed=True)
        + line([(100, crest[1]), (384, crest[1])], "axis")
        + line([(212, 192), (212, 246)], "axis")
        + line([(134, 204), (134, 246)], "axis")
        + text((146, 190), "\u03b1", "end")
        + text((205, 187), "\u03b1\u2082", "end")
        + text((214, 240), "β", "start")
        + text((131, 240), "\u03b3", "end")
        + _span((92, crest[1]), (92, floor), "h", (84, 218), "end")
        + _span((250, mirrored[2][1]), (250, crest[1]), "g", (244, 160), "end")
        + pointer(crest, (160, 150), "c")
        + pointer(profile[1], (112, 162), "\u03f1")
        + text((110, 269), "braking flank")
        + text((240, 269), "traction flank")
    )


def _play() -> str:
    """Draw seated dogs with play."""
    return (
        _output_ring([(56, FLOOR), (66, 96), (118, 96), (128, FLOOR)])
        + _sliding_ring([(43.6, 150), (53.6, 86), (116.4, 86), (126.4, 150)])
        + line([(48.2, 120), (62.3, 120)], "thin", look=' style="stroke-width:2.5"')
        + pointer((55, 120), (40, 48), "j")
    )


def _ring_view() -> str:
    """Draw a ring along its axis, with diameters and the radius of its toothing."""
    middle = (84.0, 146.0)

    def place(radius: float, turns: float) -> Point:
        angle = 2.0 * math.pi * turns
        return middle[0] + radius * math.cos(angle), middle[1] - radius * math.sin(angle)

    def circle(radius: float, kind: str) -> str:
        return f'<circle cx="{middle[0]}" cy="{middle[1]}" r="{radius}" class="{kind}"/>'

    count = 8
    dogs = []
    for index in range(count):
        ends = (index - 0.26) / count, (index + 0.26) / count
        corners = [place(52, ends[0]), place(76, ends[0]), place(76, ends[1]), place(52, ends[1])]
        dogs.append(line(corners, "sliding", closed=True))
    return (
        circle(76, "grid")
        + circle(52, "grid")
        + "".join(dogs)
        + circle(36, "axis")
        + line([middle, place(36, 0.14)])
        + text((92, 134), "rₛ", "end")
        + _span((8, 246), (160, 246), "D", (84, 262))
        + _span((32, 278), (136, 278), "d", (84, 294))
        + pointer(place(76, 0.25), (132, 46), "N dogs", "start")
    )


DRAWINGS: dict[str, Callable[[], str]] = {
    "pipeline/reports/templates/symbols.svg": symbols,
    "docs/measured.svg": measured_times,
    "docs/inference.svg": cause_steps,
    "docs/proof.svg": deviations,
    "docs/sketches.svg": sketches,
}


if __name__ == "__main__":
    for name, draw in DRAWINGS.items():
        (ROOT / name).write_text(draw(), encoding="utf-8")
