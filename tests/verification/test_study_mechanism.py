"""Mechanisms that a study names, against closed forms and limits of whole shifts."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.statistics.blocks import engage
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


FLANK = 12.0 * DEG  #: side angle of the prototype's traction flank
RHO = np.arctan(0.10)  #: angle of friction of the dogs


def _leverage(friction: float) -> float:
    """Return axial over tangential force on the ring while a flank throws it back."""
    spline = load_study("mq200_paper", {"mechanism.spline_friction": 0.1}).clutch
    share = 1.0 - 0.3 * spline.dog.mean_radius**2 / spline.rings.sliding_inertia
    radii = spline.dog.mean_radius / spline.mechanism.spline_radius
    return float(np.tan(FLANK - RHO) - friction * share * radii)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_spline_that_locks_holds_the_ring_in_a_flank_strike(engine: str) -> None:
    """tan(beta - rho) < mu_s (1 - m r^2/J1) r/r_s at 0.1, not at 0.05."""
    assert _leverage(0.05) > 0.0 > _leverage(0.1)
    studies = [_study(engine, spline_friction=friction) for friction in (0.05, 0.1)]
    free, held = (_shift(study, 249, 469.0, 14).events.rebound_travel for study in studies)
    assert free > 3e-3
    assert held < 5e-5
