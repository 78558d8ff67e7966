"""The table of alternatives, records of its designs, and doubts about margins."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.data_sheet import searched_record
from dogshape.pipeline.reports.study_page import write_report
from dogshape.pipeline.reports.study_summary import alternatives_table
from dogshape.sim.strength.locking import locking_checks, locking_friction
from dogshape.sim.versions import bundled_root
from tests.kept import kept_folder, let_land_too_hard

Row = dict[str, Any]

#: Trials of the front of ``mq200_paper``, quickest first by the search.
FRONT = [46, 36, 44, 47, 37, 45, 34, 26, 38, 43, 25, 30, 40]


@pytest.fixture(scope="module")
def kept() -> tuple[Setup, Row]:
    """The default study with its kept result."""
    return load_study("mq200_paper"), json.loads(
        (bundled_root() / "mq200_paper/result.json").read_text()
    )


@pytest.mark.parametrize(
    ("angles", "spline"),
    [((8.0, 12.0, 22.0), 0.0), ((20.0, 7.0, 24.0), 0.06), ((15.0, 25.0, 9.0), 0.06)],
)
def test_a_surface_locks_just_above_its_friction(
    angles: tuple[float, float, float], spline: float
) -> None:
    """The checks of release pass a thousandth below, and the named one fails a thousandth above."""
    names = ("chamfer_deg", "traction_deg", "braking_deg")
    study = load_study("mq200_paper", [f"dog.{n}={v}" for n, v in zip(names, angles, strict=True)])
    dog = study.clutch.dog
    load = replace(study.limits.load, spline_friction=spline)
    friction, name = locking_friction(dog, load)

    def failed(factor: float) -> list[str]:
        checks = locking_checks(dog, replace(load, friction_release=factor * friction))
        return [c.name for c in checks if c.name.endswith("_release") and not c.passed]

    assert failed(0.999) == []
    assert failed(1.001) == [name]


def test_the_table_has_the_designs_that_were_confirmed(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    table = alternatives_table(study, result)
    first, *others = FRONT
    names = [*map(str, (first, *others)), "prototype"]
    assert [row[0] for row in table.rows] == names
    chosen, *_, prototype = table.rows
    row = dict(zip(table.heads, chosen, strict=True))
    assert row["worst point less prototype, ms"].startswith("+27.8 ± ")
    assert row["at worst-case tolerances"] == "\N{MINUS SIGN}13 % root fatigue"
    assert row["locks above friction"] == "0.121 (traction)"
    gain = result["confirmation"]["gain_s"]
    assert prototype[-1].startswith(f"+{1e3 * gain:.1f} ± ")
    assert (table.looks[0], table.looks[len(FRONT)]) == ("best", "prototype")


def test_what_fails_or_does_not_engage_is_no_alternative(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    record = json.loads(json.dumps(result))
    designs = {one["trial"]: one for one in record["confirmation"]["designs"]}
    designs[47]["checks"][0]["margin"] = -0.01
    designs[44]["points"][0]["engaged"] = 0.0
    rows = {row[0]: row for row in alternatives_table(study, record).rows}
    assert "47" not in rows
    assert "engages in 432 of 448" in rows["44"]
    assert rows["44"][-1] == "-"


def test_worst_points_are_those_of_the_record(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    rows = {row["trial"]: row for row in result["trials"]}
    points = result["confirmation"]["prototype"]["points"]
    (own,) = (d for d in result["confirmation"]["designs"] if d["trial"] == 44)
    losses = [q["mean_s"] - p["mean_s"] for p, q in zip(points, own["points"], strict=True)]
    worst = searched_record(study, result, rows[44])["worst_against_prototype"]
    assert worst["difference_s"] == pytest.approx(max(losses))
    searched = searched_record(study, result, rows[21])
    assert (searched["confirmed"], searched["worst_against_prototype"]) == (False, None)


def test_page_one_shows_the_table(tmp_path: Path) -> None:
    folder = kept_folder(tmp_path / "mq200_paper")
    let_land_too_hard(folder, 47, 34)
    page = write_report(folder).read_text()
    first = page[page.index("<h1>") : page.index('id="front"')]
    for words in (">44</td>", "0.121 (traction)", "designs out, failed at the new angles"):
        assert words in first
    assert ">47</td>" not in first
