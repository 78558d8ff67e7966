r"""Expected shift time from two engines: many shifts of a cheap one, few of the one that counts.

At one operating point the cheap engine has shifts at *N* even angles, the other one at *n* of the
same. Each shift gives :math:`a`, its time, or what a lost attempt costs where it did not engage,
and :math:`e`, one where it engaged; both are zero where the integration failed. The expected time
with its retries is :math:`E[a] / E[e]`. Either mean is that of the cheap engine and the mean
difference of the pairs,

.. math:: A = \overline{a'}_N + \overline{(a - a')}_n, \qquad
   B = \overline{e'}_N + \overline{(e - e')}_n, \qquad E = A / B,

which are unbiased whatever the cheap engine does: a shift that engages in one engine alone is in
both means. With n = N nothing is left of the cheap engine.

**Standard error.** Of :math:`z = (a - E e)/B` the mean of all *N* shifts of the engine that counts,
were they known, and the choice of *n* of them are uncorrelated, since each of the N/n choices is
as likely whatever the N angles are. So the variance is exactly

.. math:: V = V_z(N) + V_\Delta(n) - V_\Delta(N), \qquad \Delta = z - z',

with :math:`V_x(m)` the variance of a mean over *m* even angles. Of the first term the cheap engine
has the estimate :math:`V_{z'}(N)`, the third is left out, which is on the safe side:
:math:`s^2 = s_{z'}^2(N) + s_\Delta^2(n)`. The first is by differences of neighbours
(``sim.statistics.expectation``). The second is that of *n* random angles: engines part where a
shift comes into another slot, at single angles, of which even ones find no more.

Few pairs often have none of these angles and look exact. Where engines part is a matter of the
mismatch, so the spread of a point's differences is drawn to the mean of the ``ALIKE`` points
nearest in mismatch, which counts as ``WEIGHT`` pairs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.statistics.expectation import (
    PointExpectation,
    ShiftResult,
    variance_of_mean,
)

Values = NDArray[np.float64]

ALIKE = 8  #: points whose differences make the common spread
WEIGHT = 3.0  #: pairs that the common spread counts as


@dataclass(frozen=True)
class TwoLevelPoint:
    """One operating point in two levels: means in s, variances in s2.

    Parameters
    ----------
    alone : what the engine that counts says without the cheap one.
    mean, mean_engaged : over both levels, with retries and without.
    cheap_variance : of the cheap engine's mean.
    coarse_variance : of such a mean over n angles, from all of its N/n starts.
    spread : variance of a single difference.
    sd : standard deviation of a single shift's time, by the cheap engine.
    n, n_cheap : shifts of both engines.
    parted : pairs of which one engine alone engages.
    """

    alone: PointExpectation
    mean: float
    mean_engaged: float
    cheap_variance: float
    coarse_variance: float
    spread: float
    sd: float
    n: int
    n_cheap: int
    parted: int

    def variance(self, spread: float) -> float:
        """Compute the variance of the mean, with such a variance of single differences."""
        return self.cheap_variance + spread / self.n

    def expectation(self, spread: float) -> PointExpectation:
        """Give the expectation of the point in two levels, with such a spread of differences."""
        return replace(
            self.alone,
            mean=self.mean,
            mean_engaged=self.mean_engaged,
            standard_error=math.sqrt(self.variance(spread)),
            sd=self.sd,
            n_planar=self.n_cheap,
        )


def two_level_point(
    alone: PointExpectation,
    cheap: Sequence[ShiftResult],
    dear: Sequence[ShiftResult],
    places: Sequence[int],
    lost: float,
) -> TwoLevelPoint | None:
    """Work out one operating point from shifts of two engines.

    Parameters
    ----------
    alone : what ``dear`` says alone.
    cheap, dear : shifts at N and n even angles, in their order; n at least three.
    places : of the n angles among the N.
    lost : what a shift that does not engage costs, s.

    Returns None where no mean follows: no shift of ``dear`` engaged, or by the pairs none would.
    """
    many, few = parts_of(cheap, lost), parts_of(dear, lost)
    total, share, times = many.mean(axis=1) + (few - many[:, list(places)]).mean(axis=1)
    if alone.mean_engaged is None or share <= 0.0:
        return None
    mean = total / share
    z_many, z_few = ((part[0] - mean * part[1]) / share for part in (many, few))
    differences = z_few - z_many[list(places)]
    engaged, step = many[1] > 0.0, len(cheap) // len(dear)
    starts = [(z_many[k::step], bool(engaged[k::step].all())) for k in range(step)]
    return TwoLevelPoint(
        alone=alone,
        mean=float(mean),
        mean_engaged=float(times / share),
        cheap_variance=variance_of_mean(z_many, even=bool(engaged.all())),
        coarse_variance=float(np.mean([variance_of_mean(z, even=even) for z, even in starts])),
        spread=len(dear) * variance_of_mean(differences, even=False),
        sd=float(many[2, engaged].std(ddof=1)) if engaged.sum() > 1 else 0.0,
        n=len(dear),
        n_cheap=len(cheap),
        parted=int((few[1] != many[1, list(places)]).sum()),
    )


def common_spreads(points: Sequence[TwoLevelPoint]) -> list[float]:
    """Draw each point's spread of differences to that of the points nearest in mismatch, s2."""
    speeds = np.array([abs(p.alone.point.mismatch) for p in points])
    spreads, found = np.array([p.spread for p in points]), []
    for speed, point in zip(speeds, points, strict=True):
        near = np.argsort(np.abs(speeds - speed), kind="stable")[:ALIKE]
        common = float(spreads[near].mean())
        found.append((point.n * point.spread + WEIGHT * common) / (point.n + WEIGHT))
    return found


def parts_of(shifts: Sequence[ShiftResult], lost: float) -> Values:
    """Return times with costs of lost attempts, whether each engaged, and bare times, (3, n), s."""
    engaged = np.array([s.shift_time is not None for s in shifts], dtype=float)
    sound = np.array([s.outcome is not Outcome.DIVERGED for s in shifts], dtype=float)
    times = np.array([s.shift_time or 0.0 for s in shifts])
    return np.array([times + (sound - engaged) * lost, engaged, times])
