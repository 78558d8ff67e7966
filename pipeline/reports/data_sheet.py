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
from dogshape.sim.shift.clutch import CONTACT_SETS
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.strength.manufacture import Kind
from dogshape.sim.strength.verdict import WORDS, Margin
from dogshape.sim.units import MM, from_si, suffix_of, unit_of
from dogshape.sim.versions import bundled_root, versions

GENERAL = "ISO 2768-f"  #: tolerance of a dimension that the study gives none for
TIME, ENGAGED = "expected shift time, ms", "mean of engaged shifts, ms"
HANGS = "shifts that hang, % (95 %)"
#: Keys of what was simulated of a design.
SIMULATION = (
    SIMULATED, "standard_error_s", *HangKeys.model_fields, "source", "engaged", "shifts_engaged",
    "gain_s",
    "gain_standard_error_s", "worst_against_prototype", "slowest_point",
)  # fmt: skip
HINGES = 2  #: assumptions that fit on a sheet, the strongest
#: Keys of the title block of a data sheet with their words; the reason of a decision stands above.
TITLE_BLOCK = {
    "number": "drawing number", "revision": "revision", "date": "date", "author": "author",
    "checker": "checked by", "decided_by": "decided by",
}  # fmt: skip
Values = Mapping[str, float]
#: Words for the smallest margins within the tolerances.
STATISTICAL_MARGIN = "at statistical tolerances, landing nominal"
WORST_MARGIN = "at worst-case tolerances, landing nominal"


@dataclass(frozen=True)
class NamedDesign:
    """A design with its study, and with the result and the row in it where it was searched.

    ``study`` is the one that was searched, or that has the design as its own dog.
    """

    label: str
    study: Setup
    result: Row | None = None
    row: Row | None = None

    @property
    def title(self) -> str:
        """Name of the study, and the number of the design where it has one."""
        return self.study.name + ("" if self.row is None else f", design {self.row['trial']}")

    @property
    def own_study(self) -> Setup:
        """The study with the design as its dog, operated as the design is."""
        if self.row is None:
            return self.study
        dog = self.study.dog_with({key: self.row[key] for key in self.study.variables})
        own = self.study.with_operation(self.row)
        return replace(own, clutch=replace(own.clutch, dog=dog))

    @property
    def prototype_study(self) -> Setup:
        """The study with the design as its prototype, operated as the design is."""
        return self.study if self.row is None else _with_prototype(self.study, self.row)


def _with_prototype(study: Setup, row: Row) -> Setup:
    """Build a study again with a design of its search as prototype, operated as the design is."""
    dog = {f"dog.{key}": row[key] for key in study.shape_keys}
    return replace_keys(study, dog).with_operation(row)


def named_design(name: str, settings: Settings = None, *, chosen: bool = True) -> NamedDesign:
    """Read ``FOLDER#N`` or ``STUDY#N`` as a design of a result, or what ``load_study`` takes.

    ``settings`` are keys of a study with their values. A name without ``#N`` is the chosen design
    of its result, where it has one; unless ``chosen``, it is the study's own dog. InputError for an
    unknown name, a design that is not there, and for settings of a design with a number;
    StorageError for a folder with damaged files.
    """
    numbered = "#" in name and not Path(name).exists()
    where, sign, number = name.rpartition("#") if numbered else (name, "", "")
    if not chosen and not sign:
        return NamedDesign(name, load_study(name, settings))
    if settings:
        fault = f"'{name}' is a design as it was simulated, which --set would change"
        raise InputError(f"{fault}; give '{where}' and the keys of the dog")
    if sign and not number.isdecimal():
        remedy = "write for instance results/mq200#43"
        raise InputError(f"'{name}' must end in the number of a design after '#'; {remedy}")
    path, folder = Path(where), StudyFolder(Path(where))
    if folder.manifest.exists():
        return _searched(where, folder.stored_study(), folder.stored_result(), number)
    try:
        find_study(where)
    except InputError as error:
        raise InputError(
            f"'{where}' is no folder of results, no study and no contact set; give a folder as "
            f"results/mq200 (with #N for a design), a study file, one of "
            f"{', '.join(bundled_studies())}, or contact sets ({', '.join(sorted(CONTACT_SETS))})"
        ) from error
    # A result that is kept beside a study file, in a folder or of a bundled study.
    kept = (path if path.is_dir() else bundled_root() / where) / "result.json"
    if kept.is_file() and not path.is_file():
        return _searched(where, load_study(where), read_json(kept, "take it away"), number)
    searched = Path("results") / where
    if sign and StudyFolder(searched).manifest.exists():
        return named_design(f"{searched}{sign}{number}")
    if sign:
        remedy = f"run 'dogshape study {where}' and give the folder of its results"
        raise InputError(f"'{name}' names design {number}, but '{where}' has no result; {remedy}")
    return NamedDesign(where, load_study(where))


