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
from typing import Any, NamedTuple, Protocol

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
from dogshape.pipeline.export.drawing import ring_drawings
from dogshape.pipeline.record import SHARE, Bad, Record, Table, number_or_none, percent
from dogshape.pipeline.reports.designs import confirmation_of, engaged_shifts, margins_of
from dogshape.pipeline.reports.report import Report
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
from dogshape.pipeline.search.study_record import (
    ConfirmedDesign,
    DesignRow,
    StudyRecord,
    read_study_record,
    study_record_of,
)
from dogshape.pipeline.simulate.design import (
    SUMMARIES,
    design_of,
    verdict_of,
)
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.result_records import (
    CheckRow,
    HangKeys,
    PlaceRow,
    VerdictRow,
    check_table,
    hinge_table,
    not_judged_row,
)
from dogshape.sim.clutch_tables import key
from dogshape.sim.errors import DogshapeError, InputError, did_you_mean
from dogshape.sim.interface import argument, verb
from dogshape.sim.quantity import quantities_of
from dogshape.sim.shift.clutch import CONTACT_SETS, ContactSet
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.pair import OutputDog
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
    result: StudyRecord | None = None
    row: DesignRow | None = None

    @property
    def title(self) -> str:
        """Name of the study, with the number of a searched design."""
        if self.row is None:
            return self.study.name
        return f"{self.study.name}, design {self.row.trial}"

    @property
    def design_study(self) -> Setup:
        """The study with the design as its dog, operated as the design is."""
        if self.row is None:
            return self.study
        params = self.row.params(self.study.variables)
        study = self.study.with_operation(params)
        return replace(study, clutch=replace(study.clutch, dog=self.study.dog_with(params)))

    @property
    def prototype_study(self) -> Setup:
        """The study with the design as its prototype, operated as the design is."""
        if self.row is None:
            return self.study
        return _replace_prototype(self.study, self.row)


def _replace_prototype(study: Setup, row: DesignRow) -> Setup:
    """Rebuild a study with a searched design as its prototype, operated as the design is."""
    dog = {f"dog.{name}": value for name, value in row.params(study.shape_keys).items()}
    return replace_keys(study, dog).with_operation(row.params(study.variables))


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
        fault = (
            f"'{name}' is a design as it was simulated, which {argument('settings')} would change"
        )
        raise InputError(f"{fault}; give '{source}' and the keys of the dog")
    if sign and not number.isdecimal():
        remedy = "write for instance results/mq200#43"
        raise InputError(f"'{name}' must end in the number of a design after '#'; {remedy}")
    path = Path(source)
    folder = StudyFolder(path)
    if folder.manifest.exists():
        return _select_design(source, folder.stored_study(), read_study_record(folder), number)
    _require_study(source)
    # The result of a study may be stored beside its file, in a folder or of a bundled study.
    stored = (path if path.is_dir() else bundled_root() / source) / "result.json"
    if stored.is_file() and not path.is_file():
        result = study_record_of(read_json(stored, "take it away"), str(stored))
        return _select_design(source, load_study(source), result, number)
    if not sign:
        return NamedDesign(source, load_study(source))
    results = Path("results") / source
    if StudyFolder(results).manifest.exists():
        return named_design(f"{results}#{number}")
    remedy = f"run {verb('search', source)} and give the folder of its results"
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


def _select_design(source: str, study: Setup, result: StudyRecord, number: str) -> NamedDesign:
    """Select a design of a result by its number; without one the chosen design or the prototype.

    A design that was not simulated becomes the prototype of its study.
    """
    rows = {row.trial: row for row in result.trials}
    prototype = next((row for row in result.trials if row.prototype), None)
    if number:
        design = f"design {int(number)}"
        selected = rows.get(int(number))
    else:
        design = "chosen design"
        selected = result.best or prototype
    if selected is None:
        last = max(rows, default=0)
        raise InputError(f"'{source}' has no {design}; it has the designs 0 (prototype) to {last}")
    row = rows[selected.trial]
    name = f"{source}#{row.trial}"
    if row.expected_shift_time_s is None and confirmation_of(result, row) is None:
        return NamedDesign(name, _replace_prototype(study, row))
    return NamedDesign(name, study, result, row)


