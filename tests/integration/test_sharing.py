"""Many machines, one search: heartbeats in PostgreSQL tell whose trial is whose."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from dogshape.pipeline.config.study_file import VARIABLES, load_study
from dogshape.pipeline.reports.study_page import write_report
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import run_study
from dogshape.sim.errors import StorageError
from tests.conftest import SMALL, search_run, set_options
from tests.integration.studies import lines_of, result_of, wait_until
from tests.server import Server, command_of, free_port, postgres, start_command

Process = subprocess.Popen[str]


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    """A server for the tests of this file."""
    with postgres() as running:
        yield running


def _start(server: Server, name: str, out: Path, *more: str) -> Process:
    """Start a run of the search ``name`` in a process group of its own."""
    # So many angles that the one which starts first does not end before the other begins.
    settings = (*SMALL, "expectation.angles=12", "solver.engine=drake", f"name={name}", *more)
    where = ["--storage", server.url, "--out", str(out), "--resume", "--no-report", "--jobs", "1"]
    return start_command(command_of("search", "mq200_paper", *where, *set_options(settings)))


def _end(process: Process) -> None:
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err


def _states(server: Server, name: str) -> list[str]:
    return server.ask(
        "SELECT t.state FROM trials t JOIN studies s USING (study_id) "
        f"WHERE s.study_name = '{name}' ORDER BY t.number"
    )


def _require_whole(server: Server, name: str, outs: list[Path], trials: int) -> None:
    """Every folder has all trials, each once, and the same surrogate and report of them."""
    assert _states(server, name).count("COMPLETE") == trials
    assert set(_states(server, name)) <= {"COMPLETE", "FAIL"}
    first = result_of(outs[0])
    different = {tuple(row[key] for key in VARIABLES) for row in first["trials"]}
    assert len(different) == len(first["trials"]) == trials
    for out in outs:
        result = result_of(out)
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
    for process, out in ((first, one), (second, two)):
        wait_until(lambda out=out: len(lines_of(out)) >= 3, process)
    os.killpg(first.pid, signal.SIGKILL)
    first.communicate()
    assert "RUNNING" in _states(server, "killed")
    _end(second)
    assert "FAIL" in _states(server, "killed")
    _end(_start(server, "killed", one))
    _require_whole(server, "killed", [one, two], 12)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("postgresql://u:secret@127.0.0.1:{free}/db", "cannot be opened (connection"),
        ("{server}_missing", 'database "postgres_missing" does not exist'),
        ("mysql://u:secret@127.0.0.1/db", "storage is of 'mysql', but a study is kept in"),
        ("rubbish", "storage is 'rubbish', which is not the address of a database"),
    ],
)
def test_wrong_addresses_are_said(server: Server, tmp_path: Path, url: str, words: str) -> None:
    full = url.format(free=free_port(), server=server.url)
    with pytest.raises(StorageError) as refused:
        run_study(load_study("mq200_paper", SMALL), search_run(tmp_path, 1, storage=full))
    assert words in str(refused.value)
    assert "secret" not in str(refused.value)
