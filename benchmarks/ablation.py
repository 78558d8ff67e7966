"""Figures of a sealed field set without one part of the diagnosis at a time.

    python -m benchmarks.ablation results/field

The set must be diagnosed (``dogshape blind run``). A part is left out where it can decide: angles
that are not uniform and their two modes where the diagnosis gives them 2 % or more, meanings of the
record where one is not noted. Without the rule for invisible effects the answer is that by
evidence. The key is opened. Takes half a minute of processor time for each case diagnosed again;
a stopped run goes on.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.inference.verdict import credible_set, parts_of
from dogshape.diagnosis.prediction import model
from dogshape.diagnosis.prediction.moments import Modes, modes_of
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, UNKNOWN
from dogshape.pipeline.diagnose import bank_diagnosis
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions, diagnose_bench
from dogshape.sim.effects import load
from dogshape.validation.blind import score, sealed
from dogshape.validation.blind.verbs import figure_text

Record = dict[str, Any]

ANGLES = "relative_angle"
MIN_INCLUSION = 0.02  #: of angles that are not uniform, from which a case is diagnosed again
DEFAULT_RECORD = {"time_zero": "command", "displacement_at": "sleeve"}
FIGURES = ("single_named", "pair_named", "true_names", "wrong_sure", "credible", "sizes")


def diagnose_without_modes(folder: Path) -> Record:
    """Diagnose a case with one mode of shift times under any angles."""

    def one_mode(times: Any, is_timely: Any, weights: Any) -> Modes:
        modes = modes_of(times, is_timely, weights)
        ones = np.ones_like(modes.kurtosis)
        return Modes(ones, ones, ones, modes.kurtosis)

    with patch.object(model, "modes_of", one_mode):
        return _diagnose(folder)


def diagnose_without_angles(folder: Path) -> Record:
    """Diagnose a case with uniform relative angles under every hypothesis."""
    effects = {name: effect for name, effect in load(None).items() if name != ANGLES}
    with patch.object(bank_diagnosis, "load", lambda _: effects):
        return _diagnose(folder)


def diagnose_without_meanings(folder: Path) -> Record:
    """Diagnose a case with the usual meaning of what its record leaves out."""
    return _diagnose(folder, DEFAULT_RECORD)


def _diagnose(folder: Path, defaults: Mapping[str, str] | None = None) -> Record:
    bench = load_bench(folder)
    unknown = {k: v for k, v in (defaults or {}).items() if getattr(bench.record, k) == "unknown"}
    bench = replace(bench, record=bench.record.model_copy(update=unknown))
    return diagnose_bench(bench, BankOptions(jobs=1, engine="planar")).to_dict()


def has_angles(diagnosis: Record) -> bool:
    """Test whether angles that are not uniform may decide a diagnosis."""
    return diagnosis.get("inclusion", {}).get(ANGLES, 0.0) >= MIN_INCLUSION


def has_unknown(diagnosis: Record) -> bool:
    """Test whether the record of a case leaves something out that has a usual meaning."""
    record = diagnosis.get("record", {})
    return any(record.get(key) == "unknown" for key in DEFAULT_RECORD)


#: Parts by name of their results: words, what a case must have, and the diagnosis without it.
PARTS: dict[str, tuple[str, Callable[[Record], bool], Callable[[Path], Record]]] = {
    "without_modes": ("two modes", has_angles, diagnose_without_modes),
    "without_angles": ("angles that are not uniform", has_angles, diagnose_without_angles),
    "without_meanings": ("meanings of the record", has_unknown, diagnose_without_meanings),
}


def by_evidence(diagnosis: Record) -> Record:
    """Conclude by evidence alone, where invisible effects do not count as absent."""
    if "hypotheses" not in diagnosis:
        return diagnosis
    hypotheses = [{**h, "probability": h["evidence_probability"]} for h in diagnosis["hypotheses"]]
    hypotheses.sort(key=lambda h: -h["probability"])
    posterior = {tuple(h["effects"]): h["probability"] for h in hypotheses}
    verdict = diagnosis["verdict"]
    causes = diagnosis["causes"]
    if verdict in ("effect", "ambiguous"):
        top = next(iter(posterior))
        is_named = top not in (NONE, UNKNOWN) and USUAL.names(top, posterior[top])
        verdict = "effect" if is_named else "ambiguous"
        causes = list(top if is_named else parts_of(posterior, USUAL))
    credible = [list(h) for h in credible_set(posterior, USUAL.credible)]
    changes = {"hypotheses": hypotheses, "verdict": verdict, "causes": causes}
    return {**diagnosis, **changes, "credible_set": credible}


def result_of(
    results: Mapping[str, Record],
    has_part: Callable[[Record], bool],
    diagnose: Callable[[Path], Record],
    case: Path,
) -> Record:
    """Diagnose a case without a part; where it has none, take the result of the set."""
    diagnosis = results[case.name].get("diagnosis", {})
    return diagnose(case) if has_part(diagnosis) else diagnosis


def figures_of(folder: Path, name: str) -> Mapping[str, score.Interval]:
    """Score the results of a folder within a set, by figure."""
    record = score.score_field(folder, None, results_name=name)
    return {row["name"]: row["figure"] for row in record["headline"]}


def changed_count(results: Mapping[str, Record], others: Mapping[str, Record]) -> int:
    """Count the cases whose verdict or causes differ."""
    keys = ("verdict", "causes")
    return sum(
        any(results[n].get("diagnosis", {}).get(k) != o.get("diagnosis", {}).get(k) for k in keys)
        for n, o in others.items()
    )


def main() -> None:
    """Print the figures with all parts, and without each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    folder = arguments.folder
    results = sealed.results_of(folder)
    rows = [("all", "-", "-", figures_of(folder, sealed.RESULTS))]
    for name, (words, has_part, diagnose) in PARTS.items():
        without = partial(result_of, results, has_part, diagnose)
        others = sealed.run(folder, without, arguments.jobs, results_name=name)
        tried = sum(has_part(result.get("diagnosis", {})) for result in results.values())
        changed = changed_count(results, others)
        rows.append((f"without {words}", str(tried), str(changed), figures_of(folder, name)))
    name = "by_evidence"
    (folder / name).mkdir(exist_ok=True)
    others = {}
    for case, result in results.items():
        others[case] = {**result}
        if "diagnosis" in result:
            others[case]["diagnosis"] = by_evidence(result["diagnosis"])
        (folder / name / f"{case}.json").write_text(json.dumps(others[case]), encoding="utf-8")
    changed = str(changed_count(results, others))
    rows.append(("without the rule for invisible effects", "-", changed, figures_of(folder, name)))
    print(f"{len(results)} cases")
    for label, tried_text, changed_text, figures in rows:
        print(f"\n{label}: {tried_text} cases diagnosed again, {changed_text} verdicts change")
        for figure in FIGURES:
            print(f"  {figure:13s} {figure_text(figures[figure])} of {figures[figure]['n']}")


if __name__ == "__main__":
    main()
