"""Data sets as benches leave them: unequal numbers of shifts, few shifts, missing points."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.likelihood.cell_likelihood import log_times
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.settings import Rules
from dogshape.sim.bundled import bundled_root
from dogshape.sim.errors import DataError
from tests.toy import EFFECTS, Toy, bench_of, points_of

NAMES = ("actuation_delay", "moving_mass", "sleeve_friction")
POINTS = points_of()
DELAY = {"delay_s": 0.08}


def _diagnosed(bench: Bench) -> Diagnosis:
    points = tuple(cell.point for cell in bench.cells)
    return diagnose(bench, Toy(points), {n: EFFECTS[n] for n in NAMES}, pairs=[])


def _with(counts: Sequence[int], seed: int = 1) -> Bench:
    """Return the toy with a delay, so many shifts at each point; 0 leaves a point out."""
    generator, rows = np.random.default_rng(seed), []
    for point, count in zip(POINTS, counts, strict=True):
        if count:
            rows += bench_of(DELAY, generator, shifts=count, points=[point]).readings
    rows = [replace(row, row=k) for k, row in enumerate(rows, start=2)]
    return replace(bench_of({}, generator, points=POINTS[:1]), cells=gather(rows))


@pytest.mark.parametrize(
    "counts",
    [[1] * 28, [2] * 28, [1, 2, 7, 40] * 7, [0, 10, 0, 3, 10, 10, 0] * 4, [500] + [1] * 27],
    ids=["one", "two", "unequal", "missing points", "one of many"],
)
def test_any_number_of_shifts_at_any_points_leads_to_the_cause(counts: list[int]) -> None:
    found = _diagnosed(_with(counts))
    assert found.verdict.causes == ("actuation_delay",)
    size = found.intervals[("actuation_delay",)]["delay_s"]
    assert size.low - 0.01 < 0.08 < size.high + 0.01


def test_a_mean_counts_by_its_number() -> None:
    """Three rows of one point are their weighted mean, with the number of all their shifts."""
    point = POINTS[-1]
    parts = [(1, 0.021), (2, 0.024), (7, 0.023)]
    rows = [Reading(k, point, n, time, True) for k, (n, time) in enumerate(parts, start=2)]
    whole = sum(n * time for n, time in parts) / 10
    bench = bench_of({}, np.random.default_rng(1), points=[point])
    apart, together = (
        observe(replace(bench, cells=gather(those)))
        for those in (rows, [Reading(2, point, 10, whole, True)])
    )
    said = CellPredictions.of([Toy((point,)).at(NONE, np.zeros((1, 0)), 0)], Rules())
    assert apart.mean[0] == pytest.approx(whole)
    assert apart.n[0] == 10
    # The single shift is none of which only a mean is known, so that it is no late one.
    assert log_times(apart, said)[0, 0] == pytest.approx(log_times(together, said)[0, 0], abs=0.1)


def test_an_error_of_the_simulation_does_not_average_out() -> None:
    """More shifts at one point make it no surer than the error of any simulation."""
    point = POINTS[-1]
    bench = bench_of({}, np.random.default_rng(1), points=[point])
    said = CellPredictions.of([Toy((point,)).at(NONE, np.zeros((1, 0)), 0)], Rules())
    off = float(said.mean[0, 0]) + 3e-3
    logs = []
    for n in (10, 1000, 100_000):
        seen = observe(replace(bench, cells=gather([Reading(2, point, n, off, True)])))
        logs.append(log_times(seen, said)[0, 0])
    assert logs[1] == pytest.approx(logs[2], abs=0.1)


@pytest.mark.parametrize("count", ["", "2.5", "many", "-3"])
def test_a_row_without_a_number_is_refused(tmp_path: Path, count: str) -> None:
    target = tmp_path / "set"
    shutil.copytree(bundled_root() / "bench" / "mq200_stand", target)
    table = target / "shifts.csv"
    lines = table.read_text().splitlines()
    cells = lines[2].split(",")
    cells[3] = count
    lines[2] = ",".join(cells)
    table.write_text("\n".join(lines))
    with pytest.raises(DataError) as refused:
        load_bench(target)
    said = str(refused.value)
    assert (
        f"row 3, column n_shifts is '{count}', but it must be a whole number of at least 1" in said
    )
    assert "1 for a single shift" in said
