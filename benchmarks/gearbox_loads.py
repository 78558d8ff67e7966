"""Checks of designs of the paper's study under the loads of a gearbox.

    python -m benchmarks.gearbox_loads [--jobs N]

Prototype and designs that ``benchmarks.contact_sets`` compares, with the keys of docs/studies.md
(Further loads) one at a time and together. For each the smallest margin with its check, and every
check that fails with its margin, the hardest landing among them: simulated at the study's own
operating points and angles by the compiled engine, with the friction in the ring's toothing where
that is set. Then the share of the dogs that carries and lands, the pull-out force, and torque and
force of a flank strike. Takes a minute.
"""

from __future__ import annotations

import argparse

from benchmarks.contact_sets import Designs, designs_of
from dogshape.check import Strength, check_strength
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.executor import RunOptions
from dogshape.sim.shift.geometry import FLANKS
from dogshape.sim.strength.checks import smallest_margin

Keys = dict[str, float | bool | list[float]]

SPLINE: Keys = {"mechanism.spline_friction": 0.1, "mechanism.spline_radius_mm": 17.6}
PULLED: Keys = {"load.release_by_itself": False}
COAST: Keys = {"load.coast_share": 0.4}
STRIKE: Keys = {
    "strike.ring_inertia_kgm2": 5e-4,
    "strike.input_stiffness_Nm_rad": 15e3,
    "strike.backlash_deg": 0.5,
}
SETTINGS: dict[str, Keys] = {
    "as it is": {},
    "toothing 0.1": SPLINE,
    "toothing 0.1, pulled out": SPLINE | PULLED,
    "coast 0.4": COAST,
    **{f"class {a}": {"load.accuracy": a} for a in (4, 5, 6, 7, 8)},
    "strike": STRIKE,
    "strike, ring 0.001 kg m2": STRIKE | {"strike.ring_inertia_kgm2": 1e-3},
    "strike, all rigid": STRIKE | {"strike.ring_inertia_kgm2": 0.01},
    "class 6, strike": STRIKE | {"load.accuracy": 6},
    "all, class 5": SPLINE | PULLED | COAST | STRIKE | {"load.accuracy": 5},
    "all, class 6": SPLINE | PULLED | COAST | STRIKE | {"load.accuracy": 6},
}


def check_design(design: dict[str, float], keys: Keys, jobs: int) -> Strength:
    """Return all checks of a design, keys in edge units, with its landing."""
    shape = {f"dog.{name}": value for name, value in design.items()}
    study = load_study("mq200_paper", {**shape, **keys, "solver.engine": "planar"})
    return check_strength(study, RunOptions(jobs))


def summary_line(strength: Strength) -> str:
    """Return smallest margin and failures of a design in a line."""
    weakest = smallest_margin(strength.design.checks)
    failed = [f"{c.name} {c.margin:+.0%}" for c in strength.design.checks if not c.passed]
    margin = f"{weakest.margin:+6.1%} {weakest.name}"
    return f"{'yes' if strength.feasible else 'NO':4}{margin:34}{'; '.join(failed)}".rstrip()


def load_lines(strength: Strength) -> list[str]:
    """Write the sizes of the further loads of a design, one a line."""
    pull = [c.value for c in strength.design.checks if c.name == "pull_out_force"]
    beginnings = ("load sharing", *(f"{flank} flanks" for flank in FLANKS))
    sizes = [
        text
        for text in strength.to_parts()
        if isinstance(text, str) and text.startswith(beginnings)
    ]
    return [*sizes, *(f"pulled out with {value:.0f} N" for value in pull)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=0)
    jobs = parser.parse_args().jobs
    designs: Designs = designs_of(load_study("mq200_paper"))
    for name, keys in SETTINGS.items():
        settings = ", ".join(f"{key}={value}" for key, value in keys.items())
        print(f"\n{name}: {settings or 'nothing further'}")
        for label, design in designs.items():
            strength = check_design(design, keys, jobs)
            print(f"  {label:12} {summary_line(strength)}")
            for line in load_lines(strength):
                print(f"  {'':12} {line}")


if __name__ == "__main__":
    main()