def _searched(where: str, study: Setup, result: Row, number: str) -> NamedDesign:
    rows = {row["trial"]: row for row in result["trials"]}
    own = next((row for row in result["trials"] if row["prototype"]), None)
    row = rows.get(int(number)) if number else result["best"] or own
    if row is None:
        fault = f"'{where}' has no {f'design {int(number)}' if number else 'chosen design'}"
        raise InputError(f"{fault}; it has the designs 0 (prototype) to {max(rows, default=0)}")
    name, row = f"{where}#{row['trial']}", rows[row["trial"]]
    if row[SIMULATED] is None and confirmation_of(result, row) is None:
        own = replace_keys(study, {f"dog.{key}": row[key] for key in study.shape_keys})
        return NamedDesign(name, own.with_operation(row))
    return NamedDesign(name, study, result, row)


def design_record(
    study: Setup,
    params: Values,
    margins: Values,
    within: Mapping[Kind, tuple[str, float] | None],
    verdict: Row,
    **known: Any,
) -> Row:
    """Record a design of a study by one set of keys, None where something is not known.

    ``params`` are its searched keys in edge units, ``margins`` those of all checks, ``within`` has
    the check with the smallest margin within the tolerances with that margin, by the addition of
    their effects (``KINDS``), ``verdict`` has the keys of ``VerdictRow``; ``known`` is what else is
    known, by the keys of the record.
    """
    own = {name: margin for name, margin in margins.items() if name not in SUMMARIES}
    dog, weakest = study.dog_with(dict(params)), min(own, key=lambda name: own[name])
    friction, surface = locking_friction(dog, study.limits.load)
    return {
        "study": study.name,
        "design": 0,
        "prototype": True,
        **study.file.dog.model_dump(),
        **params,
        "axial_length_mm": dog.axial_length / MM,
        "travel_mm": dog.travel / MM,
        **dict.fromkeys(SIMULATION),
        "confirmed": False,
        "passes": verdict["state"] == "passes",
        "verdict": verdict,
        "smallest_margin": own[weakest],
        "weakest_check": weakest,
        **{f"margin_{k}": pair and number_or_none(pair[1]) for k, pair in within.items()},
        **{f"weakest_check_{k}": pair and pair[0] for k, pair in within.items()},
        "locking_friction": number_or_none(friction),
        "locking_surface": surface,
        "engine": study.clutch.solver.engine,
        "contact": study.clutch.contact.name,
        "material": study.limits.material.name,
        "operating_points": len(study.points),
        "physics_hash": study.physics_hash,
        "config_hash": study.config_hash,
        "margins": {name: number_or_none(margin) for name, margin in margins.items()},
        **known,
    }


def searched_record(study: Setup, result: Row, row: Row) -> Row:
    """Record a design of a result; ``study`` is the one that was searched."""
    confirmed = confirmation_of(result, row)
    known = row if confirmed is None else confirmed
    found: Row = {"engaged": known["engaged"], "source": "search"}
    if known[SIMULATED] is not None:
        found |= {key: known[key] for key in (SIMULATED, "standard_error_s")}
    found |= {name: known.get(name) for name in HangKeys.model_fields}
    if confirmed is not None:
        own = (result["confirmation"] or {}).get("prototype")
        found |= {"source": "new angles", "confirmed": True}
        found["shifts_engaged"] = list(engaged_shifts(confirmed))
        if known[SIMULATED] is not None:
            slow = max(confirmed["points"], key=lambda p: p["mean_s"])
            found["slowest_point"] = {k: slow[k] for k in (*PLACE, "mean_s", "standard_error_s")}
        loss = None if own is None else difference(own, confirmed)
        if own is not None and loss and not row["prototype"]:
            found |= {"gain_s": -loss[0], "gain_standard_error_s": loss[1]}
            found["worst_against_prototype"] = max(
                point_differences(own, confirmed), key=lambda one: float(one["difference_s"])
            )
    params = {name: row[name] for name in study.variables}
    margins = {kind: row[f"margin_{kind}"] for kind in KINDS}
    within = {
        kind: None if margin is None else (row.get(f"weakest_check_{kind}") or "", margin)
        for kind, margin in margins.items()
    }
    return design_record(
        study,
        params,
        margins_of(row, confirmed),
        within,
        verdict=searched_verdict(study, params, row, confirmed),
        design=int(row["trial"]),
        prototype=bool(row["prototype"]),
        **found,
    )


