"""The table of alternatives, records of its designs, and doubts about margins."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.data_sheet import searched_record
from dogshape.pipeline.reports.study_page import alternatives_table, write_report
from dogshape.sim.strength.locking import locking_checks, locking_friction
from dogshape.sim.versions import bundled_root
from tests.kept import kept_folder, let_land_too_hard

Row = dict[str, Any]
TIME = "expected_shift_time_s"


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


def _by_trial(result: Row) -> dict[int, Row]:
    return {one["trial"]: one for one in result["confirmation"]["designs"]}


def test_the_table_has_the_designs_that_were_confirmed(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    table, confirmed = alternatives_table(study, result), result["confirmation"]
    first, *others = sorted(
        (row["trial"] for row in result["front"]),
        key=lambda trial: (trial != confirmed["chosen"], _by_trial(result)[trial][TIME]),
    )
    assert [row[0] for row in table.rows] == [*map(str, (first, *others)), "prototype"]
    chosen, *_, prototype = table.rows
    row, known = (
        dict(zip(table.heads, chosen, strict=True)),
        searched_record(study, result, result["best"]),
    )
    worst = 1e3 * known["worst_against_prototype"]["difference_s"]
    assert row["worst point less prototype, ms"].startswith(f"{worst:+.1f} ± ")
    assert row["locks above friction"].startswith(f"{known['locking_friction']:.3f} (")
    assert prototype[-1].startswith(f"+{1e3 * confirmed['gain_s']:.1f} ± ")
    assert (table.looks[0], table.looks[len(others) + 1]) == ("best", "prototype")


def test_what_fails_or_does_not_engage_is_no_alternative(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    record = json.loads(json.dumps(result))
    fails, stuck = [row["trial"] for row in record["front"]][1:3]
    _by_trial(record)[fails]["checks"][0]["margin"] = -0.01
    points = _by_trial(record)[stuck]["points"]
    points[0]["engaged"] = 0.0
    _by_trial(record)[stuck][TIME] = None
    rows = {row[0]: row for row in alternatives_table(study, record).rows}
    assert str(fails) not in rows
    count = sum(p["n"] for p in points)
    engaged = sum(round(p["engaged"] * p["n"]) for p in points)
    assert f"engages in {engaged} of {count}" in rows[str(stuck)]
    assert rows[str(stuck)][-1] == "-"


def test_worst_points_are_those_of_the_record(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    rows, trial = {row["trial"]: row for row in result["trials"]}, result["front"][1]["trial"]
    points = result["confirmation"]["prototype"]["points"]
    own = _by_trial(result)[trial]["points"]
    losses = [q["mean_s"] - p["mean_s"] for p, q in zip(points, own, strict=True)]
    worst = searched_record(study, result, rows[trial])["worst_against_prototype"]
    assert worst["difference_s"] == pytest.approx(max(losses))
    other = next(t for t in rows if t and t not in _by_trial(result) and rows[t][TIME])
    searched = searched_record(study, result, rows[other])
    assert (searched["confirmed"], searched["worst_against_prototype"]) == (False, None)


def test_page_one_shows_the_table(tmp_path: Path) -> None:
    folder = kept_folder(tmp_path / "mq200_paper")
    first, second, *_ = [row["trial"] for row in folder.stored_result()["front"]]
    let_land_too_hard(folder, second)
    page = write_report(folder).read_text()
    page = page[page.index("<h1>") : page.index('id="front"')]
    for words in (f">{first}</td>", f"{second}: edge pressure impact"):
        assert words in page
    assert f">{second}</td>" not in page
