"""Does a linkage that gives way change shifts, or do Drake's steps: both engines, finer and finer.

    python -m benchmarks.linkage_steps

Some shifts of the prototype at one operating point, with the published contact set (Drake's scheme
``cenic``) and with the design set (its scheme for that), without a linkage and with ones from stiff
to soft, and with free play. A diagnosis lets Drake simulate its bank at 1e-6; the published set's
own accuracy is 1e-7.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.statistics.batch import run_block
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.units import RPM

MISMATCH, FORCE = 100.0, 235.2  #: 1/min and N
ANGLES, EVERY = 24, 4
LINKAGES = (
    ("none", ()),
    ("compliance 0.3 mm/kN", ("mechanism.compliance_mm_kN=0.3",)),
    ("compliance 3 mm/kN", ("mechanism.compliance_mm_kN=3",)),
    ("compliance 10 mm/kN", ("mechanism.compliance_mm_kN=10",)),
    ("free play 0.5 mm", ("mechanism.free_play_mm=0.5",)),
)
ENGINES = {
    "adams2019": (
        ("drake", 1e-6), ("drake", 1e-7), ("drake", 1e-8), ("drake", 1e-9), ("planar", 1e-4),
        ("planar", 1e-5),
    ),
    "lubricated_steel": (("drake", 3e-4), ("drake", 1e-5), ("planar", 1e-4), ("planar", 1e-5)),
}  # fmt: skip


def times(contact: str, linkage: tuple[str, ...], engine: str, accuracy: float) -> np.ndarray:
    """Simulate the shifts of one line, s; NaN where one does not engage."""
    sets = [f"contact.set={contact}", f"solver.engine={engine}", *linkage]
    study = load_study("mq200_paper", sets)
    clutch = replace(study.clutch, solver=replace(study.clutch.solver, accuracy=accuracy))
    (point,) = [
        one
        for one in study.points
        if abs(one.mismatch / RPM - MISMATCH) < 1e-6 and abs(one.profile.force - FORCE) < 1e-6
    ]
    block = even_block(clutch, point, ANGLES, (1, 0)).only(range(0, ANGLES, EVERY))
    found = [row["shift_time_s"] for row in run_block(block)]
    return np.array([np.nan if time is None else time for time in found])


def main() -> None:
    """Print the table."""
    print(f"shift times at {MISMATCH:g} 1/min and {FORCE:g} N, ms, at every fourth of 24 angles;")
    print("off: largest difference from the compiled engine's at 1e-5")
    for contact, engines in ENGINES.items():
        for name, linkage in LINKAGES:
            print(f"\n{contact}, {name}")
            found = {one: times(contact, linkage, *one) for one in engines}
            finest = found[engines[-1]]
            for (engine, accuracy), one in found.items():
                shown = "  ".join(f"{1e3 * time:7.2f}" for time in one)
                off = 1e3 * float(np.nanmax(np.abs(one - finest)))
                print(f"{engine:7s} {accuracy:5.0e}  {shown}   off {off:6.2f}")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
