"""Peak impact forces over stiffness of the contact and mass of the fork, beside a closed form.

    python -m benchmarks.impact_force

Prototype and chosen design of the paper's study at its 28 operating points, three even angles each,
the same for all settings: mean of the shifts' peak axial and tangential force with the standard
error of their ratio, and the hardest landing dog on dog, an extreme and so mostly luck. The fork
moves with the sliding ring (``sim.shift.mechanism``, the effect moving_mass).

Beside it the peak of one body on Hunt and Crossley's spring (``validation.impact``), all faces flat
on each other: at 0.25 m/s, where it goes with the root of stiffness times mass, and at the speed
with which the ring lands after its free flight. That falls with the mass: the force grows as the
square of the time at first, so the way as its fourth power over the mass, the speed at the end of
the gap as the mass to the power -1/4, and the peak of a spring alone with the mass to the power
1/4; the dissipation, less at less speed, takes from that. Takes five minutes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import paper_study, read_result
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.study_record import DesignRow
from dogshape.sim.shift.clutch import Clutch, ContactSet
from dogshape.sim.shift.conclusion import Engagement, engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import even_blocks
from dogshape.sim.strength.landing import hardest
from dogshape.sim.units import MM

STIFFNESSES = (5e12, 1.5e13, 2e13)  #: Pa/m: default, faces pressed on steel, its upper end
FORKS = (0.0, 1.0)  #: kg
ANGLES = 3
SEED = 31
SPEED = 0.25  #: m/s, of the closed form

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Forces:
    """Peak forces of shifts in N, each (n,), and the hardest landing in N/mm."""

    axial: Values
    tangential: Values
    landing: float


def load_designs(study: Setup) -> dict[str, Clutch]:
    """Read the prototype and the chosen design of the kept result."""
    result = read_result(study.name)
    chosen = result["confirmation"]["chosen"]
    row = next(DesignRow(**row) for row in result["trials"] if row["trial"] == chosen)
    best = study.clutch_with(row.params(study.variables))
    return {"prototype": study.clutch, f"chosen ({chosen})": best}


def with_setting(clutch: Clutch, stiffness: float, fork: float) -> Clutch:
    """Change stiffness of the contact and mass that moves with the ring."""
    return replace(
        clutch,
        contact=replace(clutch.contact, stiffness=stiffness),
        mechanism=replace(clutch.mechanism, added_mass=fork),
    )


def peak_force(contact: ContactSet, area: float, mass: float, speed: float) -> float:
    r"""Compute the peak force in N of a mass (kg) at a speed (m/s) on faces of ``area`` (m2).

    :math:`F = k A x (1 + d v)` on the way in, along :math:`m v\,dv = -F\,dx`: the spring alone
    makes :math:`v \sqrt{k A m}`.
    """
    stiffness = contact.stiffness * area
    d = contact.dissipation
    speeds = np.linspace(speed, 0.0, 4001)
    # Separated: k A x dx = -m v dv / (1 + d v).
    works = mass * np.concatenate(
        [[0.0], np.cumsum(_midpoints(speeds / (1.0 + d * speeds)) * -np.diff(speeds))]
    )
    depth = np.sqrt(2.0 * works / stiffness)
    return float((stiffness * depth * (1.0 + d * speeds)).max())


def _midpoints(values: Values) -> Values:
    return 0.5 * (values[1:] + values[:-1])


def flat_peak(clutch: Clutch, speed: float = SPEED) -> float:
    """Return the peak force in N where all faces land flat on each other at a speed."""
    dog = clutch.dog
    area = dog.count * dog.radial_width * dog.tip_width
    return peak_force(clutch.contact, area, clutch.mechanism.sleeve_mass(clutch.rings.mass), speed)


def landing_peak(study: Setup, clutch: Clutch) -> float:
    """Compute the mean of ``flat_peak`` over the study's forces after free flight, N."""
    mass = clutch.mechanism.sleeve_mass(clutch.rings.mass)
    gap = clutch.dog.axial_gap
    peaks = []
    for profile in {point.profile for point in study.points}:
        time = profile.free_flight_time(gap, mass)
        peaks.append(flat_peak(clutch, float(profile.free_speed(time, mass))))
    return float(np.mean(peaks))


