"""Values of the live page, without a server: those of the package."""

from __future__ import annotations

import itertools
import shlex
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from dash.development.base_component import Component

import dogshape as ds
from dogshape.app.live_callbacks import (
    answer_at_once,
    answer_by_simulation,
    answer_on_own_dog,
    build_app,
    link_files,
)
from dogshape.app.live_page import FILES, LivePage, Question, open_live_page
from dogshape.app.time_curve import TimeCurve
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import (
    build_study,
    bundled_studies,
    load_study,
    replace_keys,
)
from dogshape.pipeline.export.drawing import open_section_svg
from dogshape.pipeline.record import percent
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.clutch_tables import validate
from dogshape.sim.shift.actuators import KINDS
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.pair import dog_pair
from tests.conftest import Call

PAPER = load_study("mq200_paper")


@pytest.fixture(scope="module")
def live_page() -> LivePage:
    """The paper's study with the surrogate and the search that the package brings."""
    return open_live_page(ds.Study("mq200_paper"))


def _asked(live_page: LivePage, where: str = "all", **changed: str) -> Question:
    changes = {key.replace("__", "."): text for key, text in changed.items()}
    return Question(live_page.start_texts() | changes, where)


def _answer(live_page: LivePage, question: Question) -> tuple[dict[str, str], dict[str, Any]]:
    """Return faults and content of the page, at once."""
    answers, content = answer_at_once(live_page, question, "dog.chamfer_deg")
    return answers.faults, content


def _properties(content: Any) -> Iterator[dict[str, Any]]:
    """Yield the properties of all components in some content of the page, from the outside in."""
    if isinstance(content, (list, tuple, dict)):
        for part in content.values() if isinstance(content, dict) else content:
            yield from _properties(part)
    elif isinstance(content, Component):
        properties = content.to_plotly_json()["props"]
        yield properties
        yield from _properties(properties.get("children"))


def _exact(content: Any) -> list[list[float]]:
    """List the unrounded times with their intervals in some content of the page."""
    texts = [part["data-exact"] for part in _properties(content) if "data-exact" in part]
    return [[float(word) for word in text.split()] for text in texts]


def _check_rows(content: Any) -> dict[str, dict[str, Any]]:
    """Return the rows of a table of checks by name."""
    rows = [part for part in _properties(content) if "data-check" in part]
    return {row["data-check"]: row for row in rows}


@pytest.mark.parametrize("name", bundled_studies())
def test_every_study_has_a_page_and_keys_as_on_the_command_line(name: str) -> None:
    sets = {"dog.height_mm": 3.5, "load.torque_Nm": 150, "solver.engine": "planar"}
    study = load_study(name)
    assert replace_keys(study, sets).config_hash == load_study(name, sets).config_hash
    assert replace_keys(study, {}).config_hash == study.config_hash
    live_page = open_live_page(ds.Study(name))
    assert build_app(live_page).layout().children
    question = _asked(live_page)
    faults, answer = _answer(live_page, question)
    assert not faults
    assert repr(answer["checks.children"]).count("data-check=") > 15
    read = live_page.read(question)
    assert read.values == {}
    assert read.study is not None
    assert read.study.config_hash == study.config_hash


@pytest.mark.parametrize(
    ("key", "text", "sentence"),
    [
        ("dog.chamfer_deg", "abc", "'abc' is no number"),
        ("dog.count", "5,5", "give a whole number"),
        ("mismatch_rpm", "x", "'x' is no number"),
        ("force_N", "9000", "shift force is 9000 N, but the rise times of the study cover"),
        ("load.friction_hold", "0.5", "load.friction_hold is 0.5, but it must not exceed"),
        ("load.torque_Nm", "3,200", "3,200 may be 3200 or 3.2; write it without the comma"),
        ("load.safety", "0.5", "load.safety is 0.5, but it must lie between 1 and 10"),
        ("material.allowable_pressure_MPa", "2 mm", "'mm' is no unit of this quantity"),
        ("material.set", "wood", "give one of 16MnCr5, 20MnCr5"),
        ("actuation.rise_s", "0.1", "actuation.force_N has 4 and actuation.rise_s 1 values"),
    ],
)
def test_a_refusal_stands_at_its_field(
    live_page: LivePage, key: str, text: str, sentence: str
) -> None:
    """That of an impossible shape stands above the answers, without any figure."""
    faults, answer = _answer(live_page, _asked(live_page, "one", **{key: text}))
    assert answer["answer.className"] == "stale"
    assert faults[key].startswith(sentence)
    labels = {field.key: field.label for field in live_page.fields}
    assert labels[key] in answer["refused.children"]
    faults, answer = _answer(
        live_page, _asked(live_page, dog__traction_deg="50", dog__height_mm="9")
    )
    assert not any(faults.values())
    assert answer["refused.children"].startswith("There is no such clutch: ")
    assert not _exact([answer["predicted.children"], answer["simulated.children"]])


