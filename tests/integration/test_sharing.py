"""Many machines, one search: heartbeats in PostgreSQL tell whose trial is whose."""

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
    # So many angles that the one which starts first does not end before the other begins.
    settings = (*SMALL, "expectation.angles=12", "solver.engine=drake", f"name={name}", *more)
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


def _wait_for_shifts(process: Process, out: Path, count: int) -> None:
    end = time.monotonic() + 120
    while _shifts(out) < count:
        assert process.poll() is None, process.communicate()
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
    assert _states(server, name).count("COMPLETE") == trials
    assert set(_states(server, name)) <= {"COMPLETE", "FAIL"}
    first = _result(outs[0])
    assert len({tuple(row[1:]) for row in _designs(first)}) == len(first["trials"]) == trials
    for out in outs:
        result = _result(out)
        for key in ("trials", "best", "front", "confirmation", "surrogate"):
            assert result[key] == first[key], key
        assert result["n_simulated_shifts"] == 24 * trials + 12
        stored, other = (json.loads((o / "surrogate.json").read_text()) for o in (out, outs[0]))
        assert stored == other
    assert f"{trials} designs" in write_report(StudyFolder(outs[-1])).read_text()


def test_two_machines_share_a_search_and_one_is_killed(server: Server, tmp_path: Path) -> None:
    """Designs of the killed one are simulated by the other; started again, it has them all."""
    one, two = tmp_path / "one", tmp_path / "two"
    first = _start(server, "killed", one)
    second = _start(server, "killed", two)
    _wait_for_shifts(first, one, 3)
    _wait_for_shifts(second, two, 3)
    os.killpg(first.pid, signal.SIGKILL)
    first.communicate()
    assert "RUNNING" in _states(server, "killed")
    _ended(second)
    assert "FAIL" in _states(server, "killed")
    _ended(_start(server, "killed", one))
    _require_whole(server, "killed", [one, two], 12)


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