class PointDifference(PlaceRow):
    """Time of a design less the prototype's at an operating point."""

    difference_s: float = key("time of the design less the prototype's", "s")
    standard_error_s: float | None = key("its standard error; null unless both have one", "s")


class PointTime(PlaceRow):
    """Mean time of a design at an operating point."""

    mean_s: float | None = key("mean with retries", "s")
    standard_error_s: float | None = key("its standard error", "s")


class TimeKeys(Record):
    """Expected shift time of a design."""

    expected_shift_time_s: float | None = key("expected shift time", "s")
    standard_error_s: float | None = key("its standard error", "s")


class SimulatedValues(HangKeys, TimeKeys):
    """Simulated values of a design, after its time and the terms of that."""

    source: str = key("source of the time: `search`, `new angles`, an engine or a refusal")
    engaged: float | None = key("least share of the shifts that engaged at a point", SHARE)
    shifts_engaged: list[int] | None = key("shifts that engaged, and all, at new angles", "", None)
    gain_s: float | None = key("time of the prototype less the design's", "s", None)
    gain_standard_error_s: float | None = key("its standard error", "s", None)
    worst_against_prototype: PointDifference | None = key("point of the largest loss", "", None)
    slowest_point: PointTime | None = key("point of the largest mean time", "", None)


class DesignSheet(Record):
    """Record of a design with its provenance; null for an unknown value."""

    study: str = key("name of the study")
    design: int = key("number of the design; 0 of the study's own", "", 0)
    prototype: bool = key("whether it is the study's own design", "", True)
    dog: dict[str, Any] = key("keys of the dog, and searched keys of the operation")
    axial_length_mm: float = key("axial length, root to root", "mm")
    travel_mm: float = key("travel of the sliding ring", "mm")
    simulated: SimulatedValues = key("simulated values")
    confirmed: bool = key("whether it was simulated at new angles", "", False)
    passes: bool = key("whether every standard check is judged and clearly passes")
    verdict: VerdictRow = key("verdict on the design")
    smallest_margin: float = key("smallest margin at nominal size", "1")
    weakest_check: str = key("check with that margin")
    margin_worst_case: float | None = key("smallest margin with all tolerances at worst", "1")
    margin_root_sum_square: float | None = key("smallest margin by root sum of squares", "1")
    weakest_check_worst_case: str | None = key("check with that margin")
    weakest_check_root_sum_square: str | None = key("check with that margin")
    locking_friction: float | None = key("friction above which the ring locks", "1")
    locking_surface: str = key("surface that locks first; empty without one")
    engine: str = key("engine that simulated the shifts")
    contact: str = key("name of the contact set")
    material: str = key("name of the material")
    operating_points: int = key("number of operating points")
    physics_hash: str = key("hash of what the simulation of a shift depends on")
    config_hash: str = key("hash of the study file")
    margins: dict[str, float | None] = key("margin by check; null where infinite", "1")

    def to_dict(self) -> dict[str, Any]:
        """Return the record as JSON takes it; keys of dog and simulation stand among the others."""
        values: dict[str, Any] = {}
        for name, value in self.model_dump().items():
            values |= value if name in ("dog", "simulated") else {name: value}
        return values


class WeakestCheck(NamedTuple):
    """Check with the smallest margin within the tolerances."""

    name: str | None  #: None without a dog
    margin: float | None


