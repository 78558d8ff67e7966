"""Set-point of the mismatch, level and rise of the shift force as variables of a search."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.sampler import Space
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.errors import InputError
from dogshape.sim.units import RPM

SPREAD = "operating={mismatch_rpm={distribution='normal',mean=40,sd=10}, force_N=[300], samples=16}"
SEARCHED = (
    "variables.mismatch_set_rpm=[-100, 100]",
    "variables.force_factor=[0.8, 2.0]",
    "variables.rise_factor=[0.5, 1.5]",
)


def _study(*more: str) -> Setup:
    return load_study("mq200_paper", [SPREAD, *SEARCHED, "search.sampler='space_filling'", *more])


def _mismatches(study: Setup) -> np.ndarray:
    return np.array([point.mismatch / RPM for point in study.points])


@pytest.mark.parametrize("target", [-70.0, 0.0, 25.0])
def test_the_set_point_is_the_mean_and_the_spread_stays(target: float) -> None:
    study = _study()
    moved = _mismatches(study.operated({"mismatch_set_rpm": target}))
    assert moved.mean() == pytest.approx(target, abs=1e-5)
    own = _mismatches(study)
    assert moved - moved.mean() == pytest.approx(own - own.mean(), abs=1e-9)


def test_the_force_takes_the_rise_time_of_the_table() -> None:
    study = _study()
    (profile, *_) = [p.profile for p in study.operated({"force_factor": 469.0 / 300.0}).points]
    assert (profile.force, profile.rise) == (pytest.approx(469.0), pytest.approx(0.1766))
    (slow, *_) = [p.profile for p in study.operated({"rise_factor": 1.5}).points]
    assert slow.force == 300.0
    assert slow.rise == pytest.approx(1.5 * study.points[0].profile.rise)


def test_a_study_is_operated_as_it_says() -> None:
    study = _study()
    assert study.operated(study.prototype).points == study.points
    assert study.operated({"chamfer_deg": 9.0}) is study
    assert study.shape_keys == ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")
    trial = Space(study.variables).trial(study.prototype)
    assert [*trial.params][-3:] == [*OPERATED]
    assert study.dog_with(study.prototype) == study.clutch.dog
    # What a shift depends on is known by its operating point: variables of it change no hash.
    assert study.physics_hash == load_study("mq200_paper").physics_hash


def test_shifts_are_those_of_the_operation() -> None:
    """A design that is operated otherwise is simulated as a study of that operation is."""
    moved = {"mismatch_set_rpm": -30.0, "force_factor": 1.5}
    study = _study("solver.engine='planar'")
    named = [
        {"mismatch_rpm": p.mismatch / RPM, "force_N": p.profile.force}
        for p in study.operated(moved).points
    ]
    other = load_study("mq200_paper", {"operating": {"points": named}, "solver.engine": "planar"})
    times = []
    for one, params in ((study, moved), (other, {})):
        (found,) = evaluate(one, [params], scratch_executor(), 3, 1)
        times.append([p.mean for p in found.expectation.points])
    assert times[0] == pytest.approx(times[1], rel=1e-6)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("variables.force_factor=[0.5, 2.0]", "shift force is 150 N, but the rise times"),
        ("variables.force_factor=[-1, 2.0]", "variables.force_factor is -1, but it must lie"),
        ("variables.mismatch_set_rpm=[3, 1]", "the first must be below the second"),
        ("variables.force_facter=[1, 2]", "did you mean 'variables.force_factor'"),
    ],
)
def test_ranges_that_no_shift_has_are_refused(more: str, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        _study(more)
    assert sentence in str(refused.value)
