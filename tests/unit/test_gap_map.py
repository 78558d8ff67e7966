"""Where a gap is: its sentence and map; sizes at an end of their range."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dogshape.bench.bench_data import Cell, Reading
from dogshape.diagnosis.comparison import PointGap
from dogshape.diagnosis.gap_map import describe_gaps, group_values, map_gaps
from dogshape.diagnosis.range_ends import find_end
from dogshape.diagnosis.settings import USUAL
from dogshape.sim.effect import Parameter
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM

MISMATCHES = (10.0, 50.0, 100.0, 249.0)  #: 1/min
FORCES = (235.2, 469.0, 641.5)  #: N
ERROR_S = 0.01
Gap = Callable[[float, float], float | None]  #: s, of mismatch in 1/min and force in N


def _gaps(gap: Gap) -> list[PointGap]:
    """Make gaps over a grid of operating points."""
    gaps = []
    for mismatch in MISMATCHES:
        for force in FORCES:
            point = OperatingPoint(mismatch * RPM, ForceProfile(force, 0.1))
            size = gap(mismatch, force)
            time = None if size is None else 0.2 + size
            cell = Cell(point, (Reading(2, point, 10, time, engaged=True),))
            gaps.append(PointGap(cell, 0.2, ERROR_S))
    return gaps


@pytest.mark.parametrize(
    ("gap", "start"),
    [
        (lambda *_: 0.01, "The bench is within the error at all 12 points; largest at "),
        (lambda m, f: 0.03 + 1e-4 * m, "The bench is slower by 31 to 55 ms at all 12 points; "),
        (
            lambda m, f: 0.04 + 1e-4 * m if m >= 50.0 else 0.0,
            "The bench is slower by 45 to 65 ms from 50 1/min on, within the error below; "
            "largest at 249 1/min and 235.2 N: +65 ms, 6.5 standard errors.",
        ),
        (
            lambda m, f: 0.04 if f < 400.0 else -0.03,
            "The bench is faster by 30 ms from 469 N on, slower by 40 ms below; ",
        ),
        (
            lambda m, f: -0.04 if m < 100.0 and (m, f) != (10.0, 469.0) else 0.0,
            "The bench is faster by 40 ms below 100 1/min at 5 of 6 points, within the error above",
        ),
        (
            lambda m, f: 0.05 * (-1.0) ** (MISMATCHES.index(m) + FORCES.index(f)),
            "The bench is slower at 6, faster at 6, within the error at 0 of 12 points; ",
        ),
    ],
    ids=("nowhere", "everywhere", "from", "both signs", "below", "no pattern"),
)
def test_a_sentence_says_where(gap: Gap, start: str) -> None:
    assert describe_gaps(_gaps(gap)).startswith(start)


def test_points_without_a_time_are_left_out() -> None:
    gaps = _gaps(lambda m, f: None if m == 10.0 else 0.03)
    assert describe_gaps(gaps).startswith("The bench is slower by 30 ms at all 9 points")
    gap_map = map_gaps(gaps, columns=4, rows=3)
    assert [group.low for group in gap_map.mismatches] == [50.0, 100.0, 249.0]
    nothing = describe_gaps(_gaps(lambda *_: None))
    assert nothing == "No operating point has a time of bench and simulation."


def test_a_map_averages_neighbours_by_their_errors() -> None:
    """50 and 100 1/min are nearest by their ratio; two equal errors leave 1 over root 2."""
    gap_map = map_gaps(_gaps(lambda m, f: 1e-4 * m), columns=3, rows=3)
    assert [group.label for group in gap_map.mismatches] == ["10", "50 to 100", "249"]
    assert [group.label for group in gap_map.forces] == ["235.2", "469", "641.5"]
    cell = gap_map.cells[0, 1]
    assert cell.gap == pytest.approx(0.0075)
    assert cell.standard_error == pytest.approx(ERROR_S / 2.0**0.5)
    assert cell.z == pytest.approx(0.75 * 2.0**0.5)


def test_values_of_both_signs_are_grouped_apart() -> None:
    groups = group_values(np.array([-50.0, -49.0, 0.0, 49.0, 50.0]), 3)
    assert [(group.low, group.high) for group in groups] == [
        (-50.0, -49.0),
        (0.0, 0.0),
        (49.0, 50.0),
    ]


FACTOR = Parameter("factor", neutral=1.0, low=0.75, high=1.25, scale="uniform", least=0.1)
SIZE = Parameter("size_N", neutral=0.0, low=1.0, high=100.0, scale="log-uniform")


@pytest.mark.parametrize(
    ("parameter", "centre", "sd", "end"),
    [
        (FACTOR, 0.6, 0.03, "low"),  # the truth lies beyond the end
        (FACTOR, 1.4, 0.03, "high"),
        (FACTOR, 0.75, 0.02, "low"),
        (FACTOR, 0.80, 0.02, None),  # near the end, and seen to be off it
        (FACTOR, 1.0, 5.0, None),  # the data say nothing
        (SIZE, 300.0, 30.0, "high"),
        (SIZE, 0.5, 0.3, None),  # towards no effect
    ],
)
def test_draws_that_pile_up_at_an_end(
    parameter: Parameter, centre: float, sd: float, end: str | None
) -> None:
    """A uniform prior of the value, and a normal likelihood."""
    values = np.linspace(parameter.low, parameter.high, 4001)
    weights = np.exp(
        -0.5 * ((values - centre) / sd) ** 2 + 0.5 * ((values - centre) / sd).min() ** 2
    )
    weights /= weights.sum()
    draws = np.random.default_rng(1).choice(values, size=400, p=weights)
    assert find_end(parameter, draws, parameter.neutral_of(None), USUAL) == end  # type: ignore[arg-type]


def test_a_limit_of_possible_values_is_no_end() -> None:
    share = Parameter("share", neutral=0.5, low=0.1, high=1.0, scale="uniform", most=1.0)
    draws = np.random.default_rng(1).uniform(0.97, 1.0, 400)
    assert find_end(share, draws, 0.5, USUAL) is None
