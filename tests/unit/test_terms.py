"""Tables of rows, and the gap at an operating point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.comparison import PointGap
from dogshape.diagnosis.terms import Array, Table
from tests.toy import bench_of, points_of


@dataclass(frozen=True)
class _Inner(Table):
    values: Array


@dataclass(frozen=True)
class _Outer(Table):
    SHARED = ("common",)

    values: Array
    inner: _Inner
    common: Array
    absent: Array | None = None


def test_rows_of_a_table_are_selected_and_appended_in_all_its_parts() -> None:
    values = np.arange(6.0).reshape(3, 2)
    table = _Outer(values, _Inner(values[:, 0]), np.ones(5))
    some = table.only(np.array([False, True, True]))
    assert (some.values == values[1:]).all()
    assert (some.inner.values == [2.0, 4.0]).all()
    assert (some.common is table.common, some.absent) == (True, None)
    both = some.joined(table)
    assert (both.values == np.vstack([values[1:], values])).all()
    assert both.inner.values.tolist() == [2.0, 4.0, 0.0, 2.0, 4.0]
    assert both.common is table.common


def test_a_gap_is_bench_less_simulation_and_none_without_a_time() -> None:
    cell = bench_of({}, np.random.default_rng(1), points=points_of()[:1]).cells[0]
    time = cell.time
    assert time is not None
    gap = PointGap(cell, time - 0.03, 0.01)
    assert gap.gap is not None
    assert gap.z is not None
    np.testing.assert_allclose([gap.gap, gap.z], [0.03, 3.0])
    assert (replace(gap, mean=None).gap, replace(gap, mean=None).z) == (None, None)
