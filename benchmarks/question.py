"""What designs of two questions are worth under the harder one, and what its limits cost.

    python -m benchmarks.question

The study ``mq200`` asks with a mechanism, under contact that is not known for sure, for
designs nowhere slower than the prototype that keep every margin with tolerances at their worst.
The first table judges by it the prototype, designs that ``mq200_paper`` found and the one that it
chose itself: expected times from Drake at 16 angles that no search used; loss on the prototype and
landing from the compiled engine at 64. The second searches by the compiled engine alone, with and
without the limits. Takes a quarter of an hour on two cores.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.confirmation import resimulated
from dogshape.pipeline.search.tolerance_effects import smallest_within
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from dogshape.sim.bundled import bundled_root
from dogshape.sim.strength.checks import smallest_margin

NAME = "mq200"
OLD = (43, 44, 21)  #: trials of ``mq200_paper``: chosen, next on the front, the one locking latest
QUESTIONS = {
    "all limits": [],
    "slower at some points": ["search.limits={smallest_margin_worst=0.0}"],
    "no limits": ["search.limits={}"],
}
TRIALS = 40  #: of each of these searches


def kept(study: str) -> dict[str, Any]:
    """Read the kept result of a bundled study."""
    text = (bundled_root() / study / "result.json").read_text(encoding="utf-8")
    record: dict[str, Any] = json.loads(text)
    return record


def designs_of(study: Setup) -> dict[str, dict[str, float]]:
    """Collect the designs that are judged, by name."""
    old = {row["trial"]: row for row in kept("mq200_paper")["trials"]}
    rows = {"prototype": study.prototype}
    rows |= {f"mq200_paper, {trial}": old[trial] for trial in OLD}
    rows["mq200, chosen"] = kept(NAME)["best"]
    return {name: {key: row[key] for key in study.variables} for name, row in rows.items()}


def judge(study: Setup) -> None:
    """Print what each design is worth under the question."""
    designs = designs_of(study)
    numbered = dict(enumerate(designs.values()))
    found = resimulated(study, numbered, scratch_executor())
    first = found[0].expectation
    print("                                                slower by  least margin")
    print(
        "design            time, ms         gain, ms     %    at most"
        "                       at worst"
    )
    for (name, params), one in zip(designs.items(), found.values(), strict=True):
        design, mean = design_of(study, params, one.measured), one.expectation
        gain = first.mean - mean.mean
        error = (first.standard_error**2 + mean.standard_error**2) ** 0.5
        lost = one.measured.limited["slower_than_reference_s"]
        own = [check for check in design.checks if check.rule.group != "goal"]
        least, worst = smallest_margin(own), smallest_within(study, design)["margin_worst_case"]
        print(
            f"{name:16s} {mean.mean * 1e3:6.1f} +- {mean.standard_error * 1e3:3.1f} "
            f"{gain * 1e3:8.1f} +- {error * 1e3:3.1f} {gain / first.mean:5.0%} "
            f"{lost * 1e3:10.1f}  {least.margin:6.1%} {least.name:24s} {worst:6.1%}",
            flush=True,
        )


def search(study: Setup, folder: Path) -> None:
    """Print what a search finds, by the compiled engine alone."""
    result = run_study(study, Run(StudyFolder(folder), report=False))
    best, told = result["confirmation"]["best"], result["best"]
    values = " ".join(f"{told[key]:7.2f}" for key in study.variables)
    proto = result["confirmation"]["prototype"]["expected_shift_time_s"]
    time = best["expected_shift_time_s"]
    print(
        f"{values} {time * 1e3:8.1f} +- {best['standard_error_s'] * 1e3:3.1f} "
        f"{(proto - time) / proto:6.0%} {result['n_simulated_designs']:8d}",
        flush=True,
    )


def main() -> None:
    """Print both tables."""
    study = load_study(NAME)
    judge(study)
    keys = "chamfer traction braking height  count"
    print(f"\nsearched by the compiled engine   {keys}   time, ms   gain  simulated")
    quick = ["solver.engine=planar", f"search.trials={TRIALS}"]
    for name, more in QUESTIONS.items():
        print(f"{name:32s}", end=" ")
        with tempfile.TemporaryDirectory() as folder:
            search(load_study(NAME, [*quick, *more]), Path(folder) / "out")


if __name__ == "__main__":
    main()
