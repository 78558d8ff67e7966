"""Checks of a roof with backlash and of an undercut dog by hand, and margins within tolerances."""

from __future__ import annotations

import itertools
import math
from dataclasses import fields, replace

import numpy as np
import pytest

from dogshape.sim.shift.geometry import Dog, Dogs, flank_contact, section
from dogshape.sim.shift.pair import OutputDog
from dogshape.sim.strength.dog_strength import Limits, margin_losses, strength_checks
from dogshape.sim.strength.landing import Wear, wear_crests
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.locking import blocking_force, locking_checks, locking_friction
from dogshape.sim.strength.manufacture import Tolerances, add_deviations, losses, tolerance_checks
from dogshape.sim.units import DEG, MM
from tests.conftest import dog_of, named_checks

LIMITS = Limits(
    LoadCase(release_by_itself=False, pull_out_force_limit=500.0, separating_force_limit=5000.0)
)


@pytest.fixture
def roof(prototype: Dog) -> Dog:
    """Give a roof of 14 and 20 degrees on flanks of 14 degrees with 0.6 mm of backlash."""
    flanks = {"traction": 14.0 * DEG, "braking": 14.0 * DEG, "backlash": 0.6 * MM}
    return replace(prototype, crest=0.55, chamfer=14.0 * DEG, chamfer_back=20.0 * DEG, **flanks)


@pytest.fixture
def undercut(prototype: Dog) -> Dog:
    """Give six flat dogs with undercut flanks and wide windows, as in a motorcycle."""
    return replace(
        prototype, count=6, chamfer=0.0, traction=-4.0 * DEG, braking=-5.0 * DEG, backlash=4.0 * MM
    )


def test_a_roof_is_judged_by_its_flatter_face_and_lower_edge(roof: Dog) -> None:
    tan = {n: math.tan(n * DEG) for n in (14, 20)}
    inner = math.pi * 22.0 / 15 - 0.3 * 22.0 / 24.0 - 3.7 * tan[14]
    outer = math.pi * 26.0 / 15 - 0.3 * 26.0 / 24.0 - 3.7 * tan[14]
    tip = math.pi * 24.0 / 15 - 0.3 - 3.7 * tan[14]
    slope = tan[20] / (1.0 - tan[20] * tan[14])  # of the back, which falls deeper than the face
    found = named_checks(roof, LIMITS)
    assert found["chamfer_release"].value == pytest.approx(14.0)
    assert found["tip_width"].value == pytest.approx(inner)
    assert found["slot_width"].value == pytest.approx(inner + 0.6 * 22.0 / 24.0)
    assert found["flank_height"].value == pytest.approx(3.7 - 0.45 * outer * slope)
    assert found["chamfer_share"].value == pytest.approx(0.45 * tip * slope / 3.7)
    contact = flank_contact(roof, 0.0, "traction")
    assert contact.height / MM == pytest.approx(3.7 - 2.0 * 0.45 * tip * slope)
    assert locking_friction(roof, LIMITS.load)[1] == "chamfer_release"


def test_an_undercut_dog_holds_itself_and_has_to_be_pulled(undercut: Dog) -> None:
    """Under 200 N m at 24 mm the steeper undercut needs T/r tan(5 deg + arctan 0.12)."""
    pull = 200.0 / 0.024 * math.tan(5.0 * DEG + math.atan(0.12))
    found = named_checks(undercut, LIMITS)
    assert found["pull_out_force"].value == pytest.approx(pull)
    assert blocking_force(undercut, LIMITS.load) == 0.0
    assert found["retention_traction"].value < 0.0
    mouth = 22.0 * (math.pi / 6 + 2.0 / 24.0) - 0.5 * 3.7 * (math.tan(4 * DEG) + math.tan(5 * DEG))
    assert found["slot_width"].value == pytest.approx(mouth)
    rest = replace(LIMITS.load, pull_out_share=0.05)
    (eased,) = (c for c in locking_checks(undercut, rest) if c.name == "pull_out_force")
    assert eased.value == pytest.approx(0.05 * pull)
    assert eased.passed


def test_flat_faces_are_judged_where_they_have_to_slide(undercut: Dog) -> None:
    assert not named_checks(undercut, LIMITS)["chamfer_release"].passed
    waits = replace(LIMITS.load, faces_release=False)
    assert "chamfer_release" not in named_checks(undercut, replace(LIMITS, load=waits))
    assert locking_friction(undercut, waits) == (math.inf, "")


