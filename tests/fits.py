"""Hand-made fits and diagnoses, on which advice and plans have closed forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dogshape.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.inference.outcome import Field, field_of
from dogshape.diagnosis.prediction.curve import ParameterSpace
from dogshape.diagnosis.prediction.model import Prediction
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.shift.clutch import OperatingPoint
from tests.toy import EFFECTS, bench_of, points_of, times_of

Array = NDArray[np.float64]
POINTS = points_of((235.2, 641.5))
UNTRACED = bench_of({}, np.random.default_rng(1), shifts=10, points=POINTS)
#: The same with a trace at each point, so that none is asked for.
BENCH = replace(
    UNTRACED,
    cells=tuple(
        replace(c, readings=(replace(c.readings[0], trace=cast("Any", object())),))
        for c in UNTRACED.cells
    ),
)
SETTING = setting_of(BENCH)
CELLS = len(POINTS)
WAITS = (np.arange(16) + 0.5) / 16  #: shares of the wait at which the toy is predicted
#: Without errors of the simulation but those that a prediction states.
SETTINGS = replace(USUAL, model_error=0.0, least_error=1e-9, spread_error=0.0)


def prediction_of(mean: Array) -> Prediction:
    """Make a prediction with a spread of 20 ms and an error of 1 ms from means (m, C)."""
    ones = np.ones_like(mean)
    zeros = np.zeros_like(mean)
    fields = (
        0.02 * ones,
        1e-3 * ones,
        zeros,
        zeros,
        zeros,
        ones,
        zeros,
        ones,
        zeros,
        0.02 * ones,
        zeros,
        zeros,
    )
    return Prediction(mean, *fields)


def space_of(hypothesis: Hypothesis) -> ParameterSpace:
    """Return the parameters of a hypothesis."""
    return ParameterSpace(tuple(EFFECTS[name] for name in hypothesis), SETTING)


def fit_of(
    hypothesis: Hypothesis, shares: float | Array = 0.5, time: float = 0.3, count: int = 64
) -> Fit:
    """Fit a hypothesis by draws of its shares, and one mean time everywhere."""
    space = space_of(hypothesis)
    rows = np.broadcast_to(shares, (count, len(space.parameters)))
    mean = np.full((count, CELLS), time)
    amplitude = np.zeros(count)
    none = 0.0 * mean
    draws = np.array(rows), prediction_of(mean), amplitude, none, none, np.zeros((count, 0))
    return Fit(hypothesis, space, *draws, log_evidence=0.0, error=0.0, checks={"means": 0.5})


def diagnosis_of(
    posterior: Mapping[Hypothesis, float],
    fits: Mapping[Hypothesis, Fit],
    bench: Bench = BENCH,
    **changes: Any,
) -> Any:
    """Make a diagnosis of a posterior; shifts at each point as the bench has them, of 0.3 s."""
    seen = SimpleNamespace(count=np.full(CELLS, 10.0), mean=np.full(CELLS, 0.3))
    names = {name for h in fits for name in h}
    diagnosis = SimpleNamespace(
        bench=bench,
        posterior=dict(posterior),
        fits=dict(fits),
        settings=SETTINGS,
        observed=seen,
        effects={name: EFFECTS[name] for name in sorted(names)},
        record_meanings=(),
        model=SimpleNamespace(setting=SETTING),
    )
    vars(diagnosis).update(changes)
    return diagnosis


class ToyModel:
    """The toy's times, with errors of 1 ms."""

    effects: dict[str, Any]

    def __init__(self, names: tuple[str, ...], points: Sequence[OperatingPoint]) -> None:
        """Take the names of its effects and its operating points."""
        self.effects = {name: EFFECTS[name] for name in names}
        self.points = points

    def space(self, hypothesis: Hypothesis) -> ParameterSpace:
        """Return the parameters of a hypothesis."""
        return space_of(hypothesis)

    def possible(self, _: Hypothesis, shares: Array) -> Array:
        """Mark all values."""
        return np.ones(len(shares), dtype=bool)

    def predict(self, hypothesis: Hypothesis, shares: Array) -> Prediction:
        """Return mean and spread of the toy's times."""
        space = self.space(hypothesis)
        size = (len(shares), WAITS.size)
        values = {p.name: space.values(shares)[:, [k]] for k, p in enumerate(space.parameters)}
        point_times = [np.broadcast_to(times_of(values, p, WAITS), size) for p in self.points]
        times = np.stack(point_times, axis=1)
        prediction = prediction_of(times.mean(axis=2))
        return replace(prediction, sd=np.maximum(1e-3, times.std(axis=2)))


def field_at(
    names: tuple[str, ...], points: Sequence[OperatingPoint] = POINTS, discrepancy: float = 0.0
) -> Field:
    """Predict some of the toy's effects at operating points."""
    cells = len(points)
    likelihood: Any = SimpleNamespace(
        model=ToyModel(names, points),
        settings=replace(SETTINGS, discrepancy=discrepancy),
        discrepancy_root=np.ones((cells, 1)),
        common_errors=lambda p: np.zeros((len(p.mean), cells, 0)),
        mean_variance=lambda p: p.error**2,
    )
    return field_of(likelihood)
