"""Designs side by side, with their differences to the first and the errors of these.

Times are paired angle by angle where both designs were simulated at the same places of the pitch
(``pipeline.reports.study.paired``); otherwise their errors are independent. Where studies differ in
more than the dog, the keys that differ are told: a difference has those causes too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dogshape.pipeline.reports.comparison.items import Item
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.study.designs import engaged_shifts
from dogshape.pipeline.reports.study.paired import (
    Difference,
    overall,
    paired_points,
    point_differences,
)
from dogshape.pipeline.reports.study.single_shifts import place
from dogshape.pipeline.reports.study.standing import weights_by_place, worst_point
from dogshape.pipeline.store.folder import comparable, differing
from dogshape.pipeline.store.result_records import number_or_none
from dogshape.sim.shift.contact import ContactSet

#: Tables of a study file that shifts do not depend on, or that the dog itself is.
APART = ("name", "format", "dog", "variables", "search", "surrogate", "expectation")
PARAMETERS = {
    "static_friction": "",
    "dynamic_friction": "",
    "stiction_velocity": "m/s",
    "stiffness": "Pa/m",
    "dissipation": "s/m",
}


def designs_record(items: Sequence[Item]) -> Row:
    """Record designs side by side, and the differences of the others to the first."""
    first = items[0]
    return {
        "kind": "designs",
        "items": [_item_record(item) for item in items],
        "differences": [_difference_record(first, item) for item in items[1:]],
    }


def _item_record(item: Item) -> Row:
    one, study = item.standing, item.study
    dog = study.dog_with({name: one.row[name] for name in study.variables})
    whole = study.file.dog.model_dump()
    time = one.time or (None, None)
    worst = None if item.prototype is None else worst_point(item.prototype, one, item.shifts)
    return {
        "label": item.label,
        "source": item.source,
        "study": study.name,
        "design": one.trial,
        "prototype": bool(one.row["prototype"]),
        **{name: one.row.get(name, whole[name]) for name in whole if name != "axial_gap_mm"},
        "axial_length_mm": one.length_mm,
        "travel_mm": 1e3 * dog.travel,
        "expected_shift_time_s": time[0],
        "standard_error_s": time[1],
        "confirmed": one.confirmed,
        "shifts_engaged": None if one.record is None else list(engaged_shifts(one.record)),
        "predicted_by": item.predicted or None,
        "worst_against_prototype": None if worst is None else _point_record(worst[0], worst[1]),
        "smallest_margins": [{"name": name, "margin": margin} for name, margin in one.least],
        "weakest_check_worst_case": one.worst and one.worst[0],
        "margin_worst_case": one.worst and number_or_none(one.worst[1]),
        "passes": one.passes,
        "locking_friction": one.friction[0],
        "locking_surface": one.friction[1],
        "engine": item.engine,
        "contact": study.clutch.contact.name,
        "material": study.limits.material.name,
        "operating_points": len(study.points),
        "physics_hash": study.physics_hash,
        "config_hash": study.config_hash,
    }


def _point_record(point: Row, one: Difference) -> Row:
    return {
        "mismatch_rpm": point["mismatch_rpm"],
        "force_N": point["force_N"],
        "difference_s": one.value,
        "standard_error_s": number_or_none(one.error),
        "paired": one.paired,
    }


def _difference_record(first: Item, other: Item) -> Row:
    pairs = paired_points(first.confirmed_shifts, other.confirmed_shifts)
    points = point_differences(first.standing.points, other.standing.points, pairs)
    if first.standing.time is None or other.standing.time is None:
        points = {}  # means that are retries
    records = []
    for point in first.standing.points:
        at = place(point["mismatch_rpm"], point["force_N"])
        if at in points:
            records.append(_point_record(point, points[at]))
    time, notes = _time(first, other, points)
    one, two = first.standing, other.standing
    return {
        "of": other.label,
        "to": first.label,
        "expected_shift_time_s": None if time is None else time.value,
        "standard_error_s": None if time is None else number_or_none(time.error),
        "paired": bool(time and time.paired),
        "clear": bool(time and time.clear),
        "axial_length_mm": two.length_mm - one.length_mm,
        "locking_friction": two.friction[0] - one.friction[0],
        "other_keys": _other_keys(first, other),
        "notes": notes,
        "points": records,
    }


def _time(
    first: Item, other: Item, points: dict[Any, Difference]
) -> tuple[Difference | None, list[str]]:
    """Take the difference of expected times, with sentences on what it does not cover."""
    weights, theirs = weights_by_place(first.study), weights_by_place(other.study)
    notes = []
    if points:
        if set(points) != set(weights) or weights != theirs:
            notes.append(
                f"taken over the {len(points)} operating points that both have, with the weights "
                f"of {first.label}"
            )
        if any(one.paired for one in points.values()) and not all(
            one.paired for one in points.values()
        ):
            paired = sum(one.paired for one in points.values())
            notes.append(f"paired at {paired} of {len(points)} operating points")
        return overall(points, weights), notes
    one, two = first.standing.time, other.standing.time
    if one is None or two is None:
        lacking = first if one is None else other
        how = "was not simulated" if lacking.standing.record is None else "does not engage"
        return None, [f"{lacking.label} {how}"]
    if weights != theirs:
        return None, [
            "their operating points differ, and not both were confirmed: times of other mixes of "
            "points have no difference"
        ]
    foretold = [f"the time of {i.label} is that of the {i.predicted}" for i in (first, other)
                if i.predicted]  # fmt: skip
    own = "one of both was not simulated at the new angles, so its search's time counts"
    notes += foretold or [own]
    return Difference(two[0] - one[0], float((one[1] ** 2 + two[1] ** 2) ** 0.5), False), notes


def _other_keys(first: Item, other: Item) -> list[str]:
    """List the keys of the study files that differ, beside dog and search: first against other."""
    before, now = (
        {k: _given(v) for k, v in comparable(item.study.file).items() if k not in APART}
        for item in (first, other)
    )
    found = differing(before, now)
    return [one.replace(" was ", ": ", 1).replace(" and is now ", " against ", 1) for one in found]


def _given(value: Any) -> Any:
    """Leave out of tables what is not given."""
    if not isinstance(value, dict):
        return value
    return {key: _given(one) for key, one in value.items() if one is not None}


def contacts_record(sets: Sequence[ContactSet]) -> Row:
    """Record contact sets side by side, and each parameter over that of the first."""
    first = sets[0]
    return {
        "kind": "contact_sets",
        "items": [
            {"label": one.name, **{name: getattr(one, name) for name in PARAMETERS}} for one in sets
        ],
        "differences": [
            {
                "of": one.name,
                "to": first.name,
                **{
                    f"{name}_ratio": getattr(one, name) / getattr(first, name)
                    for name in PARAMETERS
                },
            }
            for one in sets[1:]
        ],
    }
