r"""Calibrated check of a hypothesis: its evidence against that of replicates, each fitted anew.

A p-value whose parameters were fitted to the same data is conservative, and so is one whose
discrepancy was. So data are drawn from the hypothesis at values of its posterior, with a
discrepancy of the prior, in the form of the data set (``diagnosis.likelihood.replicates``), and
the evidence of each is worked out anew,

.. math:: Z(y) = \sum_i w_i L(y \mid \theta_i), \qquad p = P(Z(y^{rep}) \le Z(y)),

from few values whose predictions are known: a refit by reweighting. That is a parametric bootstrap
with the marginal likelihood as its statistic (Box 1980). For a hypothesis without parameters it is
exact. Means, spreads, late shifts and shares engaged are all in it, as in the likelihood.

Replicates are drawn until ``ENOUGH`` of them have no more evidence than the data, or all are drawn:
the first number over the second is a valid p-value (Besag and Clifford 1991).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.nominal_errors import NominalErrors
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.likelihood.cell_likelihood import log_engaged
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.likely_offsets import timed_together
from dogshape.diagnosis.likelihood.observations import Observed, observe
from dogshape.diagnosis.likelihood.replicates import offsets_of, replicate
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.likelihood.time_parts import log_sum
from dogshape.diagnosis.terms import Array

VALUES = 80  #: values of a hypothesis that replicates are fitted by, at most
FLAT = 0.5  #: power of the posterior from which these are drawn: it has to hold refits as well
MOST = 400  #: replicates of a hypothesis
ENOUGH = 6  #: of them with no more evidence than the data


@dataclass(frozen=True)
class Refits:
    """A hypothesis at some values, ready to be fitted to any data of the same cells.

    Parameters
    ----------
    predicted : of the cells, at m values.
    log_prior : share of the prior that each value stands for, (m,).
    drawn : posterior probability of each value, (m,).
    """

    problem: Problem
    predicted: CellPredictions
    log_prior: Array
    drawn: Array

    @classmethod
    def of(cls, problem: Problem, one: Scored, generator: np.random.Generator) -> Refits:
        """Choose the values of a hypothesis."""
        log = one.log_prior + one.rows.whole
        flat = np.exp(FLAT * (log - log.max()))
        chance = flat / flat.sum()
        picks = generator.choice(len(log), VALUES, p=chance)
        rows, counts = np.unique(picks, return_counts=True)
        stands = np.log(counts / (VALUES * chance[rows]))
        posterior = np.exp(log[rows] + stands - log.max())
        values = one.space.values(one.rows.shares[rows])
        predicted = problem.predictions(one.hypothesis, values)
        return cls(problem, predicted, one.log_prior[rows] + stands, posterior / posterior.sum())

    def log_evidence(self, seen: Observed) -> float:
        """Compute the logarithm of the evidence of some data, flights left out."""
        times, together = timed_together(seen, self.predicted, self.problem.discrepancy)
        table = (times.log + log_engaged(seen, self.predicted, seen.failed)).T
        return float(log_sum(self.log_prior + table.sum(axis=1) + together, axis=0))

    def replicate(self, bench: Bench, generator: np.random.Generator) -> Observed:
        """Draw data in the form of a data set's, flights left out."""
        place = int(generator.choice(len(self.drawn), p=self.drawn))
        said = self.predicted.at_value(place)
        offsets = offsets_of(said, self.problem.discrepancy, generator)
        cells = replicate(said, bench.cells, offsets, generator)
        # What nominal values err in is part of the prediction already.
        drawn = replace(bench, cells=cells, errors=NominalErrors())
        return observe(drawn, self.problem.settings.likelihood)


def checked(problem: Problem, one: Scored, most: int = MOST) -> float:
    """Compute the predictive p-value of a hypothesis: the smaller of two.

    That at values of the posterior (``diagnosis.inference.predictive_check``) sees spreads that are
    too narrow. That of refits has more power: an error that no smooth curve has may pass the
    first by a large amplitude of the discrepancy, which it takes from the same data.
    """
    return min(p_value(problem, one), calibrated_p(problem, one, most=most))


def calibrated_p(problem: Problem, one: Scored, seed: int = 1, most: int = MOST) -> float:
    """Compute the p-value of a hypothesis by replicates that are fitted anew, ``most`` at most.

    1 where the problem has no data set that they could be like.
    """
    if problem.bench is None:
        return 1.0
    generator = np.random.default_rng(seed)
    refits = Refits.of(problem, one, generator)
    own, less = refits.log_evidence(problem.seen), 0
    for count in range(1, most + 1):
        less += refits.log_evidence(refits.replicate(problem.bench, generator)) <= own
        if less == ENOUGH:
            return less / count
    return (less + 1) / (most + 1)
