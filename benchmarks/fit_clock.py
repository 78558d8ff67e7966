"""How long ``dogshape fit`` takes by the clock, of clutches that were never seen.

    python -m benchmarks.fit_clock [--clutch NAME ...] [--mix-shifts N ...] [--jobs N]

Runs the command as a user does, in an empty folder, for the clutches of ``two_fidelities``, one
after another, with each number of shifts at all operating points. The prototype is fitted with
``--levels 2``, so that nothing the package brings is used. Meant for an idle machine: beside the
clock stands the processor time of the command and its workers.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import resource
import subprocess
import sys
import tempfile
import time

from benchmarks.two_fidelities import CLUTCHES
from dogshape.pipeline.config.schema import MIX_SHIFTS


def main() -> None:
    """Fit each clutch and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clutch", choices=CLUTCHES, nargs="+", default=list(CLUTCHES))
    parser.add_argument("--mix-shifts", type=int, nargs="+", default=[MIX_SHIFTS])
    parser.add_argument("--jobs", type=int, default=0)
    given = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before")
    print("clutch      mix shifts  clock,s  processor,s     Q2  Q2 points")
    for clutch, shifts in itertools.product(given.clutch, given.mix_shifts):
        clock, used, found = fitted(clutch, shifts, given.jobs)
        figures = f"{found['q2']:6.3f} {found['q2_points']:10.3f}"
        print(f"{clutch:10s} {shifts:11d} {clock:8.0f} {used:12.0f} {figures}", flush=True)


def cpu() -> float:
    """Return the processor time of this process and its workers so far, s."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def fitted(clutch: str, shifts: int, jobs: int) -> tuple[float, float, dict[str, float]]:
    """Fit a clutch in an empty folder; return clock and processor time, s, and what it says."""
    command = [sys.executable, "-m", "dogshape.pipeline", "fit", "mq200_paper", "--levels", "2"]
    command += ["--json", "--jobs", str(jobs), "--set", f"surrogate.mix_shifts={shifts}"]
    for key, value in CLUTCHES[clutch].items():
        command += ["--set", f"{key}={json.dumps(value)}"]
    with tempfile.TemporaryDirectory() as folder:
        began, used = time.perf_counter(), cpu()
        done = subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE)
        clock = time.perf_counter() - began
    return clock, cpu() - used, json.loads(done.stdout)


if __name__ == "__main__":
    main()
