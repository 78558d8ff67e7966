"""``choose``: the decision, its record, and the folder for the workshop."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

import dogshape as ds
from dogshape.pipeline.export.cad import cad_available
from dogshape.pipeline.reports.decision import workshop
from dogshape.pipeline.reports.study.study_page import write_report
from dogshape.pipeline.store.decisions import decisions_of
from dogshape.pipeline.store.folder import StudyFolder
from tests.conftest import Said, needed
from tests.kept import kept_folder, let_land_too_hard

Call = Callable[..., Said]
WHY = "shorter, and as fast within the error"


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    return kept_folder(tmp_path / "mq200_paper")


@pytest.fixture
def without_cad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workshop, "cad_available", lambda: False)


@pytest.mark.usefixtures("without_cad")
def test_a_decision_is_kept_and_shown(dogshape: Call, folder: StudyFolder) -> None:
    write_report(folder)
    said = dogshape("choose", folder.root, "--design", 44, "--why", WHY, "--json")
    assert said.status == 0, said.err
    record = said.json
    assert (record["design"], record["why"]) == (44, WHY)
    digest = hashlib.sha256(folder.result.read_bytes()).hexdigest()
    assert record["result_sha256"] == digest
    assert record["config_hash"] == folder.stored_study().config_hash
    (kept,) = decisions_of(folder)
    assert (kept.design, kept.time) == (44, record["time"])
    page = folder.report.read_text()
    assert f"design 44.</b> {WHY}." in page
    assert "The result has changed since" not in page
    target = folder.root / "decision"
    assert json.loads((target / "decision.json").read_text())["design"] == 44
    assert ElementTree.parse(target / "section.svg").getroot().tag.endswith("svg")
    assert (target / "ring.stl").stat().st_size > 1000
    assert not (target / "rings.step").exists()
    assert any("extra [cad]" in note for note in record["notes"])
    sheet = (target / "datasheet.html").read_text()
    for words in (
        WHY, "15.70 °", "± 0.25 °", "3.15 mm", "59.5 ± 0.2 ms", "94.9 ± 0.1 ms",
        "31.9 ± 1.9 ms slower", "traction release", digest[:20], "16MnCr5", "drake 1.51",
    ):  # fmt: skip
        assert words in sheet
    folder.result.write_text(folder.result.read_text() + "\n")
    assert "The result has changed since" in write_report(folder).read_text()


@pytest.mark.usefixtures("without_cad")
def test_no_decision_is_lost(dogshape: Call, folder: StudyFolder) -> None:
    assert dogshape("choose", folder.root, "--design", 44, "--why", WHY).status == 0
    again = dogshape("choose", folder.root, "--design", 46, "--why", "faster")
    assert again.status == 2
    assert "has a decision already, for design 44" in again.sentence
    forced = dogshape("choose", folder.root, "--design", 46, "--why", "faster", "--force")
    assert forced.status == 0
    assert [one.design for one in decisions_of(folder)] == [44, 46]
    assert "design 46" in (folder.root / "decision" / "datasheet.html").read_text()


@pytest.mark.usefixtures("without_cad")
def test_doubts_about_a_decision_are_said(dogshape: Call, folder: StudyFolder) -> None:
    let_land_too_hard(folder, 47)
    hard = dogshape("choose", folder.root, "--design", 47, "--why", "fast")
    assert "warning: design 47 fails edge_pressure_impact" in hard.out
    once = dogshape("choose", folder.root, "--design", 41, "--why", "short", "--force")
    assert "was not simulated at the new angles" in once.out


@pytest.mark.parametrize(
    ("design", "why", "words"),
    [
        ("480", "x", "has the designs 0 (prototype) to 47"),
        ("44", "  ", "--why is empty"),
    ],
)
def test_what_cannot_be_chosen_is_refused(
    dogshape: Call, folder: StudyFolder, design: str, why: str, words: str
) -> None:
    said = dogshape("choose", folder.root, "--design", design, "--why", why)
    assert said.status == 2
    assert words in said.sentence
    assert not folder.decision.exists()
    assert not (folder.root / "decision").exists()


def test_a_folder_without_a_study_is_refused(dogshape: Call, tmp_path: Path) -> None:
    said = dogshape("choose", tmp_path, "--design", 1, "--why", "x")
    assert said.status == 2
    assert "there is no study.json" in said.sentence


@pytest.mark.usefixtures("without_cad")
def test_from_python(folder: StudyFolder) -> None:
    found = ds.load_result(folder.root).choose(44, WHY)
    assert found.to_dict()["design"] == 44
    assert "datasheet.html" in "".join(found.to_frame()["file"])
    assert "design 44" in repr(found)


def test_with_the_extra_there_is_a_step_file(dogshape: Call, folder: StudyFolder) -> None:
    needed(cad_available(), "build123d")
    said = dogshape("choose", folder.root, "--design", 44, "--why", WHY, "--json")
    assert "rings.step" in said.json["files"]
    assert (folder.root / "decision" / "rings.step").read_text(errors="replace").startswith("ISO")
