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

Kept = tuple[Setup, dict[str, Any], dict[str, Any]]


@pytest.fixture(scope="module", params=bundled_studies())
def kept(request: pytest.FixtureRequest) -> Kept:
    """A study as it is, its kept result and the row of its chosen design."""
    path = bundled_root() / request.param / "result.json"
    result = json.loads(path.read_text("utf-8"))
    chosen = result["confirmation"]["chosen"]
    row = next(row for row in result["trials"] if row["trial"] == chosen)
    return load_study(request.param), result, row


def test_kept_result_is_of_the_study_as_it_is(kept: Kept) -> None:
    study, result, row = kept
    assert result["physics_hash"] == study.working.physics_hash
    assert result["objectives"] == list(study.file.search.objectives)
    assert len(result["trials"]) == study.file.search.trials
    operated = study.working.operated({key: row[key] for key in study.variables})
    points = {(round(p.mismatch / RPM, 6), round(p.profile.force, 6)) for p in operated.points}
    confirmed = result["confirmation"]["best"]["points"]
    assert {(round(p["mismatch_rpm"], 6), round(p["force_N"], 6)) for p in confirmed} == points


def test_kept_margins_are_those_of_today(kept: Kept) -> None:
    study, result, row = kept
    design = design_of(study, {key: row[key] for key in study.variables})
    margins = {one["name"]: one["margin"] for one in result["confirmation"]["best"]["checks"]}
    assert design.feasible
    for check in design.checks:
        assert check.margin == pytest.approx(margins[check.name], abs=1e-9), check.name


def test_kept_times_are_simulated_again(kept: Kept) -> None:
    """Where single angles matter least, so that no machine's rounding does."""
    study, result, row = kept
    points = result["confirmation"]["best"]["points"]
    place = min(range(len(points)), key=lambda k: points[k]["sd_s"] / points[k]["mean_s"])
    seed = study.file.expectation.seed + NEW_ANGLES
    params = {key: row[key] for key in study.variables}
    block = design_blocks(study.working, params, new_angles(study.working), seed)[place]
    rows = scratch_executor(1).run([block])
    mean = expectation_of(study.working, [block.point], rows).mean
    assert mean == pytest.approx(points[place]["mean_s"], rel=1e-4)
