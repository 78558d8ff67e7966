"""Mechanisms that a study names, against closed forms and limits of whole shifts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.sim.engines import engage
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.trace import crossing
from dogshape.sim.statistics.expectation import ShiftResult, expect_point
from dogshape.sim.units import DEG, RPM

ENGINES = ("drake", "planar")
NEAR = 0.9e-3  #: m, way within the gap of 1 mm in which nothing is touched


def _study(engine: str = "drake", **mechanism: float) -> Setup:
    keys = {f"mechanism.{key}": value for key, value in mechanism.items()}
    return load_study("mq200_paper", {**keys, "solver.engine": engine})


def _shift(study: Setup, mismatch: float, force: float, angle: float) -> Engagement:
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(force))
    return engage(study.clutch, point, angle * DEG)


def _flight(result: Engagement) -> float:
    """Return when the ring has made the way ``NEAR``, s."""
    trace = result.trace
    found = crossing(trace.time, trace.displacement, trace.axial_speed, NEAR)
    assert found is not None
    return found


@pytest.mark.parametrize("engine", ENGINES)
def test_no_mechanism_is_bit_identical(engine: str) -> None:
    noughts = _study(engine, friction_N=0.0, spline_friction=0.0, drag_torque_Nm=0.0)
    plain, none = (_shift(one, 50, 469.0, 10) for one in (_study(engine), noughts))
    assert none.shift_time == plain.shift_time
    for name, series in vars(plain.trace).items():
        assert np.array_equal(getattr(none.trace, name), series), name


@pytest.mark.parametrize("friction", [5.0, 60.0])
def test_sleeve_friction_delays_the_flight_as_its_closed_form_says(friction: float) -> None:
    """m x = G2(t) - G2(t0) - (t - t0) G1(t0) - R (t - t0)^2/2 from F(t0) = R on."""
    force, mass = 235.2, 0.3
    study = _study(friction_N=friction)
    rise = study.actuation.profile(force).rise

    def momentum(t: float) -> float:
        return force * rise * ((t / rise) ** 3 - (t / rise) ** 4 / 2.0)

    def way(t: float) -> float:
        return force * rise**2 * ((t / rise) ** 4 / 4.0 - (t / rise) ** 5 / 10.0)

    def push(t: float) -> float:
        return force * (3.0 * (t / rise) ** 2 - 2.0 * (t / rise) ** 3)

    free = brentq(lambda t: push(t) - friction, 0.0, rise)

    def left(t: float) -> float:
        flown = way(t) - way(free) - (t - free) * momentum(free)
        return (flown - 0.5 * friction * (t - free) ** 2) / mass - NEAR

    exact = brentq(left, free, rise)
    found, plain = (_flight(_shift(one, 50, force, 0)) for one in (study, _study()))
    # The smooth law lets the ring creep by micrometres before the force exceeds the friction.
    assert found == pytest.approx(exact, rel=0.01)
    assert found - plain == pytest.approx(exact - plain, rel=0.03)


def test_added_mass_flies_as_one_with_the_ring() -> None:
    study = _study(added_mass_kg=0.9)
    exact = study.actuation.profile(235.2).free_flight_time(NEAR, 1.2)
    assert _flight(_shift(study, 50, 235.2, 0)) == pytest.approx(exact, rel=1e-3)


def test_drag_slows_a_ring_that_turns_and_not_its_flight() -> None:
    """The speed is w0 - M t/J1 until the dogs meet."""
    turning = {"sliding.initial_speed_rpm": 600.0}
    plain = load_study("mq200_paper", turning)
    study = load_study("mq200_paper", {**turning, "mechanism.drag_torque_Nm": 0.5})
    result = _shift(study, 50, 235.2, 0)
    trace = result.trace
    free = trace.time < _flight(result)
    assert free.sum() > 5
    exact = 600.0 * RPM - 0.5 / study.clutch.rings.sliding_inertia * trace.time[free]
    assert trace.sliding_speed[free] == pytest.approx(exact, rel=1e-4)
    assert _flight(result) == pytest.approx(_flight(_shift(plain, 50, 235.2, 0)), rel=1e-3)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_dead_time_moves_all_times_by_itself(engine: str) -> None:
    delay, studies = 0.05, (_study(engine), _study(engine, delay_s=0.05))
    plain, late = (_shift(study, 50, 469.0, 10) for study in studies)
    assert plain.shift_time is not None
    assert late.shift_time == plain.shift_time + delay
    assert late.actuator_time == plain.actuator_time + delay
    assert (late.events, late.loads, late.steps) == (plain.events, plain.loads, plain.steps)
    assert np.array_equal(late.trace.time, plain.trace.time + delay)
    assert np.array_equal(late.trace.displacement, plain.trace.displacement)
    assert [p.name for p in late.phases] == ["dead time", *(p.name for p in plain.phases)]
    assert late.phases[0].end == late.phases[1].start == delay


def test_a_retry_waits_for_its_dead_time_too() -> None:
    """E = E0 + d/p: one dead time for each try."""
    late, plain, delay = _study(delay_s=0.05), _study(), 0.05
    engaged = _shift(plain, 50, 469.0, 10)
    lost = replace(engaged, shift_time=None)
    means = []
    for study, more in ((plain, 0.0), (late, delay)):
        assert engaged.shift_time is not None
        shifts = [
            ShiftResult(engaged.outcome, engaged.shift_time + more),
            ShiftResult(lost.outcome, None),
            ShiftResult(engaged.outcome, engaged.shift_time + more),
            ShiftResult(engaged.outcome, engaged.shift_time + more),
        ]
        point, timeout = study.points[0], study.clutch.timeout
        means.append(expect_point(point, shifts, timeout, study.retraction).mean)
    assert means[1] - means[0] == pytest.approx(delay / 0.75, rel=1e-9)


def test_a_ring_that_is_all_inertia_passes_nothing_through_its_spline() -> None:
    """The spline takes M (1 - m r^2/J1): none where the ring itself has all of J1."""
    radius = load_study("mq200_paper").clutch.dog.mean_radius
    own = {"sliding.inertia_kgm2": 0.3 * radius**2}
    plain, rubbing = (
        _shift(load_study("mq200_paper", {**own, **more}), 50, 469.0, 10).shift_time
        for more in ({}, {"mechanism.spline_friction": 0.3})
    )
    assert plain is not None
    assert rubbing == pytest.approx(plain, rel=2e-3)


FLANK = 12.0 * DEG  #: side angle of the prototype's traction flank
RHO = np.arctan(0.10)  #: angle of friction of the dogs


def _leverage(friction: float) -> float:
    """Return axial over tangential force on the ring while a flank throws it back."""
    spline = load_study("mq200_paper", {"mechanism.spline_friction": 0.1}).clutch
    share = 1.0 - 0.3 * spline.dog.mean_radius**2 / spline.rings.sliding_inertia
    radii = spline.dog.mean_radius / spline.mechanism.spline_radius
    return float(np.tan(FLANK - RHO) - friction * share * radii)


def _thrown(friction: float) -> float:
    """Return axial over tangential impulse of a flank strike while it throws the ring back."""
    study = _study(spline_friction=friction)
    trace, clutch = _shift(study, 249, 469.0, 14).trace, study.clutch
    strike = int(np.argmax(trace.tangential_force))
    back = (trace.time > trace.time[strike] - 5e-4) & (trace.axial_speed < -0.3)
    first = int(np.argmax(back))
    last = first + int(np.argmax(trace.axial_speed[first:] < -0.7))
    pair = [first, last]
    between = slice(first, last + 1)
    pushed = np.trapezoid(trace.shift_force[between], trace.time[between])
    lost = pushed - clutch.rings.mass * float(np.diff(trace.axial_speed[pair])[0])
    struck = clutch.rings.sliding_inertia * float(np.diff(trace.sliding_speed[pair])[0])
    assert struck > 0.01
    return float(lost * clutch.dog.mean_radius / struck)


def test_a_spline_takes_its_share_of_what_a_flank_strike_throws_back() -> None:
    """F dt - m dv = (J1 dw/r) (tan(beta - rho) - mu_s (1 - m r^2/J1) r/r_s) while v < 0."""
    free, rubbing = _thrown(0.0), _thrown(0.05)
    assert free == pytest.approx(_leverage(0.0), rel=0.06)  # the flank bears off the mean radius
    assert free - rubbing == pytest.approx(_leverage(0.0) - _leverage(0.05), rel=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_spline_that_locks_holds_the_ring_in_a_flank_strike(engine: str) -> None:
    """tan(beta - rho) < mu_s (1 - m r^2/J1) r/r_s at 0.1, not at 0.05."""
    assert _leverage(0.05) > 0.0 > _leverage(0.1)
    studies = [_study(engine, spline_friction=friction) for friction in (0.05, 0.1)]
    free, held = (_shift(study, 249, 469.0, 14).events.rebound for study in studies)
    assert free > 3e-3
    assert held < 5e-5
