"""Cost of bench tests at a stand, and tests that it cannot do: the advice takes both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.stand_file import TestTerms
from dogshape.diagnosis.inference.outcome import SHIFT, NextTest
from dogshape.diagnosis.next_test import choose, require_terms
from dogshape.sim.errors import DataError, InputError
from tests.benches import good_set
from tests.fits import BENCH, diagnosis_of, fit_of
from tests.toy import EFFECTS

FORCE, RUN_DOWN = EFFECTS["actuation_delay"].test.name, EFFECTS["drag_torque"].test.name
DELAY, DRAG = ("actuation_delay",), ("drag_torque",)


def _tests(*terms: TestTerms) -> tuple[NextTest, ...]:
    shares = np.linspace(0.3, 0.7, 64)[:, None]
    fits: Any = {h: fit_of(h, shares) for h in (DELAY, DRAG)}
    return choose(diagnosis_of({DELAY: 0.5, DRAG: 0.5}, fits, replace(BENCH, tests=terms)))


def test_hours_are_those_of_the_stand() -> None:
    found = _tests(TestTerms(name=FORCE, hours=7.0), TestTerms(name="more shifts", hours=3.0))
    hours = {test.name: test.hours for test in found}
    assert hours[FORCE] == 7.0
    ten = next(test for test in found if test.shifts == 10)
    assert ten.hours == pytest.approx(3.0 + 10 * SHIFT)


def test_terms_are_keys_of_the_data_set_and_mistakes_are_sentences(tmp_path: Path) -> None:
    folder = good_set(tmp_path, traces=False)
    head = folder / "bench.toml"
    text = head.read_text()

    def reads(terms: str) -> object:
        head.write_text(text + f"\n[[tests]]\n{terms}\n")
        bench = load_bench(folder)
        require_terms(bench, EFFECTS)
        return bench.tests

    assert reads('name = "traces"\npossible = false') == (
        TestTerms(name="traces", hours=None, possible=False),
    )
    with pytest.raises(DataError, match=r"is no bench test; did you mean 'more shifts'"):
        reads('name = "more shift"')
    with pytest.raises(InputError, match=r"tests.0.hours is -1.0, but it must be above 0"):
        reads('name = "traces"\nhours = -1.0')
    none = "\n[[tests]]\n".join(
        f'name = "{name}"\npossible = false'
        for name in {"more shifts", *(effect.test.name for effect in EFFECTS.values())}
    )
    with pytest.raises(DataError, match="leaves no bench test that is possible"):
        reads(none)
