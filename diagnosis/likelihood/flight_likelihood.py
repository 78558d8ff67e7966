r"""Likelihood of the marks of the flight under the prediction of a hypothesis.

The *k* marks of one force profile count once, whatever the number of traces. Their law is a Student
distribution of few degrees of freedom, so that one odd profile decides nothing alone:

.. math:: \ln L = c_k - \tfrac12 \ln |\Sigma| - \tfrac{\nu + k}2 \ln(1 + d^2/\nu), \qquad
          d^2 = (t - \hat t)^T \Sigma^{-1} (t - \hat t).

:math:`\Sigma` has the marks' scatter and what sensors and rigid flight err
(``diagnosis.bench.flight_marks``), the error of the emulated marks, and the creep of a ring that
friction holds.

The force of a trace may be the one that acts, with its delay, lag and scale, or the nominal one
that was asked for. The source does not say which, so each is tried for all profiles, half and half.

Operating points of a profile that have traces share its term in equal parts: left out together, as
when a force is held out, they take all of it along.

*Unknown* has the baseline's marks, or such moved by offsets: a Gaussian process over the logarithms
of force and of the mark's share, apart for displacement and force, of several sizes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.special import expit, gammaln
from scipy.stats import f as f_distribution
from scipy.stats import norm

from dogshape.diagnosis.bench.flight_marks import FORCES, WAYS, SeenFlight
from dogshape.diagnosis.prediction.prediction import Marks
from dogshape.diagnosis.settings import USUAL, Unlisted
from dogshape.diagnosis.terms import Array

SCALES = 10  #: standard deviations of unknown offsets that are summed over
SHARES = np.array([*WAYS, *FORCES])


@dataclass(frozen=True)
class FlightPrediction:
    """Prediction of the marks that one profile has, (m, k), and its covariance, (m, k, k).

    ``nominal`` are the marks where the force of the traces is the nominal one.
    """

    times: Array
    nominal: Array
    covariance: Array


def flight_prediction(seen: SeenFlight, predicted: Marks, baseline: Marks) -> FlightPrediction:
    """Select the predicted marks that a profile has."""
    places = seen.places
    times, error, creep = (
        part[:, places] for part in (predicted.times, predicted.error, predicted.creep)
    )
    nominal = np.where(places < len(WAYS), times, baseline.times[:, places])
    own = np.eye(places.size) * (error**2)[:, None, :]
    common = creep[:, :, None] * creep[:, None, :]
    return FlightPrediction(times, nominal, seen.covariance + own + common)


def log_flights(
    seen: Sequence[SeenFlight],
    predicted: Sequence[FlightPrediction],
    freedom: float = USUAL.likelihood.flight_freedom,
) -> Array:
    """Return the logarithm of the density of each profile's marks, (profiles, m).

    Their sum is that of both readings of the force; a profile has its part of it.
    """
    pairs = list(zip(seen, predicted, strict=True))
    acting = np.array([_student(one.times, it.times, it.covariance, freedom) for one, it in pairs])
    nominal = np.array(
        [_student(one.times, it.nominal, it.covariance, freedom) for one, it in pairs]
    )
    apart = acting.sum(axis=0) - nominal.sum(axis=0)
    first = expit(apart)
    # ln(e^A + e^B) = r A + (1 - r) B + H(r), r the probability of the first.
    entropy = np.logaddexp(0.0, -apart) + (1.0 - first) * apart
    return first * acting + (1.0 - first) * nominal + (entropy - np.log(2.0)) / len(seen)


def _squared(seen: Array, predicted: Array, covariance: Array) -> tuple[Array, Array]:
    """Return squared distances (m,) and logarithms of determinants (m,)."""
    root = np.linalg.cholesky(covariance)
    scaled = np.linalg.solve(root, (seen - predicted)[..., None])[..., 0]
    spread = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return (scaled**2).sum(axis=1), spread


def _student(seen: Array, predicted: Array, covariance: Array, freedom: float) -> Array:
    distance, spread = _squared(seen, predicted, covariance)
    size = seen.size
    constant = gammaln((freedom + size) / 2.0) - gammaln(freedom / 2.0)
    constant = constant - 0.5 * size * np.log(freedom * np.pi)
    return constant - 0.5 * spread - 0.5 * (freedom + size) * np.log1p(distance / freedom)


def to_cells(seen: Sequence[SeenFlight], logs: Array, cells: int) -> Array:
    """Return the profiles' terms (profiles, m) as parts of their cells, (m, cells)."""
    table = np.zeros((logs.shape[1], cells))
    for one, log in zip(seen, logs, strict=True):
        table[:, list(one.cells)] = log[:, None] / len(one.cells)
    return table


