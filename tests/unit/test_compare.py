"""``compare``: designs, studies and contact sets side by side."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.check import check_design
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.study.single_shifts import read_shifts
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.store.decisions import Decision, keep_decision
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.bundled import bundled_root
from dogshape.sim.shift.contact import CONTACT_SETS
from tests.conftest import ONE_LEVEL, Said
from tests.found import shift
from tests.kept import kept_folder

Call = Callable[..., Said]
KEPT = json.loads((bundled_root() / "mq200_paper/result.json").read_text())


def test_designs_of_a_kept_result(dogshape: Call) -> None:
    said = dogshape("compare", "mq200_paper#0", "mq200_paper#46", "mq200_paper#44", "--json")
    assert said.status == 0
    record = said.json
    assert [item["label"] for item in record["items"]] == [
        "mq200_paper#0",
        "mq200_paper#46",
        "mq200_paper#44",
    ]
    confirmed = KEPT["confirmation"]
    gain, _ = record["differences"]
    assert gain["expected_shift_time_s"] == pytest.approx(-confirmed["gain_s"])
    assert gain["standard_error_s"] == pytest.approx(confirmed["gain_standard_error_s"])
    assert (gain["paired"], gain["clear"], gain["notes"]) == (False, True, [])
    assert len(gain["points"]) == 28
    chosen = record["items"][1]
    assert chosen["expected_shift_time_s"] == confirmed["best"]["expected_shift_time_s"]
    worst = chosen["worst_against_prototype"]
    assert (worst["mismatch_rpm"], worst["force_N"]) == (249.0, 315.5)
    assert worst["difference_s"] == pytest.approx(0.0278, abs=1e-4)
    assert chosen["locking_friction"] == pytest.approx(0.12098, abs=1e-5)


def test_margins_at_worst_case_tolerances_have_the_check_behind_them(
    dogshape: Call, tmp_path: Path
) -> None:
    """Also of a study that bounds that margin, and of its own dog."""
    names = ("mq200#34", "mq200#33", "mq200#0")
    record = dogshape("compare", *names, "--json").json
    found = [(i["weakest_check_worst_case"], i["margin_worst_case"]) for i in record["items"]]
    assert [name for name, _ in found] == ["root_fatigue", "contact_ratio", "root_fatigue"]
    assert found[0][1] == pytest.approx(0.00565, abs=1e-5)
    for item in record["items"]:
        assert "smallest_margin_worst" not in [one["name"] for one in item["smallest_margins"]]
    said = dogshape("compare", *names, "--html", tmp_path / "side.html").out
    page = (tmp_path / "side.html").read_text()
    for text in (said, page):
        assert "0.6 % root fatigue" in text
        assert "smallest margin worst" not in text
    assert page.count("independent") < 6


def test_a_design_that_does_not_engage_is_compared_by_counts(tmp_path: Path) -> None:
    folder = kept_folder(tmp_path / "mine")
    result = folder.stored_result()
    for one in (result["confirmation"]["best"], *result["confirmation"]["designs"][:1]):
        one["points"][0]["engaged"] = 0.25
    folder.result.write_text(json.dumps(result))
    found = ds.compare(f"{folder.root}#44", f"{folder.root}#46")
    item = found.to_dict()["items"][1]
    assert (item["expected_shift_time_s"], item["shifts_engaged"]) == (None, [436, 448])
    assert found.to_dict()["differences"][0]["expected_shift_time_s"] is None
    found.report(tmp_path / "side.html")
    assert "engages in 436 of 448" in (tmp_path / "side.html").read_text()


def test_a_study_without_a_number_is_its_chosen_design_or_the_one_decided_for(
    tmp_path: Path,
) -> None:
    folder = kept_folder(tmp_path / "mine")
    here = str(folder.root)
    assert ds.compare("mq200_paper", here).to_dict()["items"][1]["design"] == 46
    keep_decision(folder, Decision(44, "why", "2026-01-01T00:00:00Z", "", "", ""))
    assert ds.compare("mq200_paper", here).to_dict()["items"][1]["design"] == 44
    assert ds.compare("mq200_paper", f"{here}#47").to_dict()["items"][1]["design"] == 47


def _with_shifts(root: Path, noise: float) -> tuple[str, list[float]]:
    """Make results whose designs 46 and 44 have shifts that share most of their scatter."""
    folder = kept_folder(root, settings=ONE_LEVEL)
    result = folder.stored_result()
    confirmed = result["confirmation"]
    for design in (confirmed["best"], *confirmed["designs"]):
        for point in design["points"]:  # of Drake alone, as such a study has it
            point.pop("n_planar", None)
    folder.result.write_text(json.dumps(result))
    study, rows = folder.stored_study(), []
    trials = {row["trial"]: row for row in KEPT["trials"]}
    apart = [0.002 + noise * math.sin(7.0 * k) for k in range(16)]
    for trial in (46, 44):
        values = {name: trials[trial][name] for name in study.variables}
        for point in KEPT["confirmation"]["prototype"]["points"]:
            for k in range(16):
                time = 0.06 + 0.02 * math.sin(1.0 + k) + (apart[k] if trial == 44 else 0.0)
                angle = 360.0 / values["count"] * (k + 0.4) / 16
                place = {name: point[name] for name in ("mismatch_rpm", "force_N")}
                seed = study.file.expectation.seed + NEW_ANGLES
                key = f"{trial}-{k}-{place}"
                rows.append(shift(study, values, angle, time, **place, seed=seed, key=key))
    folder.shifts.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return str(folder.root), apart


def test_the_same_angles_are_paired(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here, apart = _with_shifts(tmp_path / "mine", 1e-4)
    folder = kept_folder(tmp_path / "plain")
    rows = [json.loads(line) for line in Path(here, "shifts.jsonl").read_text().splitlines()]

    def journal(path: Path, only_read: bool = False) -> Any:
        """A journal of rows by hand, whose keys are no hashes of their content."""
        found = ShiftJournal(path.with_name("none.jsonl"), only_read)
        found.rows = {row["key"]: row for row in rows}
        return found

    monkeypatch.setattr("dogshape.pipeline.reports.comparison.items.ShiftJournal", journal)
    paired = ds.compare(f"{here}#46", f"{here}#44").to_dict()["differences"][0]
    assert paired["paired"]
    assert paired["expected_shift_time_s"] == pytest.approx(sum(apart) / 16)
    alone = ds.compare("mq200_paper#46", "mq200_paper#44").to_dict()["differences"][0]
    assert paired["standard_error_s"] < 0.1 * alone["standard_error_s"]
    shifts = read_shifts(folder.stored_study(), journal(folder.shifts))
    assert len(shifts.rows) == 2 * 28 * 16


def test_other_physics_are_told(dogshape: Call) -> None:
    said = dogshape("compare", "mq200_paper", "mq200")
    assert said.status == 0
    assert "differ in more than the dog: mechanism: not given against" in said.out
    assert "null" not in said.out


@pytest.mark.parametrize("origin", ["mq200_paper", None])
def test_a_study_that_was_not_searched_has_its_margins_and_a_prediction(
    dogshape: Call, origin: str | None
) -> None:
    by = "compiled engine"
    if origin is None:
        dogshape("init", "study", "--out", "mine", "--set", "dog.height_mm=3.2")
        name = "mine"
    else:
        text = (bundled_root() / origin / "study.toml").read_text()
        name = "mine.toml"
        Path(name).write_text(text.replace("height_mm = 3.7", "height_mm = 3.2"))
    said = dogshape("compare", "mq200_paper", name, "--json")
    own = said.json["items"][1]
    study = load_study(name)
    found = check_design(study)
    assert own["height_mm"] == 3.2
    assert (own["predicted_by"], own["source"]) == (by, f"study, not searched; time by the {by}")
    assert own["expected_shift_time_s"] == pytest.approx(found.time_s)
    assert found.expected is not None
    assert own["standard_error_s"] == pytest.approx(found.expected.error)
    assert own["axial_length_mm"] == pytest.approx(1e3 * study.clutch.dog.axial_length)
    assert said.json["items"][0]["predicted_by"] is None
    (difference,) = said.json["differences"]
    apart = own["expected_shift_time_s"] - said.json["items"][0]["expected_shift_time_s"]
    assert difference["expected_shift_time_s"] == pytest.approx(apart)
    assert f"the time of {name} is that of the {by}" in difference["notes"]


def test_contact_sets(dogshape: Call) -> None:
    said = dogshape("compare", "lubricated_steel", "adams2019", "--json")
    one, two = (CONTACT_SETS[name] for name in ("lubricated_steel", "adams2019"))
    (difference,) = said.json["differences"]
    assert difference["static_friction_ratio"] == two.static_friction / one.static_friction
    assert "0.3 (x 2.5)" in dogshape("compare", "lubricated_steel", "adams2019").out


def test_the_page_of_a_comparison(dogshape: Call) -> None:
    said = dogshape("compare", "mq200_paper#46", "mq200_paper#44", "--html", "side.html")
    assert said.status == 0
    page = Path("side.html").read_text()
    for words in (
        "mq200_paper#44 less mq200_paper#46",
        "249 1/min, 469 N",
        "+0.7 ± 0.2",
        "independent",
    ):
        assert words in page
    assert "http://" not in page
    assert len(page) < 50_000  # without the code of figures


@pytest.mark.parametrize(
    ("items", "words"),
    [
        (("mq200_paper",), "needs two or more"),
        (
            ("mq200_paper", "nowhere"),
            "'nowhere' is no folder of results, no study and no contact set",
        ),
        (("mq200_paper", "adams2019"), "'adams2019' is a contact set and 'mq200_paper' is none"),
        (
            ("mq200_paper#46", "mq200_paper#99"),
            "has no design 99; it has the designs 0 (prototype) to 47",
        ),
        (("mq200_paper#46", "mq200_paper#x"), "must end in the number of a design"),
    ],
)
def test_what_cannot_be_compared_is_refused(
    dogshape: Call, items: tuple[str, ...], words: str
) -> None:
    said = dogshape("compare", *items)
    assert said.status == 2
    assert words in said.sentence


def test_from_python() -> None:
    found = ds.compare("mq200_paper#46", "mq200_paper#44")
    assert list(found.to_frame().index) == ["mq200_paper#46", "mq200_paper#44"]
    assert "58.9 ± 0.1 ms" in repr(found)
