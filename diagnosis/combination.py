r"""Effects together, from what each of them makes alone.

With :math:`T_e` the times at a share of an effect's own spread and :math:`T_0` those of the
baseline, :math:`T = T_0 \prod_e T_e/T_0`, and the odds of engaging likewise. What that misses is
measured on pairs that were simulated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from diagnosis.bank import Bank
from diagnosis.late import bulk
from diagnosis.levels import Level
from diagnosis.sampling import engaged_mean, even_variance, residuals
from diagnosis.spread import Array

INTERACTION = 0.5  #: missed of the smaller change, where no pair was simulated
LEAST_INTERACTION = 0.2  #: the least, since a few pairs may agree by luck


@dataclass(frozen=True)
class Reach:
    """What is emulated at m values: times (m, q), share engaged and both variances, (m,).

    ``times`` are those that are not late, ``variance`` that of the logarithm of their mean;
    ``late`` is the share of late ones, (m,).
    """

    times: Array
    engaged: Array
    variance: Array
    engaged_variance: Array
    late: Array


def log_mean(reach: Reach) -> Array:
    """Return the logarithm of the mean time, (m,)."""
    mean: Array = np.log(reach.times.mean(axis=1))
    return mean


def together(base: Reach, reaches: list[Reach], variances: list[Array]) -> Reach:
    """Return effects together: changes of times and odds multiply; none leaves the baseline."""
    times, odds, late = np.log(base.times), _logit(base.engaged), _logit(base.late)
    doubt, variance = base.engaged_variance, base.variance
    for one, own in zip(reaches, variances, strict=True):
        times = times + np.log(one.times) - np.log(base.times)
        odds = odds + _logit(one.engaged) - _logit(base.engaged)
        late = late + _logit(one.late) - _logit(base.late)
        doubt, variance = doubt + one.engaged_variance, variance + own
    found = np.sort(np.exp(times), axis=1)
    return Reach(found, expit(odds), variance, doubt, expit(late))


def _logit(share: Array) -> Array:
    inside = np.clip(share, 1e-3, 1.0 - 1e-3)
    odds: Array = np.log(inside / (1.0 - inside))
    return odds


def interaction_of(bank: Bank, places: list[int]) -> float:
    """Return the root mean square of what pairs differ by over their smaller change."""
    missed = small = 0.0
    for k in places:
        level = bank.levels[k]
        alone = [_same(bank, level, place) for place in range(len(level.hypothesis))]
        four = bulk(np.array([bank.base, bank.times[k], *(bank.times[j] for j in alone)]))
        mean, series = np.log(engaged_mean(four)), residuals(four)
        changes = mean[2:] - mean[0]
        left = mean[1] - mean[0] - changes.sum(axis=0)
        noise = even_variance(series[1] - series[0] - (series[2:] - series[0]).sum(axis=0))
        known = np.isfinite(left)
        missed += float((left**2 - noise)[known].sum())
        small += float((np.sort(abs(changes), axis=0)[-2] ** 2)[known].sum())
    if small == 0.0:
        return INTERACTION
    return max(LEAST_INTERACTION, float(np.sqrt(max(missed, 0.0) / small)))


def _same(bank: Bank, level: Level, place: int) -> int:
    """Return the place of the level that has one effect of a pair alone."""
    counts = [len(e.parameters) for n in level.hypothesis for e in bank.effects if e.name == n]
    start = sum(counts[:place])
    values = level.values[start : start + counts[place]]
    return bank.levels.index(Level((level.hypothesis[place],), values))
