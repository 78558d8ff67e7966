"""Peak impact forces over stiffness of the contact and mass of the fork, beside a closed form.

    python -m benchmarks.impact_force

Prototype and chosen design of the default study at 14 operating points, four even angles each, the
same for all settings: mean of the shifts' peak axial and tangential force, and the hardest landing
dog on dog. The fork moves with the sliding ring (``sim.mechanism``, the effect moving_mass).
Beside it the peak of one body on Hunt and Crossley's spring (``sim.impact``): all faces flat on
each other at 0.25 m/s. Takes about ten minutes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.common import default_study
from pipeline.config import Study
from sim.blocks import even_blocks
from sim.bundled import bundled_root
from sim.clutch import Clutch
from sim.contact import ContactSet
from sim.engagement import Engagement, engage
from sim.landing import hardest
from sim.plant import ClutchPlant
from sim.units import MM

STIFFNESSES = (5e12, 1.5e13, 2e13)  #: Pa/m: default, faces pressed on steel, its upper end
FORKS = (0.0, 0.3, 1.0)  #: kg
FORCES = (315.5, 641.5)  #: N, with every mismatch of the study
ANGLES, SEED = 4, 31
SPEED = 0.25  #: m/s, of the closed form


@dataclass(frozen=True)
class Forces:
    """Mean peak forces in N with standard errors, and the hardest landing in N/mm."""

    axial: float
    axial_error: float
    tangential: float
    landing: float


def designs(study: Study) -> dict[str, Clutch]:
    """Read the prototype and the chosen design of the kept result."""
    path = bundled_root() / study.name / "result.json"
    result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    chosen = result["confirmation"]["chosen"]
    row = next(row for row in result["trials"] if row["trial"] == chosen)
    best = study.clutch.with_dog(study.dog_with({key: row[key] for key in study.variables}))
    return {"prototype": study.clutch, f"chosen ({chosen})": best}


def with_setting(clutch: Clutch, stiffness: float, fork: float) -> Clutch:
    """Change stiffness of the contact and mass that moves with the ring."""
    return replace(
        clutch,
        contact=replace(clutch.contact, stiffness=stiffness),
        mechanism=replace(clutch.mechanism, added_mass=fork),
    )


def peak(contact: ContactSet, area: float, mass: float, speed: float) -> float:
    r"""Compute the peak force in N of a mass (kg) at a speed (m/s) on faces of ``area`` (m2).

    :math:`F = k A x (1 + d v)` on the way in, along :math:`m v\\,dv = -F\\,dx`: the spring alone
    makes :math:`v \\sqrt{k A m}`.
    """
    stiffness, d = contact.stiffness * area, contact.dissipation
    now = np.linspace(speed, 0.0, 4001)
    # Separated: k A x dx = -m v dv / (1 + d v).
    steps = mass * np.concatenate([[0.0], np.cumsum(_means(now / (1.0 + d * now)) * -np.diff(now))])
    depth = np.sqrt(2.0 * steps / stiffness)
    return float((stiffness * depth * (1.0 + d * now)).max())


def _means(values: np.ndarray) -> np.ndarray:
    return 0.5 * (values[1:] + values[:-1])


def closed_form(clutch: Clutch, speed: float = SPEED) -> tuple[float, float]:
    """Return peak forces in N of flat faces at a speed: spring and damper, and spring alone."""
    dog = clutch.dog
    area = dog.count * dog.radial_width * dog.tip_width
    mass = clutch.mechanism.sleeve_mass(clutch.rings.mass)
    spring = speed * math.sqrt(clutch.contact.stiffness * area * mass)
    return peak(clutch.contact, area, mass, speed), spring


def forces(study: Study, clutch: Clutch) -> Forces:
    """Simulate the operating points and return their mean peak forces."""
    plant = ClutchPlant(clutch)
    points = [p for p in study.points if p.profile.force in FORCES]
    shifts = [
        engage(plant, block.point, angle)
        for block in even_blocks(clutch, points, ANGLES, SEED)
        for angle in block.angles
    ]
    axial = np.array([s.loads.peak_axial_force for s in shifts])
    return Forces(
        float(axial.mean()),
        float(axial.std(ddof=1) / math.sqrt(axial.size)),
        float(np.mean([s.loads.peak_tangential_force for s in shifts])),
        _hardest(shifts) * MM,
    )


def _hardest(shifts: Iterable[Engagement]) -> float:
    return max(hardest(s.loads.landing for s in shifts).line_loads)


def settings() -> list[tuple[float, float]]:
    """List stiffness and fork: one at a time from the default, then both."""
    alone = [(k, FORKS[0]) for k in STIFFNESSES] + [(STIFFNESSES[0], m) for m in FORKS[1:]]
    return [*alone, (STIFFNESSES[-1], FORKS[-1])]


def main() -> None:
    """Print the table."""
    study = default_study()
    points = len([p for p in study.points if p.profile.force in FORCES])
    print(f"peak forces of the ring, kN: means of {points} operating points, {ANGLES} angles each;")
    print(f"closed form: all faces flat at {SPEED} m/s, with and without dissipation")
    print(f"{'design':<12} {'Pa/m':>8} {'fork, kg':>8} {'axial':>7} {'s.e.':>5} {'ratio':>6} "
          f"{'tangential':>10} {'ratio':>6} {'N/mm':>6} {'ratio':>6} {'flat':>6} {'ratio':>6} "
          f"{'v sqrt(km)':>10} {'ratio':>6}")  # fmt: skip
    for name, clutch in designs(study).items():
        first: tuple[float, ...] | None = None
        for stiffness, fork in settings():
            changed = with_setting(clutch, stiffness, fork)
            found, flat = forces(study, changed), closed_form(changed)
            row = (found.axial, found.tangential, found.landing, *flat)
            first = first or row
            axial, tangential, landing, damped, spring = (
                a / b for a, b in zip(row, first, strict=True)
            )
            print(
                f"{name:<12} {stiffness:8.1e} {fork:8.1f} {found.axial / 1e3:7.2f} "
                f"{found.axial_error / 1e3:5.2f} {axial:6.2f} {found.tangential / 1e3:10.1f} "
                f"{tangential:6.2f} {found.landing:6.0f} {landing:6.2f} {flat[0] / 1e3:6.1f} "
                f"{damped:6.2f} {flat[1] / 1e3:10.1f} {spring:6.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
