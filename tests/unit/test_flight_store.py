"""Tables of flights: kept once, read again, and never taken for another bench's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
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


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    path = tmp_path / "flights.npz"
    path.write_bytes(b"not an archive")
    with pytest.raises(StorageError, match="not a file of flights"):
        FlightStore((path,)).get("a")


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