def test_tolerances_move_what_a_dog_has(roof: Dog, undercut: Dog, prototype: Dog) -> None:
    """An undercut stays one within its tolerance, and plays add up with heights."""
    spread = margin_losses(undercut, LIMITS)["tip_width"].by_dimension
    moved = 0.5 * 3.7 * (math.tan(4.0 * DEG) - math.tan(3.75 * DEG))
    assert spread["traction"] == pytest.approx(moved / 1.5)
    assert spread["backlash"] == pytest.approx(0.5 * 0.05 * 22.0 / 24.0 / 1.5)
    assert "chamfer_back" in margin_losses(roof, LIMITS)["tip_width"].by_dimension
    plain = margin_losses(prototype, LIMITS)["tip_width"].by_dimension
    assert plain.keys().isdisjoint({"chamfer_back", "backlash"})


def test_a_worn_roof_keeps_both_edges(roof: Dog) -> None:
    loss = 0.1 * MM
    (_, edge, ridge, back, _), (_, old_edge, old_ridge, old_back, _) = (
        section(dog) for dog in (wear_crests(roof, loss), roof)
    )
    assert edge == pytest.approx(old_edge)
    assert back == pytest.approx(old_back)
    assert ridge[1] == pytest.approx(old_ridge[1] - loss)
    sides = (old_edge, old_ridge, old_back, ridge)
    pairs = zip(sides, (*sides[1:], sides[0]), strict=True)
    area = 0.5 * abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs))
    rate, friction, shifts = 1e-15, 0.1, 1e5
    energy = friction * 2.0 * roof.count * roof.radial_width * area / (rate * shifts)
    assert Wear(rate=rate).loss(roof, energy, friction, shifts) == pytest.approx(loss, rel=0.03)


DESIGNS = [(8, 12, 22, 3.7, 15), (14, 9, 20, 2.6, 26), (10, 18, 12, 4.5, 10)]


@pytest.mark.parametrize("values", DESIGNS)
def test_worst_case_agrees_with_all_corners(prototype: Dog, values: tuple[float, ...]) -> None:
    """256 corners: none is worse than the one that single deviations point to."""
    dog, limits = dog_of(prototype, values), Limits()
    spreads = margin_losses(dog, limits)
    nominal = {c.name: c.margin for c in strength_checks(dog, limits)}
    worst = dict(nominal)
    sizes = {n: limits.tolerances.dimensions[n] for n in spreads["tip_width"].by_dimension}
    for signs in itertools.product((-1.0, 1.0), repeat=len(sizes)):
        deviations = {n: s * t for s, (n, t) in zip(signs, sizes.items(), strict=True)}
        shape, radius = add_deviations(dog, limits.root_radius, deviations)
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
    assert spread.worst_case * limits.tolerances.statistical_share == spread.root_sum_square
    assert limits.tolerances.statistical_share == pytest.approx(1.0, abs=1e-4)  # 3 deviations


def test_no_tolerance_loses_nothing(prototype: Dog) -> None:
    none = Tolerances(*[0.0] * 8)
    spreads = margin_losses(prototype, Limits(tolerances=none)).values()
    assert all(spread.worst_case == 0.0 for spread in spreads)
    contact = flank_contact(prototype, 0.3e-3, "braking")
    left = tolerance_checks(prototype, 0.3e-3, none, 5e-5)[0].value
    assert left == pytest.approx((contact.height - 5e-5) / prototype.height)


def test_a_deviation_that_leaves_no_dog_loses_everything(prototype: Dog) -> None:
    """The chamfer may eat up to half the height; five degrees more do."""
    dog = dog_of(prototype, (16, 10, 20, 3.0, 15))
    found = losses(dog, 0.3e-3, Tolerances(chamfer=5 * DEG), lambda d, *_: {"height": d.height})
    assert found["height"].worst_case == float("inf")


@pytest.mark.parametrize(
    "limits",
    [
        Limits(tolerances=Tolerances(chamfer=5 * DEG)),  # leaves no dog of the last design
        Limits(output_dog=OutputDog(height=2.4 * MM, chamfer=6 * DEG)),
    ],
)
def test_losses_of_many_dogs_are_those_of_each(prototype: Dog, limits: Limits) -> None:
    """All deviations of many dogs are computed together."""
    dogs = [dog_of(prototype, values) for values in (*DESIGNS, (16, 10, 20, 3.0, 15))]
    shape = {field.name: getattr(prototype, field.name) for field in fields(Dog)}
    for name in ("chamfer", "traction", "braking", "height", "count"):
        shape[name] = np.array([getattr(dog, name) for dog in dogs])
    spreads_of_many = margin_losses(Dogs(**shape), limits)
    for place, dog in enumerate(dogs):
        for name, spread in margin_losses(dog, limits).items():
            for kind in ("worst_case", "root_sum_square"):
                loss = np.broadcast_to(getattr(spreads_of_many[name], kind), len(dogs))[place]
                assert loss == pytest.approx(getattr(spread, kind), rel=1e-9, abs=1e-12), name


