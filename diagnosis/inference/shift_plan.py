r"""Plan of shifts before any is made: operating points, numbers, order, and pairs told apart.

With the errors that *n* shifts at each operating point leave, two values of hypotheses lie apart by

.. math:: D = \delta^T (V + A A^T)^{-1} \delta + \sum \delta_s^2 / v_s + \sum \delta_p^2 / v_p,

:math:`\delta`, :math:`\delta_s`, :math:`\delta_p` the differences of means, ln spreads and shares
that engage, *V* the variances of means, *A* all errors in common. A rival imitates a truth by its
nearest value. *D*/2 is about the expected log Bayes factor, :math:`\Phi(\sqrt D / 2)` the
probability to decide a pair; its mean over all pairs and strengths is the worth of a plan. Shifts
go in lots, each to the operating point that adds most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, polygamma
from scipy.stats import qmc

from dogshape.diagnosis.inference.outcome import EDGE, SETUP, SHIFT
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.prediction.model import Model, Predicted
from dogshape.diagnosis.terms import NONE, Array, Hypothesis
from dogshape.sim.errors import InputError, refusal

LOT, LOTS = 5, 20  #: shifts given at once, at least; lots of a plan, at most
VISITS = 3  #: to the reference point: at the beginning, in the middle, at the end
TRUTHS, RIVALS = 32, 256  #: values of each effect that may be true, and that may imitate
APART = 1.5  #: expected log Bayes factor from which two hypotheses are told apart, 4.5 : 1


@dataclass(frozen=True)
class Field:
    """Predictions of all hypotheses at some operating points."""

    hypotheses: tuple[Hypothesis, ...]  #: none, then each effect
    truths: tuple[Array, ...]  #: values that may be true, (m, 4, cells) of each hypothesis
    rivals: tuple[Array, ...]  #: values that imitate them, as many of each
    baseline: Predicted  #: without any effect, (1, cells)
    error: Array  #: standard errors of its means, s, (cells,)
    spread: Array  #: standard errors of ln of its spreads, (cells,)
    common: Array  #: covariance of the means, s^2, (cells, cells)

    @property
    def cells(self) -> int:
        """Number of operating points."""
        return len(self.common)

    def distances(self, shifts: Array) -> list[Array]:
        """Compute squared distances of truths from all at numbers of shifts, (truths, h)."""
        used, base = np.flatnonzero(shifts > 0), self.baseline
        n = shifts[used]
        variance = base.sd[0, used] ** 2 / n + self.error[used] ** 2
        covariance = np.diag(variance) + self.common[np.ix_(used, used)]
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        share = np.clip(base.engaged[0, used], EDGE, 1.0 - EDGE)
        engaged = np.sqrt(share * (1.0 - share) / n + EDGE**2)
        # One shift has no spread.
        freedom = np.where(n >= 2.0, n - 1.0, 1e-9)
        spread = np.sqrt(0.25 * polygamma(1, 0.5 * freedom) + self.spread[used] ** 2)

        def placed(values: Array) -> tuple[Array, Array]:
            mean, log_sd, part, own = np.moveaxis(values[:, :, used], 1, 0)
            points = np.hstack([mean @ root.T, log_sd / spread, part / engaged])
            return points, own @ (root**2).sum(axis=0)

        rivals, found = [placed(values) for values in self.rivals], []
        for mine, noise in map(placed, self.truths):
            columns = []
            for theirs, other in rivals:
                cross = -2.0 * mine @ theirs.T + (theirs**2).sum(axis=1)
                # The nearest with its noise: values of large error are else near to anything.
                near = cross.argmin(axis=1)
                columns.append(((mine - theirs[near]) ** 2).sum(axis=1) - noise - other[near])
            found.append(np.maximum(0.0, np.stack(columns, axis=1)))
        return found

    def worth(self, shifts: Array) -> float:
        """Compute the mean probability to decide a pair rightly; half where nothing is."""
        right = [ndtr(0.5 * np.sqrt(one)).mean(axis=0) for one in self.distances(shifts)]
        return float(np.array(right)[~np.eye(len(right), dtype=bool)].mean())


def field_of(likelihood: Likelihood) -> Field:
    """Predict none and each effect alone at the operating points of a likelihood."""
    model, settings = likelihood.model, likelihood.settings
    base = model.predict(NONE, np.zeros((1, 0)))
    hypotheses = (NONE, *((name,) for name in sorted(model.effects)))
    time = (base.mean - base.delay)[0]
    smooth = settings.discrepancy * time[:, None] * likelihood.smooth
    common = np.hstack([smooth, likelihood.columns(base)[0]])
    spread = np.hypot(settings.spread_share, np.log1p(settings.spread_error * time / base.sd[0]))
    truths, rivals = (
        tuple(_values(model, h, count, base) for h in hypotheses) for count in (TRUTHS, RIVALS)
    )
    error = np.sqrt(likelihood.own_variance(base)[0])
    return Field(hypotheses, truths, rivals, base, error, spread, common @ common.T)


def _values(model: Model, hypothesis: Hypothesis, count: int, base: Predicted) -> Array:
    """Predict mean, ln sd, share engaged, variance of emulation over the range, (m, 4, cells)."""
    size = len(model.space(hypothesis).parameters)
    shares = ((np.arange(count) + 0.5) / count)[:, None] if size == 1 else np.zeros((1, 0))
    if size > 1:
        shares = np.asarray(qmc.Sobol(size, seed=1).random(count))
    one = model.predict(hypothesis, shares[model.possible(hypothesis, shares)])
    own = np.maximum(0.0, one.error**2 - base.error**2)
    # Where nothing engages the share says so, and there is no mean to compare.
    return np.nan_to_num(np.stack([one.mean, np.log(one.sd), one.engaged, own], axis=1))


@dataclass(frozen=True)
class ShiftPlan:
    """Plan of shifts and the pairs that it tells apart."""

    field: Field
    shifts: tuple[int, ...]  #: at each operating point, (cells,), whole numbers
    order: tuple[tuple[int, int], ...]  #: visits: place of the point, number of shifts
    reference: int  #: place of the point that is visited three times
    worth: float  #: mean probability to decide a pair rightly
    log_odds: Array  #: mean expected log Bayes factors of truth (row) and rival, (h, h)
    apart: Array  #: share of a truth's strengths that differ from a rival, (h, h)

    @property
    def hours(self) -> float:
        """Hours of work: each visit is set up."""
        return len(self.order) * SETUP + sum(self.shifts) * SHIFT


def shift_plan(field: Field, count: int, seed: int = 1, most: int | None = None) -> ShiftPlan:
    """Plan ``count`` shifts in random order, at ``most`` operating points.

    Raises InputError where they are too few for the reference point and one more lot, or too many.
    """
    least = (VISITS + 1) * LOT
    if not least <= count <= 1_000_000:
        rule = f"it must lie between {least} and 1000000: a reference point is visited {VISITS} "
        rule += f"times with {LOT} shifts each, and {LOT} more are the least that say anything else"
        raise InputError(refusal("number of shifts", count, "", rule, "plan more shifts"))
    # Where single shifts scatter least a drift shows first.
    engaging = np.where(field.baseline.engaged[0] > 0.5, field.baseline.sd[0], np.nan)
    reference = int(np.nanargmin(engaging))
    shifts = np.zeros(field.cells)
    shifts[reference] = VISITS * LOT
    lot = max(LOT, -(-(count - VISITS * LOT) // LOTS))
    while left := count - int(shifts.sum()):
        step = lot if left >= 2 * LOT and left - lot >= LOT else left
        full = np.count_nonzero(shifts) >= (most or field.cells)
        more = shifts + step * np.eye(field.cells)[(shifts > 0) | (not full)]
        shifts = more[int(np.argmax([field.worth(one) for one in more]))]
    whole = tuple(int(n) for n in shifts)
    half = [0.5 * one for one in field.distances(shifts)]
    odds = np.array([one.mean(axis=0) for one in half])
    apart = np.array([(one > APART).mean(axis=0) for one in half])
    order = visits(whole, reference, seed)
    return ShiftPlan(field, whole, order, reference, field.worth(shifts), odds, apart)


def visits(shifts: Sequence[int], reference: int, seed: int) -> tuple[tuple[int, int], ...]:
    """Order the visits of a plan: others at random, the reference first, amid and last."""
    others = [(k, n) for k, n in enumerate(shifts) if n and k != reference]
    mixed = [others[k] for k in np.random.default_rng(seed).permutation(len(others))]
    third, more = divmod(shifts[reference], VISITS)
    first, middle, last = ((reference, third + (k < more)) for k in range(VISITS))
    half = len(mixed) // 2
    return (first, *mixed[:half], middle, *mixed[half:], last)
