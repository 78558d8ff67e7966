r"""The surrogate: shift time, spread and share engaged over designs and operating points.

Times are modelled by their logarithm :math:`y = \ln t`, which keeps them positive and makes
errors relative; t is the mean of the shifts that engage. The covariance has a term over
operating points alone, a smooth one over both, and two that grow with the mismatch: there a
dog is thrown back once more or once less, and the mean runs in steps, of which short ones are
rough: no design nearby predicts them.

Expected time over a mix with weights :math:`w_j` and mean and covariance :math:`\mu, C` of the
logarithms (Bayesian quadrature, O'Hagan 1991, for a process of logarithms):

.. math:: T_j = e^{\mu_j + C_{jj}/2}, \qquad E = \sum_j w_j T_j + w_j \frac{1 - p_j}{p_j} t_r,
   \qquad s^2 = \sum_{jk} w_j w_k T_j T_k (e^{C_{jk}} - 1) + s_p^2

Retries after a time :math:`t_r` (time-out and retraction) follow the share *p*
(``surrogate.model``); its errors :math:`s_p` go together as far as the points are near.

**Share that engages.** Engaged and all shifts of the rows are counted with a weight that falls with
their distance, on top of a prior with the overall share (correlated Beta process, Goetschalckx,
Poupart and Hoey 2011):

.. math:: p(z) \sim Beta(s \bar p + \sum_i c_i k_i,\; s (1 - \bar p) + \sum_i c_i (n_i - k_i)),
   \quad c_i = e^{-|z - z_i|^2/2\ell^2}

Length :math:`\ell` and strength *s* of the prior are those that best predict the counts of
designs left out. A Gaussian process of the logit would pull shares that are nearly always
one away from it, and each thousandth costs a retry.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array, Places, Term, distance
from dogshape.surrogate.dataset import Dataset, Mix
from dogshape.surrogate.mix_times import MixTimes
from dogshape.surrogate.process import FLOOR, Process, design_coordinates, point_coordinates

LENGTHS = (0.1, 0.2, 0.4, inf)  #: of designs scaled to one, and of operating points
STRENGTHS = (1.0, 10.0, 100.0)


@dataclass(frozen=True)
class Share:
    """Counts with their inputs, the length and the strength of the prior.

    Parameters
    ----------
    designs : number of coordinates of a design.
    inputs : (n, d + p).
    engaged, shifts : counts of each row, (n,).
    """

    designs: int
    inputs: Array
    engaged: Array
    shifts: Array
    length: float
    strength: float

    @property
    def overall(self) -> float:
        """Share of all shifts after Jeffreys, which is never 0 or 1."""
        return float((self.engaged.sum() + 0.5) / (self.shifts.sum() + 1.0))

    def at(self, inputs: Array) -> tuple[Array, Array]:
        """Return share and its variance at inputs (m, d + p), each (m,)."""
        cut = self.designs
        near = _nearness(inputs[:, :cut], self.inputs[:, :cut], self.length)
        near *= _nearness(inputs[:, cut:], self.inputs[:, cut:], self.length)
        return self._beta(near @ self.engaged, near @ (self.shifts - self.engaged))

    def over(self, x: Array, nodes: Array, known: Array, place: Places) -> tuple[Array, Array]:
        """Return share and variance of designs (m, d) at operating points (q, p), each (m, q).

        ``known`` are the distinct designs of the rows (k, d), ``place`` that of each row (n,).
        """
        here = _nearness(nodes, self.inputs[:, self.designs :], self.length)
        counts = []
        for count in (self.engaged, self.shifts - self.engaged):
            summed = np.zeros((len(known), len(nodes)))
            np.add.at(summed, place, (here * count).T)
            counts.append(_nearness(x, known, self.length) @ summed)
        return self._beta(*counts)

    def alike(self, inputs: Array) -> Array:
        """Compute the correlation of errors of the share at inputs (m, d + p), (m, m)."""
        x, points = inputs[:, : self.designs], inputs[:, self.designs :]
        return self.near(x, x) * self.near(points, points)

    def near(self, a: Array, b: Array) -> Array:
        """Compute the nearness of designs, or operating points, (m, c) and (k, c), (m, k)."""
        return _nearness(a, b, self.length)

    def _beta(self, engaged: Array, lost: Array) -> tuple[Array, Array]:
        a = engaged + self.strength * self.overall
        b = lost + self.strength * (1.0 - self.overall)
        total = a + b
        return a / total, a * b / (total**2 * (total + 1.0))


def fit_share(designs: int, inputs: Array, counts: tuple[Array, Array], place: Places) -> Share:
    """Fit length and strength: those that best predict the counts of designs left out.

    ``counts`` are those of engaged and of all shifts, each (n,); ``place`` the design's of
    each row, (n,).
    """
    engaged, shifts = counts
    if (engaged == shifts).all():
        return Share(designs, inputs, engaged, shifts, inf, STRENGTHS[-1])
    others = place[:, None] != place[None, :]
    best, found = -inf, None
    for length in LENGTHS:
        near = _nearness(inputs, inputs, length) * others
        for strength in STRENGTHS:
            one = Share(designs, inputs, engaged, shifts, length, strength)
            share = one._beta(near @ engaged, near @ (shifts - engaged))[0]
            likely = float((engaged * np.log(share) + (shifts - engaged) * np.log1p(-share)).sum())
            if likely > best:
                best, found = likely, one
    assert found is not None
    return found


def _nearness(a: Array, b: Array, length: float) -> Array:
    if length == inf:
        return np.ones((len(a), len(b)))
    return np.exp(-0.5 * (distance(a, b) / length) ** 2)


CHUNK = 2000  #: designs that are predicted at a time
MIN_DESIGNS = 10  #: fewer say nothing about five length scales

SMOOTH = Term(design=True, point=True)
POINT = Term(design=False, point=True)
STEPS = Term(design=True, point=True, grows=True, scales=(0.1, 3.0), first=0.3)
ROUGH = Term(design=True, point=True, grows=True, scales=(0.1, 0.1), first=0.1)
#: Over operating points alone; smooth in both; steps of fast shifts, and rough ones.
TERMS = (POINT, SMOOTH, STEPS, ROUGH)


@dataclass(frozen=True)
class Expected:
    """Expected shift time over a mix with its 95 % interval, s.

    ``error`` is its standard error, ``sd`` the standard deviation of a single shift of the mix,
    ``engaged`` the least share engaged at a point. ``retries`` is the part of the time that shifts
    which do not engage cost, with its standard error.
    """

    time: float
    low: float
    high: float
    error: float
    sd: float
    engaged: float
    retries: float = 0.0
    retries_error: float = 0.0

    @property
    def without_retries(self) -> tuple[float, float]:
        """Expected time of the shifts that engage, and its standard error, s."""
        left = max(self.error**2 - self.retries_error**2, 0.0)
        return self.time - self.retries, left**0.5


@dataclass(frozen=True)
class Surrogate:
    """Fitted processes with their data; ``surrogate.learning.fit`` makes one.

    ``own`` has the times at the study's own operating points, where designs were simulated at all
    of them; whatever mix it has is asked of it.
    """

    data: Dataset
    times: Process
    spreads: Process
    share: Share
    own: MixTimes | None = None

    def coordinates(self, x: Array) -> Array:
        """Return coordinates of designs (m, d) in edge units, (m, c)."""
        return design_coordinates(self.data, x)

    @cached_property
    def known(self) -> Array:
        """Coordinates of the distinct simulated designs, (k, c)."""
        return self.coordinates(self.data.designs)

    def inputs(self, x: Array, points: Array) -> Array:
        """Return coordinates of designs (m, d) at operating points (m, 2), (m, c + 2)."""
        return np.concatenate([self.coordinates(x), point_coordinates(points)], axis=1)

    def crossed(self, x: Array, points: Array) -> Array:
        """Return coordinates of each design (m, d) at each of the points (q, 2), (m q, c + 2)."""
        return self.inputs(np.repeat(x, len(points), axis=0), np.tile(points, (len(x), 1)))

    def expected(self, x: Array, mix: Mix) -> Expected:
        """Predict one design (d,) over a mix."""
        inputs = self.crossed(x[None, :], mix.points)
        own = self.own_process(mix)
        if own is None:
            return self.summed(inputs, *self.times.joint(inputs), mix)
        mean, covariance = own.joint(self.own_coordinates(x[None, :]))
        time = float(np.exp(mean[0] + 0.5 * covariance[0, 0]))
        variance = time**2 * float(np.expm1(covariance[0, 0]))
        return self._with_retries(inputs, np.exp(self.times.mean(inputs)), (time, variance), mix)

    def own_process(self, mix: Mix) -> Process | None:
        """Return the process that has a mix of the study's own points, None where none has."""
        return None if self.own is None else self.own.process_of(mix)

    def own_coordinates(self, x: Array) -> Array:
        """Return coordinates of designs (m, d), edge units, for ``own_process``, (m, c)."""
        assert self.own is not None
        return self.own.coordinates(x)

    def mean(self, x: Array, mix: Mix) -> float:
        """Predict one design (d,) over a mix without its error, at once, s."""
        inputs = self.crossed(x[None, :], mix.points)
        share = self.share.at(inputs)[0]
        retries = float(mix.weights @ ((1.0 - share) / share)) * mix.retry
        own = self.own_process(mix)
        if own is not None:
            return float(np.exp(own.mean(self.own_coordinates(x[None, :]))[0])) + retries
        return float(mix.weights @ np.exp(self.times.mean(inputs))) + retries

    def times_at(self, x: Array, points: Array, retry: float) -> Array:
        """Predict designs (m, d), each at its operating point (m, 2), without error, (m,), s.

        Points are in 1/min and N; ``retry`` is the time of a shift that does not engage, s.
        """
        inputs, found = self.inputs(x, points), []
        for some in (inputs[k : k + CHUNK] for k in range(0, len(x), CHUNK)):
            share = self.share.at(some)[0]
            found.append(np.exp(self.times.mean(some)) + (1.0 - share) / share * retry)
        return np.concatenate(found)

    def summed(self, inputs: Array, mean: Array, covariance: Array, mix: Mix) -> Expected:
        """Sum a mix from the mean (m,) and covariance (m, m) of logarithms at its inputs."""
        times = np.exp(mean + 0.5 * np.diag(covariance))
        parts = mix.weights * times
        variance = float(parts @ np.expm1(covariance) @ parts)
        return self._with_retries(inputs, times, (float(parts.sum()), variance), mix)

    def _with_retries(
        self, inputs: Array, times: Array, engaged: tuple[float, float], mix: Mix
    ) -> Expected:
        """Add retries to the time of shifts that engage and its variance, s and s2.

        ``times`` are those at the inputs (m, c + 2), (m,).
        """
        time, variance = engaged
        share, unsure = self.share.at(inputs)
        retries = float(mix.weights @ ((1.0 - share) / share)) * mix.retry
        lost = mix.weights * np.sqrt(unsure) / share**2 * mix.retry
        retry_error = float(lost @ self.share.alike(inputs) @ lost) ** 0.5
        within = self.spread(inputs) ** 2 + (times - time) ** 2
        error = (max(variance, 0.0) + retry_error**2) ** 0.5
        low, high = interval(np.array([time + retries]), np.array([error]))
        sd = float(mix.weights @ within) ** 0.5
        return Expected(
            time=time + retries,
            low=float(low[0]),
            high=float(high[0]),
            error=error,
            sd=sd,
            engaged=float(share.min()),
            retries=retries,
            retries_error=retry_error,
        )

    def spread(self, inputs: Array) -> Array:
        """Return the standard deviation of a shift at inputs (m, c + 2), (m,), s."""
        return np.maximum(np.exp(self.spreads.mean(inputs)) - FLOOR, 0.0)

    @cached_property
    def spacing(self) -> float:
        """Median distance of a simulated design to the next one, in shares of the range."""
        known = self.data.scaled(self.data.designs)
        apart = distance(known, known)
        np.fill_diagonal(apart, np.inf)
        return float(np.median(apart.min(axis=1)))

    def distance(self, x: Array) -> Array:
        """Return the distance of designs (m, d) to the next simulated one, in ``spacing``, (m,)."""
        known = self.data.scaled(self.data.designs)
        scaled = self.data.scaled(x)
        parts = (scaled[k : k + CHUNK] for k in range(0, len(x), CHUNK))
        return np.concatenate([distance(one, known).min(axis=1) for one in parts]) / self.spacing


def interval(time: Array, error: Array) -> tuple[Array, Array]:
    """Return the 95 % interval of positive times with their standard errors, each (m,), s."""
    relative = np.sqrt(np.log1p((error / time) ** 2))
    centre = np.log(time) - 0.5 * relative**2
    low: Array = np.exp(centre - 1.96 * relative)
    high: Array = np.exp(centre + 1.96 * relative)
    return low, high


def require_enough(data: Dataset) -> None:
    """Raise InputError for fewer than ``MIN_DESIGNS`` designs with a time and its scatter."""
    counted = len(np.unique(data.x[data.column("engaged") > 2], axis=0))
    if counted < MIN_DESIGNS:
        raise InputError(
            f"the surrogate has {counted} designs with three shifts that engage at an operating "
            f"point, but it needs at least {MIN_DESIGNS}; raise surrogate.designs or "
            "surrogate.angles for 'fit', search.trials for 'study'"
        )
