"""Mechanisms around the sliding ring against closed forms of its motion without contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import HeldActuator, Outcome, engage
from dogshape.sim.shift.drive import Drive
from dogshape.sim.shift.mechanism import DAMPING_RATIO, FORK_MASS_SHARE, Mechanism
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import Trace
from dogshape.sim.statistics import blocks
from dogshape.sim.units import DEG, RPM
from tests.conftest import Point

Flight = Callable[..., Trace]

STEP = 1e-4  #: s, rise of a force that is as good as constant from half of it on


def _far(clutch: Clutch, time: float, **mechanism: float) -> Clutch:
    """Return a clutch with a mechanism whose dogs stand far apart, for ``time`` s."""
    far = replace(clutch, dog=replace(clutch.dog, axial_gap=90e-3))
    return replace(far, timeout=time, mechanism=Mechanism(**mechanism))


@pytest.fixture
def flight(clutch: Clutch) -> Flight:
    """Let the ring fly with a mechanism, dogs far apart, for ``time`` s."""

    def fly(profile: ForceProfile, time: float, engine: str = "drake", **mechanism: float) -> Trace:
        far = _far(clutch, time, **mechanism)
        own = far if engine == "drake" else far.with_engine(engine)
        result = blocks.engage(own, OperatingPoint(50 * RPM, profile), 0.0)
        assert result.outcome is Outcome.TIMED_OUT
        assert result.trace.displacement.max() < 90e-3
        assert np.abs(result.trace.contact_force).max() < 0.01 * profile.force
        return result.trace

    return fly


def test_added_mass_flies_with_the_ring(flight: Flight, point: Point) -> None:
    profile = point(50, 235.2).profile
    trace = flight(profile, 0.06, added_mass=1.7)
    assert trace.displacement[-1] == pytest.approx(profile.free_flight(0.06, 2.0), rel=1e-3)


def test_friction_holds_the_ring_until_the_force_exceeds_it(flight: Flight, point: Point) -> None:
    """From the time t0 at which F = R on, m v is what F - R gave since."""
    profile, mass, friction = point(50, 235.2).profile, 0.3, 60.0
    trace = flight(profile, 0.13, friction=friction)
    times = np.linspace(0.0, 0.13, 200_001)
    over = np.maximum(profile.at(times) - friction, 0.0)
    speed = np.cumsum(over) * (times[1] - times[0]) / mass
    way = np.cumsum(speed) * (times[1] - times[0])
    begin = float(times[np.argmax(over > 0.0)])
    assert np.interp(begin, trace.time, trace.displacement) < 1e-4
    assert trace.displacement[-1] == pytest.approx(way[-1], rel=0.02)
    assert trace.time[0] == 0.0
    turned = trace.relative_angle / (50 * RPM)
    assert turned == pytest.approx(trace.time, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("regularised", [2e-3, 5e-4])
def test_the_velocity_that_smooths_friction_does_not_matter(
    clutch: Clutch, point: Point, monkeypatch: pytest.MonkeyPatch, regularised: float
) -> None:
    """Twice and half of it move a slow shift, dog on dog, by less than 1 %."""
    slow = ClutchPlant(replace(clutch, mechanism=Mechanism(friction=50.0)))
    usual = engage(slow, point(10, 235.2), 0.0).shift_time
    monkeypatch.setattr("dogshape.sim.shift.mechanism.SMOOTH_SPEED_M_S", regularised)
    assert engage(slow, point(10, 235.2), 0.0).shift_time == pytest.approx(usual, rel=0.01)


def test_oil_damps_as_its_equation_says(flight: Flight) -> None:
    """v = F/c (1 - exp(-c t/m))."""
    force, damping = 100.0, 60.0
    trace = flight(ForceProfile(force, STEP), 0.04, damping=damping)
    exact = force / damping * (1.0 - np.exp(-damping / 0.3 * (trace.time - 0.5 * STEP)))
    late = trace.time > 0.002
    assert trace.axial_speed[late] == pytest.approx(exact[late], rel=1e-3)


@pytest.mark.parametrize("lag", [0.002, 0.05, 0.4])
def test_lagged_force_is_the_convolution_of_the_step(lag: float) -> None:
    """y = int u(t - z) exp(-z/tau) dz / tau; the quadrature errs by (step/tau)^2/12."""
    profile, plain = ForceProfile(300.0, 0.2, lag=lag), ForceProfile(300.0, 0.2)
    fine = np.linspace(0.0, 0.6, 3001)
    kernel = np.exp(-fine / lag) / lag * fine[1]
    kernel[0] *= 0.5
    exact = np.convolve(plain.at(fine), kernel)[: len(fine)]
    assert profile.at(fine) == pytest.approx(exact, rel=(fine[1] / lag) ** 2 / 6, abs=5e-3)
    speed = cumulative_trapezoid(profile.at(fine), fine, initial=0.0) / 0.3
    assert profile.free_speed(fine, 0.3) == pytest.approx(speed, rel=1e-3, abs=1e-5)
    way = cumulative_trapezoid(speed, fine, initial=0.0)
    assert profile.free_flight(fine, 0.3) == pytest.approx(way, rel=1e-3, abs=1e-6)
    assert profile.free_flight_time(way[500], 0.3) == pytest.approx(fine[500], rel=1e-3)


@pytest.mark.parametrize("engine", ["planar", "drake"])
def test_a_detent_gives_back_in_its_seat_what_the_ring_climbed(flight: Flight, engine: str) -> None:
    """m v2/2 = F x before and beyond both peaks, less (8/15) D w between: the work of the hump."""
    hill = {"detent": 80.0, "detent_position": 3e-3, "detent_seat": 6e-3, "added_mass": 4.7}
    trace = flight(ForceProfile(120.0, 20 * STEP), 0.03, engine, **hill)
    way = trace.displacement[1:]
    force = 0.5 * (trace.shift_force[1:] + trace.shift_force[:-1])
    work = np.cumsum(np.diff(trace.displacement) * force)
    lost, top = work - 0.5 * 5.0 * trace.axial_speed[1:] ** 2, 8.0 / 15.0 * 80.0 * 1e-3
    before, between, beyond = way < 2.5e-3, (way > 3.5e-3) & (way < 5.5e-3), way > 6.5e-3
    assert min(before.sum(), between.sum(), beyond.sum()) > 2
    assert lost[between] == pytest.approx(top, rel=0.01)
    assert np.abs(lost[before | beyond]).max() < 0.01 * top


def test_a_seated_ring_is_held_by_the_peak_force() -> None:
    """The pull has no work over the whole way, and D on the way back out of the seat."""
    hill = Mechanism(detent=80.0, detent_position=0.5e-3, detent_width=1e-3, detent_seat=4.2e-3)
    way = np.linspace(0.0, 5e-3, 5001)
    force = -hill.resistance(way, 0.0 * way, 0.0 * way)
    assert (way[force.argmin()], force.min()) == pytest.approx((0.5e-3, -80.0))
    assert (way[force.argmax()], force.max()) == pytest.approx((4.2e-3, 80.0))
    energy = cumulative_trapezoid(force, way, initial=0.0)
    assert energy[-1] == pytest.approx(0.0, abs=1e-9)
    assert energy[2000] == pytest.approx(-8.0 / 15.0 * 80.0 * 1e-3, rel=1e-6)


def test_the_actuator_runs_ahead_by_force_over_stiffness(clutch: Clutch, point: Point) -> None:
    """Dog on dog, held by friction: the ring stands, and the sensor at the actuator does not."""
    low = replace(clutch, dog=replace(clutch.dog, chamfer=4.5 * DEG))
    held = replace(low, mechanism=Mechanism(compliance=4e-6))
    result = engage(ClutchPlant(held), OperatingPoint(0.0, point(5, 641.5).profile), 0.0)
    assert result.outcome is Outcome.BLOCKED
    trace = result.trace
    ahead = trace.actuator_displacement[-1] - trace.displacement[-1]
    assert ahead == pytest.approx(4e-6 * trace.shift_force[-1], rel=0.01)
    assert trace.contact_force[-1] == pytest.approx(trace.shift_force[-1], rel=0.01)


def test_play_closes_in_free_flight_and_hands_on_the_momentum(flight: Flight, point: Point) -> None:
    """The actuator alone flies through the play; then both masses share what the force gave."""
    profile, play, added = point(50, 235.2).profile, 0.5e-3, 0.27
    trace = flight(profile, 0.05, free_play=play, added_mass=added)
    far, near = FORK_MASS_SHARE * 0.3 + added, (1.0 - FORK_MASS_SHARE) * 0.3
    closing = profile.free_flight_time(play, far)
    alone = trace.time < closing
    exact = profile.free_flight(trace.time[alone], far)
    assert trace.actuator_displacement[alone] == pytest.approx(exact, abs=2e-6)
    assert np.abs(trace.displacement[alone]).max() < 1e-12
    momentum = far * trace.actuator_speed + near * trace.axial_speed
    assert momentum == pytest.approx(profile.free_speed(trace.time, 1.0), rel=1e-3, abs=1e-4)
    assert trace.displacement[-1] > 2e-3
    closing_speed = trace.actuator_speed - trace.axial_speed
    first = int(np.argmax(trace.displacement > 1e-9))
    back = -closing_speed[first : first + 15].min() / closing_speed[first - 1]
    assert math.exp(-math.pi * DAMPING_RATIO / math.sqrt(1 - DAMPING_RATIO**2)) < back < 0.7


def test_drag_slows_a_turning_ring_and_holds_a_standing_one(clutch: Clutch) -> None:
    """w = w0 - M t / J; a ring at rest stays there, whatever the output ring does."""
    far = _far(clutch, 0.02, drag_torque=2.0)
    point = OperatingPoint(50 * RPM, ForceProfile(100.0, 0.1))
    turning = replace(far, drive=Drive(40.0, engine_side="output"))
    trace = engage(ClutchPlant(turning), point, 0.0).trace
    assert trace.sliding_speed == pytest.approx(40.0 - 2.0 / 0.01 * trace.time, rel=1e-4)
    assert not trace.tangential_force.any()
    assert not engage(ClutchPlant(far), point, 0.0).trace.sliding_speed.any()


@pytest.mark.parametrize("mechanism", [{"compliance": 10e-6}, {"free_play": 1e-3}], ids=str)
def test_a_held_ring_is_let_go_as_the_whole_motion_says(
    clutch: Clutch, point: Point, monkeypatch: pytest.MonkeyPatch, mechanism: dict[str, float]
) -> None:
    """The actuator loads the linkage alone until it pulls the ring loose, against one run."""
    far = _far(clutch, 0.08, friction=40.0, **mechanism)
    asked = point(50, 315.5)
    apart = engage(ClutchPlant(far), asked, 0.0).trace
    at_once = HeldActuator(*np.zeros((5, 1)))
    monkeypatch.setattr("dogshape.sim.shift.conclusion.release", lambda *_: at_once)
    whole = engage(ClutchPlant(far), asked, 0.0).trace
    for name in ("displacement", "actuator_displacement"):
        assert getattr(apart, name)[-1] == pytest.approx(getattr(whole, name)[-1], rel=5e-3)
    assert apart.displacement[-1] > 1e-3
    assert np.abs(apart.contact_force).max() < 0.01 * 315.5
