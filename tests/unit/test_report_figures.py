"""The figures of the report by their data: values, and marks that tell without colour."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.study.convergence import convergence_figure, course
from dogshape.pipeline.reports.study.front import (
    LETTER,
    PLOT,
    WIDTHS,
    front_figure,
    sure_figure,
    third_figure,
)
from dogshape.pipeline.reports.study.goals import MARGIN
from dogshape.pipeline.reports.study.point_gains import (
    engaged_figure,
    gain_figure,
    gains,
    is_grid,
    listed_figure,
    points_figure,
)
from dogshape.pipeline.reports.study.single_shifts import (
    Shifts,
    distribution,
    distribution_figure,
    quantile_rows,
)
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.sim.versions import bundled_root
from tests.found import FORCE, LENGTH, TIME, VARIABLES, Row, confirmed, design, shift


def traces(figure: go.Figure) -> dict[str, Any]:
    return {trace.name: trace for trace in figure.data}


def told_apart(figure: go.Figure, kinds: tuple[str, ...]) -> bool:
    """Whether kinds differ by symbol or dash, and so without colour."""
    found = traces(figure)
    looks = [(found[k].marker.symbol, getattr(found[k].line, "dash", None)) for k in kinds]
    return len(set(looks)) == len(looks)


def test_front_shows_every_design_at_its_place_with_its_interval(result: Row) -> None:
    result["front"][1] |= {"low": 0.077, "high": 0.085}
    result["trials"][5][LENGTH] = 6.2
    result["trials"].append(design(6, None, 13.0))
    figure = front_figure(result, VARIABLES, LENGTH)
    found = traces(figure)
    places = {k: list(zip(found[k].x, found[k].y, strict=True)) for k in found}
    assert places["chosen"] == [(pytest.approx(70.0), 7.0)]
    assert places["prototype"] == [(pytest.approx(100.0), 8.0)]
    assert places["fails when simulated"] == [(pytest.approx(60.0), 6.5)]
    # One that is far longer and was not simulated does not stretch the axis.
    assert places["infeasible"] == [("not<br>simulated", 6.2)]
    assert figure.layout.yaxis.range[1] < 9.0
    symbols = [found[k].marker.symbol for k in places if k != "border of the front"]
    assert len(set(symbols)) == len(symbols)
    assert found["chosen"].error_x.array == pytest.approx([1.96])
    assert (found["front"].error_x.array[0], found["front"].error_x.arrayminus[0]) == (
        pytest.approx(5.0), pytest.approx(3.0),
    )  # fmt: skip
    # What lies right of and above a design is beaten by it: first right, then down.
    border = found["border of the front"]
    assert list(border.x) == pytest.approx([70.0, 80.0])
    assert border.line.shape == "hv"
    said = [note.text for note in figure.layout.annotations]
    assert sorted(said) == ["1", "<b>chosen: design 2</b>", "<b>prototype</b>"]
    for words in ("design 1", "80.0 ± 1.0 ms", "number of dogs N 16", "tip width 2.0 %"):
        assert words in found["front"].text[0]
    assert told_apart(figure, ("dominated", "fails when simulated", "front", "chosen", "prototype"))


def test_third_objective_is_size_and_number(result: Row) -> None:
    result["objectives"] = [TIME, LENGTH, FORCE]
    assert "border of the front" not in traces(front_figure(result, VARIABLES, LENGTH))
    figure = third_figure(result, VARIABLES, LENGTH, FORCE)
    found = traces(figure)
    assert "fails when simulated" not in found
    assert found["front"].marker.size[0] == 9.0
    assert found["prototype"].marker.size[0] == 36.0
    said = sorted(note.text for note in figure.layout.annotations)
    assert said == ["1: 6000", "2: 7000", "<b>prototype</b>: 8000"]


def test_how_sure_with_and_without_what_confirms(result: Row) -> None:
    plain = sure_figure(result)
    assert [trace.name for trace in plain.data] == [
        "search, 95 % interval", "new angles, 95 % interval",
    ]  # fmt: skip
    assert list(plain.data[0].y) == ["design 1", "design 2 (chosen)"]
    assert list(plain.data[1].x) == pytest.approx([80.0])
    assert plain.data[1].marker.symbol != plain.data[0].marker.symbol
    for row, share in zip(result["front"], (0.9, 0.6), strict=True):
        row["probability_on_front"] = share
    result["confirmation"]["designs"].append({"trial": 1, **confirmed([], 0.083)})
    full = traces(sure_figure(result))
    assert list(full["probability on the front"].x) == [0.6, 0.9]
    assert list(full["new angles, 95 % interval"].x) == pytest.approx([83.0, 80.0])
    result["confirmation"] = None
    assert len(sure_figure(result).data) == 2


def test_gain_at_each_operating_point(result: Row) -> None:
    first, second = gains(result["confirmation"])
    assert first.gain_s == pytest.approx(0.05)
    assert first.error_s == pytest.approx(math.hypot(0.002, 0.002))
    assert first.clear
    assert second.gain_s == pytest.approx(-0.01)
    figure = gain_figure(result["confirmation"])
    assert np.asarray(figure.data[0].z)[:, 0] == pytest.approx([50.0, -10.0])
    assert list(figure.data[0].y) == ["50", "100"]
    assert figure.data[0].text[0][0] == "+50.0 ± 2.8"
    assert figure.data[0].text[1][0] == "\N{MINUS SIGN}10.0 ± 3.6 slower"
    # The loss, and it alone, has a frame, which a print in grey shows.
    assert [(shape.y0, shape.line.dash) for shape in figure.layout.shapes] == [(0.54, "solid")]


def test_share_engaged_with_counts(result: Row) -> None:
    prototype, chosen = engaged_figure(result["confirmation"]).data
    assert np.asarray(prototype.z)[:, 0].tolist() == [1.0, 0.5]
    assert prototype.text[1][0] == "50 %<br>8/16"
    assert chosen.text[1][0] == "100 %<br>16/16"


def test_mean_times_over_mismatch_differ_by_dash_and_mark(result: Row) -> None:
    figure = points_figure(result["confirmation"])
    assert list(traces(figure)["chosen"].y) == pytest.approx([60.0, 100.0])
    assert told_apart(figure, ("prototype", "chosen"))


def test_points_that_are_no_grid_have_a_line_each(result: Row) -> None:
    confirmation = result["confirmation"]
    assert is_grid(confirmation)
    for key in ("prototype", "best"):
        first, second = confirmation[key]["points"]
        confirmation[key]["points"] = [
            {**first, "mismatch_rpm": -50.0, "weight": 3.0},
            {**second, "force_N": 469.0, "weight": 1.0},
        ]
    assert not is_grid(confirmation)
    found = traces(listed_figure(confirmation))
    names = ["\N{MINUS SIGN}50 1/min, 235.2 N (3)", "100 1/min, 469 N (1)"]
    assert list(found["chosen"].y) == names
    assert list(found["chosen"].x) == pytest.approx([60.0, 100.0])
    assert list(found["gain"].x) == pytest.approx([50.0, -10.0])
    assert list(found["engaged, prototype"].text) == ["100 % 16/16", "50 % 8/16"]


def test_maps_say_weights_and_gaps_where_the_mismatch_turns(result: Row) -> None:
    confirmation = result["confirmation"]
    for key in ("prototype", "best"):
        first, second = confirmation[key]["points"]
        points = [{**first, "mismatch_rpm": -50.0, "weight": 2.0}, {**second, "weight": 1.0}]
        confirmation[key]["points"] = points
    figure = gain_figure(confirmation)
    assert list(figure.layout.yaxis.ticktext) == ["\N{MINUS SIGN}50 (2)", "100 (1)"]
    means = points_figure(confirmation)
    assert list(traces(means)["chosen"].x) == [-50, None, 100]
    assert means.layout.xaxis.type is None


def test_front_of_what_is_maximised_has_errors_of_both_objectives(result: Row) -> None:
    result |= {"objectives": [MARGIN, TIME], "leading": MARGIN}
    result["front"] = result["front"][::-1]
    figure = front_figure(result, VARIABLES, TIME)
    found = traces(figure)
    assert list(found["chosen"].x) == pytest.approx([3.0])
    assert list(found["chosen"].y) == pytest.approx([70.0])
    assert found["chosen"].error_y.array == pytest.approx([1.96])
    assert found["chosen"].error_x.array is None
    assert figure.layout.xaxis.title.text == "smallest margin, % (more is better)"


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
    assert quantile_rows(both)[0]["lost"] == 1
    figure = distribution_figure(both)
    curve = traces(figure)["prototype"]
    steps = next(t for t in figure.data if t.name == "prototype" and t.mode == "lines")
    assert steps.y[-1] == pytest.approx(0.99)
    assert steps.x[-1] == pytest.approx(990.0)
    assert curve.name == "prototype"
    marks = next(t for t in figure.data if t.name == "prototype" and t.mode == "markers")
    assert list(marks.x) == pytest.approx([500.0, 950.0, 990.0])
    assert [note.text for note in figure.layout.annotations] == [" 50%", " 95%", " 99%"]
    dashes = {t.line.dash for t in figure.data if t.mode == "lines"}
    assert dashes == {"dash", "solid"}
    assert distribution(Shifts(study, ()), own) is None


def test_course_counts_shifts_of_every_simulated_design(study: Setup, result: Row) -> None:
    result["trials"] = [{**study.prototype, **row} for row in result["trials"]]
    each = 2 * study.file.expectation.angles
    found = course(result, Shifts(study, ()))
    # The fifth design costs shifts, too, but is no answer; the last was not simulated.
    assert found.shifts.tolist() == [each, 2 * each, 3 * each, 4 * each]
    assert found.best == pytest.approx([100.0, 80.0, 70.0, 70.0])
    # Box 70 to 100 ms by 6 to 8 mm: the second leaves a third of the time, the third half
    # of the length undominated.
    assert found.volume == pytest.approx([0.0, 2 / 3, 2 / 3 + 1 / 6, 2 / 3 + 1 / 6])
    figure = traces(convergence_figure(result, found))
    assert list(figure["best so far"].y) == pytest.approx([100.0, 80.0, 70.0, 70.0])
    assert figure["best so far"].line.dash != figure["hypervolume"].line.dash


def test_a_prototype_far_behind_has_a_panel_of_its_own(result: Row) -> None:
    """No empty stretch of the axis; the places stay what they are."""
    for row in result["trials"]:
        if row["prototype"]:
            row[TIME] = 0.2
    figure = front_figure(result, VARIABLES, LENGTH)
    found = traces(figure)
    assert (found["prototype"].xaxis, found["front"].xaxis) == ("x2", "x")
    assert list(found["prototype"].x) == pytest.approx([200.0])
    low, high = figure.layout.xaxis2.range
    assert low < 200.0 < high
    assert figure.layout.xaxis.range[1] < 120.0
    names = [(note.text, note.xref) for note in figure.layout.annotations]
    assert ("<b>prototype</b>", "x2") in names


def test_names_stand_within_the_axes_where_the_front_leaves_no_design(result: Row) -> None:
    figure = front_figure(result, VARIABLES, LENGTH)
    low, high = figure.layout.xaxis.range
    notes = [note for note in figure.layout.annotations if note.text != "<b>prototype</b>"]
    for note in notes:
        assert note.ay > 0  # shorter: below the front
        middle = PLOT[0] * (note.x - low) / (high - low) + note.ax
        half = 0.5 * LETTER * len(note.text.replace("<b>", "").replace("</b>", ""))
        assert half - 1e-9 <= middle <= PLOT[0] - half + 1e-9
    assert len(notes) == 2


@pytest.mark.parametrize("width", WIDTHS)
def test_names_cover_no_mark_and_no_other_name(width: float) -> None:
    """The front of the default study, whose first designs are close to each other."""
    result = json.loads((bundled_root() / "mq200/result.json").read_text())
    variables = list(load_study("mq200").variables)
    figure = front_figure(result, variables, LENGTH)
    ends = figure.layout.xaxis.range, figure.layout.yaxis.range
    notes = [note for note in figure.layout.annotations if note.xref == "x"]
    assert len(notes) == len(result["front"])

    def placed(note: Any) -> tuple[float, float]:
        x, y = (
            wide * (value - low) / (high - low)
            for value, (low, high), wide in zip(
                (note.x, note.y), ends, (width, PLOT[1]), strict=True
            )
        )
        return x, y

    boxes = [(*placed(note), 8.0, 8.0) for note in notes]
    for note in notes:
        x, y = placed(note)
        half = 0.5 * LETTER * len(note.text.replace("<b>", "").replace("</b>", ""))
        boxes.append((x + note.ax, y - note.ay, half, 9.0))
    for k, one in enumerate(boxes[len(notes) :], start=len(notes)):
        for other in boxes[:k]:
            apart = [abs(one[i] - other[i]) >= one[i + 2] + other[i + 2] for i in (0, 1)]
            assert any(apart), (one, other)
