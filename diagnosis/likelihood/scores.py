"""Scores of one hypothesis at many values of its parameters, cell by cell.

Evidence, refits on some cells, other priors and outcomes of tests are weighted sums over these
rows, so the emulator is asked once for each value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Self

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.flight_marks import SeenFlight
from dogshape.diagnosis.bench.sense import Sense
from dogshape.diagnosis.likelihood.cell_likelihood import log_as_failed, log_engaged
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import (
    Discrepancy,
    Slopes,
    discrepancy_prior,
    marginals,
)
from dogshape.diagnosis.likelihood.flight_likelihood import (
    FlightPrediction,
    flight_prediction,
    log_flights,
    to_cells,
)
from dogshape.diagnosis.likelihood.likely_offsets import timed_together
from dogshape.diagnosis.likelihood.observations import Observed
from dogshape.diagnosis.likelihood.time_parts import log_sum
from dogshape.diagnosis.prediction.hypotheses import NONE, Space
from dogshape.diagnosis.prediction.prediction import Emulator, FlightEmulator, Marks
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import Array, Hypothesis, Table

IMPOSSIBLE = -1e6  #: logarithm of a likelihood that is as good as nothing


@dataclass(frozen=True)
class PredictionSummary(Table):
    """Moments of the predicted times of each cell, each (m, cells); times in s.

    ``mean`` and ``sd`` are of all shifts that engage, ``core`` and ``core_sd`` leave outliers out.
    ``log_sd`` is the logarithm of ``core_sd`` and ``shape`` its error, ``error`` the standard error
    of the mean, of which ``model`` is that of any simulation.
    ``flight`` are the marks of all force profiles, (m, K), None without traces.
    """

    mean: Array
    sd: Array
    error: Array
    log_sd: Array
    engaged: Array
    engaged_error: Array
    core: Array
    core_sd: Array
    model: Array
    shape: Array
    flight: Array | None = None

    def of(self, cells: np.ndarray) -> Self:
        """Select some cells; the marks of flights stay."""
        names = [f.name for f in fields(self) if f.name != "flight"]
        return replace(self, **{name: getattr(self, name)[:, cells] for name in names})


@dataclass(frozen=True)
class Rows(Table):
    """Scores at m values: shares (m, p), log likelihood and what else reads of it (m, cells).

    ``slopes`` are those of the log likelihood over offsets of cells; ``discrepancy`` is what cells
    err in common for any value, and ``joint`` an error of each value, s, (m, cells).
    """

    SHARED = ("discrepancy",)

    shares: Array
    log_likelihood: Array
    as_failed: Array
    predicted: PredictionSummary
    slopes: Slopes
    discrepancy: Discrepancy
    joint: Array

    @cached_property
    def whole(self) -> Array:
        """Log likelihood of all cells together, (m,)."""
        added: Array = self.log_likelihood.sum(axis=1)
        if self.discrepancy.absent_beside(self.joint):
            return added
        return added + marginals(self.slopes, self.discrepancy, self.joint).log

    def with_table(self, table: Array) -> Self:
        """Return the same with another log likelihood (m, cells); errors in common stay."""
        changed = replace(self, log_likelihood=table)
        # The integral over these errors is most of the work, and reads no log likelihood.
        return changed.summing(self.whole + (table.sum(axis=1) - self.log_likelihood.sum(axis=1)))

    def total(self, cells: np.ndarray) -> Array:
        """Return the log likelihood of some cells together, (m,)."""
        return self.of(cells).whole

    def of(self, cells: np.ndarray) -> Self:
        """Select some cells."""
        return replace(
            self,
            log_likelihood=self.log_likelihood[:, cells],
            as_failed=self.as_failed[:, cells],
            predicted=self.predicted.of(cells),
            slopes=self.slopes.of(cells),
            discrepancy=self.discrepancy.of(cells),
            joint=self.joint[:, cells],
        )

    def joined(self, other: Self) -> Self:
        """Append other rows."""
        # Each row's sum is its own, and costs more than the rest of joining.
        return super().joined(other).summing(np.concatenate([self.whole, other.whole]))

    def only(self, which: np.ndarray) -> Self:
        """Select some of the rows."""
        return super().only(which).summing(self.whole[which])

    def summing(self, whole: Array) -> Self:
        """Return the same rows, whose log likelihoods of all cells together are known, (m,)."""
        vars(self)["whole"] = whole
        return self


@dataclass(frozen=True)
class Problem:
    """Inference problem: observations, and the emulator that predicts them per hypothesis.

    ``sense`` says whether the sign of the mismatch is known; ``bench`` is the data set that was
    observed, which replicates are like, None without them. ``places`` are the cells' numbers in
    the emulator where only some of them are seen.
    """

    seen: Observed
    emulator: Emulator
    settings: Settings
    sense: Sense = "known"
    bench: Bench | None = None
    places: tuple[int, ...] | None = None

    @cached_property
    def discrepancy(self) -> Discrepancy:
        """Prior of the model's discrepancy at the cells, with what else they err in together."""
        means = self.predictions(NONE, np.zeros((1, 0))).mean[:, 0]
        seen = self.seen
        told = seen.shifts > 0
        prior = discrepancy_prior(seen.mismatch, seen.force, means, self.settings.likelihood, told)
        beside = [] if seen.drift is None else [seen.drift.direction[:, None]]
        if seen.inputs is not None:
            beside.append(np.nan_to_num(seen.inputs.systematic(self.baseline)))
        return replace(prior, beside=np.hstack(beside)) if beside else prior

    @cached_property
    def baseline(self) -> Array:
        """Mean times without any effect, s, (cells,); NaN where nothing engages."""
        nothing = np.zeros((1, 0))
        times = [self.emulator.at(NONE, nothing, k).times for k in range(self.seen.cells)]
        return np.array([one.mean() for one in times])

    @cached_property
    def _setting(self) -> Array:
        """Error of each mean by those of its nominal values, s, (cells,)."""
        inputs = self.seen.inputs
        if inputs is None:
            return np.zeros(self.seen.cells)
        return np.nan_to_num(inputs.each_point(self.baseline))

    def predictions(self, hypothesis: Hypothesis, values: Array) -> CellPredictions:
        """Predict the times of all cells for values (m, p) of a hypothesis."""
        cells = range(self.seen.cells) if self.places is None else self.places
        return CellPredictions.of(
            [self.emulator.at(hypothesis, values, k) for k in cells],
            self.settings.likelihood,
            self._setting,
        )

    def of(self, cells: np.ndarray) -> Self:
        """Select some cells, (cells,) true or false; the marks of flights stay.

        The discrepancy at these is the same as among all cells, and the errors of nominal values.
        """
        places = tuple(np.flatnonzero(cells).tolist())
        mine = places if self.places is None else tuple(self.places[k] for k in places)
        bench = self.bench
        if bench is not None:
            bench = replace(bench, cells=tuple(bench.cells[k] for k in places))
        found = replace(self, seen=self.seen.of(cells), places=mine, bench=bench)
        vars(found)["discrepancy"] = self.discrepancy.of(cells)
        vars(found)["_setting"] = self._setting[cells]
        return found

    @cached_property
    def flights(self) -> tuple[SeenFlight, ...]:
        """Marks of traces, none where the emulator knows no flight."""
        return self.seen.flights if isinstance(self.emulator, FlightEmulator) else ()

    def flown(self, hypothesis: Hypothesis, values: Array) -> list[FlightPrediction]:
        """Predict the marks of each profile for values (m, p) of a hypothesis."""
        return [
            flight_prediction(seen, self._marks(hypothesis, values, seen), plain)
            for seen, plain in zip(self.flights, self._plain, strict=True)
        ]

    @cached_property
    def _plain(self) -> list[Marks]:
        return [self._marks(NONE, np.zeros((1, 0)), seen) for seen in self.flights]

    def _marks(self, hypothesis: Hypothesis, values: Array, seen: SeenFlight) -> Marks:
        assert isinstance(self.emulator, FlightEmulator)
        return self.emulator.flight(hypothesis, values, seen.profile)

    def summary(self, hypothesis: Hypothesis, values: Array) -> PredictionSummary:
        """Predict the moments of all cells for values (m, p) of a hypothesis."""
        return summary_of(self.predictions(hypothesis, values), self.flown(hypothesis, values))


