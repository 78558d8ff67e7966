"""The figures of the report by their data: values, and marks that tell without colour."""

from __future__ import annotations

import math
from typing import Any

import plotly.graph_objects as go
import pytest

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.designs import MARGIN, goals_of
from dogshape.pipeline.reports.single_shifts import Shifts, distribution
from dogshape.pipeline.reports.study_figures import (
    course_figure,
    course_of,
    distribution_figure,
    front_figure,
    points_figure,
    sure_figure,
)
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from tests.found import LENGTH, TIME, VARIABLES, Row, confirmed, shift


def traces(figure: go.Figure) -> dict[str, Any]:
    return {trace.name: trace for trace in figure.data}


def told_apart(figure: go.Figure, kinds: tuple[str, ...]) -> bool:
    """Whether kinds differ by symbol or dash, and so without colour."""
    found = traces(figure)
    looks = [(found[k].marker.symbol, getattr(found[k].line, "dash", None)) for k in kinds]
    return len(set(looks)) == len(looks)


def test_front_shows_every_design_at_its_place_with_its_interval(result: Row) -> None:
    figure = front_figure(result, VARIABLES, LENGTH)
    found = traces(figure)
    places = {k: list(zip(found[k].x, found[k].y, strict=True)) for k in found if k}
    assert places["chosen"] == [(pytest.approx(70.0), 7.0)]
    assert places["prototype"] == [(pytest.approx(100.0), 8.0)]
    assert places["fails when simulated"] == [(pytest.approx(60.0), 6.5)]
    assert found["chosen"].error_x.array == pytest.approx([1.96])
    # What lies right of and above a design is beaten by it: first right, then down.
    (border,) = [trace for trace in figure.data if trace.line.shape == "hv"]
    assert list(border.x) == pytest.approx([70.0, 80.0])
    assert list(found["front"].text) == ["1"]
    for words in ("design 1", "80.0 ± 1.0 ms", "number of dogs N 16", "2.0 %, tip width"):
        assert words in found["front"].hovertext[0]
    assert told_apart(figure, ("dominated", "fails when simulated", "front", "chosen", "prototype"))


def test_front_of_what_is_maximised(result: Row) -> None:
    result |= {"objectives": [TIME, MARGIN], "leading": MARGIN}
    figure = front_figure(result, VARIABLES, TIME)
    assert list(traces(figure)["chosen"].x) == pytest.approx([3.0])
    assert figure.layout.xaxis.title.text == "smallest margin, % (more is better)"


def test_intervals_of_the_front_by_search_and_new_angles(result: Row) -> None:
    result["confirmation"]["designs"].append({"trial": 1, **confirmed([], 0.083)})
    search, anew = sure_figure(result).data
    assert list(search.y) == ["design 1", "design 2"]
    assert list(anew.x) == pytest.approx([83.0, 80.0])
    assert anew.marker.symbol != search.marker.symbol
    result["confirmation"] = None
    assert len(sure_figure(result).data) == 1


def test_a_line_for_each_operating_point(result: Row) -> None:
    weights = {(50, 235.2): 3.0, (100, 235.2): 1.0}
    figure = points_figure(result["confirmation"], weights)
    (chosen,) = [trace for trace in figure.data if trace.name == "chosen"]
    assert list(chosen.y) == ["50 1/min, 235.2 N (3)", "100 1/min, 235.2 N (1)"]
    assert list(chosen.x) == pytest.approx([60.0, 100.0])
    assert told_apart(figure, ("prototype", "chosen"))
    (gain,) = [trace for trace in figure.data if trace.xaxis == "x2"]
    assert list(gain.x) == pytest.approx([50.0, -10.0])
    assert gain.error_x.array[0] == pytest.approx(1.96 * math.hypot(2.0, 2.0))
    shares = [list(trace.text) for trace in figure.data if trace.mode == "text"]
    assert shares[0] == ["100% 16/16", "50% 8/16"]


def test_course_counts_shifts_of_every_simulated_design(result: Row) -> None:
    found = course_of(result, goals_of(result)[0])
    # The fifth design costs shifts, too, but is no answer; the last was not simulated.
    assert [total for total, *_ in found] == [12, 24, 36, 48]
    best = [100.0, 80.0, 70.0, 70.0]
    assert [one for _, _, one, _ in found] == pytest.approx(best)
    assert list(traces(course_figure(result))["best so far"].y) == pytest.approx(best)


def test_distribution_of_single_shifts(study: Setup) -> None:
    own, fresh = study.prototype, {"seed": study.file.expectation.seed + NEW_ANGLES}
    times = [0.01 * k for k in range(1, 100)] + [None]
    place = {"mismatch_rpm": 50.0, "force_N": 469.0, **fresh}
    rows = tuple(shift(study, own, k, t, **place) for k, t in enumerate(times))
    found = distribution(Shifts(study, rows), own)
    assert found is not None
    assert found.quantile(0.5) == pytest.approx(0.5)
    assert found.quantile(0.99) == pytest.approx(0.99)
    assert math.isinf(found.quantile(1.0))
    both = {"prototype": found, "chosen": found}
    assert found.lost == 1
    figure = distribution_figure(both)
    curve = traces(figure)["prototype"]
    steps = next(t for t in figure.data if t.name == "prototype" and t.mode == "lines")
    assert steps.y[-1] == pytest.approx(0.99)
    assert steps.x[-1] == pytest.approx(990.0)
    assert curve.name == "prototype"
    dashes = {t.line.dash for t in figure.data if t.mode == "lines"}
    assert dashes == {"dash", "solid"}
    assert distribution(Shifts(study, ()), own) is None
