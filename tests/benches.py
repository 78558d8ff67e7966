"""Bench data sets to try things on: a good one, and changes of its cells and traces."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

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

Change = Callable[[float], float]


def good_set(folder: Path, *, sensor: bool = True, traces: bool = True) -> Path:
    """Copy the good set into ``folder``, with an actuator's sensor and its calibration."""
    target = folder / "set"
    shutil.copytree(GOOD, target)
    if sensor:
        with (target / "bench.toml").open("a") as file:
            file.write(SENSOR)
    if not traces:
        edit(target / "shifts.csv", trace=lambda _: "")
    return target


def edit(path: Path, **changes: Callable[[str], str]) -> None:
    """Change columns of a table, cell by cell."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row.update({column: change(row[column]) for column, change in changes.items()})
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def scale(path: Path, **factors: float) -> None:
    """Multiply columns of a table, empty cells apart."""

    def by(factor: float) -> Callable[[str], str]:
        return lambda text: f"{float(text) * factor:.9g}" if text else text

    edit(path, **{column: by(factor) for column, factor in factors.items()})


def scale_traces(folder: Path, **factors: float) -> None:
    """Multiply columns of all traces of a set."""
    for path in sorted((folder / "traces").glob("*.csv")):
        scale(path, **factors)


def swap(path: Path) -> None:
    """Swap mismatch and force in a table of shifts."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    swapped = [[row[1], row[0], *row[2:]] for row in rows[1:]]
    path.write_text("\n".join(",".join(row) for row in [rows[0], *swapped]) + "\n")
