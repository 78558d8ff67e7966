"""The figures, tables and words of the report, by their values."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest

from pipeline.config import Study, load_study
from pipeline.evaluation import FRESH
from pipeline.folder import StudyFolder
from pipeline.journal import ShiftJournal
from pipeline.reporting import replays
from pipeline.reporting.convergence import convergence_figure, course, hypervolume
from pipeline.reporting.distribution import distribution, distribution_figure, quantile_rows
from pipeline.reporting.front import front_figure, sure_figure, third_figure
from pipeline.reporting.labels import Label, shifts_of
from pipeline.reporting.learned import learn_effects, stored_effects
from pipeline.reporting.names import interval, of_kinds, percent
from pipeline.reporting.operating import engaged_figure, gain_figure, gains, points_figure
from pipeline.reporting.parallel import APART, parallel_figure, spread
from pipeline.reporting.provenance import command_of
from pipeline.reporting.replays import replays_of, write_replays
from pipeline.reporting.shifts import Shifts, extremes, quantile, weights_of
from pipeline.reporting.summary import headline, points_of
from pipeline.reporting.tables import csv_link, designs_frame, in_parts
from sim.records import clutch_record
from surrogate.store import Stored, save
from tests.unit.test_explore import study as study  # noqa: PLC0414
from tests.unit.test_explore import surrogate as surrogate  # noqa: PLC0414

Row = dict[str, Any]
VARIABLES = ["chamfer_deg", "count"]
TIME, LENGTH, FORCE = "expected_shift_time_s", "axial_length_mm", "separating_force_N"


def design(trial: int, time: float | None, length: float, **changes: Any) -> Row:
    """A row of a search; the prototype is trial 0."""
    row: Row = {
        "trial": trial, "prototype": trial == 0, "chamfer_deg": 8.0 + trial, "count": 15 + trial,
        LENGTH: length, FORCE: 1000.0 * length, TIME: time,
        "standard_error_s": None if time is None else 0.001,
        "engaged": None if time is None else 1.0, "feasible": time is not None,
        "failed": [] if time is not None else ["tip_width"],
        "smallest_margin": 0.01 * (trial + 1), "weakest_check": "tip_width",
        "margins": {"tip_width": 0.01 * (trial + 1), "module": 0.5},
        "margin_worst_case": -0.02, "margin_root_sum_square": 0.0, "time_within_tolerances": None,
    }  # fmt: skip
    return row | changes


def point(mismatch: float, force: float, mean: float, error: float, engaged: float = 1.0) -> Row:
    return {"mismatch_rpm": mismatch, "force_N": force, "mean_s": mean, "standard_error_s": error,
            "engaged": engaged, "n": 16}  # fmt: skip


def confirmed(points: list[Row], mean: float) -> Row:
    return {TIME: mean, "standard_error_s": 0.0006, "points": points, "checks": [],
            "numerical_error_s": 1e-6, "lower_bound": False}  # fmt: skip


@pytest.fixture
def result() -> Row:
    """A search of six designs: prototype, two on the front, one beaten, two that fail."""
    rows = [
        design(0, 0.100, 8.0),
        design(1, 0.080, 6.0),
        design(2, 0.070, 7.0),
        design(3, 0.090, 7.5),
        design(4, 0.060, 6.5, feasible=False, failed=["edge_pressure_impact"]),
        design(5, None, 5.0),
    ]
    ours = [point(50, 235.2, 0.110, 0.002), point(100, 235.2, 0.090, 0.003, 0.5)]
    theirs = [point(50, 235.2, 0.060, 0.002), point(100, 235.2, 0.100, 0.002)]
    return {
        "study": "mq200", "objectives": [TIME, LENGTH], "trials": rows, "best": rows[2],
        "front": [rows[2], rows[1]], "n_simulated_designs": 5, "n_simulated_shifts": 100,
        "surrogate": None, "versions": {},
        "confirmation": {
            "angles": 16, "prototype": confirmed(ours, 0.100), "best": confirmed(theirs, 0.080),
            "gain_s": 0.020, "gain_standard_error_s": 0.001, "gain_share": 0.2,
        },
    }  # fmt: skip


def traces(figure: go.Figure) -> dict[str, Any]:
    return {trace.name: trace for trace in figure.data}


def told_apart(figure: go.Figure, kinds: tuple[str, ...]) -> bool:
    """Whether kinds differ by symbol or dash, and so without colour."""
    found = traces(figure)
    looks = [(found[k].marker.symbol, getattr(found[k].line, "dash", None)) for k in kinds]
    return len(set(looks)) == len(looks)


def test_every_design_is_of_one_kind(result: Row) -> None:
    kinds = of_kinds(result)
    assert {k: [r["trial"] for r in rows] for k, rows in kinds.items()} == {
        "dominated": [3], "lands too hard": [4], "infeasible": [5], "front": [1],
        "chosen": [2], "prototype": [0],
    }  # fmt: skip


def test_front_shows_every_design_at_its_place_with_its_interval(result: Row) -> None:
    result["front"][1] |= {"low_s": 0.077, "high_s": 0.085}
    figure = front_figure(result, VARIABLES, LENGTH)
    found = traces(figure)
    places = {k: list(zip(found[k].x, found[k].y, strict=True)) for k in found}
    assert places["chosen"] == [(pytest.approx(70.0), 7.0)]
    assert places["prototype"] == [(pytest.approx(100.0), 8.0)]
    assert places["lands too hard"] == [(pytest.approx(60.0), 6.5)]
    assert places["infeasible"] == [("not<br>simulated", 5.0)]
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
    assert told_apart(figure, ("dominated", "lands too hard", "front", "chosen", "prototype"))


def test_third_objective_is_size_and_number(result: Row) -> None:
    result["objectives"] = [TIME, LENGTH, FORCE]
    assert "border of the front" not in traces(front_figure(result, VARIABLES, LENGTH))
    figure = third_figure(result, VARIABLES, LENGTH, FORCE)
    found = traces(figure)
    assert "lands too hard" not in found
    assert found["front"].marker.size[0] == 9.0
    assert found["prototype"].marker.size[0] == 36.0
    said = sorted(note.text for note in figure.layout.annotations)
    assert said == ["1: 6000", "2: 7000", "<b>prototype</b>: 8000"]


def test_how_sure_with_and_without_what_confirms(result: Row) -> None:
    plain = sure_figure(result)
    assert [trace.name for trace in plain.data] == [
        "search, 95 % interval", "fresh angles, 95 % interval",
    ]  # fmt: skip
    assert list(plain.data[0].y) == ["design 1", "design 2 (chosen)"]
    assert list(plain.data[1].x) == pytest.approx([80.0])
    assert plain.data[1].marker.symbol != plain.data[0].marker.symbol
    for row, share in zip(result["front"], (0.9, 0.6), strict=True):
        row["probability_on_front"] = share
    result["confirmation"]["designs"] = [{"trial": 1, TIME: 0.083, "standard_error_s": 0.001}]
    full = traces(sure_figure(result))
    assert list(full["probability on the front"].x) == [0.6, 0.9]
    assert list(full["fresh angles, 95 % interval"].x) == pytest.approx([83.0, 80.0])
    result["confirmation"] = None
    assert len(sure_figure(result).data) == 2


def test_interval_is_the_given_one_or_that_of_the_standard_error() -> None:
    assert interval(design(1, 0.08, 6.0)) == pytest.approx((0.07804, 0.08196))
    assert interval(design(1, 0.08, 6.0, low_s=0.07, high_s=0.1)) == (0.07, 0.1)


def test_parallel_lines_run_over_every_axis(result: Row) -> None:
    figure = parallel_figure(result, VARIABLES)
    found = traces(figure)
    assert set(found) == {
        "lands too hard (1)", "dominated (1)", "front (1)", "prototype (1)", "chosen (1)",
    }  # fmt: skip
    # Chamfer, number, time, length, margin of designs 0 to 4.
    chosen = list(found["chosen (1)"].y)[:5]
    assert chosen == pytest.approx([0.5, 0.5, 0.25, 0.5, 0.5])
    assert list(found["prototype (1)"].y)[:5] == pytest.approx([0.0, 0.0, 1.0, 1.0, 0.0])
    assert len({(trace.line.dash, trace.marker.symbol) for trace in figure.data}) == 5
    words = [note.text for note in figure.layout.annotations]
    for said in ("60", "100", "design 2", "prototype", "smallest<br>margin, %"):
        assert said in words


def test_names_at_the_end_of_lines_stay_apart() -> None:
    levels = spread([0.2, 0.2, 0.99, 1.0, 1.0])
    assert np.diff(levels).min() >= APART - 1e-12
    assert levels[-1] <= 1.0
    assert levels[0] == 0.2


def test_labels_cover_neither_marks_nor_each_other() -> None:
    labels = [Label("12", (0.5 + 0.01 * k, 0.5)) for k in range(4)]
    places = shifts_of(labels, (0.0, 1.0), (0.0, 1.0))
    centres = [(600 * (0.5 + 0.01 * k) + x, 160 + y) for k, (x, y) in enumerate(places)]
    for k, (x, y) in enumerate(centres):
        for other in centres[:k]:
            assert abs(x - other[0]) >= 15.9 or abs(y - other[1]) >= 16.9


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


def test_hypervolume_in_two_and_three_dimensions() -> None:
    corner = np.ones(3)
    assert hypervolume(np.array([[0.5, 0.5]]), corner[:2]) == pytest.approx(0.25)
    stairs = np.array([[0.0, 0.5], [0.5, 0.0], [0.7, 0.7], [2.0, 0.1]])
    assert hypervolume(stairs, corner[:2]) == pytest.approx(0.75)
    rng = np.random.default_rng(1)
    values, drawn = rng.random((12, 3)), rng.random((200_000, 3))
    below = (values[None] <= drawn[:, None]).all(axis=2).any(axis=1).mean()
    assert hypervolume(values, corner) == pytest.approx(below, abs=4e-3)


def shift(study: Study, values: Row, angle: float, time: float | None, **changes: Any) -> Row:
    """A shift as a journal holds it, of a design of the study."""
    clutch = study.clutch.with_dog(study.dog_with(values))
    seed = study.file.expectation.seed
    return {
        "key": f"{angle:010.4f}-{values['chamfer_deg']}", **clutch_record(clutch),
        "mismatch_rpm": 50.0, "force_N": 469.0, "force_rise_s": 0.1766,
        "relative_angle_deg": angle, "outcome": "blocked" if time is None else "engaged",
        "shift_time_s": time, "seed": seed,
    } | changes  # fmt: skip


def test_shifts_of_a_design_without_repeats_of_other_accuracy(study: Study) -> None:
    own, seed = study.prototype, study.file.expectation.seed
    rows = (
        shift(study, own, 1.0, 0.05),
        shift(study, own, 2.0, None, seed=seed + FRESH),
        shift(study, own, 3.0, 0.07, accuracy=1e-9),
        shift(study, own, 4.0, None, outcome="diverged"),
        shift(study, own | {"chamfer_deg": 9.0}, 1.0, 0.02),
    )
    found = Shifts(study, rows)
    assert [row["relative_angle_deg"] for row in found.of(own)] == [1.0, 2.0]
    assert [row["relative_angle_deg"] for row in found.searched(own)] == [1.0]
    assert [row["relative_angle_deg"] for row in found.fresh(own)] == [2.0]
    fast, slow = extremes(found.of(own)) or pytest.fail("no shifts")
    assert (fast["shift_time_s"], slow["outcome"]) == (0.05, "blocked")
    assert extremes([]) is None


def test_operating_points_keep_their_weight(study: Study) -> None:
    heavy = tuple(replace(p, weight=3.0 if k == 0 else 1.0) for k, p in enumerate(study.points))
    own = study.prototype
    first = {"mismatch_rpm": 5.0, "force_N": 235.2}
    other = {"mismatch_rpm": 5.0, "force_N": 315.5}
    rows = [shift(study, own, 1.0, 0.1, **first)]
    rows += [shift(study, own, angle, 0.2, **other) for angle in (1.0, 2.0)]
    weights = weights_of(replace(study, points=heavy), rows)
    assert weights == pytest.approx([0.75, 0.125, 0.125])
    assert quantile(np.array([0.1, 0.2, 0.2]), weights, 0.75) == 0.1
    assert quantile(np.array([0.1, 0.2, 0.2]), weights, 0.76) == 0.2


def test_distribution_of_single_shifts(study: Study) -> None:
    own, fresh = study.prototype, {"seed": study.file.expectation.seed + FRESH}
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
    words = [note.text for note in figure.layout.annotations]
    assert words.count("95%: 950 ms") == 2
    dashes = {t.line.dash for t in figure.data if t.mode == "lines"}
    assert dashes == {"dash", "solid"}
    assert distribution(Shifts(study, ()), own) is None


def test_course_counts_shifts_of_every_simulated_design(study: Study, result: Row) -> None:
    result["trials"] = [{**study.prototype, **row} for row in result["trials"]]
    each = len(study.points) * study.file.expectation.angles
    found = course(result, Shifts(study, ()))
    # The fifth design costs shifts, too, but is no answer; the last was not simulated.
    assert found.shifts.tolist() == [each, 2 * each, 3 * each, 4 * each]
    assert found.best == pytest.approx([0.1, 0.08, 0.07, 0.07])
    # Box 70 to 100 ms by 6 to 8 mm: the second leaves a third of the time, the third half
    # of the length undominated.
    assert found.volume == pytest.approx([0.0, 2 / 3, 2 / 3 + 1 / 6, 2 / 3 + 1 / 6])
    figure = traces(convergence_figure(result, found))
    assert list(figure["best so far"].y) == pytest.approx([100.0, 80.0, 70.0, 70.0])
    assert figure["best so far"].line.dash != figure["hypervolume"].line.dash


def test_every_simulated_design_is_in_the_table(result: Row) -> None:
    result["trials"][2]["time_within_tolerances"] = {"worst_case_s": 0.002, "by_dimension_s": {}}
    text = designs_frame(result, VARIABLES).to_csv(index=False)
    kind, data = csv_link(text).split(",", 1)
    assert kind == "data:text/csv;charset=utf-8"
    table = pd.read_csv(io.StringIO(unquote(data)))
    assert table["trial"].tolist() == [0, 1, 2, 3, 4]
    assert table["on_front"].tolist() == [False, True, True, False, False]
    assert table["chosen"].tolist() == [False, False, True, False, False]
    assert table[TIME].tolist() == [0.1, 0.08, 0.07, 0.09, 0.06]
    assert table["margin_of_module"].tolist() == [0.5] * 5
    assert table["failed"].fillna("").tolist()[4] == "edge_pressure_impact"
    assert table["within_tolerances_worst_case_s"][2] == 0.002


@pytest.mark.parametrize(("rows", "sizes"), [(6, [6]), (9, [5, 4]), (0, []), (17, [6, 6, 5])])
def test_margins_come_in_parts_that_fit_a_page(rows: int, sizes: list[int]) -> None:
    assert [len(part) for part in in_parts([{}] * rows)] == sizes


@pytest.mark.parametrize(
    ("margin", "words"),
    [
        (0.00048, "0.05 %"),
        (0.0, "0.0 %"),
        (0.011, "1.1 %"),
        (-0.14, "\N{MINUS SIGN}14 %"),
        (1.3, "130 %"),
    ],
)
def test_margins_in_percent(margin: float, words: str) -> None:
    assert percent(margin) == words


def test_summary_says_what_was_found(result: Row) -> None:
    assert headline(result) == "Design 2 shifts 20 % faster than the prototype."
    sure, limit, slower = points_of(result)
    assert "Clear: the gain is 20 times its standard error. 100 shifts" in sure
    assert "tip width, with a margin of 3.0 %" in limit
    assert (
        "\N{MINUS SIGN}2.0 % with every tolerance at its worst, so such a part may break" in limit
    )
    assert slower == (
        "Slower than the prototype at 1 of 2 operating points, clearly at 1: "
        "100 1/min with 235.2 N by 10.0 ± 3.6 ms."
    )
    unclear = result["confirmation"] | {"gain_s": 0.001}
    assert "cannot be told from the prototype" in headline(result | {"confirmation": unclear})
    assert "not been confirmed" in headline(result | {"confirmation": None})
    assert "No design" in headline(result | {"best": None})


def test_summary_where_nothing_is_slower_or_only_by_chance(result: Row) -> None:
    points = result["confirmation"]["best"]["points"]
    points[1]["mean_s"] = 0.093
    assert "nowhere clearly" in points_of(result)[-1]
    points[1]["mean_s"] = 0.08
    assert "nowhere slower" in points_of(result)[-1]


def test_command_runs_the_same_study_again() -> None:
    changes = ["search.trials=12", "operating.mismatch_rpm=[50, 149]", "contact.set=adams2019"]
    study = load_study("mq200", changes)
    command = command_of(study)
    assert command is not None
    assert command.startswith("dogshape study mq200 --set ")
    assert command_of(load_study("mq200")) == "dogshape study mq200"
    file = study.file.model_copy(update={"name": "elsewhere"})
    assert command_of(replace(study, file=file)) is None


def test_a_page_that_cannot_be_made_is_said_and_left_out(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, said = study.prototype, []
    shifts = Shifts(study, (shift(study, own, 1.0, 0.05), shift(study, own, 2.0, None)))
    pairs = replays_of(shifts, [{**own, "trial": 0, "prototype": True}])
    (fast, slow) = pairs[0]
    assert slow.words == "blocked at 50 1/min, 469.0 N"
    assert fast.path.startswith("shifts/prototype-fastest-")

    def fails(*_: Any) -> None:
        raise RuntimeError("no solution")

    monkeypatch.setattr(replays, "_write", fails)
    write_replays(StudyFolder(tmp_path), shifts, [fast, slow], said.append)
    assert said[0].startswith("animation 1 of 2: prototype, fastest shift, 50.0 ms")
    assert said.count("no page of this shift: no solution") == 2


def test_effects_are_of_the_surrogate_as_it_is_now(
    study: Study, surrogate: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = StudyFolder(tmp_path)
    learn_effects(folder, pytest.fail)
    assert stored_effects(folder) is None
    folder.open(study, resume=False)
    figures = Stored(surrogate, _validation())
    save(folder.surrogate, figures)
    known = {"effects": {"designs": 3}, "indices": []}
    calls: list[str] = []
    monkeypatch.setattr("pipeline.reporting.learned.Over", lambda *_: None)
    monkeypatch.setattr(
        "pipeline.reporting.learned.learned", lambda *_: calls.append("learned") or known
    )
    learn_effects(folder, calls.append)
    learn_effects(folder, calls.append)
    assert calls.count("learned") == 1
    assert stored_effects(folder) == known
    save(folder.surrogate, replace(figures, comparison=({"form": "other"},)))
    assert stored_effects(folder) is None


def _validation() -> Any:
    from surrogate.figures import Validation

    numbers = dict.fromkeys(Validation.__dataclass_fields__, 1.0)
    return Validation(**(numbers | {"source": "held out", "rank_best": None}))  # type: ignore[arg-type]


def test_a_journal_that_is_only_read_keeps_a_line_being_written(
    study: Study, tmp_path: Path
) -> None:
    row = shift(study, study.prototype, 1.0, 0.05) | {"landing_loads_N_mm": [0.0]}
    path = tmp_path / "shifts.jsonl"
    content = json.dumps(row) + "\n" + '{"key": "half'
    path.write_text(content)
    assert list(ShiftJournal(path, only_read=True).rows) == [row["key"]]
    assert path.read_text() == content
    assert list(ShiftJournal(path).rows) == [row["key"]]
    assert path.read_text() == json.dumps(row) + "\n"
