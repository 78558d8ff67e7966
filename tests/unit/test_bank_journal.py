"""The journal of banks: it keeps what is unfinished, and nothing is simulated twice."""

from __future__ import annotations

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
from dogshape.pipeline.store.folder import ShiftJournal
from dogshape.sim.effects import load
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
    return list(ShiftJournal(folder / "shifts.jsonl").rows.values())


def _same(one: Model, other: Model) -> bool:
    pairs = (one.simulated, other.simulated)
    return all(np.array_equal(*(getattr(p, n) for p in pairs)) for n in ("times", "baseline"))


def test_what_the_file_of_banks_has_leaves_the_journal(tmp_path: Path, quick: Quick) -> None:
    first, done = _model(tmp_path, _bench()), quick.done
    assert done == 48 + first.simulated.times.size
    assert _rows(tmp_path) == []
    assert _same(_model(tmp_path, _bench()), first)
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


def test_a_kill_after_the_file_of_banks_loses_nothing(
    tmp_path: Path, quick: Quick, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise SystemExit(9)

    with monkeypatch.context() as patch:
        patch.setattr(ShiftJournal, "drop", killed)
        with pytest.raises(SystemExit):
            _model(tmp_path, _bench())
    done = quick.done
    assert len(_rows(tmp_path)) == done
    _model(tmp_path, _bench())
    assert quick.done == done


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
