r"""The planar model as a control variate of the expected shift time.

At low mismatch it follows the simulation angle by angle, and what remains, time less
planar time, varies far less than the time itself:

.. math:: E[t] = E[g] + E[t - g],

the first term from many planar shifts, the second from few simulated ones. The
mean stays unbiased whatever the planar model is worth, as long as its use is not
decided on the simulated times. So it is decided on the model alone: at an operating point
where its times do not hang on what it knows least, the restitution, it is used.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.clutch import Clutch, OperatingPoint
from sim.planar import planar_times

Series = NDArray[np.float64]

BOUNCES = (0.0, 0.5, 1.0)  #: factors on the restitution: dead, the one used, full
ALIKE = 0.93  #: correlation of times under two of them from which the model is trusted
JUDGED = 32  #: angles from which the correlation is taken
AVERAGED = 128  #: angles of the planar mean


def trusted(clutch: Clutch, points: Sequence[OperatingPoint]) -> list[bool]:
    """Tell at which operating points the planar model's times deserve to be used."""
    phases = np.tile((np.arange(JUDGED) + 0.5) / JUDGED, (len(points), 1))
    angles = phases * clutch.dog.pitch_angle
    dead, middle, full = (planar_times(clutch, points, angles, bounce) for bounce in BOUNCES)
    return [
        bool(min(_likeness(m, d), _likeness(m, f)) >= ALIKE)
        for d, m, f in zip(dead, middle, full, strict=True)
    ]


def _likeness(one: Series, other: Series) -> float:
    both = np.array([one, other])
    if not np.isfinite(both).all() or (both.std(axis=1) == 0.0).any():
        return 0.0
    return float(np.corrcoef(both)[0, 1])


def deviations(
    clutch: Clutch, point: OperatingPoint, angles: Sequence[float], seed: int
) -> Series | None:
    """Return planar times less their mean over the pitch, s, (n,).

    None where a planar shift does not end. ``angles`` in rad; the mean is over
    evenly spaced angles with a random start of their own.
    """
    start = np.random.default_rng([seed, 1]).random()
    grid = (np.arange(AVERAGED) + start) / AVERAGED * clutch.dog.pitch_angle
    times = planar_times(clutch, [point], np.concatenate([np.array(angles), grid])[None, :])[0]
    if not np.isfinite(times).all():
        return None
    here: Series = times[: len(angles)] - times[len(angles) :].mean()
    return here
