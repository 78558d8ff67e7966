"""Flank strike against the motion of the chain, and load sharing against springs one by one."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import dogshape as ds
from dogshape.pipeline.config.study_file import load_study, points_of, replace_keys, settings_of
from dogshape.pipeline.reports.text import value
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.sim.errors import InputError
from dogshape.sim.shift.geometry import FLANKS, Dog, flank_contact
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.strength.dog_strength import (
    Limits,
    Load,
    root_tension,
    strength_checks,
    strike_force,
    strike_torque,
)
from dogshape.sim.strength.landing import (
    class_middles,
    crests_of,
    demand_of,
    landing_stiffness,
)
from dogshape.sim.strength.load_case import (
    LoadCase,
    Share,
    landing_share,
    load_share,
    pitch_tolerance,
    tabled_share,
)
from dogshape.sim.strength.peak_force import contact_time
from dogshape.sim.strength.strike import Strike, two_mass_torque
from dogshape.sim.units import DEG, MPA, RPM
from tests.conftest import named_checks

DOGS = 15 * 62e6 * 0.024**2  #: N m/rad, 5e12 Pa/m on 3.1 by 4 mm
SPEED = 249 * RPM
CAR = Strike(5e-4, 0.01, 15e3, 0.6048, 0.6048, mismatch=(SPEED,))
WHOLE = 0.01 * 0.6048 / 0.6148


@njit
def _march(speed, chain, springs, flanks, way):  # type: ignore[no-untyped-def]
    """Integrate the strike in small even steps and return the largest torque of the dogs, N m.

    Flanks press only, and give back the share ``back`` of the speed: they load with the stiffness
    and unload with its product with the square of that share. The spline has its play on the side
    that the far inertia closes. Speeds before places, which keeps the energy of a spring.
    """
    inertia, (first, stiffness, last) = chain, springs
    (play, back), (span, step) = flanks, way
    angle, turning, largest = np.zeros(4), np.array([speed, speed, 0.0, 0.0]), 0.0
    for _ in range(int(span / step)):
        dogs = stiffness * max(angle[1] - angle[2], 0.0)
        if turning[1] < turning[2]:
            dogs *= back * back
        lead = angle[0] - angle[1]
        shaft = first * (max(lead - play, 0.0) + min(lead, 0.0))
        out = last * (angle[2] - angle[3])
        turning += step * np.array([-shaft, shaft - dogs, dogs - out, out]) / inertia
        angle += step * turning
        largest = max(largest, dogs)
    return largest


def _motion(strike: Strike, speed: float = SPEED, stiffness: float = DOGS) -> float:
    """Return the largest torque in N m until the far inertia has wound up its shaft."""
    near, wheel = strike.ring_inertia, strike.wheel_inertia
    far, rest = strike.sliding_inertia - near, strike.output_inertia - wheel
    span = 0.5 * math.pi * math.sqrt(far / strike.input_stiffness) + 3 * strike.backlash / speed
    step = 5e-3 / math.sqrt(stiffness * (1.0 / near + 1.0 / wheel))
    chain = np.array([far, near, wheel, rest or 1.0])
    springs = (strike.input_stiffness, stiffness, strike.output_stiffness or 0.0)
    flanks = (strike.backlash, strike.restitution)
    return float(_march(speed, chain, springs, flanks, (span, step)))


def test_rigid_shafts_stop_the_whole_inertias_and_soft_ones_the_ring_alone() -> None:
    rigid = replace(CAR, input_stiffness=1e9, wheel_inertia=0.005, output_stiffness=1e9)
    whole = SPEED * math.sqrt(DOGS * WHOLE)
    assert rigid.torque(SPEED, DOGS) == pytest.approx(whole, rel=0.01)
    soft = replace(rigid, input_stiffness=1e-2, output_stiffness=1e-2, restitution=0.0)
    near = SPEED * math.sqrt(DOGS * 5e-4 * 0.005 / 0.0055)
    assert soft.torque(SPEED, DOGS) == pytest.approx(near, rel=0.01)
    alone = replace(CAR, ring_inertia=0.01)
    assert alone.torque(SPEED, DOGS) == pytest.approx(whole, rel=1e-12)
    assert whole == pytest.approx(1890, abs=10)


@pytest.mark.parametrize("stiffness", [5e3, 5e4, 5e5])
@pytest.mark.parametrize("wheel", [0.004, 0.3])
def test_modes_are_those_of_the_chain_that_stays_closed(stiffness: float, wheel: float) -> None:
    """The largest torque of a long motion, by matrix exponential, comes near their sum."""
    one = replace(
        CAR, input_stiffness=stiffness, wheel_inertia=wheel, output_stiffness=3e4, restitution=0.0
    )
    inertia = np.array([0.0095, 5e-4, wheel, 0.6048 - wheel])
    forces = np.zeros((4, 4))
    for i, spring in enumerate((stiffness, DOGS, 3e4)):
        forces[i : i + 2, i : i + 2] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    whole = np.block(
        [[np.zeros((4, 4)), np.eye(4)], [-forces / inertia[:, None], np.zeros((4, 4))]]
    )
    step = expm(whole * 4e-6)
    state, largest = np.array([0.0] * 4 + [SPEED, SPEED, 0.0, 0.0]), 0.0
    for _ in range(60_000):
        state = step @ state
        largest = max(largest, abs(DOGS * (state[1] - state[2])))
    found = one.torque(SPEED, DOGS)
    assert largest <= found * 1.001
    assert largest >= 0.93 * found


def test_strike_covers_the_motion_of_most_chains() -> None:
    """Chains drawn at random, e up to 0.25.

    All with a rigid output side, up to 4 %; 19 of 20 where that side has a shaft.
    """
    rng, shares = np.random.default_rng(3), {False: [], True: []}
    for index in range(1000):
        elastic = index % 2 == 1
        speed, dogs = 10 ** rng.uniform(0.3, 1.7), 10 ** rng.uniform(5, 6.3)
        ring, far = 10 ** rng.uniform(-4, -2.5), 10 ** rng.uniform(-2.5, -1.3)
        wheel, rest = (10 ** rng.uniform(-3, -1), 0.6) if elastic else (0.6, 0.0)
        one = Strike(
            ring_inertia=ring,
            sliding_inertia=ring + far,
            input_stiffness=10 ** rng.uniform(3, 5.5),
            wheel_inertia=wheel,
            output_inertia=wheel + rest,
            output_stiffness=10 ** rng.uniform(2, 5) if elastic else None,
            backlash=rng.choice([0.0, 10 ** rng.uniform(-2, 0)]) * DEG,
            restitution=float(rng.choice([0.0, 0.1, 0.25])),
        )
        share = _motion(one, speed, dogs) / one.torque(speed, dogs)
        shares[elastic].append(share)
    assert max(shares[False]) < 1.04
    assert np.quantile(shares[False], 0.98) < 1.005
    assert np.quantile(shares[True], 0.95) < 1.01
    for found in shares.values():
        assert min(found) > 0.38
        assert np.median(found) > 0.7


@pytest.mark.parametrize("backlash", [0.0, 0.2, 1.0, 20.0])
def test_ring_is_thrown_again_as_a_spring_with_a_moving_end_throws_it(backlash: float) -> None:
    one = replace(CAR, restitution=0.3, backlash=backlash * DEG)
    rate = one.input_stiffness / one.ring_inertia

    def slope(time: float, state: np.ndarray) -> list[float]:
        lead = SPEED * time - state[0] - one.backlash
        return [state[1], rate * max(lead, 0.0)]

    def back(time: float, state: np.ndarray) -> float:
        return float(state[0]) if time > 1e-7 else -1.0

    back.terminal, back.direction = True, 1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        slope, (0.0, 1.0), [0.0, -0.3 * SPEED], events=back, max_step=1e-5, rtol=1e-8, atol=1e-12
    )
    assert one.second_speed(SPEED) == pytest.approx(found.y[1, -1], rel=1e-3)
    assert one.second_speed(SPEED) <= 2.3 * SPEED * (1.0 + 1e-12)
    stays = replace(one, restitution=0.0)
    assert stays.second_speed(SPEED) == pytest.approx(0.0, abs=1e-6 * SPEED)


def test_dogs_bear_the_strike_as_by_hand(prototype: Dog) -> None:
    limits = Limits(strikes=(CAR,))
    pair_stiffness = limits.load.stiffness(prototype, "traction")
    torque = CAR.torque(SPEED, 15 * pair_stiffness * 0.024**2)
    assert strike_torque(prototype, limits, CAR, "traction") == pytest.approx(torque)
    force = torque / 0.024 / 15 * math.sqrt(2.0)
    assert strike_force(prototype, limits, CAR, "traction") == pytest.approx(force)
    checks = named_checks(prototype, limits)
    contact = flank_contact(prototype, 0.3e-3, "traction")
    tension = root_tension(prototype, 0.3e-3, Load(force, "traction", contact.level(0.9)))
    assert checks["flank_strike_root"].value == pytest.approx(tension / MPA)
    assert checks["flank_strike_root"].limit == pytest.approx(2 * 430 * 2.5 / 1.2)
    assert checks["flank_strike_flank"].value == pytest.approx(force / contact.area / MPA)
    assert checks["flank_strike_flank"].limit == pytest.approx(2288 / 1.2, rel=1e-3)
    rough = Limits(load=LoadCase(accuracy=8), strikes=(CAR,))
    share = rough.load.blow(prototype, torque / 0.024 / 15)
    assert strike_force(prototype, rough, CAR, "traction") == pytest.approx(
        torque / 0.024 / 15 / math.sqrt(share)
    )


def test_a_number_of_strikes_asks_for_fatigue_too(prototype: Dog) -> None:
    def limit(strikes: float | None) -> float:
        limits = Limits(strikes=(replace(CAR, strikes=strikes),))
        return named_checks(prototype, limits)["flank_strike_root"].limit

    assert limit(1e5) == pytest.approx(Limits().endurance(1e5) / MPA)
    assert limit(3e6) == pytest.approx(860 * 0.7 / 1.2)
    assert limit(100.0) == pytest.approx(0.7 * limit(None))


def test_each_sign_of_the_mismatch_strikes_its_own_flank(prototype: Dog) -> None:
    both = replace(CAR, mismatch=(SPEED, 0.5 * SPEED, -0.4 * SPEED))
    assert both.flanks == ("traction", "braking")
    assert both.speed("traction") == SPEED
    assert both.speed("braking") == pytest.approx(0.4 * SPEED)
    assert CAR.flanks == ("traction",)
    still = Limits(strikes=(replace(CAR, mismatch=(0.0,)),))
    checks = named_checks(prototype, still)
    assert checks["flank_strike_root"].value == 0.0


def test_keys_of_the_strike() -> None:
    keys = ["strike.ring_inertia_kgm2=5e-4", "strike.input_stiffness_Nm_rad=15e3"]
    plain, study = load_study("mq200_paper"), load_study("mq200_paper", keys)
    assert plain.limits.strikes == ()
    assert study.physics_hash == plain.physics_hash
    (strike,) = study.limits.strikes
    assert strike.speed("traction") == pytest.approx(SPEED)
    assert strike.wheel_inertia == strike.output_inertia == 0.6048
    (rigid,) = set(notes_of(study)) - set(notes_of(plain))
    assert "rigid at the flanks, [strike] judges a ring on its shaft" in rigid


RING = ["mechanism.ring_inertia_kgm2=5e-4", "mechanism.input_stiffness_Nm_rad=15e3"]


def test_a_strike_has_ring_and_shafts_of_the_mechanism() -> None:
    more = ["mechanism.spline_backlash_deg=0.4", "mechanism.wheel_inertia_kgm2=0.008",
            "mechanism.output_stiffness_Nm_rad=320"]  # fmt: skip
    study = load_study("mq200_paper", [*RING, *more, "strike.strikes=1000"])
    (strike,) = study.limits.strikes
    mechanism = study.clutch.mechanism
    for name in ("ring_inertia", "input_stiffness", "wheel_inertia", "output_stiffness"):
        assert getattr(strike, name) == pytest.approx(getattr(mechanism, name), rel=1e-12)
    assert strike.backlash == pytest.approx(0.4 * DEG)
    about = load_study("mq200_paper", [*RING, "strike.ring_inertia_kgm2=[2e-4, 1e-3]"])
    assert [one.ring_inertia for one in about.limits.strikes] == pytest.approx([2e-4, 1e-3])
    assert {one.input_stiffness for one in about.limits.strikes} == {15e3}
    assert not any("rigid at the flanks" in note for note in notes_of(about))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("strike.ring_inertia_kgm2=4e-4", "mechanism.ring_inertia_kgm2 is 0.0005 kg m2, but"),
        ("strike.ring_inertia_kgm2=[6e-4, 1e-3]", "= [0.0006, 0.001] is to hold it, one value"),
        ("strike.input_stiffness_Nm_rad=2e4", "leave out strike.input_stiffness_Nm_rad"),
    ],
)
def test_two_values_of_one_ring_are_refused(given: str, words: str) -> None:
    with pytest.raises(InputError, match=re.escape(words)):
        load_study("mq200_paper", [*RING, given])


def test_the_ring_shrinks_with_a_smaller_sliding_side() -> None:
    """0.0008 of 0.01 kg m2: at most half of it is ring, unless that is given."""
    keys = ["strike.ring_inertia_kgm2=[2e-4, 1e-3]", "strike.input_stiffness_Nm_rad=15e3"]
    study = replace_keys(load_study("mq200_paper", keys), {"sliding.inertia_kgm2": 8e-4})
    ends = [one.ring_inertia for one in study.limits.strikes]
    assert ends == pytest.approx([0.4 * 2e-4, 0.4 * 1e-3])
    ring = load_study("mq200_paper", RING)
    for whole, part in ((8e-4, 4e-4), (1e-3, 5e-4), (5e-3, 5e-4), (0.02, 5e-4)):
        sized = replace_keys(ring, {"sliding.inertia_kgm2": whole})
        assert sized.clutch.mechanism.ring_inertia == pytest.approx(part)
    own = {"sliding.inertia_kgm2": 8e-4, "mechanism.ring_inertia_kgm2": 6e-4}
    assert replace_keys(ring, own).clutch.mechanism.ring_inertia == 6e-4
    most = replace_keys(ring, {"mechanism.ring_inertia_kgm2": 8e-3})
    nearly = replace_keys(most, {"sliding.inertia_kgm2": 9e-3})
    assert nearly.clutch.mechanism.ring_inertia == pytest.approx(0.9 * 8e-3)


@pytest.mark.parametrize(
    "shape",
    [{}, {"dog.chamfer_deg": 10.52, "dog.traction_deg": 13.68, "dog.braking_deg": 20.96,
          "dog.height_mm": 2.4, "dog.count": 30}],
)  # fmt: skip
def test_the_stiffness_of_the_checks_bounds_strikes_of_rigid_sides(shape: dict[str, float]) -> None:
    """Two rigid inertias on the stiffness of the dogs at the whole mismatch: at most twice."""
    study = load_study("mq200_paper", {**shape, "solver.engine": "planar"})
    dog, rings = study.clutch.dog, study.clutch.rings
    (point,) = points_of(study, (249.0, 469.0, None))
    turns = (np.arange(8) + 0.37) / 8 * dog.pitch_angle
    shifts = [engage(study.clutch, point, angle) for angle in turns.tolist()]
    peak = max(one.loads.peak_tangential_force for one in shifts) * dog.mean_radius
    load = study.limits.load
    pair_stiffness = max(load.stiffness(dog, flank) for flank in FLANKS)
    stiffness = dog.count * pair_stiffness * dog.mean_radius**2
    bound = two_mass_torque(SPEED, stiffness, rings.sliding_inertia, rings.output_inertia)
    assert 0.5 * bound < peak < bound


def test_contact_time_is_that_of_a_half_sine() -> None:
    """A mass of 0.3 kg on 3e8 N/m: pi sqrt(m/k); a steady push beside it counts nothing."""
    span = math.pi * math.sqrt(0.3 / 3e8)
    time = np.linspace(0.0, 10.0 * span, 40_001)
    force = np.where(time < span, 1e4 * np.sin(math.pi * time / span), 100.0)
    assert contact_time(time, force) == pytest.approx(span, rel=2e-3)


@pytest.mark.parametrize(("mass", "stiffness", "rigid"), [(0.3, 5e12, True), (3.0, 5e13, False)])
def test_a_contact_shorter_than_a_stress_wave_has_no_rigid_ring(
    mass: float, stiffness: float, rigid: bool
) -> None:
    """3 kg on the annulus of 52/44 mm are a ring of 0.63 m: 0.25 ms through it and back."""
    keys = {"sliding.mass_kg": mass, "contact.stiffness_Pa_m": stiffness}
    shift = ds.Study("mq200_paper", {**keys, "solver.engine": "planar"}).shift(
        mismatch_rpm=5, force_N=235.2, angle_deg=1
    )
    found = shift.to_dict()["loads"]
    assert found["stress_wave_time_s"] == pytest.approx(24.5e-6 * mass / 0.3, rel=1e-3)
    assert found["axially_rigid"] is rigid
    words = "\n".join(one for one in shift.to_parts() if isinstance(one, str))
    assert ("peak axial force below" in words) is not rigid


def test_a_shift_prints_the_force_of_its_strike() -> None:
    """Closed form of ring and shaft at the speed that the hardest strike took."""
    keys = ["strike.ring_inertia_kgm2=5e-4", "strike.input_stiffness_Nm_rad=15e3"]
    study = ds.Study("mq200_paper", settings_of([*keys, "solver.engine=planar"]))
    shift = study.shift(mismatch_rpm=249, force_N=469, angle_deg=1)
    loads, limits = shift.engagement.loads, study.config.limits
    dog, (strike,) = study.config.clutch.dog, limits.strikes
    pair_stiffness = max(limits.load.stiffness(dog, flank) for flank in FLANKS)
    stiffness = dog.count * pair_stiffness * dog.mean_radius**2
    force = strike.torque(abs(loads.strike_mismatch), stiffness) / dog.mean_radius
    assert shift.to_dict()["loads"]["strike_force_N"] == pytest.approx(force, rel=1e-12)
    assert force < loads.peak_tangential_force
    words = "\n".join(one for one in shift.to_parts() if isinstance(one, str))
    assert f"peak tangential force {value('_N', force)} by [strike]" in words


def test_a_range_is_judged_at_its_worst_end() -> None:
    """Between the ends no torque is larger, and the check has the margin of the worst one."""
    inertia, stiffness = (2e-4, 1e-3), (10e3, 20e3)
    keys = {"strike.ring_inertia_kgm2": [*inertia], "strike.input_stiffness_Nm_rad": [*stiffness]}
    study = load_study("mq200_paper", keys)
    dog, ends = study.clutch.dog, study.limits.strikes
    assert len(ends) == 4
    between = [
        replace(ends[0], ring_inertia=one, input_stiffness=other).torque(SPEED, DOGS)
        for one in np.geomspace(*inertia, 9)
        for other in np.geomspace(*stiffness, 9)
    ]
    assert max(between) == max(end.torque(SPEED, DOGS) for end in ends)
    for check in strength_checks(dog, study.limits):
        alone = [named_checks(dog, replace(study.limits, strikes=(end,))) for end in ends]
        assert check.margin == min(one[check.name].margin for one in alone)
        if check.name.startswith("flank_strike"):
            assert check.ends == "ring_inertia_kgm2 = 0.001, input_stiffness_Nm_rad = 20000"


SCATTERS = (0.05, 0.3, 1.0, 5.0)


@pytest.mark.parametrize("scatter", SCATTERS)
def test_two_dogs_share_as_the_half_normal_gap_between_them_says(scatter: float) -> None:
    spread = math.sqrt(2.0) * scatter
    taken = spread * math.sqrt(2.0 / math.pi) * (
        1.0 - math.exp(-2.0 / spread**2)
    ) + 2.0 * math.erfc(math.sqrt(2.0) / spread)
    assert load_share(2, scatter) == pytest.approx(1.0 / (1.0 + 0.5 * taken), rel=0.01)


@pytest.mark.parametrize("scatter", SCATTERS)
def test_two_dogs_land_as_the_half_normal_gap_between_them_says(scatter: float) -> None:
    spread = math.sqrt(2.0) * scatter

    def peak(z: float) -> float:
        one = math.sqrt(2.0)
        both = 0.5 * (z + math.sqrt(max(4.0 - z * z, 0.0)))
        density = math.sqrt(2.0 / math.pi) / spread * math.exp(-0.5 * (z / spread) ** 2)
        return (one if z >= one else both) * density

    mean = quad(peak, 0.0, 12.0 * spread, points=[math.sqrt(2.0)], limit=200)[0]
    assert landing_share(2, scatter) == pytest.approx(1.0 / mean**2, rel=0.01)


@pytest.mark.parametrize("count", [2, 9, 36])
@pytest.mark.parametrize("wave", [0.1, 0.4])
def test_a_slow_error_alone_has_a_closed_form_while_all_touch(count: int, wave: float) -> None:
    """Mean of the largest of N cosines a step apart: sin(pi/N)/(pi/N)."""
    foremost = wave * math.sin(math.pi / count) / (math.pi / count)
    assert load_share(count, 0.0, wave) == pytest.approx(1.0 / (1.0 + foremost), rel=2e-3)
    if count > 2:  # the squares of two opposite cosines are not half in every phase
        landed = math.sqrt(1.0 - 0.5 * wave**2) + foremost
        assert landing_share(count, 0.0, wave) == pytest.approx(landed**-2, rel=2e-3)


def test_a_wide_slow_error_lands_on_an_arc() -> None:
    """Many dogs, wave far above the approach: a parabola's arc, 2/15 (2d)^(5/2)/(pi sqrt a) = 1."""
    wave, count = 50.0, 20_000
    shifts = np.cos(2.0 * np.pi * np.arange(count) / count)
    gaps = wave * (1.0 - shifts)
    depth = brentq(lambda d: float((np.maximum(d - gaps, 0.0) ** 2).mean()) - 1.0, 0.0, 100.0)
    closed = (15.0 * math.pi * math.sqrt(wave / 2.0) / 8.0) ** 0.4
    assert depth == pytest.approx(closed, rel=0.02)
    assert landing_share(360, 0.0, wave) == pytest.approx(depth**-2, rel=0.02)


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("count", [7, 31])
def test_shares_are_those_of_springs_solved_one_by_one(power: int, count: int) -> None:
    """Force (power 1) and energy (power 2) of other draws, by a root finder."""
    scatter, rng, found = 0.6, np.random.default_rng(5), []
    for _ in range(600):
        gaps = scatter * rng.standard_normal(count)

        def left(approach: float, gaps: np.ndarray = gaps) -> float:
            return float((np.maximum(approach - gaps, 0.0) ** power).sum()) - count

        found.append(brentq(left, gaps.min(), gaps.max() + 2.0) - gaps.min())
    error = np.std(found) / math.sqrt(len(found)) / np.mean(found)
    share = {1: load_share(count, scatter), 2: landing_share(count, scatter)}[power]
    assert share == pytest.approx(np.mean(found) ** -power, rel=3.0 * power * error)
    assert error < 0.015


