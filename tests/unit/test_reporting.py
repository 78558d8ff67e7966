"""Words, tables, shifts and stored parts of the report."""

from __future__ import annotations

import io
import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.record import Bad
from dogshape.pipeline.reports import single_shifts
from dogshape.pipeline.reports.designs import goals_of, of_kinds, simulated_frame
from dogshape.pipeline.reports.provenance import command_of
from dogshape.pipeline.reports.report import link
from dogshape.pipeline.reports.single_shifts import (
    Shifts,
    drawn_variant,
    replays_of,
    write_replays,
)
from dogshape.pipeline.reports.study_page import write_report
from dogshape.pipeline.reports.study_summary import facts_of, gained, headline
from dogshape.pipeline.reports.variable_effects import learn_effects, stored_effects
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.training_rows import known_surrogate
from dogshape.surrogate.hypervolume import hypervolume
from dogshape.surrogate.store import save
from tests.found import TIME, VARIABLES, Row, shift
from tests.kept import kept_folder


def test_every_design_is_of_one_kind(result: Row) -> None:
    kinds = of_kinds(result)
    assert {k: [r["trial"] for r in rows] for k, rows in kinds.items()} == {
        "dominated": [3], "fails when simulated": [4], "front": [1], "chosen": [2],
        "prototype": [0],
    }  # fmt: skip


def test_hypervolume_in_two_and_three_dimensions() -> None:
    corner = np.ones(3)
    assert hypervolume(np.array([[0.5, 0.5]]), corner[:2]) == pytest.approx(0.25)
    stairs = np.array([[0.0, 0.5], [0.5, 0.0], [0.7, 0.7], [2.0, 0.1]])
    assert hypervolume(stairs, corner[:2]) == pytest.approx(0.75)
    rng = np.random.default_rng(1)
    values, drawn = rng.random((12, 3)), rng.random((200_000, 3))
    below = (values[None] <= drawn[:, None]).all(axis=2).any(axis=1).mean()
    assert hypervolume(values, corner) == pytest.approx(below, abs=4e-3)


def test_fastest_and_slowest_shift_of_a_design(study: Setup) -> None:
    """A blocked shift is the slowest; what was repeated with finer steps counts once."""
    own = study.prototype
    rows = (
        shift(study, own, 1.0, 0.05),
        shift(study, own, 2.0, None),
        shift(study, own, 3.0, 0.04, accuracy=1e-9),
        shift(study, own, 4.0, None, outcome="diverged"),
        shift(study, own | {"chamfer_deg": 9.0}, 1.0, 0.02),
    )
    ((fast, slow),) = replays_of(Shifts(study, rows), [{**own, "trial": 0, "prototype": True}])
    assert (fast.words, slow.words) == (
        "50.0 ms at 50 1/min, 469.0 N",
        "blocked at 50 1/min, 469.0 N",
    )
    assert fast.path.startswith("shifts/prototype-fastest-")
    assert replays_of(Shifts(study, ()), [{**own, "trial": 0, "prototype": True}]) == []


def test_every_simulated_design_is_in_the_table(result: Row) -> None:
    result["trials"][2]["time_within_tolerances"] = {"worst_case_s": 0.002, "by_dimension_s": {}}
    text = simulated_frame(result, VARIABLES).to_csv(index=False)
    kind, data = link(text, "text/csv", "all.csv", "all").split('"')[3].split(",", 1)
    assert kind == "data:text/csv;charset=utf-8"
    table = pd.read_csv(io.StringIO(unquote(data)))
    assert table["trial"].tolist() == [0, 1, 2, 3, 4]
    assert table["on_front"].tolist() == [False, True, True, False, False]
    assert table["chosen"].tolist() == [False, False, True, False, False]
    assert table[TIME].tolist() == [0.1, 0.08, 0.07, 0.09, 0.06]
    assert table["margin_of_module"].tolist() == [0.5] * 5
    assert table["failed"].fillna("").tolist()[4] == "edge_pressure_impact"
    assert table["within_tolerances_worst_case_s"][2] == 0.002


@pytest.fixture
def few(study: Setup) -> Setup:
    """The study with the two variables of the search made by hand."""
    return replace(study, variables={name: study.variables[name] for name in VARIABLES})


def facts(study: Setup, result: Row) -> dict[str, str]:
    return dict(facts_of(study, result))


def against(study: Setup, result: Row) -> list[str]:
    return [name for name, words in facts_of(study, result) if isinstance(words, Bad)]


