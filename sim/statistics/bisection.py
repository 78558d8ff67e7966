r"""Mean over one pitch from angles that lie closer where the time of a shift jumps.

Over the relative angle a time runs in slopes with a few jumps, at which a slot is just missed. What
evenly spaced angles leave of the mean's error comes from these: where between two angles a jump is.
So after some even angles, intervals are halved where the time most likely jumps, each halving at
the cost of one shift. With neighbours that go on as their slopes do, the jump in an interval of
width :math:`h_k` with the difference :math:`d_k` is

.. math:: r_k = \sqrt{|d_k - h_k d_{k-1}/h_{k-1}|\,|d_k - h_k d_{k+1}/h_{k+1}|},

and intervals with the largest :math:`h_k r_k` are halved. A difference alone would not do: a jump
that cancels a slope would never be looked at, and what is left of it all has one sign.

The mean is the trapezoidal rule's. A jump that is anywhere in its interval leaves the variance

.. math:: s^2 = \frac{1}{12} \sum_k h_k^2 \rho_k^2,

with :math:`\rho_k` the smaller of both factors of :math:`r_k`, since one neighbour may have the
jump. Davis & Rabinowitz 1984, ch. 6, for such rules.

A shift that does not engage has no time; it stands for the next one below it that does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


def halves(phases: Values, times: Values, count: int) -> Values:
    """Return the middles of the ``count`` intervals in which the time most likely jumps, (count,).

    ``phases`` (n,) are fractions of a pitch in [0, 1), in any order, ``times`` (n,) those of the
    shifts, s, NaN where one did not engage. Fewer than ``count`` where there are fewer intervals.
    """
    places, widths, values = _round_the_pitch(phases, times)
    below, above = _jumps(widths, values)
    worth = widths * np.sqrt(below * above)
    chosen = np.sort(np.argsort(-worth, kind="stable")[:count])
    return (places[chosen] + 0.5 * widths[chosen]) % 1.0


def mean_round_the_pitch(phases: Values, times: Values) -> tuple[float, float]:
    """Return the mean of the times over one pitch, s, and its variance, s2.

    Arguments as for ``halves``; NaN both where no shift engaged.
    """
    _, widths, values = _round_the_pitch(phases, times)
    below, above = _jumps(widths, values)
    mean = float(widths @ (values[:-1] + values[1:])) / 2.0
    return mean, float(widths**2 @ np.minimum(below, above) ** 2) / 12.0


def _round_the_pitch(phases: Values, times: Values) -> tuple[Values, Values, Values]:
    """Return the phases in their order (n,), the intervals' widths (n,) and times (n + 1,)."""
    order = np.argsort(phases, kind="stable")
    places, values = phases[order], times[order]
    engaged = np.isfinite(values)
    if engaged.any():
        last = np.maximum.accumulate(np.where(engaged, np.arange(len(values)), -1))
        values = values[np.where(last < 0, np.flatnonzero(engaged)[-1], last)]
    widths = np.diff(places, append=places[:1] + 1.0)
    return places, widths, np.append(values, values[0])


def _jumps(widths: Values, values: Values) -> tuple[Values, Values]:
    """Compute the distance of intervals from the slopes of their neighbours, (n,), s."""
    differences = np.diff(values)
    slopes = differences / widths
    below = np.abs(differences - widths * np.roll(slopes, 1))
    above = np.abs(differences - widths * np.roll(slopes, -1))
    return below, above
