"""The surrogate of a clutch that was never seen, judged by designs that it never saw.

    python -m benchmarks.surrogate_validation [--clutch NAME ...] [--jobs N]

Fits a clutch as ``dogshape fit`` does, without the rows that the package brings. References that no
fit saw, 40 that fill the space and 20 of the best tenth, judge it; they are denser than those of a
fit. *s.e.* is the error of a reference's own time; *of exact times* is the rank correlation that
exact times would have with the references of the best, by their errors. Shifts are kept in
``results/surrogate_validation-NAME``, and a second run simulates none. Takes half an hour.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.progress import SILENT
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.train.training import fill, simulated_data, train
from dogshape.surrogate.dataset import Dataset

ERROR_DRAWS = 1000  #: of the errors of references
REFERENCE_ANGLES = 64  #: of each operating point of a reference
SEED = 20  #: of designs, angles and references: no form or number was chosen by these
POINTS = {"operating.mismatch_rpm": [5.0, 25.0, 100.0, 249.0]}
CLUTCHES: dict[str, dict[str, object]] = {
    "prototype": {},
    "small": {
        "dog.outer_diameter_mm": 40.0,
        "dog.inner_diameter_mm": 33.0,
        "dog.count": 12,
        "dog.height_mm": 3.0,
        "sliding.mass_kg": 0.15,
        "sliding.inertia_kgm2": 0.003,
        "output.inertia_kgm2": 0.2,
        "load.torque_Nm": 90.0,
        "actuation.force_N": [120.0, 350.0],
        "actuation.rise_s": [0.22, 0.13],
        "operating.force_N": [120.0, 350.0],
        **POINTS,
    },
    "large": {
        "dog.outer_diameter_mm": 92.0,
        "dog.inner_diameter_mm": 78.0,
        "dog.count": 18,
        "dog.height_mm": 5.0,
        "sliding.mass_kg": 1.1,
        "sliding.inertia_kgm2": 0.06,
        "output.inertia_kgm2": 4.0,
        "load.torque_Nm": 800.0,
        "load.separating_force_limit_N": 12000.0,
        "actuation.force_N": [500.0, 1500.0],
        "actuation.rise_s": [0.22, 0.15],
        "operating.force_N": [500.0, 1500.0],
        **POINTS,
    },
}  #: settings of clutches upon ``mq200_paper``


def rank_ceiling(best: Dataset) -> float:
    """Compute the rank correlation that exact times have with references, by their errors.

    The mean over draws: true times are the references' with as much less scatter as errors add.
    """
    grid = best.engaging
    weights = best.mix.weights
    rng = np.random.default_rng(0)
    times = grid.means @ weights
    errors = np.sqrt(grid.errors**2 @ weights**2)
    deviation = times - times.mean()
    error_variance = float((errors**2).mean())
    true = deviation * max(0.0, 1.0 - error_variance / float(deviation.var())) ** 0.5
    draws = true + errors * rng.standard_normal((ERROR_DRAWS, len(true)))
    return float(np.mean([spearmanr(true, draw).statistic for draw in draws]))


def study_of(clutch: str) -> Setup:
    """Return the study of a clutch: denser references than a fit makes."""
    overrides: dict[str, object] = {
        "name": f"surrogate_validation-{clutch}",
        "surrogate.reference_angles": REFERENCE_ANGLES,
        "surrogate.seed": SEED,
    }
    return load_study("mq200_paper", CLUTCHES[clutch] | overrides)


def print_validation(clutch: str, jobs: int) -> None:
    """Simulate a clutch, fit it, and print its validation."""
    study = study_of(clutch)
    folder = StudyFolder(Path("results") / study.name)
    fill(study, folder, jobs, None, SILENT)
    stored = train(folder)
    v = stored.validation
    best = simulated_data(study.search_setup, folder.simulated, "best_references")
    print(
        f"{clutch:<10}{len(stored.surrogate.data):8d}{v.rmse_s * 1e3:9.2f}"
        f"{v.bias_s * 1e3:+9.2f}{v.noise_s * 1e3:9.2f}  {v.q2:.3f}{v.coverage_95:9.0%}"
        f"{v.q2_points:11.3f}{v.coverage_points:9.0%}{v.rank_best or np.nan:14.2f}"
        f"{rank_ceiling(best):16.2f}",
        flush=True,
    )


def main() -> None:
    """Judge the clutches that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clutch", choices=CLUTCHES, nargs="+", default=list(CLUTCHES))
    parser.add_argument("--jobs", type=int, default=0)
    arguments = parser.parse_args()
    print(
        "clutch     designs  rmse,ms  bias,ms  s.e.,ms  Q2     in 95 %  Q2 points  in 95 %"
        "  rank of best  of exact times"
    )
    for clutch in arguments.clutch:
        print_validation(clutch, arguments.jobs)


if __name__ == "__main__":
    main()
