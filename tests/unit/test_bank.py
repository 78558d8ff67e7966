"""The bank of simulations: read as written, of its own inputs alone, finished where it stopped."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.angle_cells import BISECTIONS
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.prediction.simulations import (
    ANGLES,
    DENSE_FACTOR,
    LINE_LEVELS,
    SimulatedTimes,
    levels_of,
    settings_of,
    simulate,
)
from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.diagnose.bank import TICK, Bank, series_key
from dogshape.pipeline.diagnose.bank_diagnosis import BUNDLED_BANK, TIMES, BankOptions, models_of
from dogshape.pipeline.store.folder import ShiftJournal
from dogshape.sim import versions
from dogshape.sim.effects import load
from dogshape.sim.errors import StorageError
from dogshape.sim.statistics.blocks import Block, Runner
from dogshape.sim.statistics.shift_records import Record
from tests.analytic import AnalyticShifts, select_cells, simulate_analytic

EFFECTS = load()
POINTS = [(10, 235.2), (50, 469.0)]
BENCH = select_cells(load_bench("mq200_adams"), POINTS)


def _simulated(
    store: Bank | None, *names: str, bench: Bench = BENCH, run: Runner = simulate_analytic
) -> SimulatedTimes:
    few = {name: EFFECTS[name] for name in names}
    settings = settings_of(bench, "sleeve")
    if store is None:
        return simulate(few, settings, run)
    return simulate(few, settings, lambda blocks: store.times(blocks, run))


def _never(blocks: Sequence[Block]) -> list[list[Record]]:
    assert not blocks, f"{len(blocks)} blocks are simulated again"
    return []


def test_a_bank_is_read_back_as_it_was_and_only_for_what_it_is_of(tmp_path: Path) -> None:
    path, names = tmp_path / TIMES, ("moving_mass", "sleeve_friction")
    late = replace(BENCH, clutch=replace(BENCH.clutch, timeout=0.15))
    first = _simulated(Bank([path]), *names, bench=late)
    assert np.isinf(first.times).any()
    again = _simulated(Bank([path]), *names, bench=late, run=_never)
    assert again.levels == first.levels
    for name in ("angles", "level_angles"):
        assert np.array_equal(getattr(first, name), getattr(again, name))
    for name in ("baseline_times", "times"):
        assert getattr(again, name) == pytest.approx(getattr(first, name), abs=TICK)
    with pytest.raises(AssertionError):
        _simulated(Bank([path]), *names, run=_never)


def test_a_new_version_of_the_package_keeps_the_bank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the physics, or of Drake, it does not."""
    block = Block(BENCH.clutch, BENCH.cells[0].point, (0.0, 0.1))
    key = series_key(block)
    installed = {**versions.versions(), "dogshape": "9.9.9"}
    monkeypatch.setattr(versions, "versions", lambda: installed)
    assert series_key(block) == key
    monkeypatch.setattr(versions, "versions", lambda: {**installed, "drake": "9.9.9"})
    assert series_key(block) != key
    monkeypatch.undo()
    monkeypatch.setattr(versions, "PHYSICS_VERSION", "9.9.9")
    assert series_key(block) != key


def test_a_bank_takes_what_is_there_and_simulates_the_rest(tmp_path: Path) -> None:
    path, mine = tmp_path / TIMES, tmp_path / "mine.jsonl"
    _simulated(Bank([path]), "moving_mass")
    one = replace(BENCH, cells=BENCH.cells[1:])
    fewer = _simulated(Bank([path]), "moving_mass", bench=one, run=_never)
    assert fewer.times.shape == (LINE_LEVELS, 1, ANGLES)
    asked: list[Block] = []

    def counted(blocks: Sequence[Block]) -> list[list[Record]]:
        asked.extend(blocks)
        return simulate_analytic(blocks)

    names = ("moving_mass", "sleeve_friction")
    found = _simulated(Bank([path, mine]), *names, run=counted)
    assert {block.clutch.mechanism.friction > 0.0 for block in asked} <= {True, False}
    assert len(asked) == len(Bank([mine]).series)
    assert found.times == pytest.approx(_simulated(None, *names).times, abs=TICK)


def test_a_broken_bank_is_named(tmp_path: Path) -> None:
    path = tmp_path / TIMES
    for text in ("{", "[]", json.dumps({"key": "a", "t": 1})):
        path.write_text(text + "\n")
        with pytest.raises(StorageError, match=r"bank\.jsonl, line 1 is not a series of shifts"):
            Bank([path])
    with pytest.raises(StorageError, match="cannot be written"):
        _simulated(Bank([tmp_path / "none" / TIMES]), "moving_mass")