def mean_forces(study: Setup, clutch: Clutch) -> Forces:
    """Simulate the operating points and return their mean peak forces."""
    plant = ClutchPlant(clutch)
    results = [
        engage(plant, block.point, angle)
        for block in even_blocks(clutch, study.points, ANGLES, SEED)
        for angle in block.angles
    ]
    return Forces(
        np.array([s.loads.peak_axial_force for s in results]),
        np.array([s.loads.peak_tangential_force for s in results]),
        _hardest(results) * MM,
    )


def format_ratio(forces: Values, reference: Values) -> str:
    """Write the ratio of two means over equal angles with its standard error."""
    ratio = forces.mean() / reference.mean()
    error = (forces - ratio * reference).std(ddof=1) / math.sqrt(reference.size) / reference.mean()
    return f"{ratio:5.2f} ({error:.2f})"


def _hardest(shifts: Iterable[Engagement]) -> float:
    return max(hardest(s.loads.landing_loads for s in shifts))


def settings() -> list[tuple[float, float]]:
    """List stiffness and fork: one at a time from the default, then both."""
    single_changes = [(k, FORKS[0]) for k in STIFFNESSES] + [(STIFFNESSES[0], m) for m in FORKS[1:]]
    return [*single_changes, (STIFFNESSES[-1], FORKS[-1])]


def main() -> None:
    """Print the table."""
    study = paper_study()
    print(
        f"peak forces of the ring, kN: means of {len(study.points)} operating points, {ANGLES} "
        "angles each, with ratios to the default;"
    )
    print(f"closed form, all faces flat: at {SPEED} m/s, and at the speed after free flight")
    print(
        f"{'design':<12} {'Pa/m':>8} {'fork, kg':>8} {'axial':>7} {'ratio':>12} "
        f"{'tangential':>10} {'ratio':>12} {'N/mm':>6} {'ratio':>6} {'flat':>6} {'ratio':>6} "
        f"{'landed':>7} {'ratio':>6}"
    )
    for name, clutch in load_designs(study).items():
        base: Peaks | None = None
        for stiffness, fork in settings():
            changed = with_setting(clutch, stiffness, fork)
            peaks = Peaks(
                mean_forces(study, changed), flat_peak(changed), landing_peak(study, changed)
            )
            if base is None:
                base = peaks
            print_row(f"{name:<12} {stiffness:8.1e} {fork:8.1f}", peaks, base)


class Peaks(NamedTuple):
    """Peak forces under one setting."""

    simulated: Forces
    flat: float  #: of the closed form at ``SPEED``, N
    landed: float  #: of the closed form after free flight, N


def print_row(label: str, peaks: Peaks, base: Peaks) -> None:
    """Print peak forces with their ratios to a base."""
    simulated = peaks.simulated
    axial_ratio = format_ratio(simulated.axial, base.simulated.axial)
    tangential_ratio = format_ratio(simulated.tangential, base.simulated.tangential)
    landing_ratio = simulated.landing / base.simulated.landing
    print(
        f"{label} {simulated.axial.mean() / 1e3:7.2f} {axial_ratio:>12} "
        f"{simulated.tangential.mean() / 1e3:10.1f} {tangential_ratio:>12} "
        f"{simulated.landing:6.0f} {landing_ratio:6.2f} "
        f"{peaks.flat / 1e3:6.1f} {peaks.flat / base.flat:6.2f} "
        f"{peaks.landed / 1e3:7.1f} {peaks.landed / base.landed:6.2f}",
        flush=True,
    )


if __name__ == "__main__":
    main()
