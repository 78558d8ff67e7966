"""The flight up to the first touch: against closed forms, against Drake, and between its nodes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from dogshape.diagnosis.bench.flight_marks import FORCES, WAYS
from dogshape.diagnosis.prediction.flight import fly, touch_time
from dogshape.diagnosis.prediction.flight_table import FlightTables
from dogshape.diagnosis.prediction.levels import Level
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile, LaggedProfile
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import crossing
from tests.flying import EFFECTS, settings

GAP = 1e-3
LEVELS = np.array(WAYS) * GAP


@pytest.fixture(scope="module")
def plain() -> Setting:
    """The baseline at 315.5 N."""
    return next(s for s in settings() if s.point.profile.force == 315.5)


def _fly(setting: Setting) -> np.ndarray:
    return fly(setting, GAP, 315.5).times


@pytest.mark.parametrize("mass", [0.0, 0.2, 5.0])
@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_a_mass_under_a_step_flies_in_closed_form(plain: Setting, mass: float, lag: float) -> None:
    setting = plain.with_mechanism(added_mass=mass)
    if lag:
        setting = setting.with_point(profile=LaggedProfile(315.5, 0.2026, lag))
    profile = setting.point.profile
    exact = [profile.free_flight_time(level, 0.3 + mass) for level in LEVELS]
    assert _fly(setting)[: len(WAYS)] == pytest.approx(exact, abs=5e-6)


def test_the_force_passes_its_shares_when_the_profile_says(plain: Setting) -> None:
    found = _fly(plain)[len(WAYS) :]
    assert plain.point.profile.at(found) == pytest.approx(315.5 * np.array(FORCES), rel=1e-5)


def test_friction_under_a_constant_force_takes_its_part(plain: Setting) -> None:
    """t = sqrt(2 m x/(F - R)), half of the short rise later."""
    setting = plain.with_point(profile=ForceProfile(100.0, 1e-4)).with_mechanism(friction=40.0)
    exact = np.sqrt(2.0 * 0.3 * LEVELS / 60.0) + 0.5e-4
    assert fly(setting, GAP, 100.0).times[: len(WAYS)] == pytest.approx(exact, abs=6e-5)


def test_strong_damping_gives_the_speed_of_force_over_damper(plain: Setting) -> None:
    """x = (F/c)(t - (m/c)(1 - exp(-c t/m))) under a constant force."""
    damping = 800.0
    setting = plain.with_point(profile=ForceProfile(100.0, 1e-4)).with_mechanism(damping=damping)
    time = fly(setting, GAP, 100.0).times[: len(WAYS)] - 0.5e-4
    rate = damping / 0.3
    way = 100.0 / damping * (time - (1.0 - np.exp(-rate * time)) / rate)
    assert way == pytest.approx(LEVELS, rel=5e-3)


DRAKE: dict[str, Mapping[str, float]] = {
    "actuation_lag": {"lag_s": 0.03},
    "detent_force": {"detent_N": 60.0, "position_mm": 0.6},
    "force_scale": {"force_factor": 0.8},
    "free_play": {"free_play_mm": 0.4},
    "linkage_compliance": {"compliance_mm_kN": 8.0, "mass_behind_kg": 0.2},
    "moving_mass": {"added_mass_kg": 1.5},
    "sleeve_friction": {"friction_N": 65.0},
    "viscous_damping": {"damping_Ns_m": 150.0},
}


@pytest.mark.parametrize("sensor", ["sleeve", "actuator"])
@pytest.mark.parametrize("name", DRAKE)
def test_the_flight_is_that_of_a_shift_in_drake(plain: Setting, name: str, sensor: str) -> None:
    base = Setting(plain.clutch, plain.point, sensor=sensor)  # type: ignore[arg-type]
    setting = EFFECTS[name].apply(base, DRAKE[name])
    trace = engage(ClutchPlant(setting.clutch), setting.point, 0.1).trace
    way, speed = trace.displacement, trace.axial_speed
    if sensor == "actuator":
        way, speed = trace.actuator_displacement, trace.actuator_speed
    drake = [crossing(trace.time, way, speed, level) for level in LEVELS]
    assert _fly(setting)[: len(WAYS)] == pytest.approx(drake, abs=5e-5)


def test_a_ring_without_a_gap_touches_at_once(plain: Setting) -> None:
    """A small clutch has less gap than the range of its error, and the ends have to be computed."""
    assert touch_time(plain.with_dog(axial_gap=0.0)) == 0.0
    near = touch_time(plain.with_dog(axial_gap=1e-6))
    assert 0.0 < near < touch_time(plain.with_dog(axial_gap=1e-5)) < touch_time(plain)


HYPOTHESES = [
    ("actuation_lag",),
    ("linkage_compliance",),
    ("moving_mass",),
    ("sleeve_friction",),
    ("detent_force",),
    ("moving_mass", "sleeve_friction"),
    ("actuation_delay", "viscous_damping"),
]


@pytest.mark.parametrize("hypothesis", HYPOTHESES, ids="+".join)
def test_marks_between_nodes_err_no_more_than_they_say(
    plain: Setting, hypothesis: tuple[str, ...]
) -> None:
    """Against flights at random values: their law is the same, so its error does not count."""
    tables = FlightTables(EFFECTS, (plain,))
    parameters = [p for name in hypothesis for p in EFFECTS[name].parameters]
    shares = np.random.default_rng(1).random((10, len(parameters)))
    rows = [[p.at(s) for p, s in zip(parameters, row, strict=True)] for row in shares.tolist()]
    moving = tuple(name for name in hypothesis if name != "actuation_delay")
    said = tables.at(hypothesis, np.array(rows), plain.point.profile)
    changed = [Level(hypothesis, tuple(row)).setting(EFFECTS, plain) for row in rows]
    flown = np.array([_fly(setting) + setting.delay for setting in changed])
    table = tables._table(moving, plain.point.profile)
    first = len(parameters) - table.logs.ndim + 1
    own = table.at(np.array(rows)[:, first:]).error
    score = (said.times - flown) / np.hypot(own, 5e-5)
    assert np.sqrt((score**2).mean()) < 1.0
    assert np.median(abs(said.times - flown)) < 1e-4


def test_a_ring_without_an_axial_gap_passes_its_shares_at_once(plain: Setting) -> None:
    """Marks of the force are left, which an effect moves as it does elsewhere."""
    close = plain.with_dog(axial_gap=0.0)
    values = np.array([[0.05], [0.2]])
    near, far = (
        FlightTables(EFFECTS, (one,)).at(("actuation_lag",), values, plain.point.profile)
        for one in (close, plain)
    )
    assert np.isfinite(near.times).all()
    assert np.isfinite(near.error).all()
    assert near.times[:, : len(WAYS)].max() < 1e-4
    assert near.times[:, len(WAYS) :] == pytest.approx(far.times[:, len(WAYS) :], rel=1e-9)
