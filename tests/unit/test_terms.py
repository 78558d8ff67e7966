"""The gap at an operating point and its error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Reading, load_bench
from dogshape.diagnosis.bench.comparison import compare
from dogshape.diagnosis.bench.stand_file import NominalErrors, Tolerance
from tests.made_up import few_cells, made_up


def test_single_readings_that_scatter_more_than_the_simulation_count() -> None:
    """Five readings of a long tail that no simulated angle shows."""
    bench = few_cells(load_bench("mq200_adams"), [(100, 235.2)])
    (cell,) = bench.cells
    times = [0.07, 0.08, 0.09, 0.1, 0.26]
    single = tuple(Reading(k, cell.point, 1, time, True) for k, time in enumerate(times, 2))
    alone = replace(bench, cells=(replace(cell, readings=single),))
    (mean,) = compare(bench, made_up, 8).differences
    (found,) = compare(alone, made_up, 8).differences
    own = np.std(times, ddof=1) / np.sqrt(5)
    assert found.simulated.sd < np.std(times)
    assert found.standard_error == pytest.approx(np.hypot(found.simulated.standard_error, own))
    assert mean.standard_error < found.standard_error
    told = (
        Reading(2, cell.point, 5, float(np.mean(times)), True, sd=float(np.std(times, ddof=1))),
    )
    (beside,) = compare(
        replace(bench, cells=(replace(cell, readings=told),)), made_up, 8
    ).differences
    assert beside.standard_error == pytest.approx(found.standard_error)


def test_errors_of_nominal_values_join_those_of_the_gaps() -> None:
    bench = few_cells(
        load_bench("mq200_adams"), [(n, f) for n in (50, 100) for f in (235.2, 641.5)]
    )
    size = Tolerance(force_percent=2.0, mismatch_rpm=2.0)
    errors = {
        "none": NominalErrors(),
        "one": NominalErrors(systematic=size),
        "both": NominalErrors(systematic=size, each_point=size),
        "force": NominalErrors(each_point=Tolerance(force_percent=2.0)),
        "mismatch": NominalErrors(each_point=Tolerance(mismatch_rpm=2.0)),
    }
    squares = {
        name: np.array(
            [d.standard_error**2 for d in compare(replace(bench, errors=e), made_up, 8).differences]
        )
        for name, e in errors.items()
    }
    more = {name: one - squares["none"] for name, one in squares.items()}
    assert (more["force"] > 0.0).all()
    assert (more["mismatch"] > 0.0).all()
    assert more["one"] == pytest.approx(more["force"] + more["mismatch"])
    assert more["both"] == pytest.approx(2.0 * more["one"])
