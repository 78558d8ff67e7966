"""Agreement of the compiled engine with Drake: the rule, the audit's draw and the exit status."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.engine_audit import agreement_of, audit
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.study import require_agreement
from dogshape.sim.errors import EngineError
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record


def _row(time: float | None) -> Record:
    return {"outcome": "engaged" if time else "timed_out", "shift_time_s": time}


def _pairs(count: int, apart: Callable[[int], float]) -> list[tuple[Record, Record]]:
    return [(_row(0.1 + apart(k)), _row(0.1)) for k in range(count)]


def test_figures_are_those_of_the_pairs() -> None:
    found = agreement_of([*_pairs(99, lambda k: 1e-4 * (k % 3)), (_row(None), _row(0.2))])
    assert (found.shifts, found.outcome_same) == (100, 99)
    assert found.mean_deviation == found.median_deviation == pytest.approx(1e-3)
    assert found.worst_deviation == pytest.approx(2e-3)
    spread = np.std([0.0, 1e-3, 2e-3] * 33, ddof=1)
    assert found.standard_error == pytest.approx(spread / 99**0.5)
    assert found.agrees
    assert agreement_of([(_row(None), _row(None))] * 4).agrees


@pytest.mark.parametrize(
    ("shifts", "flips", "agrees"), [(200, 6, True), (200, 7, False), (6, 1, True), (6, 2, False)]
)
def test_as_many_shifts_may_end_differently(shifts: int, flips: int, agrees: bool) -> None:
    pairs = [(_row(None), _row(0.1))] * flips + _pairs(shifts - flips, lambda _: 0.0)
    assert agreement_of(pairs).agrees is agrees


@pytest.mark.parametrize(
    ("off", "scatter", "agrees"),
    [(9.9e-4, 0.0, True), (-1.1e-3, 0.0, False), (-1.1e-3, 8e-3, True), (5e-3, 8e-3, False)],
)
def test_means_may_differ_by_so_much(off: float, scatter: float, agrees: bool) -> None:
    """By a hundredth of Drake's mean, or by three standard errors."""
    assert agreement_of(_pairs(100, lambda k: off + scatter * (-1.0) ** k)).agrees is agrees


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float, float]]:
    """Engine, mismatch and angle of the shifts that are made up, Drake's a millisecond longer."""
    found: list[tuple[str, float, float]] = []

    def made_up(block: Block) -> Iterator[Record]:
        drake = block.clutch.solver.engine == "drake"
        for key, given in zip(block.keys, block.inputs, strict=True):
            place = given["mismatch_rpm"], given["relative_angle_deg"]
            found.append((block.clutch.solver.engine, *place))
            yield {"key": key, **given, **_row(0.1 + 1e-3 * drake), "seed": block.seed}

    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", made_up)
    return found


def test_an_audit_simulates_the_same_shifts_in_both_engines(
    small_study: Setup, simulated: list[tuple[str, float, float]]
) -> None:
    study = small_study.search_setup
    designs, said = [study.prototype, {**study.prototype, "height_mm": 3.5}], list[str]()
    found = audit(study, designs, scratch_executor(1), 8, said.append)
    assert found is not None
    assert found.shifts == 8
    assert said == ["auditing 8 shifts of the search in Drake", found.text]
    assert found.mean_deviation == pytest.approx(-0.001 / 0.101)
    by_engine = {
        engine: [row[1:] for row in simulated if row[0] == engine] for engine, *_ in simulated
    }
    assert sorted(by_engine["planar"]) == sorted(by_engine["drake"])
    assert audit(study, designs, scratch_executor(1), 8, said.append) == found
    # No more than there are: two designs at two points of three angles.
    every = audit(study, designs, scratch_executor(1), 99, said.append)
    assert every is not None
    assert every.shifts == 12


def test_engines_that_do_not_agree_end_a_study_with_a_sentence(small_study: Setup) -> None:
    require_agreement(small_study, agreement_of(_pairs(200, lambda _: 0.0)))
    pairs = [(_row(None), _row(0.1))] * 90 + _pairs(110, lambda _: 0.0)
    with pytest.raises(EngineError, match=r"110 of 200 shifts end as in Drake.*solver\.engine"):
        require_agreement(small_study, agreement_of(pairs))