@pytest.mark.parametrize(
    ("micron", "shares"), [(5.0, (0.49, 0.37, 0.30)), (2.0, (0.71, 0.58, 0.50))]
)
def test_share_falls_with_the_number_of_dogs(
    prototype: Dog, micron: float, shares: tuple[float, ...]
) -> None:
    """Springs of 100 N/um at 200 N m with 1.5 on 24 mm, as computed apart from this project."""
    plain = LoadCase(pitch_sd=micron * 1e-6)
    for count, share in zip((15, 23, 31), shares, strict=True):
        dog = replace(prototype, count=count, height=2.5e-3)
        load = replace(plain, dog_stiffness_factor=100e6 / plain.stiffness(dog))
        assert load.stiffness(dog) == pytest.approx(100e6)
        assert load.sharing(dog, load.design_torque) == pytest.approx(share, abs=0.01)


def test_pitch_tolerance_is_that_of_the_standard(prototype: Dog) -> None:
    """ISO 1328-1:2013, 48 mm and module 3.2: 6.3 um in class 5, and sqrt 2 a class."""
    assert pitch_tolerance(5, 48e-3, 15) == pytest.approx(6.328e-6, rel=1e-9)
    assert pitch_tolerance(7, 48e-3, 15) == pytest.approx(2 * 6.328e-6, rel=1e-9)
    assert LoadCase(accuracy=6).scatter(prototype) == pytest.approx(
        6.328e-6 * math.sqrt(2.0) / 3.0, rel=1e-9
    )
    assert LoadCase().scatter(prototype) is None


