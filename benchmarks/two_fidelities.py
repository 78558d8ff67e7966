"""The surrogate from rows of the compiled engine that pairs with Drake correct.

    python -m benchmarks.two_fidelities [--designs N] [--contact SET] [--clutch NAME]

Fits the paper's study, or that question for a clutch that the package has never seen, as
``dogshape fit --levels 2`` does, without the rows that the package
brings, and judges it by references in two levels, of which each has Drake's shifts of its own.
Beside it the same rows without the correction; ``docs/evidence/learning_curve.txt`` has Drake's
rows alone. Shifts are kept in ``results/two_fidelities-CLUTCH-SET``, and a second run simulates
none: CPU times are of one process that finds none. It takes some seven minutes.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.training import fill, references_of, train
from dogshape.pipeline.train.training_rows import dataset_of, study_mix
from dogshape.pipeline.train.two_level_rows import compiled
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.learning import fit
from dogshape.surrogate.store import Stored
from dogshape.surrogate.validation_figures import Validation, figures, predict, ranked

#: Clutches beside the prototype: a small one, as of a light gearbox or a transfer case, and a large
#: one, as of a truck. Geometry and masses are made up, in proportion to those of the prototype.
CLUTCHES: dict[str, dict[str, Any]] = {
    "prototype": {},
    "small": {
        "dog": {"count": 12, "outer_diameter_mm": 36.0, "inner_diameter_mm": 29.0,
                "height_mm": 2.8, "axial_gap_mm": 0.8},
        "sliding": {"mass_kg": 0.12, "inertia_kgm2": 0.0025},
        "output": {"inertia_kgm2": 0.08},
        "actuation": {"force_N": [100.0, 180.0, 300.0], "rise_s": [0.2, 0.15, 0.1]},
        "operating": {"mismatch_rpm": [10.0, 30.0, 80.0, 160.0, 300.0],
                      "force_N": [100.0, 180.0, 300.0]},
        "load": {"torque_Nm": 60.0, "separating_force_limit_N": 3000.0},
        "variables": {"height_mm": [1.4, 4.0], "count": [6, 24]},
    },
    "large": {
        "dog": {"count": 24, "outer_diameter_mm": 110.0, "inner_diameter_mm": 92.0,
                "height_mm": 6.0, "axial_gap_mm": 1.5},
        "sliding": {"mass_kg": 1.6, "inertia_kgm2": 0.12},
        "output": {"inertia_kgm2": 5.0},
        "actuation": {"force_N": [600.0, 1200.0, 2200.0], "rise_s": [0.25, 0.2, 0.15]},
        "operating": {"mismatch_rpm": [5.0, 20.0, 60.0, 120.0, 200.0],
                      "force_N": [600.0, 1200.0, 2200.0]},
        "load": {"torque_Nm": 1500.0, "separating_force_limit_N": 20000.0},
        "variables": {"height_mm": [3.0, 9.0], "count": [12, 48]},
    },
}  # fmt: skip

HEAD = "rows             rmse,ms  bias,ms  Q2     in 95 %  Q2 points  in 95 %  rank of best"


def line(name: str, v: Validation) -> str:
    """Format the figures of one fit."""
    rank = "-" if v.rank_best is None else f"{v.rank_best:.2f}"
    return (
        f"{name:15s}  {v.rmse_s * 1e3:7.2f}  {v.bias_s * 1e3:+7.2f}  {v.q2:.3f}"
        f"  {v.coverage_95:7.0%}  {v.q2_points:9.3f}  {v.coverage_points:7.0%}  {rank:>12s}"
    )


def _flat(tables: dict[str, Any]) -> dict[str, Any]:
    """Return settings by dotted keys."""
    return {
        f"{table}.{key}": value for table, keys in tables.items() for key, value in keys.items()
    }


def uncorrected(study: Setup, folder: StudyFolder, stored: Stored) -> Validation:
    """Judge the compiled engine's rows as they are, by the parameters of the corrected ones."""
    rows = dataset_of(compiled(study), ShiftJournal(folder.compiled).rows.values())
    data, known = replace(rows, physics=study.physics), stored.surrogate
    model = fit(data, known.form, known, Effort(steps=0))
    space, best = references_of(study, folder)
    mix = study_mix(study)
    found = figures(space, predict(model, space.x, mix), "references", data.shifts)
    return ranked(found, best, predict(model, best.x, mix).time) if len(best) else found


def main() -> None:
    """Simulate, fit, judge and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=500)
    parser.add_argument("--contact", default="lubricated_steel")
    parser.add_argument("--clutch", default="prototype", choices=CLUTCHES)
    given = parser.parse_args()
    settings = {
        "contact.set": given.contact,
        "surrogate.designs": given.designs,
        "surrogate.references": 24,
        "surrogate.best_references": 12,
    }
    study = load_study("mq200_paper", {**settings, **_flat(CLUTCHES[given.clutch])})
    folder = StudyFolder(Path("results") / f"two_fidelities-{given.clutch}-{given.contact}")
    begun = time.process_time()
    fill(study, folder, 1, levels=2)
    filled = time.process_time()
    stored = train(folder)
    ended = time.process_time()
    v, levels = stored.validation, stored.surrogate.data.levels
    apart = len(ShiftJournal(folder.references).rows)
    dense = len(ShiftJournal(folder.compiled_references).rows)
    about = f"{given.clutch}, {given.contact}, {given.designs} designs"
    print(f"{about}, {len(stored.surrogate.data)} rows")
    print(f"rows: {levels['planar']} shifts compiled, {levels['drake']} of Drake in pairs")
    print(f"references: {v.n} that fill the space and {v.n_best} of the best tenth, {dense} shifts")
    print(f"compiled and {apart} of Drake; s.e. of an expected time {v.noise_s * 1e3:.2f} ms")
    print(f"CPU: simulation {filled - begun:.0f} s, fit {ended - filled:.0f} s")
    found = levels["discrepancy"]
    print()
    print(f"ln Drake - ln compiled: {found['constant']:+.3%} (s.e. {found['constant_error']:.3%})")
    if found["slope"] is not None:
        print(
            f"  and {found['slope']:+.3%} (s.e. {found['slope_error']:.3%}) for each e of mismatch"
        )
    print(f"  scatter beyond sampling {found['scatter']:.3%}, of {found['pairs']} pairs of means")
    print(
        "  pairs left out are missed by "
        + ", ".join(f"{error:.3%} ({name})" for name, error in found["left_out_rms"].items())
    )
    print()
    print(HEAD)
    print(line("corrected", v))
    print(line("not corrected", uncorrected(study, folder, stored)))


if __name__ == "__main__":
    main()
