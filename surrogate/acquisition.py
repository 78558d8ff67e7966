r"""Next rows to simulate: those that most lower the error of a question.

A question is the expected time over a mix at some target designs, with weights
:math:`\omega_t`. A row *q* that is simulated with noise :math:`s_q^2` lowers the summed
variance of the relative errors by

.. math:: \sum_t \omega_t \frac{C(t, q)^2}{C(q, q) + s_q^2},

*C* being the covariance given all rows (Cohn 1996, for processes: Seo et al. 2000). Rows
are chosen one after the other, each given those before. The choice needs the place of a row, not
its result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.surrogate.covariance import Array, Places
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.process_targets import point_coordinates, timed


@dataclass(frozen=True)
class Question:
    """Designs (t, d) in edge units whose expected time is asked for, with weights (t,)."""

    designs: Array
    weights: Array


@dataclass(frozen=True)
class Choice:
    """Rows to simulate: places of designs of the question and of points of the mix, (n,).

    ``designs`` and ``points`` count from zero; ``left`` is the question's variance of the
    relative error after each row, over that before the first, when given rows are known.
    """

    designs: Places
    points: Places
    left: Array


def choose(
    over: Over,
    question: Question,
    angles: int,
    count: int,
    *,
    given: Sequence[int] = (),
    again: bool = True,
) -> Choice:
    """Choose ``count`` rows of ``angles`` shifts at the question's designs and the mix's points.

    ``given`` are rows that are simulated anyhow, counted point by point through design after
    design: their information counts before the first is chosen. With ``again`` a row may be chosen
    more than once, for other angles; else there are no more than the rows that are left.
    """
    rows = _Rows(over, question, angles)
    for row in given:
        rows.take(row)
    start, taken = rows.left, [] if again else list(given)
    picked: list[int] = []
    left: list[float] = []
    for _ in range(count if again else min(count, len(rows.noise) - len(set(given)))):
        gains = rows.gains
        gains[taken] = -np.inf
        best = int(np.argmax(gains))
        rows.take(best)
        picked.append(best)
        left.append(rows.left)
        if not again:
            taken.append(best)
    places = np.array(picked, dtype=np.int64)
    size = len(over.mix.points)
    return Choice(places // size, places % size, np.array(left) / start)


class _Rows:
    """Rows that may be simulated: what they share with the question, given those taken."""

    def __init__(self, over: Over, question: Question, angles: int) -> None:
        surrogate, mix = over.surrogate, over.mix
        process = surrogate.times
        self._covariance, self._weights = process.covariance, question.weights
        self._inputs = surrogate.crossed(question.designs, mix.points)
        self._links = process.covariance.between(self._inputs, process.inputs)
        self._known = self._links @ process.inverse
        goals = surrogate.coordinates(question.designs)
        rows = over.with_rows(goals, process.inputs)
        #: covariance with the relative error of each design of the question, (t, n)
        self._shared = over.with_rows(goals, self._inputs) - rows @ self._known.T
        taken = np.einsum("ij,ij->i", self._known, self._links)
        self._variance = process.covariance.variance(self._inputs) - taken
        self.noise = np.tile(one_shift_noise(surrogate, mix.points) / angles, len(goals))
        self._taken = np.zeros((0, len(self._inputs)))
        #: the question's variance of the relative error
        self.left = float(question.weights @ over.relative_variance(goals))

    @property
    def gains(self) -> Array:
        """Compute the drop of the question's variance by each row, (n,)."""
        gains: Array = self._weights @ self._shared**2 / (self._variance + self.noise)
        return gains

    def take(self, row: int) -> None:
        """Count a row as simulated."""
        self.left -= float(self.gains[row])
        column = self._covariance.between(self._inputs, self._inputs[row : row + 1])[:, 0]
        column = column - self._known @ self._links[row] - self._taken.T @ self._taken[:, row]
        deviation = float(self._variance[row] + self.noise[row]) ** 0.5
        scaled = column / deviation
        self._taken = np.vstack([self._taken, scaled])
        self._shared = self._shared - np.outer(self._shared[:, row], scaled) / deviation
        self._variance = np.maximum(self._variance - scaled**2, 0.0)


def one_shift_noise(surrogate: Surrogate, points: Array) -> Array:
    """Return the variance of the logarithm that one shift at each point has, (m,)."""
    process, count = surrogate.times, surrogate.data.column("engaged")
    one = process.noise * count[timed(surrogate.data)]
    known = process.inputs[:, -2]
    order = np.argsort(known, kind="stable")
    return np.interp(point_coordinates(points)[:, 0], known[order], one[order])
