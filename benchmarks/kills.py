"""Searches killed at random moments: finished shifts that are lost, results that change.

    python -m benchmarks.kills [--kills N] [--seed N]

A small search of the paper's study by two workers is killed (SIGKILL) at a random moment of its
run and resumed, until the search ends; then the next search begins, until there were N kills. The
victim is the parent, one worker, or all processes at once, in turn. A resumed run that is refused,
a finished shift of the journal that neither journal nor finished trials have afterwards, and a
result that differs from that of a search without kills are counted. A hundred kills take half
an hour.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder
from tests.integration.studies import designs_of, result_of

VICTIMS = ("parent", "worker", "all")
SETTINGS = (
    "operating.mismatch_rpm=[50, 149]",
    "operating.force_N=[469.0]",
    "expectation.angles=48",
    "search.trials=14",
    "search.startup=10",
    "search.confirm_angles=4",
    "search.confirm_designs=1",
    "search.audit_shifts=2",
)
FIRST_KILL_S = 1.0  #: earliest kill after the start of a run
STOP_S = 30.0  #: for the workers of a killed parent to end


@dataclass
class Count:
    """Kills by victim, and what they changed."""

    kills: dict[str, int] = field(default_factory=lambda: dict.fromkeys(VICTIMS, 0))
    survived: int = 0  #: kills of a worker after which the same run went on to its end
    finished_shifts: int = 0  #: in the journal at a kill
    lost_shifts: int = 0
    refused_runs: int = 0
    searches: int = 0
    different_results: int = 0


@contextmanager
def started_search(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Start or resume the search in a session of its own; end all its processes at exit."""
    command = [sys.executable, "-m", "dogshape.pipeline", "search", "mq200_paper"]
    command += ["--out", str(folder), "--resume", "--no-report", "--jobs", "2"]
    for setting in SETTINGS:
        command += ["--set", setting]
    with subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        yield process
        kill_all(process)


def kill_all(process: subprocess.Popen[str]) -> None:
    """Kill the session of a search."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def kill_one(process: subprocess.Popen[str], victim: str, generator: random.Random) -> str:
    """Kill a victim and return which one: without a worker yet it is the parent."""
    if victim == "all":
        kill_all(process)
        return victim
    workers = psutil.Process(process.pid).children(recursive=True)
    if victim == "worker" and workers:
        with suppress(psutil.NoSuchProcess):
            generator.choice(workers).kill()
        return victim
    process.kill()
    return "parent"


def finished_keys(folder: Path) -> set[str]:
    """List the keys of the shifts that the journal of a running search has."""
    return set(ShiftJournal(StudyFolder(folder).running).rows)


def finished_trials(folder: Path) -> int:
    """Count the simulated trials in the log of a search."""
    log = folder / "trials.log"
    return log.read_text(encoding="utf-8").count("simulation") if log.exists() else 0


def run_once(
    folder: Path, victim: str, delay_s: float, generator: random.Random, count: Count
) -> bool:
    """Run or resume a search, kill a victim after ``delay_s``; return whether the search ended."""
    with started_search(folder) as process:
        try:
            _, errors = process.communicate(timeout=delay_s)
        except subprocess.TimeoutExpired:
            killed = kill_one(process, victim, generator)
            count.kills[killed] += 1
            keys = finished_keys(folder)
            trials = finished_trials(folder)
            count.finished_shifts += len(keys)
            if process.poll() is None and killed == "worker":
                _, errors = process.communicate()
                count.survived += process.returncode == 0
            else:
                process.wait(timeout=STOP_S)
                kill_all(process)
                if finished_trials(folder) == trials:  # else a trial took its shifts with it
                    count.lost_shifts += len(keys - finished_keys(folder))
                return False
    if process.returncode != 0:
        count.refused_runs += 1
        print(f"exit status {process.returncode} ({victim}): {errors}", file=sys.stderr)
    return process.returncode == 0


def main() -> None:
    """Kill searches and print what was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    generator = random.Random(arguments.seed)
    count = Count()
    with TemporaryDirectory() as place:
        reference = Path(place) / "reference"
        start = time.monotonic()
        run_once(reference, "all", 3600.0, generator, count)
        duration_s = time.monotonic() - start
        expected = designs_of(result_of(reference))
        while sum(count.kills.values()) < arguments.kills:
            folder = Path(place) / "killed"
            has_ended = False
            while not has_ended:
                victim = VICTIMS[sum(count.kills.values()) % len(VICTIMS)]
                delay_s = generator.uniform(FIRST_KILL_S, duration_s)
                has_ended = run_once(folder, victim, delay_s, generator, count)
                number = sum(count.kills.values())
                print(f"{number} of {arguments.kills} kills", file=sys.stderr, flush=True)
            count.searches += 1
            count.different_results += designs_of(result_of(folder)) != expected
            shutil.rmtree(folder)
    print(f"search without a kill: {duration_s:.0f} s, {len(expected)} designs")
    kills = ", ".join(f"{name} {number}" for name, number in count.kills.items())
    print(f"kills: {kills}; runs that ended in spite of a killed worker: {count.survived}")
    print(f"finished shifts in the journal at a kill: {count.finished_shifts}")
    print(f"of these lost: {count.lost_shifts}")
    print(f"resumed runs that were refused: {count.refused_runs}")
    print(f"searches to the end: {count.searches}, with another result: {count.different_results}")


if __name__ == "__main__":
    main()
