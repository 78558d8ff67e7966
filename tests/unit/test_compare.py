"""``compare``: designs, studies and contact sets, a column each."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

import dogshape as ds
from dogshape.check import check_design
from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.shift.contact import CONTACT_SETS
from dogshape.sim.versions import bundled_root
from tests.conftest import Said
from tests.kept import kept_folder

Call = Callable[..., Said]
KEPT = json.loads((bundled_root() / "mq200_paper/result.json").read_text())


def test_designs_of_a_kept_result(dogshape: Call) -> None:
    names = ["mq200_paper#0", "mq200_paper#46", "mq200_paper#44"]
    said = dogshape("compare", *names, "--json")
    assert said.status == 0
    own, chosen, other = said.json["items"]
    assert [item["label"] for item in (own, chosen, other)] == names
    confirmed = KEPT["confirmation"]
    assert chosen["gain_s"] == pytest.approx(confirmed["gain_s"])
    assert chosen["difference_s"] == pytest.approx(-confirmed["gain_s"])
    assert chosen["difference_standard_error_s"] == pytest.approx(
        confirmed["gain_standard_error_s"]
    )
    assert (own["difference_s"], own["gain_s"], own["settings"]) == (None, None, {})
    assert chosen["expected_shift_time_s"] == confirmed["best"]["expected_shift_time_s"]
    worst = chosen["worst_against_prototype"]
    assert (worst["mismatch_rpm"], worst["force_N"]) == (249.0, 315.5)
    assert worst["difference_s"] == pytest.approx(0.0278, abs=1e-4)
    means = [point["mean_s"] for point in confirmed["best"]["points"]]
    assert chosen["slowest_point"]["mean_s"] == max(means)
    assert chosen["locking_friction"] == pytest.approx(0.12098, abs=1e-5)


def test_margins_at_worst_case_tolerances_have_the_check_behind_them(dogshape: Call) -> None:
    """Also of a study that bounds that margin, and of its own dog."""
    record = dogshape("compare", "mq200#34", "mq200#33", "mq200#0", "--json").json
    found = [(i["weakest_check_worst_case"], i["margin_worst_case"]) for i in record["items"]]
    assert [name for name, _ in found] == ["root_fatigue", "contact_ratio", "root_fatigue"]
    assert found[0][1] == pytest.approx(0.00565, abs=1e-5)
    assert "smallest_margin_worst" not in [item["weakest_check"] for item in record["items"]]


def test_a_design_that_does_not_engage_has_counts_and_no_time(tmp_path: Path) -> None:
    folder = kept_folder(tmp_path / "mine")
    result = folder.stored_result()
    for one in (result["confirmation"]["best"], *result["confirmation"]["designs"][:1]):
        one["points"][0]["engaged"] = 0.25
    folder.result.write_text(json.dumps(result))
    item = ds.compare(f"{folder.root}#44", f"{folder.root}#46").to_dict()["items"][1]
    assert (item["expected_shift_time_s"], item["shifts_engaged"]) == (None, [436, 448])
    assert (item["difference_s"], item["gain_s"]) == (None, None)


def test_a_study_without_a_number_is_its_chosen_design(tmp_path: Path) -> None:
    here = str(kept_folder(tmp_path / "mine").root)
    assert ds.compare("mq200_paper", here).to_dict()["items"][1]["design"] == 46
    assert ds.compare("mq200_paper", f"{here}#47").to_dict()["items"][1]["design"] == 47


def test_keys_of_the_study_files_that_differ_are_rows(dogshape: Call) -> None:
    said = dogshape("compare", "mq200_paper", "mq200")
    assert said.status == 0
    assert "mechanism.spline_friction" in said.out
    assert "null" not in said.out
    one, other = dogshape("compare", "mq200_paper", "mq200", "--json").json["items"]
    assert (one["settings"]["load.accuracy"], other["settings"]["load.accuracy"]) == (None, 6)


def test_times_of_other_operating_points_have_no_difference(dogshape: Call, tmp_path: Path) -> None:
    text = (bundled_root() / "mq200_paper" / "study.toml").read_text()
    other = tmp_path / "other.toml"
    other.write_text(text.replace("mismatch_rpm = [", "mismatch_rpm = [7.0, "))
    first, second = dogshape("compare", "mq200_paper", other, "--json").json["items"]
    assert second["operating_points"] > first["operating_points"]
    assert second["difference_s"] is None


@pytest.mark.parametrize("origin", ["mq200_paper", None])
def test_a_study_that_was_not_searched_is_checked(dogshape: Call, origin: str | None) -> None:
    if origin is None:
        dogshape("init", "study", "--out", "mine", "--set", "dog.height_mm=3.2")
        name = "mine"
    else:
        text = (bundled_root() / origin / "study.toml").read_text()
        name = "mine.toml"
        Path(name).write_text(text.replace("height_mm = 3.7", "height_mm = 3.2"))
    kept, own = dogshape("compare", "mq200_paper", name, "--json").json["items"]
    study = load_study(name)
    found = check_design(study)
    assert found.expected is not None
    assert own["height_mm"] == 3.2
    assert (kept["source"], own["source"]) == ("new angles", "compiled engine")
    assert own["expected_shift_time_s"] == pytest.approx(found.time_s)
    assert own["standard_error_s"] == pytest.approx(found.expected.error)
    assert own["axial_length_mm"] == pytest.approx(1e3 * study.clutch.dog.axial_length)
    apart = own["expected_shift_time_s"] - kept["expected_shift_time_s"]
    error = math.hypot(own["standard_error_s"], kept["standard_error_s"])
    found_difference = own["difference_s"], own["difference_standard_error_s"]
    assert found_difference == (pytest.approx(apart), pytest.approx(error))


def test_contact_sets(dogshape: Call) -> None:
    said = dogshape("compare", "lubricated_steel", "adams2019", "--json")
    assert said.json["kind"] == "contact_sets"
    for item in said.json["items"]:
        assert item["static_friction"] == CONTACT_SETS[item["label"]].static_friction
    assert "static_friction" in dogshape("compare", "lubricated_steel", "adams2019").out


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
    frame = found.to_frame()
    assert list(frame.columns) == ["mq200_paper#46", "mq200_paper#44"]
    assert frame.loc["margins.root_fatigue", "mq200_paper#46"] == pytest.approx(0.02012, abs=1e-5)
    assert "58.9 ± 0.1 ms" in repr(found)
