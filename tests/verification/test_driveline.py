"""Torque peak of the driveline against closed forms, the motion itself, and a hard shift."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import Trace, torque_peak
from dogshape.sim.units import RPM
from tests.conftest import Point, dog_of

STIFFNESS = 320.0  #: N m/rad
CHOSEN = (10.6325, 6.8912, 24.4977, 2.48494, 31)  #: by an earlier search

Series = NDArray[np.float64]


def _trace(clutch: Clutch, time: Series, torque: Series, mismatch: float = 0.0) -> Trace:
    """Make up a trace in which the contact gives a torque (n - 1,) in the steps between times."""
    taken = np.concatenate([[0.0], np.cumsum(torque * np.diff(time))])
    series = {name: np.zeros(time.size) for name in Trace.__dataclass_fields__}
    force = np.concatenate([[0.0], torque]) / clutch.dog.mean_radius
    left = mismatch - taken / clutch.rings.reduced_inertia
    return Trace(**{**series, "time": time, "tangential_force": force, "output_speed": left})


def strike_torque(mismatch: float, stiffness: float, inertia: float) -> float:
    """Return the torque in N m with which a driveline takes up a mismatch in one strike."""
    return mismatch * math.sqrt(stiffness * inertia)


def test_response_is_that_of_the_motion_under_any_torque(clutch: Clutch) -> None:
    rings, draw = clutch.rings, np.random.default_rng(3)
    time = np.concatenate([[0.0], np.cumsum(draw.uniform(1e-3, 8e-3, 30))])
    torque = draw.normal(0.0, 40.0, 30)

    def motion(now: float, state: Series) -> list[float]:
        near, far, twist = map(float, state)
        given = torque[min(int(np.searchsorted(time, now, side="right")) - 1, 29)]
        spring = STIFFNESS * twist
        drive = given / rings.reduced_inertia  # of the mismatch, into the twist's rate
        return [drive - spring / rings.sliding_inertia, spring / rings.output_inertia, near - far]

    state, peak = np.zeros(3), 0.0
    for start, end in pairwise(time):
        run = solve_ivp(motion, (start, end - 1e-12), state, rtol=1e-9, atol=1e-12, max_step=2e-5)
        state, peak = run.y[:, -1], max(peak, float(STIFFNESS * np.abs(run.y[2]).max()))
    rate = math.sqrt(STIFFNESS / rings.reduced_inertia)
    peak = max(peak, STIFFNESS * math.hypot(state[2], (state[0] - state[1]) / rate))
    assert torque_peak(clutch, _trace(clutch, time, torque), STIFFNESS) == pytest.approx(
        peak, rel=1e-5
    )


def test_mismatch_that_a_strike_takes_before_the_flanks_close_counts(
    clutch: Clutch, point: Point
) -> None:
    """One strike takes nearly all of 249 1/min and throws the ring back; then it creeps in."""
    hard = clutch.with_dog(dog_of(clutch.dog, CHOSEN))
    result = engage(ClutchPlant(hard), point(249, 469.0), 0.55 * hard.dog.pitch_angle)
    peak = torque_peak(hard, result.trace, STIFFNESS)
    all_of_it = strike_torque(249 * RPM, STIFFNESS, hard.rings.reduced_inertia)
    assert all_of_it == pytest.approx(46.26, abs=0.01)
    assert result.loads.residual_mismatch is not None
    assert abs(result.loads.residual_mismatch) < 0.2 * 249 * RPM
    assert 0.95 * all_of_it < peak < 1.5 * all_of_it
    assert result.loads.strike_mismatch == pytest.approx(243 * RPM, rel=0.02)
