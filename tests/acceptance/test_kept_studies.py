"""The results that studies/ keeps: of the studies as they are, and found again when simulated."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import VARIABLES, Setup, bundled_studies, load_study
from dogshape.pipeline.search.confirmation import new_angles
from dogshape.pipeline.search.study_record import DesignRow, StudyRecord
from dogshape.pipeline.simulate import evaluation
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.sim.clutch_tables import validate
from dogshape.sim.units import RPM
from tests.search_results import bundled_result

Kept = tuple[Setup, dict[str, Any], DesignRow]


@pytest.fixture(scope="module", params=bundled_studies())
def kept(request: pytest.FixtureRequest) -> Kept:
    """A study as it is, its kept result and the row of its chosen design."""
    result = bundled_result(request.param)
    chosen = result["confirmation"]["chosen"]
    row = next(DesignRow(**row) for row in result["trials"] if row["trial"] == chosen)
    return load_study(request.param), result, row


def test_kept_result_is_of_the_study_as_it_is(kept: Kept) -> None:
    study, result, row = kept
    record = validate(StudyRecord, result, study.name)
    assert json.dumps(record.to_dict()) == json.dumps(result)  # as the file is written
    assert result["config_hash"] == study.config_hash
    assert result["physics_hash"] == study.search_setup.physics_hash
    assert result["objectives"] == list(study.file.search.objectives)
    assert len(result["trials"]) == study.file.search.trials
    operated = study.search_setup.with_design(row.params(study.variables))
    points = {(round(p.mismatch / RPM, 6), round(p.profile.force, 6)) for p in operated.points}
    confirmed = result["confirmation"]["best"]["points"]
    assert {(round(p["mismatch_rpm"], 6), round(p["force_N"], 6)) for p in confirmed} == points


def test_kept_result_is_read_by_the_name_of_its_study(kept: Kept) -> None:
    study, result, row = kept
    read = ds.load_result(study.name)
    assert read.best is not None
    assert read.best.trial == row.trial
    assert len(read.to_frame()) == len(result["trials"])
    assert str(row.trial) in read._repr_html_()
    assert len(read.plot().data) > 1
    with pytest.raises(ds.DogshapeError, match=r"there is no study\.json"):
        read.report()


def test_kept_margins_are_those_of_today(kept: Kept) -> None:
    study, result, row = kept
    design = design_of(study, row.params(study.variables))
    margins = {one["name"]: one["margin"] for one in result["confirmation"]["best"]["checks"]}
    assert design.feasible
    for check in design.checks:
        assert check.margin == pytest.approx(margins[check.name], abs=1e-9), check.name


def test_kept_times_are_simulated_again(kept: Kept) -> None:
    """Where single angles matter least, within the error of most shifts at the default steps."""
    study, result, row = kept
    points = result["confirmation"]["best"]["points"]
    place = min(range(len(points)), key=lambda k: points[k]["sd_s"] / points[k]["mean_s"])
    seed = study.file.expectation.seed + evaluation.NEW_ANGLES
    params = row.params(study.variables)
    base, angles = new_angles(study.search_setup), points[place]["n"]  # more where hangs decided
    design = evaluation.OperatedDesign.of(study.search_setup, params)
    block = design.blocks(angles, seed, base)[place]
    rows = scratch_executor(1).run([block])
    (found,) = evaluation.expectation_of(study.search_setup, [block.point], rows).points
    assert found.unaided_mean == pytest.approx(points[place]["mean_engaged_s"], rel=1e-4)


KEPT = bundled_result()


def test_best_design_beats_the_prototype_by_many_standard_errors() -> None:
    """All 28 operating points, six angles that neither search nor confirmation used."""
    study = load_study("mq200_paper")
    best_design = {key: KEPT["best"][key] for key in VARIABLES}
    design = design_of(study, best_design)
    assert design.feasible
    assert design.dog is not None
    both = evaluation.evaluate(study, [{}, best_design], scratch_executor(), 6, seed=20_000)
    prototype, best = (found.expectation for found in both)
    gain = prototype.mean - best.mean
    assert prototype.engaged == best.engaged == 1.0
    assert gain > 5.0 * math.hypot(prototype.standard_error, best.standard_error)
    assert gain / prototype.mean == pytest.approx(KEPT["confirmation"]["gain_share"], abs=0.04)
    # What the surrogate of the package says of both, none of which it was fitted to.
    known, _ = stored_surrogate(study, None)
    for params, found in ((study.prototype, prototype), (best_design, best)):
        x = np.array([params[name] for name in study.variables], dtype=float)
        answer = known.surrogate.expect(x, study_mix(study))
        time, error = answer.without_retries
        within = 2.5 * math.hypot(error, found.engaged_error)
        assert abs(time - found.engaged_mean) < within
        # It tells: what it leaves open is small against what there is to gain. The best design
        # lies at the border of what can be made, where the surrogate is least sure.
        assert within < 0.25 * gain
