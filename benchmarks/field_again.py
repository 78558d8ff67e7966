"""Diagnose the clear cases of a field set again, once its key is open.

    python -m benchmarks.field_again DIR [--least N] [--kinds KIND,...] [--every N] [--jobs N]

A set that was opened is no proof any more: what it taught may have been built in. It says whether
what was mended is mended, on the cases that could be told (noncentrality of 38 at least; another
with ``--least``, of cases without any effect 0). Marked like a sealed set's, and held against the
answers that were scored. DIR keeps the answers under ``again/``, and a run
that was stopped goes on.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dogshape.validation.blind.case_diagnosis import diagnose_folder
from dogshape.validation.blind.field_score import CLEAR, LISTED, field_mark
from dogshape.validation.blind.sealed import pool, read, write

Record = dict[str, Any]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--least", type=float, default=CLEAR)
    parser.add_argument("--kinds", default=",".join(LISTED))
    parser.add_argument("--every", type=int, default=1, help="take each Nth of these cases")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    key = read(given.folder / "key.json", "bring the key")
    kinds = given.kinds.split(",")
    every = key["cases"].items()
    names = [n for n, c in every if c["kind"] in kinds and _clear(c, given.least)]
    names = names[:: given.every]
    (given.folder / "again").mkdir(exist_ok=True)
    with pool(given.jobs) as submit:
        futures = [submit(_diagnosed, given.folder, name) for name in names]
        answers = {n: f.result() for n, f in zip(names, futures, strict=True)}
    marks = [
        field_mark(n, key["cases"][n], key, {"diagnosis": answers[n], "time_s": 0.0}) for n in names
    ]
    print(f"cases with a noncentrality of {given.least:g} at least")
    print("kind      cases   leads (or its class)   named   of these right   unknown said")
    for kind in dict.fromkeys(one.kind for one in sorted(marks, key=lambda one: one.kind)):
        mine = [one for one in marks if one.kind == kind]
        named = [one.mark for one in mine if one.mark.named]
        print(
            f"{kind:9s} {len(mine):5d} {sum(one.mark.right_class for one in mine):13d} "
            f"{len(named):17d} {sum(one.named_right for one in named):14d} "
            f"{sum(one.recognised for one in mine):15d}"
        )
    scored = {n: read(given.folder / "results" / f"{n}.json", "")["diagnosis"] for n in names}
    print()
    for words, part in (
        ("leads", lambda one: one["hypotheses"][0]["effects"]),
        ("is named", lambda one: one["causes"]),
        ("is said", lambda one: one["verdict"]),
    ):
        moved = [n for n in names if part(answers[n]) != part(scored[n])]
        print(f"what {words} is as it was scored in {len(names) - len(moved)} of {len(names)}")
    none = [sum(one[n]["verdict"] == "none" for n in names) for one in (scored, answers)]
    print(f"none within the margin: {none[0]} as they were scored, {none[1]} now")
    print("\nthe three likeliest answers to each")
    for one in sorted(marks, key=lambda one: (one.kind, one.mark.name)):
        found = answers[one.mark.name]["hypotheses"][:3]
        said = ", ".join(
            f"{' + '.join(h['effects']) or 'none'} {h['probability']:.2f}" for h in found
        )
        truth = " + ".join(one.mark.truth or one.mark.outside)
        print(f"{one.kind}, {one.engine}, {one.stand}: {truth}\n    {said}")


def _clear(case: Mapping[str, Any], least: float) -> bool:
    return float(case["yardstick"].get("noncentrality", 0.0)) >= least


def _diagnosed(folder: Path, name: str) -> Record:
    path = folder / "again" / f"{name}.json"
    if not path.exists():
        write(path, json.dumps(diagnose_folder(folder / "cases" / name, 1)))
    return read(path, "remove it and run again")


if __name__ == "__main__":
    main()