def searched_verdict(study: Setup, params: Values, row: Row, confirmed: Row | None) -> Row:
    """Give the verdict of a confirmation, else judge a design by the margins of its search."""
    if confirmed is not None and confirmed.get("verdict"):
        return dict(confirmed["verdict"])
    margins = [Margin(name, margin) for name, margin in margins_of(row, confirmed).items()]
    own = study.with_operation(params)
    return verdict_of(own, own.dog_with(dict(params)), margins).to_dict()


def point_differences(prototype: Row, chosen: Row) -> list[Row]:
    """List the time of the chosen design less the prototype's, s, at each operating point.

    The n-th point of either is the same one of the study, which a design may move by set-point and
    force; it is named as the prototype's. The standard error is None where one of either is.
    """
    found = []
    for point, other in zip(prototype["points"], chosen["points"], strict=True):
        if None not in (point["mean_s"], other["mean_s"]):
            errors = [p["standard_error_s"] for p in (point, other)]
            found.append({
                **{key: point[key] for key in PLACE},
                "difference_s": other["mean_s"] - point["mean_s"],
                "standard_error_s": None if None in errors else math.hypot(*errors),
            })  # fmt: skip
    return found


def difference(one: Row, other: Row) -> tuple[float, float] | None:
    """Take the second record's time less the first's, with the error of independent means, s."""
    if None in (one[SIMULATED], other[SIMULATED]):
        return None
    error = math.hypot(*(record["standard_error_s"] or 0.0 for record in (one, other)))
    return other[SIMULATED] - one[SIMULATED], error


def words_of(one: Row) -> dict[str, str]:
    """Print times, margins and friction of a record with their errors; a dash where unknown."""
    time, counts = ms_with_error(one[SIMULATED], one["standard_error_s"]), one["shifts_engaged"]
    if one[SIMULATED] is None and counts:
        time = "engages in {} of {}".format(*counts)
    elif not one["confirmed"]:
        time += f" ({one['source']})"

    def within(kind: Kind) -> str:
        margin = one[f"margin_{kind}"]
        if margin is None:
            return "no dog"
        # What has no tolerances counts at nominal size.
        nominal = one["smallest_margin"], one["weakest_check"]
        least, name = min((margin, one[f"weakest_check_{kind}"]), nominal)
        return margin_cell(name, least)

    def at_point(point: Row | None, key: str, sign: str = "") -> str:
        if point is None:
            return "-"
        time = ms_with_error(point[key], point["standard_error_s"], sign)
        return f"{time} at {place_name(point)}"

    surface, engaged = check_name(one["locking_surface"]), one["engaged"]
    verdict = one["verdict"]
    state = WORDS[verdict["state"]]
    return {
        "verdict": verdict["line"] if verdict["state"] == "passes" else Bad(verdict["line"]),
        "state": state if verdict["state"] == "passes" else Bad(state),
        TIME: time,
        ENGAGED: ms_with_error(one["engaged_mean_s"], one["engaged_standard_error_s"]),
        HANGS: hang_share(one),
        "gain over the prototype, ms": ms_with_error(one["gain_s"], one["gain_standard_error_s"]),
        "worst point minus prototype, ms":
            at_point(one["worst_against_prototype"], "difference_s", "+"),
        "slowest point, ms": at_point(one["slowest_point"], "mean_s"),
        "engage at the first try, least": "-" if engaged is None else percent(engaged),
        "smallest margin, nominal size":
            margin_cell(one["weakest_check"], one["smallest_margin"]),
        STATISTICAL_MARGIN: within("root_sum_square"),
        WORST_MARGIN: within("worst_case"),
        "locks above friction":
            f"{one['locking_friction']:.3f} ({surface.removesuffix(' release')})" if surface
            else "-",
        "axial length, root to root, mm": f"{one['axial_length_mm']:.2f}",
    }  # fmt: skip