def test_facts_are_marked_where_they_speak_against_a_design(few: Setup, result: Row) -> None:
    result["confirmation"]["designs"][0] |= {"agrees": False, "errors_apart": 8.6}
    found = facts(few, result)
    assert found["engaged at the first try"] == "32 of 32 shifts; prototype 24 of 32"
    assert found["operating points slower than the prototype"].startswith("1 of 2 (1 clearly)")
    assert against(few, result) == [
        "operating points slower than the prototype", "search and new angles of design 2",
    ]  # fmt: skip
    result["confirmation"]["designs"][0]["agrees"] = True
    assert not any("search and new angles" in name for name in facts(few, result))
    result["best"] |= {"chamfer_deg": 0.0}
    assert "chamfer" in facts(few, result)["at the end of the search range"]
    result["confirmation"]["gains_by_contact"] = [
        {"contact": "friction 0.0667", "gain_s": 0.02, "gain_standard_error_s": 0.002},
        {"contact": "dissipation 1 s/m", "gain_s": None, "gain_standard_error_s": None},
    ]
    assert facts(few, result)["gain with friction 0.0667"] == "20.0 ± 2.0 ms"
    assert "gain with dissipation 1 s/m" not in facts(few, result)


def test_headline_is_the_gain_in_the_leading_objective(result: Row) -> None:
    assert headline(result) == "Design 2 is 20 % faster than the prototype."
    gains = {TIME: {"value": 0.001, "standard_error": 0.001}}
    unclear = result["confirmation"] | {"gains": gains}
    assert "cannot be told from the prototype" in headline(result | {"confirmation": unclear})
    assert "not confirmed" in headline(result | {"confirmation": None})
    for row in result["trials"]:
        row["margins"]["smallest_margin_worst"] = -0.02
    said = headline(result | {"best": None})
    assert "6 of 6 fail root fatigue at worst-case tolerances, the nearest of them by 2" in said
    name = "shift_time_quantile_s"
    result |= {"objectives": [TIME, name], "leading": name, "quantile": 0.9}
    c = result["confirmation"]
    for key, value in (("prototype", 0.2), ("best", 0.15)):
        c[key]["estimates"][name] = {"value": value, "standard_error": 0.002}
    c["gains"][name] = {"value": 0.05, "standard_error": 0.003}
    assert headline(result) == (
        "Design 2 is 25 % better than the prototype in the 90 % quantile of the shift time, "
        "150.0 ms."
    )
    assert [goal.name for goal, *_ in gained(result)] == [name, TIME]
    assert goals_of(result)[0].title == "90 % quantile of the shift time, ms"


def engages(result: Row, share: float, *keys: str) -> Row:
    """Let some designs of the confirmation engage in a share of their shifts."""
    for key in keys:
        for point in result["confirmation"][key]["points"]:
            point["engaged"] = share
    return result


@pytest.mark.parametrize(("share", "keys"), [(0.0625, ("best", "prototype")), (0.25, ("best",))])
def test_what_does_not_engage_has_no_time_and_no_gain(
    few: Setup, result: Row, share: float, keys: tuple[str, ...]
) -> None:
    found = engages(result, share, *keys)
    assert headline(found) == f"Design 2 engages in {32 * share:.0f} of 32 shifts."
    assert [goal.unit for goal, *_ in gained(found)] == ["mm"]
    assert not any("gain" in name or "slower" in name for name in facts(few, found))


def test_designs_that_fail_at_the_new_angles_are_said(few: Setup, result: Row) -> None:
    check = {"name": "edge_pressure_impact", "margin": -0.1, "passed": False}
    result["trials"][0] |= {"failed": ["contact_ratio"]}
    assert facts(few, result)["the prototype itself fails"] == "contact ratio"
    c = result["confirmation"]
    (own,) = c["designs"]
    c["designs"] = [{"trial": 1, **c["best"], "checks": [check]}, own]
    said = "designs out, failed at the new angles"
    assert facts(few, result)[said].startswith("1: edge pressure impact")
    c["best"]["checks"] = own["checks"] = [check]
    found = facts(few, result)
    assert found["fails at the new angles"].startswith("edge pressure impact")
    assert found["hardest landing at the new angles"].startswith("\N{MINUS SIGN}10 % edge")
    assert "but fails edge pressure impact" in headline(result)


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
    "changes",
    [
        [],
        ["search.trials=12", "operating.mismatch_rpm=[50, 149]", "contact.set=adams2019"],
        ["uncertain.friction_factor={distribution='uniform', low=0.7, high=1.3}"],
    ],
)
def test_command_runs_the_same_study_again(changes: list[str]) -> None:
    study = load_study("mq200_paper", changes)
    command = command_of(study)
    assert command is not None
    assert command.startswith("dogshape study mq200_paper")
    overrides = [word for word in shlex.split(command)[3:] if word != "--set"]
    assert load_study("mq200_paper", overrides).config_hash == study.config_hash
    file = study.file.model_copy(update={"name": "elsewhere"})
    assert command_of(replace(study, file=file)) is None


