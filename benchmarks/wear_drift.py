"""Drift of prototype and chosen design of the default study over their life.

    python -m benchmarks.wear_drift [--jobs N]

Worn by specific wear rates (Archard) and by losses of the crest, at every operating point and at 12
angles, by the compiled engine. Takes a minute.
"""

from __future__ import annotations

import argparse

from benchmarks.kept import result
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.simulate.life import life_of
from dogshape.sim.strength.wear import Wear
from dogshape.sim.units import MM

WEARS = {
    "rate 1e-7 mm3/(N m)": Wear(rate=1e-16),
    "rate 1e-6 mm3/(N m)": Wear(rate=1e-15),
    "rate 1e-5 mm3/(N m)": Wear(rate=1e-14),
    "crest 0.05 mm": Wear(crest_loss=0.05 * MM),
    "crest 0.1 mm": Wear(crest_loss=0.1 * MM),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=0)
    executor = scratch_executor(parser.parse_args().jobs)
    study = load_study("mq200_paper", {"solver.engine": "planar", "search.confirm_angles": 12})
    best = result("mq200_paper")["best"]
    designs = {"prototype": study.prototype, "chosen": {k: best[k] for k in study.variables}}
    print(f"life of {study.limits.load.shifts:.0f} shifts; {study.operating_text}")
    for label, params in designs.items():
        for name, wear in WEARS.items():
            for row in life_of(study, params, wear, executor):
                engaged = 100.0 * row["engaged"]
                print(
                    f"{label}, {name}, {100 * row['life']:.0f} %: "
                    f"{1e3 * row['crest_loss_mm']:.2f} um lost, chamfer {row['chamfer_deg']:.2f}, "
                    f"{1e3 * row['expected_shift_time_s']:.1f} +- "
                    f"{1e3 * row['standard_error_s']:.1f} ms, {engaged:.1f} % engaged, "
                    f"margin {100 * row['smallest_margin']:.1f} % {row['weakest_check']}, "
                    f"{row['energy_J']:.2f} J"
                )


if __name__ == "__main__":
    main()
