r"""Yardstick of a case: the noncentrality that the best refit by a rival leaves.

The engine of a case says without scatter how the truth changes mean times and spreads against no
effect. The same change of the diagnosis' own prediction is the data, so that the error of its
simulation cancels. A rival hypothesis *h* leaves, within its ranges,

.. math:: \Lambda = \min_h \min_\theta \; r^T C^{-1} r + \sum_k s_k^2, \qquad
          r = \bar t - \mu_h(\theta),

with all errors of the likelihood in *C* and the normal deviates :math:`s_k` of known spreads; late
shifts, shares engaged and traces are left out.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import qmc

from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.prediction.model import Prediction
from dogshape.diagnosis.terms import REVERSED, Array, Hypothesis
from dogshape.validation.blind.data import Expected

NONE: Hypothesis = ()
TRIED = (1, 65, 256, 256, 384)  #: values of a hypothesis by its number of parameters
REFINED = 10  #: rivals that are refitted further, those that leave the least
AROUND = 64  #: values of each round of that
WIDTHS = (0.12, 0.05, 0.02, 0.008)  #: of the ranges, about the best so far
ENGAGED = 0.5  #: share below which a rival has no times where the truth has
SERIES, DRAWN = 100, 100  #: test series of an observer, and draws of the gap for each


@dataclass(frozen=True)
class Yardstick:
    """Expected data of a case under the likelihood of its diagnosis.

    ``truth`` and ``plain`` are expected by the engine of the case with and without its causes.
    """

    likelihood: Likelihood
    truth: Expected
    plain: Expected

    @cached_property
    def base(self) -> Prediction:
        """Prediction without any effect."""
        return self.likelihood.model.predict(NONE, np.zeros((1, 0)))

    @cached_property
    def exact(self) -> Likelihood:
        """Likelihood of the expected data: no scatter, no late and no odd means."""
        seen, base = self.likelihood.observed, self.base
        mean = base.mean[0] + self.truth.mean - self.plain.mean
        with np.errstate(divide="ignore", invalid="ignore"):
            sd = base.sd[0] * self.truth.sd / self.plain.sd
        known = (seen.count > 0) & np.isfinite(mean) & np.isfinite(sd)
        nothing = np.zeros(len(mean))
        exact = replace(
            seen,
            count=np.where(known, seen.count, 0.0),
            mean=np.where(known, mean, 0.0),
            variance=np.where(known, np.maximum(sd, 5e-4) ** 2, 1.0),
            freedom=np.where(known, seen.freedom, 0.0),
            late_count=nothing,
            hides_late=nothing.astype(bool),
        )
        settings = replace(self.likelihood.settings, odd_share=1e-300, odd_spread=1e-300)
        return replace(self.likelihood, observed=exact, settings=settings)

    def squares(self, hypothesis: Hypothesis, shares: Array) -> Array:
        """Compute the noncentrality that values (m, p) of a hypothesis leave, (m,).

        Infinite for a value that no bench can have, or by which nothing engages where shifts do.
        """
        exact, some = self.exact, self.exact.measured_points
        p = exact.model.predict(hypothesis, shares)
        found = exact.terms(p)
        columns = exact.all_common_errors(p, exact.settings.discrepancy)[:, some]
        squares = squared_distance(found.residual, found.variance, columns)
        squares = squares + np.nansum(exact.spread_scores(p) ** 2, axis=1)
        there = (p.engaged_share[:, some] >= ENGAGED).all(axis=1)
        there &= exact.model.possible(hypothesis, shares)
        return np.where(there & np.isfinite(squares), squares, np.inf)

    def left(self, rivals: Iterable[Hypothesis]) -> dict[Hypothesis, float]:
        """Compute the noncentrality that some rivals leave; only the best ones are refitted."""
        space = self.exact.model.space
        first = {h: self._best(h, filling(len(space(h).parameters))) for h in rivals}
        best = sorted(first, key=lambda h: first[h][0])[:REFINED]
        return {h: found for h, (found, _) in first.items()} | {
            h: self._refitted(h, *first[h]) for h in best
        }

    def _best(self, hypothesis: Hypothesis, shares: Array) -> tuple[float, Array]:
        squares = self.squares(hypothesis, shares)
        place = int(squares.argmin())
        return float(squares[place]), shares[place]

    def _refitted(self, hypothesis: Hypothesis, least: float, middle: Array) -> float:
        """Search about the best value; ``least`` is its noncentrality."""
        for width in WIDTHS if middle.size else ():
            around = middle + width * (2.0 * _halton(middle.size, AROUND) - 1.0)
            found, place = self._best(hypothesis, np.clip(around, 0.0, 1.0))
            if found < least:
                least, middle = found, place
        return least


def filling(size: int) -> Array:
    """Compute shares that fill a unit cube of ``size`` dimensions evenly, (m, size)."""
    count = TRIED[min(size, len(TRIED) - 1)]
    if size < 2:
        return np.linspace(0.0, 1.0, count)[:, None] if size else np.zeros((1, 0))
    return _halton(size, count)


def _halton(size: int, count: int) -> Array:
    return np.asarray(qmc.Halton(size, scramble=False).random(count))


def rivals_of(kind: str, causes: Sequence[str], effects: Iterable[str]) -> list[Hypothesis]:
    """List the rivals of a truth: none and each other single effect, and pairs that can be it.

    Of two and more causes pairs with one of them at least are rivals, of what is outside the list
    all pairs. The reversed sense is a rival alone.
    """
    names, mine = sorted({*effects} - {REVERSED}), tuple(sorted(causes))
    singles: list[Hypothesis] = [NONE, *((n,) for n in (*names, REVERSED) if (n,) != mine)]
    pairs = list(itertools.combinations(names, 2))
    if kind == "outside":
        return [*singles, *pairs]
    if len(mine) < 2:
        return singles
    return [*singles, *(p for p in pairs if p != mine and set(p) & set(mine))]


def seen_as(
    stick: Yardstick, causes: Sequence[str], known: dict[Hypothesis, float]
) -> list[Hypothesis]:
    """List the fewest causes of a truth whose refit leaves nothing visible; several may do.

    ``known`` has the noncentrality that some rivals leave.
    """
    mine = tuple(sorted(causes))
    for size in range(len(mine)):
        parts = list(itertools.combinations(mine, size))
        left = stick.left([part for part in parts if part not in known]) | known
        if found := [part for part in parts if left[part] < stick.likelihood.settings.visible]:
            return found
    return [mine]


def power_of(stick: Yardstick, seed: int = 1) -> float:
    """Compute how often an observer who knows that no effect acts shows a gap within its margin.

    Test series of the engine's means with scatter and errors of nominal values are drawn. The gap
    is within its margin where its root mean square over the points is below one margin; that is
    shown where its probability, given the data, is that from which the diagnosis names.
    """
    generator, given = np.random.default_rng(seed), stick.likelihood
    seen, base = given.observed, stick.base
    known = (seen.count > 0) & np.isfinite(stick.plain.mean)
    count = np.where(known, seen.count, 1.0)
    simulated = base.mean[0]
    error = np.sqrt(stick.plain.sd**2 / count + given.nominal_variance * simulated**2)
    margin = given.bench.margin.of(simulated)[known]
    many = base.select(np.zeros(DRAWN, dtype=int))
    within = []
    for _ in range(SERIES):
        mean = np.where(known, stick.plain.mean + error * generator.standard_normal(len(error)), 0)
        series = replace(seen, count=np.where(known, count, 0.0), mean=mean, freedom=0.0 * mean)
        _, offset, nuisance = replace(given, observed=series).draw_common_errors(many, generator)
        gaps = offset - nuisance
        within.append((((gaps[:, known] / margin) ** 2).mean(axis=1) < 1.0).mean())
    return float((np.array(within) >= given.settings.named).mean())
