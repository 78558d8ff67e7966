"""Headline figures of an opened field set without each part of the diagnosis.

    python -m benchmarks.ablation DIR [--cases N] [--jobs N] [--kept FILE]

DIR is a field set whose key is open, made and run by ``dogshape blind``. The first N cases in a
fixed random order are diagnosed once with all parts and once without each; the last two rows have
one wrong entry in each table, half as long again or two fifths shorter. ``d ln p`` is the change of
the log probability of the truth, mean over the cases with its standard error. FILE keeps finished
diagnoses, from which a stopped run goes on.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.kept_rows import kept_rows
from dogshape.diagnosis import diagnosis
from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.likelihood.observed import Observed
from dogshape.diagnosis.prediction import model
from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.diagnose.bank_diagnosis import Means, diagnosed
from dogshape.validation.blind.case_diagnosis import ENGINE
from dogshape.validation.blind.score import Mark, headline, mark_of
from dogshape.validation.blind.sealed import opened

KEPT = Path("results") / "ablation.jsonl"
SHOWN = ("named", "leads", "whole_truth", "false_alarms", "none_shown", "unknown", "credible")
SHOWN += ("sizes", "cpu_s")
LEAST = 1e-3  #: probability of a truth that counts as not seen
NEVER = 1e-300  #: probability of what is left out

Record = dict[str, Any]  #: a diagnosis, or the truths of a key
Patch = tuple[Any, str, Any]  #: module, name and value


@dataclass(frozen=True)
class Part:
    """Part of the diagnosis: settings and patches that leave it out, on data with a wrong entry."""

    name: str
    settings: dict[str, Any]
    patches: tuple[Patch, ...] = ()
    wrong: bool = False


def _observing(**changes: Callable[[Observed], Any]) -> tuple[Patch, ...]:
    """Patch the observations of a data set."""
    plain = diagnosis.observe

    def observe(*given: Any) -> Observed:
        seen = plain(*given)
        return replace(seen, **{name: change(seen) for name, change in changes.items()})

    return ((diagnosis, "observe", observe),)


PARTS = (
    Part("all parts", {}),
    Part("odd means", {"odd_share": NEVER}),
    Part("odd spreads", {"odd_spread": NEVER}),
    Part("spreads", {}, _observing(freedom=lambda seen: 0.0 * seen.freedom)),
    Part("late shifts within means", {}, _observing(hidden=lambda seen: seen.hidden & False)),
    Part("three effects at once", {"most": 2}),
    Part("contact as a nuisance", {"nuisance": 1.001}),
    Part("discrepancy", {"discrepancy": 1e-3}),
    Part("error of effect laws", {"law": 0.0}),
    Part("error of effects together", {}, ((model, "COMBINED", 0.0),)),
    Part("error of interpolation", {}, ((model, "MISSED", (0.0, 0.0)), (model, "BLOCKED", 0.0))),
    Part("unseen effects as absent", {}, ((diagnosis, "unseen", lambda *_: {}),)),
    Part("floor", {"floor": 0.0}),
    Part("all parts, a wrong entry", {}, wrong=True),
    Part("odd means, a wrong entry", {"odd_share": NEVER}, wrong=True),
)


def with_wrong_entry(bench: Bench, seed: int) -> Bench:
    """Multiply all times of one operating point by 1.5 or 0.6."""
    generator, cells = np.random.default_rng(seed), list(bench.cells)
    place = generator.choice([k for k, cell in enumerate(cells) if cell.time is not None])
    factor = generator.choice([1.5, 0.6])
    readings = [
        replace(one, time=None if one.time is None else factor * one.time)
        for one in cells[place].readings
    ]
    cells[place] = replace(cells[place], readings=tuple(readings))
    return replace(bench, cells=tuple(cells))


def found(folder: Path, truths: Record, part: int, name: str) -> Record:
    """Diagnose a case without a part: its record."""
    one = PARTS[part]
    means = Means(jobs=1, engine=ENGINE, settings=replace(USUAL, **one.settings))
    with ExitStack() as stack:
        for place in one.patches:
            stack.enter_context(patch.object(*place))
        bench = load_bench(folder / "cases" / name)
        if one.wrong:
            bench = with_wrong_entry(bench, truths[name]["seed"])
        record = diagnosed(bench, means).to_dict()
    keys = ("hypotheses", "verdict", "causes", "credible_set", "next_test", "seconds")
    return {key: record[key] for key in keys}


def marks_of(
    folder: Path, names: Sequence[str], truths: Record, jobs: int, path: Path
) -> dict[tuple[int, str], Mark]:
    """Diagnose the cases without each part, but for what the file has: marks by part and case."""
    keys = [(part, name) for part in range(len(PARTS)) for name in names]
    records = kept_rows(path, keys, partial(found, folder, truths), jobs)
    results = {key: {"diagnosis": one, "cpu_s": one["seconds"]} for key, one in records.items()}
    return {
        (part, name): mark_of(folder, name, truths[name], results[part, name], lambda *_: None)
        for part, name in keys
    }


def log_score(mark: Mark) -> float:
    """Compute the log probability of the truth, or of what data can show of it."""
    return float(np.log(max(LEAST, sum(mark.posterior.get(h, 0.0) for h in mark.seen))))


def main() -> None:
    """Diagnose and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=64)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kept", type=Path, default=KEPT)
    given = parser.parse_args()
    truths = opened(given.folder)["cases"]
    names = np.random.default_rng(1).permutation(sorted(truths))[: given.cases].tolist()
    marks = marks_of(given.folder, names, truths, given.jobs, given.kept)
    scores = np.array([[log_score(marks[k, n]) for n in names] for k in range(len(PARTS))])
    plain = {wrong: scores[[one.wrong for one in PARTS].index(wrong)] for wrong in (False, True)}
    print(f"{len(names)} cases\n")
    print(f"{'without':28}" + "".join(f"{name:>16}" for name in SHOWN) + f"{'d ln p':>18}")
    for k, one in enumerate(PARTS):
        mine = [marks[k, n] for n in names]
        figures = headline(mine)
        cells = [figures[name] for name in SHOWN]
        change = scores[k] - plain[one.wrong]
        words = [f"{c['value']:.2f} ({c['n']})" if c["n"] else "-" for c in cells]
        error = change.std() / len(change) ** 0.5
        print(
            f"{one.name:28}" + "".join(f"{word:>16}" for word in words)
            + f"{change.mean():+10.3f} ± {error:.3f}"
        )  # fmt: skip


if __name__ == "__main__":
    main()
