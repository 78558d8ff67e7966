r"""The planar model as a control variate of the expected shift time.

At a mismatch of some revolutions a minute dogs land and slide, the model follows the
simulation angle by angle, and what remains, time less planar time, varies far less than
the time itself:

.. math:: E[t] = E[g] + E[t - g],

the first term from many planar shifts, the second from few simulated ones; the error of
both is counted. The mean is unbiased whatever the planar model is worth, as long as its
use is not decided on simulated times. So it is decided beforehand: mismatch up to 15 1/min,
beyond which flanks are struck and evenly spaced angles alone do as well (measured on the
prototype from 25 1/min up), and times that do not hang on what the model knows least,
the restitution.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.clutch import Clutch, OperatingPoint
from sim.expectation import Control, variance_of_mean
from sim.planar import planar_times
from sim.units import RPM

Series = NDArray[np.float64]

BOUNCES = (0.0, 0.5, 1.0)  #: factors on the restitution: dead, the one used, full
SLOW = 15.0 * RPM  #: mismatch in rad/s up to which the model is used
ALIKE = 0.93  #: correlation of times under two of them from which the model is trusted
JUDGED = 32  #: angles from which the correlation is taken
AVERAGED = 256  #: angles of the planar mean


def trusted(clutch: Clutch, points: Sequence[OperatingPoint]) -> list[bool]:
    """Tell at which operating points the planar model's times deserve to be used."""
    phases = np.tile((np.arange(JUDGED) + 0.5) / JUDGED, (len(points), 1))
    angles = phases * clutch.dog.pitch_angle
    dead, middle, full = (planar_times(clutch, points, angles, bounce) for bounce in BOUNCES)
    return [
        bool(abs(p.mismatch) <= SLOW and min(_likeness(m, d), _likeness(m, f)) >= ALIKE)
        for p, d, m, f in zip(points, dead, middle, full, strict=True)
    ]


def _likeness(one: Series, other: Series) -> float:
    both = np.array([one, other])
    if not np.isfinite(both).all() or (both.std(axis=1) == 0.0).any():
        return 0.0
    return float(np.corrcoef(both)[0, 1])


def control_of(
    clutch: Clutch, point: OperatingPoint, angles: Sequence[float], seed: Sequence[int]
) -> Control | None:
    """Return the control of one operating point at ``angles`` in rad.

    None where a planar shift does not end. The mean is over evenly spaced angles with a
    random start of their own, drawn from ``seed``.
    """
    start = np.random.default_rng([*seed, 1]).random()
    grid = (np.arange(AVERAGED) + start) / AVERAGED * clutch.dog.pitch_angle
    times = planar_times(clutch, [point], np.concatenate([np.array(angles), grid])[None, :])[0]
    if not np.isfinite(times).all():
        return None
    here, whole = times[: len(angles)], times[len(angles) :]
    return Control(here - whole.mean(), variance_of_mean(whole))