def flight_scores(
    seen: Sequence[SeenFlight],
    predicted: Sequence[FlightPrediction],
    values: int,
    freedom: float = USUAL.likelihood.flight_freedom,
) -> Array:
    """Score the residuals of the marks as normal deviates, (profiles, values)."""
    scores = []
    for one, it in zip(seen, predicted, strict=True):
        both = [_squared(one.times, times, it.covariance)[0] for times in (it.times, it.nominal)]
        tail = f_distribution.sf(np.minimum(*both) / one.times.size, one.times.size, freedom)
        scores.append(norm.isf(0.5 * np.maximum(tail, 1e-300)))
    return np.array(scores) if scores else np.zeros((0, values))


def log_unknown(
    seen: Sequence[SeenFlight],
    baseline: Sequence[FlightPrediction],
    prior: Unlisted = USUAL.unlisted,
    freedom: float = USUAL.likelihood.flight_freedom,
) -> float:
    """Compute the log density of all marks if no known effect moved them."""
    if not seen:
        return 0.0
    still = float(log_flights(seen, baseline, freedom).sum())
    gaps = np.concatenate([one.times - it.times[0] for one, it in zip(seen, baseline, strict=True)])
    errors = block_diag(*(it.covariance[0] for it in baseline))
    shape, way = unknown_offsets(seen, prior)
    moved = []
    for scale in np.geomspace(prior.least_mark, prior.most_mark, SCALES):
        for which in (np.ones(way.size), way):
            kernel = scale**2 * shape * np.outer(which, which)
            moved.append(_normal(gaps, errors + kernel))
    free = np.logaddexp.reduce(moved) - np.log(len(moved))
    return float(np.logaddexp(still, free) - np.log(2.0))


def unknown_offsets(seen: Sequence[SeenFlight], prior: Unlisted) -> tuple[Array, Array]:
    """Return the correlation of unknown offsets, and which are of the displacement."""
    force = np.concatenate([np.full(s.places.size, np.log(s.profile.force)) for s in seen])
    places = np.concatenate([s.places for s in seen])
    way = (places < len(WAYS)).astype(float)
    where = np.stack([force, np.log(SHARES[places])], axis=1)
    square = ((where[:, None] - where[None]) ** 2).sum(axis=2)
    smooth = prior.mark_smooth
    near = np.exp(-0.5 * square / prior.mark_length**2)
    alike = smooth * near + (1.0 - smooth) * np.eye(places.size)
    return alike * (way[:, None] == way), way


def _normal(gaps: Array, covariance: Array) -> float:
    root = np.linalg.cholesky(covariance)
    scaled = np.linalg.solve(root, gaps)
    spread = np.log(np.diag(root)).sum()
    return float(-0.5 * scaled @ scaled - spread - 0.5 * gaps.size * np.log(2.0 * np.pi))


def whitening(seen: Sequence[SeenFlight]) -> Array | None:
    """Compute the matrix that scales all marks to standard error 1, (K, K)."""
    if not seen:
        return None
    roots = [np.linalg.inv(np.linalg.cholesky(one.covariance)) for one in seen]
    return np.asarray(block_diag(*roots), dtype=np.float64)
