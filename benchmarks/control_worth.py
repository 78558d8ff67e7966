"""What shape and shift control of ``mq200_actuation`` are worth, each alone and together.

    python -m benchmarks.control_worth [--jobs N]

Prototype and chosen design, either operated as the study says and as the search operates the
chosen one, at every operating point and at angles that neither search nor confirmation used.
Simulated by the study's engine, the compiled one. Below, the shape of the prototype with one key
of the control at a time. Takes a minute.
"""

from __future__ import annotations

import argparse
import json

from dogshape.pipeline.config.set_point import OPERATED
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, evaluate
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.sim.bundled import bundled_root

NAME = "mq200_actuation"
ANGLES = 32


def told(study: Setup, params: dict[str, float], executor: Executor) -> str:
    """Return time, hardest blow and failed checks of a design in a line."""
    seed = study.file.expectation.seed + 2 * NEW_ANGLES
    dog, own = study.dog_with(params), study.operated(params)
    (found,) = evaluate(study, [dog], executor, [whole_plan(study, ANGLES)], seed, operated=[own])
    mean, error = 1e3 * found.expectation.mean, 1e3 * found.expectation.standard_error
    blow = found.estimates["impact_impulse_Ns"]
    failed = ", ".join(design_of(study, params, found.measured).failed) or "none"
    return (
        f"{mean:6.1f} +- {error:.1f} ms   blow {blow.value:.2f} +- {blow.standard_error:.2f} N s   "
        f"fails: {failed}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=0)
    executor = scratch_executor(parser.parse_args().jobs)
    study = load_study(NAME)
    kept = json.loads((bundled_root() / NAME / "result.json").read_text("utf-8"))
    own = study.prototype
    best = {key: kept["best"][key] for key in study.variables}
    control = {key: best[key] for key in OPERATED}
    shape = {key: best[key] for key in study.shape_keys}
    designs = {
        "prototype": own,
        "prototype, chosen control": own | control,
        "chosen shape, own control": own | shape,
        "chosen shape and control": best,
        **{f"prototype, {key} {value:.4g}": own | {key: value} for key, value in control.items()},
    }
    print(f"{len(study.points)} operating points, {ANGLES} angles each; {study.operating_text}")
    for name, params in designs.items():
        print(f"{name:38} {told(study, params, executor)}")


if __name__ == "__main__":
    main()
