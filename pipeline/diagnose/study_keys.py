"""Keys of a study for the clutch of a bench and for effects of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import product
from typing import Any

from dogshape.bench.bench_data import Bench
from dogshape.pipeline.config.operating import PROBE, effect_keys
from dogshape.pipeline.config.schema import FORMAT
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.quantity import quantities_of, record_quantities
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuators import Actuator, optional_values
from dogshape.sim.shift.clutch import Clutch, contact_set
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.units import MM, RPM, from_si

Data = dict[str, Any]  #: a TOML file as it is read
CONTACT = "adams2019"  #: set that a data set's coefficients of friction replace
#: Search ranges of angles, deg, and those of height and number over the bench's own.
ANGLES = {"chamfer_deg": [0.0, 20.0], "traction_deg": [4.0, 30.0], "braking_deg": [4.0, 30.0]}
HEIGHT_FACTORS = (0.45, 1.6)
COUNT_FACTORS = (0.4, 2.4)
MIN_COUNT = 3
#: Keys of ``[dog]`` by field.
DOG_KEYS = {name: declared.key for name, declared in quantities_of(Dog).items()}
EFFECT_TABLES = {"mechanism", "contact", "sliding", "dog"}  #: tables that an effect may change
PROBE_SHARES = (0.2, 0.4, 0.6, 0.8)  #: of the parameters' ranges, at which an effect is tried


def rounded(value: float, digits: int = 9) -> float:
    """Round a number to significant digits, so that conversions of units leave no trace."""
    return float(f"{value:.{digits}g}")


def clutch_tables(clutch: Clutch) -> Data:
    """Return ``[dog]``, ``[sliding]`` and ``[output]`` of a study with this clutch."""
    dog_table = {}
    for name, key in DOG_KEYS.items():
        value = getattr(clutch.dog, name)
        if value != getattr(Dog, name, None):
            dog_table[key] = value if key == "count" else rounded(from_si(key, value))
    rings = clutch.rings
    return {
        "dog": dog_table,
        "sliding": {"mass_kg": rings.mass, "inertia_kgm2": rings.sliding_inertia},
        "output": {"inertia_kgm2": rings.output_inertia},
    }


def study_of(bench: Bench, name: str) -> Data:
    """Build the tables of a study from a data set: clutch, contact, time-out, operating points.

    The rise time of a force is the mean of its rise times in the data set. Loads, material and
    tolerances are not part of a data set; they stay those of the program.
    """
    clutch = bench.clutch
    nominal_contact = record_quantities(contact_set(CONTACT))
    contact = {
        key: value
        for key, value in record_quantities(clutch.contact).items()
        if value != nominal_contact[key]
    }
    count = clutch.dog.count
    height = clutch.dog.height / MM
    low_count, high_count = (round(factor * count) for factor in COUNT_FACTORS)
    return {
        "format": FORMAT,
        "name": name,
        **clutch_tables(clutch),
        **({"drive": clutch.drive.table} if clutch.drive.table else {}),
        "contact": {"set": CONTACT, **contact},
        "shift": {
            "timeout_s": clutch.timeout,
            "seated_tolerance_mm": rounded(clutch.seated_tolerance / MM),
            "rebound_mm": rounded(clutch.rebound / MM),
        },
        "actuation": actuation_table(bench),
        "operating": operating_table(bench),
        "variables": {
            **ANGLES,
            "height_mm": [rounded(factor * height, 3) for factor in HEIGHT_FACTORS],
            "count": [max(MIN_COUNT, low_count), high_count],
        },
    }


def actuator_table(actuator: Actuator) -> Data:
    """Return ``[actuation]`` of an actuator: its kind and numbers, without optional defaults."""
    optional = optional_values(actuator.kind)
    numbers = {
        key: rounded(value)
        for key, value in record_quantities(actuator).items()
        if optional.get(key) != value
    }
    return {"kind": actuator.kind, **numbers}


def actuation_table(bench: Bench) -> Data:
    """Return ``[actuation]``: the actuator, or the mean rise time of each force of a data set."""
    if bench.clutch.actuator is not None:
        return actuator_table(bench.clutch.actuator)
    rises_by_force: dict[float, set[float]] = {}
    for cell in bench.cells:
        profile = cell.point.profile
        rises_by_force.setdefault(rounded(profile.force), set()).add(profile.rise)
    forces = sorted(rises_by_force)
    mean_rises = [
        rounded(sum(rises_by_force[force]) / len(rises_by_force[force])) for force in forces
    ]
    return {"force_N": forces, "rise_s": mean_rises}


def operating_table(bench: Bench) -> Data:
    """Return ``[operating]`` with the points of a data set: a grid if they are one, or a list."""
    points = []
    for cell in bench.cells:
        point = cell.point
        points.append((rounded(point.mismatch / RPM), rounded(point.profile.force)))
    points = list(dict.fromkeys(points))
    mismatches = list(dict.fromkeys(mismatch for mismatch, _ in points))
    forces = list(dict.fromkeys(force for _, force in points))
    if list(product(mismatches, forces)) == points:
        return {"mismatch_rpm": mismatches, "force_N": forces}
    return {"points": [{"mismatch_rpm": mismatch, "force_N": force} for mismatch, force in points]}


def has_keys_for(clutch: Clutch, effect: Effect) -> bool:
    """Decide whether a study of a clutch has keys for an effect; it has none for a user's own."""
    if effect.name not in registry.load():
        return False
    tables = {key.partition(".")[0] for key in touched_keys(clutch, effect)}
    return bool(tables) and tables <= EFFECT_TABLES


def touched_keys(clutch: Clutch, effect: Effect) -> set[str]:
    """List the keys of a study of a clutch that an effect changes at some of its values."""
    base = Setting(clutch, PROBE)
    keys: set[str] = set()
    for share in PROBE_SHARES:
        with suppress(DogshapeError):  # values that no bench has
            values = {parameter.name: parameter.at(share) for parameter in effect.parameters}
            keys |= effect_keys(effect, values, base)
    return keys


def effect_settings(clutch: Clutch, effect: Effect, values: Mapping[str, float]) -> dict[str, Any]:
    """Write an effect as dotted keys of a study; DogshapeError for values that no clutch has."""
    keys = touched_keys(clutch, effect)
    changed = effect.apply(Setting(clutch, PROBE), values)
    dog_fields = [name for name in DOG_KEYS if f"dog.{name}" in keys and name != "edge_radius"]
    if dog_fields:
        return _dog_settings(changed.clutch.dog, dog_fields)
    key = f"effects.{effect.name}"
    if len(values) == 1:
        (value,) = values.values()
        return {key: rounded(value, 6)}
    return {f"{key}.{name}": rounded(value, 6) for name, value in values.items()}


def _dog_settings(dog: Dog, names: Sequence[str]) -> dict[str, Any]:
    """Write fields of a dog as dotted keys of a study, edge units."""
    settings = {}
    for name in names:
        key = f"dog.{DOG_KEYS[name]}"
        value = getattr(dog, name)
        settings[key] = value if key == "dog.count" else rounded(from_si(key, value), 6)
    return settings
