"""Pictures of a diagnosis as inline SVG: map of the gap, bars of the effects, steps of the gap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

from markupsafe import Markup

from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.gap_map import CLEAR_ERRORS, GapMap, MapCell
from dogshape.diagnosis.report.wording import chance, listed_effects, ms, size_lines
from dogshape.diagnosis.terms import NONE
from dogshape.pipeline.reports.charts import BLUE, GREY, INK, ORANGE
from dogshape.pipeline.reports.text import bind_units, minus

WIDTH = 380.0  #: of a picture, px
MAP_LEFT = 74.0  #: of the first column of a map, px
MAP_ROW = 44.0  #: height of a row of a map, px
BAR_HEIGHT = 13.0  #: px
LABEL_HEIGHT = 18.0  #: of the line over a bar, px
SIZE_HEIGHT = 16.0  #: of a line under a bar, px
ROW_GAP = 10.0  #: px
MAX_BARS = 6  #: effects in a picture
FULL_COLOUR_ERRORS = 8.0  #: standard errors from which a cell has its full colour
MAX_TINT = 0.7  #: of the colour of a cell
PAPER = "#f1f3f5"  #: colour of a cell within the error
MIN_STEP_S = 5e-4  #: s, of a step that is drawn


class Bar(NamedTuple):
    """A horizontal bar between two values, with its label and number above it."""

    label: str
    number: str
    start: float
    end: float
    colour: str
    lines: Sequence[str] = ()  #: of text below


def map_picture(gap_map: GapMap) -> Markup:
    """Draw gaps in ms with their standard errors over mismatch and force."""
    rows = len(gap_map.forces)
    columns = len(gap_map.mismatches)
    width = (WIDTH - MAP_LEFT) / columns
    elements = []
    for i, force in enumerate(reversed(gap_map.forces)):
        y = i * MAP_ROW
        middle = y + 0.5 * MAP_ROW + 4.0
        elements.append(_text(MAP_LEFT - 8.0, middle, force.label, anchor="end"))
        for j in range(columns):
            x = MAP_LEFT + j * width
            cell = gap_map.cells.get((rows - 1 - i, j))
            if cell is not None:
                elements += _cell_elements(cell, x, y, width)
    foot = rows * MAP_ROW + 16.0
    for j, mismatch in enumerate(gap_map.mismatches):
        middle = MAP_LEFT + (j + 0.5) * width
        elements.append(_text(middle, foot, mismatch.label, anchor="middle"))
    elements += [
        _text(MAP_LEFT - 8.0, foot, "N \N{RIGHTWARDS ARROW} 1/min", anchor="end", small=True),
        _text(MAP_LEFT, foot + 20.0, "gap in ms, in brackets standard errors;", small=True),
        _text(MAP_LEFT, foot + 36.0, "orange: bench slower, blue: faster", small=True),
    ]
    return _picture(foot + 42.0, elements, "Gap over mismatch and force")


def _cell_elements(cell: MapCell, x: float, y: float, width: float) -> Iterator[str]:
    """Draw a cell of a map at its upper left corner."""
    colour = PAPER
    if abs(cell.z) >= CLEAR_ERRORS:
        tint = MAX_TINT * min(1.0, abs(cell.z) / FULL_COLOUR_ERRORS)
        colour = _mix(ORANGE if cell.gap > 0.0 else BLUE, tint)
    yield _rectangle(x + 1.0, y + 1.0, width - 2.0, MAP_ROW - 2.0, colour)
    middle = x + 0.5 * width
    gap = minus(f"{1e3 * cell.gap:+z.0f}")
    yield _text(middle, y + 0.5 * MAP_ROW, gap, anchor="middle")
    errors = f"({abs(cell.z):.0f})"
    yield _text(middle, y + 0.5 * MAP_ROW + 14.0, errors, anchor="middle", small=True)


def effects_picture(diagnosis: Inference) -> Markup:
    """Draw the probability of each plausible effect, with its sizes."""
    bars = []
    for name in listed_effects(diagnosis)[:MAX_BARS]:
        probability = diagnosis.inclusion[name]
        bars.append(
            Bar(
                label=diagnosis.effects[name].plain,
                number=chance(probability),
                start=0.0,
                end=probability,
                colour=BLUE if name in diagnosis.verdict.causes else GREY,
                lines=size_lines(diagnosis, name),
            )
        )
    if not bars:
        probability = diagnosis.posterior.get(NONE, 0.0)
        bars.append(Bar("no effect", chance(probability), 0.0, probability, GREY))
    return _bars_picture(bars, 1.0, "Probability and size of each effect")


def steps_picture(diagnosis: Inference) -> Markup:
    """Draw the steps from the gap over each effect to what held-out points and chance leave."""
    gaps = diagnosis.held_out
    bars = [Bar("gap without any effect", ms(gaps.baseline), 0.0, gaps.baseline, ORANGE)]
    level = gaps.baseline
    steps = [(diagnosis.effects[step.effect].plain, step.rmse) for step in diagnosis.gap_steps]
    if steps:
        steps.append(("errors in common, each point held out", gaps.held_out))
    for label, end in steps:
        if abs(end - level) >= MIN_STEP_S:
            number = minus(f"{1e3 * (end - level):+.3g} ms")
            bars.append(Bar(label, number, level, end, BLUE if end < level else ORANGE))
        level = end
    if steps:
        bars.append(Bar("left at held-out points", ms(gaps.held_out), 0.0, gaps.held_out, INK))
    bars.append(Bar("left by chance alone", ms(gaps.chance), 0.0, gaps.chance, GREY))
    largest = max(max(bar.start, bar.end) for bar in bars)
    return _bars_picture(bars, largest, "Gap, root mean square over the operating points")


def _bars_picture(bars: Sequence[Bar], largest: float, title: str) -> Markup:
    """Draw bars below each other, on a scale from 0 to ``largest``."""
    elements = []
    y = 0.0
    scale = WIDTH / (largest or 1.0)
    for bar in bars:
        elements.append(_text(0.0, y + LABEL_HEIGHT - 5.0, bar.label))
        elements.append(_text(WIDTH, y + LABEL_HEIGHT - 5.0, bar.number, anchor="end"))
        y += LABEL_HEIGHT
        start, end = sorted((bar.start, bar.end))
        elements.append(_rectangle(0.0, y, WIDTH, BAR_HEIGHT, PAPER))
        width = max(1.0, scale * (end - start))
        elements.append(_rectangle(scale * start, y, width, BAR_HEIGHT, bar.colour))
        y += BAR_HEIGHT
        for line in bar.lines:
            y += SIZE_HEIGHT
            elements.append(_text(0.0, y - 2.0, line, small=True))
        y += ROW_GAP
    return _picture(y, elements, title)


def _mix(colour: str, share: float) -> str:
    """Mix a colour with white."""
    channels = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return "#" + "".join(f"{round(255 - share * (255 - channel)):02x}" for channel in channels)


def _rectangle(x: float, y: float, width: float, height: float, colour: str) -> str:
    return (
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" fill="{colour}"/>'
    )


def _text(x: float, y: float, words: str, *, anchor: str = "start", small: bool = False) -> str:
    kind = ' class="small"' if small else ""
    content = escape(bind_units(words))
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{kind}>{content}</text>'


def _picture(height: float, elements: Sequence[str], title: str) -> Markup:
    """Write an SVG of the common width; its title is the name for readers of the screen."""
    body = "\n".join(elements)
    return Markup(
        f'<svg class="picture" viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" '
        f'aria-label="{escape(title)}">\n{body}\n</svg>'
    )
