"""Many machines, one search: PostgreSQL tells whose trial is whose."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.study_page import write_report
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.trial_storage import Shared, _address
from dogshape.pipeline.study import run_study
from dogshape.sim.errors import StorageError
from tests.conftest import SMALL, searching
from tests.server import ROOT, Server, command_of, free_port, postgres

Process = subprocess.Popen[bytes]


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    """A server for the tests of this file."""
    with postgres() as running:
        yield running


def _start(server: Server, name: str, out: Path, *more: str) -> Process:
    """Start a run of the search ``name`` in a process group of its own."""
    settings = (*SMALL, "solver.engine=drake", f"name={name}", *more)
    overrides = [part for text in settings for part in ("--set", text)]
    where = ["--storage", server.url, "--out", str(out), "--resume", "--no-report", "--jobs", "1"]
    return subprocess.Popen(
        command_of("study", "mq200_paper", *where, *overrides),
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def _ended(process: Process) -> str:
    """Wait for a run and return what it said."""
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err.decode()
    return err.decode()


def _shifts(out: Path) -> int:
    journal = out / "running.jsonl"
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def _wait_for_shifts(out: Path, count: int) -> None:
    end = time.monotonic() + 120
    while _shifts(out) < count:
        assert time.monotonic() < end
        time.sleep(0.05)


def _result(out: Path) -> dict[str, Any]:
    result: dict[str, Any] = json.loads((out / "result.json").read_text())
    return result


def _states(server: Server, name: str) -> list[str]:
    return server.ask(
        "SELECT t.state FROM trials t JOIN studies s USING (study_id) "
        f"WHERE s.study_name = '{name}' ORDER BY t.number"
    )


def _designs(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    names = ("trial", "chamfer_deg", "height_mm", "count", "expected_shift_time_s")
    return [tuple(row[n] for n in names) for row in result["trials"]]


def _require_whole(server: Server, name: str, outs: list[Path], trials: int) -> None:
    """Every folder has all trials, each once, and the same surrogate and report of them."""
    assert _states(server, name) == ["COMPLETE"] * trials
    first = _result(outs[0])
    assert [row["trial"] for row in first["trials"]] == list(range(trials))
    assert len({tuple(row[1:]) for row in _designs(first)}) == trials
    for out in outs:
        result = _result(out)
        for key in ("trials", "best", "front", "confirmation", "surrogate"):
            assert result[key] == first[key], key
        assert result["n_simulated_shifts"] == 6 * trials + 12
        stored, other = (json.loads((o / "surrogate.json").read_text()) for o in (out, outs[0]))
        assert stored["rows"] == other["rows"]
        assert len(stored["rows"]) == 2 * trials + 2
    assert f"{trials} designs" in write_report(StudyFolder(outs[-1])).read_text()


def test_two_machines_share_a_search_and_one_is_killed(server: Server, tmp_path: Path) -> None:
    """The trials of the killed one are taken over, each once; started again, it has them all."""
    one, two = tmp_path / "one", tmp_path / "two"
    first = _start(server, "killed", one)
    second = _start(server, "killed", two)
    _wait_for_shifts(one, 3)
    _wait_for_shifts(two, 3)
    os.killpg(first.pid, signal.SIGKILL)
    first.communicate()
    assert "RUNNING" in _states(server, "killed")
    _ended(second)
    _ended(_start(server, "killed", one))
    _require_whole(server, "killed", [one, two], 12)


def test_a_live_run_keeps_its_trials(server: Server, tmp_path: Path) -> None:
    """A run that stands still is not dead: its trials wait for it, and none is asked too many."""
    one, two = tmp_path / "one", tmp_path / "two"
    more = ("search.trials=11", "search.sampler=space_filling")
    first = _start(server, "standing", one, *more)
    _wait_for_shifts(one, 2)
    os.killpg(first.pid, signal.SIGSTOP)
    second = _start(server, "standing", two, *more)
    end = time.monotonic() + 240
    while _states(server, "standing").count("COMPLETE") < 7 and time.monotonic() < end:
        time.sleep(0.2)
    time.sleep(2.0)
    assert sorted(_states(server, "standing")) == ["COMPLETE"] * 7 + ["RUNNING"] * 4
    assert second.poll() is None
    os.killpg(first.pid, signal.SIGCONT)
    _ended(first)
    assert "waiting for 4 designs that other runs simulate" in _ended(second)
    _require_whole(server, "standing", [one, two], 11)


def test_a_server_that_goes_away_is_one_sentence(server: Server, tmp_path: Path) -> None:
    out = tmp_path / "out"
    more = ("search.trials=4",)
    process = _start(server, "lost", out, *more)
    _wait_for_shifts(out, 2)
    server.stop()
    try:
        _, err = process.communicate(timeout=120)
    finally:
        server.start()
    assert process.returncode == 2, err.decode()
    last = err.decode().strip().splitlines()[-1]
    assert "was lost" in last
    assert "finished shifts are kept" in last
    assert "Traceback" not in err.decode()
    _ended(_start(server, "lost", out, *more))
    assert _states(server, "lost") == ["COMPLETE"] * 4


def test_locks_tell_the_living(server: Server) -> None:
    address = _address(server.url)
    one, two, other = (Shared(address, name) for name in ("a", "a", "b"))
    assert one.living() == two.living() == {one.worker, two.worker}
    assert other.living() == {other.worker}
    with one.turn(), other.turn(), two.opening():
        assert not two._try(two._study, 0)
    with two.turn():
        assert not one._try(one._study, 0)
    one.close()
    end = time.monotonic() + 10
    while one.worker in two.living() and time.monotonic() < end:
        time.sleep(0.05)
    assert two.living() == {two.worker}
    two.close()
    other.close()


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("postgresql://u:secret@127.0.0.1:{free}/db", "cannot be opened (connection"),
        ("{server}_missing", 'database "postgres_missing" does not exist'),
        ("mysql://u:secret@127.0.0.1/db", "--storage is of 'mysql', but a study is kept in"),
        ("rubbish", "--storage is 'rubbish', which is not the address of a database"),
    ],
)
def test_wrong_addresses_are_said(server: Server, tmp_path: Path, url: str, words: str) -> None:
    full = url.format(free=free_port(), server=server.url)
    with pytest.raises(StorageError) as refused:
        run_study(load_study("mq200_paper", SMALL), searching(tmp_path, 1, storage=full))
    assert words in str(refused.value)
    assert "secret" not in str(refused.value)


def test_a_missing_driver_names_the_extra(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "psycopg", None)
    with pytest.raises(StorageError, match=r"needs psycopg; install the extra.*\[machines\]"):
        run_study(load_study("mq200_paper", SMALL), searching(tmp_path, 1, storage=server.url))


def test_a_machine_with_other_versions_is_refused(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = load_study("mq200_paper", [*SMALL, "search.trials=1", "name=versions"])
    run_study(study, searching(tmp_path / "a", 1, server.url))
    monkeypatch.setattr(
        "dogshape.pipeline.search.search.engine", lambda: {"dogshape": "0.1.0", "drake": "9"}
    )
    with pytest.raises(StorageError, match=r"other versions simulate \(.*drake .* and 9 here"):
        run_study(study, searching(tmp_path / "b", 1, server.url, resume=True))


def test_an_sqlite_file_serves_one_run_at_a_time(tmp_path: Path) -> None:
    from dogshape.pipeline.store.trial_storage import OneFile

    study = load_study("mq200_paper", [*SMALL, "search.trials=1"])
    held = OneFile(tmp_path / "search.db")
    with pytest.raises(StorageError, match="SQLite serves one at a time"):
        run_study(study, searching(tmp_path, 1, f"sqlite:///{tmp_path}/search.db"))
    held.close()
