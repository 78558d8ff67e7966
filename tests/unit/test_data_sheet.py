"""``export --sheet``: the data sheet of any design, as a page and as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import dogshape as ds
from dogshape.check import check_design
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import bundled_root
from tests.conftest import Said
from tests.kept import kept_folder

Call = Callable[..., Said]
WHY = "shorter, and as fast within the error"
RESULT = json.loads((bundled_root() / "mq200_paper/result.json").read_text())
TRIAL = RESULT["front"][1]["trial"]
(CONFIRMED,) = (one for one in RESULT["confirmation"]["designs"] if one["trial"] == TRIAL)


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    return kept_folder(tmp_path / "mq200_paper")


def test_a_design_of_a_result_has_its_page(dogshape: Call, folder: StudyFolder) -> None:
    name = f"{folder.root}#{TRIAL}"
    assert dogshape("export", name, "--sheet", "sheet.html", "--why", WHY).status == 0
    page = Path("sheet.html").read_text()
    for words in (
        f"mq200_paper, design {TRIAL}", WHY, f"{RESULT['front'][1]['chamfer_deg']:.2f} deg",
        "± 0.25 deg", f"{1e3 * CONFIRMED['expected_shift_time_s']:.1f} ± ", "traction release",
        content_key(RESULT), "16MnCr5", "drake 1.51",
    ):  # fmt: skip
        assert words in page
    path = ds.load_result(folder.root).data_sheet(TRIAL, "sheet.json", WHY)
    sheet = json.loads(path.read_text())
    assert (sheet["design"], sheet["why"]) == (TRIAL, WHY)
    assert sheet["expected_shift_time_s"] == CONFIRMED["expected_shift_time_s"]
    checks = {check["name"]: check for check in sheet["checks"]}
    for check in CONFIRMED["checks"]:
        assert checks[check["name"]]["value"] == pytest.approx(check["value"])
    assert checks["root_fatigue"]["margin_worst_case"] < checks["root_fatigue"]["margin"]
    sizes = {row["key"]: row["value"] for row in sheet["dimensions"]}
    assert sizes["height_mm"] == pytest.approx(sheet["height_mm"])


def test_a_typed_design_is_simulated_as_by_check(dogshape: Call) -> None:
    keys = ("--set", "dog.chamfer_deg=12")
    assert dogshape("export", "mq200", *keys, "--sheet", "sheet.json").status == 0
    sheet = json.loads(Path("sheet.json").read_text())
    found = check_design(load_study("mq200", ["dog.chamfer_deg=12"]))
    assert (sheet["name"], sheet["chamfer_deg"]) == ("mq200", 12)
    assert sheet["expected_shift_time_s"] == pytest.approx(found.time_s)
    assert {check["name"]: check["margin"] for check in sheet["checks"]}.items() <= {
        check.name: check.margin for check in found.design.checks
    }.items()
    assert sheet["provenance"]["command"] == "dogshape study mq200 --set dog.chamfer_deg=12.0"


def test_the_title_block_says_who_decided_and_why(dogshape: Call, folder: StudyFolder) -> None:
    block = {"number": "47-11", "revision": "B", "author": "A. Novak", "checker": "C. Dvorak",
             "decided_by": "E. Fiala"}  # fmt: skip
    result = ds.load_result(folder.root)
    sheet = json.loads(result.data_sheet(TRIAL, "sheet.json", WHY, **block).read_text())
    assert sheet.items() >= {**block, "why": WHY, "date": sheet["time"][:10]}.items()
    options = [part for key, text in block.items() for part in ("--title", f"{key}={text}")]
    name = f"{folder.root}#{TRIAL}"
    said = dogshape("export", name, "--sheet", "a.html", *options, "--title", "date=2026-11-30")
    assert said.status == 0
    page = Path("a.html").read_text()
    assert all(word in page for word in (*block.values(), "2026-11-30", "checked by", "<th>S</th>"))
    with pytest.raises(ds.InputError, match="'autor' is no key of a data sheet; did you mean"):
        result.data_sheet(TRIAL, "sheet.json", autor="A. Novak")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("mq200_paper#480", "--sheet", "a.html"), "has no design 480"),
        (("mq200_paper#1", "--set", "dog.count=20", "--sheet", "a.html"), "--set would change"),
        (("mq200_paper#1", "--svg", "a.svg", "--why", "x"), "--why and --title are for"),
        (("mq200#33", "--sheet", "a.html", "--title", "autor=x"), "did you mean 'author'"),
        (("mq200_paper#1", "--sheet", "a.pdf"), "must end in .html"),
    ],
)
def test_what_has_no_sheet_is_refused(
    dogshape: Call, arguments: tuple[str, ...], words: str
) -> None:
    said = dogshape("export", *arguments)
    assert said.status == 2
    assert words in said.sentence
