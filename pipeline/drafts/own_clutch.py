"""Keys of a study that follow from a clutch of one's own.

A study begins as a copy of another one. Values that hold for the other clutch alone are computed
from the new one where a rule does so, and left out where none does:

- toothing of the ring at its default share of the inner radius
- moving mass as given, with nothing added
- force that the blocking mechanism holds, as torque over mean radius
- height of the dogs, with other diameters, as mean diameter over count: the same shape
- height range as the height; other search ranges as they are, widened until they hold the own dog
- forces with which it shifts, as those of the actuator
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from dogshape.sim.shift.mechanism import SPLINE

Row = dict[str, Any]  #: a table of a TOML file, or values by dotted key
DIAMETERS = ("dog.outer_diameter_mm", "dog.inner_diameter_mm")
INERTIAS = ("sliding.inertia_kgm2", "output.inertia_kgm2")
HEIGHT = "dog.height_mm"
MASS, ADDED, TORQUE = "sliding.mass_kg", "mechanism.added_mass_kg", "load.torque_Nm"
ACTUATOR, OPERATING = "actuation.force_N", "operating.force_N"
LAST_ANGLE = 59.0  #: deg, of a search range
#: Keys and tables that hold for one clutch, each with the keys of the clutch that void it.
BOUND = {
    "mechanism.spline_radius_mm": DIAMETERS,
    ADDED: (MASS,),
    "mechanism.drag_torque_Nm": (*DIAMETERS, *INERTIAS),
    "mechanism.ring_inertia_kgm2": INERTIAS,
    "mechanism.input_stiffness_Nm_rad": INERTIAS,
    "mechanism.spline_backlash_deg": INERTIAS,
    "mechanism.wheel_inertia_kgm2": INERTIAS,
    "mechanism.output_stiffness_Nm_rad": INERTIAS,
    "driveline.stiffness_Nm_rad": (*DIAMETERS, *INERTIAS),
    "strike": (*DIAMETERS, *INERTIAS, TORQUE),
    "load.pull_out_force_limit_N": (ACTUATOR,),
    "load.abuse_torque_Nm": (TORQUE,),
    "search.reference": DIAMETERS,
    "search.within_s": (*DIAMETERS, *INERTIAS, MASS, ACTUATOR),
}
#: Limits of a search in units of their own are void with any of these.
ANY = (*DIAMETERS, *INERTIAS, MASS, TORQUE, ACTUATOR)
UNITS = ("_s", "_N", "_mm", "_Nm", "_Ns", "_J")
#: What is said of a key that is left out, where it is not simply not judged.
INSTEAD = {
    "mechanism.spline_radius_mm": f"{SPLINE:g} of the inner radius",
    ADDED: f"{MASS} is all that moves",
    "mechanism.drag_torque_Nm": "no drag",
    "load.pull_out_force_limit_N": "the largest shift force",
    "search.reference": "the study's own dog",
}


def value_at(tables: Mapping[str, Any], key: str) -> Any:
    """Look up a dotted key; None where it is missing."""
    found: Any = tables
    for name in key.split("."):
        found = found.get(name) if isinstance(found, Mapping) else None
    return found


def following(origin: Row, own: Row, given: Mapping[str, Any]) -> tuple[Row, list[str]]:
    """Compute what follows from a clutch of one's own: values, None to leave out; and sentences.

    Parameters
    ----------
    origin, own : tables of the study that is copied, without and with the given values.
    given : the given values by dotted key, which stay.
    """
    if not _sound(own):
        return {}, []  # what is wrong is said by the study
    changed = {key for key in ANY if value_at(origin, key) != value_at(own, key)}
    bound = {**BOUND, **dict.fromkeys(_limits(origin), ANY)}
    left = [key for key, by in bound.items() if changed & set(by)]
    if MASS in given:  # also where all that moves is what the ring alone was
        left = list(dict.fromkeys([*left, ADDED]))
    left = [key for key in left if value_at(origin, key) is not None]
    height: Row = {}
    if changed & set(DIAMETERS) and HEIGHT not in given:
        height[HEIGHT] = _rounded(value_at(own, HEIGHT) * _module(own) / _module(origin))
        own = {**own, "dog": {**own["dog"], "height_mm": height[HEIGHT]}}
    found: Row = {
        **height,
        **dict.fromkeys(left),
        **_scaled(origin, own),
        **{f"variables.{key}": ends for key, ends in _ranges(origin, own)},
    }
    found = {key: value for key, value in found.items() if not _is_given(key, given)}
    return found, list(_sentences(found))


def _sound(tables: Row) -> bool:
    """Test that the numbers are there that others follow from."""
    lists = [value_at(tables, key) for key in (ACTUATOR, OPERATING)]
    values = [value_at(tables, key) for key in ("dog.count", HEIGHT, *DIAMETERS)]
    for one in lists:
        values += one if isinstance(one, list) else []
    return all(isinstance(one, (int, float)) and one > 0 for one in values)


def _is_given(key: str, given: Mapping[str, Any]) -> bool:
    return any(key == one or key.startswith(f"{one}.") for one in given)


def _limits(tables: Row) -> list[str]:
    """List the limits of a search that have a unit."""
    limits = value_at(tables, "search.limits") or {}
    return [f"search.limits.{name}" for name in limits if name.endswith(UNITS)]


def _scaled(origin: Row, own: Row) -> Row:
    """Compute the values that a rule gives."""
    found: Row = {}
    held, gap, rebound = "load.separating_force_limit_N", "dog.axial_gap_mm", "shift.rebound_mm"
    limit, ratio = value_at(origin, held), _pull(own) / _pull(origin)
    if limit is not None and ratio != 1.0:
        found[held] = _rounded(limit * ratio)
    new = value_at(own, gap)
    if new and new != value_at(origin, gap) == value_at(origin, rebound):
        found[rebound] = new
    has, wants = (value_at(own, key) for key in (ACTUATOR, OPERATING))
    lists = isinstance(has, list) and isinstance(wants, list) and has and wants
    if lists and not min(has) <= min(wants) <= max(wants) <= max(has):
        found[OPERATING] = has
    return found


def _pull(tables: Row) -> float:
    """Compute torque over mean radius, in a unit that cancels; 1 without a torque."""
    torque, outer, inner = (value_at(tables, key) for key in (TORQUE, *DIAMETERS))
    there = isinstance(torque, (int, float)) and torque > 0
    return float(torque / (outer + inner)) if there else 1.0


def _module(tables: Row) -> float:
    """Compute twice the mean diameter over the number of dogs, mm."""
    outer, inner = (value_at(tables, key) for key in DIAMETERS)
    return float((outer + inner) / value_at(tables, "dog.count"))


def _ranges(origin: Row, own: Row) -> Iterator[tuple[str, list[float]]]:
    """Yield the search ranges that change: each holds the own dog."""
    for key, (low, high) in (value_at(origin, "variables") or {}).items():
        value, before = (value_at(tables, f"dog.{key}") for tables in (own, origin))
        if not isinstance(value, (int, float)) or value == before:
            continue
        ends = [low, high]
        if key == "height_mm":
            ends = [_rounded(end * value / before) for end in ends]
        if not ends[0] <= value <= ends[1]:
            ends = [min(ends[0], 0.5 * value), max(ends[1], 1.5 * value)]
        if key == "count":
            ends = [max(2, math.floor(ends[0])), math.ceil(ends[1])]
        if key.endswith("_deg"):
            ends[1] = min(ends[1], max(LAST_ANGLE, value))
        if ends != [low, high]:
            yield key, ends


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _sentences(found: Row) -> Iterator[str]:
    computed = [f"{key} {_text(value)}" for key, value in found.items() if value is not None]
    if computed:
        yield f"follows from your clutch: {', '.join(computed)}"
    replaced = [f"{key} ({INSTEAD[key]})" for key in found if found[key] is None and key in INSTEAD]
    if replaced:
        yield f"left out, with what holds instead: {', '.join(replaced)}"
    unjudged = [key for key, value in found.items() if value is None and key not in INSTEAD]
    if unjudged:
        yield f"left out, so not judged; give your own: {', '.join(unjudged)}"


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
