"""The figures of the report by their data: values, and marks that tell without colour."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go
import pytest

from dogshape.pipeline.reports.charts import front_figure, times_by_point
from dogshape.pipeline.reports.designs import MARGIN
from tests.found import LENGTH, TIME, VARIABLES, Row


def traces(figure: go.Figure) -> dict[str, Any]:
    return {trace.name: trace for trace in figure.data}


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
    for words in ("design 1", "80.0 ± 1.0 ms", "number of dogs N: 16"):
        assert words in found["front"].hovertext[0]
    assert len({found[kind].marker.symbol for kind in places}) == len(places) == 5
    numbers = figure.layout.annotations
    assert [(one.text, one.x) for one in numbers] == [("2", 70.0), ("1", 80.0)]
    assert len({one.ay for one in numbers}) == 2


def test_front_of_what_is_maximised(result: Row) -> None:
    result |= {"objectives": [TIME, MARGIN], "leading": MARGIN}
    figure = front_figure(result, VARIABLES, TIME)
    assert list(traces(figure)["chosen"].x) == pytest.approx([3.0])
    assert figure.layout.xaxis.title.text == "smallest margin, % (more is better)"


def test_a_line_for_each_operating_point() -> None:
    rows = [
        {"mismatch_rpm": 50, "force_N": 235.2, "a_s": 0.110, "a_error_s": 0.002, "b_s": 0.060},
        {"mismatch_rpm": 100, "force_N": 300.0, "a_s": None, "a_error_s": None, "b_s": None},
        {"mismatch_rpm": 5, "force_N": 300.0, "a_s": None, "a_error_s": None, "b_s": 0.100},
    ]
    figure = times_by_point(rows, {"one": ("a_s", "a_error_s"), "other": ("b_s", "")})
    names = [f"{place} 1/min, {force} N" for place, force in ((100, 300), (5, 300), (50, 235.2))]
    assert list(figure.layout.yaxis.categoryarray) == names
    one, other = figure.data
    assert (list(one.x), list(one.y)) == ([110.0], names[2:])
    assert (list(other.x), list(other.y)) == ([100.0, 60.0], names[1:])
    assert list(one.error_x.array) == pytest.approx([1.96 * 2.0])
    assert one.marker.symbol != other.marker.symbol
