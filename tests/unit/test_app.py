"""Values of the live page, without a server: those of the package."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import dogshape as ds
from dogshape.app.live_callbacks import answer_at_once, build_app, link_files
from dogshape.app.live_page import FILES, LivePage, Question, open_live_page
from dogshape.pipeline.config.study_file import bundled_studies, load_study, replace_keys
from dogshape.pipeline.export.drawing import open_section_svg
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.pair import dog_pair
from tests.conftest import Call

PAPER = load_study("mq200_paper")


@pytest.fixture(scope="module")
def live_page() -> LivePage:
    """The paper's study with the surrogate and the search that the package brings."""
    return open_live_page(ds.Study("mq200_paper"))


def _asked(live_page: LivePage, where: str = "all", **changed: str) -> Question:
    texts = {one.key: one.text for one in live_page.numbers}
    changes = {key.replace("__", "."): text for key, text in changed.items()}
    return Question(texts | changes, where)


@pytest.mark.parametrize("name", bundled_studies())
def test_every_study_has_a_page_and_keys_as_on_the_command_line(name: str) -> None:
    sets = {"dog.height_mm": 3.5, "load.torque_Nm": 150, "solver.engine": "planar"}
    study = load_study(name)
    assert replace_keys(study, sets).config_hash == load_study(name, sets).config_hash
    assert replace_keys(study, {}).config_hash == study.config_hash
    live_page = open_live_page(ds.Study(name))
    assert build_app(live_page).layout is not None
    faults, answer = answer_at_once(live_page, _asked(live_page))
    assert not any(faults.values())
    assert repr(answer["checks.children"]).count("data-check=") > 15


@pytest.mark.parametrize(
    ("key", "text", "sentence"),
    [
        ("dog.chamfer_deg", "abc", "dog.chamfer_deg is 'abc', but it must be a number in deg"),
        ("dog.height_mm", "", "dog.height_mm is '', but it must be a number in mm"),
        ("mismatch_rpm", "x", "mismatch_rpm is 'x', but it must be a number"),
        ("load.friction_hold", "0.5", "load.friction_hold is 0.5, but it must not exceed"),
    ],
)
def test_a_refusal_stands_at_its_number(
    live_page: LivePage, key: str, text: str, sentence: str
) -> None:
    """That of an impossible shape stands above the answers."""
    faults, answer = answer_at_once(live_page, _asked(live_page, "one", **{key: text}))
    assert (answer["answer.className"], answer["refused.children"]) == ("stale", "")
    assert faults[key].startswith(sentence)
    faults, answer = answer_at_once(
        live_page, _asked(live_page, dog__traction_deg="50", dog__height_mm="9")
    )
    assert not any(faults.values())
    assert answer["refused.children"].startswith("There is no such dog: ")


def test_other_physics_have_checks_and_no_prediction(live_page: LivePage) -> None:
    _, answer = answer_at_once(live_page, _asked(live_page, dog__axial_gap_mm="1.2"))
    assert "other physics" in answer["predicted.children"][-1].children
    assert "data-check=" in repr(answer["checks.children"])


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
    texts = {number.key: number.text for number in live_page.numbers}
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
    texts = {number.key: number.text for number in live_page.numbers}
    angles = [str(angle) for angle in range(8, 16)]

    def drawing(angle: str) -> bytes:
        asked = texts | {"dog.chamfer_deg": angle}
        return server.test_client().get("/file/dog.svg", query_string=asked).data

    alone = [drawing(angle) for angle in angles]
    assert len(set(alone)) == len(angles)
    with ThreadPoolExecutor(4) as browsers:
        assert list(browsers.map(drawing, 3 * angles)) == 3 * alone
    assert {number.key: number.text for number in live_page.numbers} == texts
