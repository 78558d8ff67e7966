r"""Combination of effects from the emulation of each effect alone.

With :math:`r_e = T_e/T_0` the ratio of mean times with an effect and without any, two effects that
act one after the other add their changes, :math:`r = r_1 + r_2 - 1`. If one effect stretches the
time that the other makes, they multiply, :math:`r = r_1 r_2`. A weight *w* from simulated pairs
says where between (or beyond) both a pair lies:

.. math:: \ln r = \ln r_1 r_2 + w\,d, \qquad d = \ln\frac{r_1 + r_2 - 1}{r_1 r_2}.

*w* is fitted to a pair's operating points by the errors of the simulated means, with all pairs as a
prior. At each point *w* moves as far as its own means allow. The error of *w* at other strengths
has a part that all operating points share, and one of their own. All times of a spread take the
same factor on top of their product, and the odds of engaging multiply.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from dogshape.diagnosis.prediction.angle_means import engaged_mean, even_variance, residuals
from dogshape.diagnosis.prediction.bank import Bank
from dogshape.diagnosis.prediction.levels import Level, columns_of
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.terms import Array, Hypothesis

BLEND = (0.7, 1.0)  #: mean and standard deviation of w, where no pair was simulated
BEYOND = (-2.0, 3.0)  #: w is kept between
UNSEEN = 0.3  #: standard error of w at other strengths than those simulated
OWN = 0.15  #: the same that each operating point has for itself, at least
KEPT = 0.5  #: share of the scatter of w between operating points that may be another elsewhere
LEAST_SUM = 0.5  #: of the smaller ratio, the least that two changes leave
LEAST = 1e-3  #: the least error of a mean's logarithm
FEW = 0.25  #: of the smaller change, what two effects miss where no pair was simulated


@dataclass(frozen=True)
class Emulated:
    """Emulated times at m values, (m, q), with share engaged and both variances, (m,).

    Of C operating points all have a first axis more, (C, m, q) and (C, m). ``times`` leave outliers
    out, ``variance`` is that of the logarithm of their mean; ``outlier_share`` is (m,).
    """

    times: Array
    engaged: Array
    variance: Array
    engaged_variance: Array
    outlier_share: Array


def log_mean(emulated: Emulated) -> Array:
    """Return the logarithm of the mean time, (..., m)."""
    return np.log(emulated.times.mean(axis=-1))


def together(base: Emulated, emulated_alone: list[Emulated], variances: list[Array]) -> Emulated:
    """Return effects together: changes of times and odds multiply; none leaves the baseline."""
    start = np.log(base.times), clipped_logit(base.engaged), clipped_logit(base.outlier_share)
    times, odds, outlier_share = start
    doubt, variance = base.engaged_variance, base.variance
    for one, own in zip(emulated_alone, variances, strict=True):
        times = times + np.log(one.times) - start[0]
        odds = odds + clipped_logit(one.engaged) - start[1]
        outlier_share = outlier_share + clipped_logit(one.outlier_share) - start[2]
        doubt, variance = doubt + one.engaged_variance, variance + own
    found = np.sort(np.exp(times), axis=-1)
    return Emulated(found, expit(odds), variance, doubt, expit(outlier_share))


def clipped_logit(share: Array) -> Array:
    """Compute the logarithm of the odds of shares, none of which counts as sure."""
    inside = np.clip(share, 1e-3, 1.0 - 1e-3)
    return np.log(inside / (1.0 - inside))


def basis(first: Array, second: Array) -> Array:
    """Return *d* from changes of the logarithms of two means."""
    one, two = np.exp(first), np.exp(second)
    added = np.maximum(one + two - 1.0, LEAST_SUM * np.minimum(one, two))
    return np.log(added) - first - second


@dataclass(frozen=True)
class Blend:
    """Law by which a pair combines.

    Parameters
    ----------
    share : *w* at each operating point, (C,), or (1,) for all.
    error, own : its standard errors, in common to all operating points and of each.
    left : what else two effects miss, over the smaller change.
    """

    share: Array
    error: float
    own: float
    left: float = 0.0


@dataclass(frozen=True)
class Missed:
    """Correction of the logarithm of the mean of two effects, (C, m), with standard errors.

    ``common`` is that of *w*, of one sign at operating points whose *d* is, ``own`` the rest.
    """

    moved: Array
    common: Array
    own: Array


@dataclass(frozen=True)
class Interactions:
    """Laws of combination by pair; ``any`` is that of pairs that were not simulated."""

    pairs: Mapping[Hypothesis, Blend]
    any: Blend

    @classmethod
    def of(cls, bank: Bank) -> Interactions:
        """Fit the laws to the pairs of a bank."""
        those = dict.fromkeys(k.hypothesis for k in bank.levels if len(k.hypothesis) == 2)
        checked = {pair: _checked(bank, pair) for pair in those}
        shown = {pair: _shown(bank, checks) for pair, checks in checked.items() if checks}
        if not shown:
            return cls({}, Blend(np.array([BLEND[0]]), BLEND[1], OWN, FEW))
        means = np.array([one.mean(*BLEND) for one in shown.values()])
        centre, spread = float(means.mean()), max(UNSEEN, float(means.std()))
        pairs: dict[Hypothesis, Blend] = {
            pair: one.blend(centre, spread) for pair, one in shown.items()
        }
        own = float(np.sqrt(np.mean([one.own**2 for one in pairs.values()])))
        return cls(pairs, Blend(np.array([centre]), spread, own, FEW))

    def missed(self, pair: Hypothesis, changes: Mapping[str, Array], left: float = 0.0) -> Missed:
        """Compute the correction of the product of two effects at all operating points.

        ``changes`` are those of the logarithm of the mean by each effect alone, (C, m) by name;
        ``left`` is what the pair misses at least, over the smaller of them.
        """
        one, two = (changes[name] for name in pair)
        blend = self.pairs.get(pair, self.any)
        d = basis(one, two)
        least = np.minimum(abs(one), abs(two))
        own = (blend.own * d) ** 2 + (max(left, blend.left) * least) ** 2
        return Missed(blend.share[:, None] * d, blend.error * d, np.sqrt(own))


@dataclass(frozen=True)
class _Shown:
    """Residual of a simulated pair beside the product, (levels, C) each; NaN if not known."""

    residual: Array
    noise: Array
    basis: Array

    @property
    def _known(self) -> np.ndarray:
        return np.isfinite(self.residual + self.noise + self.basis)

    def mean(self, centre: float, spread: float) -> float:
        """Return *w* of all operating points, ``centre`` give or take ``spread`` before."""
        return self._fitted(centre, spread)[0]

    def _fitted(self, centre: float, spread: float) -> tuple[float, float]:
        residual, noise, basis = (
            part[self._known] for part in (self.residual, self.noise, self.basis)
        )
        weight = basis / noise**2
        precision = float((weight * basis).sum()) + spread**-2
        share = (float((weight * residual).sum()) + centre * spread**-2) / precision
        return float(np.clip(share, *BEYOND)), precision**-0.5

    def blend(self, centre: float, spread: float) -> Blend:
        """Fit the law of the pair."""
        share, error = self._fitted(centre, spread)
        residual, basis = (
            np.where(self._known, part, 0.0)
            for part in (self.residual - share * self.basis, self.basis)
        )
        noise = np.where(self._known, self.noise, 1.0)
        whole = float((basis**2).sum())
        squares = max(0.0, float(((residual**2 - noise**2) * self._known).sum()))
        scatter = max(1e-6, squares / whole if whole > 0.0 else 0.0)
        precision = (basis**2 / noise**2).sum(axis=0) + 1.0 / scatter
        each = share + (residual * basis / noise**2).sum(axis=0) / precision
        own = float(np.hypot(OWN, KEPT * np.sqrt(scatter)))
        return Blend(np.clip(each, *BEYOND), float(np.hypot(error, UNSEEN)), own)


def _checked(bank: Bank, pair: Hypothesis) -> list[tuple[int, list[int]]]:
    """List the levels of a pair of which each effect alone is a level too, with these two."""
    found = ((k, [_same(bank, bank.levels[k], place) for place in range(2)]) for k in bank.of(pair))
    return [(k, [j for j in alone if j is not None]) for k, alone in found if None not in alone]


def _shown(bank: Bank, checks: list[tuple[int, list[int]]]) -> _Shown:
    """Compare the levels of a pair with the product."""
    rows = []
    for k, alone in checks:
        four = bulk(np.array([bank.base, bank.times[k], *(bank.times[j] for j in alone)]))
        mean, series = np.log(engaged_mean(four)), residuals(four)
        changes = mean[2:] - mean[0]
        residual = mean[1] - mean[0] - changes.sum(axis=0)
        noise = even_variance(series[1] - series[0] - (series[2:] - series[0]).sum(axis=0))
        rows.append((residual, np.sqrt(noise) + LEAST, basis(*changes)))
    return _Shown(*np.array(rows).transpose(1, 0, 2))


def _same(bank: Bank, level: Level, place: int) -> int | None:
    """Return the place of the level that has one effect of a pair alone, None without one."""
    name = level.hypothesis[place]
    columns = columns_of(level.hypothesis, {effect.name: effect for effect in bank.effects})
    alone = Level((name,), level.values[columns[name]])
    return bank.levels.index(alone) if alone in bank.levels else None
