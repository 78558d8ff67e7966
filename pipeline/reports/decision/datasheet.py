"""Content of the data sheet of a design: dimensions, times, margins, provenance on one page."""

from __future__ import annotations

import math
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.text import (
    check_name,
    minus,
    ms_with_error,
    percent,
    place_name,
)
from dogshape.pipeline.reports.study.provenance import command_of
from dogshape.pipeline.reports.study.single_shifts import Shifts
from dogshape.pipeline.reports.study.standing import (
    Standing,
    difference,
    standing_of,
    worst_point,
)
from dogshape.pipeline.reports.study.summary import engine_of
from dogshape.pipeline.simulate.design import SUMMARIES, design_of, margins_within
from dogshape.pipeline.store.decisions import Decision
from dogshape.pipeline.store.result_records import check_record
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.units import DEG, MM

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.store.result_schema``
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


def sheet_of(
    study: Setup, result: Row, chosen: Standing, decision: Decision, shifts: Shifts
) -> Row:
    """Collect the content of the data sheet's template.

    ``shifts`` pair the design with the prototype where there are shifts of both at the same angles.
    """
    params = {name: chosen.row[name] for name in study.variables}
    dog = study.dog_with(params)
    return {
        "study": study.name,
        "design": chosen.trial,
        "decision": decision,
        "dimensions": dimensions_of(dog, study.limits),
        "material": study.limits.material.name,
        "times": _times(study, result, chosen, shifts),
        "margins": margins_of(study, params, chosen),
        "provenance": _provenance(study, result, decision),
    }


def dimensions_of(dog: Dog, limits: Limits) -> list[tuple[str, str, str]]:
    """List words, value and tolerance of each dimension, and those that follow in brackets."""
    known = limits.tolerances.dimensions
    rows = [("number of dogs N", f"{dog.count}", "both rings alike")]
    for name, words, size, unit in DIMENSIONS:
        tolerance = f"± {known[name] / size:.2f} {unit}" if name in known else "ISO 2768-f"
        rows.append((words, f"{getattr(dog, name) / size:.2f} {unit}", tolerance))
    radius = known.get("root_radius")
    rows.append(
        (
            "root and tip radius R" if dog.edge_radius == 0.0 else "root radius R",
            f"{limits.root_radius / MM:.2f} mm",
            "ISO 2768-f" if radius is None else f"± {radius / MM:.2f} mm",
        )
    )
    if dog.edge_radius > 0.0:
        rows.append(("radius of the tip edges", f"{dog.edge_radius / MM:.2f} mm", "ISO 2768-f"))
    follows = (
        ("travel to full depth", dog.travel),
        ("tip width at the inner radius", dog.tip_width_at(dog.inner_radius)),
        ("pitch at the mean radius", dog.pitch),
    )
    return [*rows, *((words, f"({length / MM:.3f} mm)", "follows") for words, length in follows)]


def _times(study: Setup, result: Row, chosen: Standing, shifts: Shifts) -> list[tuple[str, str]]:
    own = next(row for row in result["trials"] if row["prototype"])
    prototype = standing_of(study, result, own)
    source = "new angles" if chosen.confirmed else "search only"
    rows = [
        (f"expected shift time ({source})", _time(chosen)),
        ("of the prototype", _time(prototype)),
    ]
    gain = difference(study, chosen, prototype, shifts)
    if gain is not None and chosen.trial != prototype.trial:
        paired = " (same angles)" if gain.paired else ""
        rows.append((f"gain{paired}", f"{ms_with_error(gain.value, gain.error)} ms"))
    if chosen.points and chosen.time is not None:
        slow = max(chosen.points, key=lambda p: p["mean_s"])
        at = place_name(slow["mismatch_rpm"], slow["force_N"])
        error = slow["standard_error_s"]
        rows.append((f"slowest point, {at}", f"{ms_with_error(slow['mean_s'], error or 0.0)} ms"))
        engaged = min(p["engaged"] for p in chosen.points)
        rows.append(("engage at the first try, least", f"{100 * engaged:.0f} %"))
    worst = worst_point(prototype, chosen, shifts)
    if worst is not None and chosen.trial != prototype.trial:
        point, loss = worst
        at = place_name(point["mismatch_rpm"], point["force_N"])
        side = "slower" if loss.value > 0.0 else "faster"
        words = f"{ms_with_error(abs(loss.value), loss.error)} ms {side}"
        rows.append((f"worst against the prototype, {at}", words))
    value, name = chosen.friction
    surface = check_name(name).removesuffix(" release")
    rows.append((f"friction above which the {surface} locks", f"{value:.3f}"))
    return rows


def _time(one: Standing) -> str:
    return one.time_words + (" shifts" if one.time is None else " ms")


def margins_of(study: Setup, params: dict[str, float], chosen: Standing) -> list[Row]:
    """List each check with its margin, nominal and with all tolerances at their worst."""
    design = design_of(study, params)
    within = margins_within(study, design)
    known = {check.name: check_record(check) for check in design.checks}
    known |= {check["name"]: check for check in (chosen.record or {"checks": []})["checks"]}
    rows = []
    for name, margin in chosen.margins.items():
        if name in SUMMARIES:
            continue
        check = known.get(name)
        worst = within.get(name, {}).get("worst_case")
        rows.append(
            {
                "name": check_name(name),
                "group": list(GROUPS).index(check["group"]) if check else len(GROUPS),
                "value": "" if check is None else _value(check),
                "limit": "" if check is None else _limit(check["at_most"], check["limit"]),
                "margin": percent(margin),
                "worst": "" if worst is None else "no dog" if math.isinf(worst) else percent(worst),
                "low": margin < 0.0,
                "worst_low": worst is not None and worst < 0.0,
            }
        )
    return sorted(rows, key=lambda row: row["group"])


def _value(check: Row) -> str:
    value = check["value"]
    return "-" if value is None else minus(f"{value:.4g} {check['unit']}".strip())


def _limit(at_most: bool, limit: float) -> str:
    return minus(f"{'≤' if at_most else '≥'} {limit:.4g}")


def _provenance(study: Setup, result: Row, decision: Decision) -> list[tuple[str, str]]:
    load = study.file.load
    versions = ", ".join(f"{name} {version}" for name, version in result["versions"].items())
    confirmation = result["confirmation"]
    angles = f", confirmed at {confirmation['angles']} new angles" if confirmation else ""
    return [
        ("study", command_of(study) or f"{study.name}, its file in study.json"),
        ("simulated", f"{result['n_simulated_shifts']} shifts by {engine_of(result)}{angles}"),
        ("operating points", study.operating_text),
        ("load", f"{load.torque_Nm:g} N m, application factor {load.application_factor:g}"),
        ("mechanism", ", ".join(f"{k} {v:.4g}" for k, v in study.mechanism.items()) or "-"),
        ("contact", f"{study.clutch.contact.name}, friction "
                    f"{study.clutch.contact.static_friction:g} static, "
                    f"{study.clutch.contact.dynamic_friction:g} dynamic"),
        ("hashes", f"configuration {decision.config_hash}, physics {decision.physics_hash}, "
                   f"result {decision.result_sha256[:20]}"),
        ("versions", versions),
    ]  # fmt: skip
