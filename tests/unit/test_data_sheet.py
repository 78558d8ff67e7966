"""Designs of results: their data sheets as pages and JSON, and ``compare``, a column each."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import dogshape as ds
from dogshape.check import check_design
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.data_sheet import provenance_of
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import bundled_root
from tests.conftest import Call
from tests.search_results import bundled_folder, bundled_result

MINUS = "\N{MINUS SIGN}"
WHY = "shorter, and as fast within the error"
RESULT = bundled_result()
TRIAL = RESULT["front"][1]["trial"]
(CONFIRMED,) = (one for one in RESULT["confirmation"]["designs"] if one["trial"] == TRIAL)


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    return bundled_folder(tmp_path / "mq200_paper")


def test_a_design_of_a_result_has_its_page(dogshape: Call, folder: StudyFolder) -> None:
    name = f"{folder.root}#{TRIAL}"
    assert dogshape("export", name, "--sheet", "sheet.html", "--why", WHY).status == 0
    page = Path("sheet.html").read_text().replace("\N{NO-BREAK SPACE}", " ")
    for words in (
        f"mq200_paper, design {TRIAL}", WHY, f"{RESULT['front'][1]['chamfer_deg']:.2f} deg",
        "± 0.25 deg", f"{1e3 * CONFIRMED['expected_shift_time_s']:.1f} ± ", "traction release",
        content_key(RESULT), "16MnCr5", "drake 1.51", f"#{TRIAL}&#39; --sheet",
        "not judged: flank strike", "Assumptions that decide", "DIN 5466-1 (flank pressure)",
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


def test_the_load_names_defaults_that_decide_checks() -> None:
    study = load_study("motorcycle", ["load.shifts=2e5"])
    words = "110 N m, application factor 1.5, 200,000 shifts over the life"
    assert study.load_text == f"{words}, pulled out under 5 % of the torque"
    assert provenance_of(study, None)["load"] == study.load_text
    default = load_study("motorcycle", ["load.shifts=1e5", "load.pull_out_share=1"])
    assert default.load_text == (
        "110 N m, application factor 1.5, 100,000 shifts over the life (default), "
        "pulled out under 100 % of the torque (default)"
    )


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
    assert sheet["provenance"]["command"] == (
        "dogshape export --sheet sheet.json mq200 --set dog.chamfer_deg=12.0"
    )


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
    with pytest.raises(ds.InputError, match="'autor' is no key of a title block; did you mean"):
        result.data_sheet(TRIAL, "sheet.json", autor="A. Novak")


CHOSEN, OTHER = (row["trial"] for row in RESULT["front"][:2])
PAIR = (f"mq200_paper#{CHOSEN}", f"mq200_paper#{OTHER}")


def test_designs_of_a_kept_result(dogshape: Call) -> None:
    names = ["mq200_paper#0", *PAIR]
    said = dogshape("compare", *names, "--json")
    assert said.status == 0
    own, chosen, other = said.json["items"]
    assert [item["label"] for item in (own, chosen, other)] == names
    confirmed = RESULT["confirmation"]
    assert chosen["gain_s"] == pytest.approx(confirmed["gain_s"])
    assert chosen["difference_s"] == pytest.approx(-confirmed["gain_s"])
    assert chosen["difference_standard_error_s"] == pytest.approx(
        confirmed["gain_standard_error_s"]
    )
    assert (own["difference_s"], own["gain_s"], own["settings"]) == (None, None, {})
    assert chosen["expected_shift_time_s"] == confirmed["best"]["expected_shift_time_s"]
    means = [point["mean_s"] for point in confirmed["best"]["points"]]
    assert chosen["slowest_point"]["mean_s"] == max(means)
    frame, margin = ds.compare(*names).to_frame(), confirmed["best"]["checks"][0]
    assert list(frame.columns) == names
    assert frame.loc[f"margins.{margin['name']}", PAIR[0]] == pytest.approx(margin["margin"])


def test_a_comparison_has_names_with_units_and_a_picture_of_each_dog(tmp_path: Path) -> None:
    found = ds.compare("mq200_paper#0", PAIR[0])
    (table,) = found.to_parts()
    assert isinstance(table, Table)
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["outer diameter, mm"][0] == "52"
    assert rows["less that of the first, ms"][0] == "-"
    difference, _, _ = rows["less that of the first, ms"][1].replace(MINUS, "-").partition(" ")
    assert float(difference) == pytest.approx(1e3 * found.items[1]["difference_s"], abs=0.1)
    assert not any("_deg" in name or name.endswith("_s") for name in rows)
    page = found.report(tmp_path / "compared.html").read_text()
    assert page.count("<figure>") == 2


def test_margins_at_worst_case_tolerances_have_the_check_behind_them() -> None:
    """Also of a study that bounds that margin."""
    rows = bundled_result("mq200")["front"][:2]
    items = ds.compare(*(f"mq200#{row['trial']}" for row in rows)).items
    for key in ("weakest_check_worst_case", "margin_worst_case"):
        assert [item[key] for item in items[:2]] == [row[key] for row in rows]
    assert "smallest_margin_worst" not in [item["weakest_check"] for item in items]


def test_a_prototype_that_the_search_did_not_simulate_has_the_time_of_the_confirmation() -> None:
    own, chosen = ds.compare("mq200#0", "mq200").items
    confirmed = bundled_result("mq200")["confirmation"]["prototype"]
    assert own["expected_shift_time_s"] == confirmed["expected_shift_time_s"]
    assert (own["passes"], own["weakest_check"]) == (False, "pull_out_force")
    assert chosen["difference_s"] == pytest.approx(-chosen["gain_s"])


def test_keys_of_the_study_files_that_differ_are_rows(tmp_path: Path) -> None:
    found = ds.compare("mq200_paper", "mq200")
    assert "mechanism.spline_friction" in repr(found)
    one, other = found.items
    assert (one["settings"]["load.accuracy"], other["settings"]["load.accuracy"]) == (None, 6)
    # Times of other operating points have no difference.
    text = (bundled_root() / "mq200_paper" / "study.toml").read_text()
    (tmp_path / "o.toml").write_text(text.replace("mismatch_rpm = [", "mismatch_rpm = [7.0, "))
    first, second = ds.compare("mq200_paper", str(tmp_path / "o.toml")).items
    assert second["operating_points"] > first["operating_points"]
    assert second["difference_s"] is None


def test_a_study_that_was_not_searched_is_checked(dogshape: Call) -> None:
    dogshape("init", "study", "--out", "mine", "--set", "dog.height_mm=3.2")
    kept, own = dogshape("compare", "mq200_paper", "mine", "--json").json["items"]
    study = load_study("mine")
    found = check_design(study)
    assert found.expected is not None
    assert own["height_mm"] == 3.2
    assert (kept["source"], own["source"]) == ("new angles", "compiled engine")
    assert own["expected_shift_time_s"] == pytest.approx(found.time_s)
    assert own["standard_error_s"] == pytest.approx(found.expected.error)
    assert own["axial_length_mm"] == pytest.approx(1e3 * study.clutch.dog.axial_length)
    assert own["difference_s"] == pytest.approx(
        own["expected_shift_time_s"] - kept["expected_shift_time_s"]
    )
    error = math.hypot(own["standard_error_s"], kept["standard_error_s"])
    assert own["difference_standard_error_s"] == pytest.approx(error)
