"""Measure the error of the emulator at the true values of a field set whose key is open.

    python -m benchmarks.field_rest DIR

Each case of the list is predicted by the emulator of the diagnosis at the values that it was made
with. Change of the mean times by the effects, there and in the engine of the case without scatter
(``expected`` of the key): what both differ by is root mean square over the operating points, as a
share of the mean time without any effect, and over the error that the emulator states; median over
the cases of each kind and engine. What the engines differ by without any effect cancels, so single
effects say how unlike the engines are where effects act, and pairs and threes what combining
effects adds.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from dogshape.validation.blind.case_diagnosis import seen_by
from dogshape.validation.blind.field_set import STANDS
from dogshape.validation.blind.sealed import opened
from dogshape.validation.blind.yardstick import Yardstick

KINDS = ("single", "beyond", "pair", "three")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    given = parser.parse_args()
    key = opened(given.folder)
    stands = sorted({case["stand"] for case in key["cases"].values()})
    sticks = {one: Yardstick(seen_by(given.folder / STANDS / one, 1)) for one in stands}
    rows: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for case in key["cases"].values():
        if case["kind"] not in KINDS:
            continue
        stick, places = sticks[case["stand"]], case["places"]
        found = stick.at_truth(case["parameters"])
        if found is None:
            continue
        reference = key["references"][f"{case['engine']}_{case['stand']}"]
        plain = np.array(reference["mean"], dtype=float)[places]
        change = np.array(case["expected"]["mean"], dtype=float) - plain
        missed = change - found.mean[0, places]
        error = np.hypot(found.error[0, places], found.common[0, places])
        share = missed / stick.baseline[places]
        rows[case["kind"], case["engine"]].append(
            tuple(float(np.sqrt(np.nanmean(one**2))) for one in (share, missed / error))  # type: ignore[arg-type]
        )
    print("median of what is missed, root mean square over a case's points")
    print("kind     engine   cases   of the mean time   of the stated error")
    for kind in KINDS:
        for engine in sorted({engine for _, engine in rows}):
            mine = np.array(rows.get((kind, engine), []))
            if mine.size:
                share, errors = np.nanmedian(mine, axis=0)
                print(f"{kind:8s} {engine:8s} {len(mine):5d} {100 * share:16.1f} % {errors:17.1f}")


if __name__ == "__main__":
    main()
