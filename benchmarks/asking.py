"""How long an answer takes: ``dogshape check`` as a whole process, and a table of designs."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.train.found_surrogates import stored_surrogate

DESIGNS = 100_000
RUNS = 5


def main() -> None:
    """Print wall times; median and range of several runs, whole processes."""
    study = load_study("mq200_paper")
    data = stored_surrogate(study, None)[0].surrogate.data
    print(f"{len(data)} rows of {len(data.designs)} designs; {os.cpu_count()} cores")
    rng = np.random.default_rng(0)
    x = data.designs[rng.integers(len(data.designs), size=DESIGNS)]
    x[:, :-1] += rng.normal(0.0, 0.02, x[:, :-1].shape) * (data.high - data.low)[:-1]
    with tempfile.TemporaryDirectory() as place:
        table = Path(place) / "designs.csv"
        np.savetxt(table, x, delimiter=",", header=",".join(data.variables), comments="")
        one = ["check", "mq200_paper", "--set", "dog.chamfer_deg=11", "--set", "dog.count=18"]
        _measure(
            "one design, one operating point", [*one, "--mismatch-rpm", "80", "--force-N", "300"]
        )
        _measure("one design, all operating points", one)
        _measure(
            f"{DESIGNS} designs, all operating points",
            ["check", "mq200_paper", "--designs", str(table)],
        )


def _measure(what: str, arguments: list[str]) -> None:
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "dogshape.pipeline", *arguments, "--json"],
            capture_output=True,
            check=False,
        )
        times.append(time.perf_counter() - begin)
        if done.returncode == 2:
            sys.exit(done.stderr.decode())
    times.sort()
    print(
        f"{what}: {times[RUNS // 2]:.2f} s (least {times[0]:.2f}, most {times[-1]:.2f})", flush=True
    )


if __name__ == "__main__":
    main()