def score(problem: Problem, space: Space, shares: Array) -> Rows:
    """Score a hypothesis at shares (m, p) of its priors."""
    values = space.values(shares)
    predicted = problem.predictions(space.hypothesis, values)
    flown = problem.flown(space.hypothesis, values)
    times, together = timed_together(problem.seen, predicted, problem.discrepancy)
    engaged = log_engaged(problem.seen, predicted, problem.seen.failed)
    table = (times.log + engaged).T.copy()
    if flown:
        freedom = problem.settings.likelihood.flight_freedom
        logs = log_flights(problem.flights, flown, freedom)
        table += to_cells(problem.flights, logs, problem.seen.cells)
    table[~space.possible(values)] = IMPOSSIBLE
    as_failed = log_as_failed(problem.seen, predicted, engaged).T
    errors = times.slopes, problem.discrepancy, np.nan_to_num(predicted.common.T)
    rows = Rows(shares, table, as_failed, summary_of(predicted, flown), *errors)
    return rows.summing(table.sum(axis=1) + together)


def summary_of(
    predicted: CellPredictions, flown: Sequence[FlightPrediction] = ()
) -> PredictionSummary:
    """Summarise predictions of all cells and of the marks of flights."""
    flight = np.hstack([one.times for one in flown]) if flown else None
    mean, sd = predicted.whole
    whole = mean.T, sd.T, predicted.error.T, np.log(predicted.sd).T
    core = predicted.mean.T, predicted.sd.T, predicted.model.T, predicted.shape.T
    return PredictionSummary(*whole, predicted.engaged.T, predicted.engaged_error.T, *core, flight)


