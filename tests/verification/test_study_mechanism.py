"""Mechanisms that a study names, against closed forms and limits of whole shifts."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.sim.engines import engage
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.statistics.expectation import ShiftResult, expect_point
from dogshape.sim.units import DEG, RPM

ENGINES = ("drake", "planar")


def _study(engine: str = "drake", **mechanism: float) -> Setup:
    keys = {f"mechanism.{key}": value for key, value in mechanism.items()}
    return load_study("mq200_paper", {**keys, "solver.engine": engine})


def _shift(study: Setup, mismatch: float, force: float, angle: float) -> Engagement:
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(force))
    return engage(study.clutch, point, angle * DEG)


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
    plain, delay = _study(), 0.05
    engaged = _shift(plain, 50, 469.0, 10)
    assert engaged.shift_time is not None
    means = []
    for study, more in ((plain, 0.0), (_study(delay_s=delay), delay)):
        times = [None, *[engaged.shift_time + more] * 3]
        shifts = [ShiftResult(engaged.outcome, time) for time in times]
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
