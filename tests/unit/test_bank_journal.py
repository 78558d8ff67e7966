"""The journal of banks: it keeps what is unfinished, and nothing is simulated twice."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.model import Model
from dogshape.pipeline.diagnose import bank_diagnosis
from dogshape.pipeline.diagnose.bank_diagnosis import Means, models_of
from dogshape.pipeline.store import journal as journals
from dogshape.pipeline.store.journal import ShiftJournal, append
from dogshape.sim.effects import load
from dogshape.sim.errors import StorageError
from dogshape.sim.files import writing
from dogshape.sim.statistics.shift_records import Record
from tests.made_up import Quick, few_cells

EFFECTS = {name: load()[name] for name in ("moving_mass", "sleeve_friction")}
POINTS = [(10, 235.2), (50, 469.0)]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> Quick:
    shifts = Quick()
    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", shifts)
    return shifts


def _bench(points: int = 1, timeout: float = 1.1) -> Bench:
    """Return some points of a clutch that the package brings no bank of."""
    bench = few_cells(load_bench("mq200_adams"), POINTS[:points])
    return replace(bench, clutch=replace(bench.clutch, timeout=timeout))


def _model(folder: Path, bench: Bench) -> Model:
    (found,) = models_of(bench, EFFECTS, Means(folder, jobs=1)).values()
    return found


def _rows(folder: Path) -> list[Record]:
    return list(ShiftJournal(folder / "shifts.jsonl", only_read=True).rows.values())


def _same(one: Model, other: Model) -> bool:
    pairs = (one.simulated, other.simulated)
    return all(np.array_equal(*(getattr(p, n) for p in pairs)) for n in ("times", "baseline"))


def test_what_the_file_of_banks_has_leaves_the_journal(tmp_path: Path, quick: Quick) -> None:
    first, done = _model(tmp_path, _bench()), quick.done
    assert done == 48 + first.simulated.times.size
    assert _rows(tmp_path) == []
    assert _same(_model(tmp_path, _bench()), first)
    assert quick.done == done


def test_another_operating_point_repeats_nothing(tmp_path: Path, quick: Quick) -> None:
    _model(tmp_path / "whole", _bench(2))
    done, quick.done = quick.done, 0
    _model(tmp_path / "now", _bench(1))
    _model(tmp_path / "now", _bench(2))
    assert quick.done == done


def test_an_unfinished_bank_stays_whole_beside_a_finished_one(tmp_path: Path, quick: Quick) -> None:
    whole = _model(tmp_path / "whole", _bench())
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


@pytest.mark.parametrize("where", ["before the journal is touched", "while it is exchanged"])
def test_a_kill_after_the_file_of_banks_loses_nothing(
    tmp_path: Path, quick: Quick, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    def killed(*_: object) -> None:
        raise SystemExit(9)

    with monkeypatch.context() as patch:
        if where == "while it is exchanged":
            patch.setattr(journals, "write_whole", killed)
        else:
            patch.setattr(ShiftJournal, "drop", killed)
        with pytest.raises(SystemExit):
            _model(tmp_path, _bench())
    done = quick.done
    assert len(_rows(tmp_path)) == done
    _model(tmp_path, _bench())
    assert quick.done == done


def test_a_disk_that_refuses_the_shorter_journal_costs_no_bank(
    tmp_path: Path, quick: Quick, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(journals, "write_whole", full)
    assert _model(tmp_path, _bench()).simulated.levels
    assert len(_rows(tmp_path)) == quick.done


def test_what_another_run_finished_before_the_folder_was_held_is_not_simulated_again(
    tmp_path: Path, quick: Quick, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def late(folder: Path, patience: float) -> Iterator[None]:
        monkeypatch.setattr(bank_diagnosis, "writing", writing)
        _model(tmp_path, _bench())
        with writing(folder, patience):
            yield

    monkeypatch.setattr(bank_diagnosis, "writing", late)
    found = _model(tmp_path, _bench())
    done, quick.done = quick.done, 0
    assert _same(_model(tmp_path / "alone", _bench()), found)
    assert quick.done == done


def test_a_patient_run_waits_for_a_folder_and_another_says_that_it_is_in_use(
    tmp_path: Path,
) -> None:
    order: list[str] = []

    def wait() -> None:
        with writing(tmp_path, 30.0):
            order.append("second")

    with writing(tmp_path):
        with pytest.raises(StorageError, match="is in use by another run"), writing(tmp_path):
            order.append("never")
        other = threading.Thread(target=wait)
        other.start()
        time.sleep(0.3)
        order.append("first")
    other.join(timeout=10.0)
    assert order == ["first", "second"]


def test_a_row_that_another_process_writes_meanwhile_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It waits with the file that is exchanged, and then takes the new one."""
    path = tmp_path / "shifts.jsonl"
    row = {"key": "a", "outcome": "engaged", "shift_time_s": 0.1, "landing_loads_N_mm": [0.0]}
    append(path, row, {**row, "key": "b"})
    journal = ShiftJournal(path)
    other = threading.Thread(target=append, args=(path, {**row, "key": "c"}))
    whole = journals.write_whole

    def slow(where: Path, content: bytes) -> None:
        other.start()
        time.sleep(0.2)
        assert other.is_alive(), "it has to wait for the lock"
        whole(where, content)

    monkeypatch.setattr(journals, "write_whole", slow)
    journal.drop({"a"})
    other.join(timeout=10.0)
    assert list(journal.rows) == ["b"]
    assert list(ShiftJournal(path).rows) == ["b", "c"]


def test_a_torn_line_goes_with_the_others(tmp_path: Path) -> None:
    path = tmp_path / "shifts.jsonl"
    row = {"key": "a", "outcome": "engaged", "shift_time_s": 0.1, "landing_loads_N_mm": [0.0]}
    append(path, row, {**row, "key": "b"})
    journal = ShiftJournal(path)
    with path.open("a") as file:
        file.write('{"key": "c", "outc')
    journal.drop({"b"})
    append(path, {**row, "key": "d"})
    assert [json.loads(line)["key"] for line in path.read_text().splitlines()] == ["a", "d"]
