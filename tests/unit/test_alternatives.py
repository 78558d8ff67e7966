"""The table of alternatives, records of its designs, and doubts about margins."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.study.alternatives import HEAD, alternatives, cells_of
from dogshape.pipeline.reports.study.design_record import difference, searched_record
from dogshape.pipeline.reports.study.study_page import write_report
from dogshape.pipeline.reports.study.summary import facts_of, landing_scatter
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


@pytest.mark.parametrize("spline", [0.0, 0.06])
@pytest.mark.parametrize("angles", [(8.0, 12.0, 22.0), (20.0, 7.0, 24.0), (15.0, 25.0, 9.0)])
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
    listed = alternatives(study, result)
    assert [one["design"] for one in listed] == [*FRONT, 0]
    assert all(one["confirmed"] for one in listed)
    chosen, *_, prototype = listed
    assert chosen["worst_against_prototype"]["difference_s"] > 0.0
    assert chosen["locking_friction"] == pytest.approx(math.tan(math.radians(6.89823)), rel=1e-4)
    cost = difference(chosen, prototype)
    assert cost is not None
    assert cost[0] == pytest.approx(result["confirmation"]["gain_s"])
    assert cost[1] == pytest.approx(result["confirmation"]["gain_standard_error_s"])
    assert all(len(cells_of(one, chosen)) == len(HEAD) for one in listed)
    cells = cells_of(chosen, chosen)
    assert cells[4:6] == ("\N{MINUS SIGN}13 % root fatigue", "0.121 (traction)")


def test_a_design_that_fails_at_the_new_angles_is_no_alternative(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    record = json.loads(json.dumps(result))
    for one in record["confirmation"]["designs"]:
        if one["trial"] == 47:
            one["checks"][0]["margin"] = -0.01
    left = [one["design"] for one in alternatives(study, record)]
    assert left == [*(number for number in FRONT if number != 47), 0]


def test_a_design_that_does_not_engage_has_neither_time_nor_cost(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    record = json.loads(json.dumps(result))
    one = next(d for d in record["confirmation"]["designs"] if d["trial"] == 44)
    one["points"][0]["engaged"] = 0.0
    listed = alternatives(study, record)
    last = next(one for one in listed if one["design"] == 44)
    cells = cells_of(last, listed[0])
    assert cells[1:3] == ("engages in 432 of 448", "-")
    assert (cells[-1], last["gain_s"]) == ("-", None)


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


def test_margins_within_their_scatter_are_said(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    landing = "hardest landing at the new angles"

    def bad(record: Row) -> dict[str, bool]:
        return {one.name: one.bad for one in facts_of(study, record)}

    assert not bad(result)[landing]
    assert bad(result)["by root sum of squares of the tolerances"]
    close = json.loads(json.dumps(result))
    for check in close["confirmation"]["best"]["checks"]:
        if check["name"] == "edge_pressure_impact":
            check["margin"] = 0.0001
    assert bad(close)[landing]
    close["best"]["margin_root_sum_square"] = 0.1
    assert not bad(close)["by root sum of squares of the tolerances"]


def test_scatter_of_the_landing_leaves_out_what_moves_all(kept: tuple[Setup, Row]) -> None:
    _, result = kept
    name = "edge_pressure_impact"
    before = landing_scatter(result, name)
    assert before is not None
    harder = json.loads(json.dumps(result))
    for one in harder["confirmation"]["designs"]:
        for check in one["checks"]:
            if check["name"] == name:
                check["margin"] = 1.0 - 1.2 * (1.0 - check["margin"])
    assert landing_scatter(harder, name) == pytest.approx(before)
    few = json.loads(json.dumps(result))
    del few["confirmation"]["designs"][2:]
    assert landing_scatter(few, name) is None


def test_page_one_shows_the_table(tmp_path: Path) -> None:
    folder = kept_folder(tmp_path / "mq200_paper")
    let_land_too_hard(folder, 47, 34)
    page = write_report(folder).read_text()
    first = page[page.index("<h1>") : page.index('id="front"')]
    for words in (
        "design 44", "27.8 ± 0.3 slower at 249 1/min, 315.5 N", "0.121 (traction)",
        "by root sum of squares", "designs out, failed at the new angles",
    ):  # fmt: skip
        assert words in first
    assert "design 47" not in first


@pytest.mark.parametrize("name", ["mq200", "mq200_paper", "mq200_robust", "mq200_actuation"])
def test_no_page_names_a_sum_of_margins_as_what_limits(name: str, tmp_path: Path) -> None:
    """A check is behind every margin of the first page, also of results kept without its name."""
    folder = kept_folder(tmp_path / name, name)
    page = write_report(folder).read_text()
    first = page[page.index("<h1>") : page.index('id="front"')]
    assert "smallest margin worst" not in page
    assert "smallest margin at worst-case" not in first
    assert re.search(r"at worst-case tolerances</th><td[^>]*>\S+ % (?!smallest)[a-z]+", first)


def test_no_design_no_table(result: Row) -> None:
    study = load_study("mq200_paper")
    assert alternatives(study, {**result, "best": None}) == []
    assert alternatives(study, {**result, "confirmation": None}) == []
