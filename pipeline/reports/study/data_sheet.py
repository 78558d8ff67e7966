"""Data sheet of a design: dimensions, times, margins and provenance on one page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.kit.html import write_page
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import check_name, label, minus, percent
from dogshape.pipeline.reports.study.design_record import confirmation_of, words_of
from dogshape.pipeline.reports.study.named_design import NamedDesign
from dogshape.pipeline.reports.study.provenance import command_of, now
from dogshape.pipeline.reports.study.summary import engine_of
from dogshape.pipeline.search.tolerance_effects import checks_within
from dogshape.pipeline.simulate.design import SUMMARIES, design_of, margins_within
from dogshape.pipeline.store.folder import write_json
from dogshape.sim.clutch_tables import DogSection
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.units import suffix_of, to_si, unit_of
from dogshape.sim.versions import versions

GENERAL = "ISO 2768-f"  #: tolerance of a dimension that the study gives none for


def write_sheet(one: NamedDesign, record: Row, checks: Sequence[Row], why: str, path: Path) -> None:
    """Write the data sheet of a design as a page, or as JSON by the ending of the path.

    Parameters
    ----------
    record, checks : of the design (``design_record``), and each of its checks.
    why : reason of a decision for the design; empty for none.
    """
    study = one.own_study
    own = [check for check in checks if check["name"] not in SUMMARIES]
    sheet = {
        "name": one.title,
        "time": now(),
        "why": why or None,
        **record,
        "dimensions": _dimensions(study),
        "checks": sorted(own, key=lambda check: list(GROUPS).index(check["group"])),
        "provenance": _provenance(one),
    }
    if path.suffix.lower() == ".json":
        return write_json(path, sheet)
    write_page(
        path, "datasheet.html.j2", plotly="", words=words_of(sheet), general=GENERAL,
        section=dimensioned_svg(study.clutch.dog, study.limits, one.title),
        percent=percent, check_name=check_name, minus=minus, label=label, **sheet,
    )  # fmt: skip


def _dimensions(study: Setup) -> list[Row]:
    """List the dimensions with their tolerances; those that follow from others have none."""
    dog, limits, known = study.clutch.dog, study.limits, study.limits.tolerances.dimensions
    every = {key: getattr(dog, key.removesuffix(suffix_of(key))) for key in DogSection.model_fields}
    given = {key: value for key, value in every.items() if value} | {
        "root_radius_mm": limits.root_radius
    }
    follows = {
        "travel_mm": dog.travel,
        "tip_width_at_the_inner_radius_mm": dog.tip_width_at(dog.inner_radius),
        "pitch_at_the_mean_radius_mm": dog.pitch,
    }
    rows = []
    for key, value in (given | follows).items():
        size, tolerance = to_si(key, 1.0), known.get(key.removesuffix(suffix_of(key)))
        rows.append({
            "key": key, "value": value / size, "unit": unit_of(key),
            "tolerance": None if tolerance is None else tolerance / size, "follows": key in follows,
        })  # fmt: skip
    return rows


def searched_checks(study: Setup, result: Row, row: Row) -> list[Row]:
    """List the closed forms of a design, then what the confirmation or the search simulated.

    ``study`` has the design as its own dog.
    """
    design, confirmed = design_of(study, {}), confirmation_of(result, row)
    found = {check["name"]: check for check in checks_within(design, margins_within(study, design))}
    for check in (confirmed or {"checks": []})["checks"]:
        found[check["name"]] = found.get(check["name"], {}) | check
    for name in row["margins"].keys() - found.keys():
        found[name] = {"name": name, "margin": row["margins"][name], "group": "impact"}
    return list(found.values())


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
