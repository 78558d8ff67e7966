"""Tables of flights: kept once, read again, and never taken for another bench's."""

from contextlib import suppress
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from threading import BrokenBarrierError
from typing import Any

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction import flight_store
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.diagnosis.prediction.flight_store import FlightStore
from dogshape.diagnosis.prediction.flight_table import FlightTables
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effects import load
from dogshape.sim.errors import StorageError

FRICTION: Hypothesis = ("sleeve_friction",)
TABLE = np.arange(8.0).reshape(4, 2) / 3.0


def test_a_table_comes_back_as_it_was_told(tmp_path: Path) -> None:
    store = FlightStore((tmp_path / "flights.npz",))
    told = store.add("a", TABLE)
    store.save()
    store.add("b", 2.0 * TABLE)
    store.save()
    again = FlightStore((tmp_path / "none.npz", tmp_path / "flights.npz"))
    kept = again.get("a")
    assert kept is not None
    assert again.get("b") is not None
    assert again.get("c") is None
    np.testing.assert_array_equal(kept, told)
    np.testing.assert_allclose(kept, TABLE, rtol=1e-7)


def test_tables_of_another_file_are_taken_over(tmp_path: Path) -> None:
    other, store = (FlightStore((tmp_path / name,)) for name in ("other.npz", "mine.npz"))
    other.add("b", TABLE)
    other.save()
    store.add("a", TABLE)
    store.take(tmp_path / "other.npz")
    store.take(tmp_path / "none.npz")
    store.save()
    again = FlightStore((tmp_path / "mine.npz",))
    assert again.get("a") is not None
    assert again.get("b") is not None


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    path = tmp_path / "flights.npz"
    path.write_bytes(b"not an archive")
    with pytest.raises(StorageError, match="not a file of flights"):
        FlightStore((path,)).get("a")


def _save_slowly(path: Path, key: str, ready: Any, between: Any) -> None:
    """Add a table; between reading and writing the file, wait for the other process."""
    read = flight_store._read

    def read_and_wait(file: Path) -> dict[str, Any]:
        found = read(file)
        # Held up by a lock, the other one does not come here before this one is done.
        with suppress(BrokenBarrierError):
            between.wait(timeout=1.0)
        return found

    flight_store._read = read_and_wait
    store = FlightStore((path,))
    store.add(key, TABLE)
    ready.wait(timeout=60.0)
    store.save()


def test_two_runs_that_save_at_once_keep_the_tables_of_both(tmp_path: Path) -> None:
    """Each would read the file before the other has written it, and leave out its table."""
    path = tmp_path / "flights.npz"
    first = FlightStore((path,))
    first.add("old", TABLE)
    first.save()
    context = get_context("spawn")
    ready, between = context.Barrier(2), context.Barrier(2)
    runs = [
        context.Process(target=_save_slowly, args=(path, key, ready, between)) for key in ("a", "b")
    ]
    for run in runs:
        run.start()
    for run in runs:
        run.join(timeout=120.0)
    assert [run.exitcode for run in runs] == [0, 0]
    kept = FlightStore((path,))
    assert {key for key in ("old", "a", "b") if kept.get(key) is not None} == {"old", "a", "b"}


def test_a_stored_table_is_not_flown_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flights.npz"
    setting = settings_of(load_bench("mq200_adams"))[0]
    effects = load(None)
    first = FlightStore((path,))
    values = np.array([[40.0]])
    flown = FlightTables(effects, [setting], first).at(FRICTION, values, setting.point.profile)
    first.save()
    monkeypatch.setattr("dogshape.diagnosis.prediction.flight_table.table_of", _forbidden)
    tables = FlightTables(effects, [setting], FlightStore((path,)))
    kept = tables.at(FRICTION, values, setting.point.profile)
    np.testing.assert_array_equal(kept.times, flown.times)


def test_another_prior_is_another_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setting = settings_of(load_bench("mq200_adams"))[0]
    store = FlightStore((tmp_path / "flights.npz",))
    effects = load(None)
    FlightTables(effects, [setting], store).at(FRICTION, np.array([[40.0]]), setting.point.profile)
    effect = effects["sleeve_friction"]
    narrow = replace(effect.parameters[0], high=0.5 * effect.parameters[0].high)
    changed = {**effects, "sleeve_friction": replace(effect, parameters=(narrow,))}
    monkeypatch.setattr("dogshape.diagnosis.prediction.flight_table.table_of", _forbidden)
    with pytest.raises(AssertionError, match="flown"):
        FlightTables(changed, [setting], store).at(
            FRICTION, np.array([[20.0]]), setting.point.profile
        )


def _forbidden(*_: object) -> None:
    raise AssertionError("flown")
