"""Share of manufactured clutches that keep all checks, where it is known in closed form."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.stats import norm

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.design import design_of, exact_losses, objectives_of
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.uncertainty import Distribution
from dogshape.sim.strength.dog_strength import Limits, strength_checks
from dogshape.sim.strength.load_case import load_share, neighbour_share
from dogshape.sim.strength.production import (
    DRAWS,
    kept_draws,
    kept_share,
    standard_error,
    surely_below,
)
from dogshape.sim.strength.tolerance import Tolerances
from dogshape.sim.units import DEG, MM

NONE = Tolerances(**dict.fromkeys([f.name for f in fields(Tolerances)][:-3], 0.0))
Z = 4.0  #: standard errors that a share of the draws may be off


def _limits(tolerances: Tolerances, **load: float) -> Limits:
    """A light load: no check binds but the one in question."""
    limits = load_study("mq200_paper").limits
    return replace(limits, tolerances=tolerances, load=replace(limits.load, torque=50.0, **load))


def _near(share: float, expected: float) -> None:
    assert share == pytest.approx(expected, abs=Z * math.sqrt(expected * (1 - expected) / DRAWS))


@pytest.mark.parametrize("deviations", [-1.0, 0.0, 1.0, 2.0])
def test_one_linear_check_with_normal_dimensions(deviations: float) -> None:
    """The gap between the crests is axial gap less what both crests stand higher."""
    gap, height = 0.3 * MM, 0.06 * MM
    tolerances = replace(NONE, axial_gap=gap, height=height, clearance=0.5 * MM)
    sd = math.hypot(gap, 2.0 * height) / 3.0
    dog = replace(load_study("mq200_paper").clutch.dog, axial_gap=0.5 * MM + deviations * sd)
    _near(kept_share(dog, _limits(tolerances)), float(norm.cdf(deviations)))


@pytest.mark.parametrize("inside", [-0.5, 0.0, 0.4, 1.0])
def test_one_linear_check_with_a_uniform_dimension(inside: float) -> None:
    gap = 0.3 * MM
    tolerances = replace(NONE, axial_gap=gap, clearance=0.5 * MM, distribution="uniform")
    dog = replace(load_study("mq200_paper").clutch.dog, axial_gap=0.5 * MM + inside * gap)
    share = kept_share(dog, _limits(tolerances))
    if inside == 1.0:
        assert share == 1.0
    else:
        _near(share, 0.5 * (1.0 + inside))


def test_an_angle_against_friction() -> None:
    """A chamfer lets go above arctan of the static coefficient: normal angle, certain friction."""
    tolerances = replace(NONE, chamfer=0.9 * DEG)
    dog = load_study("mq200_paper").clutch.dog
    friction = math.tan(dog.chamfer - 0.15 * DEG)  # half a deviation inside
    found = kept_share(dog, _limits(tolerances, friction_release=friction))
    _near(found, float(norm.cdf(0.5)))


def test_uncertain_friction_against_a_certain_angle() -> None:
    dog, limits = load_study("mq200_paper").clutch.dog, _limits(NONE)
    most = math.tan(dog.chamfer) / limits.load.friction_release
    friction = Distribution(distribution="uniform", low=0.8, high=1.3)
    _near(kept_share(dog, limits, friction), (most - 0.8) / 0.5)


def test_draws_are_the_same_for_all_designs_and_dimensions() -> None:
    """A better design keeps what a worse one keeps; a further dimension moves no draw."""
    dog = load_study("mq200_paper").clutch.dog
    one = _limits(replace(NONE, axial_gap=0.3 * MM, clearance=0.5 * MM))
    worse, better = (
        np.array(kept_draws(replace(dog, axial_gap=gap * MM), one)) for gap in (0.45, 0.55)
    )
    assert worse.sum() < better.sum()
    assert not (worse & ~better).any()
    more = _limits(replace(NONE, axial_gap=0.3 * MM, clearance=0.5 * MM, outer_diameter=0.1 * MM))
    assert kept_draws(replace(dog, axial_gap=0.45 * MM), more) == worse.tolist()


def test_no_tolerance_no_doubt() -> None:
    study = load_study("mq200_paper")
    sure = replace(study.limits, tolerances=NONE)
    assert kept_share(study.clutch.dog, sure) == 1.0
    heavy = replace(sure, load=replace(sure.load, torque=2000.0))
    assert kept_share(study.clutch.dog, heavy) == 0.0


def test_a_quick_refusal_is_right() -> None:
    """What few draws refuse has a share below the limit; a sure design is never refused."""
    limits = _limits(replace(NONE, axial_gap=0.3 * MM, clearance=0.5 * MM))
    refused = []
    for gap in np.linspace(0.3, 0.9, 13).tolist():
        dog = replace(load_study("mq200_paper").clutch.dog, axial_gap=gap * MM)
        refused.append(surely_below(dog, limits, None, 0.99))
        assert not refused[-1] or kept_share(dog, limits) < 0.99
    assert refused[0]
    assert not refused[-1]


def test_the_standard_error_covers() -> None:
    """Of many samples of a known share, some two of three lie within one standard error."""
    rng = np.random.default_rng(5)
    for truth in (0.5, 0.9, 0.98):
        shares = rng.binomial(DRAWS, truth, 4000) / DRAWS
        within = np.mean([abs(share - truth) <= standard_error(share) for share in shares])
        assert 0.60 < within < 0.75
    assert 0.0 < standard_error(1.0) < 0.002


def test_interpolated_load_sharing() -> None:
    for count in (9, 15, 30):
        for scatter in np.geomspace(0.05, 5.0, 23).tolist():
            exact = load_share(count, scatter)
            assert neighbour_share(count, scatter) == pytest.approx(exact, rel=1e-4)


def test_a_class_of_accuracy_changes_the_share() -> None:
    """Load sharing that follows from the dogs is part of a draw: coarse dogs bear less."""
    study = load_study("mq200_paper")
    shares = [
        kept_share(
            study.clutch.dog,
            replace(study.limits, load=replace(study.limits.load, accuracy=accuracy)),
        )
        for accuracy in (5, 9)
    ]
    assert shares[0] > shares[1]


def _study(*overrides: str) -> Setup:
    return load_study("mq200_paper", list(overrides))


def test_it_is_a_limit_and_an_objective() -> None:
    """The prototype keeps its limits, but not with its tolerances: a limit of 99 % refuses it."""
    study = _study("search.limits.feasible_probability=0.99")
    checked = design_of(study, {})
    (check,) = (c for c in checked.checks if c.name == "feasible_probability")
    assert all(c.passed for c in strength_checks(study.clutch.dog, study.limits))
    assert check.value == kept_share(study.clutch.dog, study.limits)
    assert check.value == pytest.approx(2.0 / 3.0, abs=2.0 * standard_error(2.0 / 3.0))
    assert checked.failed == ["feasible_probability"]
    assert f"standard error of {standard_error(check.value):.2g}" in check.rule.formula
    aims = _study("search.objectives=['expected_shift_time_s', 'feasible_probability']")
    assert [o.maximise for o in objectives_of(aims)] == [False, True]
    assert exact_losses(aims, [aims.prototype])[0, 1] == -check.value


def test_uncertain_friction_of_a_study_is_drawn_too() -> None:
    limit = "search.limits.feasible_probability=0.99"
    friction = "uncertain.friction_factor={distribution='uniform', low=0.7, high=1.3}"
    sure, unsure = _study(limit), _study(limit, friction)
    values = [
        next(c.value for c in design_of(s, {}).checks if c.name == "feasible_probability")
        for s in (sure, unsure)
    ]
    assert values[1] < values[0]


def test_a_distribution_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'uniform'"):
        _study("tolerance.distribution='unifrom'")
    assert _study().config_hash == _study("tolerance.distribution='normal'").config_hash
