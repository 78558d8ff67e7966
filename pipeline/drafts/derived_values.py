"""Values of a study that follow from those of the user: rules, applied in order."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from dogshape.pipeline.config.operating import KIND, OperatingSection, replaced_keys, value_at
from dogshape.pipeline.config.toml_text import with_values
from dogshape.pipeline.diagnose.study_keys import Data, rounded
from dogshape.pipeline.drafts.draft_keys import (
    ACTUATOR,
    ACTUATOR_NUMBERS,
    ADDED_MASS,
    BACKLASH,
    BACKLASH_DEG,
    CHAMFER_BACK,
    CHAMFERS,
    COUNT,
    CREST,
    DIAMETERS,
    DRAG,
    FORCE_RANGE,
    HEIGHT,
    HEIGHT_RANGE,
    HOLDING_FORCE,
    INERTIAS,
    MASS,
    MISMATCH,
    MOUNT,
    NOMINAL,
    OPERATING,
    POINT_SET,
    POINTS,
    RADIUS,
    RELEASE,
    RIM,
    RISE_RANGE,
    ROOF_CREST,
    STRIKE_MISMATCH,
    TORQUE,
)
from dogshape.sim.clutch_tables import mm_per_deg, validate
from dogshape.sim.errors import InputError
from dogshape.sim.quantity import record_quantities
from dogshape.sim.shift.actuators import (
    EXAMPLES,
    KINDS,
    Actuator,
    actuator_of,
    keys_of,
    required_keys,
)
from dogshape.sim.units import to_si

LookUp = Callable[[str], Any]  #: returns the value of a dotted key, None for a missing one
RING = (*DIAMETERS, *INERTIAS)
CLUTCH_KEYS = (*RING, MASS, TORQUE, KIND, ACTUATOR)
#: Keys and tables that hold for one clutch, by the keys of the clutch that void them.
BOUND_KEYS: dict[tuple[str, ...], tuple[str, ...]] = {
    RING: (
        RADIUS,
        DRAG,
        RIM,
        "sleeve.tooth_height_mm",
        "mechanism.ring_inertia_kgm2",
        "mechanism.input_stiffness_Nm_rad",
        "mechanism.spline_backlash_deg",
        "mechanism.wheel_inertia_kgm2",
        "mechanism.output_stiffness_Nm_rad",
        "driveline.stiffness_Nm_rad",
    ),
    (MASS,): (ADDED_MASS,),
    CLUTCH_KEYS: (
        HOLDING_FORCE,
        "strike",
        "load.pull_out_force_limit_N",
        "load.abuse_torque_Nm",
        "search.within_s",
    ),
}
#: Units of the absolute limits of a search, which are void for another clutch.
UNITS = ("_s", "_N", "_mm", "_Nm", "_Ns", "_J")


def is_under(key: str, stem: str) -> bool:
    """Test whether a dotted key is ``stem`` or lies in the table ``stem``."""
    return f"{key}.".startswith(f"{stem}.")


def draft_actuator(look_up: LookUp, derived: Mapping[str, Any]) -> Actuator | None:
    """Build the actuator of a draft; None for a profile or a fault."""
    kind = look_up(KIND)
    if kind not in KINDS:
        return None
    numbers = {}
    for key in keys_of(kind):
        value = derived.get(f"actuation.{key}", look_up(f"actuation.{key}"))
        if isinstance(value, (int, float)):
            numbers[key] = to_si(key, value)
    with suppress(InputError):
        return actuator_of(kind, numbers)
    return None


@dataclass(frozen=True)
class _Change:
    """Values of a study before and after the change of some keys."""

    values: Mapping[str, Any]  #: given values by dotted key
    before: LookUp
    after: LookUp
    keys: frozenset[str]  #: keys of ``CLUTCH_KEYS`` that changed

    def differs(self, key: str) -> bool:
        """Test whether the value of a key changed."""
        return bool(self.before(key) != self.after(key))


Rule = Callable[[_Change, Data], None]  #: updates the derived values of a change


def derive_values(
    text: str, values: Mapping[str, Any], rules: Sequence[Rule] | None = None
) -> tuple[Data, list[str]]:
    """Derive the values that follow from the given ones; None removes a key. Return notes too.

    Given values stay. Nothing follows from invalid values, which the study refuses. ``rules`` are
    by default all.
    """
    tables = tomllib.loads(with_values(text, values))
    before = partial(value_at, tomllib.loads(text))
    after = partial(value_at, tables)
    changed_keys = {key for key in CLUTCH_KEYS if before(key) != after(key)}
    changed_keys |= {MASS} & set(values)  # even if all moving mass equals that of the ring before
    change = _Change(values, before, after, keys=frozenset(changed_keys))
    if not _has_valid_numbers(change):
        return {}, []
    derived: Data = {}
    for rule in RULES if rules is None else rules:
        rule(change, derived)
    derived = {
        key: value
        for key, value in derived.items()
        if not any(is_under(key, given_key) for given_key in values)
    }
    replaced = replaced_keys({**values, **derived}, tables)
    notes = _notes_on_derived(derived, replaced)
    return derived | dict.fromkeys(replaced), notes


def _notes_on_derived(derived: Data, replaced: Sequence[str]) -> list[str]:
    """Describe derived, removed and replaced keys."""
    examples = {
        key: value
        for key, value in derived.items()
        if key in ACTUATOR_NUMBERS and value is not None
    }
    texts = [
        f"{key} {value}"
        for key, value in derived.items()
        if value is not None and key not in examples
    ]
    removed = [key for key, value in derived.items() if value is None]
    notes = []
    if texts:
        notes.append(f"follows from your clutch: {', '.join(texts)}")
    if examples:
        example_texts = [f"{key} {value:g}" for key, value in examples.items()]
        notes.append(f"an example, give your actuator's: {', '.join(example_texts)}")
    if removed:
        notes.append(f"left out, absent or unchecked until given: {', '.join(removed)}")
    if replaced:
        notes.append(f"replaced by values of yours: {', '.join(replaced)}")
    return notes


def _listed_points(change: _Change) -> list[Data]:
    """Return the operating points that a study lists, unless the change replaces them."""
    return [] if change.differs(POINTS) else change.before(POINTS) or []


def _required_forces(change: _Change) -> Any:
    """Return the forces of the operating points: a list, or another form of the file."""
    points = _listed_points(change)
    return [point["force_N"] for point in points] or change.after(OPERATING)


def _has_valid_numbers(change: _Change) -> bool:
    """Test whether the numbers that the rules use are positive numbers."""
    numbers = [change.after(key) for key in (COUNT, HEIGHT, *DIAMETERS)]
    numbers.append(change.after(TORQUE) or 1.0)
    for forces in (change.after(ACTUATOR), _required_forces(change)):
        if isinstance(forces, list):
            numbers += forces
    return all(isinstance(number, (int, float)) and number > 0 for number in numbers)


def _scale_height(change: _Change, derived: Data) -> None:
    """Scale the height with the pitch, so that dogs of another diameter keep their shape."""
    if change.keys & set(DIAMETERS):
        diameter_ratio = sum(map(change.after, DIAMETERS)) / sum(map(change.before, DIAMETERS))
        count_before, count = change.before(COUNT), change.after(COUNT)
        height = change.after(HEIGHT) * diameter_ratio * count_before / count
        derived[HEIGHT] = rounded(height, 3)


def _remove_bound_values(change: _Change, derived: Data) -> None:
    """Remove values of the copied clutch, and absolute limits of the search."""
    names = change.before("search.limits") or ()
    limits = tuple(f"search.limits.{name}" for name in names if name.endswith(UNITS))
    for changing_keys, bound_keys in (*BOUND_KEYS.items(), (CLUTCH_KEYS, limits)):
        if change.keys & set(changing_keys):
            derived |= {key: None for key in bound_keys if change.before(key) is not None}


def _set_simulated_strike(change: _Change, derived: Data) -> None:
    """Set ring and shaft of the shifts to the middle of a given strike's range.

    A nominal value within the range stays, and both stay if only one would be known.
    """

    def nominal_value(key: str) -> Any:
        return None if key in derived else change.after(key)

    middles: Data = {}
    for key, nominal_key in NOMINAL.items():
        value = change.values.get(key)
        ends = value if isinstance(value, list) else [value]
        if not all(isinstance(end, (int, float)) and end > 0 for end in ends):
            continue
        nominal = nominal_value(nominal_key)
        if nominal is None or not min(ends) <= nominal <= max(ends):
            middles[nominal_key] = rounded(math.sqrt(min(ends) * max(ends)), 3)
    other_keys = [key for key in NOMINAL.values() if key not in middles]
    is_alone = len(middles) == 1 and any(nominal_value(key) is None for key in other_keys)
    if not is_alone:
        derived |= middles


def _complete_actuator(change: _Change, derived: Data) -> None:
    """Add the numbers that a kind of actuator lacks, those of an example."""
    kind = change.after(KIND)
    if kind not in KINDS:
        return
    example = record_quantities(EXAMPLES[kind])
    for key in required_keys(kind):
        if change.after(f"actuation.{key}") is None:
            derived[f"actuation.{key}"] = rounded(example[key])


def _limit_forces(change: _Change, derived: Data) -> None:
    """Limit the forces of the operating points to the range of the actuator's."""
    actuator = draft_actuator(change.after, derived)
    if actuator is not None:
        _limit_to_actuator(change, derived, actuator.full_force)
        return
    available = change.after(ACTUATOR)
    required = _required_forces(change)
    if not isinstance(available, list) or not isinstance(required, list):
        return
    if min(available) <= min(required) <= max(required) <= max(available):
        return
    derived[OPERATING] = available
    points = _listed_points(change)
    if points:  # a list of points becomes a grid
        derived[MISMATCH] = sorted({point["mismatch_rpm"] for point in points})


