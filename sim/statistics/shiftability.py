r"""Entry into the first window: direct entries in closed form, and limits of speed and torque.

*Direct entry* (Aljawabrah and Lovas 2024). Flat tips enter a slot without touching a face with

.. math:: P = \frac{w - |\Delta\omega|\, x/v}{\vartheta}, \qquad
   w = \varphi + \frac{h (\tan\beta + \tan\gamma)}{r},

the window *w* at the end of the dogs where it is smallest, the axial speed *v* at the gap and the
overlap *x* from which a touch is one of flanks (``sim.kernel.FACE_DEPTH_SHARE`` of the height). A
flank that throws the ring back out of its slot makes the share smaller.

*Limit engagement speed*. The largest mismatch at which at least a stated share of the relative
angles engages in the first window, carried past no slot. The number of such shifts at each tested
mismatch has a Beta posterior of a uniform prior. Draws of it are made monotone from the mismatch
with the largest share on (isotonic regression, weighted by the shifts), and the limit of a draw is
where its straight lines between the tested mismatches fall below the share.

*Limit engagement torque*. The same for a constant torque on a side during the shift: the largest
one at which at least that share of all shifts at a force engages at the first try. A flank that a
torque *M* presses lets the force *F* in up to

.. math:: M = \frac{F r}{\tan(\beta + \arctan\mu)};

on a free side a torque also adds :math:`M t/J` to the mismatch until the dogs meet at *t*.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.kernel_layout import AXIAL_SPEED, DISPLACEMENT
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.expectation import PointExpectation

DRAWS = 400  #: of the posterior of the shares
TAILS = (0.025, 0.5, 0.975)  #: ends of the interval of a limit and its median
SEED = 1  #: of the draws


class EngagementLimit(NamedTuple):
    """Limit of engagement at a force in one sense: of the mismatch, rad/s, or of a torque, N m.

    Limits are magnitudes: 0 where no tested mismatch reaches the share, or no torque does, infinite
    where the largest one does.
    """

    force: float  #: final shift force, N
    sense: int  #: of the mismatch, 1 or -1; of the torque, 1 as the engine turns, -1 against it
    tested: float  #: largest tested mismatch or torque
    median: float
    low: float  #: end of the 95 % interval
    high: float


def direct_share(clutch: Clutch, point: OperatingPoint) -> float | None:
    """Compute the share of the relative angles that enters without touching a face.

    None for tips that slope, and if the ring does not close the gap.
    """
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load, and results have no need of it
    from dogshape.sim.shift.planar import free_flight  # noqa: PLC0415  the same

    dog = clutch.dog
    pair = clutch.pair
    if any(faces.slope + faces.slope_rise > 0.0 for faces in (pair.faces, pair.backs)):
        return None
    _, states, _ = free_flight(clutch, point.profile, dog.axial_gap)
    travel = states[:, DISPLACEMENT]
    speed = states[:, AXIAL_SPEED]
    if travel[-1] < dog.axial_gap or speed[-1] <= 0.0:
        return None
    gap_speed = float(np.interp(dog.axial_gap, travel, speed))
    radius = dog.outer_radius if dog.lean > 0.0 else dog.inner_radius
    window = pair.backlash_angle + pair.depth * dog.lean / radius
    overlap = kernel.FACE_DEPTH_SHARE * pair.depth
    share = (window - abs(point.mismatch) * overlap / gap_speed) / dog.pitch_angle
    return min(max(share, 0.0), 1.0)


def limit_draws(tested: Array, engaged: Array, shifts: Array, share: float) -> Array:
    """Draw limits of engagement, (``DRAWS``,); 0 and infinity as in ``EngagementLimit``.

    Parameters
    ----------
    tested : magnitudes of mismatches in rad/s or of torques in N m, growing, (n,).
    engaged : number of shifts that engage, at a mismatch in the first window, (n,).
    shifts : number of all shifts, (n,).
    share : smallest share that engages.
    """
    from scipy.optimize import isotonic_regression  # noqa: PLC0415  slow to load

    peak = int(np.argmax((engaged + 1.0) / (shifts + 2.0)))
    tested, weights = tested[peak:], shifts[peak:]
    rng = np.random.default_rng(SEED)
    counts = engaged[peak:]
    shares = rng.beta(counts + 1.0, weights - counts + 1.0, (DRAWS, tested.size))
    limits = np.empty(DRAWS)
    for draw, share_draws in enumerate(shares):
        fit = isotonic_regression(share_draws, weights=weights, increasing=False).x
        sufficient = np.flatnonzero(fit >= share)
        if sufficient.size == 0:
            limits[draw] = 0.0
        elif sufficient.size == fit.size:
            limits[draw] = math.inf
        else:
            last = sufficient[-1]
            fraction = (fit[last] - share) / (fit[last] - fit[last + 1])
            limits[draw] = tested[last] + fraction * (tested[last + 1] - tested[last])
    return limits


def speed_limits(points: Sequence[PointExpectation], share: float) -> Iterator[EngagementLimit]:
    """Estimate the limit engagement speed at each force and sense with at least two mismatches."""
    tested = [p for p in points if p.n and p.first_window is not None and p.point.mismatch != 0.0]
    tested.sort(key=_force_and_sense)
    for (force, sense), group in groupby(tested, _force_and_sense):
        ordered = sorted(group, key=lambda p: abs(p.point.mismatch))
        speeds = np.array([abs(p.point.mismatch) for p in ordered])
        if np.unique(speeds).size < 2:
            continue
        engaged = np.array([float(p.first_window or 0) for p in ordered])
        shifts = np.array([float(p.n) for p in ordered])
        low, middle, high = _limit_interval(speeds, engaged, shifts, share)
        yield EngagementLimit(force, sense, float(speeds[-1]), middle, low, high)


def _limit_interval(
    tested: Array, engaged: Array, shifts: Array, share: float
) -> tuple[float, float, float]:
    """Compute the low end, median and high end of a limit; arguments as for ``limit_draws``."""
    limits = limit_draws(tested, engaged, shifts, share)
    low, middle, high = np.quantile(limits, TAILS, method="nearest").tolist()
    return low, middle, high


def torque_limits(
    points: Sequence[PointExpectation],
    by_torque: Mapping[float, Sequence[PointExpectation]],
    share: float,
) -> Iterator[EngagementLimit]:
    """Estimate the limit at each force and sense with a tested torque, over all mismatches.

    Parameters
    ----------
    points : operating points without a further torque.
    by_torque : the same points under each further torque, N m.
    share : smallest share that engages at the first try.
    """
    for force in sorted({p.point.profile.force for p in points}):
        for sense in (-1, 1):
            torques = sorted((t for t in by_torque if t * sense > 0.0), key=abs)
            if not torques:
                continue
            groups = [points, *(by_torque[torque] for torque in torques)]
            counts = np.array([_engaged_counts(group, force) for group in groups])
            if not counts[:, 1].all():
                continue  # every shift of some torque failed in the solver
            tested = np.abs([0.0, *torques])
            low, middle, high = _limit_interval(tested, counts[:, 0], counts[:, 1], share)
            yield EngagementLimit(force, sense, float(tested[-1]), middle, low, high)


def _engaged_counts(points: Sequence[PointExpectation], force: float) -> tuple[float, float]:
    """Count the shifts at a force that engage at the first try, and all of them."""
    force_points = [p for p in points if p.point.profile.force == force]
    shifts = sum(p.n for p in force_points)
    engaged = shifts - sum(p.lost for p in force_points)
    return float(engaged), float(shifts)


def _force_and_sense(expectation: PointExpectation) -> tuple[float, int]:
    sense = 1 if expectation.point.mismatch > 0.0 else -1
    return expectation.point.profile.force, sense
