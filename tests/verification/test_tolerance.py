"""The worst case against all corners of the tolerances, and single tolerances by hand."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from dogshape.sim.shift.geometry import Dog, flank_contact
from dogshape.sim.strength.dog_strength import Limits, margin_losses, strength_checks
from dogshape.sim.strength.manufacture import Tolerances, losses, moved, tolerance_checks
from dogshape.sim.units import DEG
from tests.conftest import dog_of

DESIGNS = [(8, 12, 22, 3.7, 15), (14, 9, 20, 2.6, 26), (10, 18, 12, 4.5, 10)]


@pytest.mark.parametrize("values", DESIGNS)
def test_worst_case_agrees_with_all_corners(prototype: Dog, values: tuple[float, ...]) -> None:
    """256 corners: none is worse than the one that single deviations point to."""
    dog, limits = dog_of(prototype, values), Limits()
    spreads = margin_losses(dog, limits)
    nominal = {c.name: c.margin for c in strength_checks(dog, limits)}
    worst = dict(nominal)
    sizes = limits.tolerances.dimensions_of(dog)
    for signs in itertools.product((-1.0, 1.0), repeat=len(sizes)):
        deviations = {n: s * t for s, (n, t) in zip(signs, sizes.items(), strict=True)}
        shape, radius = moved(dog, limits.root_radius, deviations)
        for check in strength_checks(shape, limits.with_root_radius(radius))[:-2]:
            worst[check.name] = min(worst[check.name], check.margin)
    for name, spread in spreads.items():
        loss = nominal[name] - worst[name]
        assert spread.worst_case == pytest.approx(loss, rel=1e-9, abs=1e-12), name


def test_a_single_tolerance_by_hand(prototype: Dog) -> None:
    """Chamfer 8 +- 0.25 degrees against a limit of 6.843 degrees."""
    only = Tolerances(0.25 * DEG, *[0.0] * 7)
    limits = Limits(tolerances=only)
    spread = margin_losses(prototype, limits)["chamfer_release"]
    assert spread.by_dimension == pytest.approx({"chamfer": 0.25 / 6.8428}, rel=1e-4)
    assert spread.worst_case == pytest.approx(spread.root_sum_square)


def test_no_tolerance_loses_nothing(prototype: Dog) -> None:
    none = Tolerances(*[0.0] * 8)
    assert all(
        s.worst_case == 0.0 for s in margin_losses(prototype, Limits(tolerances=none)).values()
    )
    contact = flank_contact(prototype, 0.3e-3, "braking")
    left = tolerance_checks(prototype, 0.3e-3, none, 5e-5)[0].value
    assert left == pytest.approx((contact.height - 5e-5) / prototype.height)


def test_a_deviation_that_leaves_no_dog_loses_everything(prototype: Dog) -> None:
    """The chamfer may eat up to half the height; five degrees more do."""
    dog = dog_of(prototype, (16, 10, 20, 3.0, 15))
    spread = losses(dog, 0.3e-3, Tolerances(chamfer=5 * DEG), lambda d, _: {"height": d.height})[
        "height"
    ]
    assert spread.worst_case == float("inf")


def test_clearance_in_neutral_by_hand(prototype: Dog) -> None:
    """1.0 mm less 0.1 of the gap and 0.05 of either height; 0.2 mm would not do."""
    contact, check = tolerance_checks(prototype, 0.3e-3, Tolerances(), 5e-5)
    assert check.value == pytest.approx(0.8)
    assert check.passed
    near, loose = replace(prototype, axial_gap=0.4e-3), Tolerances(height=0.2e-3)
    assert not tolerance_checks(near, 0.3e-3, Tolerances(), 5e-5)[1].passed
    assert tolerance_checks(prototype, 0.3e-3, loose, 5e-5)[0].value < contact.value
