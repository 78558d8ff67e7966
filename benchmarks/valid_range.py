"""Speeds and forces up to which dogs do not pass through each other in the simulation.

    python -m benchmarks.valid_range

Shifts of the prototype and of the chosen design of the paper's study at angles of one pitch; the
force rises within 0.05 s. A cell has how many were refused (``sim.shift.conclusion``), and the
deepest penetration of those that were not.
"""

from __future__ import annotations

from dataclasses import replace

from benchmarks.common import paper_study, read_result
from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Outcome, engage, section_planes
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, MM, RPM

SPEEDS_RPM = (-1000.0, -500.0, -249.0, 249.0, 500.0, 1000.0)
FORCES_N = (641.5, 1500.0, 3000.0)
RISE_S = 0.05
ANGLES = 6


def chosen_clutch(clutch: Clutch) -> Clutch:
    """Build the clutch with the chosen design of the paper's study."""
    p = read_result("mq200_paper")["best"]
    dog = replace(
        clutch.dog,
        count=int(p["count"]),
        chamfer=p["chamfer_deg"] * DEG,
        traction=p["traction_deg"] * DEG,
        braking=p["braking_deg"] * DEG,
        height=p["height_mm"] * MM,
    )
    return replace(clutch, dog=dog)


def measure_cell(plant: ClutchPlant, point: OperatingPoint) -> tuple[int, float]:
    """Return the number of refused shifts and the largest penetration of the others, m."""
    pitch_angle = plant.clutch.dog.pitch_angle
    planes = section_planes(plant.clutch.pair)
    refused_count = 0
    penetration = 0.0
    for k in range(ANGLES):
        shift = engage(plant, point, (k + 0.5) / ANGLES * pitch_angle)
        if shift.outcome is Outcome.DIVERGED:
            refused_count += 1
        else:
            run = shift.run
            numbers = plant.clutch.numbers
            depth, _ = kernel.extremes(run.times, run.states, planes, numbers)
            penetration = max(penetration, depth)
    return refused_count, penetration


def main() -> None:
    """Print the table."""
    clutch = paper_study().clutch
    print(f"refused of {ANGLES} shifts, and the deepest penetration of the others, mm")
    print(f"{'design':<12}{'1/min':>8}" + "".join(f"{f'{force:g} N':>16}" for force in FORCES_N))
    for name, design in (("prototype", clutch), ("chosen", chosen_clutch(clutch))):
        plant = ClutchPlant(design)
        for speed in SPEEDS_RPM:
            cells = [
                measure_cell(plant, OperatingPoint(speed * RPM, ForceProfile(force, RISE_S)))
                for force in FORCES_N
            ]
            cell_text = "".join(f"{refused:>7}{deepest / MM:>9.3f}" for refused, deepest in cells)
            print(f"{name:<12}{speed:>8g}{cell_text}")


if __name__ == "__main__":
    main()
