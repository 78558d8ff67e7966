r"""Influence of each operating point: what would the answer be without it?

The evidence without a cell, :math:`Z_{-k}`, is a sum over the rows of the evidence with other
weights: the likelihood of the other cells, discrepancy included, is in closed form
(``diagnosis.likelihood.left_out``). So :math:`\ln Z - \ln Z_{-k}` is the log predictive density of
the cell given all others, whose sum over the cells is the elpd (Vehtari, Gelman and Gabry 2017),
and its difference of two hypotheses is what the cell adds to their log Bayes factor. Where the
weights of rows become too uneven (:math:`\hat k` above 0.7; of a quadrature, where less than half
of the weight stays in place) the evidence is computed anew without the cell. A cell without which
the answer would be another is confirmed by replicates that are fitted anew
(``diagnosis.inference.refits``), as the answer of all data was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from dogshape.diagnosis.inference.equivalence import Equivalence, equivalence
from dogshape.diagnosis.inference.evidence import ENOUGH, by_quadrature, effective, evidence
from dogshape.diagnosis.inference.pareto_tail import tail_shape
from dogshape.diagnosis.inference.posterior import Probabilities, judged, probabilities
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.inference.ranking import Ranking
from dogshape.diagnosis.inference.refits import checked
from dogshape.diagnosis.inference.verdict import Verdict
from dogshape.diagnosis.likelihood.left_out import totals_without
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.likelihood.time_parts import log_sum
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.diagnosis.terms import Array, Hypothesis

DEEP = 25.0  #: nats below the best row from which rows are left out
NEAR = 20.0  #: nats below the most probable hypothesis from which hypotheses are
UNEVEN = 0.7  #: shape of the tail of weights above which a sum is not trusted
MOVED = 0.5  #: share of a quadrature's weight that has to stay in place
WEIGHTY = 0.03  #: probability from which a hypothesis has enough draws, and is refitted
DOUBTFUL = 3.0  #: times the limit of the p-value, below which it is computed anew
RISEN = 0.1  #: probability without a cell from which a hypothesis without a p-value gets one
WITHIN = 0.4, 0.98  #: probabilities to be within the margin between which it is computed anew
LIKELY = 0.003  #: probability from which a hypothesis counts in that
REPLICATES = 100  #: that confirm another verdict without a cell: if all fit better, p is below 0.01

Settle = Callable[[Probabilities, Mapping[Hypothesis, float], float], Verdict]


@dataclass(frozen=True)
class Without:
    """A hypothesis without the data of each cell, (cells,) each.

    Parameters
    ----------
    elpd : log predictive density of a cell given all others, nat.
    error : its standard error.
    draws : effective number of rows.
    k_hat : shape of the tail of their weights, NaN for a quadrature.
    uneven : where the sum is not to be trusted.
    refitted : where the evidence was computed anew.
    """

    elpd: Array
    error: Array
    draws: Array
    k_hat: Array
    uneven: np.ndarray
    refitted: np.ndarray


@dataclass(frozen=True)
class CellInfluence:
    """Influence of an operating point on the answer.

    Parameters
    ----------
    log_bayes, error : what it adds to the log Bayes factor of the leading hypothesis over the
        rival, given all other cells, and the standard error of that, nat.
    elpd, rival_elpd : log predictive density of its data given all others, by either.
    probability : of the leading hypothesis without it.
    top : most probable hypothesis without it.
    verdict : without it.
    draws, k_hat, refitted : of the leading hypothesis (``Without``); ``k_hat`` may be None.
    """

    log_bayes: float
    error: float
    elpd: float
    rival_elpd: float
    probability: float
    top: Hypothesis
    verdict: Verdict
    draws: float
    k_hat: float | None
    refitted: bool


@dataclass(frozen=True)
class Influence:
    """Influence of all operating points on the answer; None for those without data.

    ``probability`` is that of the leading hypothesis, and ``verdict`` the one, of all data.
    """

    leading: Hypothesis
    rival: Hypothesis
    probability: float
    verdict: Verdict
    cells: tuple[CellInfluence | None, ...]

    @property
    def changing(self) -> tuple[int, ...]:
        """Places of the cells without any one of which the verdict would be another."""
        return tuple(
            place
            for place, one in enumerate(self.cells)
            if one is not None and one.verdict.answer != self.verdict.answer
        )

    @property
    def ordered(self) -> tuple[int, ...]:
        """Places of the cells that have data, the most influential first."""

        def weight(place: int) -> tuple[float, float]:
            one = self.cells[place]
            assert one is not None
            return round(abs(one.probability - self.probability), 2), abs(one.log_bayes)

        there = [place for place, one in enumerate(self.cells) if one is not None]
        return tuple(sorted(there, key=weight, reverse=True))

    def as_dict(self, points: list[tuple[float, float]]) -> dict[str, Any]:
        """Write the record; ``points`` are mismatch in 1/min and force in N of all cells."""
        known = [one for one in self.cells if one is not None]
        elpd, rival = (np.array([getattr(o, n) for o in known]) for n in ("elpd", "rival_elpd"))
        apart = elpd - rival
        many = len(known) > 1
        return {
            "leading": list(self.leading),
            "rival": list(self.rival),
            "elpd": float(elpd.sum()),
            "rival_elpd": float(rival.sum()),
            "elpd_difference": float(apart.sum()),
            "elpd_difference_error": float(np.sqrt(len(known)) * apart.std(ddof=1))
            if many
            else None,
            "verdict_holds": not self.changing,
            "cells": [
                {
                    "mismatch_rpm": points[place][0],
                    "force_N": points[place][1],
                    "log_bayes_factor": one.log_bayes,
                    "log_bayes_factor_error": one.error,
                    "elpd": one.elpd,
                    "rival_elpd": one.rival_elpd,
                    "probability_without": one.probability,
                    "most_probable_without": list(one.top),
                    "verdict_without": one.verdict.kind,
                    "causes_without": list(one.verdict.causes),
                    "effective_draws": one.draws,
                    "k_hat": one.k_hat,
                    "refitted": one.refitted,
                }
                for place, one in enumerate(self.cells)
                if one is not None
            ],
        }


def heavy_rows(one: Scored) -> Scored:
    """Return a hypothesis with those of its rows that can matter."""
    log = one.log_prior + one.rows.whole
    deep = log > log.max() - DEEP
    return replace(one, rows=one.rows.only(deep), log_prior=one.log_prior[deep])


def without_each(one: Scored) -> Without:
    """Compute a hypothesis without the data of each cell by new weights of its rows."""
    one = heavy_rows(one)
    log = one.log_prior + one.rows.whole
    left = one.log_prior[:, None] + totals_without(one.rows)
    whole = log_sum(log, axis=0)
    total = log_sum(left, axis=0)
    with_it, without = np.exp(log - whole)[:, None], np.exp(left - total)
    count = total.size
    draws = 1.0 / (without**2).sum(axis=0)
    if len(log) == 1:
        nothing, no = np.zeros(count), np.zeros(count, dtype=bool)
        return Without(whole - total, nothing, draws, np.full(count, np.nan), no, no)
    if by_quadrature(one.space):
        uneven = np.minimum(with_it, without).sum(axis=0) < MOVED
        error, shapes = np.full(count, one.error), np.full(count, np.nan)
    else:
        shapes = np.array([tail_shape(column) for column in left.T])
        uneven = ~(shapes <= UNEVEN)
        error = np.sqrt(((without - with_it) ** 2).sum(axis=0))
    return Without(whole - total, error, draws, shapes, uneven, np.zeros(count, dtype=bool))


def refitted(problem: Problem, one: Scored, found: Without, those: np.ndarray) -> Without:
    """Compute the evidence of a hypothesis anew without each of those cells, (cells,)."""
    elpd, error, draws = found.elpd.copy(), found.error.copy(), found.draws.copy()
    for place in np.flatnonzero(those):
        others = np.arange(those.size) != place
        again = evidence(problem, one.space, cells=others)
        elpd[place] = one.log_evidence - again.log_evidence
        error[place] = np.hypot(one.error, again.error)
        draws[place] = effective(again.log_prior + again.rows.whole)
    return replace(found, elpd=elpd, error=error, draws=draws, refitted=those)


def influence(
    problem: Problem,
    ranking: Ranking,
    settle: Settle,
    verdict: Verdict,
    same: Equivalence | None,
) -> Influence | None:
    """Compute what each operating point does to the answer; None for a single one.

    ``settle`` decides from probabilities, p-values, and the probability to be within the margin;
    ``verdict`` and ``same`` are those of all data.
    """
    seen = problem.seen
    flown = {place for one in seen.flights for place in one.cells}
    has = [bool(seen.shifts[k] or seen.tried[k] or k in flown) for k in range(seen.cells)]
    if sum(has) < 2:
        return None
    rival = _rival(ranking)
    found = _all_without(problem, ranking, rival)
    free = _unknown_without(problem, ranking)
    rivals = found[rival].elpd if rival != UNKNOWN else free
    whole = _Whole(problem, ranking, settle, verdict, same, found, free)
    cells: list[CellInfluence | None] = []
    mine = found[ranking.leading]
    for place in range(seen.cells):
        if not has[place]:
            cells.append(None)
            continue
        posterior, decided = whole.decided(place)
        errors = [mine.error[place], found[rival].error[place] if rival != UNKNOWN else 0.0]
        cells.append(
            CellInfluence(
                float(mine.elpd[place] - rivals[place]),
                float(np.hypot(*errors)),
                float(mine.elpd[place]),
                float(rivals[place]),
                posterior.get(ranking.leading, 0.0),
                next(iter(posterior)),
                decided,
                float(mine.draws[place]),
                float(mine.k_hat[place]) if np.isfinite(mine.k_hat[place]) else None,
                bool(mine.refitted[place]),
            )
        )
    now = ranking.posterior[ranking.leading]
    return Influence(ranking.leading, rival, now, verdict, tuple(cells))


def _rival(ranking: Ranking) -> Hypothesis:
    """Choose the best other hypothesis of known effects, else none, else unknown."""
    others = [h for h in ranking.folded if h not in (ranking.leading, NONE, UNKNOWN)]
    if others:
        return others[0]
    return UNKNOWN if ranking.leading == NONE else NONE


def _all_without(
    problem: Problem, ranking: Ranking, rival: Hypothesis
) -> dict[Hypothesis, Without]:
    """Leave each cell out of all hypotheses that may matter then."""
    least = max(ranking.raw.values()) * np.exp(-NEAR)
    weighty = {ranking.leading, rival} | {h for h, p in ranking.raw.items() if p > WEIGHTY}
    found = {}
    for hypothesis, one in ranking.scored.items():
        heavy = hypothesis in weighty
        if not heavy and ranking.raw[hypothesis] < least:
            continue
        if heavy and _few(one):
            one = evidence(problem, one.space)  # noqa: PLW2901
        left = without_each(one)
        if heavy and left.uneven.any():
            left = refitted(problem, one, left, left.uneven)
        found[hypothesis] = left
    return found


def _few(one: Scored) -> bool:
    """Test that a hypothesis was left early, or sampled with fewer draws than one that leads."""
    if len(one.log_prior) == 1:
        return False
    early = not np.isfinite(one.error)
    if by_quadrature(one.space):
        return early
    return early or effective(one.log_prior + one.rows.whole) < ENOUGH


def _unknown_without(problem: Problem, ranking: Ranking) -> Array:
    """Compute the log predictive density of each cell by the hypothesis unknown, (cells,)."""
    flights, count = problem.flights, problem.seen.cells
    part = np.ones(count)
    for one in flights:
        part[list(one.cells)] -= 1.0 / len(one.cells) / len(flights)
    places = np.arange(count)
    left = [ranking.free.log_evidence_of(places != k, float(part[k])) for k in places.tolist()]
    return ranking.free.log_evidence - np.array(left)


@dataclass(frozen=True)
class _Whole:
    """Diagnosis of all data, with its hypotheses without the data of each cell."""

    problem: Problem
    ranking: Ranking
    settle: Settle
    verdict: Verdict
    same: Equivalence | None
    found: Mapping[Hypothesis, Without]
    free: Array  #: log predictive density of each cell by the hypothesis unknown
    #: Heavy rows of hypotheses that were asked for, and their log likelihood without each cell.
    heavy: dict[Hypothesis, tuple[Scored, Array]] = field(default_factory=dict, init=False)

    def decided(self, place: int) -> tuple[Probabilities, Verdict]:
        """Decide without a cell: probabilities, the largest first, and the verdict."""
        ranking, problem = self.ranking, self.problem
        logs = dict.fromkeys(ranking.raw, -np.inf)
        for hypothesis, left in self.found.items():
            logs[hypothesis] = ranking.scored[hypothesis].log_evidence - float(left.elpd[place])
        logs[UNKNOWN] = ranking.free.log_evidence - float(self.free[place])
        raw = probabilities(logs, sense=problem.sense, before=problem.settings.priors)
        cells = np.arange(problem.seen.cells) != place
        found = self._judged(raw, cells, p_value)
        if found[1].answer == self.verdict.answer:
            return found
        # Refits see more than the check at the posterior, by which a cell left out looks too good.
        return self._judged(raw, cells, partial(checked, most=REPLICATES))

    def _judged(
        self, raw: Probabilities, cells: np.ndarray, check: Callable[[Problem, Scored], float]
    ) -> tuple[Probabilities, Verdict]:
        """Decide from the evidence without a cell by one of the predictive checks."""
        folded = self.ranking.fold.fold(raw)
        fits = self._fits(folded, cells, check)
        posterior = judged(folded, fits, self.ranking.limits.adequate)
        within = self.same.probability if self.same else 0.0
        if WITHIN[0] < within < WITHIN[1]:
            within = self._within(raw, cells, posterior.get(UNKNOWN, 0.0))
        return posterior, self.settle(posterior, fits, within)

    def _fits(
        self, folded: Probabilities, cells: np.ndarray, check: Callable[[Problem, Scored], float]
    ) -> dict[Hypothesis, float]:
        """Return p-values of the plausible hypotheses, anew for those that may pass the limit."""
        limits, found = self.ranking.limits, {}
        for hypothesis, probability in folded.items():
            fit = self.ranking.fits.get(hypothesis)
            least = RISEN if fit is None else limits.plausible
            if hypothesis == UNKNOWN or probability <= least:
                continue
            if fit is None or fit < DOUBTFUL * limits.adequate:
                fit = check(self.problem.of(cells), self._given(hypothesis, cells))
            found[hypothesis] = fit
        return found

    def _within(self, raw: Probabilities, cells: np.ndarray, unlisted: float) -> float:
        """Compute the probability to be within the margin without a cell."""
        assert self.same is not None
        drawn = {h for h, p in raw.items() if h == NONE or p > LIKELY}
        scored = {h: self._given(h, cells) for h in self.ranking.scored if h in drawn}
        same = equivalence(self.problem.of(cells), scored, raw, unlisted, self.same.margin)
        return same.probability if same else 0.0

    def _given(self, hypothesis: Hypothesis, cells: np.ndarray) -> Scored:
        """Return a hypothesis given the data of all cells but one."""
        if hypothesis not in self.heavy:
            one = heavy_rows(self.ranking.scored[hypothesis])
            self.heavy[hypothesis] = one, totals_without(one.rows)
        one, totals = self.heavy[hypothesis]
        return one.of(cells, totals[:, ~cells][:, 0])
