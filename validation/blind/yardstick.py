r"""Yardstick of a case: the noncentrality that the best refit by a rival leaves.

The engine that made a case says without scatter what the truth changes against no effect: of the
mean of each operating point :math:`d`, and of the logarithm of the spread :math:`g` where there are
single shifts. A rival hypothesis *h* changes the same by :math:`\Delta m_h(\theta)` and
:math:`\Delta\ln\sigma_h(\theta)`, which the emulator of the diagnosis says. The noncentrality is

.. math:: \Lambda = \min_h \min_\theta \; r^T C^{-1} r
          + \sum_k \frac{(g_k - \Delta\ln\sigma_{h,k})^2}{v_k + \kappa_k^2},
          \qquad r = d - \Delta m_h(\theta),

within the priors. What engine and emulator differ by without any effect cancels. *C* has all errors
of the diagnosis: sampling of the case's shifts, errors of its nominal force and
mismatch, emulation and 1 % of any simulation, and the discrepancy at the scale of its prior.
Emulation errs by what is larger, the truth's or the rival's error. :math:`v` is the variance of a
sample's logarithm of the spread and :math:`\kappa` the simulation's error of it.

Half of it is the expected logarithm of the likelihood ratio of the truth over that rival. Late
shifts, shares engaged and traces, which may tell more, are left out.

A part of a truth that leaves less than what can be told apart is what the data can show of it
(``seen_as``). Of data without any effect the yardstick is how often one who knows that there is
none could show that the gap is within its margin (``equivalence_power``).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import qmc

from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import (
    Discrepancy,
    Slopes,
    discrepancy_prior,
    posterior_draws,
)
from dogshape.diagnosis.likelihood.time_parts import sample_spread
from dogshape.diagnosis.prediction.hypotheses import NONE, Space, spaces_for
from dogshape.diagnosis.prediction.prediction import Emulator
from dogshape.diagnosis.settings import USUAL, Rules
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.setting import Setting
from dogshape.validation.blind.expected_means import Expected

TRIED = (1, 129, 512, 1024, 1024)  #: values of a hypothesis by its number of parameters
REFINED = 10  #: rivals that are refitted further, those with the least of it
AROUND = 64  #: values of each round of that
WIDTHS = (0.12, 0.05, 0.02, 0.008)  #: of the priors, about the best so far
ENGAGED = 0.5  #: share below which a rival has no times where the truth has
MOST_ERROR = 0.1  #: of the mean time, what an emulated mean errs by at most
SERIES, DRAWN = 200, 200  #: test series that an observer is tried with, and draws for each


@dataclass(frozen=True)
class Seen:
    """Emulator, effects and settings with which a set is diagnosed.

    Parameters
    ----------
    emulator : of the diagnosis.
    effects : of the list, by name.
    settings : of the emulator's cells, in their order.
    rules : of its likelihood.
    """

    emulator: Emulator
    effects: Mapping[str, Effect]
    settings: Sequence[Setting]
    rules: Rules = field(default_factory=Rules)

    def predictions(
        self, hypothesis: Hypothesis, values: Array, places: Sequence[int]
    ) -> CellPredictions:
        """Predict some cells at values (m, p) of a hypothesis."""
        return CellPredictions.of(
            [self.emulator.at(hypothesis, values, k) for k in places], self.rules
        )

    def values(self, given: Mapping[str, Mapping[str, float]]) -> Array:
        """List parameters by effect as the emulator takes them, (1, p)."""
        names = sorted(given)
        return np.array([[given[n][p.name] for n in names for p in self.effects[n].parameters]])


@dataclass(frozen=True)
class Asked:
    """Change by a truth at some operating points, with the errors of its data.

    Parameters
    ----------
    places : of the operating points among the emulator's cells, (k,).
    mean, log_sd : change against no effect, s and 1, (k,); NaN where it is not known.
    covariance : of the means without the emulator's errors, s^2, (k, k).
    spread : variance of the logarithm of a sample's spread, (k,); infinite without single shifts.
    """

    places: Sequence[int]
    mean: Array
    log_sd: Array
    covariance: Array
    spread: Array


@dataclass(frozen=True)
class Changes:
    """Changes by a hypothesis at m values against no effect, (m, cells), with their errors.

    ``error`` is that of a mean and ``common`` the one that operating points share, s; ``shape`` is
    that of the logarithm of the spread. ``there`` marks values that a bench can have and at which
    shifts engage, (m, cells).
    """

    shares: Array
    mean: Array
    log_sd: Array
    error: Array
    common: Array
    shape: Array
    there: np.ndarray


@dataclass(frozen=True)
class Left:
    """Noncentrality that the best rival leaves, and which that is.

    ``refitted`` is what each rival leaves that was refitted further.
    """

    noncentrality: float
    rival: Hypothesis
    refitted: Mapping[Hypothesis, float]


@dataclass
class Yardstick:
    """Changes by hypotheses at the operating points of one clutch; each is asked once."""

    seen: Seen
    _tried: dict[Hypothesis, Changes] = field(default_factory=dict)
    _spaces: dict[Hypothesis, Space] = field(default_factory=dict)

    def __post_init__(self) -> None:
        every = range(len(self.seen.settings))
        self._places = list(every)
        self._plain = self.seen.predictions(NONE, np.zeros((1, 0)), self._places)

    @property
    def baseline(self) -> Array:
        """Mean times without any effect, s, (cells,)."""
        return self._plain.mean[:, 0]

    def left(
        self, asked: Asked, rivals: Iterable[Hypothesis], truth: Changes | None = None
    ) -> Left:
        """Compute what the best of some rivals leaves of a truth's change.

        ``truth`` is what the emulator says of the truth itself (1 value), whose errors count; None
        where no hypothesis has it, and the errors are those without any effect.
        """
        own = truth or self.changes(NONE, np.zeros((1, 0)))
        found = {h: self._least(asked, own, self.tried(h)) for h in rivals}
        best = sorted(found, key=lambda h: found[h][0])[:REFINED]
        whole = {h: self._refined(asked, own, h, found[h][1]) for h in best}
        rival = min(whole, key=lambda h: whole[h])
        return Left(whole[rival], rival, whole)

    def tried(self, hypothesis: Hypothesis) -> Changes:
        """Predict the changes by a hypothesis at values that fill its prior."""
        if hypothesis not in self._tried:
            size = len(self._space(hypothesis).parameters)
            self._tried[hypothesis] = self.changes(hypothesis, filling(size))
        return self._tried[hypothesis]

    def at_truth(self, parameters: Mapping[str, Mapping[str, float]]) -> Changes | None:
        """Predict the changes by a truth of the list; None for one that no hypothesis has."""
        names = tuple(sorted(parameters))
        effects = self.seen.effects
        known = {n: {p.name for p in effect.parameters} for n, effect in effects.items()}
        if any(known.get(n) != set(parameters[n]) for n in names):
            return None
        values = self.seen.values(parameters)
        return self._changes(names, values, np.zeros((1, values.shape[1])))

    def changes(self, hypothesis: Hypothesis, shares: Array) -> Changes:
        """Predict the changes by a hypothesis at shares (m, p) of its priors."""
        return self._changes(hypothesis, self._space(hypothesis).values(shares), shares)

    def _space(self, hypothesis: Hypothesis) -> Space:
        if hypothesis not in self._spaces:
            mine = {name: self.seen.effects[name] for name in hypothesis}
            (space,) = spaces_for([hypothesis], mine, self.seen.settings[0])
            self._spaces[hypothesis] = space
        return self._spaces[hypothesis]

    def _changes(self, hypothesis: Hypothesis, values: Array, shares: Array) -> Changes:
        found = self.seen.predictions(hypothesis, values, self._places)
        plain: CellPredictions = self._plain
        engaged = np.broadcast_to(found.engaged >= ENGAGED, found.mean.shape)
        there = engaged & self._space(hypothesis).possible(values)
        return Changes(
            shares,
            (found.mean - plain.mean).T,
            np.log(found.sd / plain.sd).T,
            np.minimum(found.error, MOST_ERROR * found.mean).T,
            np.broadcast_to(np.nan_to_num(found.common), found.mean.shape).T,
            found.shape.T,
            there.T,
        )

    def _least(self, asked: Asked, own: Changes, tried: Changes) -> tuple[float, Array]:
        """Return the least of the tried values, with the errors of the truth, and its shares."""
        squares = squares_of(asked, own, tried)
        place = int(squares.argmin())
        return float(squares[place]), tried.shares[place]

    def _refined(self, asked: Asked, own: Changes, hypothesis: Hypothesis, start: Array) -> float:
        """Search about the best tried value; the result has the rival's errors as well."""
        best, middle = np.inf, start
        for width in WIDTHS if start.size else (0.0,):
            around = middle + width * (2.0 * _halton(start.size, AROUND) - 1.0)
            shares = np.clip(np.vstack([middle[None], around]), 0.0, 1.0)
            found = self.changes(hypothesis, shares)
            squares = squares_of(asked, own, found)
            place = int(squares.argmin())
            best, middle = float(squares[place]), shares[place]
        if not np.isfinite(best):
            return best
        rival = self.changes(hypothesis, middle[None])
        larger = Changes(
            middle[None], rival.mean, rival.log_sd, np.maximum(own.error, rival.error),
            np.where(abs(rival.common) > abs(own.common), rival.common, own.common),
            np.maximum(own.shape, rival.shape), rival.there,
        )  # fmt: skip
        return min(best, float(squares_of(asked, larger, rival)[0]))