def _limit_to_actuator(change: _Change, derived: Data, full_force: float) -> None:
    """Set the forces of the operating points to the full one, N, for a new kind or beyond it."""
    required = _required_forces(change)
    is_within = isinstance(required, list) and max(required) <= full_force
    if is_within and not change.differs(KIND):
        return
    if isinstance(required, Mapping) and not change.differs(KIND):
        return
    if change.values.keys() & {POINTS, POINT_SET}:
        return
    derived[OPERATING] = [math.floor(100.0 * full_force) / 100.0]
    if change.after(MISMATCH) is None:  # a list or a set of points becomes a grid
        operating = validate(OperatingSection, change.after("operating"), "[operating]")
        derived[MISMATCH] = sorted({mismatch for mismatch, *_ in operating.rows(full_force)})


def _keep_given_strike(change: _Change, derived: Data) -> None:
    """Remove the values of the old strike one by one if the new one has values."""
    if "strike" in derived and any(key.startswith("strike.") for key in change.values):
        del derived["strike"]
        derived |= {f"strike.{key}": None for key in change.before("strike")}


def _set_strike_mismatch(change: _Change, derived: Data) -> None:
    """Set the mismatch of a strike to the ends of a distribution, which no draw reaches."""
    mismatch = change.after(MISMATCH)
    has_strike = change.after("strike") and "strike" not in derived
    if has_strike and isinstance(mismatch, dict) and {"low", "high"} <= mismatch.keys():
        derived[STRIKE_MISMATCH] = [mismatch["low"], mismatch["high"]]