def test_the_most_loaded_dog_takes_what_the_share_leaves_it(prototype: Dog) -> None:
    load = LoadCase(accuracy=6, coast_share=0.3)
    for flank, torque in (("traction", 300.0), ("braking", 90.0)):
        force = load.force_per_dog(prototype, flank)
        assert force == pytest.approx(
            torque / (0.024 * 15) / load.sharing(prototype, torque, flank)
        )
        assert load.sharing(prototype, torque, flank) < 1.0
    assert load.sharing(prototype, 90.0) < load.sharing(prototype, 300.0)
    fixed = named_checks(prototype)["root_fatigue"].value
    found = named_checks(prototype, load)["root_fatigue"]
    share = load.sharing(prototype, 300.0)
    assert found.value == pytest.approx(fixed * 0.5 / share, rel=1e-12)


def test_foremost_dogs_bear_the_landing(prototype: Dog) -> None:
    """Face pressure grows with the root of the share, of load and stiffness as they land."""
    load, line = LoadCase(accuracy=6), 54e3
    loads = tuple(line if abs(o - 1.4e-3) < 1e-9 else 0.0 for o in OVERLAPS)
    rough = demand_of(prototype, loads, Limits(load=load)).face
    even = demand_of(prototype, loads, Limits(load=LoadCase(load_sharing=1.0))).face
    crests = crests_of(prototype, Limits())
    overlap = class_middles(crests)[14]
    stiffness = float(landing_stiffness(crests, overlap, line)) * prototype.radial_width
    layer = load.contact.stiffness * overlap * prototype.radial_width
    force = line * prototype.radial_width * math.sqrt(stiffness / layer)
    share = load.landing(prototype, force, stiffness)
    assert 1 / 15 < share < 1.0
    assert rough == pytest.approx(even * share**-0.5, rel=1e-9)
    shares = [load.landing(prototype, factor * force, stiffness) for factor in (10.0, 0.1)]
    assert shares[0] > share > shares[1]


