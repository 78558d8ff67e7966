r"""Density of the marks of the flight under the prediction of a hypothesis.

The *k* marks of one force profile count once, whatever the number of traces. Their law is a Student
distribution of few degrees of freedom, so that one odd profile decides nothing alone:

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

SCALES = 10  #: standard deviations of unknown offsets that are summed over
SIZES = (1e-3, 0.2)  #: s, the least and the largest of them
LENGTH, SMOOTH = 1.5, 0.9  #: length in logarithms, and share of variance, that offsets share
NONE: tuple[Hypothesis, Array] = (), np.zeros((1, 0))  #: the baseline and its values


def log_flights(
    seen: Sequence[SeenFlight],
    flights: Flights,
    h: Hypothesis,
    values: Array,
    freedom: float = USUAL.flight_freedom,
) -> Array:
    """Compute the log density of all profiles' marks at values (m, p) of a hypothesis, (m,)."""
    both = np.zeros((2, len(values)))
    for distance, spread, size in _distances(seen, flights, h, values):
        constant = gammaln((freedom + size) / 2.0) - gammaln(freedom / 2.0)
        constant = constant - 0.5 * size * np.log(freedom * np.pi)
        both += constant - 0.5 * spread - 0.5 * (freedom + size) * np.log1p(distance / freedom)
    whole: Array = np.logaddexp(*both) - np.log(2.0)
    return whole


def flight_scores(
    seen: Sequence[SeenFlight],
    flights: Flights,
    h: Hypothesis,
    values: Array,
    freedom: float = USUAL.flight_freedom,
) -> Array:
    """Score the marks as normal deviates, (m, profiles), in the likelier reading of the force.

    Where the hypothesis holds at these values, the sum of their squares is chi-squared with one
    degree of freedom a profile.
    """
    tails = np.zeros((2, len(values), len(seen)))
    for k, (distance, _, size) in enumerate(_distances(seen, flights, h, values)):
        tails[:, :, k] = f_distribution.sf(distance / size, size, freedom)
    scores = norm.isf(0.5 * np.maximum(tails, 1e-300))
    acting = (scores[0] ** 2).sum(axis=1) <= (scores[1] ** 2).sum(axis=1)
    return np.where(acting[:, None], scores[0], scores[1])


def log_unknown(
    seen: Sequence[SeenFlight],
    flights: Flights,
    freedom: float = USUAL.flight_freedom,
) -> float:
    """Compute the log density of all marks if no known effect moved them."""
    if not seen:
        return 0.0
    still = float(log_flights(seen, flights, *NONE, freedom)[0])
    gaps, errors = [], []
    for one in seen:
        times, _, covariance = _predicted(one, flights, *NONE)
        gaps.append(one.times - times[0])
        errors.append(covariance[0])
    gap, error = np.concatenate(gaps), block_diag(*errors)
    shape, way = unknown_offsets(seen)
    moved = [
        multivariate_normal.logpdf(gap, cov=error + scale**2 * shape * np.outer(which, which))
        for scale in np.geomspace(*SIZES, SCALES)
        for which in (np.ones(way.size), way)
    ]
    free = np.logaddexp.reduce(moved) - np.log(len(moved))
    return float(np.logaddexp(still, free) - np.log(2.0))


def unknown_offsets(seen: Sequence[SeenFlight]) -> tuple[Array, Array]:
    """Compute the correlation of unknown offsets (K, K), and which are of the displacement (K,)."""
    shares = np.array([*WAYS, *FORCES])
    force = np.concatenate([np.full(s.places.size, np.log(s.profile.force)) for s in seen])
    places = np.concatenate([s.places for s in seen])
    way = (places < len(WAYS)).astype(float)
    where = np.stack([force, np.log(shares[places])], axis=1)
    square = ((where[:, None] - where[None]) ** 2).sum(axis=2)
    near = np.exp(-0.5 * square / LENGTH**2)
    alike = SMOOTH * near + (1.0 - SMOOTH) * np.eye(places.size)
    return alike * (way[:, None] == way), way


def _predicted(
    one: SeenFlight, flights: Flights, h: Hypothesis, values: Array
) -> tuple[Array, Array, Array]:
    """Predict the marks that a profile has, (m, k), by acting and nominal force, and covariance."""
    marks = flights.marks(h, values, one.profile)
    times, error, creep = (part[:, one.places] for part in (marks.times, marks.error, marks.creep))
    still = flights.marks(*NONE, one.profile).times[:, one.places]
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
        apart = np.stack([one.times - times for times in both], axis=2)
        scaled = np.linalg.solve(root, apart)
        spread = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        yield (scaled**2).sum(axis=1).T, spread, one.times.size
