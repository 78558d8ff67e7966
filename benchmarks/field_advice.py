"""Advised tests of a field set that was scored: foreseen and found, by what the truth is.

    python -m benchmarks.field_advice DIR

The score of a field set has one figure over all cases whose cause is open. Here they are by the
kind of the truth and by the kind of the test: how often the diagnosis foresees that the test
settles the cause, how often that comes true by what it means there, and by the stricter rule of the
score how often it settles on what the data can show, on a part of the truth, and on what is not
true. A diagnosis calls settled, too, what is named as part of the cause in any case: each of its
effects with 0.95, and nothing else. The key is open. Half a minute.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dogshape.diagnosis.inference.posterior import inclusion
from dogshape.diagnosis.inference.verdict import PART
from dogshape.validation.blind.advised_test import KINDS, Advised
from dogshape.validation.blind.case_marks import Names
from dogshape.validation.blind.score import advised_test, chance_to_settle, field_mark
from dogshape.validation.blind.sealed import opened, results_of


@dataclass(frozen=True)
class Row:
    """Advised test of a case: kind of its truth, what came of the test, and what was foreseen.

    ``true`` tells that the cause is settled as the diagnosis means it.
    """

    kind: str
    test: Advised
    foreseen: float | None
    true: bool


def rows_of(folder: Path) -> list[Row]:
    """Make the advised test of each case whose cause is open."""
    key, results = opened(folder), results_of(folder)
    found = []
    for name, truth in key["cases"].items():
        one, answer = field_mark(name, truth, key, results[name]), results[name].get("diagnosis")
        if answer and one.cause_open and "kind" in answer["next_test"]:
            test = advised_test(folder, one, truth, answer)
            true = test.settled or _named(test.chances, (test.truth, *one.mark.also))
            found.append(Row(one.kind, test, chance_to_settle(answer), true))
    return found


def _named(chances: Mapping[Names, float], truths: Sequence[Names]) -> bool:
    """Test that the effects of a truth, and no others, are part of the cause in any case."""
    sure = {name for name, chance in inclusion(chances).items() if chance > PART}
    return bool(sure) and any(sure == set(truth) for truth in truths)


def _line(words: str, rows: Sequence[Row]) -> str:
    foreseen = [row.foreseen for row in rows if row.foreseen is not None]
    whole = f"{np.mean(foreseen):9.2f}" if foreseen else f"{'-':>9s}"
    tests = [row.test for row in rows]
    parts = [
        np.mean([row.true for row in rows]),
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
    heads = "cases foreseen came true  settled  on part  wrongly"
    print(f"{'truth, test':24s} {heads}")
    print(_line("all", rows))
    for kind in sorted({row.kind for row in rows}):
        mine = [row for row in rows if row.kind == kind]
        print(_line(kind, mine))
        for test in KINDS:
            if some := [row for row in mine if row.test.kind == test]:
                print(_line(f"  {test}", some))


if __name__ == "__main__":
    main()
