"""Data sets as benches leave them: unequal numbers of shifts, few shifts, missing points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, Reading, gather
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.model import build_models
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE
from tests.diagnosed import EFFECTS, simulated_bench, simulated_diagnosis
from tests.made_up import made_up

DELAY = {"actuation_delay": {"delay_s": 0.08}}


def _with(counts: Sequence[int]) -> Bench:
    """Make so many shifts with a delay at each point; 0 leaves a point out."""
    bench = simulated_bench(DELAY)
    cells = zip(bench.cells, counts, strict=True)
    rows = [replace(r, n=n) for cell, n in cells for r in cell.readings if n]
    return replace(bench, cells=gather(rows))


@pytest.mark.parametrize(
    "counts",
    [[3] * 12, [1, 2, 7, 40] * 3, [0, 10, 0, 3, 10, 10] * 2, [500] + [3] * 11],
    ids=["few", "unequal", "missing points", "one of many"],
)
def test_any_number_of_shifts_at_any_points_leads_to_the_cause(counts: list[int]) -> None:
    found = simulated_diagnosis(_with(counts))
    assert found.leading == ("actuation_delay",)
    size = found.sizes["actuation_delay"]["delay_s"]
    assert size.low - 0.01 < 0.08 < size.high + 0.01


def _likelihood(*rows: Reading) -> Likelihood:
    """Build the likelihood of some rows at one point, without an effect."""
    bench = replace(simulated_bench({}), cells=gather(rows))
    few = {"sleeve_friction": EFFECTS["sleeve_friction"]}
    (model,) = build_models(bench, few, USUAL, made_up).values()
    return Likelihood(bench, observe(bench, model), model, USUAL)


def test_a_mean_counts_by_its_number() -> None:
    """Three rows of one point are their weighted mean, with the number of all their shifts."""
    point = simulated_bench({}).cells[-1].point
    parts = [(1, 0.021), (2, 0.024), (7, 0.023)]
    whole = sum(n * time for n, time in parts) / 10
    apart = _likelihood(*(Reading(k, point, n, t, True) for k, (n, t) in enumerate(parts, 2)))
    together = _likelihood(Reading(2, point, 10, whole, True))
    assert apart.seen.mean[0] == pytest.approx(whole)
    assert apart.seen.count[0] == together.seen.count[0] == 10
    logs = [one.terms(one.model.predict(NONE, np.zeros((1, 0)))).log for one in (apart, together)]
    assert logs[0] == pytest.approx(logs[1])


def test_an_error_of_the_simulation_does_not_average_out() -> None:
    """More shifts at one point make it no surer than the error of any simulation."""
    point, logs = simulated_bench({}).cells[-1].point, []
    for n in (10, 1000, 100_000):
        one = _likelihood(Reading(2, point, n, 0.03, engaged=None))
        # Without late shifts, of which a mean of many may hide any number.
        one = replace(one, settings=replace(USUAL, late_least=1e-9))
        p = one.model.predict(NONE, np.zeros((1, 0)))
        p = replace(p, late=0.0 * p.late)
        own = one.own_variance(p)[0, 0]
        assert own > (USUAL.model_error * p.mean[0, 0]) ** 2 * (1.0 - 1e-9)
        logs.append(float(one.terms(p).log[0]))
    assert logs[1] == pytest.approx(logs[2], abs=0.1)
