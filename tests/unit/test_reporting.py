"""Words, tables, shifts and stored parts of the report."""

from __future__ import annotations

import io
import json
import os
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, load_study
from dogshape.pipeline.reports.kit.html import csv_link
from dogshape.pipeline.reports.kit.text import percent
from dogshape.pipeline.reports.study import replays
from dogshape.pipeline.reports.study.designs import designs_frame, in_parts, of_kinds
from dogshape.pipeline.reports.study.goals import Goal, goals_of
from dogshape.pipeline.reports.study.provenance import command_of, dates_of, file_of
from dogshape.pipeline.reports.study.replays import drawn_variant, replays_of, write_replays
from dogshape.pipeline.reports.study.single_shifts import Shifts, extremes, quantile, weights_of
from dogshape.pipeline.reports.study.summary import (
    Gained,
    at_the_ends,
    choice,
    failures_of,
    gained,
    headline,
    passed_over,
    points_of,
)
from dogshape.pipeline.reports.study.surrogate_effects import learn_effects, stored_effects
from dogshape.pipeline.simulate.design import OBJECTIVES
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.found_surrogates import known_surrogate
from dogshape.surrogate.hypervolume import hypervolume
from dogshape.surrogate.store import save
from tests.found import TIME, VARIABLES, Row, design, shift


def test_every_design_is_of_one_kind(result: Row) -> None:
    kinds = of_kinds(result)
    assert {k: [r["trial"] for r in rows] for k, rows in kinds.items()} == {
        "dominated": [3], "lands too hard": [4], "infeasible": [5], "front": [1],
        "chosen": [2], "prototype": [0],
    }  # fmt: skip


def test_interval_is_the_given_one_or_that_of_the_standard_error(result: Row) -> None:
    lead = goals_of(result).leading
    assert lead.interval(design(1, 0.08, 6.0)) == pytest.approx((78.04, 81.96))
    assert lead.interval(design(1, 0.08, 6.0, low=0.07, high=0.1)) == pytest.approx((70.0, 100.0))


def test_hypervolume_in_two_and_three_dimensions() -> None:
    corner = np.ones(3)
    assert hypervolume(np.array([[0.5, 0.5]]), corner[:2]) == pytest.approx(0.25)
    stairs = np.array([[0.0, 0.5], [0.5, 0.0], [0.7, 0.7], [2.0, 0.1]])
    assert hypervolume(stairs, corner[:2]) == pytest.approx(0.75)
    rng = np.random.default_rng(1)
    values, drawn = rng.random((12, 3)), rng.random((200_000, 3))
    below = (values[None] <= drawn[:, None]).all(axis=2).any(axis=1).mean()
    assert hypervolume(values, corner) == pytest.approx(below, abs=4e-3)


def test_shifts_of_a_design_without_repeats_of_other_accuracy(study: Setup) -> None:
    own, seed = study.prototype, study.file.expectation.seed
    rows = (
        shift(study, own, 1.0, 0.05),
        shift(study, own, 2.0, None, seed=seed + NEW_ANGLES),
        shift(study, own, 3.0, 0.07, accuracy=1e-9),
        shift(study, own, 4.0, None, outcome="diverged"),
        shift(study, own | {"chamfer_deg": 9.0}, 1.0, 0.02),
    )
    found = Shifts(study, rows)
    assert [row["relative_angle_deg"] for row in found.of(own)] == [1.0, 2.0]
    assert [row["relative_angle_deg"] for row in found.searched(own)] == [1.0]
    assert [row["relative_angle_deg"] for row in found.confirmed(own)] == [2.0]
    fast, slow = extremes(found.of(own)) or pytest.fail("no shifts")
    assert (fast["shift_time_s"], slow["outcome"]) == (0.05, "blocked")
    assert extremes([]) is None


def test_operating_points_keep_their_weight(study: Setup) -> None:
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


