"""Outcomes of advised tests by the truth of a case."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench, setting_of
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.sim.effects import load
from dogshape.validation.blind import advised_test
from dogshape.validation.blind.advised_test import judged_by_test, outcome_of, readings_of
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.data import expected
from dogshape.validation.blind.field_set import base
from dogshape.validation.blind.stand import read_points, read_stand

BENCH, EFFECTS = load_bench(base("prototype")), load(None)
DIAGNOSIS: Any = SimpleNamespace(
    bench=BENCH,
    effects=EFFECTS,
    settings=SimpleNamespace(named=0.8, test_error=0.02),
    model=SimpleNamespace(setting=setting_of(BENCH)),
    flights=SimpleNamespace(marks=None),
)
MASS = Case("single", "means", "planar", "prototype", 3, {"moving_mass": {"added_mass_kg": 1.0}})


def _direct(*effects: str) -> NextTest:
    names = tuple(p.name for e in effects for p in EFFECTS[e].parameters or [EFFECTS[e]])
    return NextTest("look", "Look.", "direct", 1.0, effects, names, information=1.0, settles=0.6)


def test_direct_tests_read_the_truth_as_shares_of_the_ranges() -> None:
    test = _direct("moving_mass", "reversed_mismatch", "actuation_delay")
    share = EFFECTS["moving_mass"].parameters[0].share(1.0)
    assert readings_of(MASS, DIAGNOSIS, test) == pytest.approx([share, 0.0, 0.0])
    both = replace(MASS, parameters={**MASS.parameters, "reversed_mismatch": {}})
    assert readings_of(both, DIAGNOSIS, test)[1] == 1.0
    drawn = [outcome_of(Path(), replace(MASS, seed=k), DIAGNOSIS, test) for k in range(300)]
    assert np.std(np.array(drawn)[:, 0]) == pytest.approx(0.02, rel=0.15)


def test_more_shifts_have_the_mean_that_the_engine_expects() -> None:
    cell = BENCH.cells[20].point
    place = cell.mismatch, cell.profile.force
    test = NextTest("more", "Shift.", "shifts", 1.0, cell=20, point=place, shifts=120)
    folder = base("prototype")
    mean, engaged = outcome_of(folder, MASS, DIAGNOSIS, test)
    exact = expected("planar", read_stand(folder), [read_points(folder)[20]], MASS.truth)
    assert mean == pytest.approx(exact.mean[0], abs=4.0 * exact.sd[0] / 120**0.5)
    assert engaged == 1.0


@pytest.mark.parametrize(
    ("after", "settled", "misled"),
    [
        ({("moving_mass",): 0.9, (): 0.1}, True, False),
        ({(): 0.9, ("moving_mass",): 0.1}, False, False),
        ({("detent_force",): 0.9, ("moving_mass",): 0.1}, False, True),
        ({("detent_force",): 0.6, ("moving_mass",): 0.4}, False, False),
    ],
)
def test_a_test_settles_on_the_truth_or_misleads(
    after: Any, settled: bool, misled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(advised_test, "settle", lambda *_: after)
    diagnosis = SimpleNamespace(**{**vars(DIAGNOSIS), "tests": [_direct("moving_mass")]})
    found = judged_by_test(Path(), MASS, diagnosis, [("moving_mass",)])  # type: ignore[arg-type]
    assert found is not None
    assert (found.settled, found.misled, found.foreseen) == (settled, misled, 0.6)
