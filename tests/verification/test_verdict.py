"""Verdict: its states, the effect of assumptions by closed forms, and intervals of a landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.design import design_of, judge_design
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.elementwise import Array
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.strength.checks import RULES, LimitCheck
from dogshape.sim.strength.dog_strength import Limits, strength_checks
from dogshape.sim.strength.landing import Landings, demand_checks, tail_interval
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.strike import Strike
from dogshape.sim.strength.verdict import (
    SPANS,
    STANDARD,
    HangShare,
    Hinge,
    Margin,
    hinges,
    judge,
    landing_by_stiffness,
    missing_checks,
)
from dogshape.sim.units import RPM

SMALL = ["operating.mismatch_rpm=[-500, 800]", "operating.force_N=[250]"]


@pytest.mark.parametrize(
    ("margins", "missing", "state"),
    [
        ([0.1, 0.2], False, "passes"),
        ([0.1, 0.2], True, "not_judged"),
        ([0.1, -0.2], True, "fails"),
        ([0.1, -0.2], False, "fails"),
    ],
)
def test_states_without_intervals(
    prototype: Dog, margins: list[float], missing: bool, state: str
) -> None:
    known = {rule for one in STANDARD for rule in one.rules}
    names = known - set(STANDARD[0].rules) if missing else known
    open_ones = missing_checks(prototype, Limits(), names)
    verdict = judge([Margin(f"check {k}", m) for k, m in enumerate(margins)], open_ones)
    assert verdict.state == state
    assert verdict.passes is (state == "passes")
    assert ("flank strike" in verdict.line) is missing
    assert verdict.to_dict()["line"] == verdict.line


@pytest.mark.parametrize(
    ("value", "ends", "clear", "state"),
    [
        (90.0, (80.0, 95.0), True, "passes"),
        (90.0, (80.0, 110.0), False, "not_clear"),
        (110.0, (90.0, 130.0), False, "not_clear"),
        (110.0, (105.0, 130.0), True, "fails"),
    ],
)
def test_a_margin_within_its_interval_is_not_clear(
    value: float, ends: tuple[float, float], clear: bool, state: str
) -> None:
    check = LimitCheck(RULES["face_pressure_impact"], value, 100.0, interval=ends)
    assert check.clear is clear
    low, high = check.margin_interval or (math.nan, math.nan)
    assert (low, high) == pytest.approx((1.0 - ends[1] / 100.0, 1.0 - ends[0] / 100.0))
    assert judge([Margin.of(check)], ()).state == state


def test_retention_is_wanted_where_a_worn_flank_pushes_out_without_friction(
    prototype: Dog,
) -> None:
    """Undercut holds as far as the wear of a degree leaves some; vibration needs a holder too."""

    def undercut(degrees: float) -> Dog:
        lean = math.radians(-degrees)
        return replace(prototype, traction=lean, braking=lean, backlash=2e-3)

    shaken = Limits(load=LoadCase(vibration_force=20.0))
    for dog, limits, wanted in (
        (prototype, Limits(), True), (undercut(0.5), Limits(), True),
        (undercut(3.0), Limits(), False), (undercut(3.0), shaken, True),
    ):  # fmt: skip
        assert ("retention" in {one.check for one in missing_checks(dog, limits, ())}) is wanted


def _hinge(found: tuple[Hinge, ...], key: str) -> Hinge:
    (one,) = (hinge for hinge in found if hinge.key == key)
    return one


def test_the_effect_of_the_application_factor_is_in_proportion(prototype: Dog) -> None:
    """All stresses of one rated torque are in proportion to it, and so is their share of limits."""
    load = LoadCase(torque=3000.0, release_by_itself=False, faces_release=False)
    limits = Limits(load=load)
    weakest = min(strength_checks(prototype, limits), key=lambda check: check.margin)
    assert weakest.margin < -1.0  # loads alone decide
    one = _hinge(hinges(prototype, limits), "load.application_factor")
    low, high = 1.25 / 1.5, 1.75 / 1.5
    assert one.margin == pytest.approx(weakest.margin)
    assert one.margin_low == pytest.approx(1.0 - low * (1.0 - weakest.margin))
    assert one.margin_high == pytest.approx(1.0 - high * (1.0 - weakest.margin))
    assert not one.flips
    with_sharing = _hinge(hinges(prototype, limits), "load.load_sharing")
    assert with_sharing.margin_low == pytest.approx(1.0 - (1.0 - weakest.margin) / 0.7)


def test_an_end_of_a_range_is_the_check_of_that_value(prototype: Dog) -> None:
    """By a second way: limits built with the value."""
    load = LoadCase(release_by_itself=False, pull_out_force_limit=500.0, spline_friction=0.1,
                    spline_radius=0.0176)  # fmt: skip
    limits = Limits(load=load)
    found = hinges(prototype, limits)
    for key, name, scale in (
        ("load.spline_friction_release", "spline_friction_release", 1.0),
        ("load.friction_release", "friction_release", 1.0),
        ("mechanism.spline_radius_mm", "spline_radius", 1e-3),
    ):
        hinge = _hinge(found, key)
        for end, margin in ((hinge.low, hinge.margin_low), (hinge.high, hinge.margin_high)):
            case = replace(limits, load=replace(load, **{name: scale * end}))
            expected = min(check.margin for check in strength_checks(prototype, case))
            assert margin == pytest.approx(expected, rel=1e-9)
    given = hinges(prototype, limits, given=["mechanism.spline_radius_mm"])
    assert all(hinge.key != "mechanism.spline_radius_mm" for hinge in given)
    assert [h.effect for h in found if not h.flips] == sorted(
        (h.effect for h in found if not h.flips), reverse=True
    )


def test_a_strike_is_judged_at_the_ends_of_the_range_of_a_study(prototype: Dog) -> None:
    """A single ring moves by the assumed factors, a range to its own ends."""

    def strikes(*rings: float) -> tuple[Strike, ...]:
        return tuple(
            Strike(ring_inertia=ring, sliding_inertia=0.01, input_stiffness=1e4,
                   wheel_inertia=0.6, output_inertia=0.6, mismatch=(900.0 * RPM,))
            for ring in rings
        )  # fmt: skip

    def margin(*rings: float) -> float:
        limits = Limits(strikes=strikes(*rings))
        return min(check.margin for check in strength_checks(prototype, limits))

    single = _hinge(hinges(prototype, Limits(strikes=strikes(0.002))), "strike.ring_inertia_kgm2")
    assert (single.low, single.high) == pytest.approx((0.001, 0.004))
    assert (single.margin_low, single.margin_high) == pytest.approx((margin(0.001), margin(0.004)))
    ranged = Limits(strikes=strikes(0.0005, 0.003))
    own = _hinge(hinges(prototype, ranged), "strike.ring_inertia_kgm2")
    assert (own.margin_low, own.margin_high) == pytest.approx((margin(0.0005), margin(0.003)))
    assert own.margin == pytest.approx(margin(0.0005, 0.003))


def test_a_strike_of_the_mechanism_moves_by_its_keys() -> None:
    """Ring and shaft that shifts are simulated with, unless [strike] has a range about them."""
    ring, shaft = "mechanism.ring_inertia_kgm2", "mechanism.input_stiffness_Nm_rad"
    keys = {ring: 5e-4, shaft: 15e3, "strike.mismatch_rpm": [900.0]}
    alone = load_study("mq200_paper", keys)
    ranged = load_study("mq200_paper", {**keys, "strike.ring_inertia_kgm2": [2e-4, 1e-3]})
    for study, key, ends in (
        (alone, ring, (2.5e-4, 1e-3)), (ranged, "strike.ring_inertia_kgm2", (2e-4, 1e-3)),
    ):  # fmt: skip
        _, verdict = judge_design(design_of(study, {}))
        found = _hinge(verdict.hangs_on, key)
        assert (found.value, found.low, found.high) == pytest.approx((5e-4, *ends))
        assert "strike.input_stiffness_Nm_rad" not in {one.key for one in verdict.hangs_on}


def test_checks_follow_the_stiffness_of_the_dogs(prototype: Dog) -> None:
    """By a second way, checks of a case with that stiffness: strikes, sharing and landings."""
    load = LoadCase(release_by_itself=False, faces_release=False, accuracy=9)
    strike = Strike(ring_inertia=0.002, sliding_inertia=0.01, input_stiffness=1e4,
                    wheel_inertia=0.6, output_inertia=0.6, mismatch=(900.0 * RPM,))  # fmt: skip
    loads = np.zeros((1, len(OVERLAPS)))
    loads[0, 0], loads[0, -1] = 3e4, 2e5
    landings = Landings(loads, np.ones(1))
    steel = Limits(load=load, strikes=(strike,))
    soft_case = replace(Limits().material, surface_hardness=100.0)
    for limits in (steel, replace(Limits(load=load), material=soft_case)):
        hinge = _hinge(hinges(prototype, limits, landings), "load.dog_stiffness_factor")
        assert (hinge.low, hinge.high) == SPANS.dog_stiffness_factor.ends(1.0)
        for end, margin in ((hinge.low, hinge.margin_low), (hinge.high, hinge.margin_high)):
            case = replace(limits, load=replace(load, dog_stiffness_factor=end))
            checks = strength_checks(prototype, case)
            checks += demand_checks(prototype, landings.demand(prototype, case), case)
            assert margin == pytest.approx(min(check.margin for check in checks))
        soft, stiff = landing_by_stiffness(prototype, limits, landings)
        assert (soft[0], stiff[0]) == (hinge.low, hinge.high)
        assert stiff[1].margin < soft[1].margin
        measured = replace(limits, load=replace(load, dog_stiffness_factor=1.1))
        keys = {one.key for one in hinges(prototype, measured, landings)}
        assert "load.dog_stiffness_factor" not in keys
        ((factor, check),) = landing_by_stiffness(prototype, measured, landings)
        assert factor == 1.1
        assert stiff[1].margin < check.margin < soft[1].margin


Sample = Callable[[np.random.Generator, int], Array]
TAILS: dict[str, tuple[Sample, float]] = {
    "exponential": (lambda rng, n: rng.exponential(size=n), -math.log(0.01)),
    "uniform": (lambda rng, n: rng.random(n), 0.99),
    "normal": (lambda rng, n: np.abs(rng.normal(size=n)), 2.5758),
    "lognormal": (lambda rng, n: np.exp(0.5 * rng.normal(size=n)), math.exp(0.5 * 2.3263)),
    "half without landing": (
        lambda rng, n: rng.exponential(size=n) * (rng.random(n) < 0.5), -math.log(0.02)
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", TAILS)
def test_intervals_of_a_quantile_hold_it(kind: str) -> None:
    """Of 200 samples of 160 shifts 95 % hold it; 0.89 is 4 standard errors of that below."""
    draw, true = TAILS[kind]
    rng = np.random.default_rng(1)
    ends = [tail_interval(draw(rng, 160), np.ones(160), 0.01) for _ in range(200)]
    assert np.mean([low <= true <= high for low, high in ends]) > 0.89
    narrow = [high - low for low, high in ends]
    draw_many = [tail_interval(draw(rng, 1600), np.ones(1600), 0.01) for _ in range(20)]
    assert np.mean([high - low for low, high in draw_many]) < 0.6 * np.mean(narrow)


def test_intervals_of_the_hardest_hold_that_of_as_many_new_landings() -> None:
    draw, _ = TAILS["exponential"]
    rng = np.random.default_rng(2)
    inside = []
    for _ in range(200):
        low, high = tail_interval(draw(rng, 100), np.ones(100), None)
        inside.append(low <= draw(rng, 100).max() <= high)
    assert np.mean(inside) > 0.89


def test_an_interval_does_not_depend_on_the_scale_of_weights_nor_of_loads() -> None:
    rng = np.random.default_rng(3)
    values, weights = rng.exponential(size=120), rng.random(120)
    own = np.array(tail_interval(values, weights, 0.02))
    assert tail_interval(7.0 * values, 3.0 * weights, 0.02) == pytest.approx(7.0 * own)
    assert tail_interval(np.zeros(40), np.ones(40), 0.01) == (0.0, 0.0)


def test_landings_of_other_seeds_hold_what_many_angles_say() -> None:
    """Of 40 seeds of one dog, 32 angles at each point, beside 512 angles of another seed.

    At 95 % 38 hold it; 34 is 3 standard errors of that below.
    """
    study, count = load_study("motorcycle", SMALL).in_engine("planar"), 40
    executor = scratch_executor(1)

    def landings(angles: int, seed: int) -> Landings:
        (found,) = evaluate(study, [{}], executor, angles, seed)
        assert found.check_inputs.landings is not None
        return found.check_inputs.landings

    dog, limits = study.clutch.dog, study.limits
    true = np.array(landings(512, 777).demand(dog, limits))
    ends = np.array([landings(32, 1 + k).interval(dog, limits) for k in range(count)])
    held = (ends[:, 0] <= true) & (true <= ends[:, 1])
    assert (held.sum(axis=0) >= 34).all()


def test_a_study_names_what_its_verdict_lacks() -> None:
    """By its keys: with them the verdict has nothing left open."""
    bare = load_study("mq200_paper", ["expectation.angles=4"]).in_engine("planar")
    keys = ["strike.ring_inertia_kgm2=0.0005", "strike.input_stiffness_Nm_rad=15000"]
    struck = load_study("mq200_paper", [*keys, "expectation.angles=4"]).in_engine("planar")
    for study, missing in ((bare, ["flank_strike"]), (struck, [])):
        (found,) = evaluate(study, [{}], scratch_executor(1), 4, 1)
        design, verdict = judge_design(design_of(study, {}, found.check_inputs))
        assert [one.check for one in verdict.not_judged] == missing
        intervals = [check for check in design.checks if check.interval is not None]
        assert {check.rule.group for check in intervals} == {"impact"}
        assert [check.value for check in intervals] == [
            check.value for check in design_of(study, {}, found.check_inputs).checks
            if check.rule.group == "impact"
        ]  # fmt: skip


@pytest.mark.parametrize(("share", "warns"), [(0.033, False), (0.1, True), (0.49, True)])
def test_a_verdict_warns_of_hangs_and_stays_what_it_is(share: float, warns: bool) -> None:
    hangs = HangShare(share, low=0.5 * share, high=1.5 * share, warning_share=0.05, max_share=0.5)
    verdict = replace(judge([Margin("engagement", 0.02)], ()), hangs=hangs)
    assert verdict.passes
    assert ("warning" in verdict.line) is warns
    assert f"{100.0 * share:.2g} % of the shifts hang" in hangs.limits_text
    assert "engagement fails above 50 %" in hangs.limits_text


def test_a_warning_of_few_shifts_is_not_clear() -> None:
    """One hang in twelve shifts may be a rate of 1 or 30 %; dogs that always block have 100 %."""
    few = HangShare(0.08, low=0.01, high=0.3, warning_share=0.05, max_share=0.5)
    verdict = replace(judge([Margin("engagement", 0.02)], ()), hangs=few)
    assert (
        "warning (not clear by so few shifts, give more angles): 8 % of the shifts hang"
        in verdict.line
    )
    many = few._replace(low=0.06, high=0.1)
    assert "; warning: 8 % of the shifts hang" in replace(verdict, hangs=many).line
    all_hang = few._replace(share=0.997, low=0.98, high=1.0)
    assert all_hang.text.startswith("100 % of the shifts hang")
    assert all_hang.text.endswith("(95 %: 98 to 100 %)")


def test_the_share_of_hangs_is_that_of_the_worst_point() -> None:
    """Flat dogs hang at small mismatches; the set level decides the warning."""
    flat = {"dog.chamfer_deg": 0.0, "load.faces_release": False, "uncertain": None}
    points = {"operating.mismatch_rpm": [10, 249], "operating.force_N": [469]}
    study = load_study("mq200", {**flat, **points}).in_engine("planar")
    (evaluation,) = evaluate(study, [{}], scratch_executor(1), 12, 1)
    _, verdict = judge_design(design_of(study, {}, evaluation.check_inputs))
    worst, other = sorted(evaluation.expectation.points, key=lambda point: -point.hangs)
    assert worst.hangs > other.hangs
    assert verdict.hangs is not None
    assert verdict.hangs.share == worst.hang.mean
    assert verdict.hangs.low < worst.hangs / worst.n < verdict.hangs.high
    assert verdict.hangs.warning_share == 0.05
    assert verdict.hangs.warns


#: Changes that a remedy names as less friction, by the check whose margin they raise.
LESS_FRICTION = [
    ("chamfer_release", "load.friction_release", {}),
    ("chamfer_release", "contact.face_friction", {"contact.face_friction": 0.12}),
    ("traction_release", "load.friction_release", {"load.release_by_itself": True}),
    ("pull_out_force", "load.friction_release", {}),
    ("pull_out_force", "mechanism.spline_friction", {}),
]


@pytest.mark.parametrize(("name", "key", "settings"), LESS_FRICTION)
def test_less_friction_raises_the_margins_whose_remedy_it_is(
    name: str, key: str, settings: dict[str, Any]
) -> None:
    friction = settings.get(key, 0.12 if "release" in key else 0.2)

    def check_of(value: float) -> LimitCheck:
        study = load_study("mq200", {**settings, key: value})
        return next(check for check in design_of(study, {}).checks if check.name == name)

    assert check_of(0.8 * friction).margin > check_of(friction).margin
    assert "less friction" in check_of(friction).remedy


def test_less_friction_or_force_engages_more_dogs_that_faces_hold() -> None:
    """As the remedy of the engagement says."""
    flat = {"dog.chamfer_deg": 0.0, "load.faces_release": False, "uncertain": None}
    points = {"operating.mismatch_rpm": [20], "operating.force_N": [641]}

    def check_of(settings: dict[str, Any]) -> LimitCheck:
        study = load_study("mq200", {**flat, **points, **settings}).in_engine("planar")
        (evaluation,) = evaluate(study, [{}], scratch_executor(1), 24, 1)
        design = design_of(study, {}, evaluation.check_inputs)
        return next(check for check in design.checks if check.name == "engagement")

    held = check_of({})
    assert not held.passed
    assert "less friction of the faces (contact.face_friction) or less shift force" in held.remedy
    assert check_of({"operating.force_N": [236]}).value > held.value
    assert check_of({"contact.face_friction": 0.03}).value > held.value


def test_check_shows_the_load_sharing_of_its_strength_checks() -> None:
    checked = ds.Study("mq200").strength(simulate=False)
    load = checked.config.limits.load
    dog = checked.config.clutch.dog
    shares = checked.to_dict()["load_sharing"]
    for flank, share in shares.items():
        torque = load.static_torque(flank)
        force = torque / (dog.mean_radius * load.bearing(dog, flank) * share)
        assert load.force_per_dog(dog, flank) == pytest.approx(force)
    printed = f"{shares['traction']:.2f} on the traction flank, {shares['braking']:.2f} on the "
    for parts in (checked.to_parts(), checked.explained):
        assert any(isinstance(part, str) and printed in part for part in parts)
    fixed = ds.Study("mq200", {"load.accuracy": None}).strength(simulate=False)
    assert fixed.load_sharing == {"traction": 0.5, "braking": 0.5}
    assert "(load.load_sharing)" in fixed.load_sharing_text