def design_sheet(
    study: Setup,
    params: Values,
    margins: Values,
    *,
    worst_case: WeakestCheck,
    root_sum_square: WeakestCheck,
    verdict: VerdictRow,
    simulated: SimulatedValues,
    engine: str | None = None,
) -> DesignSheet:
    """Record a design of a study as the study's own.

    Parameters
    ----------
    study, params
        Study, and searched keys of the design in edge units.
    margins
        Margins of all checks by name.
    worst_case, root_sum_square
        Weakest checks by the addition of the effects of all dimensions.
    verdict, simulated
        Verdict and simulated values of the design.
    engine
        Engine that simulated the shifts; None for that of the study.

    """
    single = {name: margin for name, margin in margins.items() if name not in SUMMARIES}
    weakest = min(single, key=lambda name: single[name])
    dog = study.dog_with(dict(params))
    friction, surface = locking_friction(dog, study.limits.load)
    return DesignSheet(
        study=study.name,
        dog={**study.file.dog.model_dump(), **params},
        axial_length_mm=dog.axial_length / MM,
        travel_mm=dog.travel / MM,
        simulated=simulated,
        passes=verdict.passes,
        verdict=verdict,
        smallest_margin=single[weakest],
        weakest_check=weakest,
        margin_worst_case=number_or_none(worst_case.margin),
        margin_root_sum_square=number_or_none(root_sum_square.margin),
        weakest_check_worst_case=worst_case.name,
        weakest_check_root_sum_square=root_sum_square.name,
        locking_friction=number_or_none(friction),
        locking_surface=surface,
        engine=engine or study.clutch.solver.engine,
        contact=study.clutch.contact.name,
        material=study.limits.material.name,
        operating_points=len(study.points),
        physics_hash=study.physics_hash,
        config_hash=study.config_hash,
        margins={name: number_or_none(margin) for name, margin in margins.items()},
    )


def searched_sheet(study: Setup, result: StudyRecord, row: DesignRow) -> DesignSheet:
    """Record a design of a result; ``study`` is the one that was searched."""
    confirmed = confirmation_of(result, row)

    def weakest_check(kind: Kind) -> WeakestCheck:
        margin = row.margin_within(kind)
        name = None if margin is None else row.weakest_within(kind) or ""
        return WeakestCheck(name, margin)

    params = row.params(study.variables)
    sheet = design_sheet(
        study,
        params,
        margins_of(row.margins, confirmed),
        worst_case=weakest_check("worst_case"),
        root_sum_square=weakest_check("root_sum_square"),
        verdict=searched_verdict(study, params, row.margins, confirmed),
        simulated=_simulated_values(result, row, confirmed),
    )
    changes = {
        "design": row.trial,
        "prototype": row.prototype,
        "confirmed": confirmed is not None,
    }
    return sheet.model_copy(update=changes)


def _simulated_values(
    result: StudyRecord, row: DesignRow, confirmed: ConfirmedDesign | None
) -> SimulatedValues:
    """Collect the values of a design at new angles, by default those of the search."""
    simulated = row if confirmed is None else confirmed
    is_timed = simulated.expected_shift_time_s is not None
    values = SimulatedValues(
        expected_shift_time_s=simulated.expected_shift_time_s,
        standard_error_s=simulated.standard_error_s if is_timed else None,
        **{name: getattr(simulated, name) for name in HangKeys.model_fields},
        source="search" if confirmed is None else "new angles",
        engaged=simulated.engaged,
    )
    if confirmed is None:
        return values
    changes: dict[str, Any] = {"shifts_engaged": list(engaged_shifts(confirmed))}
    if is_timed:
        changes |= {"slowest_point": _slowest_point(confirmed)}
    prototype = None if result.confirmation is None else result.confirmation.prototype
    if prototype is not None and not row.prototype:
        loss = time_difference(prototype, confirmed)
        if loss is not None:
            differences = point_differences(prototype, confirmed)
            changes |= {
                "gain_s": -loss[0],
                "gain_standard_error_s": loss[1],
                "worst_against_prototype": largest_loss(differences),
            }
    return values.model_copy(update=changes)


def _slowest_point(confirmed: ConfirmedDesign) -> PointTime:
    """Return the operating point with the largest mean time of a design that engages."""
    slowest = max(confirmed.points, key=lambda point: point.mean_s or 0.0)
    return PointTime(
        mismatch_rpm=slowest.mismatch_rpm,
        force_N=slowest.force_N,
        mean_s=slowest.mean_s,
        standard_error_s=slowest.standard_error_s,
    )


def searched_verdict(
    study: Setup, params: Values, margins: Values, confirmed: ConfirmedDesign | None
) -> VerdictRow:
    """Return the verdict of a confirmation, else judge a design by the margins of its search."""
    if confirmed is not None and confirmed.verdict:
        return confirmed.verdict
    checks = [Margin(name, margin) for name, margin in margins_of(margins, confirmed).items()]
    operated = study.with_operation(params)
    return VerdictRow.of(verdict_of(operated, operated.dog_with(dict(params)), checks))