def hang_share(one: Row) -> str:
    """Print the probability of a hang in percent with its interval; a dash where unknown."""
    if one.get("hang_probability") is None:
        return "-"
    keys = ("hang_probability", "hang_probability_low", "hang_probability_high")
    mean, low, high = (100.0 * one[name] for name in keys)
    return f"{mean:.2g} ({low:.2f} to {high:.2g})"


def searched_checks(study: Setup, result: Row, row: Row) -> list[Row]:
    """List the closed forms of a design, then what the confirmation or the search simulated.

    ``study`` has the design as its own dog.
    """
    design, confirmed = design_of(study, {}), confirmation_of(result, row)
    found = {check["name"]: check for check in checks_within(study, design)}
    for check in (confirmed or {"checks": []})["checks"]:
        found[check["name"]] = found.get(check["name"], {}) | check
    for name, margin in row["margins"].items():
        found.setdefault(name, {"name": name, "margin": margin, "group": "impact"})
    return list(found.values())


def write_sheet(
    one: NamedDesign, record: Row, checks: Sequence[Row], block: Mapping[str, str], path: Path
) -> None:
    """Write the data sheet of a design as a page, or as JSON by the ending of the path.

    ``record`` and ``checks`` are those of the design; ``block`` has values of ``TITLE_BLOCK`` and
    ``why``, the reason of a decision for it. InputError for other keys.
    """
    study, time = one.own_study, f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
    title = {"why": "", **dict.fromkeys(TITLE_BLOCK, ""), "date": time[:10]}
    for key in block.keys() - title.keys():
        raise InputError(f"'{key}' is no key of a data sheet; {did_you_mean(key, title)}")
    title |= {key: text.strip() for key, text in block.items()}
    own = [check for check in checks if check["name"] not in SUMMARIES]
    own.sort(key=lambda check: list(GROUPS).index(check["group"]))
    dimensions, origin = _dimensions(study), provenance_of(one.study, one.result)
    if one.result is not None:
        again = f"dogshape export {shlex.quote(one.label)} --sheet sheet.html"
        origin = {"command": again, "searched by": origin.pop("command"), **origin}
    if path.suffix.lower() == ".json":
        known = {key: text or None for key, text in title.items()}
        sheet = {"name": one.title, "time": time, **known, **record, "dimensions": dimensions}
        return write_json(path, {**sheet, "checks": own, "provenance": origin})
    sizes = []
    for row in dimensions:
        unit, tolerance = row["unit"], row["tolerance"]
        size = minus(f"{row['value']:.2f} {unit}") if unit else f"{row['value']:.4g}"
        within = f"± {tolerance:.2f} {unit}" if tolerance else GENERAL if unit else ""
        sizes.append((label(row["key"]), size, within))
    none, verdict = dict.fromkeys(CheckRow.model_fields), VerdictRow(**record["verdict"])
    rows = [CheckRow.model_construct(**{**none, **c, "name": check_name(c["name"])}) for c in own]
    missing = [not_judged_row(one) for one in verdict.not_judged]
    rows += [row.model_copy(update={"name": check_name(row.name)}) for row in missing]
    columns = ("name", "value", "limit", "unit", "safety", "margin", "margin_root_sum_square")
    words = words_of(record)
    del words["state"]  # the verdict has it
    # One line for both, so that the sheet stays a page.
    words[STATISTICAL_MARGIN] += f"; worst case {words.pop(WORST_MARGIN)}"
    facts = [pair for pair in words.items() if pair[1] != "-"]
    facts += [(f"{row.name}, margin within 95 %", row.cell("margin_interval"))
              for row in rows if row.margin_interval]  # fmt: skip
    judged, facts = facts[:1], facts[1:]
    page = Report(f"{one.title}: data sheet", title.pop("why"), compact=True)
    page.add("", Table(list(TITLE_BLOCK.values()), [list(title.values())], {}, range(6)))
    page.add("", Table(("", ""), judged))
    page.add("", Markup(dimensioned_svg(study.clutch.dog, study.limits, one.title)))
    page.add(f"Dimensions ({record['material']})", Table(("", "", ""), sizes))
    page.add("Times (± one standard error), margins, friction", Table(("", ""), facts))
    page.add("Margins to the limits", check_table(rows, *columns))
    hangs_on = hinge_table(verdict.hangs_on[:HINGES], "assumption", "range", "smallest_margin")
    hangs_on = replace(hangs_on, words=(), note="")
    page.add("Assumptions that decide the smallest margin", hangs_on)
    page.add("Provenance", Table(("", ""), list(origin.items())))
    return page.save(path)