def test_all_levels_share_the_angles_of_their_point_and_span_the_range() -> None:
    found = _simulated(None, "moving_mass")
    assert found.baseline_times.shape == (2, DENSE_FACTOR * ANGLES)
    shared = np.take_along_axis(found.angles, found.level_angles, axis=1)
    assert np.diff(shared) == pytest.approx(BENCH.clutch.dog.pitch_angle / ANGLES)
    settings = settings_of(BENCH, "sleeve")
    values = [level.values[0] for level in levels_of(EFFECTS["moving_mass"], settings)]
    (mass,) = EFFECTS["moving_mass"].parameters
    assert (values[0], values[-1]) == pytest.approx((mass.low, mass.high))
    assert len(values) == LINE_LEVELS


@pytest.mark.parametrize("name", ["mq200_stand", "mq200_adams"])
@pytest.mark.parametrize("place", ["sleeve", "actuator", "unknown"])
def test_the_bundled_bank_has_every_series_of_the_compiled_engine(name: str, place: str) -> None:
    """Read at the sleeve or at the actuator, the series are the same."""
    bench = load_bench(name)
    record = bench.record.model_copy(update={"displacement_at": place})
    quick = replace(bench, clutch=bench.clutch.with_engine("planar"), record=record)
    store = Bank([BUNDLED_BANK])
    build_models(quick, EFFECTS, USUAL, lambda blocks: store.times(blocks, _never))


FEW = {name: EFFECTS[name] for name in ("moving_mass", "sleeve_friction")}


def _bench(points: int = 1, timeout: float = 1.1) -> Bench:
    """Return some points of a clutch that the package brings no bank of."""
    bench = select_cells(load_bench("mq200_adams"), POINTS[:points])
    return replace(bench, clutch=replace(bench.clutch, timeout=timeout))


def _model(folder: Path, bench: Bench) -> Model:
    (found,) = models_of(bench, FEW, BankOptions(folder, jobs=1)).values()
    return found


def _rows(folder: Path) -> list[Record]:
    return list(ShiftJournal(folder / "shifts.jsonl").rows.values())


def _same(one: Model, other: Model) -> bool:
    pairs = (one.baseline.simulated, other.baseline.simulated)
    return all(np.array_equal(*(getattr(p, n) for p in pairs)) for n in ("times", "baseline_times"))


def test_an_unfinished_bank_stays_whole_beside_a_finished_one(
    tmp_path: Path, quick: AnalyticShifts
) -> None:
    whole = _model(tmp_path / "whole", _bench())
    bisected_count = quick.done - 48 - whole.baseline.simulated.times.size
    assert bisected_count > 0
    assert bisected_count % BISECTIONS == 0
    assert _rows(tmp_path / "whole") == []
    done, quick.done, quick.stop = quick.done, 0, 100
    with pytest.raises(KeyboardInterrupt):
        _model(tmp_path / "stopped", _bench())
    quick.stop = None
    stopped = {row["key"] for row in _rows(tmp_path / "stopped")}
    assert len(stopped) == 100
    _model(tmp_path / "stopped", _bench(timeout=1.2))
    assert stopped == {row["key"] for row in _rows(tmp_path / "stopped")}
    quick.done = 100
    assert _same(_model(tmp_path / "stopped", _bench()), whole)
    assert quick.done == done


def test_a_kill_after_the_file_of_banks_loses_nothing(
    tmp_path: Path, quick: AnalyticShifts, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise SystemExit(9)

    with monkeypatch.context() as patch:
        patch.setattr(ShiftJournal, "drop", killed)
        with pytest.raises(SystemExit):
            _model(tmp_path, _bench())
    assert len(_rows(tmp_path)) == quick.done
    _model(tmp_path, _bench())
    done, quick.done = quick.done, 0
    _model(tmp_path / "whole", _bench())
    assert quick.done == done


def test_two_runs_write_to_a_bank_at_once(tmp_path: Path, quick: AnalyticShifts) -> None:
    """The second run begins before the first has written its series."""
    first = Bank([tmp_path / TIMES])
    second = Bank([tmp_path / TIMES])
    names = ("moving_mass", "sleeve_friction")
    times = [_simulated(bank, *names).times for bank in (first, second)]
    read_times = _simulated(Bank([tmp_path / TIMES]), *names, run=_never).times
    assert np.array_equal(times[0], times[1])
    assert np.array_equal(read_times, times[0])