def in_words(sentence: str, *facts: str) -> bool:
    """Whether a sentence has all these facts, in this order."""
    places = [sentence.find(fact) for fact in facts]
    return min(places) >= 0 and places == sorted(places)


def test_summary_says_what_was_found(result: Row) -> None:
    assert in_words(headline(result), "Design 2", "20 % faster", "prototype")
    sure, hung, limit, slower = points_of(result)
    assert in_words(sure, "20 times its standard error", "100 shifts")
    assert in_words(hung, "8 of 32 shifts", "prototype", "not engage")
    assert "tip width, with a margin of 3.0 %" in limit
    assert in_words(limit, "\N{MINUS SIGN}2.0 %", "tolerance")
    assert in_words(slower, "1 of 2 operating points", "100 1/min with 235.2 N", "10.0 ± 3.6 ms")
    gains = {TIME: {"value": 0.001, "standard_error": 0.001}}
    unclear = result["confirmation"] | {"gains": gains}
    assert "cannot be told from the prototype" in headline(result | {"confirmation": unclear})
    assert "not been confirmed" in headline(result | {"confirmation": None})
    assert "No design" in headline(result | {"best": None})
    own = result | {"best": result["trials"][0]}
    assert in_words(headline(own), "No design", "faster than the prototype")
    assert [line.split()[0] for line in points_of(own)] == ["100", "What"]


def test_summary_says_what_is_left_without_shifts_that_hung(result: Row) -> None:
    prototype = result["confirmation"]["prototype"]
    prototype |= {"mean_engaged_s": 0.0954}
    (hung,) = (line for line in points_of(result) if "did not engage" in line)
    assert hung.endswith("tried again; without the retries it takes 95.4 ms.")
    for point in prototype["points"]:
        point["engaged"] = 1.0
    assert not any("did not engage" in line for line in points_of(result))


def test_summary_where_nothing_is_slower_or_only_by_chance(result: Row) -> None:
    points = result["confirmation"]["best"]["points"]
    points[1]["mean_s"] = 0.093
    assert "nowhere clearly" in points_of(result)[-1]
    points[1]["mean_s"] = 0.08
    assert "Nowhere slower" in points_of(result)[-1]


def test_summary_names_the_leading_objective(result: Row) -> None:
    name = "shift_time_quantile_s"
    result |= {"objectives": [name, "axial_length_mm"], "leading": name, "quantile": 0.9}
    c = result["confirmation"]
    for key, value in (("prototype", 0.2), ("best", 0.15)):
        c[key]["estimates"][name] = {"value": value, "standard_error": 0.002}
    c["designs"] = [{"trial": 2, **c["best"]}]
    c["gains"][name] = {"value": 0.05, "standard_error": 0.003}
    assert headline(result) == (
        "Design 2 has a 90 % quantile of the shift time of 150.0 ms, 25 % below the prototype's."
    )
    assert [one.goal.name for one in gained(result)] == [name, "axial_length_mm", TIME]
    assert goals_of(result).leading.title == "90 % quantile of the shift time, ms"


def test_summary_of_a_margin_that_is_maximised(result: Row) -> None:
    name = "smallest_margin"
    result |= {"objectives": [name, TIME], "leading": name}
    c = result["confirmation"]
    for key, value in (("prototype", 0.01), ("best", 0.03)):
        c[key]["estimates"][name] = {"value": value, "standard_error": 0.0}
    c["designs"] = [{"trial": 2, **c["best"]}]
    c["gains"][name] = {"value": 0.02, "standard_error": 0.0}
    assert headline(result) == (
        "Design 2 has a smallest margin of 3.0 %, 2.0 percentage points above the prototype's."
    )
    assert "no standard error" in points_of(result)[0]


