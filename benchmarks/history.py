"""CPU times of this version, in the table of all versions.

    python -m benchmarks.history

Writes the row of the installed version of ``docs/evidence/history.csv``, or replaces it: a shift of
a search in both engines (``benchmarks.engines``), a ``check`` at first use, when all functions are
compiled, and again, and ``expect`` to 1 % of the mean. Commands run in processes of their own, with
empty caches of simulations; their CPU time has start and imports. The row has the load of the
machine before the first measurement, as rows of unlike load do not compare. Takes two minutes.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.engines import measure_batch
from benchmarks.field_table import EVIDENCE
from benchmarks.scale import cpu
from dogshape.sim.versions import versions

TABLE = EVIDENCE / "history.csv"
#: The dog of the README, which passes every check.
DOG = ("count=27", "chamfer_deg=12.5", "traction_deg=20", "braking_deg=22", "height_mm=2.6")
CHECK = ("check", "mq200", *(word for size in DOG for word in ("--set", f"dog.{size}")))
EXPECT = ("expect", "mq200_paper", "--precision", "0.01", "--jobs", "1")
ANGLES = 12  #: of the shifts at each operating point
Row = dict[str, str]


def measure_command(arguments: Sequence[str], compiled: Path) -> float:
    """Measure a command of the command line without earlier simulations, s.

    ``compiled`` is the folder of the compiled functions.
    """
    with TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(compiled), "XDG_CACHE_HOME": cache}
        start = cpu()
        subprocess.run(
            [sys.executable, "-m", "dogshape.pipeline", *arguments],
            env=environment,
            stdout=subprocess.DEVNULL,
            check=True,
        )
        return cpu() - start


def measure_version() -> Row:
    """Measure the CPU times of the installed version."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    batch = measure_batch(ANGLES)
    with TemporaryDirectory() as folder:
        compiled = Path(folder)
        first_use = measure_command(CHECK, compiled)
        check = measure_command(CHECK, compiled)
        measure_command(EXPECT, compiled)  # what only this command compiles
        expect = measure_command(EXPECT, compiled)
    return {
        "version": versions()["dogshape"],
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "compiled_shift_ms": f"{1e3 * batch.compiled:.3f}",
        "drake_shift_ms": f"{1e3 * batch.drake:.1f}",
        "ratio": f"{batch.drake / batch.compiled:.0f}",
        "first_use_s": f"{first_use:.1f}",
        "check_s": f"{check:.2f}",
        "expect_s": f"{expect:.2f}",
        "load_per_core": f"{load:.1f}",
        "processor": processor(),
    }


def processor() -> str:
    """Return the name of the processor as Linux states it."""
    lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "unknown"


def read_rows() -> list[Row]:
    """Read the rows of the table, the first version first."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def with_version(rows: Sequence[Row], row: Row) -> list[Row]:
    """Replace the row of the same version, or append the row."""
    versions_of_rows = [earlier["version"] for earlier in rows]
    if row["version"] not in versions_of_rows:
        return [*rows, row]
    return [row if earlier["version"] == row["version"] else earlier for earlier in rows]


def main() -> None:
    """Measure and write."""
    row = measure_version()
    rows = with_version(read_rows() if TABLE.exists() else [], row)
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    for name, text in row.items():
        print(f"{name:18s} {text}")


if __name__ == "__main__":
    main()
