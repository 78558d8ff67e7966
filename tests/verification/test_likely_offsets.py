"""Log likelihood of all cells together, against sums over the offset that they have in common."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from dogshape.diagnosis.likelihood.cell_likelihood import timed
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy, Slopes, marginals
from dogshape.diagnosis.likelihood.likely_offsets import likely_offsets, timed_together
from dogshape.diagnosis.likelihood.observations import Observed, observe
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array
from tests.toy import bench_of, points_of

CELLS, SHIFTS = 6, 20
MEAN, SD = 0.1, 0.004
WIDTH = float(np.hypot(SD / np.sqrt(SHIFTS), 0.01 * MEAN))  #: of a mean, with 1 % of any simulation
SCATTER = np.array([0.3, -1.1, 0.8, 1.5, -0.4, -0.9])


def _said() -> CellPredictions:
    times = norm.ppf((np.arange(24) + 0.5) / 24, MEAN, SD)[None]
    one = np.ones(1)
    plain = Prediction.plain(times, one, 0.0 * one, 0.02 * one)
    parts = {"outlier_share": 0.01 * one, "behind": 0.12 * one, "behind_sd": 0.03 * one}
    return CellPredictions.of([Prediction(**{**vars(plain), **parts})] * CELLS, Rules())


def _seen(widths: Array) -> Observed:
    """Observe means that are off by so many widths, (cells,)."""
    bench = bench_of({}, np.random.default_rng(0), points=points_of()[:CELLS], shifts=SHIFTS)
    seen = observe(bench)
    return type(seen)(**{**vars(seen), "mean": MEAN + WIDTH * widths})


def _alike(size: float) -> Discrepancy:
    """Make a discrepancy that is the same in all cells, of a normal amplitude, s."""
    return Discrepancy((np.full((CELLS, 1), size),), np.ones(1), np.ones((1, 1)))


def _summed(seen: Observed, prior: Discrepancy) -> float:
    """Sum the likelihood over the offset in common, without any expansion."""
    said, nodes = _said(), np.linspace(-8.0, 8.0, 6001)
    offsets = prior.roots[0] * nodes
    logs = timed(seen, said.moved(offsets)).log.sum(axis=0) + norm.logpdf(nodes)
    return float(logsumexp(logs) + np.log(nodes[1] - nodes[0]))


def _found(seen: Observed, prior: Discrepancy, *, at_zero: bool = False) -> float:
    said = _said()
    cells, gain = timed_together(seen, said, prior)
    if at_zero:
        cells = timed(seen, said)
        gain = marginals(cells.slopes, prior, np.zeros((1, CELLS))).log
    return float(cells.log.sum() + gain[0])


def test_what_joins_is_what_the_slopes_say() -> None:
    seen, prior = _seen(SCATTER + 10.0), _alike(10.0 * WIDTH)
    cells, gain = timed_together(seen, _said(), prior)
    own = marginals(cells.slopes, prior, np.zeros((1, CELLS))).log
    assert gain == pytest.approx(own, abs=1e-9)


@pytest.mark.parametrize("off", [0.0, 2.0, -5.0, 10.0, 20.0])
def test_an_offset_in_common_is_as_likely_as_its_sum(off: float) -> None:
    seen, prior = _seen(SCATTER + off), _alike(10.0 * WIDTH)
    assert _found(seen, prior) == pytest.approx(_summed(seen, prior), abs=0.1)


@pytest.mark.parametrize("off", [-5.0, 10.0, 20.0])
def test_with_slopes_of_no_offset_it_is_missed_by_far(off: float) -> None:
    seen, prior = _seen(SCATTER + off), _alike(10.0 * WIDTH)
    assert _found(seen, prior, at_zero=True) < _summed(seen, prior) - 20.0


@pytest.mark.parametrize("off", [0.0, 10.0, 20.0, -20.0])
@pytest.mark.parametrize("odd", [-60.0, -30.0, 25.0, 60.0])
def test_an_odd_cell_beside_it_does_not_pull_the_others(off: float, odd: float) -> None:
    gaps = np.where(np.arange(CELLS) == 2, odd, SCATTER) + off
    seen, prior = _seen(gaps), _alike(10.0 * WIDTH)
    assert _found(seen, prior) == pytest.approx(_summed(seen, prior), abs=0.2)


def test_where_cells_err_in_nothing_together_nothing_changes() -> None:
    seen, prior = _seen(np.arange(6.0)), _alike(0.0)
    (found, gain), plain = timed_together(seen, _said(), prior), timed(seen, _said())
    assert not gain.any()
    np.testing.assert_array_equal(found.log, plain.log)
    np.testing.assert_array_equal(found.first, plain.first)


def test_offsets_are_those_of_joint_normals() -> None:
    generator = np.random.default_rng(2)
    root, joint = generator.normal(size=(4, 4)), generator.normal(size=(3, 4))
    gaps, variances = generator.normal(size=(3, 4)), generator.uniform(0.5, 2.0, (3, 4))
    found = likely_offsets(Slopes(gaps / variances, 1.0 / variances), root @ root.T, joint)
    for row, gap, variance, own in zip(found, gaps, variances, joint, strict=True):
        before = root @ root.T + np.outer(own, own)
        assert row == pytest.approx(before @ np.linalg.solve(before + np.diag(variance), gap))
