"""How long an answer takes: ``dogshape`` as a whole process, and a table of designs.

Cold, one process for each answer. Processor time is given beside the time on the clock, because it
says more of a machine that does other things too. "Kept" are root and inverse of the surrogate's
covariance, which the first call works out and those after it find (``surrogate.kept_matrices``).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.common import load_told
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.train.design_verdicts import by_columns, verdicts
from dogshape.pipeline.train.found_surrogates import stored_surrogate
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.kept_matrices import PLACE

DESIGNS = 100_000
ONE_BY_ONE = 2_000  #: designs whose checks are worked out one after the other, to compare
RUNS = 9
FEW = 3  #: runs of what takes long
SET = ("--set", "dog.chamfer_deg=11", "--set", "dog.count=18")
NO_SURROGATE = "mq200"  #: a study that the package brings none for


def main() -> None:
    """Print time on the clock and processor time, median and range of several whole processes."""
    study = load_study("mq200_paper")
    stored, path = stored_surrogate(study, None)
    data = stored.surrogate.data
    print(f"{len(data)} rows of {len(data.designs)} designs; {os.cpu_count()} cores; {load_told()}")
    with tempfile.TemporaryDirectory() as place:
        os.environ[PLACE] = str(Path(place) / "kept")
        x = _designs(data)
        table = Path(place) / "designs.csv"
        np.savetxt(table, x, delimiter=",", header=",".join(data.variables), comments="")
        one = ("check", "mq200_paper", *SET, "--surrogate", str(path))
        many = ("check", "mq200_paper", "--designs", str(table))
        _measure("--help", ("--help",))
        _measure("check --help", ("check", "--help"))
        _measure("one design, nothing kept", one, first=lambda: os.environ.update({PLACE: "off"}))
        os.environ[PLACE] = str(Path(place) / "kept")
        _measure("one design, the call that keeps", one, runs=1)
        _measure("one design, kept", one)
        _measure("the same at one operating point", (*one, "--mismatch-rpm=80", "--force-N=300"))
        _measure("one design by the compiled engine", ("check", NO_SURROGATE, *SET), runs=FEW)
        _measure(f"{DESIGNS} designs", many, runs=FEW)
    _closed_forms(study, data, x)
    print(f"at the end: {load_told()}")


def _designs(data: Dataset) -> Array:
    rng = np.random.default_rng(0)
    x = data.designs[rng.integers(len(data.designs), size=DESIGNS)]
    x[:, :-1] += rng.normal(0.0, 0.02, x[:, :-1].shape) * (data.high - data.low)[:-1]
    return x


def _measure(
    what: str,
    arguments: tuple[str, ...],
    runs: int = RUNS,
    first: Callable[[], None] | None = None,
) -> None:
    if first is not None:
        first()
    more = () if "--help" in arguments else ("--json",)
    times, work = [], []
    for _ in range(runs):
        begin = time.perf_counter()
        child = subprocess.Popen(
            [sys.executable, "-m", "dogshape.pipeline", *arguments, *more],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        _, status, used = os.wait4(child.pid, 0)
        times.append(time.perf_counter() - begin)
        work.append(used.ru_utime + used.ru_stime)
        assert child.stderr is not None
        said = child.stderr.read().decode()
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode == 2:
            sys.exit(said)
    print(f"{what}: {_middle(times)}, processor {_middle(work)}", flush=True)


def _middle(times: list[float]) -> str:
    ordered = sorted(times)
    middle = ordered[len(ordered) // 2]
    if len(ordered) == 1:
        return f"{middle:.2f} s"
    return f"{middle:.2f} s (least {ordered[0]:.2f}, most {ordered[-1]:.2f})"


def _closed_forms(study: Setup, data: Dataset, x: Array) -> None:
    """Print what the closed-form checks alone take, by columns and one design after the other."""
    names = data.variables
    assert by_columns(study, names)
    begin = time.process_time()
    verdicts(study, names, x)
    print(f"their closed-form checks alone: processor {time.process_time() - begin:.2f} s")
    slow = load_study(study.name, ("search.limits.axial_length_mm=1000",))
    assert not by_columns(slow, names)
    begin = time.process_time()
    verdicts(slow, names, x[:ONE_BY_ONE])
    each = (time.process_time() - begin) / ONE_BY_ONE
    print(f"one after the other, as for a limit of one's own: {each * DESIGNS:.0f} s for as many")


if __name__ == "__main__":
    main()