def point_differences(prototype: ConfirmedDesign, chosen: ConfirmedDesign) -> list[PointDifference]:
    """Compute the time of the chosen design less the prototype's, s, at each operating point.

    The n-th point of both designs is the same point of the study, which a design may move by
    set-point and force; its keys are those of the prototype. A point where a design has no mean
    time is left out; the standard error is None unless both designs have one.
    """
    differences = []
    for prototype_point, point in zip(prototype.points, chosen.points, strict=True):
        if prototype_point.mean_s is None or point.mean_s is None:
            continue
        error = None
        if prototype_point.standard_error_s is not None and point.standard_error_s is not None:
            error = math.hypot(prototype_point.standard_error_s, point.standard_error_s)
        differences.append(
            PointDifference(
                mismatch_rpm=prototype_point.mismatch_rpm,
                force_N=prototype_point.force_N,
                difference_s=point.mean_s - prototype_point.mean_s,
                standard_error_s=error,
            )
        )
    return differences


def largest_loss(differences: Sequence[PointDifference]) -> PointDifference:
    """Select the operating point at which a design loses most time on the prototype."""
    return max(differences, key=lambda difference: difference.difference_s)


class TimedRecord(Protocol):
    """Record with an expected time."""

    @property
    def expected_shift_time_s(self) -> float | None:
        """Expected shift time, s; None where too few shifts engage."""

    @property
    def standard_error_s(self) -> float | None:
        """Its standard error, s."""


def time_difference(reference: TimedRecord, record: TimedRecord) -> tuple[float, float] | None:
    """Compute a record's expected time less the reference's, s, and the standard error.

    The means count as independent. None unless both records have a time.
    """
    if reference.expected_shift_time_s is None or record.expected_shift_time_s is None:
        return None
    error = math.hypot(reference.standard_error_s or 0.0, record.standard_error_s or 0.0)
    return record.expected_shift_time_s - reference.expected_shift_time_s, error


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
    surface = check_name(sheet.locking_surface).removesuffix(" release")
    return {
        "verdict": line,
        "state": state,
        TIME: _time_words(sheet),
        ENGAGED: ms_with_error(simulated.engaged_mean_s, simulated.engaged_standard_error_s),
        HANGS: hang_share(simulated),
        "gain over the prototype, ms": gain,
        "worst point minus prototype, ms": worst_words,
        "slowest point, ms": slowest_words,
        "engage at the first try, least": engaged_words,
        "smallest margin, nominal size": margin_cell(sheet.weakest_check, sheet.smallest_margin),
        STATISTICAL_MARGIN: _tolerance_margin(
            sheet, sheet.margin_root_sum_square, sheet.weakest_check_root_sum_square
        ),
        WORST_MARGIN: _tolerance_margin(
            sheet, sheet.margin_worst_case, sheet.weakest_check_worst_case
        ),
        "locks above friction": f"{sheet.locking_friction:.3f} ({surface})" if surface else "-",
        "axial length, root to root, mm": f"{sheet.axial_length_mm:.2f}",
    }


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
    mean, low, high = hang_percents(record)
    return f"{mean:.2g} ({low:.2f} to {high:.2g})"


def searched_checks(study: Setup, result: StudyRecord, row: DesignRow) -> list[CheckRow]:
    """List the checks of a design: closed forms with simulated values, then simulated checks.

    ``study`` has the design as its prototype. Simulated values are those of the confirmation, for
    checks that it lacks those of the search.
    """
    design = design_of(study, {})
    confirmed = confirmation_of(result, row)
    checks = {check.name: check for check in design.rows}
    for check in confirmed.checks if confirmed else ():
        closed_form = checks.get(check.name)
        values = closed_form.to_dict() if closed_form else {}
        checks[check.name] = CheckRow(**(values | check.to_dict()))
    for name, margin in row.margins.items():
        if name not in checks:
            checks[name] = _searched_check(name, margin)
    return list(checks.values())


def _searched_check(name: str, margin: float) -> CheckRow:
    """Record a simulated check of which a search stores its margin alone."""
    values = {"name": name, "margin": margin, "group": "impact"}
    empty = dict.fromkeys(CheckRow.model_fields)
    return CheckRow.model_construct(_fields_set=set(values), **{**empty, **values})