def test_a_page_that_cannot_be_made_is_said_and_left_out(
    study: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, said = study.prototype, []
    shifts = Shifts(study, (shift(study, own, 1.0, 0.05), shift(study, own, 2.0, None)))
    pairs = replays_of(shifts, [{**own, "trial": 0, "prototype": True}])
    (fast, slow) = pairs[0]

    def fails(*_: Any) -> None:
        raise RuntimeError("no solution")

    monkeypatch.setattr(single_shifts, "_write", fails)
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
    known: Row = {"effects": {"designs": 3}, "prices": []}
    calls: list[str] = []

    def learned(*_: Any) -> Row:
        calls.append("learned")
        return dict(known["effects"])

    place = "dogshape.pipeline.reports.variable_effects"
    monkeypatch.setattr(f"{place}._effects_record", learned)
    monkeypatch.setattr(f"{place}.prices", lambda *_: [])
    learn_effects(folder, calls.append)
    learn_effects(folder, calls.append)
    assert calls.count("learned") == 1
    assert stored_effects(folder) == known
    save(folder.surrogate, replace(stored, validation=replace(stored.validation, n=7)))
    assert stored_effects(folder) is None


def _effect(low: float, high: float, lines: list[float]) -> Row:
    many = len(lines)
    return {"variable": "chamfer_deg", "values": [*range(many)], "effect_s": lines,
            "low_s": [low] * many, "high_s": [high] * many, "distinguishable": True}  # fmt: skip


@pytest.mark.parametrize(("outside", "drawn"), [(0.4, True), (0.95, False)])
def test_effects_are_not_drawn_where_they_are_extrapolated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, outside: float, drawn: bool
) -> None:
    effects = {"designs": 150, "outside_trained_range": outside, "mean_expected_shift_time_s": 0.08,
               "variables": [_effect(-0.01, 0.01, [0.0, 0.005])]}  # fmt: skip
    known = {"effects": effects, "prices": []}
    monkeypatch.setattr("dogshape.pipeline.reports.study_page.stored_effects",
                        lambda _: known)  # fmt: skip
    page = write_report(kept_folder(tmp_path / "mq200")).read_text()
    assert ("Accumulated local effects" in page) == drawn


def test_a_page_where_nothing_was_found_compares_the_prototype_with_nothing(
    tmp_path: Path,
) -> None:
    folder = kept_folder(tmp_path / "mq200", "mq200")
    result = folder.stored_result()
    own = next(row for row in result["trials"] if row["prototype"])
    c = result["confirmation"]
    c |= {"best": c["prototype"], "chosen": own["trial"], "designs": []}
    result |= {"best": own, "front": [own], "trials": [own], "n_simulated_designs": 1}
    folder.result.write_text(json.dumps(result))
    page = write_report(folder).read_text()
    first = page[page.index("<h1>") : page.index('id="front"')]
    assert "No design of this search is chosen before the prototype" in first
    assert "chosen<" not in first
    assert 'id="operating-points"' not in page


def test_a_page_of_a_clutch_that_does_not_engage_has_counts(tmp_path: Path) -> None:
    folder = kept_folder(tmp_path / "mq200", "mq200")
    result = folder.stored_result()
    for key in ("best", "prototype"):
        found = result["confirmation"][key] | {"expected_shift_time_s": 21.0}
        found["points"] = [{**p, "engaged": 0.0, "mean_s": 21.0} for p in found["points"]]
        found["points"][0]["engaged"] = 1.0
        result["confirmation"][key] = found
    folder.result.write_text(json.dumps(result))
    page = write_report(folder).read_text()
    first = page[page.index("<h1>") : page.index('id="front"')]
    points = result["confirmation"]["best"]["points"]
    assert f"{points[0]['n']} of {sum(p['n'] for p in points)}" in first
    for words in ("21000", "% faster"):
        assert words not in first
    assert 'id="operating-points"' in page


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
