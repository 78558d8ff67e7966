"""Predicted outcome of traces: the marks of the flight of one force profile, per hypothesis.

Up to the first touch the motion depends on no relative angle, so a few traces show the flight
(``diagnosis.bench.flight_marks``). A hypothesis predicts its marks at values drawn from its
posterior; their covariance has the spread of these, and all errors of the likelihood of a flight
(``diagnosis.likelihood.flight_likelihood``), with the variance of its Student distribution. The
force of a trace may be the nominal one: each reading has half. *Unknown* has the marks of the
baseline, half, or such moved by its offsets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from dogshape.diagnosis.bench.flight_marks import FORCES, SIZE, WAYS, SeenFlight, model_covariance
from dogshape.diagnosis.bench.sense import DELAY, forward
from dogshape.diagnosis.inference.outcome import Outcome
from dogshape.diagnosis.likelihood.flight_likelihood import (
    SCALES,
    FlightPrediction,
    flight_prediction,
    unknown_offsets,
)
from dogshape.diagnosis.likelihood.scores import Scored
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.diagnosis.prediction.prediction import FlightEmulator, Marks
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.shift.actuation import ForceProfile

DRAWN = 200  #: values drawn from the posterior of a hypothesis
STEP = 1e-3  #: s, sampling step that a recording is taken to have
TABULATED = 2  #: effects beside a delay whose flights together are tabulated

Densities = list[tuple[float, Array, Array]]  #: share, mean and covariance


def tabulated(hypothesis: Hypothesis) -> bool:
    """Test that the flight of a hypothesis is tabulated; a delay adds to all marks alike."""
    return len([name for name in forward(hypothesis) if name != DELAY]) <= TABULATED


def flight_outcome(
    emulator: FlightEmulator,
    hypotheses: Sequence[Hypothesis],
    scored: Mapping[Hypothesis, Scored],
    profile: ForceProfile,
    traces: int,
) -> Outcome:
    """Predict the marks of so many traces under a force profile, in s.

    ``hypotheses`` have tabulated flights; *unknown* is among them.
    """
    still = emulator.flight(NONE, np.zeros((1, 0)), profile)
    found: list[Densities] = []
    for hypothesis in hypotheses:
        if hypothesis == UNKNOWN:
            found.append(_moved(profile, still, traces))
            continue
        one = scored[hypothesis]
        generator = np.random.default_rng(1)
        places, counts = np.unique(one.draw(DRAWN, generator), return_counts=True)
        values = one.space.values(one.rows.shares[places])
        marks = emulator.flight(hypothesis, values, profile)
        found.append(_flown(profile, marks, still, counts / DRAWN, traces))
    owner = np.repeat(np.arange(len(found)), [len(rows) for rows in found])
    every = [row for rows in found for row in rows]
    share, mean, covariance = (np.array([row[k] for row in every]) for k in range(3))
    return Outcome(owner, share, mean, covariance, np.ones(len(found), dtype=bool))


def _flown(
    profile: ForceProfile, marks: Marks, still: Marks, weights: Array, traces: int
) -> Densities:
    """Return the densities of the marks of a hypothesis, its values weighted."""
    it = flight_prediction(_recorded(profile, weights @ marks.times, traces), marks, still)
    densities: Densities = []
    for times in (it.times, it.nominal):
        mean = weights @ times
        spread = (weights[:, None] * (times - mean)).T @ (times - mean)
        densities.append((0.5, mean, spread + _errors(it, weights)))
    return densities


def _moved(profile: ForceProfile, still: Marks, traces: int) -> Densities:
    """Return the densities of the marks that no known effect moved."""
    seen = _recorded(profile, still.times[0], traces)
    it = flight_prediction(seen, still, still)
    mean, errors = it.times[0], _errors(it, np.ones(1))
    prior = USUAL.unlisted
    shape, way = unknown_offsets([seen], prior)
    kernels = [
        scale**2 * shape * np.outer(which, which)
        for scale in np.geomspace(prior.least_mark, prior.most_mark, SCALES)
        for which in (np.ones(way.size), way)
    ]
    moved = [(0.5 / len(kernels), mean, errors + kernel) for kernel in kernels]
    return [(0.5, mean, errors), *moved]


def _errors(predicted: FlightPrediction, weights: Array) -> Array:
    """Return the covariance of marks at given values, of which the Student scale is a part."""
    whole: Array = np.tensordot(weights, predicted.covariance, axes=1)
    freedom = USUAL.likelihood.flight_freedom
    return freedom / (freedom - 2.0) * whole


def _recorded(profile: ForceProfile, times: Array, traces: int) -> SeenFlight:
    """Return the flight that traces with marks at given times would show."""
    places = np.arange(SIZE)
    parts = np.split(times, [len(WAYS)])
    # A mark's value over its slope there; marks that never come have the time-out in common.
    reach = np.concatenate(
        [
            np.array(values) * np.gradient(part, values)
            for values, part in zip((WAYS, FORCES), parts, strict=True)
        ]
    )
    covariance = model_covariance(places, times, np.maximum(0.0, reach))
    return SeenFlight(profile, (), places, times, covariance + STEP**2 / 12.0 / traces, traces)