def _remove_sleeve(change: _Change, derived: Data) -> None:
    """Remove the sleeve of a copied study from dogs on a face, unless its keys are given."""
    gives_sleeve = any(key.startswith("sleeve") for key in change.values)
    if change.after(MOUNT) != "sleeve" and change.before("sleeve") and not gives_sleeve:
        derived["sleeve"] = None


def _complete_tip(change: _Change, derived: Data) -> None:
    """Add or remove the ridge of a roof, and decide whether changed faces must release.

    A tip without a back chamfer has no ridge, a new roof has it in the middle. Flat faces wait for
    the next window, others slide.
    """
    chamfers = [change.after(key) or 0.0 for key in CHAMFERS]
    if not all(isinstance(angle, (int, float)) for angle in chamfers):
        return
    crest = change.after(CREST)
    has_back = chamfers[1] > 0.0
    if chamfers[1] == 0.0 and change.after(CHAMFER_BACK) is not None and crest is not None:
        derived[CREST] = None
    if has_back and crest is None:
        derived[CREST] = ROOF_CREST
    is_flat = not any(chamfers)
    must_release = change.after(RELEASE) is not False
    if any(map(change.differs, CHAMFERS)) and is_flat == must_release:
        derived[RELEASE] = False if is_flat else None


def _widen_ranges(change: _Change, derived: Data) -> None:
    """Widen the ranges of a search that exclude the dog of the study."""

    def look_up(key: str) -> Any:
        return change.after(key) if key in change.values else derived.get(key, change.after(key))

    ranges: Data = {}
    searched = dict(look_up("variables") or {})
    output_ranges = searched.pop("output_dog", {})
    searched |= {f"output_dog.{key}": ends for key, ends in output_ranges.items()}
    for key, (low, high) in searched.items():
        name = key.rpartition(".")[2]
        value = look_up(f"dog.{name}")
        if f"dog.{name}" == BACKLASH and look_up(BACKLASH_DEG) is not None:
            value = look_up(BACKLASH_DEG) * mm_per_deg(*map(look_up, DIAMETERS))
        if name != key:
            output_value = look_up(key)
            value = value if output_value is None else output_value
        if not isinstance(value, (int, float)) or low <= value <= high:
            continue
        kind = type(low)
        new_low = min(low, kind(math.floor(value)))
        new_high = max(high, kind(math.ceil(value)))
        ranges[f"variables.{key}"] = [new_low, new_high]
    derived |= ranges