def test_designs_that_fail_at_the_fresh_angles_are_said(result: Row) -> None:
    assert failures_of(result) == []
    check = {"name": "edge_pressure_impact", "margin": -0.1, "passed": False}
    result["confirmation"]["best"]["checks"] = [check]
    result["confirmation"]["designs"] = [{"trial": 2, **result["confirmation"]["best"]}]
    (said,) = failures_of(result)
    assert "no confirmed design passes every check" in choice(result)
    assert said == (
        "Design 2, the chosen one, fails at the new angles: "
        "edge pressure impact (\N{MINUS SIGN}10 %)."
    )
    assert headline(result).endswith("but fails a check at the new angles.")


def test_a_design_that_was_passed_over_is_said(result: Row) -> None:
    c = result["confirmation"]
    check = {"name": "edge_pressure_impact", "margin": -0.1, "passed": False}
    failing = c["best"] | {"checks": [check]}
    (own,) = c["designs"]
    assert passed_over(result) == ""
    worse = c["best"] | {"checks": [{**check, "margin": -0.02}]}
    c["designs"] = [{"trial": 1, **failing}, own, {"trial": 3, **worse}]
    assert failures_of(result) == [], "nobody chose them"
    assert in_words(passed_over(result), "Designs 1, 3", "2.0 % to 10 %", "edge pressure impact")
    c["designs"] = [{"trial": 1, **failing}, own]
    assert in_words(passed_over(result), "Design 1 ", "10 %")
    assert in_words(headline(result), "Design 2", "20 % faster")


def test_a_prototype_that_fails_is_said_on_the_first_page(result: Row) -> None:
    own = next(row for row in result["trials"] if row["prototype"])
    own["failed"], own["margins"] = ["contact_ratio"], {"contact_ratio": -0.028}
    (said,) = failures_of(result)
    assert in_words(said, "prototype", "fails", "contact ratio", "\N{MINUS SIGN}2.8 %")


def test_a_best_design_at_the_end_of_its_range_is_said(result: Row) -> None:
    best = result["best"]
    best |= {"count": 36, "chamfer_deg": 8.0, "height_mm": 1.61}
    ranges = {"count": (6.0, 36.0), "chamfer_deg": (0.0, 20.0), "height_mm": (1.6, 6.0)}
    said = at_the_ends(result, ranges)
    assert "number of dogs N 36 (upper end 36)" in said
    assert "(lower end 1.6)" in said
    assert "chamfer" not in said
    assert at_the_ends(result, {**ranges, "count": (6.0, 37.0), "height_mm": (1.0, 6.0)}) == ""
    assert at_the_ends({**result, "best": {**best, "prototype": True}}, ranges) == ""


def test_objectives_and_choice_are_explained(result: Row) -> None:
    said = choice(result)
    assert said.startswith(
        "There are two objectives: the expected shift time, which leads; the axial length, root "
        "to root. Chosen is the design of the front"
    )
    assert "Margins at nominal size decide" in said
    assert choice(result | {"objectives": [TIME]}).startswith("The objective is the expected")


def test_changes_read_alike_for_every_objective(result: Row) -> None:
    time, length = gained(result)
    assert time.change == "20.0 ± 1.0 ms less (20 %)"
    assert length.change == "1 mm less (12 %)"
    margin = Goal(OBJECTIVES["smallest_margin"], 0.95, False)
    assert Gained(margin, (1.0, 0.0), (3.0, 0.0), (2.0, 0.0)).change == "2.0 percentage points more"
    longer = Gained(length.goal, (8.0, 0.0), (9.0, 0.0), (-1.0, 0.0))
    assert longer.change == "1 mm more (12 %), worse"
    unclear = Gained(time.goal, (100.0, 1.0), (99.0, 1.0), (1.0, 1.4))
    assert unclear.change == "1.0 ± 1.4 ms less (1 %), not clear"
    same = Gained(length.goal, (8.0, 0.0), (8.0, 0.0), (0.0, 0.0))
    assert same.change == "none"


