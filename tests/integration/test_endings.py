"""The program stopped from outside: a closed pipe, a signal to end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PROGRAM = [sys.executable, "-m", "dogshape.pipeline"]
SHIFT = ["shift", "mq200", "--mismatch-rpm", "50", "--force-N", "469", "--relative-angle-deg", "10",
         "--engine", "planar"]  # fmt: skip


@pytest.mark.parametrize(
    ("asked", "errors"),
    [([*SHIFT, "--json"], subprocess.PIPE), (["no-such-verb"], subprocess.STDOUT)],
)
def test_a_closed_pipe_ends_quietly(asked: list[str], errors: int) -> None:
    process = subprocess.Popen([*PROGRAM, *asked], stdout=subprocess.PIPE, stderr=errors)
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(timeout=120) == 128 + signal.SIGPIPE
    if process.stderr is not None:
        assert process.stderr.read() == b""
        process.stderr.close()


@pytest.mark.parametrize(("number", "group"), [(signal.SIGTERM, True), (signal.SIGHUP, False)])
def test_a_signal_to_end_keeps_what_is_finished(
    tmp_path: Path, number: signal.Signals, group: bool
) -> None:
    """As after Ctrl-C: what is kept, one word, and nothing of a library's."""
    asked = ["expect", "mq200_paper", "--angles", "96", "--jobs", "2"]
    process = subprocess.Popen(
        ["env", "--default-signal=HUP", *PROGRAM, *asked],  # tests may run under nohup
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and not _shifts(tmp_path):
        time.sleep(0.05)
    kept = _shifts(tmp_path)
    assert kept > 0
    (os.killpg if group else os.kill)(process.pid, number)
    _, err = process.communicate(timeout=60)
    said = " ".join(err.decode().split())
    assert process.returncode == 128 + number
    assert "finished shifts are kept in results/shifts/" in said
    assert said.endswith("dogshape: stopped")
    for noise in ("Traceback", "leaked", "resource_tracker", "Warning"):
        assert noise not in said
    assert _shifts(tmp_path) >= kept


def _shifts(folder: Path) -> int:
    return sum(p.read_bytes().count(b"\n") for p in folder.glob("results/shifts/*/shifts.jsonl"))
