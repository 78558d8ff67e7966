"""What the regularisation of friction does to a shift, in both contact sets.

    python -m benchmarks.stiction

Mean shift time of the prototype over twelve even angles, and how many of them stay
blocked, by stiction velocity. Takes about two minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.common import angles_of, measure, paper_study, point_of
from dogshape.sim.shift.clutch import solver_for
from dogshape.sim.shift.contact import CONTACT_SETS
from dogshape.sim.shift.plant import ClutchPlant

VELOCITIES = {
    "adams2019": (0.1, 0.03, 0.01, 0.001),
    "lubricated_steel": (2e-3, 5e-4, 2e-4, 1e-4),
}
POINTS = ((5.0, 235.2), (10.0, 641.5), (50.0, 469.0))


def main() -> None:
    """Print the table."""
    study = paper_study()
    print("mean shift time of those that engage, ms, and how many of twelve stay blocked")
    for name, velocities in VELOCITIES.items():
        head = "".join(f"{v * 1e3:>11.1f} mm/s" for v in velocities)
        print(f"\n{name:<18} stiction velocity{head}")
        for mismatch, force in POINTS:
            row = ""
            for velocity in velocities:
                contact = replace(CONTACT_SETS[name], stiction_velocity=velocity)
                clutch = replace(study.clutch, contact=contact, solver=solver_for(contact))
                point, angles = point_of(study, mismatch, force), angles_of(clutch, 12, 0)
                cell = measure(ClutchPlant(clutch), point, angles)
                blocked = int(np.isnan(cell.times).sum())
                time = f"{cell.mean * 1e3:.1f}" if blocked < 12 else "-"
                row += f"{time:>10} ({blocked:2d})"
            print(f"{mismatch:7.0f} 1/min {force:7.1f} N           {row}", flush=True)


if __name__ == "__main__":
    main()
