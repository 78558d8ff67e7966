"""Marks of the flight in traces: found in spite of scatter, and averaged without odd traces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from dogshape.diagnosis.bench.bench_data import Reading, gather
from dogshape.diagnosis.bench.flight_marks import (
    FORCE_FLOOR,
    FORCES,
    SIZE,
    WAYS,
    flights_of,
    mark_of,
    trace_marks,
)
from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.diagnosis.prediction.flights import fly
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import Trace
from tests.flying import flying_bench, sampled, settings

GAP = 1e-3
Drawn = Callable[[float, float, int], list[BenchTrace]]


@pytest.fixture(scope="module")
def setting() -> Setting:
    """The slow one of two operating points at 315.5 N."""
    return next(s for s in settings() if s.point.profile.force == 315.5)


@pytest.fixture(scope="module")
def shift(setting: Setting) -> Trace:
    """A simulated shift there that waits for its slot."""
    return engage(ClutchPlant(setting.clutch), setting.point, 0.05).trace


@pytest.fixture(scope="module")
def drawn(setting: Setting, shift: Trace) -> Drawn:
    """Sample the shift again and again, its start anywhere within a step."""

    def draw(step: float, noise: float, count: int) -> list[BenchTrace]:
        rng = np.random.default_rng(3)
        found = []
        for early in step * rng.random(count):
            late = replace(setting, delay=float(early))
            trace = sampled(shift, late, step, noise, rng)
            found.append(replace(trace, time=trace.time - early))
        return found

    return draw


@pytest.mark.parametrize(("step", "noise"), [(1e-3, 1.0), (5e-4, 1.0), (1e-3, 3.0), (2e-3, 0.5)])
def test_marks_of_a_noisy_trace_come_back_within_their_errors(
    setting: Setting, drawn: Drawn, step: float, noise: float
) -> None:
    profile = setting.point.profile
    exact = fly([setting], GAP, profile.force)[0][0]
    table = np.array([trace_marks(trace, profile, GAP) for trace in drawn(step, noise, 60)])
    for place in range(SIZE):
        marks = table[np.isfinite(table[:, place, 0]), place]
        if len(marks) < 0.8 * len(table):
            continue
        apart, errors = marks[:, 0] - exact[place], marks[:, 1]
        score = apart / np.hypot(errors, 2e-5)
        assert 0.4 < np.sqrt((score**2).mean()) < 1.5
        # What the mean is off by stays below the model error that every mark has.
        assert abs(np.median(apart)) < 1.5e-4 + 0.3 * np.median(errors)


def test_marks_of_straight_rises_are_exact_and_few_have_none(
    setting: Setting, drawn: Drawn
) -> None:
    time, around = np.linspace(0.0, 0.1, 101), (0.75, 1.3)
    mark = mark_of(time, 2000.0 * time, 50.5, around)
    assert mark[[0, 2]] == pytest.approx(0.02525)
    for values in (np.zeros(101), np.full(101, 100.0), 100.0 * time):
        assert np.isnan(mark_of(time, values, 50.0, around)).all()
    quiet, usual, loud = (
        trace_marks(drawn(1e-3, f, 1)[0], setting.point.profile, GAP)[:, 0] for f in (0.1, 1.0, 5)
    )
    # 0.3, 0.6 and 0.9 of the gap, and a tenth of the force.
    assert np.isfinite(usual[[2, 3, 4, len(WAYS)]]).all()
    assert (np.isnan(quiet[0]), np.isnan(loud[0])) == (False, True)


def _early(trace: BenchTrace) -> BenchTrace:
    """Return a trace whose ring was thrown back at 0.4 of the gap."""
    way = trace.displacement
    first = int(np.argmax(way > 0.4 * GAP))
    back = np.concatenate([way[:first], np.full(20, 0.35 * GAP), way[first:]])[: way.size]
    return replace(trace, displacement=back)


def test_traces_of_one_profile_are_averaged_and_odd_ones_left_out(
    setting: Setting, drawn: Drawn
) -> None:
    traces = drawn(1e-3, 1.0, 12)
    exact = fly([setting], GAP, setting.point.profile.force)[0][0]
    for odd in (0, 2):
        mixed = [_early(trace) if k < odd else trace for k, trace in enumerate(traces)]
        rows = [Reading(k + 2, setting.point, 1, 0.1, True, t) for k, t in enumerate(mixed)]
        bench = replace(flying_bench(None, {}, shifts=0), cells=gather(rows))
        (seen,) = flights_of(bench)
        apart = seen.times - exact[seen.places]
        assert abs(apart[seen.places < len(WAYS)]).max() < 3e-4
        assert np.sqrt(np.diag(seen.covariance)).min() > 2e-4
        assert np.linalg.eigvalsh(seen.covariance).min() > 0.0


def test_the_shares_are_those_of_the_nominal_force() -> None:
    profile = ForceProfile(400.0, 0.1)
    time = np.arange(0.0, 0.12, 1e-3)
    still = np.zeros(time.size)
    trace = BenchTrace(Path(), time, still, profile.at(time), still, still)
    marks = trace_marks(trace, profile, GAP)[len(WAYS) :, 0]
    exact = [float(brentq(lambda t, s=s: profile.at(t) - s * 400.0, 0.0, 0.1)) for s in FORCES]
    assert marks == pytest.approx(exact, abs=0.5 * FORCE_FLOOR)
