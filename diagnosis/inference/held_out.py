"""Prediction of each operating point from all others, against what chance alone leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.terms import Array, Hypothesis

ROWS = 100  #: draws of a hypothesis


@dataclass(frozen=True)
class HeldOut:
    """Gaps at operating points that the fit has not seen, root mean square, s.

    Parameters
    ----------
    baseline : without any effect.
    held_out : at each point from all others, by the leading hypothesis.
    chance : what scatter and errors alone leave.
    rival, rival_held_out : the best other hypothesis, and what it leaves.
    mean, sd : prediction at each point from all others, s, (C,).
    """

    baseline: float
    held_out: float
    chance: float
    rival: Hypothesis | None
    rival_held_out: float | None
    mean: Array
    sd: Array


def held_out(likelihood: Likelihood, leading: Fit, rival: Fit | None, baseline: Array) -> HeldOut:
    """Predict each operating point from all others by the leading hypothesis and its rival.

    ``baseline`` are the gaps without any effect, s, (C,), NaN where there is no mean.
    """
    some = likelihood.having
    mean, sd, gaps, chance = left_out(likelihood, leading)
    other = left_out(likelihood, rival)[2] if rival is not None else None
    every = np.full(likelihood.model.cells, np.nan)
    means, sds = every.copy(), every.copy()
    means[some], sds[some] = mean, sd
    return HeldOut(
        _rms(baseline[some]),
        _rms(gaps),
        chance,
        rival.hypothesis if rival is not None else None,
        _rms(other) if other is not None else None,
        means,
        sds,
    )


def left_out(likelihood: Likelihood, one: Fit) -> tuple[Array, Array, Array, float]:
    """Predict each observed mean from all others: mean, sd, gap (c,), and the chance gap, s.

    Draws count for a point by the inverse of the density that they give it, so as if the point had
    not been seen.
    """
    rows = np.linspace(0, len(one.shares) - 1, ROWS).astype(int)
    p = one.predicted.only(rows)
    found = likelihood.terms(p)
    simulated = (p.mean - p.delay)[..., None]
    smooth = one.amplitude[rows, None, None] * simulated * likelihood.smooth
    columns = np.concatenate([smooth, likelihood.columns(p)], axis=2)[:, likelihood.having]
    size = found.residual.shape[1]
    covariance = columns @ np.swapaxes(columns, 1, 2) + found.variance[..., None] * np.eye(size)
    inverse = np.linalg.inv(covariance)
    diagonal = np.diagonal(inverse, axis1=1, axis2=2)
    gap = np.einsum("mcd,md->mc", inverse, found.residual) / diagonal
    log = 0.5 * np.log(diagonal) - 0.5 * gap**2 * diagonal
    weights = np.exp(np.minimum(-log - (-log).mean(axis=0), 0.5 * np.log(len(rows))))
    weights /= weights.sum(axis=0)
    seen = likelihood.seen.mean[likelihood.having]
    predicted = seen - gap
    mean = (weights * predicted).sum(axis=0)
    variance = (weights * (1.0 / diagonal + (predicted - mean) ** 2)).sum(axis=0)
    scatter = (weights * found.variance).sum(axis=0)
    return mean, np.sqrt(variance), seen - mean, float(np.sqrt(scatter.mean()))


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt((known**2).mean())) if known.size else 0.0
