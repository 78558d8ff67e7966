"""Two levels of a search: estimator, errors, corrections of many designs, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.level_front import (
    LEAST,
    _variances,
    compiled_covariance,
    correction_of,
)
from dogshape.pipeline.simulate.level_times import (
    LevelTimes,
    common_squares,
    holding,
    level_times,
    parts_of,
    require_levels,
)
from dogshape.sim.errors import InputError
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.statistics.expectation import ShiftResult, nested, variance_of_mean
from dogshape.surrogate.covariance import Array
from tests.conftest import SMALL

BOTH = [*SMALL, "search.levels=2", "search.screen_angles=16"]


@pytest.fixture(scope="module")
def study() -> Setup:
    return load_study("mq200_paper", BOTH)


def _parts(study: Setup, times: list[float | None]) -> Array:
    lost = study.clutch.timeout + study.retraction
    shifts = [
        ShiftResult(Outcome.ENGAGED if time is not None else Outcome.BLOCKED, time)
        for time in times
    ]
    return parts_of(shifts, lost)


def _made_up(study: Setup, few: int, many: int, seed: int = 3) -> LevelTimes:
    """Two points: even times of a saw-tooth, and Drake off by half a millisecond."""
    rng = np.random.default_rng(seed)
    cheap = [[0.05 + 0.02 * (k / many) + 1e-3 * rng.random() for k in range(many)] for _ in "ab"]
    dear = [[cheap[i][k] + 5e-4 for k in nested(few, many, seed, i, few)] for i in range(2)]
    each = [[_parts(study, [*times]) for times in level] for level in (cheap, dear)]
    return level_times(study, each[0], each[1], seed, few)


def test_a_constant_difference_is_found_without_an_error(study: Setup) -> None:
    found = _made_up(study, 2, 16)
    assert found.correction == pytest.approx(5e-4, rel=1e-9)
    assert found.time == pytest.approx(found.compiled + 5e-4, rel=1e-9)
    assert (found.few, found.many) == (2, 16)


def test_with_all_angles_nothing_is_left_of_the_compiled_engine(study: Setup) -> None:
    rng = np.random.default_rng(1)
    cheap, dear = 0.05 + 0.01 * rng.random((2, 8)), 0.06 + 0.01 * rng.random((2, 8))
    parts = [[_parts(study, [*row]) for row in level] for level in (cheap, dear)]
    found = level_times(study, parts[0], parts[1], 1, 8)
    assert found.time == pytest.approx(dear.mean(), rel=1e-12)


def test_one_pair_that_engages_in_one_engine_alone_stays_finite(study: Setup) -> None:
    """The cost of a lost attempt, less the mean that an engaged shift is worth."""
    cheap: list[float | None] = [0.05] * 8
    lost = study.clutch.timeout + study.retraction
    parts = [[_parts(study, cheap)] * 2, [_parts(study, [None])] * 2]
    found = level_times(study, parts[0], parts[1], 1, 1)
    assert found.time == pytest.approx(0.05 + lost, rel=1e-9)
    none = [[_parts(study, [None] * 8)] * 2, [_parts(study, [None])] * 2]
    assert np.isfinite(level_times(study, none[0], none[1], 1, 1).time)


def test_the_mean_over_every_choice_of_pairs_is_the_whole_difference() -> None:
    rng = np.random.default_rng(5)
    cheap, apart = 0.05 + 0.01 * rng.random((3, 32)), 1e-3 * rng.standard_normal((3, 32))
    weights = np.array([0.2, 0.3, 0.5])
    found = [LevelTimes(weights, cheap, (True,) * 3, apart[:, k::16]).time for k in range(16)]
    assert np.mean(found) == pytest.approx(weights @ (cheap + apart).mean(axis=1), rel=1e-12)


@pytest.mark.parametrize(("few", "many", "base"), [(2, 16, 2), (4, 64, 2), (8, 256, 8)])
def test_both_engines_have_angles_and_draws_alike(few: int, many: int, base: int) -> None:
    study = load_study("mq200")
    point, draw = study.points[5], (4, 5)
    ours, theirs = (
        even_block(study.clutch, point, count, draw, base, uncertainty=study.uncertainty)
        for count in (few, many)
    )
    places = nested(few, many, 4, 5, base)
    assert [theirs.angles[k] for k in places] == pytest.approx(ours.angles)
    assert [theirs.variants[k] for k in places] == [*ours.variants]


def test_a_record_holds_the_shifts(study: Setup) -> None:
    found = _made_up(study, 2, 16)
    again = LevelTimes.of_record(study, found.record)
    assert again.cheap == pytest.approx(found.cheap, rel=1e-6)
    assert again.apart.tolist() == found.apart.tolist()
    assert again.record == found.record


def test_spreads_are_those_of_points_alike_in_mismatch() -> None:
    study = load_study("mq200")
    squares = np.zeros(len(study.points))
    squares[0] = 1.0
    common = common_squares(study, squares)
    slow = [abs(p.mismatch) for p in study.points] == np.min([p.mismatch for p in study.points])
    assert common[slow] == pytest.approx(1.0 / 8.0)
    assert common[-1] == 0.0


def test_variances_are_those_of_even_angles() -> None:
    rng = np.random.default_rng(2)
    times = rng.standard_normal((3, 2, 24))
    found = _variances(times, np.array([True, False]))
    for k in range(3):
        assert found[k, 0] == pytest.approx(variance_of_mean(times[k, 0]))
        assert found[k, 1] == pytest.approx(variance_of_mean(times[k, 1], even=False))


def _designs(
    scatter: float, few: int, count: int, seed: int = 0, sd: float = 0.01
) -> tuple[list[LevelTimes], Array]:
    """Designs whose engines differ by their own share, and that share of each."""
    rng = np.random.default_rng(seed)
    weights, true = np.full(28, 1.0 / 28.0), 0.001 + scatter * rng.standard_normal(count)
    made = []
    for own in true:
        apart = 0.06 * (own + sd * rng.standard_normal((28, few)))
        made.append(LevelTimes(weights, np.full((28, 64), 0.06), (True,) * 28, apart))
    return made, true


def test_corrections_that_differ_by_sampling_alone_are_drawn_to_their_mean() -> None:
    study = load_study("mq200")
    levels, true = _designs(0.0, 2, 40)
    found = correction_of(study, levels)
    own = np.array([one.correction / one.compiled for one in levels]) - true
    drawn_in = found.values - true
    assert np.abs(drawn_in).mean() < 0.6 * np.abs(own).mean()
    z = drawn_in / np.sqrt(np.diag(found.covariance))
    assert np.sqrt((z**2).mean()) < 1.1
    assert found.mean == pytest.approx(0.001, abs=3.0 * found.mean_variance**0.5)


def test_corrections_that_truly_differ_stay_each_design_s_own() -> None:
    study = load_study("mq200")
    levels, true = _designs(0.02, 8, 40)
    found = correction_of(study, levels)
    own = np.array([one.correction / one.compiled for one in levels])
    assert found.scatter > 0.015
    assert np.abs(found.values - own).max() < 0.1 * np.abs(own - own.mean()).max()
    z = (found.values - true) / np.sqrt(np.diag(found.covariance))
    assert 0.7 < np.sqrt((z**2).mean()) < 1.3


def test_errors_of_corrections_hold_over_many_searches() -> None:
    """Differences of two designs, with a scatter that the pairs can hardly see."""
    study = load_study("mq200")
    scores = []
    for seed in range(40):
        levels, true = _designs(0.0006, 2, 20, seed)
        found = correction_of(study, levels)
        covariance, wrong = found.covariance, found.values - true
        gap = covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1]
        scores.append((wrong[0] - wrong[1]) / gap**0.5)
    assert 0.7 < np.std(scores) < 1.25


def test_few_designs_keep_their_own_corrections() -> None:
    study = load_study("mq200")
    levels, _ = _designs(0.0, 2, LEAST - 1)
    found = correction_of(study, levels)
    assert found.values == pytest.approx([one.correction / one.compiled for one in levels])


def test_what_designs_share_cancels_between_them() -> None:
    """Of times alike but for a constant no error is left between two designs."""
    rng = np.random.default_rng(7)
    weights, apart = np.full(28, 1.0 / 28.0), np.zeros((28, 2))
    times = 0.06 + 0.01 * rng.standard_normal((28, 64))
    other = 0.06 + 0.01 * rng.standard_normal((28, 64))
    levels = [
        LevelTimes(weights, one, (True,) * 28, apart) for one in (times, times + 0.002, other)
    ]
    found = compiled_covariance(levels)
    left = found[0, 0] + found[1, 1] - 2.0 * found[0, 1]
    assert left == pytest.approx(0.0, abs=1e-3 * found[0, 0])
    apart_from_it = found[0, 0] + found[2, 2] - 2.0 * found[0, 2]
    assert apart_from_it == pytest.approx(found[0, 0] + found[2, 2], rel=0.3)


@pytest.mark.parametrize(("base", "least", "found"), [(2, 64, 64), (6, 64, 96), (16, 1, 16)])
def test_angles_that_hold_others_are_doubled(base: int, least: int, found: int) -> None:
    assert holding(base, least) == found


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["solver.engine=planar"], "take solver.engine"),
        (["search.screen_angles=24"], "give 32"),
        (["search.objectives=['peak_impact_force_N']"], "give search.levels = 1"),
    ],
)
def test_what_two_levels_cannot_say_is_refused(more: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        require_levels(load_study("mq200_paper", [*BOTH, *more]))


def test_two_levels_need_a_screen() -> None:
    with pytest.raises(InputError, match="screen_angles"):
        require_levels(load_study("mq200_paper", [*SMALL, "search.levels=2"]))
