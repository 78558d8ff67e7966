r"""Plan of shifts before any is made: where, how many, in which order, what they tell apart.

A value *a* of a hypothesis is predicted at every operating point: mean time, logarithm of the
spread of single shifts, share that engages. With the errors that *n* shifts at each point leave,
the squared distance (noncentrality) of two values is

.. math:: D = \delta^T (V + A A^T)^{-1} \delta + \sum \delta_s^2 / v_s + \sum \delta_p^2 / v_p,

:math:`\delta` the differences of the means, *V* their variances (scatter over *n*, emulator, 1 % of
any simulation) and *A* the error that operating points have in common
(``diagnosis.likelihood.discrepancy``). A rival imitates a truth by its best value, so *D* is the
least over these, less what errors of emulation alone make. *D*/2 is about the expected log Bayes
factor, and :math:`\Phi(\sqrt D / 2)` the probability that the likelihood ratio of just these two
points to the truth. Its mean over all ordered pairs of hypotheses and all strengths that the
priors hold possible is the worth of a plan. Shifts are given in lots, each to the operating point
that adds most; no time that was measured is looked at.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr
from scipy.stats import qmc

from dogshape.diagnosis.inference.classes import APART
from dogshape.diagnosis.inference.next_test import SETUP, SHIFT
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Problem
from dogshape.diagnosis.likelihood.signature import squared
from dogshape.diagnosis.likelihood.time_parts import sample_spread
from dogshape.diagnosis.prediction.hypotheses import NONE, Space, spaces_for
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError, refusal
from dogshape.sim.setting import Setting

LOT = 5  #: shifts that are given at once, at least
LOTS = 20  #: lots of a plan, at most
VISITS = 3  #: to the reference point: at the beginning, in the middle, at the end
TRUTHS = 24  #: strengths of each effect that may be true
RIVALS = 64, 16  #: values of an effect with one parameter, and along each axis of one with two


@dataclass(frozen=True)
class Values:
    """Values of all hypotheses at the operating points, and where each hypothesis begins.

    ``mean``, ``log_sd``, ``engaged`` are (m, cells), ``own`` the variance that the emulation alone
    gives each mean, (m, cells).
    """

    mean: Array
    log_sd: Array
    engaged: Array
    own: Array
    starts: np.ndarray


@dataclass(frozen=True)
class Field:
    """Predictions of all hypotheses at some operating points.

    Parameters
    ----------
    hypotheses : none, then each effect.
    truths, rivals : values that may be true, and values that imitate them.
    baseline : without any effect, (1, cells).
    common : errors that operating points have in common, s, (cells, r).
    """

    hypotheses: tuple[Hypothesis, ...]
    truths: Values
    rivals: Values
    baseline: PredictionSummary
    common: Array

    @property
    def cells(self) -> int:
        """Number of operating points."""
        return len(self.common)

    def distances(self, shifts: Array) -> Array:
        """Compute squared distances of truths from hypotheses, (truths, hypotheses).

        ``shifts`` is the number at each operating point, (cells,), which need not be whole.
        """
        used = np.flatnonzero(shifts > 0)
        if not used.size:
            return np.zeros((len(self.truths.mean), len(self.hypotheses)))
        root, precision = self._whitening(shifts, used)
        places = [self._placed(one, shifts, used, root) for one in (self.truths, self.rivals)]
        noise = [one.own[:, used] @ precision for one in (self.truths, self.rivals)]
        whole = squared(*places)
        ends = [*self.rivals.starts[1:], whole.shape[1]]
        found = np.empty((len(whole), len(ends)))
        rows = np.arange(len(whole))
        for k, (start, end) in enumerate(zip(self.rivals.starts, ends, strict=True)):
            # Chosen with the noise in: values of large error would else be the nearest to anything.
            near = start + whole[:, start:end].argmin(axis=1)
            found[:, k] = whole[rows, near] - noise[0] - noise[1][near]
        return np.maximum(0.0, found)

    def worth(self, shifts: Array) -> float:
        """Compute the mean probability that a pair is decided rightly; half where nothing is."""
        right = ndtr(0.5 * np.sqrt(self.distances(shifts)))
        return float(self._means(right)[~np.eye(len(self.hypotheses), dtype=bool)].mean())

    def log_odds(self, shifts: Array) -> Array:
        """Compute mean expected log Bayes factors of truth (row) and rival, (h, h)."""
        return self._means(0.5 * self.distances(shifts))

    def told_apart(self, shifts: Array) -> Array:
        """Compute the share of a truth's strengths at which it is told from a rival, (h, h)."""
        return self._means((0.5 * self.distances(shifts) > APART).astype(float))

    def _means(self, table: Array) -> Array:
        """Return means (h, h) over the strengths of each truth, all held as probable."""
        counts = np.diff([*self.truths.starts, len(table)])
        sums: Array = np.add.reduceat(table, self.truths.starts, axis=0)
        return sums / counts[:, None]

    def _whitening(self, shifts: Array, used: np.ndarray) -> tuple[Array, Array]:
        """Return the matrix that whitens means, and the precision of each."""
        base = self.baseline
        variance = base.core_sd[0, used] ** 2 / shifts[used] + base.error[0, used] ** 2
        whole = np.diag(variance) + self.common[np.ix_(used, used)]
        root = np.linalg.inv(np.linalg.cholesky(whole))
        return root, (root**2).sum(axis=0)

    def _placed(self, values: Values, shifts: Array, used: np.ndarray, root: Array) -> Array:
        """Return values as points whose squared distance is that of their predictions."""
        n, base = shifts[used], self.baseline
        share = np.clip(base.engaged[0, used], 0.02, 0.98)
        engaged = np.sqrt(share * (1.0 - share) / n + base.engaged_error[0, used] ** 2)
        parts = [values.mean[:, used] @ root.T, values.engaged[:, used] / engaged]
        freedom = np.maximum(0.0, n - 1.0)
        several = freedom >= 1.0
        spread = np.sqrt(sample_spread(freedom)[1] + base.shape[0, used] ** 2)
        parts.append(values.log_sd[:, used][:, several] / spread[several])
        return np.hstack(parts)


