r"""Times of all designs of a search in two levels, and how surely they are told apart.

**Correction.** Each design has its own mean difference of Drake to the compiled engine,
:math:`r_i \pm s_i` of its time. That of a few pairs is mostly the luck of single angles at which
one engine comes into another slot, so it is drawn to the mean of all designs as far as the pairs
say that designs differ no more than that: with :math:`\tau^2` their scatter beyond sampling
(DerSimonian and Laird 1986),

.. math:: \tilde r_i = b_i r_i + (1 - b_i) \bar r, \qquad b_i = \tau^2/(\tau^2 + s_i^2).

:math:`\tau^2` is taken one standard error above its estimate, so that a scatter which the pairs
cannot exclude counts too. Fewer than ``LEAST`` designs each keep their own.

**Errors.** All designs have the same angles and draws, so most of the compiled engine's error is
common to neighbours on the front. Of two designs it leaves

.. math:: Cov_{ij} = (V(z_i) + V(z_j) - V(z_i - z_j))/2

with *V* the variance of a mean over even angles (``sim.statistics.expectation``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.level_times import LevelTimes, common_squares
from dogshape.surrogate.covariance import Array

LEVELS = "levels"  #: attribute of a trial: its shifts in two levels
LEAST = 10  #: designs whose corrections are drawn to each other


@dataclass(frozen=True)
class Correction:
    """Corrections of the compiled engine for m designs, relative.

    Parameters
    ----------
    mean : of all designs, with its variance ``mean_variance``.
    scatter : standard deviation of designs beyond sampling that is taken.
    values : of each design, drawn to the mean, (m,).
    own : variance of each design's that is its alone, (m,).
    shared : share of the mean's error that each design has, (m,).
    """

    mean: float
    mean_variance: float
    scatter: float
    values: Array
    own: Array
    shared: Array

    @property
    def covariance(self) -> Array:
        """Covariance of the designs' corrections, (m, m)."""
        common = self.mean_variance * np.outer(self.shared, self.shared)
        return common + np.diag(self.own)


def levels_of(study: Setup, trial: FrozenTrial) -> LevelTimes:
    """Read the shifts of a simulated trial in two levels."""
    return LevelTimes.of_record(study, trial.user_attrs[LEVELS])


def correction_of(study: Setup, levels: Sequence[LevelTimes]) -> Correction:
    """Work out the corrections of all designs from the pairs of all of them."""
    pairs = np.array([one.few for one in levels], dtype=float)
    squares = np.array([one.squares for one in levels])
    common = common_squares(study, pairs @ squares / pairs.sum())
    values = np.array([one.correction / one.compiled for one in levels])
    sampling = np.array([one.correction_variance(common) / one.compiled**2 for one in levels])
    sampling = np.maximum(sampling, 1e-18)  # engines that agree to the last digit
    count, weights = len(levels), 1.0 / sampling
    mean, spread = float(weights @ values / weights.sum()), 0.0
    if count < LEAST:
        return Correction(mean, 0.0, 0.0, values, sampling, np.zeros(count))
    scale = float(weights.sum() - (weights**2).sum() / weights.sum())
    excess = float(weights @ (values - mean) ** 2) - (count - 1)
    spread = (max(0.0, excess) + (2.0 * (count - 1)) ** 0.5) / scale
    weights = 1.0 / (sampling + spread)
    mean, kept = float(weights @ values / weights.sum()), spread / (spread + sampling)
    drawn_in = kept * values + (1.0 - kept) * mean
    error = float(1.0 / weights.sum())
    return Correction(mean, error, spread**0.5, drawn_in, kept * sampling, 1.0 - kept)


def level_times_of(study: Setup, trials: Sequence[FrozenTrial]) -> tuple[Array, Array]:
    """Compute the expected times of simulated trials and their standard errors, (m,) each, s."""
    levels = [levels_of(study, trial) for trial in trials]
    found = correction_of(study, levels)
    compiled = np.array([one.compiled for one in levels])
    own = np.array([one.compiled_variance for one in levels])
    corrected = compiled**2 * np.diag(found.covariance)
    return compiled * (1.0 + found.values), np.sqrt(own + corrected)


def joint_level_times(
    study: Setup, trials: Sequence[FrozenTrial], asked: Sequence[FrozenTrial]
) -> tuple[Array, Array]:
    """Compute the times of trials asked, (m,) in s, and the covariance of their errors, (m, m).

    The pairs of all ``trials`` say what the compiled engine is off by.
    """
    every = [levels_of(study, trial) for trial in trials]
    found = correction_of(study, every)
    places = [trial.number for trial in trials]
    chosen = [places.index(trial.number) for trial in asked]
    levels = [every[place] for place in chosen]
    compiled = np.array([one.compiled for one in levels])
    corrected = found.covariance[np.ix_(chosen, chosen)] * np.outer(compiled, compiled)
    return compiled * (1.0 + found.values[chosen]), corrected + compiled_covariance(levels)


def compiled_covariance(levels: Sequence[LevelTimes]) -> Array:
    """Compute the covariance of the compiled engine's times at the same angles, (m, m), s2."""
    covariance = np.diag([one.compiled_variance for one in levels])
    for i, one in enumerate(levels):
        for j, other in enumerate(levels[:i]):
            even = np.array(one.even) & np.array(other.even)
            left = one.weights**2 @ _variances((one.cheap - other.cheap)[None], even)[0]
            shared = 0.5 * (covariance[i, i] + covariance[j, j] - float(left))
            covariance[i, j] = covariance[j, i] = shared
    return covariance


def _variances(times: Array, even: Array) -> Array:
    """Compute ``sim.statistics.expectation.variance_of_mean`` over the last axis, (m, q), s2."""
    n = times.shape[-1]
    steps = np.roll(times, -1, axis=-1) - times
    scatter = np.maximum(0.0, -(steps * np.roll(steps, -1, axis=-1)).mean(axis=-1))
    smooth = (steps**2).sum(axis=-1) / (12.0 * n * n) + 5.0 * scatter / (6.0 * n)
    return np.where(even, smooth, times.var(axis=-1, ddof=1) / n)
