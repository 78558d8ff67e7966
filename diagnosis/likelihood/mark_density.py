r"""Density of the marks of the flight under the prediction of a hypothesis.

The *k* marks of a force profile count once, by a Student distribution of few degrees of freedom:

.. math:: \ln L = c_k - \tfrac12 \ln |\Sigma| - \tfrac{\nu + k}2 \ln(1 + d^2/\nu), \qquad
          d^2 = (t - \hat t)^T \Sigma^{-1} (t - \hat t).

:math:`\Sigma` holds the errors of seen and predicted marks, and the creep of a ring that friction
holds. The force of a trace is the one that acts or the nominal one, a half each. *Unknown* has the
baseline's marks, or these moved by offsets: a Gaussian process over the logarithms of force and
share, apart for displacement and force, of several sizes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import block_diag
from scipy.special import gammaln
from scipy.stats import f as f_distribution
from scipy.stats import multivariate_normal, norm

from dogshape.diagnosis.bench.flight_marks import FORCES, WAYS, SeenFlight
from dogshape.diagnosis.prediction.flights import Flights
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis

SCALES = np.geomspace(1e-3, 0.2, 10)  #: s, standard deviations of unknown offsets
LENGTH, SMOOTH = 1.5, 0.9  #: length in logarithms, and share of variance, that offsets share
STILL: tuple[Hypothesis, Array] = (), np.zeros((1, 0))  #: the baseline and its values
FREEDOM = USUAL.flight_freedom


def log_flights(
    seen: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Array:
    """Compute the log density of all profiles' marks at values (m, p) of a hypothesis, (m,)."""
    both = np.zeros((2, len(values)))
    for distance, spread, size in _distances(seen, flights, h, values):
        constant = gammaln((FREEDOM + size) / 2.0) - gammaln(FREEDOM / 2.0)
        constant = constant - 0.5 * size * np.log(FREEDOM * np.pi)
        both += constant - 0.5 * spread - 0.5 * (FREEDOM + size) * np.log1p(distance / FREEDOM)
    whole: Array = np.logaddexp(*both) - np.log(2.0)
    return whole


def flight_scores(
    seen: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Array:
    """Score the marks as normal deviates, (m, profiles), in the likelier reading of the force."""
    tails = np.zeros((2, len(values), len(seen)))
    for k, (distance, _, size) in enumerate(_distances(seen, flights, h, values)):
        tails[:, :, k] = f_distribution.sf(distance / size, size, FREEDOM)
    scores = norm.isf(0.5 * np.maximum(tails, 1e-300))
    acting = (scores[0] ** 2).sum(axis=1) <= (scores[1] ** 2).sum(axis=1)
    return np.where(acting[:, None], scores[0], scores[1])


def log_unknown(seen: Sequence[SeenFlight], flights: Flights) -> float:
    """Compute the log density of all marks if no known effect moved them."""
    if not seen:
        return 0.0
    still = float(log_flights(seen, flights, *STILL)[0])
    predicted = [_predicted(one, flights, *STILL) for one in seen]
    gap = np.concatenate([s.times - p[0][0] for s, p in zip(seen, predicted, strict=True)])
    error = block_diag(*(covariance[0] for *_, covariance in predicted))
    places = np.concatenate([one.places for one in seen])
    force = np.concatenate([np.full(one.places.size, one.profile.force) for one in seen])
    where = np.log([force, np.array([*WAYS, *FORCES])[places]])
    square = ((where[:, :, None] - where[:, None]) ** 2).sum(axis=0)
    way = places < len(WAYS)
    alike = SMOOTH * np.exp(-0.5 * square / LENGTH**2) + (1.0 - SMOOTH) * np.eye(way.size)
    shape = alike * (way[:, None] == way)
    moved = [
        multivariate_normal.logpdf(gap, cov=error + scale**2 * shape * np.outer(which, which))
        for scale in SCALES
        for which in (way | True, way)
    ]
    free = np.logaddexp.reduce(moved) - np.log(len(moved))
    return float(np.logaddexp(still, free) - np.log(2.0))


def _predicted(
    one: SeenFlight, flights: Flights, h: Hypothesis, values: Array
) -> tuple[Array, Array, Array]:
    """Predict the marks that a profile has, (m, k), by acting and nominal force, and covariance."""
    marks = flights.marks(h, values, one.profile)
    times, error, creep = (part[:, one.places] for part in (marks.times, marks.error, marks.creep))
    still = flights.marks(*STILL, one.profile).times[:, one.places]
    nominal = np.where(one.places < len(WAYS), times, still)
    own = np.eye(one.places.size) * (error**2)[:, None, :]
    return times, nominal, one.covariance + own + creep[:, :, None] * creep[:, None, :]


def _distances(
    seen: Sequence[SeenFlight], flights: Flights, h: Hypothesis, values: Array
) -> Iterator[tuple[Array, Array, int]]:
    """Yield of each profile squared distances (2, m), log determinants (m,) and number of marks."""
    for one in seen:
        *both, covariance = _predicted(one, flights, h, values)
        root = np.linalg.cholesky(covariance)
        scaled = np.linalg.solve(root, np.stack([one.times - times for times in both], axis=2))
        spread = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        yield (scaled**2).sum(axis=1).T, spread, one.times.size