def field_of(problem: Problem, effects: Mapping[str, Effect], setting: Setting) -> Field:
    """Predict what each effect of its own does at the operating points of a problem."""
    spaces = spaces_for([NONE, *((name,) for name in sorted(effects))], effects, setting)
    baseline = problem.summary(NONE, np.zeros((1, 0)))
    truths = [_some(problem, space, _drawn(space)) for space in spaces]
    rivals = [_some(problem, space, _grid(space)) for space in spaces]
    return Field(
        tuple(space.hypothesis for space in spaces),
        _joined(truths, baseline),
        _joined(rivals, baseline),
        baseline,
        problem.discrepancy.covariance,
    )


def _drawn(space: Space) -> Array:
    """Return shares of the prior that may be true, evenly over it."""
    size = len(space.parameters)
    if size < 2:
        return ((np.arange(TRUTHS) + 0.5) / TRUTHS)[:, None] if size else np.zeros((1, 0))
    return np.asarray(qmc.Sobol(size, seed=1).random(32))


def _grid(space: Space) -> Array:
    """Return shares of the prior at which a hypothesis may imitate another one."""
    size = len(space.parameters)
    if size == 0:
        return np.zeros((1, 0))
    ticks = np.linspace(0.0, 1.0, RIVALS[min(size, 2) - 1])
    return np.stack(np.meshgrid(*[ticks] * size, indexing="ij"), axis=-1).reshape(-1, size)


def _some(problem: Problem, space: Space, shares: Array) -> PredictionSummary:
    """Predict the values at some shares of which there is a bench."""
    values = space.values(shares)
    return problem.summary(space.hypothesis, values[space.possible(values)])


def _joined(parts: Sequence[PredictionSummary], baseline: PredictionSummary) -> Values:
    counts = [len(part.core) for part in parts]
    core = np.concatenate([part.core for part in parts])
    error = np.concatenate([part.error**2 - part.model**2 for part in parts])
    own = error - (baseline.error**2 - baseline.model**2)
    return Values(
        # Where nothing engages the share says so, and there is no mean to compare.
        np.where(np.isfinite(core), core, baseline.core),
        np.nan_to_num(np.concatenate([part.log_sd for part in parts])),
        np.concatenate([part.engaged for part in parts]),
        np.nan_to_num(np.maximum(0.0, own)),
        np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(int),
    )


