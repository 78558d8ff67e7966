"""Scores of one hypothesis at many values of its parameters, cell by cell.

Everything that follows (evidence, refits on some of the cells, other priors, what a test would
show) is a weighted sum over these rows, so the emulator is asked once for each value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypotheses import Space
from diagnosis.likelihood import Observed, Rules, Said, log_as_failed, log_likelihood, log_sum
from diagnosis.spread import Array, Emulator, Hypothesis

IMPOSSIBLE = -1e6  #: logarithm of a likelihood that is as good as nothing


@dataclass(frozen=True)
class Predicted:
    """What is said of each cell, each (m, cells); times in s.

    ``bulk`` is the logarithm of the distance of the quartiles, ``error`` that of the mean.
    """

    mean: Array
    sd: Array
    error: Array
    bulk: Array
    engaged: Array
    engaged_error: Array

    def rows(self, which: np.ndarray) -> Predicted:
        """Return some of the values."""
        return Predicted(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Rows:
    """Scores at m values: shares (m, p), log likelihood and what else reads of it (m, cells)."""

    shares: Array
    log_likelihood: Array
    as_failed: Array
    predicted: Predicted

    def joined(self, other: Rows) -> Rows:
        """Return these rows and others below them."""
        names = Predicted.__dataclass_fields__
        mine, theirs = self.predicted, other.predicted
        both = [np.vstack([getattr(mine, n), getattr(theirs, n)]) for n in names]
        return Rows(
            np.vstack([self.shares, other.shares]),
            np.vstack([self.log_likelihood, other.log_likelihood]),
            np.vstack([self.as_failed, other.as_failed]),
            Predicted(*both),
        )

    def only(self, which: np.ndarray) -> Rows:
        """Return some of the rows."""
        return Rows(
            self.shares[which],
            self.log_likelihood[which],
            self.as_failed[which],
            self.predicted.rows(which),
        )


@dataclass(frozen=True)
class Problem:
    """What the bench shows and what says how hypotheses would have it."""

    seen: Observed
    emulator: Emulator
    rules: Rules

    def said(self, hypothesis: Hypothesis, values: Array) -> Said:
        """Return what a hypothesis with values (m, p) says of all cells."""
        cells = range(self.seen.cells)
        return Said.of([self.emulator.at(hypothesis, values, k) for k in cells], self.rules)


def score(problem: Problem, space: Space, shares: Array) -> Rows:
    """Score a hypothesis at shares (m, p) of its priors."""
    values = space.values(shares)
    said = problem.said(space.hypothesis, values)
    table = log_likelihood(problem.seen, said).T.copy()
    table[~space.possible(values)] = IMPOSSIBLE
    return Rows(shares, table, log_as_failed(problem.seen, said).T, predict(said))


def predict(said: Said) -> Predicted:
    """Return what is said of all cells in short."""
    size = said.times.shape[2]
    low, high = (said.times[..., int(share * size)] for share in (0.25, 0.75))
    bulk = np.log(np.maximum(high - low, 1e-3))
    parts = said.mean, said.sd, said.error, bulk, said.engaged, said.engaged_error
    return Predicted(*(part.T for part in parts))


@dataclass(frozen=True)
class Scored:
    """A hypothesis with its evidence.

    Parameters
    ----------
    log_prior : logarithm of the share of the prior that each row stands for, (m,).
    log_evidence, error : logarithm of the evidence, and its standard error.
    ends : likelihood rows at the ends of the prior, for wider ones.
    """

    space: Space
    rows: Rows
    log_prior: Array
    log_evidence: float
    error: float
    ends: Rows | None = None

    @property
    def hypothesis(self) -> Hypothesis:
        """Names of its effects."""
        return self.space.hypothesis

    def weights(self, cells: np.ndarray | None = None) -> Array:
        """Return posterior weights of the rows, (m,), given the data of some cells, or all."""
        log = self.log_prior + self.log_table(cells)
        result: Array = np.exp(log - log_sum(log, axis=0))
        return result

    def log_table(self, cells: np.ndarray | None = None) -> Array:
        """Return the log likelihood of some cells, or all, (m,)."""
        table = self.rows.log_likelihood
        total: Array = (table if cells is None else table[:, cells]).sum(axis=1)
        return total

    def read_as_failed(self) -> Scored:
        """Return the same with the unknown shifts read as failed."""
        table = self.rows.log_likelihood + self.rows.as_failed
        return self.with_table(table)

    def with_table(self, table: Array) -> Scored:
        """Return the same with another log likelihood (m, cells) of its rows."""
        rows = replace(self.rows, log_likelihood=table)
        total = float(log_sum(self.log_prior + table.sum(axis=1), axis=0))
        return replace(self, rows=rows, log_evidence=total)

    def draw(self, count: int, generator: np.random.Generator) -> np.ndarray:
        """Return places of rows, drawn by their posterior weights, (count,)."""
        return generator.choice(len(self.log_prior), size=count, p=self.weights())