def test_all_wrong_fields_are_marked_at_once(live_page: LivePage) -> None:
    question = _asked(
        live_page, dog__count="0", load__torque_Nm="much", material__proof_stress_MPa="7 kN"
    )
    faults, _ = _answer(live_page, question)
    assert faults.keys() == {"dog.count", "load.torque_Nm", "material.proof_stress_MPa"}


def test_fields_are_read_as_people_write_them(live_page: LivePage) -> None:
    question = _asked(
        live_page,
        load__torque_Nm="0,25 kN m",
        dog__chamfer_deg="11,5 deg",
        material__set="20MnCr5",
        material__allowable_pressure_MPa="0.21 GPa",
        manufacturing__tip_width_mm="1,6",
        load__coast_share="125 Nm",
        load__accuracy="7",
    )
    assert live_page.read(question).values == {
        "dog.chamfer_deg": 11.5, "load.torque_Nm": 250.0, "load.coast_share": 0.5,
        "load.accuracy": 7, "manufacturing.tip_width_mm": 1.6, "material.set": "20MnCr5",
        "material.allowable_pressure_MPa": 210.0,
    }  # fmt: skip
    assert live_page.number_of("dog.chamfer_deg", "11,5 deg") == 11.5
    assert live_page.number_of("dog.chamfer_deg", "11,5 N") is None


def test_numbers_of_a_material_are_those_of_its_set(live_page: LivePage) -> None:
    """Until the user gives one; a number of the set is no change."""
    read = live_page.read(_asked(live_page, material__set="31CrMoV9"))
    assert read.defaults["material.allowable_pressure_MPa"] == 140.0
    question = _asked(live_page, material__set="31CrMoV9", material__allowable_pressure_MPa="140")
    assert live_page.read(question).values == {"material.set": "31CrMoV9"}


#: Fields as a user fills them, and the operating points that are asked for.
CHANGES: dict[str, tuple[str, dict[str, str]]] = {
    "load and material": ("all", {
        "load.torque_Nm": "0,25 kN m", "material.set": "20MnCr5", "dog.chamfer_deg": "11,25",
        "material.allowable_pressure_MPa": "210", "load.safety": "1,3", "load.accuracy": "6",
    }),
    "one point": ("one", {"mismatch_rpm": "45", "force_N": "0.3 kN", "dog.count": "18"}),
    "points": ("all", {"operating.mismatch_rpm": "25 149", "manufacturing.module_mm": "1.5"}),
    "profile": ("all", {"actuation.force_N": "200 700", "actuation.rise_s": "300 ms 100 ms"}),
    "spring": ("all", {"actuation.kind": "spring", "actuation.preload_N": "0,4 kN"}),
    "cylinder": ("all", {"actuation.kind": "pneumatic", "operating.force_N": "500"}),
}  # fmt: skip


@pytest.mark.parametrize("name", bundled_studies())
def test_every_study_takes_every_actuator(name: str) -> None:
    """Its numbers are those of an example; command and file have the same study."""
    live_page = LivePage(ds.Study(name), name)
    for kind in KINDS:
        question = _asked(live_page, actuation__kind=kind)
        read = live_page.read(question)
        assert (read.faults, read.refusal) == ({}, "")
        assert read.study is not None
        assert read.study.clutch.actuator is not None
        assert read.study.clutch.actuator.kind == kind
        words = shlex.split(" ".join(live_page.check_words(question)))
        sets = [setting for setting in words if setting != "--set"]
        assert load_study(name, sets).config_hash == read.study.config_hash
        exported = tomllib.loads(live_page.export(question))
        file = validate(StudyFile, exported, "the exported file")
        assert build_study(file).config_hash == read.study.config_hash


