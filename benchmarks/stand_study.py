"""Compare designs with the stand's causes in every shift, over their posterior.

    dogshape gap mq200_stand --write stand.toml --base mq200
    dogshape study stand.toml --engine planar --set search.levels=1 --out results/stand
    dogshape gap mq200_stand --write damped.toml --base mq200 \\
        --causes actuation_delay,drag_torque,viscous_damping
    dogshape study damped.toml --engine planar --set search.levels=1 --out results/damped
    python -m benchmarks.stand_study damped.toml results/damped --also results/stand \\
        --draws stand.toml

The prototype, the best design of the study with the stand's causes and that of the default study
(``studies/mq200``) in the compiled engine, with these causes: at the posterior means, at the same
96 angles of each operating point, and at four at the draws beside ``--draws``, which have any third
effect by its probability. Intervals hold 90 % of the draws, of which all designs have the same.
What searches with another third effect found is said first. Five minutes on two cores.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import dogshape as ds
from benchmarks.entries import ROOT
from dogshape.pipeline.reports.study.summary import headline

KEYS = ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")
COMPILED = {"solver.engine": "planar", "search.levels": 1}
ANGLES, DRAWN = 96, 4  #: at each operating point, at the means and at each draw
ENDS = (0.05, 0.5, 0.95)  #: of the draws


def best(folder: Path) -> dict[str, float]:
    """Read the dogs of the best design of a study."""
    found: dict[str, Any] = json.loads((folder / "result.json").read_text("utf-8"))["best"]
    return {key: found[key] for key in KEYS}


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--also", type=Path, nargs="*", default=[])
    parser.add_argument("--draws", type=Path)
    parser.add_argument("--jobs", type=int, default=0)
    given = parser.parse_args()
    for folder in given.also:
        print(f"{folder.name}: {headline(json.loads((folder / 'result.json').read_text('utf-8')))}")
    here, default = given.study.stem, best(ROOT / "studies/mq200")
    dogs = {"prototype": {}, here: best(given.folder), "default": default}
    means = {}
    for name, dog in dogs.items():
        means[name] = ds.Study(given.study, COMPILED, **dog).expect(angles=ANGLES, jobs=given.jobs)
        shown = ", ".join(f"{key} {value:.4g}" for key, value in dog.items())
        time, error = (1e3 * one for one in (means[name].time_s, means[name].standard_error_s))
        print(f"{name:10s} {time:6.1f} +- {error:.1f} ms   {shown}".rstrip(), flush=True)
    drawn_study: Path = given.draws or given.study
    draws, times = drawn_study.with_name(f"{drawn_study.stem}-draws.csv"), {}
    for name, dog in dogs.items():
        keys = {**COMPILED, **{f"dog.{key}": value for key, value in dog.items()}}
        drawn = ds.expect_draws(drawn_study, draws, keys, angles=DRAWN, jobs=given.jobs)
        times[name] = drawn.times
        print(f"{name:10s} over {len(drawn.times)} draws {_span(drawn.times)}", flush=True)
    for name in ("prototype", "default"):
        print(f"gain of {here} over {name:10s} {_span(times[name] - times[here])}")


def _span(values: np.ndarray) -> str:
    low, middle, high = 1e3 * np.quantile(values, ENDS)
    return f"{middle:6.1f} ms ({low:.1f} to {high:.1f})"


if __name__ == "__main__":
    main()
