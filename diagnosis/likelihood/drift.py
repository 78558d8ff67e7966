r"""Drift: a trend of the shift times over the series in which they were measured.

Oil and actuator warm up, edges wear. Where the order of the shifts is known, shift *i* at operating
point *k* is off by :math:`d\, \bar t_k\, x_i`, with :math:`\bar t_k` the mean time there and
:math:`x_i` the shift's place in the series, of which the whole is one long; its mean is zero. The
drift *d* is normal, so that its size is half normal (``Rules.drift``). It is the same under every
hypothesis, and so is what shifts at one operating point say of it by themselves,

.. math:: I = \sum_i \frac{n_i}{\sigma_k^2} \bar t_k^2 (x_i - \bar x_k)^2, \qquad
          g = \sum_i \frac{n_i}{\sigma_k^2} \bar t_k (x_i - \bar x_k)(t_i - \bar t_k):

*d* is then normal with the variance :math:`v = 1/(1/s^2 + I)` and the mean :math:`v g`. That mean
is taken off all times. What is left, :math:`\sqrt v\, \bar t_k \bar x_k z` for each cell, is a
direction that cells err along together, integrated out beside the discrepancy
(``diagnosis.likelihood.discrepancy``). Scatter :math:`\sigma_k` is that of the shifts about the
trend, drawn towards the relative one of all operating points, and raised for the few shifts that it
is known from, so that the 90 % interval of *d* is that of Student's distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import norm, spearmanr
from scipy.stats import t as student

from dogshape.diagnosis.bench.reading import Cell, Reading
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM

ROUNDS = 4  #: of trend and scatter in turn
INSIDE = 0.95  #: probability below the upper end of an interval that holds 90 %
ALIKE = 4.0  #: degrees of freedom that the scatter of all operating points counts as at each


@dataclass(frozen=True)
class Drift:
    """Trend over the series before the shifts of different operating points are compared.

    Parameters
    ----------
    first, last : first and last place in the series, and ``middle``, the mean of all shifts'.
    mean, sd : of the drift as a share of the mean time over the whole series, by what repeated
        operating points say of it.
    repeated : share of the prior's variance that these have taken.
    direction : offset of each cell for one ``sd``, s, (cells,).
    time : mean time of all shifts, s.
    cells : of the data set.
    """

    first: float
    last: float
    middle: float
    mean: float
    sd: float
    repeated: float
    direction: Array
    time: float
    cells: tuple[Cell, ...]

    @cached_property
    def order_of(self) -> dict[str, float]:
        """Rank correlations of the series with what its operating points may be in order of."""
        return _order_of(self.cells)

    def places(self, readings: Sequence[Reading]) -> Array:
        """Return the places of readings in the series, of which the whole is one long, (k,)."""
        return _placed(readings, self.first, self.last) - self.middle

    def taken_off(self, cells: Sequence[Cell]) -> tuple[Cell, ...]:
        """Return cells whose times are without the mean trend."""
        return tuple(self._level(cell) for cell in cells)

    def _level(self, cell: Cell) -> Cell:
        time = cell.time
        if time is None:
            return cell
        off = self.mean * time * self.places(cell.readings)
        pairs = zip(cell.readings, off.tolist(), strict=True)
        # A trend that would take away a time altogether is none; the rest stays above zero.
        rows = tuple(
            one if one.time is None else replace(one, time=max(one.time - shift, 0.1 * one.time))
            for one, shift in pairs
        )
        return replace(cell, readings=rows)


@dataclass(frozen=True)
class _Repeats:
    """Rows of one operating point: times in s, numbers of shifts, places, (k,) each.

    ``squares`` and ``freedom`` are those of the standard deviations beside means.
    """

    time: Array
    n: Array
    place: Array
    squares: float
    freedom: float

    @cached_property
    def mean(self) -> float:
        """Mean time of all shifts, s."""
        return float(np.average(self.time, weights=self.n))

    @cached_property
    def centre(self) -> float:
        """Mean place of all shifts."""
        return float(np.average(self.place, weights=self.n))

    def information(self) -> float:
        """Sum of squares of the relative trend that counts for its slope, s^2."""
        return float((self.n * (self.mean * (self.place - self.centre)) ** 2).sum())

    def pull(self) -> float:
        """Sum of products of that trend and the times, s^2."""
        return float(
            (self.n * self.mean * (self.place - self.centre) * (self.time - self.mean)).sum()
        )

    def scatter(self, slope: float) -> tuple[float, float]:
        """Sum of squares about a trend over the squared mean time, and its degrees of freedom."""
        left = self.time - self.mean - slope * self.mean * (self.place - self.centre)
        squares = float((self.n * left**2).sum()) + self.squares
        return squares / self.mean**2, self.time.size - 1.0 + self.freedom


def drift_of(cells: Sequence[Cell], rules: Rules) -> Drift | None:
    """Return the trend of a data set; None where the order of its shifts is not known.

    Parameters
    ----------
    cells : with places of all readings that have a time.
    rules : with the scale of the half-normal prior of the drift's size.
    """
    timed = [r for cell in cells for r in cell.readings if r.time is not None]
    places = [r.place for r in timed]
    if rules.drift <= 0.0 or not timed or any(place is None for place in places):
        return None
    first, last = (float(end(p for p in places if p is not None)) for end in (min, max))
    if first == last:
        return None
    middle = np.average(_placed(timed, first, last), weights=[r.n for r in timed])
    groups = [_repeats(cell, first, last, float(middle)) for cell in cells]
    having = [one for one in groups if one.time.size]
    mean, variance = _within(having, rules.drift)
    sd = float(np.sqrt(variance))
    direction = [one.mean * one.centre if one.time.size else 0.0 for one in groups]
    whole = sum(float(one.n.sum()) for one in having)
    time = sum(float((one.n * one.time).sum()) for one in having) / whole
    taken = 1.0 - variance / rules.drift**2
    offsets = sd * np.array(direction)
    return Drift(first, last, float(middle), mean, sd, taken, offsets, time, tuple(cells))


def _placed(readings: Sequence[Reading], first: float, last: float) -> Array:
    """Return places of readings from 0 to 1; 0 for those without one, which have no time."""
    places = np.array([first if r.place is None else r.place for r in readings])
    return (places - first) / (last - first)


def _repeats(cell: Cell, first: float, last: float, middle: float) -> _Repeats:
    """Gather the rows of a cell with a time, late single shifts left out."""
    timed = [r for r in cell.readings if r.time is not None]
    core = bulk(cell.times) if cell.times.size else cell.times
    late = iter(np.isnan(core).tolist())
    kept = [r for r in timed if r.n > 1 or not next(late)]
    told = [(r.sd, r.n - 1.0) for r in kept if r.sd is not None]
    return _Repeats(
        np.array([r.time for r in kept], dtype=float),
        np.array([r.n for r in kept], dtype=float),
        _placed(kept, first, last) - middle,
        sum(count * sd**2 for sd, count in told),
        sum(count for _, count in told),
    )


def _within(groups: Sequence[_Repeats], scale: float) -> tuple[float, float]:
    """Return mean and variance of the drift by what shifts at one operating point say of it."""
    slope, variance = 0.0, scale**2
    informations = np.array([one.information() for one in groups])
    if not informations.any():
        return slope, variance
    pulls = np.array([one.pull() for one in groups])
    times = np.array([one.mean for one in groups])
    for _ in range(ROUNDS):
        squares, freedom = np.array([one.scatter(slope) for one in groups]).T
        # The slope is fitted to the same rows.
        common = squares.sum() / max(1.0, freedom.sum() - 1.0)
        sigma = (squares + ALIKE * common) / (freedom + ALIKE) * times**2
        if freedom.sum() < 2.0 or not common > 0.0:
            return 0.0, scale**2
        sigma = sigma * _unsure(max(1.0, freedom.sum() - 1.0))
        variance = 1.0 / (scale**-2.0 + float((informations / sigma).sum()))
        slope = variance * float((pulls / sigma).sum())
    return slope, variance


def _unsure(freedom: float) -> float:
    """Return the factor on a variance of so many degrees of freedom, for a slope taken as normal.

    Its 90 % interval is then that of Student's distribution.
    """
    return float((student.ppf(INSIDE, freedom) / norm.ppf(INSIDE)) ** 2)


def _order_of(cells: Sequence[Cell]) -> dict[str, float]:
    """Return rank correlations of the shifts' places with mismatch and force, where they vary."""
    rows = [
        (r.place, abs(cell.point.mismatch) + RPM, cell.point.profile.force)
        for cell in cells
        for r in cell.readings
        if r.time is not None
    ]
    place, mismatch, force = np.array(rows, dtype=float).T
    found = {}
    for name, values in (("mismatch", mismatch), ("force", force)):
        if np.unique(values).size > 1:
            found[name] = float(spearmanr(place, values).statistic)
    return found
