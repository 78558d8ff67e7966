"""Formulas that treat all values at once, against the plain ones that treat each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from dogshape.diagnosis.inference.unknown import Model, Offset, Unknown, log_normal
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy, Slopes, marginals
from dogshape.diagnosis.prediction.angle_means import shared_out
from dogshape.diagnosis.prediction.outliers import MIDDLE, MOST, finite_quantile
from dogshape.diagnosis.prediction.recent import Recent
from dogshape.diagnosis.terms import Array

VALUES, CELLS = 7, 5


def _by_eigenvalues(slopes: Slopes, prior: Discrepancy, columns: Array) -> tuple[Array, Array]:
    """Squares and spreads of one value's marginals by plain linear algebra; columns (cells, q)."""
    (first,), (second,) = slopes.first, slopes.second
    squares, spreads = [], []
    for root in prior.roots:
        for amplitude in prior.amplitudes:
            whole = np.hstack([amplitude * root, columns])
            values, vectors = np.linalg.eigh(whole.T @ np.diag(second) @ whole)
            turned = vectors.T @ whole.T @ first
            squares.append((turned**2 / (1.0 + values)).sum())
            spreads.append(0.5 * np.log1p(values).sum())
    return np.array(squares), np.array(spreads)


@pytest.mark.parametrize("widths", [(2, 4), (5, 5), (9, 3)])
@pytest.mark.parametrize("others", [0, 1, 3])
def test_marginals_of_all_values_are_those_of_eigenvalues(
    widths: tuple[int, ...], others: int
) -> None:
    """Roots narrower and wider than cells, alone, with a joint error, with more beside it."""
    generator = np.random.default_rng(others)
    first = generator.standard_normal((VALUES, CELLS)) * 300.0
    second = 10.0 ** generator.uniform(2.0, 6.0, (VALUES, CELLS))
    second[0] = 0.0  # a value that knows nothing
    first[0] = 0.0
    roots = tuple(0.02 * generator.standard_normal((CELLS, width)) for width in widths)
    joint = (others > 0) * 0.004 * generator.standard_normal((VALUES, CELLS))
    beside = 0.003 * generator.standard_normal((CELLS, others - 1)) if others > 1 else None
    prior = Discrepancy(roots, np.array([0.1, 1.0, 3.0]), np.full((2, 3), 1.0 / 6.0), beside)
    found = marginals(Slopes(first, second), prior, joint)
    for k in range(VALUES):
        columns = np.hstack([joint[[k]].T, np.zeros((CELLS, 0)) if beside is None else beside])
        squares, spreads = _by_eigenvalues(
            Slopes(first[[k]], second[[k]]), prior, columns if others else columns[:, :0]
        )
        assert found.squares[k] == pytest.approx(squares, rel=1e-9)
        assert found.spread[k] == pytest.approx(spreads, rel=1e-9, abs=1e-12)


def test_densities_of_members_are_those_of_each_normal() -> None:
    generator = np.random.default_rng(0)
    roots = generator.standard_normal((6, 4, 4))
    covariance = roots @ np.swapaxes(roots, 1, 2) + np.eye(4)
    apart = generator.standard_normal((6, 4))
    each = [multivariate_normal(cov=c).logpdf(a) for c, a in zip(covariance, apart, strict=True)]
    assert log_normal(apart, covariance) == pytest.approx(np.array(each))


def test_unknown_is_the_sum_over_its_members_of_the_cells_with_times() -> None:
    generator = np.random.default_rng(1)
    offsets = [(Offset(-1.0, 0.01, 1e-4), None, Offset(2.0, -0.02, 4e-4), Offset(0.0, 0.0, 1e-3))]
    offsets += [(Offset(0.5, 0.03, 2e-4), None, Offset(1.0, 0.01, 3e-4), Offset(0.3, 0.1, 1e-3))]
    roots = 0.01 * generator.standard_normal((2, 4, 4))
    models = [Model(r @ r.T, o, p) for r, o, p in zip(roots, offsets, (-0.3, -1.4), strict=True)]
    unlisted = Unknown(tuple(models), np.ones(4), np.zeros(4), np.zeros(4))
    for cells, places in ((np.ones(4, dtype=bool), [0, 2, 3]), (np.arange(4) != 2, [0, 3])):
        whole = 0.0
        for model in models:
            those = [o for k in places if (o := model.offsets[k]) is not None]
            matrix = model.kernel[np.ix_(places, places)] + np.diag([o.variance for o in those])
            log = multivariate_normal(cov=matrix).logpdf([o.mean for o in those])
            whole += np.exp(model.log_prior + log + sum(o.log_size for o in those))
        assert unlisted.log_evidence_of(cells) == pytest.approx(np.log(whole))


def test_quantiles_of_finite_times_are_those_of_numpy_to_the_last_digit() -> None:
    generator = np.random.default_rng(2)
    for count in (1, 2, 3, 8, 49):
        times = generator.gamma(2.0, 0.1, (200, count))
        times[generator.random(times.shape) < 0.2] = np.nan
        times[generator.random(times.shape) < 0.1] = np.inf
        some = times[np.isfinite(times).any(axis=1)]
        for share in (MIDDLE, MOST):
            plain = np.nanquantile(np.where(np.isfinite(some), some, np.nan), share, axis=1)
            assert (finite_quantile(some, share) == plain).all()
    assert (finite_quantile(np.array([[np.inf, np.nan]]), MIDDLE) == 0.0).all()


def test_amounts_over_equal_shares_are_those_of_each_row() -> None:
    generator = np.random.default_rng(3)
    mass = generator.random((300, 20))
    mass /= mass.sum(axis=1, keepdims=True)
    amount = mass * generator.random((300, 20))
    edges = np.linspace(0.0, 1.0, 25)
    for k, row in enumerate(shared_out(mass, amount, 24)):
        places, sums = (np.append(0.0, np.cumsum(one[k])) for one in (mass, amount))
        assert row == pytest.approx(np.diff(np.interp(edges, places, sums)), abs=1e-12)


def test_recent_results_are_made_once_and_the_oldest_is_forgotten() -> None:
    made = list[str]()

    def make(name: str) -> str:
        made.append(name)
        return name

    kept = Recent[str](2)
    for name in ("a", "b", "a", "c", "a", "b"):
        assert kept.get("key", np.array([ord(name)]), lambda n=name: make(n)) == name  # type: ignore[misc]
    assert made == ["a", "b", "c", "b"]