def _dimensions(study: Setup) -> list[Row]:
    """List the dimensions that are given with their tolerances; others follow from them."""
    dog, limits, rows = study.clutch.dog, study.limits, list[Row]()
    for key in (*DogSection.model_fields, "root_radius_mm"):
        name = key.removesuffix(suffix_of(key))
        value = limits.root_radius if name == "root_radius" else getattr(dog, name)
        if value not in (0.0, getattr(Dog, name, 0.0)):
            tolerance = from_si(key, limits.tolerances.dimensions.get(name))
            rows.append({"key": key, "value": from_si(key, value), "unit": unit_of(key),
                         "tolerance": tolerance})  # fmt: skip
    return rows


def provenance_of(study: Setup, result: Row | None) -> dict[str, str]:
    """List command, operating points, contact, shafts, mechanism, hashes and versions of a result.

    ``result`` is None for a design that was not searched.
    """
    load, contact = study.file.load, study.clutch.contact
    simulated, used, own = "as by 'dogshape check'", versions(), ""
    verb, file = "export --sheet sheet.html", "its study file"
    if result is not None:
        c, used = result["confirmation"], result["versions"]
        verb, file = "study", "study.json"
        simulated = f"{result['n_simulated_designs']} designs, {result['n_simulated_shifts']} "
        simulated += f"shifts by {ENGINES[result['engine']]}"
        simulated += f", confirmed at {c['angles']} new angles of each operating point" if c else ""
        own = f", result {content_key(result)}"
    normal = f"stiffness {contact.stiffness:.3g} Pa/m, dissipation {contact.dissipation:g} s/m"
    if (law := contact.impact) is not None:
        normal = f"IMPACT with {law.stiffness:.3g} N/m^1.5 and {law.damping:.3g} N s/m"
    film = contact.face_friction
    faces = "" if film is None else f"{film:g} of faces on faces, "
    facts = {
        "command": command_of(study, verb) or f"dogshape {verb} FILE; {study.name} is in {file}",
        "simulated": simulated,
        "operating points": minus(study.operating_text),
        "load": f"{load.torque_Nm:g} N m, application factor {load.application_factor:g}",
        "contact": f"{contact.name}: friction {contact.static_friction:g} static, "
        f"{contact.dynamic_friction:g} dynamic, {faces}{normal}",
        "shafts": study.clutch.drive.text,
        "mechanism": ", ".join(f"{name} {one:.4g}" for name, one in study.mechanism.items()),
        "versions": ", ".join(f"{name} {version}" for name, version in used.items()),
        "hashes": f"configuration {study.config_hash}, physics {study.physics_hash}{own}",
    }
    return {name: words for name, words in facts.items() if words}


def command_of(study: Setup, verb: str) -> str | None:
    """Compose the command of a verb for a study like this; None unless ``--set`` leads to it.

    Checked by the hash of the configuration.
    """
    try:
        bundled = flat_keys(load_study(study.name).file.model_dump())
        wanted = flat_keys(study.file.model_dump())
        changed = {k: v for k, v in wanted.items() if v is not None and bundled.get(k) != v}
        overrides = [f"{key}={toml_value(value)}" for key, value in changed.items()]
        if load_study(study.name, overrides).config_hash != study.config_hash:
            return None
    except DogshapeError:
        return None
    return f"dogshape {verb} {study.name}" + "".join(f" --set {shlex.quote(o)}" for o in overrides)


def flat_keys(record: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten nested records into one, keys joined by dots."""
    found: dict[str, Any] = {}
    for key, value in record.items():
        inner = flat_keys(value, f"{prefix}{key}.") if isinstance(value, Mapping) else None
        found |= {f"{prefix}{key}": value} if inner is None else inner
    return found