def write_sheet(
    design: NamedDesign,
    sheet: DesignSheet,
    checks: Sequence[CheckRow],
    block: Mapping[str, str],
    path: Path,
) -> None:
    """Write the data sheet of a design as JSON to a path that ends in .json, else as a page.

    ``sheet`` and ``checks`` are those of the design; ``block`` has values of ``TITLE_BLOCK`` and
    ``why``, the reason of a decision for it. InputError for other keys.
    """
    time = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
    title = {"why": "", **dict.fromkeys(TITLE_BLOCK, ""), "date": time[:10]}
    for name in block.keys() - title.keys():
        raise InputError(f"'{name}' is no key of a data sheet; {did_you_mean(name, title)}")
    title |= {name: text.strip() for name, text in block.items()}
    single = [check for check in checks if check.name not in SUMMARIES]
    groups: list[str] = list(GROUPS)
    single.sort(key=lambda check: groups.index(check.group))
    dimensions = _dimensions(design.design_study)
    provenance = provenance_of(design.study, design.result)
    if design.result is not None:
        command = f"dogshape export {shlex.quote(design.label)} --sheet sheet.html"
        provenance = {"command": command, "searched by": provenance.pop("command"), **provenance}
    if path.suffix.lower() == ".json":
        texts = {key: text or None for key, text in title.items()}
        content = {
            "name": design.title,
            "time": time,
            **texts,
            **sheet.to_dict(),
            "dimensions": [dimension._asdict() for dimension in dimensions],
            "checks": [check.to_dict() for check in single],
            "provenance": provenance,
        }
        write_json(path, content)
        return
    study = design.design_study
    verdict = sheet.verdict
    rows = _check_rows(single, verdict)
    judged, *facts = _sheet_facts(sheet, rows)
    page = Report(f"{design.title}: data sheet", title.pop("why"), compact=True)
    page.add("", Table(list(TITLE_BLOCK.values()), [list(title.values())], {}, range(6)))
    page.add("", Table(("", ""), [judged]))
    drawings = ring_drawings(study.clutch.pair, study.limits, design.title)
    page.add("", *map(Markup, drawings))
    sizes = [_size_cells(dimension) for dimension in dimensions]
    page.add(f"Dimensions ({sheet.material})", Table(("", "", ""), sizes))
    page.add("Times (± one standard error), margins, friction", Table(("", ""), facts))
    columns = ["name", "value", "limit", "unit", "safety", "margin", "margin_root_sum_square"]
    if study.limits.has_unlike_rings:
        columns.append("ring")
    page.add("Margins to the limits", check_table(rows, *columns))
    assumptions = verdict.hangs_on[:MAX_ASSUMPTIONS]
    hinges = hinge_table(assumptions, "assumption", "range", "smallest_margin")
    page.add("Assumptions that decide the smallest margin", replace(hinges, words=(), note=""))
    page.add("Provenance", Table(("", ""), list(provenance.items())))
    page.save(path)


def _check_rows(checks: Sequence[CheckRow], verdict: VerdictRow) -> list[CheckRow]:
    """List checks, then those that could not be judged, with printed names."""
    rows = [*checks, *map(not_judged_row, verdict.not_judged)]
    return [row.model_copy(update={"name": check_name(row.name)}) for row in rows]


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
        tolerance = limits.tolerances.dimensions.get(name)
        dimensions.append(
            Dimension(
                key=f"output_dog_{key}",
                value=from_si(key, size),
                unit=unit_of(key),
                tolerance=from_si(key, tolerance),
            )
        )
    return dimensions


def provenance_of(study: Setup, result: StudyRecord | None) -> dict[str, str]:
    """List command, operating points, contact, shafts, actuator, mechanism, hashes and versions.

    ``result``, whose they are, is None for a design that was not searched.
    """
    if result is None:
        call = "export --sheet sheet.html"
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
    load = study.file.load
    sleeve = study.limits.sleeve
    facts = {
        "command": command_of(study, call) or f"dogshape {call} FILE; {study.name} is in {file}",
        "simulated": simulated,
        "operating points": minus(study.operating_text),
        "load": f"{load.torque_Nm:g} N m, application factor {load.application_factor:g}",
        "mount": "" if sleeve is None else sleeve.text(study.clutch.dog),
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
