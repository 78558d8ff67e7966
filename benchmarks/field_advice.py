"""Advised tests of a field set that was scored: foreseen and found, by what the truth is.

    python -m benchmarks.field_advice DIR

The score of a field set has one figure over all cases whose cause is open. Here they are by the
kind of the truth and by the kind of the test: how often the diagnosis foresees that the test
settles the cause, how often it does on what the data can show, on a part of the truth, and on what
is not true. The key is open. Half a minute.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dogshape.validation.blind.advised_test import KINDS, Advised
from dogshape.validation.blind.field_score import advised_test, chance_to_settle, field_mark
from dogshape.validation.blind.sealed import opened, results_of

Row = tuple[str, Advised, float | None]  #: kind of the truth, its test, chance foreseen


def rows_of(folder: Path) -> list[Row]:
    """Make the advised test of each case whose cause is open."""
    key, results = opened(folder), results_of(folder)
    found = []
    for name, truth in key["cases"].items():
        one, answer = field_mark(name, truth, key, results[name]), results[name].get("diagnosis")
        if answer and one.cause_open and "kind" in answer["next_test"]:
            test = advised_test(folder, one, truth, answer)
            found.append((one.kind, test, chance_to_settle(answer)))
    return found


def _line(words: str, rows: Sequence[Row]) -> str:
    foreseen = [chance for _, _, chance in rows if chance is not None]
    whole = f"{np.mean(foreseen):9.2f}" if foreseen else f"{'-':>9s}"
    tests = [test for _, test, _ in rows]
    parts = [
        np.mean([one.settled for one in tests]),
        np.mean([one.part for one in tests]),
        np.mean([one.wrong and not one.part for one in tests]),
    ]
    return f"{words:24s}{len(rows):6d}{whole}" + "".join(f"{part:9.2f}" for part in parts)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    rows = rows_of(parser.parse_args().folder)
    heads = "cases foreseen  settled  on part  wrongly"
    print(f"{'truth, test':24s} {heads}")
    print(_line("all", rows))
    for kind in sorted({kind for kind, _, _ in rows}):
        mine = [row for row in rows if row[0] == kind]
        print(_line(kind, mine))
        for test in KINDS:
            if some := [row for row in mine if row[1].kind == test]:
                print(_line(f"  {test}", some))


if __name__ == "__main__":
    main()
