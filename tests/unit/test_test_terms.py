"""Cost of bench tests at a stand, and tests that it cannot do: the advice takes both."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.stand_file import TestTerms
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.next_test import SHIFT, require_terms
from dogshape.sim.errors import DataError, InputError
from tests.benches import good_set
from tests.toy import EFFECTS, Toy, bench_of, points_of

POINTS = points_of((235.2, 641.5))
NAMES = ("actuation_delay", "sleeve_friction", "moving_mass")
FORCE = EFFECTS["actuation_delay"].test.name
WAVE = 0.04 * np.sin(1.3 * np.arange(len(POINTS)))


def _found(*terms: TestTerms, wave: bool = False) -> Diagnosis:
    extra = WAVE if wave else None
    bench = bench_of(
        {"delay_s": 0.08}, np.random.default_rng(1), shifts=20, points=POINTS, extra=extra
    )
    few = {name: EFFECTS[name] for name in NAMES}
    return diagnose(replace(bench, tests=terms), Toy(POINTS), few, pairs=[])


def test_a_test_that_cannot_be_done_is_not_advised() -> None:
    assert FORCE in {test.name for test in _found().tests}
    without = _found(TestTerms(FORCE, possible=False))
    assert FORCE not in {test.name for test in without.tests}
    direct = _found(TestTerms("more shifts", possible=False))
    assert {test.asked.kind for test in direct.tests} == {"direct"}
    assert _found(wave=True).tests[0].asked.kind == "traces"
    blind = _found(TestTerms("traces", possible=False), wave=True)
    assert "traces" not in {test.asked.kind for test in blind.tests}
    # Nothing else of the answer depends on the terms.
    assert without.posterior == _found().posterior


def test_hours_are_those_of_the_stand() -> None:
    found = _found(TestTerms(FORCE, 7.0), TestTerms("more shifts", 3.0))
    hours = {test.name: test.hours for test in found.tests}
    assert hours[FORCE] == 7.0
    ten = next(test for test in found.tests if test.asked.shifts == 10)
    assert ten.hours == pytest.approx(3.0 + 10 * SHIFT)


def test_a_dear_test_yields_to_a_cheap_one() -> None:
    """Where the cause is open each hour costs some chance to settle it."""
    some = POINTS[:2]
    bench = bench_of({"delay_s": 0.01}, np.random.default_rng(1), shifts=2, points=some)
    few = {name: EFFECTS[name] for name in NAMES}
    plain = diagnose(bench, Toy(some), few, pairs=[])
    first = plain.tests[0]
    name = "more shifts" if first.asked.kind == "shifts" else first.name
    dear = diagnose(replace(bench, tests=(TestTerms(name, 100.0),)), Toy(some), few, pairs=[])
    assert plain.verdict.kind == "ambiguous"
    assert dear.tests[0].name != first.name
    assert dear.tests[-1].hours >= 100.0


def test_terms_are_keys_of_the_data_set_and_mistakes_are_sentences(tmp_path: Path) -> None:
    folder = good_set(tmp_path, traces=False)
    head = folder / "bench.toml"
    text = head.read_text()

    def reads(terms: str) -> object:
        head.write_text(text + f"\n[[tests]]\n{terms}\n")
        bench = load_bench(folder)
        require_terms(bench, EFFECTS)
        return bench.tests

    assert reads(f'name = "{FORCE}"\nhours = 5.0') == (TestTerms(FORCE, 5.0, True),)
    assert reads('name = "traces"\npossible = false') == (TestTerms("traces", None, False),)
    with pytest.raises(DataError, match=r"is no bench test; did you mean 'more shifts'"):
        reads('name = "more shift"')
    with pytest.raises(DataError, match="hours of the test 'traces' is -1 h, but"):
        reads('name = "traces"\nhours = -1.0')
    with pytest.raises(InputError, match="possible"):
        reads('name = "traces"\npossible = "no"')
    none = "\n[[tests]]\n".join(
        f'name = "{name}"\npossible = false'
        for name in {"more shifts", *(effect.test.name for effect in EFFECTS.values())}
    )
    with pytest.raises(DataError, match="leaves no bench test that is possible"):
        reads(none)
    shutil.rmtree(folder)
