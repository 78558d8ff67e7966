"""Data sheet of a design: dimensions, times, margins and provenance on one page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.kit.html import write_page
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import check_name, minus, ms_with_error, percent, place_name
from dogshape.pipeline.reports.study.design_record import confirmation_of
from dogshape.pipeline.reports.study.named_design import NamedDesign
from dogshape.pipeline.reports.study.provenance import command_of, now
from dogshape.pipeline.reports.study.summary import engine_of
from dogshape.pipeline.search.tolerance_effects import checks_within
from dogshape.pipeline.simulate.design import SUMMARIES, design_of, margins_within
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.units import DEG, MM
from dogshape.sim.versions import versions

#: Dimensions in the order of the sheet: field of the dog, words, and the unit's size and name.
DIMENSIONS = (
    ("chamfer", "chamfer \u03b1", DEG, "°"),
    ("traction", "traction flank \u03b2", DEG, "°"),
    ("braking", "braking flank \u03b3", DEG, "°"),
    ("height", "height h", MM, "mm"),
    ("outer_diameter", "outer diameter", MM, "mm"),
    ("inner_diameter", "inner diameter", MM, "mm"),
    ("axial_gap", "axial gap in neutral", MM, "mm"),
)
GENERAL = "ISO 2768-f"  #: tolerance of a dimension that the study gives none for


def sheet_record(one: NamedDesign, record: Row, checks: Sequence[Row] | None, why: str) -> Row:
    """Record the data sheet of a design.

    Parameters
    ----------
    record : record of the design (``design_record``).
    checks : its checks where it was checked; None for a design of a result.
    why : reason of a decision for the design; empty for none.
    """
    study = one.own_study
    if checks is None:
        checks = _searched_checks(study, one, record["margins"])
    own = [check for check in checks if check["name"] not in SUMMARIES]
    return {
        "name": one.title,
        "time": now(),
        "why": why or None,
        **record,
        "dimensions": _dimensions(study),
        "checks": sorted(own, key=lambda check: list(GROUPS).index(check["group"])),
        "provenance": _provenance(one),
    }


def write_sheet(study: Setup, sheet: Row, path: Path) -> None:
    """Write the page of a data sheet; ``study`` has the design as its own dog."""
    section = dimensioned_svg(study.clutch.dog, study.limits, sheet["name"])
    write_page(
        path, "datasheet.html.j2", plotly="", section=section, times=_times(sheet),
        percent=percent, check_name=check_name, minus=minus, **sheet,
    )  # fmt: skip


def _dimensions(study: Setup) -> list[Row]:
    """List the dimensions with their tolerances; those that follow from others have none."""
    dog, limits = study.clutch.dog, study.limits
    known = limits.tolerances.dimensions
    rows: list[tuple[str, float, str, str]] = [
        ("number of dogs N", dog.count, "", "both rings alike")
    ]
    for name, words, size, unit in DIMENSIONS:
        tolerance = f"± {known[name] / size:.2f} {unit}" if name in known else GENERAL
        rows.append((words, getattr(dog, name) / size, unit, tolerance))
    radius = known.get("root_radius")
    words = "root and tip radius R" if dog.edge_radius == 0.0 else "root radius R"
    tolerance = GENERAL if radius is None else f"± {radius / MM:.2f} mm"
    rows.append((words, limits.root_radius / MM, "mm", tolerance))
    if dog.edge_radius > 0.0:
        rows.append(("radius of the tip edges", dog.edge_radius / MM, "mm", GENERAL))
    follows = (
        ("travel to full depth", dog.travel),
        ("tip width at the inner radius", dog.tip_width_at(dog.inner_radius)),
        ("pitch at the mean radius", dog.pitch),
    )
    rows += [(words, length / MM, "mm", "follows") for words, length in follows]
    keys = ("dimension", "value", "unit", "tolerance")
    return [dict(zip(keys, row, strict=True)) for row in rows]


def _searched_checks(study: Setup, one: NamedDesign, margins: Row) -> list[Row]:
    """List the closed forms of a design, then what the confirmation or the search simulated."""
    assert one.result is not None
    assert one.row is not None
    design = design_of(study, {})
    found = {check["name"]: check for check in checks_within(design, margins_within(study, design))}
    confirmed = confirmation_of(one.result, one.row) or {"checks": []}
    for check in confirmed["checks"]:
        found[check["name"]] = found.get(check["name"], {}) | check
    for name in margins.keys() - found.keys():
        found[name] = {"name": name, "margin": margins[name], "group": "impact"}
    return list(found.values())


def _times(sheet: Row) -> list[tuple[str, str]]:
    """List what was simulated, in words, and the friction that locks."""
    name = f"expected shift time ({sheet['source']})"
    if sheet["expected_shift_time_s"] is None:
        counts = sheet["shifts_engaged"]
        rows = [(name, "engages in {} of {} shifts".format(*counts) if counts else "none")]
    else:
        rows = [(name, _ms(sheet["expected_shift_time_s"], sheet["standard_error_s"]))]
    if sheet["gain_s"] is not None:
        gain = _ms(sheet["gain_s"], sheet["gain_standard_error_s"])
        rows.append(("gain over the prototype", gain))
    if (slow := sheet["slowest_point"]) is not None:
        at = place_name(slow["mismatch_rpm"], slow["force_N"])
        rows.append((f"slowest point, {at}", _ms(slow["mean_s"], slow["standard_error_s"])))
    if (worst := sheet["worst_against_prototype"]) is not None:
        at = place_name(worst["mismatch_rpm"], worst["force_N"])
        loss = worst["difference_s"]
        words = _ms(abs(loss), worst["standard_error_s"]) + (" slower" if loss > 0 else " faster")
        rows.append((f"worst against the prototype, {at}", words))
    if sheet["engaged"] is not None:
        rows.append(("engage at the first try, least", f"{100 * sheet['engaged']:.0f} %"))
    surface = check_name(sheet["locking_surface"]).removesuffix(" release")
    friction = f"{sheet['locking_friction']:.3f}"
    return [*rows, (f"friction above which the {surface} locks", friction)]


def _ms(time: float, error: float | None) -> str:
    return f"{ms_with_error(time, error or 0.0)} ms"


def _provenance(one: NamedDesign) -> dict[str, str]:
    study, result = one.study, one.result
    load, contact = study.file.load, study.clutch.contact
    simulated, brought = "as by 'dogshape check'", versions()
    if result is not None:
        confirmation, brought = result["confirmation"], result["versions"]
        angles = f", confirmed at {confirmation['angles']} new angles" if confirmation else ""
        simulated = f"{result['n_simulated_shifts']} shifts by {engine_of(result)}{angles}"
    found: dict[str, Any] = {
        "study": command_of(study) or f"{study.name}, its file in study.json",
        "simulated": simulated,
        "operating points": study.operating_text,
        "load": f"{load.torque_Nm:g} N m, application factor {load.application_factor:g}",
        "material": study.limits.material.name,
        "mechanism": ", ".join(f"{k} {v:.4g}" for k, v in study.mechanism.items()) or "-",
        "contact": f"{contact.name}, friction {contact.static_friction:g} static, "
        f"{contact.dynamic_friction:g} dynamic",
        "hashes": f"configuration {study.config_hash}, physics {study.physics_hash}"
        + ("" if result is None else f", result {content_key(result)}"),
        "versions": ", ".join(f"{name} {version}" for name, version in brought.items()),
    }
    return found
