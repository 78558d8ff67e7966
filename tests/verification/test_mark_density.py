"""Evidence of the marks of the flight alone: simulated effects, no effect, and unknown offsets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import chi2, multivariate_t
from scipy.stats.qmc import Sobol

from dogshape.diagnosis.bench.bench_data import Bench, gather
from dogshape.diagnosis.bench.flight_marks import WAYS, SeenFlight, flights_of
from dogshape.diagnosis.likelihood.mark_density import flight_scores, log_flights, log_unknown
from dogshape.diagnosis.prediction.flights import Flights
from dogshape.diagnosis.terms import Array, Hypothesis
from tests.flying import EFFECTS, flying_bench, settings

FLIGHTS = Flights(EFFECTS, settings())
NOTHING = np.zeros((1, 0))
RIVALS = (
    "actuation_delay",
    "actuation_lag",
    "force_scale",
    "linkage_compliance",
    "moving_mass",
    "sleeve_friction",
    "viscous_damping",
)
TRUTHS: dict[str, Mapping[str, float]] = {
    "actuation_delay": {"delay_s": 0.02},
    "actuation_lag": {"lag_s": 0.02},
    "moving_mass": {"added_mass_kg": 0.5},
    "sleeve_friction": {"friction_N": 40.0},
}


@cache
def _seen(name: str | None) -> tuple[SeenFlight, ...]:
    """Return the marks of a bench with one of the effects, or without any."""
    return flights_of(flying_bench(name, TRUTHS[name] if name else {}))


def _values(name: str) -> Array:
    """Fill the prior of an effect evenly, (1024, p)."""
    parameters = EFFECTS[name].parameters
    shares = Sobol(len(parameters), seed=1).random(1024)
    return np.array([[p.at(s) for p, s in zip(parameters, row, strict=True)] for row in shares])


def _evidence(seen: tuple[SeenFlight, ...]) -> dict[Hypothesis, float]:
    """Compute log evidence by the mean of the density over the prior."""
    found: dict[Hypothesis, float] = {(): float(log_flights(seen, FLIGHTS, (), NOTHING)[0])}
    for name in RIVALS:
        values = _values(name)
        logs = log_flights(seen, FLIGHTS, (name,), values)
        found[(name,)] = float(logsumexp(logs) - np.log(len(values)))
    return found


@pytest.mark.parametrize("name", TRUTHS)
def test_the_flight_tells_the_effect_from_all_rivals(name: str) -> None:
    seen = _seen(name)
    logs = _evidence(seen)
    mine = logs.pop((name,))
    if name == "moving_mass":  # a stiff linkage with that mass is the same
        logs = {h: log for h, log in logs.items() if "linkage_compliance" not in h}
    assert mine > max(logs.values()) + 5.0
    assert mine > log_unknown(seen, FLIGHTS) + 3.0
    (truth,) = TRUTHS[name].values()
    values = _values(name)
    logs_of = log_flights(seen, FLIGHTS, (name,), values)
    weights = np.exp(logs_of - logs_of.max())
    mean = weights @ values[:, 0] / weights.sum()
    sd = np.sqrt(weights @ (values[:, 0] - mean) ** 2 / weights.sum())
    assert abs(mean - truth) < 2.0 * sd + 0.05 * truth
    best = values[[np.argmax(logs_of)]]
    assert _p_value(seen, (name,), best) > 0.05


def _p_value(seen: tuple[SeenFlight, ...], h: Hypothesis, values: Array) -> float:
    scores = flight_scores(seen, FLIGHTS, h, values)
    return float(chi2.sf((scores**2).sum(axis=1), len(seen))[0])


def _moved(bench: Bench, offsets: Mapping[float, float]) -> Bench:
    """Return a bench whose displacement comes later by something for each force, s."""
    rows = []
    for reading in bench.readings:
        trace, late = reading.trace, offsets[reading.point.profile.force]
        assert trace is not None
        way = np.interp(trace.time - late, trace.time, trace.displacement)
        rows.append(replace(reading, trace=replace(trace, displacement=way)))
    return replace(bench, cells=gather(rows))


def test_traces_that_no_effect_explains_raise_unknown() -> None:
    offsets = {235.2: 0.002, 315.5: 0.03, 469.0: 0.003, 641.5: 0.025}
    seen = flights_of(_moved(flying_bench(None, {}), offsets))
    logs = _evidence(seen)
    assert log_unknown(seen, FLIGHTS) > max(logs.values()) + 5.0
    best = max(logs, key=lambda h: logs[h])
    values = _values(best[0])
    values = values[[np.argmax(log_flights(seen, FLIGHTS, best, values))]]
    assert _p_value(seen, best, values) < 0.01


def test_the_density_is_students_in_both_readings_of_the_force() -> None:
    seen = _seen(None)[:1]
    (one,) = seen
    values = np.array([[0.0], [0.001], [0.05]])
    marks = FLIGHTS.marks(("actuation_delay",), values, one.profile)
    still = FLIGHTS.marks((), NOTHING, one.profile).times[0]
    logs = []
    for times, error in zip(marks.times, marks.error, strict=True):
        shape = one.covariance + np.diag(error[one.places] ** 2)
        nominal = np.where(np.arange(times.size) < len(WAYS), times, still)
        both = [
            multivariate_t(mean[one.places], shape, df=5.0).logpdf(one.times)
            for mean in (times, nominal)
        ]
        logs.append(np.logaddexp(*both) - np.log(2.0))
    assert log_flights(seen, FLIGHTS, ("actuation_delay",), values) == pytest.approx(logs)
