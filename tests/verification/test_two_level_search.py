"""Times of a search in two levels against dense Drake."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.evaluation import Simulated, evaluate, in_two_levels, screen
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.simulate.level_times import LevelTimes, common_squares
from dogshape.pipeline.simulate.point_plans import whole_plan
from tests.conftest import SMALL

MANY, FEW = 32, 2


@pytest.fixture(scope="module")
def study() -> Setup:
    """Two operating points with uncertain friction, as the default study has it."""
    friction = "{distribution='triangular', low=0.8, mode=1.0, high=1.3}"
    return load_study(
        "mq200_paper",
        [*SMALL, "search.levels=2", f"search.screen_angles={MANY}",
         f"uncertain.friction_factor={friction}"],
    )  # fmt: skip


@pytest.fixture(scope="module")
def dense(study: Setup) -> tuple[Simulated, Simulated]:
    """Drake at every angle that the compiled engine has, alone and in two levels."""
    executor, dog = scratch_executor(1), study.clutch.dog
    (quick,) = screen(study, [dog], executor, 1, angles=MANY, base=FEW)
    (alone,) = evaluate(study, [dog], executor, [whole_plan(study, MANY)], 1, base=FEW)
    assert quick is not None
    (both,) = in_two_levels(study, [quick], [alone], 1, FEW)
    return alone, both


def test_a_few_pairs_say_on_the_mean_what_dense_drake_says(
    study: Setup, dense: tuple[Simulated, Simulated]
) -> None:
    """Over every choice of two of the 32 angles the time is Drake's own mean, to first order."""
    alone, both = dense
    assert both.levels is not None
    each = [_choice(both.levels, k) for k in range(MANY // FEW)]
    times = np.array([one.time for one in each])
    assert times.mean() == pytest.approx(alone.expectation.mean, rel=1e-6)
    errors = [one.correction_variance(common_squares(study, one.squares)) for one in each]
    # Spread over two points unlike each other in mismatch, the error is on the safe side.
    assert 0.8 < np.mean(errors) / times.var(ddof=1) < 2.5


def test_the_search_tells_one_of_these_choices(
    study: Setup, dense: tuple[Simulated, Simulated]
) -> None:
    executor, dog = scratch_executor(1), study.clutch.dog
    (quick,) = screen(study, [dog], executor, 1, base=FEW)
    (few,) = evaluate(study, [dog], executor, [whole_plan(study)], 1)
    assert quick is not None
    (told,) = in_two_levels(study, [quick], [few], 1, FEW)
    assert told.expectation.shifts == FEW * len(study.points)
    assert told.expectation.planar_shifts == MANY * len(study.points)
    mean, error = told.expectation.mean, told.expectation.standard_error
    assert told.estimates["expected_shift_time_s"].value == mean
    assert abs(mean - dense[0].expectation.mean) < 3.0 * error
    assert told.measured == quick.measured


def _choice(levels: LevelTimes, place: int) -> LevelTimes:
    step = MANY // FEW
    return LevelTimes(levels.weights, levels.cheap, levels.even, levels.apart[:, place::step])
