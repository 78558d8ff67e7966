"""Whether the bundled rows make a search better: the paper's study with and without them.

    python -m benchmarks.cold_start [--seeds N] [--jobs N]

Both searches have as many designs, all operating points and the compiled engine, whose means are
Drake's to a hundredth of a percent, so that no shift decides. With the rows a search begins with
what the package brings, taken as the compiled engine's; without them with designs that fill the
space. Of a hundred landings one may be harder than the checks take. The fronts that both declare
after so many designs are simulated again at new angles, those that fail there left out. Told is
their hypervolume up to a quarter beyond the prototype, and the processor time. Takes some three
minutes of a processor a seed.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.dog_guide import DogGuide
from dogshape.pipeline.search.rounds import run
from dogshape.pipeline.search.samplers import sampler_factory
from dogshape.pipeline.search.search import open_search
from dogshape.pipeline.search.state import SearchState
from dogshape.pipeline.simulate.design import SIMULATED, design_of, values_of
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, evaluate
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.found_surrogates import known_surrogate
from dogshape.sim.units import MM
from dogshape.sim.versions import engine
from dogshape.surrogate.hypervolume import hypervolume
from dogshape.surrogate.model import Surrogate

ANGLES, DENSE = 16, 48  #: of the search, and new ones of a declared design, at each point
AFTER = (24, 36, 48)  #: designs after which fronts are compared
SHARE = 0.01  #: of shifts that may land harder than the checks take: no extreme of the sample
BEYOND = 1.25  #: the hypervolume's reference point, over the prototype's time and length

Fronts = dict[int, list[dict[str, float]]]


def main() -> None:
    """Run the searches and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    print(f"hypervolume after {AFTER} designs as a share of that with the rows at the "
          "end; minutes of a processor without simulations of the fronts")  # fmt: skip
    for seed in range(1, given.seeds + 1):
        study = _study(seed)
        found = {known: _search(study, known, given.jobs) for known in (True, False)}
        volumes = {
            known: _volumes(study, fronts, given.jobs) for known, (fronts, _) in found.items()
        }
        for known, (_, minutes) in found.items():
            shares = "".join(f"{v / volumes[True][-1]:>8.3f}" for v in volumes[known])
            name = "with the rows" if known else "without"
            print(f"seed {seed}, {name:<14}{shares}{minutes:>8.1f}", flush=True)


def _study(seed: int) -> Setup:
    settings = {
        "solver.engine": "planar", "expectation.angles": ANGLES, "search.points": None,
        "search.trials": AFTER[-1], "search.seed": seed, "load.landing_share": SHARE,
    }  # fmt: skip
    return load_study("mq200_paper", settings)


def _brought(study: Setup) -> Surrogate:
    """Take the rows that the package brings as the compiled engine's."""
    brought = known_surrogate(load_study("mq200_paper"))
    if brought is None:
        raise SystemExit("the package brings no surrogate for this physics")
    data = replace(brought.surrogate.data, physics=study.physics, engine=engine(), levels={})
    return replace(brought.surrogate, data=data)


def _search(study: Setup, known: bool, jobs: int) -> tuple[Fronts, float]:
    """Search once; give the front after so many designs, and minutes of a processor."""
    guide, fronts, begun = DogGuide(study, _brought(study) if known else None), Fronts(), _spent()
    with TemporaryDirectory() as folder:
        root = StudyFolder(Path(folder))
        opened = open_search(study, root, None, False, guide=guide)

        def after_round(_: str, state: SearchState) -> None:
            told = len(state.trials)
            for count in AFTER:
                if told <= count:
                    fronts[count] = [dict(trial.params) for trial in state.front]

        executor = Executor(ShiftJournal(root.shifts), jobs)
        run(opened, sampler_factory(study, guide), executor, after_round)
    return fronts, (_spent() - begun) / 60.0


def _spent() -> float:
    return time.process_time()


def _volumes(study: Setup, fronts: Fronts, jobs: int) -> list[float]:
    """Simulate declared fronts at new angles and give their hypervolumes."""
    every = [study.prototype, *(design for front in fronts.values() for design in front)]
    once = {tuple(design.items()): design for design in every}
    dogs = [study.dog_with(design) for design in once.values()]
    seed = study.file.expectation.seed + NEW_ANGLES
    plans = [whole_plan(study, DENSE)] * len(dogs)
    found = evaluate(study, dogs, scratch_executor(jobs), plans, seed)
    values = {}
    for (key, params), one in zip(once.items(), found, strict=True):
        design = design_of(study, params, one.measured)
        told = values_of(study, design, {SIMULATED: one.expectation.mean})
        values[key] = np.array(told) if design.feasible else np.full(2, np.inf)
    length = study.clutch.dog.axial_length / MM
    beyond = BEYOND * np.array([found[0].expectation.mean, length])
    return [
        hypervolume(np.array([values[tuple(one.items())] for one in fronts[count]]), beyond)
        for count in AFTER
    ]


if __name__ == "__main__":
    main()
