"""A study of the clutch of a bench, at the operating points of its data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.pipeline.config.schema import FORMAT
from dogshape.sim.shift.contact import contact_set
from dogshape.sim.units import DEG, MM, RPM

Data = dict[str, Any]  #: a TOML file as it is read
CONTACT = "adams2019"  #: set that a data set's coefficients of friction replace
#: Search ranges of angles, deg, and those of height and number over the bench's own.
ANGLES = {"chamfer_deg": [0.0, 20.0], "traction_deg": [4.0, 30.0], "braking_deg": [4.0, 30.0]}
SHARES = (0.45, 1.6)
#: Keys of ``[contact]`` by what they set of a contact set.
OWN_CONTACT = {
    "static_friction": "static_friction",
    "dynamic_friction": "dynamic_friction",
    "stiction_velocity_m_s": "stiction_velocity",
    "stiffness_Pa_m": "stiffness",
    "dissipation_s_m": "dissipation",
}


def study_of(bench: Bench, name: str) -> Data:
    """Build the tables of a study file from a data set.

    It has the bench's clutch, contact, time-out and operating points, all with the same weight. A
    data set says nothing of loads, material and tolerances, which stay those of the program. The
    rise time of a force is the mean of those that the data set has of it.
    """
    clutch = bench.clutch
    dog, rings, contact = clutch.dog, clutch.rings, clutch.contact
    plain = contact_set(CONTACT)
    differing = {
        key: getattr(contact, field)
        for key, field in OWN_CONTACT.items()
        if getattr(contact, field) != getattr(plain, field)
    }
    rises = rises_of(bench)
    return {
        "format": FORMAT,
        "name": name,
        "dog": {
            "count": dog.count,
            "chamfer_deg": rounded(dog.chamfer / DEG),
            "traction_deg": rounded(dog.traction / DEG),
            "braking_deg": rounded(dog.braking / DEG),
            "height_mm": rounded(dog.height / MM),
            "outer_diameter_mm": rounded(dog.outer_diameter / MM),
            "inner_diameter_mm": rounded(dog.inner_diameter / MM),
            "axial_gap_mm": rounded(dog.axial_gap / MM),
            **({"edge_radius_mm": rounded(dog.edge_radius / MM)} if dog.edge_radius else {}),
        },
        "sliding": {"mass_kg": rings.mass, "inertia_kgm2": rings.sliding_inertia},
        "output": {"inertia_kgm2": rings.output_inertia},
        "contact": {"set": CONTACT, **differing},
        "shift": {
            "timeout_s": clutch.timeout,
            "seated_tolerance_mm": rounded(clutch.seated_tolerance / MM),
            "rebound_mm": rounded(clutch.rebound / MM),
        },
        "actuation": {"force_N": list(rises), "rise_s": list(rises.values())},
        "operating": operating_of(points_of(bench)),
        "variables": {
            **ANGLES,
            "height_mm": [rounded(share * dog.height / MM, 3) for share in SHARES],
            "count": [max(3, round(0.4 * dog.count)), round(2.4 * dog.count)],
        },
    }


def points_of(bench: Bench) -> list[tuple[float, float]]:
    """List mismatch, 1/min, and force, N, of the operating points of a data set, each once."""
    points = [(cell.point.mismatch / RPM, cell.point.profile.force) for cell in bench.cells]
    return list(dict.fromkeys((rounded(mismatch), rounded(force)) for mismatch, force in points))


def operating_of(points: Sequence[tuple[float, float]]) -> Data:
    """Return ``[operating]`` for some points: a grid where they are one, else a list."""
    mismatches, forces = (list(dict.fromkeys(axis)) for axis in zip(*points, strict=True))
    if list(product(mismatches, forces)) == list(points):
        return {"mismatch_rpm": mismatches, "force_N": forces}
    return {"points": [{"mismatch_rpm": m, "force_N": force} for m, force in points]}


def rises_of(bench: Bench) -> Mapping[float, float]:
    """Give the mean rise time, s, of each final force, N, of a data set; forces ascend."""
    found: dict[float, set[float]] = {}
    for cell in bench.cells:
        profile = cell.point.profile
        found.setdefault(rounded(profile.force), set()).add(profile.rise)
    return {force: rounded(sum(those) / len(those)) for force, those in sorted(found.items())}


def rounded(value: float, digits: int = 9) -> float:
    """Round a number to so many significant digits, so that conversions of units leave no trace."""
    return float(f"{value:.{digits}g}")
