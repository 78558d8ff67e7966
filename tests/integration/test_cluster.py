"""Simulating on a Dask cluster: the same shifts, whoever dies on the way."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.conftest import SMALL, set_options
from tests.integration.studies import Finished, lines_of, result_of, wait_until
from tests.server import Cluster, command_of, dask_cluster, start_command

OVERRIDES = set_options(SMALL)
STUDY = ["mq200_paper", "--no-report", "--engine", "drake", *OVERRIDES]
EXPECT = ["mq200_paper", "--angles", "3", *OVERRIDES, "--json"]


@contextmanager
def _on(cluster: Cluster, verb: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start a command on a cluster; where it fails, show what the cluster was at."""
    with start_command(command_of(verb, *arguments, "--cluster", cluster.address)) as process:
        try:
            yield process
        except BaseException:
            print(cluster.read_log())
            raise
        finally:
            process.kill()


def test_a_killed_worker_loses_no_trial(in_drake: Finished, tmp_path: Path) -> None:
    """Its shifts run again on the other one; the result is that of one machine."""
    outs = [tmp_path / "away", in_drake.folder]
    with dask_cluster(2) as two, _on(two, "search", *STUDY, "--out", str(outs[0])) as process:
        wait_until(lambda: len(lines_of(outs[0])) >= 6)
        os.kill(two.workers[0].pid, signal.SIGKILL)
        two.workers[0].wait()
        _, err = process.communicate(timeout=240)
        assert process.returncode == 0, err
    assert result_of(outs[0]) == result_of(outs[1])


OTHER_DRAKE = """
from importlib import metadata
import dogshape.sim.versions
dogshape.sim.versions.versions.__wrapped__.__globals__["metadata"] = type(
    "Metadata",
    (),
    {"version": lambda name: "1.2.3" if name == "drake" else metadata.version(name)},
)
"""


def test_workers_of_another_version_are_refused() -> None:
    with dask_cluster(1, OTHER_DRAKE) as other, _on(other, "expect", *EXPECT) as process:
        _, err = process.communicate(timeout=300)
    assert process.returncode == 2
    assert "has drake 1.2.3, but here it is" in err
    assert len(err.strip().splitlines()) == 1
