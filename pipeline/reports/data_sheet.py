"""Data sheet of a design on an A4 page, with its provenance."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.config.toml_text import toml_value
from dogshape.pipeline.export.drawing import ring_drawings
from dogshape.pipeline.record import Bad, Table, percent
from dogshape.pipeline.reports.design_record import (
    DesignSheet,
    PointDifference,
    PointTime,
)
from dogshape.pipeline.reports.named_design import NamedDesign
from dogshape.pipeline.reports.report import Report, title_table, title_values
from dogshape.pipeline.reports.text import (
    ENGINES,
    check_name,
    hang_percents,
    label,
    margin_cell,
    minus,
    ms_with_error,
    place_name,
)
from dogshape.pipeline.search.study_record import StudyRecord
from dogshape.pipeline.simulate.design import SUMMARIES
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.pipeline.store.check_records import (
    CheckRow,
    LandingRow,
    VerdictRow,
    assumed_table,
    check_table,
    hinge_table,
    not_judged_row,
)
from dogshape.pipeline.store.folder import write_json
from dogshape.pipeline.store.result_records import HangKeys
from dogshape.sim.errors import DogshapeError
from dogshape.sim.quantity import quantities_of
from dogshape.sim.shift.clutch import ContactSet
from dogshape.sim.shift.geometry import FLANKS, Dog
from dogshape.sim.shift.pair import OUTPUT_PREFIX, RING_NAMES, OutputDog
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.verdict import WORDS
from dogshape.sim.units import from_si, suffix_of, unit_of
from dogshape.sim.versions import versions

GENERAL_TOLERANCE = "ISO 2768-f"  #: tolerance of a dimension that the study gives none for
TIME = "expected shift time, ms"
ENGAGED = "mean of engaged shifts, ms"
HANGS = "shifts that hang, % (95 %)"
WORST_HANGS = "shifts that hang at the worst point, %"
ASSUMED_TITLE = "Values that nobody gave"  #: of a section of sheet and report
MAX_ASSUMPTIONS = 2  #: assumptions that fit on a sheet, the strongest
#: Words for the smallest margins within the tolerances.
STATISTICAL_MARGIN = "at statistical tolerances, landing nominal"
WORST_MARGIN = "at worst-case tolerances, landing nominal"


def words_of(sheet: DesignSheet) -> dict[str, str]:
    """Print verdict, times, margins and friction of a design by label; a dash if unknown."""
    line = sheet.verdict.line
    state = WORDS[sheet.verdict.state]
    if not sheet.passes:
        line = Bad(line)
        state = Bad(state)
    simulated = sheet.simulated
    gain = ms_with_error(simulated.gain_s, simulated.gain_standard_error_s)
    worst = simulated.worst_against_prototype
    slowest = simulated.slowest_point
    worst_words = _point_words(worst, worst.difference_s, "+") if worst else "-"
    slowest_words = _point_words(slowest, slowest.mean_s) if slowest else "-"
    engaged_words = "-" if simulated.engaged is None else percent(simulated.engaged)
    return {
        "verdict": line,
        "state": state,
        TIME: _time_words(sheet),
        ENGAGED: ms_with_error(simulated.engaged_mean_s, simulated.engaged_standard_error_s),
        HANGS: hang_share(simulated),
        WORST_HANGS: _worst_hang_share(sheet.verdict),
        "gain over the own dog, ms": gain,
        "worst point minus own dog, ms": worst_words,
        "slowest point, ms": slowest_words,
        "engage at the first try, least": engaged_words,
        "smallest margin, nominal size": margin_cell(sheet.weakest_check, sheet.smallest_margin),
        STATISTICAL_MARGIN: _tolerance_margin(
            sheet, sheet.margin_root_sum_square, sheet.weakest_check_root_sum_square
        ),
        WORST_MARGIN: _tolerance_margin(
            sheet, sheet.margin_worst_case, sheet.weakest_check_worst_case
        ),
        "decisive landing": _landing_words(simulated.decisive_landing),
        "locks above friction": _locking_words(sheet),
        "axial length, root to root, mm": f"{sheet.axial_length_mm:.2f}",
    }


def _locking_words(sheet: DesignSheet) -> str:
    """Print the friction above which a surface locks that must release; a dash without one."""
    if not sheet.locking_surface:
        return "-"
    surface = check_name(sheet.locking_surface).removesuffix(" release")
    if not any(f"{flank}_release" in sheet.margins for flank in FLANKS):
        surface += " alone; flanks need not release"
    return f"{sheet.locking_friction:.3f} ({surface})"


def _landing_words(landing: LandingRow | None) -> str:
    """Print the landing that decides, with its check; a dash if unknown."""
    return "-" if landing is None else f"{landing.text} ({check_name(landing.check)})"


def _time_words(sheet: DesignSheet) -> str:
    """Print the expected time of a design, ms, with its source unless it is confirmed."""
    simulated = sheet.simulated
    time = ms_with_error(simulated.expected_shift_time_s, simulated.standard_error_s)
    if simulated.expected_shift_time_s is None and simulated.shifts_engaged:
        return "engages in {} of {}".format(*simulated.shifts_engaged)
    return time if sheet.confirmed else f"{time} ({simulated.source})"


def _point_words(point: PointDifference | PointTime, time_s: float | None, sign: str = "") -> str:
    """Print a time of an operating point, ms, with the point."""
    time = ms_with_error(time_s, point.standard_error_s, sign)
    return f"{time} at {place_name(point)}"


def _tolerance_margin(sheet: DesignSheet, margin: float | None, name: str | None) -> str:
    """Print the smallest margin of a design within its tolerances, with its check."""
    if margin is None or name is None:
        return "no dog"
    # Checks without tolerances count at nominal size.
    smallest, name = min((margin, name), (sheet.smallest_margin, sheet.weakest_check))
    return margin_cell(name, smallest)


def hang_share(record: HangKeys) -> str:
    """Print the probability of a hang in percent with its interval; a dash if unknown."""
    if record.hang_probability is None:
        return "-"
    return _percents_text(*hang_percents(record))


def _worst_hang_share(verdict: VerdictRow) -> str:
    """Print the share of hangs at the worst operating point as ``hang_share``."""
    hangs = verdict.hangs
    if hangs is None:
        return "-"
    return _percents_text(100.0 * hangs.share, 100.0 * hangs.low, 100.0 * hangs.high)


def _percents_text(mean: float, low: float, high: float) -> str:
    return f"{mean:.2g} ({low:.2f} to {high:.2g})"


def write_sheet(
    design: NamedDesign,
    sheet: DesignSheet,
    checks: Sequence[CheckRow],
    block: Mapping[str, str],
    path: Path,
) -> None:
    """Write the data sheet of a design as JSON to a path that ends in .json, else as a page.

    ``sheet`` and ``checks`` are those of the design; ``block`` has values of the title block and
    ``why``, the reason of a decision for it. InputError for other keys.
    """
    time = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
    texts = dict(block)
    why = texts.pop("why", "").strip()
    title = title_values(texts)
    single = [check for check in checks if check.name not in SUMMARIES]
    groups: list[str] = list(GROUPS)
    single.sort(key=lambda check: groups.index(check.group))
    dimensions = _dimensions(design.design_study)
    sheet_option = f"--sheet {shlex.quote(path.name)}"
    provenance = provenance_of(design.study, design.result, f"export {sheet_option}")
    if design.result is not None:
        command = f"dogshape export {shlex.quote(design.label)} {sheet_option}"
        provenance = {"command": command, "searched by": provenance.pop("command"), **provenance}
    if path.suffix.lower() == ".json":
        content = {
            "name": design.title,
            "time": time,
            **{key: text or None for key, text in {"why": why, **title}.items()},
            **sheet.to_dict(),
            "dimensions": [dimension._asdict() for dimension in dimensions],
            "checks": [check.to_dict() for check in single],
            "warnings": notes_of(design.design_study),
            "provenance": provenance,
        }
        write_json(path, content)
        return
    study = design.design_study
    verdict = sheet.verdict
    rows = _check_rows(single, verdict)
    judged, *facts = _sheet_facts(sheet, rows)
    page = Report(f"{design.title}: data sheet", why, compact=True)
    page.add("", title_table(title))
    page.add("", Table(("", ""), [judged]))
    drawings = ring_drawings(study.clutch.pair, study.limits, design.title)
    page.add("", *map(Markup, drawings))
    sizes = [_size_cells(dimension) for dimension in dimensions]
    page.add(f"Dimensions ({sheet.material})", Table(("", "", ""), sizes))
    page.add("Times (± one standard error), margins, friction", Table(("", ""), facts))
    columns = ["name", "value", "limit", "unit", "safety", "margin", "margin_root_sum_square"]
    if study.limits.has_unlike_rings:
        columns.append("ring")
    margins = replace(check_table(rows, *columns), note=_references_note(single))
    assumptions = verdict.hangs_on[:MAX_ASSUMPTIONS]
    hinges = hinge_table(assumptions, "assumption", "range", "smallest_margin")
    page.add("Assumptions that decide the smallest margin", replace(hinges, words=(), note=""))
    page.add("Warnings", *map(Markup('<p class="warning">{}</p>').format, notes_of(study)))
    page.add("Margins to the limits", margins)
    if verdict.assumed:
        page.add(ASSUMED_TITLE, assumed_table(verdict.assumed))
    page.add("Provenance", Table(("", ""), list(provenance.items())))
    page.save(path)


def _check_rows(checks: Sequence[CheckRow], verdict: VerdictRow) -> list[CheckRow]:
    """List checks, then those that could not be judged, with printed names."""
    rows = [*checks, *map(not_judged_row, verdict.not_judged)]
    return [row.model_copy(update={"name": check_name(row.name)}) for row in rows]


def _references_note(checks: Sequence[CheckRow]) -> str:
    """List the checks by the standards and authors that they follow, both flanks as one."""
    names_by_reference = dict[str, list[str]]()
    for check in checks:
        name = check_name(check.name.removesuffix("_traction").removesuffix("_braking"))
        names = names_by_reference.setdefault(check.references, [])
        if name not in names:
            names.append(name)
    names_by_reference.pop("", None)
    parts = [f"{reference} ({', '.join(names)})" for reference, names in names_by_reference.items()]
    return f"Checks follow: {'; '.join(parts)}." if parts else ""


def _sheet_facts(sheet: DesignSheet, rows: Sequence[CheckRow]) -> list[tuple[str, str]]:
    """List the known facts of a design by label, the verdict first, then margin intervals."""
    words = words_of(sheet)
    del words["state"]  # the verdict has it
    # One line for two margins, so that the sheet stays a page.
    words[STATISTICAL_MARGIN] += f"; worst case {words.pop(WORST_MARGIN)}"
    facts = [pair for pair in words.items() if pair[1] != "-"]
    for row in rows:
        if row.margin_interval:
            facts.append((f"{row.name}, margin within 95 %", row.cell("margin_interval")))
    return facts


class Dimension(NamedTuple):
    """An independent dimension of a dog; its fields are the keys of a data sheet."""

    key: str  #: of the study file
    value: float  #: in ``unit``
    unit: str
    tolerance: float | None  #: in ``unit``; None where a general one holds


def _size_cells(dimension: Dimension) -> tuple[str, str, str]:
    """Print name, size and tolerance of a dimension."""
    name = label(dimension.key)
    unit = dimension.unit
    if not unit:
        size = f"{dimension.value:.4g}"
        general = ""
    else:
        size = minus(f"{dimension.value:.2f} {unit}")
        general = GENERAL_TOLERANCE
    if dimension.tolerance:
        return name, size, f"± {dimension.tolerance:.2f} {unit}"
    return name, size, general


def _dimensions(study: Setup) -> list[Dimension]:
    """List the independent dimensions of a dog with tolerance and unit; defaults are left out."""
    dog = study.clutch.dog
    limits = study.limits
    dimensions = []
    names = [declared.key for declared in quantities_of(Dog).values()]
    for name in [*names, "root_radius_mm"]:
        field_name = name.removesuffix(suffix_of(name))
        size = limits.root_radius if name == "root_radius_mm" else getattr(dog, field_name)
        if size in (0.0, getattr(Dog, field_name, 0.0)):
            continue
        tolerance = limits.tolerances.dimensions.get(field_name)
        dimensions.append(
            Dimension(
                key=name,
                value=from_si(name, size),
                unit=unit_of(name),
                tolerance=from_si(name, tolerance),
            )
        )
    for name, size in study.clutch.output_dog.given.items():
        key = quantities_of(OutputDog)[name].key
        is_of_sliding_ring = name in RING_NAMES and study.clutch.output_dog.is_sliding_sparse
        tolerance = limits.tolerances.dimensions.get(name)
        dimensions.append(
            Dimension(
                key=key if is_of_sliding_ring else f"{OUTPUT_PREFIX}{key}",
                value=from_si(key, size),
                unit=unit_of(key),
                tolerance=from_si(key, tolerance),
            )
        )
    return dimensions


def provenance_of(study: Setup, result: StudyRecord | None, verb: str = "check") -> dict[str, str]:
    """List command, operating points, contact, shafts, actuator, mechanism, hashes and versions.

    ``result``, whose they are, is None for a design that was not searched: the command is then that
    of a ``verb`` with its options.
    """
    if result is None:
        call = verb
        file = "its study file"
        simulated = "as by 'dogshape check'"
        program_versions = versions()
        result_hash = ""
    else:
        call = "search"
        file = "study.json"
        simulated = _simulated_words(result)
        program_versions = result.versions
        result_hash = f", result {content_key(result.to_dict())}"
    facts = {
        "command": command_of(study, call) or f"dogshape {call} FILE; {study.name} is in {file}",
        "simulated": simulated,
        "operating points": minus(study.operating_text),
        "load": study.load_text,
        "mount": study.mount_text,
        "contact": _contact_words(study.clutch.contact),
        "shafts": study.clutch.drive.text,
        "actuator": study.clutch.actuator.text if study.clutch.actuator else "",
        "mechanism": ", ".join(f"{name} {value:.4g}" for name, value in study.mechanism.items()),
        "versions": ", ".join(f"{name} {version}" for name, version in program_versions.items()),
        "hashes": f"configuration {study.config_hash}, physics {study.physics_hash}{result_hash}",
    }
    return {name: words for name, words in facts.items() if words}


def _simulated_words(result: StudyRecord) -> str:
    """Print the numbers of designs and shifts of a result, with the angles of its confirmation."""
    words = (
        f"{result.n_simulated_designs} designs, {result.n_simulated_shifts} "
        f"shifts by {ENGINES[result.engine]}"
    )
    if result.confirmation:
        words += f", confirmed at {result.confirmation.angles} new angles of each operating point"
    return words


def _contact_words(contact: ContactSet) -> str:
    """Print the friction of a contact set, and the law of its normal force."""
    words = (
        f"{contact.name}: friction {contact.static_friction:g} static, "
        f"{contact.dynamic_friction:g} dynamic, "
    )
    if contact.face_friction is not None:
        words += f"{contact.face_friction:g} of faces on faces, "
    law = contact.impact
    if law is not None:
        return f"{words}IMPACT with {law.stiffness:.3g} N/m^1.5 and {law.damping:.3g} N s/m"
    return f"{words}stiffness {contact.stiffness:.3g} Pa/m, dissipation {contact.dissipation:g} s/m"


def command_of(study: Setup, verb: str) -> str | None:
    """Compose the command of a verb that runs a study by the name of a bundled one and ``--set``.

    None if no such command has the configuration hash of the study.
    """
    try:
        bundled = flat_keys(load_study(study.name).file.model_dump())
        values = flat_keys(study.file.model_dump())
        changes = {k: v for k, v in values.items() if v is not None and bundled.get(k) != v}
        overrides = [f"{key}={toml_value(value)}" for key, value in changes.items()]
        if load_study(study.name, overrides).config_hash != study.config_hash:
            return None
    except DogshapeError:
        return None
    options = "".join(f" --set {shlex.quote(override)}" for override in overrides)
    return f"dogshape {verb} {study.name}{options}"


def flat_keys(record: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten nested records into a dictionary with keys joined by dots."""
    flat: dict[str, Any] = {}
    for name, value in record.items():
        if isinstance(value, Mapping):
            flat |= flat_keys(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value
    return flat