@pytest.mark.parametrize("name", CHANGES)
def test_the_exported_file_is_the_study_of_the_page(
    live_page: LivePage, dogshape: Call, name: str, tmp_path: Path
) -> None:
    """It keeps the comments, and the printed command has the same keys."""
    where, texts = CHANGES[name]
    question = Question(live_page.start_texts() | texts, where)
    design = live_page.design(live_page.read(question), where)
    assert design is not None
    client = build_app(live_page).server.test_client()
    answer = client.get("/file/study.toml", query_string={**question.texts, "where": where})
    assert answer.status_code == 200, answer.text
    file = tmp_path / "mine.toml"
    file.write_bytes(answer.data)
    config = design.study.config
    assert load_study(file).config_hash == config.config_hash
    assert "# at the inner radius" in answer.text
    words = shlex.split(link_files(live_page, question, "")["command.children"])
    sets = [setting for option, setting in itertools.pairwise(words) if option == "--set"]
    assert load_study("mq200_paper", sets).config_hash == config.config_hash
    rows = _check_rows(_answer(live_page, question)[1]["checks.children"])
    checks = dogshape("strength", file, "--no-simulate", "--json").json["checks"]
    assert len(rows) == len(checks)
    for check in checks:
        margin = float(rows[check["name"]]["data-margin"])
        assert margin == pytest.approx(check["margin"], rel=1e-9)
    assert ("--mismatch-rpm 45 --force-N 300" in answer.text) == (name == "one point")


def test_another_actuator_has_checks_and_a_time_that_must_be_simulated(
    live_page: LivePage,
) -> None:
    """No figure of the surrogate stays, and the button simulates design and own dog."""
    study = ds.Study("mq200_paper", {"expectation.angles": 8, "operating.mismatch_rpm": [50.0]})
    page = open_live_page(study)
    question = _asked(page, actuation__kind="spring", dog__chamfer_deg="11")
    _, answer = _answer(page, question)
    assert not _exact(answer)
    reason = answer["predicted.children"][-1].children
    assert "was fitted to the actuation 'profile', and this is 'spring'" in reason
    assert "must be simulated" in reason
    assert "not simulated" in repr(answer["simulated.children"])
    assert answer["simulate.hidden"] is False
    assert "data-check=" in repr(answer["checks.children"])
    assert answer["curve-box.hidden"] is True
    assert answer_by_simulation(page, question, is_wanted=False) == {}
    answer = answer_by_simulation(page, question, is_wanted=True)
    spring = study.replace_keys(
        {
            "actuation.kind": "spring",
            "actuation.preload_N": 300.0,
            "actuation.rate_N_mm": 20.0,
            "operating.force_N": [300.0],
        }
    )
    expected = spring.replace_keys(chamfer_deg=11.0).check().expected
    assert expected is not None
    assert answer["simulate.hidden"] is True
    assert _exact(answer["simulated.children"]) == [[expected.time, expected.low, expected.high]]
    own = spring.check().expected
    assert own is not None
    times = _exact(answer_on_own_dog(page, question)["beside.children"])
    assert times == [[one.time, one.low, one.high] for one in (own, expected)]
    # A design that is simulated already is shown without the button.
    _, answer = _answer(page, question)
    assert _exact(answer["simulated.children"]) == [[expected.time, expected.low, expected.high]]
    assert answer["simulate.hidden"] is True


def test_other_physics_have_checks_and_no_prediction(live_page: LivePage) -> None:
    _, answer = _answer(live_page, _asked(live_page, dog__axial_gap_mm="1.2"))
    assert "other physics" in answer["predicted.children"][-1].children
    assert "data-check=" in repr(answer["checks.children"])


def test_the_own_dog_stands_beside_the_design(live_page: LivePage) -> None:
    """Under the load of the page; values, times and margins are those of ``check``."""
    question = _asked(live_page, load__torque_Nm="210", dog__chamfer_deg="11", dog__count="18")
    _, answer = _answer(live_page, question)
    loaded = live_page.study.replace_keys({"load.torque_Nm": 210.0})
    own = loaded.check(surrogate=live_page.surrogate)
    design = loaded.replace_keys(chamfer_deg=11.0, count=18).check(surrogate=live_page.surrogate)
    assert own.expected is not None
    assert design.expected is not None
    assert _exact(answer["beside.children"]) == [
        [side.time, side.low, side.high] for side in (own.expected, design.expected)
    ]
    table = repr(answer["beside.children"])
    assert "[Td('number of dogs N'), Td('15'), Td('18')], className='changed'" in table
    assert "torque 210 N m (study: 200)" in table
    rows = _check_rows(answer["checks.children"])
    for check in own.design.checks:
        assert rows[check.name]["children"][-1].children == percent(check.margin)
    assert "own%20dog" in answer["section.src"]


