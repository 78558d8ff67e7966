"""The ways to correct rows that the benchmark of two fidelities compares, on known differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.two_fidelities import parametric, process, uncorrected
from dogshape.pipeline.train.two_level_rows import Times
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset
from tests.unit.test_surrogate import made


def _known(apart: Callable[[Dataset], Array]) -> tuple[Dataset, Times, Times, Array]:
    """Return rows, times of both engines at one row of each of 80 designs, and the true factors."""
    rows, rng = made(80), np.random.default_rng(3)
    factor = np.exp(apart(rows))
    cheap: Times = {}
    dear: Times = {}
    for k in range(0, len(rows), 4):
        place = tuple(rows.x[k].tolist()), (*rows.points[k].tolist(), 0.1)
        times = 0.06 * np.exp(0.3 * rng.standard_normal(4))
        noisy = times * factor[k] * np.exp(0.001 * rng.standard_normal(4))
        angles = (0.0, 1.0, 2.0, 3.0)
        cheap[place] = dict(zip(angles, times.tolist(), strict=True))
        dear[place] = dict(zip(angles, noisy.tolist(), strict=True))
    return rows, cheap, dear, factor


def _missed(rows: Dataset, corrected: Dataset, factor: Array) -> float:
    """Return the root-mean-square error of the logarithm of the means."""
    found = corrected.column("mean_s") / (rows.column("mean_s") * factor)
    return float(np.sqrt((np.log(found) ** 2).mean()))


def test_a_process_follows_what_changes_with_the_design() -> None:
    rows, cheap, dear, factor = _known(lambda data: 0.03 * data.scaled(data.x)[:, 0])
    line, own = (way(rows, cheap, dear) for way in (parametric, process))
    assert _missed(rows, own, factor) < 0.3 * _missed(rows, line, factor)


def test_both_recover_a_constant() -> None:
    rows, cheap, dear, factor = _known(lambda data: np.full(len(data), 0.02))
    assert _missed(rows, uncorrected(rows, cheap, dear), factor) == pytest.approx(0.02)
    for way in (parametric, process):
        assert _missed(rows, way(rows, cheap, dear), factor) < 0.002