def test_run_out_loads_flanks_and_tilt_loads_faces(prototype: Dog) -> None:
    plain = LoadCase(pitch_sd=2e-6)
    out, tilted = LoadCase(pitch_sd=2e-6, run_out=20e-6), LoadCase(pitch_sd=2e-6, tilt=5e-4)
    wave = 10e-6 * plain.stiffness(prototype) * prototype.mean_radius * 15 / 300.0
    assert out.sharing(prototype, 300.0) == pytest.approx(
        load_share(15, 0.2 * wave, wave), rel=5e-4
    )
    assert out.sharing(prototype, 300.0) < plain.sharing(prototype, 300.0)
    assert out.blow(prototype, 1e3) < plain.blow(prototype, 1e3) == tilted.blow(prototype, 1e3)
    landing = 200.0, 6e7
    assert tilted.landing(prototype, *landing) < plain.landing(prototype, *landing)
    assert out.landing(prototype, *landing) == plain.landing(prototype, *landing)
    assert tilted.sharing(prototype, 300.0) == plain.sharing(prototype, 300.0)


def test_keys_of_accuracy() -> None:
    plain = load_study("mq200_paper")
    study = load_study("mq200_paper", ["load.pitch_sd_um=3.0"])
    assert study.limits.load.pitch_sd == pytest.approx(3e-6)
    assert study.physics_hash == plain.physics_hash
    assert load_study("mq200_paper", ["load.accuracy=6"]).limits.load.accuracy == 6


@pytest.mark.parametrize("share", [load_share, landing_share])
@pytest.mark.parametrize("count", [6, 30])
def test_a_table_of_shares_is_what_it_interpolates(share: Share, count: int) -> None:
    sizes = 10.0 ** np.random.default_rng(3).uniform(-3.0, 4.0, 40)
    for wave in (0.0, 0.4):
        exact = [share(count, size, wave * size) for size in sizes.tolist()]
        found = [tabled_share(share, count, size, 1.0, wave) for size in sizes.tolist()]
        assert tabled_share(share, count, sizes, 1.0, wave).tolist() == found
        assert found == pytest.approx(exact, rel=5e-4)