def _limit_searched_operation(change: _Change, derived: Data) -> None:
    """Limit the searched force to that of the actuator, and remove a searched rise time."""
    actuator = draft_actuator(change.after, derived)
    if actuator is None:
        return
    if change.after(RISE_RANGE) is not None:
        derived[RISE_RANGE] = None
    force_range = change.after(FORCE_RANGE)
    forces = derived.get(OPERATING, change.after(OPERATING))
    if not isinstance(force_range, list) or not isinstance(forces, list):
        return
    low, high = force_range
    max_factor = math.floor(100.0 * actuator.full_force / max(forces)) / 100.0
    if high > max_factor:
        derived[FORCE_RANGE] = [low, max_factor] if low < max_factor else None


def _limit_height(change: _Change, derived: Data) -> None:
    """Limit the range of the height to the travel of an actuator that the dog is within."""
    actuator = draft_actuator(change.after, derived)
    height_range = derived.get(HEIGHT_RANGE, change.after(HEIGHT_RANGE))
    forces = derived.get(OPERATING, change.after(OPERATING))
    if actuator is None or not isinstance(height_range, list):
        return
    force = min(forces) if isinstance(forces, list) else actuator.full_force
    max_height = 1e3 * actuator.reach(force) - change.after("dog.axial_gap_mm")
    max_height = math.floor(100.0 * max_height) / 100.0 if math.isfinite(max_height) else math.inf
    height: float = derived.get(HEIGHT) or change.after(HEIGHT)
    if height <= max_height < height_range[1]:
        derived[HEIGHT_RANGE] = [min(height_range[0], max_height), max_height]


#: Rules that derive values from a change, in this order; each updates the derived values.
RULES: tuple[Rule, ...] = (
    _scale_height,
    _remove_bound_values,
    _set_simulated_strike,
    _complete_actuator,
    _limit_forces,
    _keep_given_strike,
    _set_strike_mismatch,
    _remove_sleeve,
    _complete_tip,
    _widen_ranges,
    _limit_height,
    _limit_searched_operation,
)
#: Rules of another actuator for the same clutch.
ACTUATOR_RULES: tuple[Rule, ...] = (
    _complete_actuator,
    _limit_forces,
    _limit_height,
    _limit_searched_operation,
)
