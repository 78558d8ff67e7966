"""Where the time of a shift goes, and below what it cannot fall.

    python -m benchmarks.floor

CPU of one derivative in free flight, with dogs near each other and in contact, with
the integrator alone and no record kept; then how many derivatives a shift needs, by
what happens meanwhile. Takes about a minute.
"""

from __future__ import annotations

import time
from collections import Counter

import numpy as np

from benchmarks.common import angles_of, paper_study
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.phases import PHASES, touching
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import MM, RPM

#: Displacement in mm, part of a pitch, and a step in s small enough to stay there.
PLACES = {
    "far apart": (-50.0, 0.0, 1e-5),
    "faces 0.1 mm apart": (0.9, 0.0, 5e-6),
    "in the slot, untouched": (3.0, 0.51, 1e-6),
    "sliding on a face": (1.0, 0.14, 2e-5),
}


def derivative(plant: ClutchPlant, place: str) -> float:
    """Return the CPU of one derivative in s: the least of nine runs."""
    way, part, step = PLACES[place]
    point = paper_study().points[0]
    best = np.inf
    for _ in range(9):
        simulator = plant.start(point, part * plant.clutch.dog.pitch_angle)
        angle = plant.state()[0]
        plant.plant.SetPositions(plant.plant_context, [angle, way * MM, 0.0])
        plant.plant.SetVelocities(plant.plant_context, np.zeros(3))
        integrator = simulator.get_mutable_integrator()
        integrator.request_initial_step_size_target(step)
        integrator.set_maximum_step_size(step)
        simulator.Initialize()
        start = time.process_time()
        simulator.AdvanceTo(500 * step)
        best = min(
            best, (time.process_time() - start) / integrator.get_num_derivative_evaluations()
        )
    return float(best)


def main() -> None:
    """Print both tables."""
    study = paper_study()
    plant = ClutchPlant(study.clutch)
    print("CPU of one derivative")
    for place in PLACES:
        print(f"  {place:<24}{derivative(plant, place) * 1e6:7.1f} us")
    steps: Counter[str] = Counter()
    spans: Counter[str] = Counter()
    evaluations, cpu, shifts = 0, 0.0, 0
    for index, point in enumerate(p for p in study.points if p.mismatch >= 24.0 * RPM):
        for angle in angles_of(study.clutch, 3, index):
            start = time.process_time()
            result = engage(plant, point, float(angle))
            cpu += time.process_time() - start
            evaluations, shifts = evaluations + result.evaluations, shifts + 1
            trace = result.trace
            starts = [p.start for p in result.phases]
            phase = np.maximum(np.searchsorted(starts, trace.time, side="left") - 1, 0)
            for k, touch, span in zip(
                phase[1:], touching(trace)[1:], np.diff(trace.time), strict=True
            ):
                name = f"{PHASES[k]}, {'in contact' if touch else 'in the air'}"
                steps[name] += 1
                spans[name] += span
    print(f"\n{shifts} shifts of the prototype from 25 1/min up, a shift:")
    print(f"  {cpu / shifts * 1e3:.1f} ms CPU, {evaluations / shifts:.0f} derivatives", end="")
    print(f", {evaluations / steps.total():.2f} a step that was kept")
    for name in sorted(steps):
        each = steps[name] / shifts
        print(f"  {name:<28}{each:6.0f} steps{spans[name] / shifts * 1e3:8.1f} ms of motion")


if __name__ == "__main__":
    main()
