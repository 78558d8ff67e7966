"""The simulation against the published Adams table, at the same ten angles."""

from __future__ import annotations

import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.comparison import compare
from dogshape.pipeline.simulate.executor import scratch_executor

#: Root-mean-square deviation over all 25 cells. The mean of ten random angles
#: scatters by 10 to 25 % itself; the phase origin of the published angles is not given.
ALL_CELLS = 0.14
#: Largest deviation of one cell in standard errors of ten angles, or else its share.
ONE_CELL_SHARE = 0.26


@pytest.fixture(scope="module")
def adams() -> Bench:
    return load_bench("mq200_adams")


def test_published_adams_table(adams: Bench) -> None:
    result = compare(adams, scratch_executor().run)
    assert len(result.differences) == 28
    compared = [d for d in result.differences if d.gap is not None]
    assert len(compared) == 25
    assert all(d.simulated.engaged == 1.0 for d in result.differences)
    assert result.relative_rms < ALL_CELLS
    for d in compared:
        assert d.gap is not None
        assert d.cell.time is not None
        assert abs(d.gap / d.cell.time) < ONE_CELL_SHARE


def test_stand_is_slower_than_the_published_simulation(adams: Bench) -> None:
    """The gap that the thesis reports as about 0.1 s: worked out from its two tables."""
    stand = load_bench("mq200_stand")
    pairs = zip(stand.cells, adams.cells, strict=True)
    gaps = [s.time - a.time for s, a in pairs if s.time is not None and a.time is not None]
    assert len(gaps) == 25
    assert min(gaps) > 0.04
    mean = sum(gaps) / 25
    rms = (sum(g * g for g in gaps) / 25) ** 0.5
    assert mean == pytest.approx(0.1212, abs=1e-4)
    assert rms == pytest.approx(0.1317, abs=1e-4)
