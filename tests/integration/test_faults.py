"""Faults and ends from outside, each one injected: nothing that was finished is lost."""

from __future__ import annotations

import errno
import json
import os
import random
import resource
import signal
import subprocess
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import ShiftJournal, append
from dogshape.pipeline.study import run_study
from dogshape.sim.errors import StorageError, WorkerError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.statistics.blocks import Block, even_blocks
from tests.conftest import SMALL, search_run, set_options
from tests.integration.studies import Finished, designs_of, lines_of, result_of, wait_until
from tests.server import ROOT, command_of, start_command

DRAKE = (*SMALL, "solver.engine=drake")  #: shifts that take long enough to be cut off


def _command(out: Path, *more: str) -> list[str]:
    where = ("--out", str(out), "--resume", "--no-report")
    return command_of("search", "mq200_paper", *where, *set_options(DRAKE), *more)


def _done(out: Path) -> int:
    """Count the shifts of trials that have ended and of those that run."""
    told = out / "trials.log"
    return 6 * (told.exists() and told.read_text().count("simulation")) + len(lines_of(out))


def test_kills_at_random_moments_change_nothing(tmp_path: Path, in_drake: Finished) -> None:
    chance = random.Random(5)
    for share, jobs, how in ((0.1, "1", signal.SIGINT), (0.4, "2", signal.SIGKILL),
                             (0.8, "1", signal.SIGKILL)):  # fmt: skip
        process = start_command(_command(tmp_path, "--jobs", jobs))
        wait_until(lambda share=share: _done(tmp_path) >= share * 72)
        time.sleep(chance.random())
        os.killpg(process.pid, how)
        _, err = process.communicate(timeout=60)
        if how is signal.SIGINT:
            assert process.returncode == 130, err
            assert "finished shifts are kept" in err
            assert "Traceback" not in err
    run_study(load_study("mq200_paper", DRAKE), search_run(tmp_path, 1, resume=True))
    assert designs_of(result_of(tmp_path)) == designs_of(in_drake.result)
    confirmed = (one["confirmation"]["best"] for one in (result_of(tmp_path), in_drake.result))
    one, other = ({k: v for k, v in best.items() if k != "trial"} for best in confirmed)
    assert one == other
    assert not lines_of(tmp_path)


def test_a_full_disk_is_said_and_costs_nothing(tmp_path: Path, in_drake: Finished) -> None:
    """No file may grow beyond some bytes: the journal of shifts is the first to want to."""
    full = subprocess.run(
        _command(tmp_path, "--jobs", "2"),
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000)),
    )
    assert full.returncode == 2, full.stderr
    assert "running.jsonl cannot be written (File too large)" in full.stderr
    assert "Traceback" not in full.stderr
    kept = lines_of(tmp_path)
    assert len(kept) >= 3
    assert all(line.endswith(b"\n") and json.loads(line) for line in kept)
    again = run_study(
        load_study("mq200_paper", DRAKE), search_run(tmp_path, 1, resume=True)
    ).to_dict()
    assert designs_of(again) == designs_of(in_drake.result)


def test_a_line_is_written_whole_or_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, row = tmp_path / "shifts.jsonl", {"key": "a", "text": "x" * 100}
    append(path, row)
    whole = path.read_bytes()
    true, calls = os.write, []

    def half(descriptor: int, content: bytes) -> int:
        calls.append(len(content))
        if len(calls) > 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return true(descriptor, content[:50])

    monkeypatch.setattr("os.write", half)
    with pytest.raises(StorageError, match="No space left on device"):
        append(path, row)
    monkeypatch.undo()
    assert calls == [len(whole), len(whole) - 50]
    assert path.read_bytes() == whole
    path.write_bytes(whole + whole[:30])  # as a killed worker leaves it to the others
    append(path, row)
    assert path.read_bytes() == whole + whole


def _block(study: Setup, **solver: Any) -> Block:
    (block,) = even_blocks(study.clutch, study.points[:1], 3, 1)
    clutch = replace(study.clutch, solver=replace(study.clutch.solver, **solver))
    return replace(block, clutch=clutch)


def test_a_limit_of_steps_is_kept_and_one_of_time_not(small_study: Setup, tmp_path: Path) -> None:
    """Only the first is the shift's own; what the clock ended is simulated again."""
    # So fine an accuracy that no machine ends a shift within the least limit.
    plain, timed, counted = (
        _block(small_study, accuracy=1e-9, **limit)
        for limit in ({}, {"time_limit": 0.01}, {"max_steps": 50})
    )
    assert plain.keys == timed.keys
    assert not set(plain.keys) & set(counted.keys)
    path = tmp_path / "shifts.jsonl"
    for block, words, kept in [
        (timed, "no end after solver.time_limit_s = 0.01", False),
        (counted, "solver.max_steps = 50", True),
    ]:
        executor = Executor(ShiftJournal(path), 1)
        for row in executor.run([block])[0]:
            assert row["outcome"] == "diverged"
            assert words in row["reason"]
        assert (set(ShiftJournal(path).rows) == set(block.keys)) is kept
    again = Executor(ShiftJournal(path), 1).run([_block(small_study, accuracy=1e-4)])[0]
    assert all(row["outcome"] == "engaged" for row in again)


