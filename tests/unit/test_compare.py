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
from dogshape.sim.versions import bundled_root
from tests.conftest import Said

Call = Callable[..., Said]
KEPT = json.loads((bundled_root() / "mq200_paper/result.json").read_text())
CHOSEN, OTHER = (row["trial"] for row in KEPT["front"][:2])
PAIR = (f"mq200_paper#{CHOSEN}", f"mq200_paper#{OTHER}")


def test_designs_of_a_kept_result(dogshape: Call) -> None:
    names = ["mq200_paper#0", *PAIR]
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
    means = [point["mean_s"] for point in confirmed["best"]["points"]]
    assert chosen["slowest_point"]["mean_s"] == max(means)
    frame, margin = ds.compare(*names).to_frame(), confirmed["best"]["checks"][0]
    assert list(frame.columns) == names
    assert frame.loc[f"margins.{margin['name']}", PAIR[0]] == pytest.approx(margin["margin"])


def test_margins_at_worst_case_tolerances_have_the_check_behind_them() -> None:
    """Also of a study that bounds that margin."""
    rows = json.loads((bundled_root() / "mq200/result.json").read_text())["front"][:2]
    items = ds.compare(*(f"mq200#{row['trial']}" for row in rows)).items
    for key in ("weakest_check_worst_case", "margin_worst_case"):
        assert [item[key] for item in items[:2]] == [row[key] for row in rows]
    assert "smallest_margin_worst" not in [item["weakest_check"] for item in items]


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


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ("mq200_paper", "needs two or more"),
        ("mq200_paper nowhere", "'nowhere' is no folder of results, no study and no contact set"),
        ("mq200_paper adams2019", "'adams2019' is a contact set and 'mq200_paper' is none"),
        ("mq200_paper#0 mq200_paper#99", "has the designs 0 (prototype) to 47"),
        ("mq200_paper#0 mq200_paper#x", "must end in the number of a design"),
    ],
)
def test_what_cannot_be_compared_is_refused(dogshape: Call, items: str, words: str) -> None:
    said = dogshape("compare", *items.split())
    assert said.status == 2
    assert words in said.sentence
