"""How many designs and angles a fit has."""

from __future__ import annotations

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.train.mix_rows import (
    LEAST,
    MOST,
    USUAL,
    angles_of,
    count_of,
    halved,
    mix_blocks,
    require_mix,
)
from dogshape.sim.errors import InputError

ONE = {"operating.mismatch_rpm": [25.0], "operating.force_N": [469.0]}
EIGHT = {"operating.mismatch_rpm": [5.0, 25.0, 100.0, 249.0], "operating.force_N": [235.2, 641.5]}


@pytest.mark.parametrize(("settings", "angles"), [({}, 16), (EIGHT, 16), (ONE, 128)])
def test_a_design_has_enough_angles_at_each_point_and_shifts_in_all(
    settings: dict[str, object], angles: int
) -> None:
    study = load_study("mq200_paper", {**settings, "surrogate.mix_shifts": 50_000})
    assert angles_of(study) == angles >= LEAST
    each = angles * len(study.points)
    assert each >= USUAL
    assert count_of(study) == 50_000 // each
    blocks = mix_blocks(study.working, study.prototype, 3)
    assert {len(block.angles) for block in blocks} == {angles // 2}
    assert sum(halved(study)) == angles // 2
    assert {block.clutch.solver.engine for block in blocks} == {"planar"}


def test_no_more_designs_than_are_worth_asking() -> None:
    assert count_of(load_study("mq200_paper", {**ONE, "surrogate.mix_shifts": 10**7})) == MOST


@pytest.mark.parametrize("shifts", [1, 500, 10 * 128, 15 * 128 - 1])
def test_fewer_designs_than_a_fit_needs_are_refused_before_any_is_simulated(shifts: int) -> None:
    study = load_study("mq200_paper", {**ONE, "surrogate.mix_shifts": shifts})
    with pytest.raises(InputError, match=rf"mix_shifts = {shifts} .* give 1920 or more, or 0"):
        require_mix(study)


@pytest.mark.parametrize("shifts", [0, 15 * 128])
def test_enough_designs_and_none_are_taken(shifts: int) -> None:
    require_mix(load_study("mq200_paper", {**ONE, "surrogate.mix_shifts": shifts}))


def test_what_is_uncertain_has_even_angles() -> None:
    """A time is no function of the angle there: between two of them nothing is halved."""
    unsure = {"uncertain.friction_factor": {"distribution": "uniform", "low": 0.9, "high": 1.1}}
    study = load_study("mq200_paper", {**ONE, **unsure})
    assert halved(study) == ()
    (block,) = mix_blocks(study, study.prototype, 0)
    assert len(block.angles) == angles_of(study)


def test_two_designs_have_no_angle_in_common() -> None:
    study = load_study("mq200_paper", EIGHT)
    seen = [block.angles[0] for k in (0, 1) for block in mix_blocks(study, study.prototype, k)]
    assert len(set(seen)) == len(seen)