def squares_of(asked: Asked, errors: Changes, rival: Changes) -> Array:
    """Compute what m values of a rival leave, (m,), with emulation errors of one value.

    Infinite for a value by which nothing engages where shifts do.
    """
    places = list(asked.places)
    common = errors.common[0, places]
    covariance = asked.covariance + np.diag(errors.error[0, places] ** 2) + np.outer(common, common)
    known = np.isfinite(asked.mean) & np.isfinite(np.diag(covariance))
    gaps = (asked.mean - rival.mean[:, places])[:, known]
    out = ~rival.there[:, places][:, known].all(axis=1) | ~np.isfinite(gaps).all(axis=1)
    gaps = np.nan_to_num(gaps)
    squares = np.zeros(len(gaps))
    if known.any():
        root = cho_factor(covariance[np.ix_(known, known)], lower=True)
        squares += (gaps * cho_solve(root, gaps.T).T).sum(axis=1)
    apart = asked.log_sd - rival.log_sd[:, places]
    variance = asked.spread + errors.shape[0, places] ** 2
    counted = np.isfinite(apart) & np.isfinite(variance)
    squares += np.where(counted, np.nan_to_num(apart) ** 2 / variance, 0.0).sum(axis=1)
    return np.where(out, np.inf, squares)


def filling(size: int) -> Array:
    """Return shares that fill a prior of ``size`` parameters evenly, (m, size)."""
    if size == 0:
        return np.zeros((1, 0))
    count = TRIED[min(size, len(TRIED) - 1)]
    return np.linspace(0.0, 1.0, count)[:, None] if size == 1 else _halton(size, count)


