"""Interpolation of an effect's changes against simulations between its levels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.model import build_models
from dogshape.diagnosis.prediction.simulations import ANGLES, Level, simulate
from dogshape.diagnosis.settings import USUAL
from dogshape.sim.effects import load
from dogshape.sim.statistics.blocks import Block, run_block
from dogshape.sim.statistics.shift_records import Record


def _run(blocks: list[Block]) -> list[list[Record]]:
    return [list(run_block(block)) for block in blocks]


@pytest.mark.parametrize("name", ["sleeve_friction", "force_scale"])
def test_errors_of_an_interpolation_are_its_stated_ones(name: str) -> None:
    """Friction holds the ring at the end of its range, where the time is infinite.

    The means of level and interpolation both scatter by their angles, half as much as at random.
    """
    bench = load_bench("mq200_adams")
    bench = replace(bench, clutch=bench.clutch.with_engine("planar"), cells=bench.cells[1:28:9])
    (model,) = build_models(bench, {name: load(None)[name]}, USUAL, _run).values()
    shares = np.linspace(0.02, 0.98, 17)[:, None]
    values = model.space((name,)).values(shares)
    levels = [Level((name,), tuple(row)) for row in values.tolist()]
    times = simulate(model.effects, model.settings, _run, levels).times
    exact = (model._moments(times) - model._moments(model.simulated.base))[..., 0]
    found, p = model.changes(name, values), model.predict((name,), shares)
    scatter = 0.5 * p.sd / (p.mean - p.delay) * (2.0 / ANGLES) ** 0.5
    known = np.isfinite(exact)
    scores = ((found.moments[..., 0] - exact) / np.hypot(found.error, scatter))[known]
    assert np.sqrt((scores**2).mean()) < 1.3
    assert abs(scores).max() < 4.0