def test_a_page_shows_an_uncertain_shift_as_it_was_drawn(study: Setup) -> None:
    row = shift(study, study.prototype, 1.0, 0.05)
    assert drawn_variant(row) is None
    factors = {"friction_factor": 1.2, "force_factor": 0.9, "inertia_factor": 1.1}
    variant = drawn_variant(row | factors | {"drawn_force_rise_s": 0.2})
    assert variant is not None
    assert variant.clutch(study.clutch).contact.static_friction == pytest.approx(
        1.2 * study.clutch.contact.static_friction
    )
    profile = variant.point(study.points[0]).profile
    assert (profile.force, profile.rise) == (
        pytest.approx(0.9 * study.points[0].profile.force),
        0.2,
    )


@pytest.mark.parametrize(
    "change",
    [
        "operating={points=[{mismatch_rpm=-50, force_N=300, weight=3}]}",
        "operating.mismatch_rpm={distribution='normal', mean=60, sd=20}",
        "uncertain.friction_factor={distribution='uniform', low=0.7, high=1.3}",
    ],
)
def test_command_holds_tables(change: str) -> None:
    command = command_of(load_study("mq200_paper", [change]))
    assert command is not None
    overrides = [word for word in shlex.split(command)[3:] if word != "--set"]
    assert (
        load_study("mq200_paper", overrides).config_hash
        == load_study("mq200_paper", [change]).config_hash
    )


def test_provenance_has_dates_and_the_file_as_it_was_run(tmp_path: Path) -> None:
    stored = tmp_path / "result.json"
    stored.touch()
    os.utime(stored, (86400.0 * 365, 86400.0 * 365))
    dates = dates_of(stored)
    assert dates["stored"] == "1971-01-01"
    assert dates["written"] > dates["stored"]
    told = json.loads(file_of(load_study("mq200_paper", ["search.trials=12"])))
    assert build_study(StudyFile.model_validate(told)).file.search.trials == 12


def test_command_runs_the_same_study_again() -> None:
    changes = ["search.trials=12", "operating.mismatch_rpm=[50, 149]", "contact.set=adams2019"]
    study = load_study("mq200_paper", changes)
    command = command_of(study)
    assert command is not None
    assert command.startswith("dogshape study mq200_paper --set ")
    assert command_of(load_study("mq200_paper")) == "dogshape study mq200_paper"
    file = study.file.model_copy(update={"name": "elsewhere"})
    assert command_of(replace(study, file=file)) is None


def test_a_page_that_cannot_be_made_is_said_and_left_out(
    study: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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
    study: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = StudyFolder(tmp_path)
    learn_effects(folder, pytest.fail)
    assert stored_effects(folder) is None
    folder.open(study, resume=False)
    stored = known_surrogate(study)
    assert stored is not None
    save(folder.surrogate, stored)
    known = {"effects": {"designs": 3}, "indices": [], "prices": []}
    calls: list[str] = []

    def learned(*_: Any) -> Row:
        calls.append("learned")
        return known

    monkeypatch.setattr("dogshape.pipeline.reports.study.surrogate_effects.Over", lambda *_: None)
    monkeypatch.setattr("dogshape.pipeline.reports.study.surrogate_effects.learned", learned)
    monkeypatch.setattr("dogshape.pipeline.reports.study.surrogate_effects.prices", lambda *_: [])
    learn_effects(folder, calls.append)
    learn_effects(folder, calls.append)
    assert calls.count("learned") == 1
    assert stored_effects(folder) == known
    save(folder.surrogate, replace(stored, comparison=({"form": "other"},)))
    assert stored_effects(folder) is None


def test_a_journal_that_is_only_read_keeps_a_line_being_written(
    study: Setup, tmp_path: Path
) -> None:
    row = shift(study, study.prototype, 1.0, 0.05) | {"landing_loads_N_mm": [0.0]}
    path = tmp_path / "shifts.jsonl"
    content = json.dumps(row) + "\n" + '{"key": "half'
    path.write_text(content)
    assert list(ShiftJournal(path, only_read=True).rows) == [row["key"]]
    assert path.read_text() == content
    assert list(ShiftJournal(path).rows) == [row["key"]]
    assert path.read_text() == json.dumps(row) + "\n"
