r"""Where to simulate next: the rows that most lower the error of a question.

A question is the expected time over a mix at some target designs, with weights
:math:`\omega_t`. A row *q* that is simulated with noise :math:`s_q^2` lowers the summed
variance of the relative errors by

.. math:: \sum_t \omega_t \frac{C(t, q)^2}{C(q, q) + s_q^2},

*C* being the covariance given all rows (Cohn 1996, for processes: Seo et al. 2000). Rows
are chosen one after the other, each given those before: what a row will say is not needed for
that, only where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surrogate.covariance import Array, Places
from surrogate.model import Surrogate
from surrogate.over import Over
from surrogate.targets import point_coordinates, timed


@dataclass(frozen=True)
class Question:
    """Designs (t, d) in edge units whose expected time is asked for, with weights (t,)."""

    designs: Array
    weights: Array


@dataclass(frozen=True)
class Choice:
    """Rows to simulate: places of designs of the question and of points of the mix, (n,).

    ``designs`` and ``points`` count from nought; ``left`` is the question's variance of the
    relative error after each row, over that before the first.
    """

    designs: Places
    points: Places
    left: Array


def choose(over: Over, question: Question, angles: int, count: int) -> Choice:
    """Choose ``count`` rows of ``angles`` shifts at the question's designs and the mix's points."""
    surrogate, mix = over.surrogate, over.mix
    process, size = surrogate.times, len(mix.points)
    inputs = surrogate.crossed(question.designs, mix.points)
    links = process.covariance.between(inputs, process.inputs)
    known = links @ process.inverse
    goals = surrogate.coordinates(question.designs)
    shared = over.with_rows(goals, inputs) - over.with_rows(goals, process.inputs) @ known.T
    variance = process.covariance.variance(inputs) - np.einsum("ij,ij->i", known, links)
    noise = np.tile(one_shift_noise(surrogate, mix.points) / angles, len(question.designs))
    start = float(question.weights @ over.relative_variance(goals))
    told = np.zeros((0, len(inputs)))
    picked: list[int] = []
    left = [start]
    for _ in range(count):
        gain = question.weights @ shared**2 / (variance + noise)
        best = int(np.argmax(gain))
        picked.append(best)
        left.append(left[-1] - float(gain[best]))
        column = process.covariance.between(inputs, inputs[best : best + 1])[:, 0]
        column = column - known @ links[best] - told.T @ told[:, best]
        deviation = float(variance[best] + noise[best]) ** 0.5
        told = np.vstack([told, column / deviation])
        shared = shared - np.outer(shared[:, best], told[-1]) / deviation
        variance = np.maximum(variance - told[-1] ** 2, 0.0)
    places = np.array(picked)
    return Choice(places // size, places % size, np.array(left[1:]) / start)


def one_shift_noise(surrogate: Surrogate, points: Array) -> Array:
    """Return the variance of the logarithm that one shift at each point has, (m,)."""
    process, count = surrogate.times, surrogate.data.column("engaged")
    one = process.noise * count[timed(surrogate.data)]
    known = process.inputs[:, -2]
    order = np.argsort(known, kind="stable")
    return np.interp(point_coordinates(points)[:, 0], known[order], one[order])