def _halton(size: int, count: int) -> Array:
    found: Array = qmc.Halton(size, scramble=False).random(count)
    return found


def rivals_of(kind: str, causes: Sequence[str], effects: Iterable[str]) -> list[Hypothesis]:
    """List the rivals of a truth: none and each other single effect, and what of pairs can be it.

    Of two and more causes pairs with one of them at least are rivals, of what is outside the list
    all pairs.
    """
    names, mine = sorted(effects), tuple(sorted(causes))
    singles: list[Hypothesis] = [NONE, *((n,) for n in names if (n,) != mine)]
    pairs = list(itertools.combinations([n for n in names if n != REVERSED], 2))
    if kind == "outside":
        return [*singles, *pairs]
    if len(mine) < 2:
        return singles
    return [*singles, *(p for p in pairs if p != mine and set(p) & set(mine))]


@dataclass(frozen=True)
class Series:
    """Test series of a case: its operating points and shifts, and how far nominal values are off.

    Parameters
    ----------
    places : of the operating points among the emulator's cells, (k,).
    counts : shifts with a time, (k,).
    single : whether each shift has its own time.
    nominal : variance of a mean by the errors of its nominal force and mismatch, s^2, (k,).
    """

    places: Sequence[int]
    counts: Array
    single: bool
    nominal: Array