@dataclass(frozen=True)
class Scored:
    """Hypothesis with its evidence.

    Parameters
    ----------
    log_prior : logarithm of the share of the prior that each row stands for, (m,).
    log_evidence, error : logarithm of the evidence, and its standard error.
    ends : computes the log likelihood at the ends of the prior, (k,), which only wider ones ask.
    """

    space: Space
    rows: Rows
    log_prior: Array
    log_evidence: float
    error: float
    ends: Callable[[], Array] | None = None

    @property
    def hypothesis(self) -> Hypothesis:
        """Names of its effects."""
        return self.space.hypothesis

    def weights(self, cells: np.ndarray | None = None) -> Array:
        """Return posterior weights of the rows, (m,), given the data of some cells, or all."""
        log = self.log_prior + self.log_table(cells)
        return np.exp(log - log_sum(log, axis=0))

    def log_table(self, cells: np.ndarray | None = None) -> Array:
        """Return the log likelihood of some cells, or all, (m,)."""
        return self.rows.whole if cells is None else self.rows.total(cells)

    def of(self, cells: np.ndarray, whole: Array | None = None) -> Scored:
        """Return the same given the data of some cells, whose evidence is summed anew.

        ``whole`` is their log likelihood together, (m,), where it is known.
        """
        rows = self.rows.of(cells)
        if whole is not None:
            rows = rows.summing(whole)
        total = float(log_sum(self.log_prior + rows.whole, axis=0))
        return replace(self, rows=rows, log_evidence=total, ends=None)

    def read_as_failed(self) -> Scored:
        """Return the same with the unknown shifts read as failed."""
        table = self.rows.log_likelihood + self.rows.as_failed
        return self.with_table(table)

    def with_table(self, table: Array) -> Scored:
        """Return the same with another log likelihood (m, cells) of its rows."""
        rows = self.rows.with_table(table)
        total = float(log_sum(self.log_prior + rows.whole, axis=0))
        return replace(self, rows=rows, log_evidence=total)

    def draw(self, count: int, generator: np.random.Generator) -> np.ndarray:
        """Return places of rows, drawn by their posterior weights, (count,)."""
        return generator.choice(len(self.log_prior), size=count, p=self.weights())
