"""Keys of a study for the clutch of a bench, and for what an effect of the diagnosis says."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from itertools import product
from typing import Any

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.pipeline.config.operating import PROBE, keys_changed
from dogshape.pipeline.config.schema import FORMAT
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError, ranged_record, ranges_of
from dogshape.sim.setting import Setting
from dogshape.sim.shift.clutch import Clutch, contact_set
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.units import MM, RPM, from_si

Data = dict[str, Any]  #: a TOML file as it is read
CONTACT = "adams2019"  #: set that a data set's coefficients of friction replace
#: Search ranges of angles, deg, and those of height and number over the bench's own.
ANGLES = {"chamfer_deg": [0.0, 20.0], "traction_deg": [4.0, 30.0], "braking_deg": [4.0, 30.0]}
SHARES = (0.45, 1.6)
DOG = {name: one.key for name, one in ranges_of(Dog).items()}  #: keys of ``[dog]`` by its fields
TABLES = ("mechanism", "contact", "sliding")


def rounded(value: float, digits: int = 9) -> float:
    """Round a number to so many significant digits, so that conversions of units leave no trace."""
    return float(f"{value:.{digits}g}")


def clutch_tables(clutch: Clutch) -> Data:
    """Return ``[dog]``, ``[sliding]`` and ``[output]`` of a study with this clutch."""
    dog, rings = clutch.dog, clutch.rings
    return {
        "dog": {
            key: dog.count if key == "count" else rounded(from_si(key, value))
            for field, key in DOG.items()
            if (value := getattr(dog, field)) != getattr(Dog, field, None)
        },
        "sliding": {"mass_kg": rings.mass, "inertia_kgm2": rings.sliding_inertia},
        "output": {"inertia_kgm2": rings.output_inertia},
    }


def study_of(bench: Bench, name: str) -> Data:
    """Build the tables of a study from a data set: clutch, contact, time-out, operating points.

    The rise time of a force is the mean of those that the data set has of it. Of loads, material
    and tolerances a data set says nothing; they stay those of the program.
    """
    clutch, plain = bench.clutch, ranged_record(contact_set(CONTACT))
    own = {k: value for k, value in ranged_record(clutch.contact).items() if value != plain[k]}
    points, rises = list[tuple[float, float]](), dict[float, set[float]]()
    for point in (cell.point for cell in bench.cells):
        points.append((rounded(point.mismatch / RPM), rounded(point.profile.force)))
        rises.setdefault(points[-1][1], set()).add(point.profile.rise)
    means = {force: rounded(sum(those) / len(those)) for force, those in sorted(rises.items())}
    # A grid of operating points where they are one, else a list.
    each = list(dict.fromkeys(points))
    mismatches, forces = (list(dict.fromkeys(axis)) for axis in zip(*each, strict=True))
    operating: Data = {"mismatch_rpm": mismatches, "force_N": forces}
    if list(product(mismatches, forces)) != each:
        operating = {"points": [{"mismatch_rpm": m, "force_N": force} for m, force in each]}
    count, height = clutch.dog.count, clutch.dog.height / MM
    return {
        "format": FORMAT,
        "name": name,
        **clutch_tables(clutch),
        **({"drive": clutch.drive.table} if clutch.drive.table else {}),
        "contact": {"set": CONTACT, **own},
        "shift": {
            "timeout_s": clutch.timeout,
            "seated_tolerance_mm": rounded(clutch.seated_tolerance / MM),
            "rebound_mm": rounded(clutch.rebound / MM),
        },
        "actuation": {"force_N": list(means), "rise_s": list(means.values())},
        "operating": operating,
        "variables": {
            **ANGLES,
            "height_mm": [rounded(share * height, 3) for share in SHARES],
            "count": [max(3, round(0.4 * count)), round(2.4 * count)],
        },
    }


def takes(clutch: Clutch, effect: Effect) -> bool:
    """Decide whether a study of a clutch has keys for an effect; it has none for a user's own."""
    tables = {key.partition(".")[0] for key in touched_keys(clutch, effect)}
    return effect.name in registry.load() and bool(tables) and tables <= {*TABLES, "dog"}


def touched_keys(clutch: Clutch, effect: Effect) -> set[str]:
    """List the keys of a study of a clutch that an effect changes at any of some values."""
    found: set[str] = set()
    for share in (0.2, 0.4, 0.6, 0.8):
        with suppress(DogshapeError):  # values of which there is no bench
            values = {p.name: p.at(share) for p in effect.parameters}
            found |= keys_changed(effect, values, Setting(clutch, PROBE))
    return found


def effect_settings(clutch: Clutch, effect: Effect, values: Mapping[str, float]) -> dict[str, Any]:
    """Write an effect as dotted keys of a study; DogshapeError for values of no clutch."""
    touched, after = touched_keys(clutch, effect), effect.apply(Setting(clutch, PROBE), values)
    mine = [f for f in DOG if f"dog.{f}" in touched and f != "edge_radius"]
    if mine:
        dog = {f"dog.{DOG[f]}": getattr(after.clutch.dog, f) for f in mine}
        return {k: v if k == "dog.count" else rounded(from_si(k, v), 6) for k, v in dog.items()}
    key, alone = f"effects.{effect.name}", len(values) == 1
    return {key if alone else f"{key}.{n}": rounded(v, 6) for n, v in values.items()}