@dataclass(frozen=True)
class ShiftPlan:
    """Plan of shifts with what it can tell apart.

    Parameters
    ----------
    shifts : at each operating point, (cells,), whole numbers.
    order : visits, each an operating point's place and its number of shifts.
    reference : place of the point that is visited at the beginning, in the middle and at the end.
    worth, evenly : mean probability that a pair is decided rightly, by the plan and by as many
        shifts spread evenly over all operating points.
    log_odds, apart, apart_evenly : of truth and rival, (h, h) each.
    """

    field: Field
    shifts: tuple[int, ...]
    order: tuple[tuple[int, int], ...]
    reference: int
    worth: float
    evenly: float
    log_odds: Array
    apart: Array
    apart_evenly: Array

    @property
    def hours(self) -> float:
        """Hours of work, as the next test counts them: each visit is set up."""
        return len(self.order) * SETUP + sum(self.shifts) * SHIFT

    @property
    def hours_evenly(self) -> float:
        """The same for all operating points, the reference thrice too."""
        return (self.field.cells + VISITS - 1) * SETUP + sum(self.shifts) * SHIFT


def shift_plan(field: Field, count: int, seed: int = 1, most: int | None = None) -> ShiftPlan:
    """Plan some shifts.

    Parameters
    ----------
    count : shifts in all.
    seed : of the order.
    most : operating points that are used, at most; None for any number.

    Raises
    ------
    InputError
        There are too few shifts for the reference point's three visits and one more lot, or fewer
        than one operating point.
    """
    least = (VISITS + 1) * LOT
    if not least <= count <= 1_000_000:
        rule = f"it must lie between {least} and 1000000: a reference point is visited {VISITS} "
        rule += f"times with {LOT} shifts each, and {LOT} more are the least that say anything else"
        raise InputError(refusal("number of shifts", count, "", rule, "plan more shifts"))
    reference = steadiest(field)
    shifts = _greedy(field, count, reference, most or field.cells)
    even = np.full(field.cells, count / field.cells)
    return ShiftPlan(
        field,
        tuple(int(n) for n in shifts),
        visits(shifts.astype(int).tolist(), reference, seed),
        reference,
        field.worth(shifts),
        field.worth(even),
        field.log_odds(shifts),
        field.told_apart(shifts),
        field.told_apart(even),
    )


def steadiest(field: Field) -> int:
    """Return the operating point whose single shifts scatter least: drift shows there first."""
    scatter = field.baseline.core_sd[0]
    return int(np.nanargmin(np.where(field.baseline.engaged[0] > 0.5, scatter, np.nan)))


def _greedy(field: Field, count: int, reference: int, most: int) -> Array:
    """Give shifts, lot by lot, to the operating point that adds most to the worth."""
    shifts = np.zeros(field.cells)
    shifts[reference] = VISITS * LOT
    lot = max(LOT, -(-(count - VISITS * LOT) // LOTS))
    left = count - VISITS * LOT
    while left > 0:
        step = lot if left >= 2 * LOT and left - lot >= LOT else left
        full = np.count_nonzero(shifts) >= most
        open_to = [k for k in range(field.cells) if shifts[k] > 0 or not full]
        worths = []
        for place in open_to:
            more = shifts.copy()
            more[place] += step
            worths.append(field.worth(more))
        shifts[open_to[int(np.argmax(worths))]] += step
        left -= step
    return shifts


def visits(shifts: Sequence[int], reference: int, seed: int) -> tuple[tuple[int, int], ...]:
    """Return the visits of a plan: others in random order, the reference before, amid, behind."""
    others = [(k, n) for k, n in enumerate(shifts) if n and k != reference]
    order = np.random.default_rng(seed).permutation(len(others))
    mixed = [others[k] for k in order]
    third, more = divmod(shifts[reference], VISITS)
    first, middle, last = ((reference, third + (k < more)) for k in range(VISITS))
    half = len(mixed) // 2
    return (first, *mixed[:half], middle, *mixed[half:], last)
