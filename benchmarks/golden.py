"""Write the JSON of the main verbs, to show that a change of the code moves no number.

    python -m benchmarks.golden [FOLDER]

Run it before and after the change into two folders and compare these with ``diff -r``. Versions,
durations and absolute paths are left out: two runs on one machine are equal byte for byte.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from itertools import chain
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
POINT = ("--mismatch-rpm", "50", "--force-N", "469")
DRAKE = ("--engine", "drake")
PLANAR = ("--engine", "planar")
SHIFT = ("shift", "mq200_paper", *POINT, "--angle-deg", "10")
#: A study at two operating points, with as little of Drake as it takes.
SMALL = (
    "operating.mismatch_rpm=[50, 149]",
    "operating.force_N=[469.0]",
    "variables.chamfer_deg=[6, 14]",
    "variables.height_mm=[2.8, 4.2]",
    "variables.count=[12, 24]",
    "search.startup=8",
    "expectation.angles=16",
    "search.audit_shifts=4",
    "search.confirm_angles=3",
    "search.confirm_designs=1",
)
CALLS = {
    "shift_drake": (*SHIFT, *DRAKE),
    "shift_planar": (*SHIFT, *PLANAR),
    "expect_drake": ("expect", "mq200_paper", *POINT, "--angles", "3", *DRAKE),
    "expect_planar": ("expect", "mq200", "--angles", "24", *PLANAR),
    "check": ("check", "mq200_paper"),
    "strength": ("strength", "mq200", *PLANAR),
    "gap_stand": ("diagnose", "mq200_stand"),
    "gap_adams": ("diagnose", "mq200_adams"),
    "study": (
        *("search", "mq200_paper", "--trials", "12", "--no-report", "--out", "study"),
        *chain.from_iterable(("--set", setting) for setting in SMALL),
    ),
}
#: Keys whose values differ between two runs or two machines.
IGNORED_KEYS = {"versions", "seconds", "seconds_cpu"}


def main() -> None:
    """Write one file for each call."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("build/golden"))
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    # An empty folder and no cache: nothing is taken from an earlier run.
    settings = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    for name, arguments in CALLS.items():
        print(name, flush=True)
        with tempfile.TemporaryDirectory() as work:
            result = subprocess.run(
                [sys.executable, "-m", "dogshape.pipeline", *arguments, "--json"],
                cwd=work,
                env={**os.environ, **settings},
                stdout=subprocess.PIPE,
                text=True,
                check=False,
            )
            if result.returncode > 1:
                sys.exit(result.returncode)
            text = json.dumps(_without_ignored_keys(json.loads(result.stdout)), indent=1)
            for folder_path in (work, str(ROOT)):
                text = text.replace(folder_path, "")
        (folder / f"{name}.json").write_text(f"{text}\n", encoding="utf-8")


def _without_ignored_keys(value: Any) -> Any:
    """Return a value without the keys of ``IGNORED_KEYS``, at any depth."""
    if isinstance(value, dict):
        return {
            key: _without_ignored_keys(inner)
            for key, inner in value.items()
            if key not in IGNORED_KEYS
        }
    return [_without_ignored_keys(inner) for inner in value] if isinstance(value, list) else value


if __name__ == "__main__":
    main()