def asked_of(stick: Yardstick, series: Series, truth: Expected, plain: Expected) -> Asked:
    """Compute the change by a truth, by its engine, with the errors of the data but emulation."""
    places = list(series.places)
    prior = _discrepancy(stick, places)
    with np.errstate(divide="ignore", invalid="ignore"):
        own = truth.sd**2 / series.counts + series.nominal
        log_sd = np.log(truth.sd / plain.sd)
    own = np.where(np.isfinite(own) & (series.counts > 0), own, np.inf)
    freedom = np.where(series.counts > 1, series.counts - 1.0, 0.0) * series.single
    spread = np.where(freedom > 0, sample_spread(freedom)[1], np.inf)
    known = np.isfinite(own)
    covariance = prior.covariance + np.diag(np.where(known, own, 0.0))
    mean = np.where(known, truth.mean - plain.mean, np.nan)
    return Asked(places, mean, np.where(known, log_sd, np.nan), covariance, spread)


def seen_as(
    stick: Yardstick,
    asked: Asked,
    causes: Sequence[str],
    truth: Changes | None = None,
    *,
    visible: float = USUAL.decision.visible,
    known: Mapping[Hypothesis, float] | None = None,
) -> list[Hypothesis]:
    """List what the data can show of a truth: the fewest of its causes that leave nothing visible.

    A part of the causes is all that can be seen where its best refit leaves less than ``visible``,
    the limit of the diagnosis from which two predictions can be told apart. Several of one size
    may do. Parts are of causes that the diagnosis knows. ``known`` is what some of them leave of
    the same data and truth (``Left.refitted``), which are not refitted again.
    """
    left = dict(known or {})
    mine = tuple(sorted(causes))
    listed = [name for name in mine if name in stick.seen.effects]
    for size in range(len(mine)):
        parts = [tuple(part) for part in itertools.combinations(listed, size)]
        new = [part for part in parts if part not in left]
        left |= {part: stick.left(asked, [part], truth).noncentrality for part in new}
        found = [part for part in parts if left[part] < visible]
        if found:
            return found
    return [mine]


def power_of(stick: Yardstick, series: Series, plain: Expected, margin: Array) -> float:
    """Compute how often data without any effect can show that the gap is within its margin.

    ``plain`` is what the engine of the case expects; ``margin`` is in s, (k,).
    """
    places, rules = list(series.places), stick.seen.rules
    simulated = stick.baseline[places]
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.sqrt(plain.sd**2 / series.counts + series.nominal)
    known = np.isfinite(error) & np.isfinite(plain.mean)
    model = np.hypot(rules.model_error * simulated, rules.least_error)
    prior = _discrepancy(stick, places).of(np.flatnonzero(known))
    gaps = plain.mean - simulated
    return equivalence_power(gaps[known], error[known], model[known], prior, margin[known])


def _discrepancy(stick: Yardstick, places: Sequence[int]) -> Discrepancy:
    """Build the prior of the discrepancy at some operating points."""
    points = [stick.seen.settings[k].point for k in places]
    return discrepancy_prior(
        np.array([point.mismatch for point in points]),
        np.array([point.profile.force for point in points]),
        stick.baseline[list(places)],
        stick.seen.rules,
    )


def equivalence_power(
    gaps: Array, errors: Array, model: Array, prior: Discrepancy, margin: Array
) -> float:
    """Compute how often an observer who knows that no effect acts shows a gap within its margin.

    Parameters
    ----------
    gaps, errors : true gap of each operating point, and the standard error of its mean, s, (k,).
    model : error of any simulation, with which the observer reckons as well, s, (k,).
    prior : of the gap, which is what the simulation is off by.
    margin : s, (k,).

    The gap is within its margin where its root mean square over the points is below one; that is
    shown where its probability after the data is that from which the diagnosis says *none*.
    """
    generator = np.random.default_rng(1)
    read = gaps + errors * generator.standard_normal((SERIES, gaps.size))
    bent = np.broadcast_to(1.0 / (errors**2 + model**2), read.shape)
    slopes, nothing = Slopes(read * bent, bent), np.zeros(read.shape)
    within = np.zeros(SERIES)
    for _ in range(DRAWN):
        drawn, _ = posterior_draws(slopes, prior, nothing, generator)
        within += ((drawn / margin) ** 2).mean(axis=1) < 1.0
    return float((within / DRAWN >= USUAL.decision.named).mean())
