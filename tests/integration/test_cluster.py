"""Simulating on a Dask cluster: the same shifts, whoever dies on the way."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.conftest import SMALL
from tests.integration.studies import Finished
from tests.server import ROOT, Cluster, command_of, dask_cluster

OVERRIDES = [part for text in SMALL for part in ("--set", text)]
STUDY = ["mq200_paper", "--no-report", "--engine", "drake", *OVERRIDES]
EXPECT = ["mq200_paper", "--angles", "3", *OVERRIDES, "--json"]


@contextmanager
def _started(cluster: Cluster, verb: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start a command on a cluster; where it fails, show what the cluster was at."""
    command = command_of(verb, *arguments, "--cluster", cluster.address)
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, cwd=ROOT, stdout=pipe, stderr=pipe, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
    ) as process:  # fmt: skip
        try:
            yield process
        except BaseException:
            print(cluster.said())
            raise
        finally:
            process.kill()


def _call(cluster: Cluster, verb: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    with _started(cluster, verb, *arguments) as process:
        out, err = process.communicate(timeout=300)
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def test_a_killed_worker_loses_no_trial(in_drake: Finished, tmp_path: Path) -> None:
    """Its shifts run again on the other one; the result is that of one machine."""
    outs = [tmp_path / "away", in_drake.folder]
    with (
        dask_cluster(2) as two,
        _started(two, "study", *STUDY, "--out", str(outs[0])) as process,
    ):
        _wait_for_shifts(outs[0], 6)
        os.kill(two.workers[0].pid, signal.SIGKILL)
        two.workers[0].wait()
        _, err = process.communicate(timeout=240)
        assert process.returncode == 0, err
    away, alone = (json.loads((out / "result.json").read_text()) for out in outs)
    assert away == alone


def _wait_for_shifts(out: Path, count: int) -> None:
    end = time.monotonic() + 120
    journal = out / "running.jsonl"
    while not journal.exists() or journal.read_bytes().count(b"\n") < count:
        assert time.monotonic() < end
        time.sleep(0.02)


OTHER_DRAKE = """
import dogshape.sim.versions
dogshape.sim.versions.versions.__wrapped__.__globals__["metadata"] = type(
    "Metadata", (), {"version": lambda name: "1.2.3" if name == "drake" else "0.1.0"}
)
"""


def test_workers_of_another_version_are_refused() -> None:
    with dask_cluster(1, OTHER_DRAKE) as other:
        refused = _call(other, "expect", *EXPECT)
    assert refused.returncode == 2
    assert "has drake 1.2.3, but here it is" in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