@dataclass(frozen=True)
class Breaking(ForceProfile):
    """A shift force that kills the worker which asks for it, where ``once`` is no file yet."""

    once: str = ""
    parent: int = 0

    @property
    def knots(self) -> Any:
        """Break in a shift, where the compiled engine asks for the course of the force."""
        if os.getpid() != self.parent and not Path(self.once).is_file():
            if self.once:
                Path(self.once).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().knots


def _broken(study: Setup, tmp_path: Path, once: str = "") -> tuple[Executor, list[Block]]:
    good = even_blocks(study.clutch, study.points, 3, 1)
    bad = _block(study)
    force = bad.point.profile
    profile = Breaking(force.force, force.rise, once, os.getpid())
    bad = replace(bad, point=replace(bad.point, profile=profile), angles=(0.01,))
    return Executor(ShiftJournal(tmp_path / "shifts.jsonl"), 2), [good[0], bad, *good[1:]]


def test_a_killed_worker_says_nothing_against_its_shift(small_study: Setup, tmp_path: Path) -> None:
    executor, blocks = _broken(small_study, tmp_path, str(tmp_path / "done"))
    rows = executor.run(blocks)
    assert all(row["outcome"] == "engaged" for block in rows for row in block)


def test_two_runs_in_one_folder(tmp_path: Path) -> None:
    """The second is refused while the first runs, and the first does not notice."""
    first = start_command(_command(tmp_path, "--jobs", "1", "--set", "search.trials=1"))
    wait_until(lambda: lines_of(tmp_path), first)
    os.kill(first.pid, signal.SIGSTOP)
    second = subprocess.run(_command(tmp_path), cwd=ROOT, capture_output=True, text=True,
                            timeout=120, check=False)  # fmt: skip
    os.kill(first.pid, signal.SIGCONT)
    _, err = first.communicate(timeout=120)
    assert second.returncode == 2
    assert "is in use by another run" in second.stderr
    assert first.returncode == 0, err


def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    """They hold memory, and nothing tells them: idle, they would wait five minutes for work."""
    with start_command(_command(tmp_path, "--jobs", "2")) as parent:
        wait_until(lambda: len(lines_of(tmp_path)) >= 4, parent)
        assert len(_members(parent.pid)) >= 3
        parent.kill()
    wait_until(lambda: not _members(parent.pid))


def _members(session: int) -> list[int]:
    """Return the processes of a session that are no zombies."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, _, its = path.read_text().rpartition(")")[2].split()[:4]
            found += [int(path.parent.name)] if int(its) == session and state != "Z" else []
    return found


def test_workers_that_die_again_and_again_are_said(small_study: Setup, tmp_path: Path) -> None:
    executor, blocks = _broken(small_study, tmp_path)
    with pytest.raises(WorkerError, match="died 3 times without finishing a shift"):
        executor.run(blocks)
    assert len(lines_of(tmp_path, "shifts.jsonl")) == 6


SHIFT = ["shift", "mq200", "--mismatch-rpm", "50", "--force-N", "469", "--angle-deg", "10",
         "--engine", "planar"]  # fmt: skip


@pytest.mark.parametrize(
    ("asked", "errors"),
    [([*SHIFT, "--json"], subprocess.PIPE), (["no-such-verb"], subprocess.STDOUT)],
)
def test_a_closed_pipe_ends_quietly(asked: list[str], errors: int) -> None:
    process = subprocess.Popen(command_of(*asked), stdout=subprocess.PIPE, stderr=errors)
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(timeout=120) == 128 + signal.SIGPIPE
    if process.stderr is not None:
        assert process.stderr.read() == b""
        process.stderr.close()


@pytest.mark.parametrize(("number", "group"), [(signal.SIGTERM, True), (signal.SIGHUP, False)])
def test_signals_keep_what_is_finished(tmp_path: Path, number: signal.Signals, group: bool) -> None:
    """As after Ctrl-C: what is kept, one word, and nothing of a library's."""
    asked = ["expect", "mq200_paper", "--angles", "96", "--jobs", "2"]
    command = ["env", "--default-signal=HUP", *command_of(*asked)]  # tests may run under nohup
    process = start_command(command, tmp_path)
    wait_until(lambda: _shifts(tmp_path))
    kept = _shifts(tmp_path)
    (os.killpg if group else os.kill)(process.pid, number)
    _, err = process.communicate(timeout=60)
    said = " ".join(err.split())
    assert process.returncode == 128 + number
    assert "finished shifts are kept in results/shifts/" in said
    assert said.endswith("dogshape: stopped")
    for noise in ("Traceback", "leaked", "resource_tracker", "Warning"):
        assert noise not in said
    assert _shifts(tmp_path) >= kept


def _shifts(folder: Path) -> int:
    return sum(p.read_bytes().count(b"\n") for p in folder.glob("results/shifts/*/shifts.jsonl"))
