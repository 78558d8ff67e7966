"""The figures of the report by their data: values, and marks that tell without colour."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go
import pytest

from dogshape.pipeline.reports.charts import times_by_point
from dogshape.pipeline.reports.designs import MARGIN
from dogshape.pipeline.reports.study_page import front_figure
from tests.found import LENGTH, TIME, VARIABLES, Row, point


def traces(figure: go.Figure) -> dict[str, Any]:
    return {trace.name: trace for trace in figure.data}


def told_apart(figure: go.Figure, kinds: tuple[str, ...]) -> bool:
    """Whether kinds differ by symbol, and so without colour."""
    found = traces(figure)
    return len({found[kind].marker.symbol for kind in kinds}) == len(kinds)


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
    for words in ("design 1", "80.0 ± 1.0 ms", "number of dogs N: 16"):
        assert words in found["front"].hovertext[0]
    assert told_apart(figure, ("dominated", "fails when simulated", "front", "chosen", "prototype"))


def test_front_of_what_is_maximised(result: Row) -> None:
    result |= {"objectives": [TIME, MARGIN], "leading": MARGIN}
    figure = front_figure(result, VARIABLES, TIME)
    assert list(traces(figure)["chosen"].x) == pytest.approx([3.0])
    assert figure.layout.xaxis.title.text == "smallest margin, % (more is better)"


def test_one_objective_is_drawn_over_the_smallest_margin(result: Row) -> None:
    result |= {"objectives": [TIME]}
    found = traces(front_figure(result, VARIABLES, MARGIN))
    assert (list(found["chosen"].x), list(found["chosen"].y)) == ([70.0], [3.0])


def test_a_line_for_each_operating_point() -> None:
    unknown = point(100, 300.0, 0.0, 0.0) | {"mean_s": None, "standard_error_s": None}
    ours = [point(50, 235.2, 0.110, 0.002), unknown]
    theirs = [point(50, 235.2, 0.060, 0.002), point(5, 300.0, 0.100, 0.003)]
    figure = times_by_point({"prototype": ours, "chosen": theirs})
    names = [f"{place} 1/min, {force} N" for place, force in ((100, 300), (5, 300), (50, 235.2))]
    assert list(figure.layout.yaxis.categoryarray) == names
    chosen = traces(figure)["chosen"]
    assert list(chosen.y) == [names[2], names[1]]
    assert list(chosen.x) == pytest.approx([60.0, 100.0])
    assert list(chosen.error_x.array) == pytest.approx([1.96 * 2.0, 1.96 * 3.0])
    assert list(traces(figure)["prototype"].y) == [names[2]]
    assert told_apart(figure, ("prototype", "chosen"))