def test_clearance_in_neutral_by_hand(prototype: Dog) -> None:
    """1.0 mm less 0.1 of the gap and 0.05 of either height; 0.2 mm would not do."""
    contact, check = tolerance_checks(prototype, 0.3e-3, Tolerances(), 5e-5)
    _, worst = tolerance_checks(prototype, 0.3e-3, Tolerances(), 5e-5, "worst_case")
    share = Tolerances().statistical_share
    assert worst.value == pytest.approx(0.8)
    assert check.value == pytest.approx(1.0 - share * math.hypot(0.1, 2 * 0.05))
    assert check.passed
    near, loose = replace(prototype, axial_gap=0.4e-3), Tolerances(height=0.2e-3)
    assert not tolerance_checks(near, 0.3e-3, Tolerances(), 5e-5)[1].passed
    assert tolerance_checks(prototype, 0.3e-3, loose, 5e-5)[0].value < contact.value


def test_play_at_the_mouth_by_hand(prototype: Dog, undercut: Dog) -> None:
    """Flat dogs lose the undercut over their height; a dog that does not pass has a play too."""
    exact = {"outer_diameter": 0.0, "inner_diameter": 0.0}
    tolerances = Tolerances(**exact)
    play = 4.0 * 22.0 / 24.0 - 3.7 * (math.tan(4.0 * DEG) + math.tan(5.0 * DEG))
    slopes = math.tan(4.25 * DEG) + math.tan(5.25 * DEG)
    worst_play = 3.95 * 22.0 / 24.0 - 3.75 * slopes
    *_, worst = tolerance_checks(undercut, 0.3e-3, tolerances, 5e-5, "worst_case")
    *_, check = tolerance_checks(undercut, 0.3e-3, tolerances, 5e-5)
    assert worst.name == check.name == "mouth_play"
    assert worst.value == pytest.approx(worst_play)
    assert worst_play < check.value < play
    assert check.margin == pytest.approx(check.value / 0.05 - 1.0)
    narrow = replace(undercut, backlash=0.7 * MM)  # 0.05 mm at nominal size
    *_, check = tolerance_checks(narrow, 0.3e-3, tolerances, 5e-5)
    assert not check.passed
    assert -0.1 < check.value < 0.05
    names = [c.name for c in tolerance_checks(prototype, 0.3e-3, tolerances, 5e-5)]
    assert names == ["contact_ratio", "clearance"]


@pytest.mark.parametrize(
    ("rate", "capability"),
    [(0.05, 1.0), (0.05, 0.7), (0.00135, 1.0), (0.05, 1.0 / math.sqrt(3.0))],
)
def test_the_reject_rate_is_that_of_dogs_drawn_within_their_tolerances(
    prototype: Dog, rate: float, capability: float
) -> None:
    """40,000 dogs: normal dimensions, at a capability of 1/sqrt 3 even over the whole tolerance.

    A check that falls with a dimension on either side alone, or only beyond another, loses less.
    """
    kept = {"outer_diameter": 0.0, "inner_diameter": 0.0, "root_radius": 0.0}
    tolerances = replace(Tolerances(), reject_rate=rate, capability=capability, **kept)
    dog, limits = dog_of(prototype, DESIGNS[1]), Limits(tolerances=tolerances)
    rng, draws = np.random.default_rng(7), 40_000
    sizes = {
        n: t for n, t in tolerances.dimensions.items() if n not in ("chamfer_back", "backlash")
    }
    even = capability < 0.6

    def drawn(size: float) -> np.ndarray:
        if even:
            return size * rng.uniform(-1.0, 1.0, draws)
        return size / (3.0 * capability) * rng.standard_normal(draws)

    own = {f.name: getattr(dog, f.name) for f in fields(Dog)}
    many = Dogs(**(own | {name: own[name] + drawn(size) for name, size in sizes.items()}))
    nominal = {check.name: check.margin for check in strength_checks(dog, limits)}
    spreads, linear = margin_losses(dog, limits), 0
    for check in strength_checks(many, limits):
        spread = spreads.get(check.name)
        if spread is None or spread.root_sum_square == 0.0:
            continue
        rejected = float(np.mean(check.margin < nominal[check.name] - spread.root_sum_square))
        error = math.sqrt(rate * (1.0 - rate) / draws)
        # An even dimension that decides alone rejects none beyond its tolerance.
        alone = max(spread.by_dimension.values()) > 0.8 * math.hypot(*spread.by_dimension.values())
        if even and alone:
            assert rejected <= rate + 3.0 * error, check.name
            continue
        assert rejected == pytest.approx(rate, rel=0.1 if rate > 0.01 else 0.4), check.name
        linear += 1
    assert linear >= (2 if even else 3)
