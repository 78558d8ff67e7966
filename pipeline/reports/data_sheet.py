"""Designs by their names, their records with provenance, and the data sheet of one on an A4 page.

Times and margins of a searched design are those of the confirmation where it was confirmed, else
of the search. A design that does not engage has no time.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from markupsafe import Markup

from dogshape.pipeline.config.study_file import (
    Settings,
    Setup,
    bundled_studies,
    find_study,
    load_study,
    replace_keys,
)
from dogshape.pipeline.config.toml_text import toml_value
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.record import Bad, Table, number_or_none, percent
from dogshape.pipeline.reports.designs import Row, confirmation_of, engaged_shifts, margins_of
from dogshape.pipeline.reports.report import Report
from dogshape.pipeline.reports.text import (
    ENGINES,
    PLACE,
    check_name,
    label,
    margin_cell,
    minus,
    ms_with_error,
    place_name,
)
from dogshape.pipeline.simulate.design import (
    KINDS,
    SIMULATED,
    SUMMARIES,
    checks_within,
    design_of,
    verdict_of,
)
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.result_records import (
    CheckRow,
    HangKeys,
    VerdictRow,
    check_table,
    hinge_table,
    not_judged_row,
)
from dogshape.sim.clutch_tables import DogSection
from dogshape.sim.errors import DogshapeError, InputError, did_you_mean
from dogshape.sim.shift.clutch import CONTACT_SETS, ContactSet
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.strength.manufacture import Kind
from dogshape.sim.strength.verdict import WORDS, Margin
from dogshape.sim.units import MM, from_si, suffix_of, unit_of
from dogshape.sim.versions import bundled_root, versions

GENERAL_TOLERANCE = "ISO 2768-f"  #: tolerance of a dimension that the study gives none for
TIME = "expected shift time, ms"
ENGAGED = "mean of engaged shifts, ms"
HANGS = "shifts that hang, % (95 %)"
#: Keys of the simulated results in the record of a design.
SIMULATION_KEYS = (
    SIMULATED,
    "standard_error_s",
    *HangKeys.model_fields,
    "source",
    "engaged",
    "shifts_engaged",
    "gain_s",
    "gain_standard_error_s",
    "worst_against_prototype",
    "slowest_point",
)
MAX_ASSUMPTIONS = 2  #: assumptions that fit on a sheet, the strongest
#: Keys of the title block of a data sheet with their words; the reason of a decision stands above.
TITLE_BLOCK = {
    "number": "drawing number",
    "revision": "revision",
    "date": "date",
    "author": "author",
    "checker": "checked by",
    "decided_by": "decided by",
}
Values = Mapping[str, float]
#: Words for the smallest margins within the tolerances.
STATISTICAL_MARGIN = "at statistical tolerances, landing nominal"
WORST_MARGIN = "at worst-case tolerances, landing nominal"


@dataclass(frozen=True)
class NamedDesign:
    """A design with its study; with result and row of a search if it is part of one.

    ``study`` is the one that was searched, or that has the design as its own dog.
    """

    label: str
    study: Setup
    result: Row | None = None
    row: Row | None = None

    @property
    def title(self) -> str:
        """Name of the study, with the number of a searched design."""
        if self.row is None:
            return self.study.name
        return f"{self.study.name}, design {self.row['trial']}"

    @property
    def design_study(self) -> Setup:
        """The study with the design as its dog, operated as the design is."""
        if self.row is None:
            return self.study
        dog = self.study.dog_with({key: self.row[key] for key in self.study.variables})
        study = self.study.with_operation(self.row)
        return replace(study, clutch=replace(study.clutch, dog=dog))

    @property
    def prototype_study(self) -> Setup:
        """The study with the design as its prototype, operated as the design is."""
        if self.row is None:
            return self.study
        return _replace_prototype(self.study, self.row)


def _replace_prototype(study: Setup, row: Row) -> Setup:
    """Rebuild a study with a searched design as its prototype, operated as the design is."""
    dog = {f"dog.{key}": row[key] for key in study.shape_keys}
    return replace_keys(study, dog).with_operation(row)


def named_design(name: str, settings: Settings = None, *, chosen: bool = True) -> NamedDesign:
    """Find the design of ``FOLDER#N`` or ``STUDY#N`` in a result, or of a study by its name.

    ``settings`` are keys of a study with their values. A name without ``#N`` is the chosen design
    of its result, where it has one; unless ``chosen``, it is the study's own dog. InputError for an
    unknown name, a design that is not there, and for settings of a design with a number;
    StorageError for a folder with damaged files.
    """
    numbered = "#" in name and not Path(name).exists()
    source, sign, number = name.rpartition("#") if numbered else (name, "", "")
    if not chosen and not sign:
        return NamedDesign(name, load_study(name, settings))
    if settings:
        fault = f"'{name}' is a design as it was simulated, which --set would change"
        raise InputError(f"{fault}; give '{source}' and the keys of the dog")
    if sign and not number.isdecimal():
        remedy = "write for instance results/mq200#43"
        raise InputError(f"'{name}' must end in the number of a design after '#'; {remedy}")
    path = Path(source)
    folder = StudyFolder(path)
    if folder.manifest.exists():
        return _select_design(source, folder.stored_study(), folder.stored_result(), number)
    _require_study(source)
    # The result of a study may be stored beside its file, in a folder or of a bundled study.
    stored = (path if path.is_dir() else bundled_root() / source) / "result.json"
    if stored.is_file() and not path.is_file():
        result = read_json(stored, "take it away")
        return _select_design(source, load_study(source), result, number)
    if not sign:
        return NamedDesign(source, load_study(source))
    results = Path("results") / source
    if StudyFolder(results).manifest.exists():
        return named_design(f"{results}#{number}")
    remedy = f"run 'dogshape search {source}' and give the folder of its results"
    raise InputError(f"'{name}' names design {number}, but '{source}' has no result; {remedy}")


def _require_study(source: str) -> None:
    """Raise InputError for a name that is no study; the message lists the valid names."""
    try:
        find_study(source)
    except InputError as error:
        raise InputError(
            f"'{source}' is no folder of results, no study and no contact set; give a folder as "
            f"results/mq200 (with #N for a design), a study file, one of "
            f"{', '.join(bundled_studies())}, or contact sets ({', '.join(sorted(CONTACT_SETS))})"
        ) from error


def _select_design(source: str, study: Setup, result: Row, number: str) -> NamedDesign:
    """Select a design of a result by its number; without one the chosen design or the prototype.

    A design that was not simulated becomes the prototype of its study.
    """
    rows = {row["trial"]: row for row in result["trials"]}
    prototype = next((row for row in result["trials"] if row["prototype"]), None)
    if number:
        design = f"design {int(number)}"
        selected = rows.get(int(number))
    else:
        design = "chosen design"
        selected = result["best"] or prototype
    if selected is None:
        last = max(rows, default=0)
        raise InputError(f"'{source}' has no {design}; it has the designs 0 (prototype) to {last}")
    row = rows[selected["trial"]]
    name = f"{source}#{row['trial']}"
    if row[SIMULATED] is None and confirmation_of(result, row) is None:
        return NamedDesign(name, _replace_prototype(study, row))
    return NamedDesign(name, study, result, row)


def design_record(
    study: Setup,
    params: Values,
    margins: Values,
    weakest_checks: Mapping[Kind, tuple[str, float] | None],
    verdict: Row,
    **values: Any,
) -> Row:
    """Record a design of a study; every record has the same keys, null for an unknown value.

    ``params`` are its searched keys in edge units, ``margins`` those of all checks.
    ``weakest_checks`` has the check with the smallest margin within the tolerances, and that
    margin, by the addition of their effects (``KINDS``). ``verdict`` has the keys of
    ``VerdictRow``, ``values`` further keys of the record.
    """
    single = {name: margin for name, margin in margins.items() if name not in SUMMARIES}
    weakest = min(single, key=lambda name: single[name])
    dog = study.dog_with(dict(params))
    friction, surface = locking_friction(dog, study.limits.load)
    return {
        "study": study.name,
        "design": 0,
        "prototype": True,
        **study.file.dog.model_dump(),
        **params,
        "axial_length_mm": dog.axial_length / MM,
        "travel_mm": dog.travel / MM,
        **dict.fromkeys(SIMULATION_KEYS),
        "confirmed": False,
        "passes": verdict["state"] == "passes",
        "verdict": verdict,
        "smallest_margin": single[weakest],
        "weakest_check": weakest,
        **{f"margin_{k}": pair and number_or_none(pair[1]) for k, pair in weakest_checks.items()},
        **{f"weakest_check_{k}": pair and pair[0] for k, pair in weakest_checks.items()},
        "locking_friction": number_or_none(friction),
        "locking_surface": surface,
        "engine": study.clutch.solver.engine,
        "contact": study.clutch.contact.name,
        "material": study.limits.material.name,
        "operating_points": len(study.points),
        "physics_hash": study.physics_hash,
        "config_hash": study.config_hash,
        "margins": {name: number_or_none(margin) for name, margin in margins.items()},
        **values,
    }


def searched_record(study: Setup, result: Row, row: Row) -> Row:
    """Record a design of a result; ``study`` is the one that was searched."""
    confirmed = confirmation_of(result, row)
    simulated = row if confirmed is None else confirmed
    values: Row = {"engaged": simulated["engaged"], "source": "search"}
    if simulated[SIMULATED] is not None:
        values |= {key: simulated[key] for key in (SIMULATED, "standard_error_s")}
    values |= {name: simulated.get(name) for name in HangKeys.model_fields}
    if confirmed is not None:
        values |= _confirmed_values(result, row, confirmed)
    params = study.select_params(row)
    margins = {kind: row[f"margin_{kind}"] for kind in KINDS}
    weakest_checks = {
        kind: None if margin is None else (row.get(f"weakest_check_{kind}") or "", margin)
        for kind, margin in margins.items()
    }
    return design_record(
        study,
        params,
        margins_of(row, confirmed),
        weakest_checks,
        verdict=searched_verdict(study, params, row, confirmed),
        design=int(row["trial"]),
        prototype=bool(row["prototype"]),
        **values,
    )


def _confirmed_values(result: Row, row: Row, confirmed: Row) -> Row:
    """Collect the values of a record that a design has by its confirmation alone."""
    values: Row = {"source": "new angles", "confirmed": True}
    values["shifts_engaged"] = list(engaged_shifts(confirmed))
    if confirmed[SIMULATED] is not None:
        slowest = max(confirmed["points"], key=lambda point: point["mean_s"])
        values["slowest_point"] = {k: slowest[k] for k in (*PLACE, "mean_s", "standard_error_s")}
    prototype = (result["confirmation"] or {}).get("prototype")
    if prototype is None or row["prototype"]:
        return values
    loss = time_difference(prototype, confirmed)
    if loss is not None:
        values |= {"gain_s": -loss[0], "gain_standard_error_s": loss[1]}
        differences = point_differences(prototype, confirmed)
        worst = max(differences, key=lambda point: float(point["difference_s"]))
        values["worst_against_prototype"] = worst
    return values


def searched_verdict(study: Setup, params: Values, row: Row, confirmed: Row | None) -> Row:
    """Return the verdict of a confirmation, else judge a design by the margins of its search."""
    if confirmed is not None and confirmed.get("verdict"):
        return dict(confirmed["verdict"])
    margins = [Margin(name, margin) for name, margin in margins_of(row, confirmed).items()]
    operated = study.with_operation(params)
    return verdict_of(operated, operated.dog_with(dict(params)), margins).to_dict()


def point_differences(prototype: Row, chosen: Row) -> list[Row]:
    """Compute the time of the chosen design less the prototype's, s, at each operating point.

    The n-th point of both designs is the same point of the study, which a design may move by
    set-point and force; its keys are those of the prototype. A point where a design has no mean
    time is left out; the standard error is None unless both designs have one.
    """
    differences = []
    for prototype_point, point in zip(prototype["points"], chosen["points"], strict=True):
        if prototype_point["mean_s"] is None or point["mean_s"] is None:
            continue
        errors = [prototype_point["standard_error_s"], point["standard_error_s"]]
        difference = {key: prototype_point[key] for key in PLACE}
        difference["difference_s"] = point["mean_s"] - prototype_point["mean_s"]
        difference["standard_error_s"] = None if None in errors else math.hypot(*errors)
        differences.append(difference)
    return differences


def time_difference(reference: Row, record: Row) -> tuple[float, float] | None:
    """Compute a record's expected time less the reference's, s, and the standard error.

    The means count as independent. None unless both records have a time.
    """
    if reference[SIMULATED] is None or record[SIMULATED] is None:
        return None
    error = math.hypot(reference["standard_error_s"] or 0.0, record["standard_error_s"] or 0.0)
    return record[SIMULATED] - reference[SIMULATED], error


def words_of(record: Row) -> dict[str, str]:
    """Print verdict, times, margins and friction of a record by label; a dash if unknown."""
    verdict = record["verdict"]
    line = verdict["line"]
    state = WORDS[verdict["state"]]
    if verdict["state"] != "passes":
        line = Bad(line)
        state = Bad(state)
    gain = ms_with_error(record["gain_s"], record["gain_standard_error_s"])
    worst = _point_words(record["worst_against_prototype"], "difference_s", "+")
    engaged = record["engaged"]
    surface = check_name(record["locking_surface"]).removesuffix(" release")
    return {
        "verdict": line,
        "state": state,
        TIME: _time_words(record),
        ENGAGED: ms_with_error(record["engaged_mean_s"], record["engaged_standard_error_s"]),
        HANGS: hang_share(record),
        "gain over the prototype, ms": gain,
        "worst point minus prototype, ms": worst,
        "slowest point, ms": _point_words(record["slowest_point"], "mean_s"),
        "engage at the first try, least": "-" if engaged is None else percent(engaged),
        "smallest margin, nominal size": margin_cell(
            record["weakest_check"], record["smallest_margin"]
        ),
        STATISTICAL_MARGIN: _tolerance_margin(record, "root_sum_square"),
        WORST_MARGIN: _tolerance_margin(record, "worst_case"),
        "locks above friction": f"{record['locking_friction']:.3f} ({surface})" if surface else "-",
        "axial length, root to root, mm": f"{record['axial_length_mm']:.2f}",
    }


def _time_words(record: Row) -> str:
    """Print the expected time of a record, ms, with its source unless it is confirmed."""
    time = ms_with_error(record[SIMULATED], record["standard_error_s"])
    if record[SIMULATED] is None and record["shifts_engaged"]:
        return "engages in {} of {}".format(*record["shifts_engaged"])
    return time if record["confirmed"] else f"{time} ({record['source']})"


def _point_words(point: Row | None, key: str, sign: str = "") -> str:
    """Print a time of an operating point, ms, with the point; a dash without one."""
    if point is None:
        return "-"
    time = ms_with_error(point[key], point["standard_error_s"], sign)
    return f"{time} at {place_name(point)}"


def _tolerance_margin(record: Row, kind: Kind) -> str:
    """Print the smallest margin of a record within its tolerances, with its check."""
    margin = record[f"margin_{kind}"]
    if margin is None:
        return "no dog"
    # Checks without tolerances count at nominal size.
    nominal = record["smallest_margin"], record["weakest_check"]
    smallest, name = min((margin, record[f"weakest_check_{kind}"]), nominal)
    return margin_cell(name, smallest)


def hang_share(record: Row) -> str:
    """Print the probability of a hang in percent with its interval; a dash if unknown."""
    if record.get("hang_probability") is None:
        return "-"
    keys = ("hang_probability", "hang_probability_low", "hang_probability_high")
    mean, low, high = (100.0 * record[name] for name in keys)
    return f"{mean:.2g} ({low:.2f} to {high:.2g})"


def searched_checks(study: Setup, result: Row, row: Row) -> list[Row]:
    """List the checks of a design: closed forms with simulated values, then simulated checks.

    ``study`` has the design as its prototype. Simulated values are those of the confirmation, for
    checks that it lacks those of the search.
    """
    design = design_of(study, {})
    confirmed = confirmation_of(result, row)
    checks = {check["name"]: check for check in checks_within(study, design)}
    for check in (confirmed or {"checks": []})["checks"]:
        checks[check["name"]] = checks.get(check["name"], {}) | check
    for name, margin in row["margins"].items():
        checks.setdefault(name, {"name": name, "margin": margin, "group": "impact"})
    return list(checks.values())


def write_sheet(
    design: NamedDesign, record: Row, checks: Sequence[Row], block: Mapping[str, str], path: Path
) -> None:
    """Write the data sheet of a design as JSON to a path that ends in .json, else as a page.

    ``record`` and ``checks`` are those of the design; ``block`` has values of ``TITLE_BLOCK`` and
    ``why``, the reason of a decision for it. InputError for other keys.
    """
    time = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
    title = {"why": "", **dict.fromkeys(TITLE_BLOCK, ""), "date": time[:10]}
    for key in block.keys() - title.keys():
        raise InputError(f"'{key}' is no key of a data sheet; {did_you_mean(key, title)}")
    title |= {key: text.strip() for key, text in block.items()}
    single = [check for check in checks if check["name"] not in SUMMARIES]
    single.sort(key=lambda check: list(GROUPS).index(check["group"]))
    dimensions = _dimensions(design.design_study)
    provenance = provenance_of(design.study, design.result)
    if design.result is not None:
        command = f"dogshape export {shlex.quote(design.label)} --sheet sheet.html"
        provenance = {"command": command, "searched by": provenance.pop("command"), **provenance}
    if path.suffix.lower() == ".json":
        texts = {key: text or None for key, text in title.items()}
        sheet = {"name": design.title, "time": time, **texts, **record, "dimensions": dimensions}
        write_json(path, {**sheet, "checks": single, "provenance": provenance})
        return
    study = design.design_study
    verdict = VerdictRow(**record["verdict"])
    rows = _check_rows(single, verdict)
    judged, *facts = _sheet_facts(record, rows)
    page = Report(f"{design.title}: data sheet", title.pop("why"), compact=True)
    page.add("", Table(list(TITLE_BLOCK.values()), [list(title.values())], {}, range(6)))
    page.add("", Table(("", ""), [judged]))
    page.add("", Markup(dimensioned_svg(study.clutch.dog, study.limits, design.title)))
    sizes = [_size_cells(dimension) for dimension in dimensions]
    page.add(f"Dimensions ({record['material']})", Table(("", "", ""), sizes))
    page.add("Times (± one standard error), margins, friction", Table(("", ""), facts))
    columns = ("name", "value", "limit", "unit", "safety", "margin", "margin_root_sum_square")
    page.add("Margins to the limits", check_table(rows, *columns))
    assumptions = verdict.hangs_on[:MAX_ASSUMPTIONS]
    hinges = hinge_table(assumptions, "assumption", "range", "smallest_margin")
    page.add("Assumptions that decide the smallest margin", replace(hinges, words=(), note=""))
    page.add("Provenance", Table(("", ""), list(provenance.items())))
    page.save(path)


def _check_rows(checks: Sequence[Row], verdict: VerdictRow) -> list[CheckRow]:
    """Build the rows of checks, then of checks that could not be judged, with printed names."""
    empty = dict.fromkeys(CheckRow.model_fields)
    rows = []
    for check in checks:
        values = {**empty, **check, "name": check_name(check["name"])}
        rows.append(CheckRow.model_construct(**values))
    for missing in verdict.not_judged:
        row = not_judged_row(missing)
        rows.append(row.model_copy(update={"name": check_name(row.name)}))
    return rows


def _sheet_facts(record: Row, rows: Sequence[CheckRow]) -> list[tuple[str, str]]:
    """List the known facts of a record by label, the verdict first, then margin intervals."""
    words = words_of(record)
    del words["state"]  # the verdict has it
    # One line for two margins, so that the sheet stays a page.
    words[STATISTICAL_MARGIN] += f"; worst case {words.pop(WORST_MARGIN)}"
    facts = [pair for pair in words.items() if pair[1] != "-"]
    for row in rows:
        if row.margin_interval:
            facts.append((f"{row.name}, margin within 95 %", row.cell("margin_interval")))
    return facts


def _size_cells(dimension: Row) -> tuple[str, str, str]:
    """Print name, size and tolerance of a dimension."""
    name = label(dimension["key"])
    unit = dimension["unit"]
    if not unit:
        size = f"{dimension['value']:.4g}"
        general = ""
    else:
        size = minus(f"{dimension['value']:.2f} {unit}")
        general = GENERAL_TOLERANCE
    if dimension["tolerance"]:
        return name, size, f"± {dimension['tolerance']:.2f} {unit}"
    return name, size, general


def _dimensions(study: Setup) -> list[Row]:
    """List the independent dimensions of a dog with tolerance and unit; defaults are left out."""
    dog = study.clutch.dog
    limits = study.limits
    rows = []
    for key in (*DogSection.model_fields, "root_radius_mm"):
        name = key.removesuffix(suffix_of(key))
        value = limits.root_radius if name == "root_radius" else getattr(dog, name)
        if value in (0.0, getattr(Dog, name, 0.0)):
            continue
        row: Row = {"key": key, "value": from_si(key, value), "unit": unit_of(key)}
        row["tolerance"] = from_si(key, limits.tolerances.dimensions.get(name))
        rows.append(row)
    return rows


def provenance_of(study: Setup, result: Row | None) -> dict[str, str]:
    """List command, operating points, contact, shafts, mechanism, hashes and versions of a result.

    ``result`` is None for a design that was not searched.
    """
    if result is None:
        verb = "export --sheet sheet.html"
        file = "its study file"
        simulated = "as by 'dogshape check'"
        program_versions = versions()
        result_hash = ""
    else:
        verb = "study"
        file = "study.json"
        simulated = _simulated_words(result)
        program_versions = result["versions"]
        result_hash = f", result {content_key(result)}"
    load = study.file.load
    facts = {
        "command": command_of(study, verb) or f"dogshape {verb} FILE; {study.name} is in {file}",
        "simulated": simulated,
        "operating points": minus(study.operating_text),
        "load": f"{load.torque_Nm:g} N m, application factor {load.application_factor:g}",
        "contact": _contact_words(study.clutch.contact),
        "shafts": study.clutch.drive.text,
        "mechanism": ", ".join(f"{name} {value:.4g}" for name, value in study.mechanism.items()),
        "versions": ", ".join(f"{name} {version}" for name, version in program_versions.items()),
        "hashes": f"configuration {study.config_hash}, physics {study.physics_hash}{result_hash}",
    }
    return {name: words for name, words in facts.items() if words}


def _simulated_words(result: Row) -> str:
    """Print the numbers of designs and shifts of a result, with the angles of its confirmation."""
    words = (
        f"{result['n_simulated_designs']} designs, {result['n_simulated_shifts']} "
        f"shifts by {ENGINES[result['engine']]}"
    )
    confirmation = result["confirmation"]
    if confirmation:
        words += f", confirmed at {confirmation['angles']} new angles of each operating point"
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
    for key, value in record.items():
        if isinstance(value, Mapping):
            flat |= flat_keys(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
