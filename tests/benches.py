"""Bench data sets to try things on: a good one, and changes of its cells and traces."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd

GOOD = Path(__file__).parent / "data" / "planar"

SENSOR = """
[record]
displacement_at = "actuator"
[sensor]
linkage_ratio = 3.1914
linkage_efficiency = 0.80
[[actuator_calibration]]
arm_force_N = 92.1172
sleeve_force_N = 235.1929
[[actuator_calibration]]
arm_force_N = 251.2455
sleeve_force_N = 641.4778
"""


def good_set(folder: Path, *, sensor: bool = True, traces: bool = True) -> Path:
    """Copy the good set into ``folder``, with an actuator's sensor and its calibration."""
    target = folder / "set"
    shutil.copytree(GOOD, target)
    if sensor:
        state(target, SENSOR)
    if not traces:
        table = pd.read_csv(target / "shifts.csv", dtype=str)
        table.assign(trace="").to_csv(target / "shifts.csv", index=False)
    return target


def state(folder: Path, text: str) -> None:
    """Add keys to the ``bench.toml`` of a set."""
    with (folder / "bench.toml").open("a") as file:
        file.write(f"\n{text}\n")


def scale(path: Path, **factors: float) -> None:
    """Multiply columns of a table, empty cells apart."""
    table = pd.read_csv(path, dtype={"engaged": str})
    table[[*factors]] *= pd.Series(factors)
    table.to_csv(path, index=False, float_format="%.9g")


def scale_traces(folder: Path, **factors: float) -> None:
    """Multiply columns of all traces of a set."""
    for path in sorted((folder / "traces").glob("*.csv")):
        scale(path, **factors)


def swap(path: Path) -> None:
    """Swap mismatch and force in a table of shifts."""
    table = pd.read_csv(path, dtype=str)
    table[["mismatch_rpm", "force_N"]] = table[["force_N", "mismatch_rpm"]].to_numpy()
    table.to_csv(path, index=False)
