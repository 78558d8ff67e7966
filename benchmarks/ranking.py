"""What physics beyond the paper's does to the order of designs.

    python -m benchmarks.ranking [--angles N] [--jobs N]

The prototype, 20 designs that fill the feasible space of ``mq200_paper`` and four that both studies
found, at the 28 operating points of the paper, by the compiled engine: with the study as it is, and
with one part of the clutch or of its contact after the other. The second row is the first one again
at other angles: what a setting moves beyond that is its own. Each row has Kendall's tau with the
order of the first one, the share of pairs told apart by their errors in both that change places,
what the design that leads the first row gains, and which one leads. Takes some minutes.
"""

from __future__ import annotations

import argparse
import math
from itertools import combinations, islice

import numpy as np
from scipy.stats import kendalltau

from benchmarks.contact_sets import kept
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, evaluate
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.pipeline.train.filling import filling_designs
from dogshape.sim.statistics.expectation import Expectation

SEED = 20261201
DRAWN = 20
FOUND = {"mq200_paper": (43, 44, 21)}  #: trials beside the design that ``mq200`` chose
SHAFTS = {
    "ring_inertia_kgm2": 5e-4,
    "input_stiffness_Nm_rad": 15e3,
    "wheel_inertia_kgm2": 0.01,
    "output_stiffness_Nm_rad": 8e3,
}
#: Values of docs/studies.md.
SETTINGS: dict[str, dict[str, float]] = {
    "as the paper has it": {},
    "the same at other angles": {"expectation.seed": 2},
    "friction in the toothing 0.1": {"mechanism.spline_friction": 0.1},
    "fork of 0.3 kg, drag of 0.1 N m": {
        "mechanism.added_mass_kg": 0.3,
        "mechanism.drag_torque_Nm": 0.1,
    },
    "shafts that give way": {f"mechanism.{key}": value for key, value in SHAFTS.items()},
    "and play of 0.2 degrees": {
        **{f"mechanism.{key}": value for key, value in SHAFTS.items()},
        "mechanism.spline_backlash_deg": 0.2,
    },
    "faces that throw back (1 s/m)": {"contact.dissipation_s_m": 1.0},
    "friction a third smaller": {
        "contact.static_friction": 0.08,
        "contact.dynamic_friction": 0.0667,
    },
    "friction a third larger": {
        "contact.static_friction": 0.16,
        "contact.dynamic_friction": 0.1333,
    },
    # Root fillets must not be larger; they do not move a shift.
    "edge radius 0.2": {"dog.edge_radius_mm": 0.2, "manufacturing.root_radius_mm": 0.2},
}


def designs_of(study: Setup) -> dict[str, dict[str, float]]:
    """Collect the designs, by name, the prototype first."""
    found = {"prototype": study.prototype}
    for name, trials in FOUND.items():
        rows = {row["trial"]: row for row in kept(name)["trials"]}
        found |= {f"{name}, {one}": {k: rows[one][k] for k in study.variables} for one in trials}
    best = kept("mq200")["best"]
    found["mq200, chosen"] = {key: best[key] for key in study.variables}
    drawn = islice(filling_designs(study, SEED, border=False), DRAWN)
    return found | {f"drawn {k}": design for k, design in enumerate(drawn)}


def expected(
    settings: dict[str, float], designs: dict[str, dict[str, float]], angles: int, run: Executor
) -> dict[str, Expectation]:
    """Compute the expected shift time of each design."""
    study = load_study("mq200_paper", {**settings, "solver.engine": "planar"})
    dogs = [study.dog_with(design) for design in designs.values()]
    plans = [whole_plan(study, angles)] * len(dogs)
    found = evaluate(study, dogs, run, plans, study.file.expectation.seed + 3 * NEW_ANGLES)
    return {name: one.expectation for name, one in zip(designs, found, strict=True)}


def exchanged(before: dict[str, Expectation], after: dict[str, Expectation]) -> float:
    """Compute the share of pairs told apart by two errors in both that change places."""
    told = moved = 0
    for one, other in combinations(before, 2):
        gaps = [found[one].mean - found[other].mean for found in (before, after)]
        errors = [
            math.hypot(found[one].standard_error, found[other].standard_error)
            for found in (before, after)
        ]
        if all(abs(gap) > 2.0 * error for gap, error in zip(gaps, errors, strict=True)):
            told += 1
            moved += gaps[0] * gaps[1] < 0.0
    return moved / max(told, 1)


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--angles", type=int, default=24)
    parser.add_argument("--jobs", type=int, default=0)
    given = parser.parse_args()
    designs = designs_of(load_study("mq200_paper"))
    run = scratch_executor(given.jobs)
    print(f"{len(designs)} designs, 28 operating points, {given.angles} angles each")
    print(f"{'':34s}prototype,  tau  exchanged  gain of the  best here")
    print(f"{'':34s}ms                          first best   and its gain")
    first, leader = None, ""
    for name, settings in SETTINGS.items():
        found = expected(settings, designs, given.angles, run)
        if first is None:
            first, leader = found, min(found, key=lambda one: found[one].mean)
        times = [np.array([one.mean for one in each.values()]) for each in (first, found)]
        here = min(found, key=lambda one: found[one].mean)
        base = found["prototype"].mean
        print(
            f"{name:34s}{base * 1e3:6.1f}    {kendalltau(*times).statistic:5.2f} "
            f"{exchanged(first, found):8.1%} {1.0 - found[leader].mean / base:12.0%}"
            f"       {here}, {1.0 - found[here].mean / base:.0%}",
            flush=True,
        )


if __name__ == "__main__":
    main()
