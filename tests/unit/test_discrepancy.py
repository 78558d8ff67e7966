"""What corrects the compiled engine's rows, on differences that are known."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.sim.errors import DataError, InputError
from dogshape.surrogate.discrepancy import LEAST, Pair, discrepancy_of
from tests.unit.test_surrogate import made

SPEEDS = np.geomspace(5.0, 249.0, 80)
SCATTER = 0.004


def _pairs(
    constant: float, slope: float, scatter: float = SCATTER, noise: float = 0.002, seed: int = 0
) -> list[Pair]:
    """Pairs of four times that scatter together, whose means differ by a known line."""
    rng, found = np.random.default_rng(seed), []
    for speed in SPEEDS:
        apart = constant + slope * np.log(speed / 50.0) + scatter * rng.standard_normal()
        cheap = 0.06 * np.exp(0.5 * rng.standard_normal(4))
        dear = cheap * np.exp(apart + noise * rng.standard_normal(4))
        found.append(Pair(float(speed), cheap, dear))
    return found


@pytest.mark.parametrize("slope", [0.0, 0.006])
def test_a_known_discrepancy_is_recovered_within_its_error(slope: float) -> None:
    asked, off = np.array([5.0, 50.0, 249.0]), []
    for seed in range(30):
        found = discrepancy_of(_pairs(0.01, slope, seed=seed))
        value, error = found.at(asked)
        off.append((value - 0.01 - slope * np.log(asked / 50.0)) / error)
        assert found.scatter == pytest.approx(SCATTER, rel=0.4)
    deviation = np.sqrt((np.array(off) ** 2).mean())
    assert 0.7 < deviation < 1.4


def test_the_slope_is_kept_where_it_foretells() -> None:
    steep, flat = discrepancy_of(_pairs(0.01, 0.006)), discrepancy_of(_pairs(0.01, 0.0, seed=3))
    assert steep.as_dict()["slope"] == pytest.approx(0.006, abs=0.001)
    assert flat.as_dict()["slope"] is None
    uncorrected, constant, slope = steep.left_out
    assert slope < constant < uncorrected


def test_sampling_errors_are_no_scatter_of_rows() -> None:
    found = [discrepancy_of(_pairs(0.01, 0.0, 0.0, 0.02, seed)).scatter for seed in range(20)]
    assert np.mean(found) < 0.3 * 0.02 / 4**0.5


def test_one_pair_of_another_slot_keeps_its_weight() -> None:
    """A row whose engines part has a large error of its own, which must not silence it."""
    pairs = _pairs(0.0, 0.0, 0.0, 1e-4)
    for place in range(0, len(pairs), 8):
        dear = pairs[place].cheap.copy()
        dear[0] += 0.2 * dear.sum()
        pairs[place] = Pair(pairs[place].mismatch, pairs[place].cheap, dear)
    true = np.log(1.2) / 8
    value, error = discrepancy_of(pairs).at(np.array([50.0]))
    assert value[0] == pytest.approx(true, rel=0.3)
    assert abs(value[0] - true) < 2.0 * error[0]


def test_corrected_rows_have_the_times_of_the_engine_that_counts() -> None:
    data, found = made(20), discrepancy_of(_pairs(0.05, 0.01))
    rows = found.corrected(data)
    factor = np.exp(found.at(data.points[:, 0])[0])
    assert rows.column("mean_s") == pytest.approx(data.column("mean_s") * factor)
    assert rows.column("sd_s") == pytest.approx(data.column("sd_s") * factor)
    relative = rows.column("standard_error_s") / rows.column("mean_s")
    before = data.column("standard_error_s") / data.column("mean_s")
    assert relative**2 - before**2 == pytest.approx(found.scatter**2)
    assert (rows.column("shifts") == data.column("shifts")).all()


def test_no_pairs_are_refused() -> None:
    for few in ([], _pairs(0.01, 0.0)[: LEAST - 1]):
        with pytest.raises(InputError, match=f"has {len(few)} pairs .* at least {LEAST}"):
            discrepancy_of(few)


def test_rows_of_one_level_do_not_join_rows_of_two() -> None:
    one = made(12)
    two = one.__class__(
        one.variables, one.low, one.high, one.rows, one.physics, one.engine, {"planar": 96}
    )
    assert len(two.joined(two)) == len(two)
    with pytest.raises(DataError, match="different levels cannot be mixed"):
        one.joined(two)