def test_an_own_dog_that_is_no_clutch_leaves_the_design_alone(live_page: LivePage) -> None:
    """The stroke of this magnet ends before the prototype's travel."""
    changes = {"actuation__kind": "solenoid", "actuation__stroke_mm": "4", "dog__height_mm": "2.5"}
    question = _asked(live_page, **changes)
    assert live_page.read(live_page.own_question(question)).study is None
    faults, answer = _answer(live_page, question)
    assert not faults
    table = repr(answer["beside.children"])
    assert "Th('this design')" in table
    assert "Th('own dog')" not in table
    assert "with which there is no such clutch" in table


def test_the_curve_has_the_predicted_times_over_the_slider(live_page: LivePage) -> None:
    question = _asked(live_page, dog__chamfer_deg="11", dog__count="18")
    answers = live_page.read(question)
    design = live_page.design(answers, "all")
    assert design is not None
    for key, places in {"dog.height_mm": (0, 17, 40), "dog.count": (4, 12)}.items():
        curve = live_page.time_curve(design, key)
        assert isinstance(curve, TimeCurve)
        for place in places:
            value = curve.values[place]
            number = int(value) if key == "dog.count" else float(value)
            check = design.study.replace_keys({key: number}).check(surrogate=live_page.surrogate)
            if check.expected is None:
                assert np.isnan(curve.times[place])
                continue
            expected = (check.expected.time, check.expected.low, check.expected.high)
            found = (curve.times[place], curve.low[place], curve.high[place])
            assert found == pytest.approx(expected, rel=1e-6)
    _, answer = answer_at_once(live_page, question, "dog.count")
    marks = {trace.name: trace.x[0] for trace in answer["curve.figure"].data if trace.name}
    first, last = answer["curve.figure"].layout.xaxis.range
    assert first < 6
    assert last > 36
    assert marks["own dog"] == 15
    assert marks["this design"] == 18


@pytest.mark.parametrize(
    ("where", "key", "sentence"),
    [
        ("all", "load.torque_Nm", "the shift time does not depend on it"),
        ("all", "contact.static_friction", "the surrogate has one value of it"),
        ("all", "dog.axial_gap_mm", "the surrogate has one value of it"),
        ("all", "force_N", "the times are means over all operating points"),
        ("all", "angle_deg", "the times are means over the relative angle"),
    ],
)
def test_a_slider_without_a_curve_says_why(
    live_page: LivePage, where: str, key: str, sentence: str
) -> None:
    design = live_page.design(live_page.read(_asked(live_page)), where)
    assert design is not None
    assert live_page.time_curve(design, key) == sentence


def test_the_curve_over_one_point_has_its_predicted_times(live_page: LivePage) -> None:
    design = live_page.design(live_page.read(_asked(live_page, "one", force_N="300")), "one")
    assert design is not None
    curve = live_page.time_curve(design, "mismatch_rpm")
    assert isinstance(curve, TimeCurve)
    for place in (3, 30):
        check = design.study.check(
            mismatch_rpm=curve.values[place], force_N=300.0, surrogate=live_page.surrogate
        )
        assert check.expected is not None
        assert curve.times[place] == pytest.approx(check.expected.time, rel=1e-9)


def test_cautions_are_one_line(live_page: LivePage) -> None:
    question = _asked(live_page, dog__traction_deg="2", dog__braking_deg="31")
    _, answer = _answer(live_page, question)
    (folded,) = answer["cautions.children"]
    summary, *others = folded.children
    assert summary.children.startswith("4 cautions, the first: braking side angle, deg, is 31")
    assert "traction_deg = 2 is outside the simulated designs" in repr(others)
    assert len(others) == 3
    _, answer = _answer(live_page, _asked(live_page))
    assert answer["cautions.children"] == []


