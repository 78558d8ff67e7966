"""The simulation against the published Adams table, at the same ten angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.adams import DENSE_ANGLES, deviations, free_flights, laws, ratios_without_skips
from dogshape.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.comparison import compare
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, MM, RPM

#: Root-mean-square deviation over all 25 cells. The mean of ten random angles
#: scatters by 10 to 25 % itself; the phase origin of the published angles is not given.
ALL_CELLS = 0.14
#: Largest deviation of one cell in standard errors of ten angles, or else its share.
ONE_CELL_SHARE = 0.26
#: Root-mean-square deviation over all angles, by the contact: 8.1 and 4.4 % in docs/proof.md, and
#: what other angles add, 1 to 2 %.
ALL_ANGLES = {"adams2019": 0.10, "adams_impact": 0.065}
#: Mean of the fast shifts that skip no slot over the table: the model's are too short.
UNHINDERED = {"adams2019": (0.86, 0.92), "adams_impact": (0.84, 0.90)}

#: Five single cases of the 2019 paper (Jasny, Hajzman, Achtenova, section "Simulation results",
#: figures 10 to 14 in this order): mismatch in 1/min, force in N, relative angle in degrees, and
#: whether the text has face meet face. Of the fifth it has "several contact occurrences" and a
#: time "relatively short".
CASES = (
    (50, 235.2, 0.0, False), (50, 235.2, 10.0, True), (50, 469.0, 0.0, False),
    (50, 469.0, 10.0, True), (149, 235.2, 0.0, None),
)  # fmt: skip
#: Where the model has it otherwise at the paper's angles: cases 1 and 3, whose faces graze.
GRAZED = (0, 2)
#: Way that grazing faces slide, m: 16 % of the pitch and a third of what faces slide that meet.
GRAZE = 1.6 * MM
#: The paper does not say where its zero is: with zero here all face contacts are as published, deg.
ORIGIN = 4.0
LAWS = ("adams2019, Drake", "adams2019", "adams_impact")


@pytest.fixture(scope="module")
def adams() -> Bench:
    return load_bench("mq200_adams")


def test_published_adams_table(adams: Bench) -> None:
    result = compare(adams, scratch_executor().run)
    assert len(result.differences) == 28
    compared = [d for d in result.differences if d.gap is not None]
    assert len(compared) == 25
    assert all(d.engaged == 1.0 for d in result.differences)
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


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("origin", [0.0, ORIGIN])
def test_five_single_cases_of_the_paper(adams: Bench, law: str, origin: float) -> None:
    """All engage; cases 2, 4 and 5 are as published at the paper's angles, 1 and 3 are not.

    There faces graze that do not meet in the paper. With zero four degrees on, all meet or miss as
    published, but the first case, "optimal" in the paper, then bounces on a flank.
    """
    clutch = adams.clutch if law == LAWS[0] else laws(adams)[law]
    points = {(round(c.point.mismatch / RPM), c.point.profile.force): c.point for c in adams.cells}
    found = [
        engage(clutch, points[speed, force], (angle + origin) * DEG)
        for speed, force, angle, _ in CASES
    ]
    assert all(one.outcome is Outcome.ENGAGED for one in found)
    for number, (one, (*_, meet)) in enumerate(zip(found, CASES, strict=True)):
        if meet is None:
            trace = one.trace
            touches = trace.contact_force > 0.5 + 0.01 * trace.shift_force
            assert (np.diff(touches.astype(int)) > 0).sum() > 1
        elif origin == 0.0 and number in GRAZED:
            assert 0.0 < one.events.face_slide < GRAZE
        else:
            assert (one.events.face_contacts > 0) is meet
            assert one.events.face_slide > 3.0 * GRAZE or not meet
    first, second, third, fourth, fifth = (one.shift_time or 0.0 for one in found)
    assert third < first < second
    assert third < fourth
    assert fifth < min(second, fourth)
    if origin == ORIGIN:
        assert found[0].events.rebound_travel > 0.05 * MM
        assert found[2].loads.peak_tangential_force > 0.0  # case 3: sides of teeth alone


@pytest.mark.parametrize("law", LAWS[1:])
def test_all_angles_and_the_fast_rows(adams: Bench, law: str) -> None:
    """Over all angles rows agree better than at the ten, and fast shifts without a miss do not."""
    clutch = laws(adams)[law]
    own = replace(adams, clutch=clutch)
    ten = compare(own, scratch_executor().run).relative_rms
    every = compare(own, scratch_executor().run, DENSE_ANGLES)
    assert every.relative_rms is not None
    assert ten is not None
    assert every.relative_rms < ALL_ANGLES[law] < ten
    for row in deviations(every).values():
        assert abs(sum(row) / len(row)) < 0.20
    short = ratios_without_skips(adams, clutch, clutch.shift_travel)
    least, most = UNHINDERED[law]
    assert len(short) == 12
    assert 0.80 < min(short) < max(short) < 1.0
    assert least < sum(short) / 12 < most


def test_fast_rows_are_twice_the_free_flight(adams: Bench) -> None:
    """The table alone: 1.95 +- 0.05 in all twelve cells, as if none of its shifts missed a slot."""
    ratios = free_flights(adams)
    assert len(ratios) == 12
    assert np.mean(ratios) == pytest.approx(1.952, abs=1e-3)
    assert np.std(ratios, ddof=1) == pytest.approx(0.052, abs=1e-3)
