"""Rows of a comparison in words: a quantity, a cell for each item, and the difference behind it."""

from __future__ import annotations

from dogshape.pipeline.reports.comparison.side_by_side import PARAMETERS
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import (
    axis,
    check_name,
    minus,
    ms_with_error,
    percent,
    place_name,
)

VARIABLES = ("count", "chamfer_deg", "traction_deg", "braking_deg", "height_mm",
             "outer_diameter_mm", "inner_diameter_mm")  #: in the order of the table  # fmt: skip


def rows_of(record: Row) -> list[list[str]]:
    """Write a comparison as rows: the head first, then a row for each quantity."""
    items = record["items"]
    head = ["", *(item["label"] for item in items)]
    if record["kind"] == "contact_sets":
        return [head, *_contact_rows(record)]
    rows = [head]
    for name in VARIABLES:
        title = axis(name) if name in ("chamfer_deg", "traction_deg", "braking_deg",
                                       "height_mm", "count") else _plain(name)  # fmt: skip
        rows.append([title, *(f"{item[name]:.4g}" for item in items)])
    rows += [
        ["axial length, mm", *(f"{item['axial_length_mm']:.2f}" for item in items)],
        ["expected shift time, ms", *map(_time, items)],
        [f"less that of {items[0]['label']}, ms", "", *map(_difference, record["differences"])],
        ["worst point against its prototype, ms", *map(_worst, items)],
        ["smallest margins, nominal size", *map(_margins, items)],
        ["smallest margin at worst-case tolerances", *map(_worst_margin, items)],
        ["passes every check", *("yes" if item["passes"] else "no" for item in items)],
        ["locks above friction", *map(_friction, items)],
        ["contact set", *(item["contact"] for item in items)],
        ["material", *(item["material"] for item in items)],
        ["operating points", *(str(item["operating_points"]) for item in items)],
        ["engine", *(item["engine"] for item in items)],
        ["source", *(item["source"] for item in items)],
    ]
    return rows


def notes_of(record: Row) -> list[str]:
    """Write sentences on each difference: what it covers, and keys that differ."""
    said = []
    for one in record["differences"]:
        name = f"{one['to']} and {one['of']}"
        said += [f"{name}: {note}" for note in one.get("notes", ())]
        said += [f"{name} differ in more than the dog: {key}" for key in one.get("other_keys", ())]
    return said


def point_rows(difference: Row) -> list[list[str]]:
    """Write the operating points of a difference, largest loss first."""
    points = sorted(difference["points"], key=lambda one: -one["difference_s"])
    return [
        [
            place_name(one["mismatch_rpm"], one["force_N"]),
            _signed(one["difference_s"], one["standard_error_s"]),
        ]
        for one in points
    ]


def _contact_rows(record: Row) -> list[list[str]]:
    rows = []
    for name, unit in PARAMETERS.items():
        title = f"{_plain(name)}, {unit}" if unit else _plain(name)
        ratios = ["1", *(f"{one[f'{name}_ratio']:.3g}" for one in record["differences"])]
        values = [f"{item[name]:.4g}" for item in record["items"]]
        rows.append([title, *(f"{v} (x {r})" for v, r in zip(values, ratios, strict=True))])
    return rows


def _plain(name: str) -> str:
    return name.replace("_mm", ", mm").replace("_", " ")


def _time(item: Row) -> str:
    value, error = item["expected_shift_time_s"], item["standard_error_s"]
    if value is None:
        engaged = item["shifts_engaged"]
        return "engages in {} of {}".format(*engaged) if engaged else "not simulated"
    said = ms_with_error(value, error or 0.0)
    return said if item["confirmed"] else f"{said} ({item['predicted_by'] or 'search'})"


def _difference(one: Row) -> str:
    if one["expected_shift_time_s"] is None:
        return "-"
    how = "same angles" if one["paired"] else "independent errors"
    clear = "" if one["clear"] else ", not clear"
    return f"{_signed(one['expected_shift_time_s'], one['standard_error_s'])} ({how}{clear})"


def _signed(value: float, error: float | None) -> str:
    if error is None:
        return minus(f"{1e3 * value:+.1f}")
    return ms_with_error(value, error, "+")


def _worst(item: Row) -> str:
    worst = item["worst_against_prototype"]
    if worst is None or item["prototype"]:
        return "-"
    at = place_name(worst["mismatch_rpm"], worst["force_N"])
    return f"{_signed(worst['difference_s'], worst['standard_error_s'])} at {at}"


def _margins(item: Row) -> str:
    return ", ".join(_margin(one) for one in item["smallest_margins"][:2])


def _worst_margin(item: Row) -> str:
    margin, name = item["margin_worst_case"], item["weakest_check_worst_case"]
    return "no dog" if margin is None else f"{percent(margin)} {check_name(name)}"


def _margin(one: Row) -> str:
    return f"{percent(one['margin'])} {check_name(one['name'])}"


def _friction(item: Row) -> str:
    surface = check_name(item["locking_surface"]).removesuffix(" release")
    return f"{item['locking_friction']:.3f} ({surface})"
