"""What the page of a shift says in words, and the solids it shows."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from rich.console import Console

from dogshape.cli.tables.shift_tables import shift_table
from dogshape.pipeline.reports.shift import story
from dogshape.pipeline.reports.shift.scene import ring_body, solids
from dogshape.pipeline.reports.shift.story import facts, why
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import dog_solid
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.shift.planes import dog_planes
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, RPM

Point = Callable[[float, float], OperatingPoint]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ((50.0, 469.0, 10.0), ("Face contact took", "to the next slot", "mm/ms")),
        ((249.0, 641.5, 3.0), ("Face contact took", "past 1 slot", "mismatch fell from 249 to")),
        ((5.0, 235.2, 13.0), ("Seating took", "flanks met at")),
        ((0.0, 641.5, 12.0), ("Free flight took", "gap of 1.00 mm")),
    ],
)
def test_sentence_names_the_longest_phase(
    plant: ClutchPlant,
    point: Point,
    asked: tuple[float, float, float],
    words: tuple[str, ...],
) -> None:
    mismatch, force, angle = asked
    result = engage(plant, point(mismatch, force), angle * DEG)
    sentence = why(result)
    assert all(word in sentence for word in words), sentence
    assert sentence.endswith(".")
    listed = facts(result, 12.3)
    assert listed[0].startswith("first touch" if "Face contact" in sentence else "crests meet")
    assert any(" skipped" in fact for fact in listed)
    assert listed[-1].endswith("12.3 N m")


def test_sentence_of_a_blocked_shift_and_of_a_time_out(clutch: Clutch, point: Point) -> None:
    flat = clutch.with_dog(replace(clutch.dog, chamfer=4.5 * DEG))
    blocked = engage(ClutchPlant(flat), point(0.0, 641.5), 0.0)
    assert blocked.outcome is Outcome.BLOCKED
    assert "Friction holds dog on dog" in why(blocked)
    late = engage(ClutchPlant(replace(clutch, timeout=0.03)), point(50.0, 469.0), 10 * DEG)
    assert late.outcome is Outcome.TIMED_OUT
    assert "Not engaged" in why(late)


def test_body_of_a_ring_is_closed_and_behind_the_dogs(prototype: Dog) -> None:
    body = ring_body(prototype, 3e-3)
    area = math.pi * (prototype.outer_radius**2 - prototype.inner_radius**2)
    assert body.volume == pytest.approx(3e-3 * area, rel=1e-3)
    assert body.vertices[:, 2].max() == pytest.approx(-0.5 * prototype.height)


def test_touching_surfaces_come_first_in_the_order_the_page_names(prototype: Dog) -> None:
    dog, planes = dog_solid(prototype), dog_planes(prototype)
    assert solids(prototype)["dog"]["cells"] == dog.cells.ravel().tolist()
    for index, name in enumerate(("traction", "face", "braking")):
        for a, b, c in dog.vertices[dog.cells[2 * index : 2 * index + 2]]:
            normal = np.cross(b - a, c - a)
            assert normal / np.linalg.norm(normal) == pytest.approx(planes[name].normal, abs=1e-9)


@pytest.mark.parametrize(
    ("speeds", "words"),
    [
        ((149, 60, 2, 27), "fell from 149 to 2 and rose to 27 1/min"),
        ((149, 100, 27, 27), "fell from 149 to 27 1/min"),
        ((100, 60, -20, 34), "fell from 100 to 0 and rose to 34 1/min"),
        ((-149, -60, -2, -27), "fell from \N{MINUS SIGN}149 to \N{MINUS SIGN}2 and turned to "
                               "\N{MINUS SIGN}27 1/min"),
        ((149, 148, 140, 145), ""),
    ],
)  # fmt: skip
def test_the_mismatch_is_told_with_its_least_and_its_end(
    plant: ClutchPlant, point: Point, speeds: tuple[float, ...], words: str
) -> None:
    result = engage(plant, point(50.0, 469.0), 10 * DEG)
    phase = result.phases[1]
    times = np.linspace(phase.start, phase.end, 200)
    course = np.interp(times, np.linspace(phase.start, phase.end, len(speeds)), speeds) * RPM
    every = {f.name: np.interp(times, result.trace.time, getattr(result.trace, f.name))
             for f in fields(result.trace)
             if getattr(result.trace, f.name) is not None}  # fmt: skip
    slower = every["output_speed"] - course
    trace = replace(result.trace, **{**every, "time": times, "sliding_speed": slower})
    said = story._on_faces(replace(result, trace=trace), phase)
    assert said.partition("mismatch ")[2] == words


def test_phases_have_the_names_of_the_field(plant: ClutchPlant, point: Point) -> None:
    """People read free flight; the record keeps its key."""
    result = engage(plant, point(0.0, 641.5), 12 * DEG)
    assert result.phases[0].name == "free fly"
    stream = io.StringIO()
    Console(file=stream, width=120).print(shift_table(result, None))
    assert "free flight" in stream.getvalue()
    assert "free fly " not in stream.getvalue()
