"""The results that studies/ keeps: of the studies as they are, and found again when simulated."""

from __future__ import annotations

import json
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import Setup, bundled_studies, load_study
from dogshape.pipeline.search.confirmation import new_angles
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, design_blocks, expectation_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root


def _kept(name: str) -> dict[str, Any]:
    result: dict[str, Any] = json.loads((bundled_root() / name / "result.json").read_text("utf-8"))
    return result


@pytest.mark.parametrize("name", bundled_studies())
def test_kept_result_is_of_the_study_as_it_is(name: str) -> None:
    study, result = load_study(name).working, _kept(name)
    assert result["physics_hash"] == study.physics_hash
    assert result["objectives"] == list(study.file.search.objectives)
    assert len(result["trials"]) == study.file.search.trials
    operated = study.operated({key: _chosen(result)[key] for key in study.variables})
    points = {(round(p.mismatch / RPM, 6), round(p.profile.force, 6)) for p in operated.points}
    confirmed = result["confirmation"]["best"]["points"]
    assert {(round(p["mismatch_rpm"], 6), round(p["force_N"], 6)) for p in confirmed} == points


@pytest.mark.parametrize("name", bundled_studies())
def test_kept_margins_are_those_of_today(name: str) -> None:
    study, result = load_study(name), _kept(name)
    row = _chosen(result)
    design = design_of(study, {key: row[key] for key in study.variables})
    kept = {check["name"]: check["margin"] for check in result["confirmation"]["best"]["checks"]}
    assert design.feasible
    for check in design.checks:
        assert check.margin == pytest.approx(kept[check.name], abs=1e-9), check.name


@pytest.mark.parametrize("name", bundled_studies())
def test_kept_times_are_simulated_again(name: str) -> None:
    """Where single angles matter least, so that no machine's rounding does."""
    study, result = load_study(name), _kept(name)
    row, points = _chosen(result), result["confirmation"]["best"]["points"]
    place = min(range(len(points)), key=lambda k: points[k]["sd_s"] / points[k]["mean_s"])
    assert _mean_at(study, row, place) == pytest.approx(points[place]["mean_s"], rel=1e-4)


def _chosen(result: dict[str, Any]) -> dict[str, Any]:
    chosen = result["confirmation"]["chosen"]
    row: dict[str, Any] = next(row for row in result["trials"] if row["trial"] == chosen)
    return row


def _mean_at(study: Setup, row: dict[str, Any], place: int) -> float:
    working, params = study.working, {key: row[key] for key in study.variables}
    seed = study.file.expectation.seed + NEW_ANGLES
    block = design_blocks(working, params, new_angles(working), seed)[place]
    rows = scratch_executor(1).run([block])
    return expectation_of(working, [block.point], rows).mean
