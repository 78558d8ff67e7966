"""How long ``dogshape fit`` takes by the clock, of clutches that were never seen.

    python -m benchmarks.fit_clock [--clutch NAME ...] [--jobs N]

Runs the command as a user does, in an empty folder, for the clutches of ``two_fidelities``, one
after another. The prototype is fitted with ``--levels 2``, so that nothing the package brings is
used. Meant for an idle machine: beside the clock stands the processor time of the command and its
workers.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time

from benchmarks.two_fidelities import CLUTCHES
from benchmarks.unseen_clutch import cpu


def main() -> None:
    """Fit each clutch and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clutch", choices=CLUTCHES, nargs="+", default=list(CLUTCHES))
    parser.add_argument("--jobs", type=int, default=0)
    given = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before")
    print("clutch      clock,s  processor,s     Q2")
    verb = [sys.executable, "-m", "dogshape.pipeline", "fit", "mq200_paper", "--levels", "2"]
    for clutch in given.clutch:
        command = [*verb, "--json", "--jobs", str(given.jobs)]
        for key, value in CLUTCHES[clutch].items():
            command += ["--set", f"{key}={json.dumps(value)}"]
        with tempfile.TemporaryDirectory() as folder:
            began, used = time.perf_counter(), cpu()
            done = subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE)
            clock = time.perf_counter() - began
        q2 = json.loads(done.stdout)["q2"]
        print(f"{clutch:10s} {clock:8.0f} {cpu() - used:12.0f}  {q2:.3f}", flush=True)


if __name__ == "__main__":
    main()
