"""Load sharing by number and accuracy against closed forms, and springs solved one by one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.errors import InputError
from dogshape.sim.shift.events import OVERLAPS
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.landing import demand_of
from dogshape.sim.strength.load_case import (
    LoadCase,
    landing_share,
    load_share,
    pitch_tolerance,
    tabled_share,
)
from tests.conftest import named_checks

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
    load = LoadCase(pitch_sd=micron * 1e-6, dog_stiffness=100e6)
    for count, share in zip((15, 23, 31), shares, strict=True):
        dog = replace(prototype, count=count, height=2.5e-3)
        assert load.sharing(dog, load.design_torque) == pytest.approx(share, abs=0.01)
    assert LoadCase().stiffness(prototype) == pytest.approx(100e6)


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
        assert force == pytest.approx(torque / (0.024 * 15) / load.sharing(prototype, torque))
    assert load.sharing(prototype, 90.0) < load.sharing(prototype, 300.0) < 1.0
    fixed = named_checks(prototype)["root_fatigue"].value
    found = named_checks(prototype, load)["root_fatigue"]
    share = load.sharing(prototype, 300.0)
    assert found.value == pytest.approx(fixed * 0.5 / share, rel=1e-12)


def test_foremost_dogs_bear_the_landing(prototype: Dog) -> None:
    """Edge pressure grows with the root of the load, which grows with that of the share."""
    load, line = LoadCase(accuracy=6), 54e3
    loads = tuple(line if abs(o - 0.1e-3) < 1e-9 else 0.0 for o in OVERLAPS)
    rough = demand_of(prototype, loads, Limits(load=load)).edge
    even = demand_of(prototype, loads, Limits(load=LoadCase(load_sharing=1.0))).edge
    share = load.landing(prototype, line)
    assert 1 / 15 < share < 1.0
    assert rough == pytest.approx(even * share**-0.25, rel=1e-12)
    assert load.landing(prototype, 10 * line) > share > load.landing(prototype, 0.1 * line)


def test_run_out_loads_flanks_and_tilt_loads_faces(prototype: Dog) -> None:
    plain = LoadCase(pitch_sd=2e-6)
    out, tilted = LoadCase(pitch_sd=2e-6, run_out=20e-6), LoadCase(pitch_sd=2e-6, tilt=5e-4)
    wave = 10e-6 * plain.stiffness(prototype) * prototype.mean_radius * 15 / 300.0
    assert out.sharing(prototype, 300.0) == pytest.approx(
        load_share(15, 0.2 * wave, wave), rel=1e-9
    )
    assert out.sharing(prototype, 300.0) < plain.sharing(prototype, 300.0)
    assert out.blow(prototype, 1e3) < plain.blow(prototype, 1e3) == tilted.blow(prototype, 1e3)
    assert tilted.landing(prototype, 5e4) < plain.landing(prototype, 5e4)
    assert out.landing(prototype, 5e4) == plain.landing(prototype, 5e4)
    assert tilted.sharing(prototype, 300.0) == plain.sharing(prototype, 300.0)


def test_keys_of_accuracy() -> None:
    plain = load_study("mq200_paper")
    study = load_study("mq200_paper", ["load.pitch_sd_um=3.0", "load.dog_stiffness_N_um=120"])
    assert study.limits.load.pitch_sd == pytest.approx(3e-6)
    assert study.limits.load.dog_stiffness == pytest.approx(120e6)
    assert study.physics_hash == plain.physics_hash
    assert load_study("mq200_paper", ["load.accuracy=6"]).limits.load.accuracy == 6
    for wrong, words in (
        (["load.accuracy=14"], "load.accuracy is 14, but it must lie between 1 and 11"),
        (["load.pitch_sd_um=-1"], "load.pitch_sd_um is -1 um"),
        (["load.dog_stiffness_N_um=0"], "load.dog_stiffness_N_um is 0 N/um"),
        (["load.accuracy=6", "load.pitch_sd_um=3"], "leave out one"),
        (["load.tilt_mrad=-1"], "load.tilt_mrad is -1 mrad, but"),
        (["load.run_out_um=2000"], "load.run_out_um is 2000 um"),
    ):
        with pytest.raises(InputError, match=words):
            load_study("mq200_paper", wrong)


@pytest.mark.parametrize("count", [6, 30])
def test_the_table_of_landings_is_what_it_interpolates(count: int) -> None:
    rng = np.random.default_rng(3)
    for size, wave in zip(10.0 ** rng.uniform(-3.0, 4.0, 40), 20 * [0.0, 0.4], strict=True):
        exact = landing_share(count, size, wave * size)
        assert tabled_share(count, size, wave * size) == pytest.approx(exact, rel=5e-4)
