"""The table that decides: standing of designs, paired differences, and doubts about margins."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.study.alternatives import (
    alternatives,
    landing_scatter,
    margin_doubts,
    reasons,
)
from dogshape.pipeline.reports.study.paired import Difference, overall, paired_points
from dogshape.pipeline.reports.study.single_shifts import place
from dogshape.pipeline.reports.study.standing import difference, standings, worst_point
from dogshape.pipeline.reports.study.study_page import write_report
from dogshape.sim.bundled import bundled_root
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.strength.locking import locking_checks, locking_friction
from tests.kept import kept_folder, let_land_too_hard

Row = dict[str, Any]


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


def _shifts(count: int, times: np.ndarray, start: float = 0.3) -> list[Row]:
    pitch = 360.0 / count
    return [
        {"count": count, "relative_angle_deg": pitch * (k + start) / len(times),
         "mismatch_rpm": 50.0, "force_N": 469.0, "shift_time_s": float(time)}
        for k, time in enumerate(times)
    ]  # fmt: skip


def test_pairs_leave_out_what_both_designs_have_in_common() -> None:
    """Equal scatter cancels: the error of the difference is that of what is left of it."""
    rng = np.random.default_rng(1)
    common, own = rng.normal(0.1, 0.02, 16), rng.normal(0.003, 0.001, 16)
    found = paired_points(_shifts(15, common), _shifts(31, common + own))
    (one,) = found.values()
    assert one.value == pytest.approx(own.mean())
    assert one.error == pytest.approx(math.sqrt(variance_of_mean(own)))
    assert one.paired
    alone = math.sqrt(2.0 * variance_of_mean(common))
    assert one.error < 0.1 * alone


def test_other_angles_and_shifts_that_hung_are_not_paired() -> None:
    times = np.linspace(0.05, 0.06, 6)
    assert paired_points(_shifts(15, times), _shifts(15, times, start=0.4)) == {}
    hung = _shifts(15, times)
    hung[2]["shift_time_s"] = None
    assert paired_points(hung, _shifts(15, times)) == {}


def test_the_error_of_a_paired_difference_is_its_scatter_over_draws() -> None:
    """Of many draws of the start the differences scatter as their error says, within a fifth."""
    rng = np.random.default_rng(2)

    def time(phase: np.ndarray, shift: float) -> np.ndarray:
        return 0.1 + 0.05 * ((phase + shift) % 1.0)

    values, errors = [], []
    for _ in range(400):
        start = rng.random()
        phase = (np.arange(16) + start) / 16
        pair = [_shifts(15, time(phase, s), start) for s in (0.0, 0.37)]
        (one,) = paired_points(*pair).values()
        values.append(one.value)
        errors.append(one.error)
    assert np.mean(values) == pytest.approx(0.0, abs=3e-4)
    ratio = np.sqrt(np.mean(np.square(errors))) / np.std(values)
    assert 0.8 < ratio < 2.0  # the estimator's own range, sim.statistics.expectation


def test_points_are_weighed() -> None:
    points = {
        place(50, 469): Difference(0.01, 0.003, True),
        place(5, 469): Difference(0.0, 0.004, False),
    }
    found = overall(points, {place(50, 469): 3.0, place(5, 469): 1.0})
    assert found.value == pytest.approx(0.0075)
    assert found.error == pytest.approx(math.hypot(0.75 * 0.003, 0.25 * 0.004))
    assert not found.paired


def test_the_table_has_what_another_engineer_would_take(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    listed = alternatives(study, result, None)
    assert [one.standing.trial for one in listed] == [43, 21, 45, 46, 0]
    chosen, steep, _, short, prototype = listed
    assert chosen.worst is not None
    assert chosen.worst[1].value > 0.0
    assert steep.worst is None
    assert chosen.standing.friction[0] == pytest.approx(math.tan(math.radians(6.95429)), rel=1e-4)
    assert short.standing.length_mm == min(row["axial_length_mm"] for row in result["front"])
    assert prototype.cost is not None
    assert prototype.cost.value == pytest.approx(result["confirmation"]["gain_s"])
    assert prototype.cost.error == pytest.approx(result["confirmation"]["gain_standard_error_s"])
    first, second, _ = reasons(listed)
    for words in ("Design 21, for 7.7 ± 0.1 ms more", "0.196 instead of 0.122", "2.25 mm shorter"):
        assert words in first
    assert second.endswith("it was not simulated at the new angles.")
    with_44 = alternatives(study, result, None, decided=44)
    assert 44 in [one.standing.trial for one in with_44]


def test_a_design_that_loses_less_at_its_worst_point_is_in_the_table(
    kept: tuple[Setup, Row],
) -> None:
    """As the one that locks latest would be, had it been confirmed without a slow point."""
    study, result = kept
    record = json.loads(json.dumps(result))
    confirmation = record["confirmation"]
    steady = json.loads(json.dumps(confirmation["best"])) | {"trial": 21}
    for own, old in zip(steady["points"], confirmation["prototype"]["points"], strict=True):
        own["mean_s"] = min(own["mean_s"], old["mean_s"] + 0.002)
    confirmation["designs"].append(steady)
    listed = alternatives(study, record, None)
    assert [one.standing.trial for one in listed] == [43, 21, 45, 46, 0]
    assert listed[1].worst is not None
    assert listed[1].worst[1].value == pytest.approx(0.002)
    first = reasons(listed)[0]
    assert "at its worst point it is 2.0 ms slower than the prototype" in first
    assert "where design 43 is 25.7 ms slower" in first
    assert "simulated at the new angles" not in first


def test_worst_points_are_those_of_the_record(kept: tuple[Setup, Row]) -> None:
    study, result = kept
    found = standings(study, result)
    worst = worst_point(found[0], found[44])
    assert worst is not None
    losses = [
        q["mean_s"] - p["mean_s"] for p, q in zip(found[0].points, found[44].points, strict=True)
    ]
    assert worst[1].value == pytest.approx(max(losses))
    unconfirmed = difference(study, found[43], found[21])
    assert unconfirmed is not None
    assert not unconfirmed.paired


def test_margins_within_their_scatter_are_said(kept: tuple[Setup, Row]) -> None:
    _, result = kept
    (parts,) = margin_doubts(result)
    assert "1.1 %, is within the scatter of parts" in parts
    close = json.loads(json.dumps(result))
    for check in close["confirmation"]["best"]["checks"]:
        if check["name"] == "edge_pressure_impact":
            check["margin"] = 0.001
    landing, _ = margin_doubts(close)
    assert "0.1 % (edge pressure impact), is within its own scatter" in landing
    wide = json.loads(json.dumps(result))
    for check in wide["confirmation"]["best"]["checks"]:
        check["margin"] = max(check["margin"], 0.5)
    wide["best"]["margin_root_sum_square"] = 0.1
    assert margin_doubts(wide) == []


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
    let_land_too_hard(folder, 42, 30)
    page = write_report(folder).read_text()
    first = page[page.index("<h1>") : page.index('id="front"')]
    for words in (
        "what another engineer would take", "design 21", "25.7 ± 0.4 slower at 249 1/min, 315.5 N",
        "Design 21, for 7.7 ± 0.1 ms more", "is within the scatter of parts", "0.122 (traction)",
    ):  # fmt: skip
        assert words in first
    out = first.index("are out: they fail")
    assert first.rfind('<p class="note">', 0, out) > first.rfind("<li", 0, out)


def test_no_design_no_table(result: Row) -> None:
    study = load_study("mq200_paper")
    assert alternatives(study, {**result, "best": None}, None) == []
    assert alternatives(study, {**result, "confirmation": None}, None) == []