def test_designs_of_a_search_are_offered_where_its_physics_are_the_studys(
    live_page: LivePage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert live_page.result is not None
    design = live_page.result.front[0]
    shape = live_page.shape(str(design.trial))
    assert shape["dog.count"] == str(design.value("count"))
    assert shape["dog.axial_gap_mm"] == "1"  # the rest of the dog as it was
    other = open_live_page(ds.Study("mq200_paper", {"shift.timeout_s": 1.1}))
    assert (other.result, other.surrogate) == (None, None)
    assert open_live_page(ds.Study("mq200_actuation")).result is None


def test_the_verb_takes_the_folder_of_a_search(
    dogshape: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: dict[str, Any] = {}
    monkeypatch.setattr(
        "dogshape.app.server.serve_app", lambda study, **how: seen.update(how, study=study)
    )
    (tmp_path / "mine").mkdir()
    StudyFolder(tmp_path / "mine").open(PAPER, resume=False)
    assert dogshape("app", "mine", "--set", "dog.count=18", "--no-browser").status == 130
    assert seen["study"].dog["count"] == 18
    assert (seen["folder"], seen["port"], seen["browser"]) == (Path("mine"), 8050, False)
    assert seen["command"] == "mine --set=dog.count=18"


def test_links_say_the_design(live_page: LivePage) -> None:
    found = link_files(
        live_page, _asked(live_page, "one", dog__count="18", force_N="300"), "why not"
    )
    every = [*found["files.children"], *found["shift-link.children"]]
    assert {one.href.partition("?")[0] for one in every} == {f"/file/{name}" for name in FILES}
    assert all("dog.count=18" in one.href and "why=why+not" in one.href for one in every)


def test_the_open_section_has_both_rings_to_scale(prototype: Dog) -> None:
    root = ElementTree.fromstring(open_section_svg(dog_pair(prototype), dog_pair(prototype)))
    paths = {
        path.get("class"): path.get("d", "")
        for path in root.iter("{http://www.w3.org/2000/svg}path")
    }
    levels = {
        name: [float(pair.split(",")[1]) for pair in paths[name].strip("M Z").split(" L")]
        for name in ("ring-a", "ring-b", "ghost")
    }
    bar = [float(pair.split(",")[0]) for pair in paths["bar"].strip("M").split(" L")]
    scale = (bar[1] - bar[0]) / 5e-3
    gap = min(levels["ghost"]) - max(levels["ring-b"][:-2])
    assert gap == pytest.approx(prototype.axial_gap * scale, abs=0.1)
    height = max(levels["ghost"]) - min(levels["ghost"])
    assert height == pytest.approx(prototype.height * scale, abs=0.1)


@pytest.mark.parametrize("path", ["/", "/_dash-layout", "/_dash-dependencies", "/file/dog.svg"])
def test_only_names_of_this_machine_are_answered(live_page: LivePage, path: str) -> None:
    """A page elsewhere whose name resolves to this machine gets nothing (DNS rebinding)."""
    client = build_app(live_page).server.test_client()
    texts = live_page.start_texts()
    hosts = {
        "127.0.0.1:8050": 200, "localhost": 200, "localhost:1234": 200, "elsewhere.example": 400,
        "127.0.0.1.elsewhere.example:8050": 400, "localhost.elsewhere.example": 400,
        "192.168.0.7:8050": 400,
    }  # fmt: skip
    for host, status in hosts.items():
        answer = client.get(path, query_string=texts, headers={"Host": host})
        assert answer.status_code == status
    update = client.post("/_dash-update-component", json={}, headers={"Host": "elsewhere.example"})
    assert update.status_code == 400


def test_browsers_at_once_get_answers_to_their_own_numbers(live_page: LivePage) -> None:
    """Designs stand in the requests alone: answers at once are those one after the other."""
    server = build_app(live_page).server
    texts = live_page.start_texts()
    angles = [str(angle) for angle in range(8, 16)]

    def drawing(angle: str) -> bytes:
        asked = texts | {"dog.chamfer_deg": angle}
        return server.test_client().get("/file/dog.svg", query_string=asked).data

    alone = [drawing(angle) for angle in angles]
    assert len(set(alone)) == len(angles)
    with ThreadPoolExecutor(4) as browsers:
        assert list(browsers.map(drawing, 3 * angles)) == 3 * alone
    assert live_page.start_texts() == texts
