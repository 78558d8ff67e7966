"""Designs by their names, their records, and the data sheet of one on an A4 page.

Times and margins of a searched design are those of the confirmation where it was confirmed, else
of the search. A design that does not engage has no time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from markupsafe import Markup

from dogshape.pipeline.config.study_file import Setup, bundled_studies, find_study, load_study
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.record import Table, number_or_none
from dogshape.pipeline.reports.charts import Row
from dogshape.pipeline.reports.designs import (
    confirmation_of,
    engaged_shifts,
    is_measured,
    least_margins,
    margins_of,
    weakest_at_worst,
)
from dogshape.pipeline.reports.provenance import command_of, now
from dogshape.pipeline.reports.report import Report
from dogshape.pipeline.reports.text import (
    ENGINES,
    check_name,
    label,
    ms_with_error,
    percent,
    place_name,
)
from dogshape.pipeline.search.tolerance_effects import checks_within
from dogshape.pipeline.simulate.design import SIMULATED, SUMMARIES, design_of, margins_within
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.result_records import CheckRow, check_table
from dogshape.sim.clutch_tables import DogSection
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import CONTACT_SETS
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.units import MM, suffix_of, to_si, unit_of
from dogshape.sim.versions import bundled_root, versions

GENERAL = "ISO 2768-f"  #: tolerance of a dimension that the study gives none for
#: Keys of what was simulated of a design.
SIMULATION = (
    SIMULATED, "standard_error_s", "source", "engaged", "shifts_engaged", "gain_s",
    "gain_standard_error_s", "worst_against_prototype", "slowest_point",
)  # fmt: skip
PLACE = ("mismatch_rpm", "force_N")  #: keys of an operating point


@dataclass(frozen=True)
class NamedDesign:
    """A design with its study, and with the result that it was searched in.

    Parameters
    ----------
    label : its name, with the number of the design.
    study : the study that was searched, or that holds the design as its own dog.
    result, row : the result and the design's row in it; None where nothing was searched.
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
        own = self.study.operated(self.row)
        return replace(own, clutch=own.clutch.with_dog(dog))


def named_design(
    name: str, settings: Iterable[str] | Mapping[str, Any] | None = None, *, chosen: bool = True
) -> NamedDesign:
    """Read ``FOLDER#N`` or ``STUDY#N`` as a design of a result.

    Parameters
    ----------
    name : such as ``results/mq200#43``, ``mq200#43``, or what ``load_study`` takes.
    settings : keys of the study with their values, of a study's dog alone.
    chosen : whether a name without ``#N`` is the chosen design of its result, where it has one;
        else it is the study's own dog.

    Raises
    ------
    InputError
        For an unknown name, a design that is not there or was not simulated, and for settings of a
        design with a number.
    StorageError
        For a folder with damaged files.
    """
    where, sign, number = name.rpartition("#") if "#" in name else (name, "", "")
    if not chosen and (not sign or Path(name).exists()):
        return NamedDesign(name, load_study(name, settings))
    if settings:
        raise InputError(
            f"'{name}' is a design as it was simulated, which --set would change; give '{where}' "
            "and the keys of the dog"
        )
    if sign and not number.isdecimal():
        raise InputError(
            f"'{name}' must end in the number of a design after '#'; write for instance "
            "results/mq200#43"
        )
    folder, path = StudyFolder(Path(where)), Path(where)
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
    study = load_study(where)
    # A result that is kept beside a study file, in a folder or of a bundled study.
    kept = (path if path.is_dir() else bundled_root() / where) / "result.json"
    if kept.is_file() and not path.is_file():
        return _searched(where, study, read_json(kept, "take it away"), number)
    if sign:
        raise InputError(
            f"'{name}' names design {number}, but '{where}' has no result; run 'dogshape study "
            f"{where}' and give the folder of its results"
        )
    return NamedDesign(where, study)


def _searched(where: str, study: Setup, result: Row, number: str) -> NamedDesign:
    rows = {row["trial"]: row for row in result["trials"]}
    own = next((row for row in result["trials"] if row["prototype"]), None)
    row = rows.get(int(number)) if number else result["best"] or own
    if row is None and number:
        raise InputError(
            f"'{where}' has no design {int(number)}; it has the designs 0 (prototype) to "
            f"{max(rows)}"
        )
    if row is None:
        raise InputError(f"'{where}' has no chosen design and no prototype; name one with #N")
    if row[SIMULATED] is None:
        raise InputError(
            f"design {row['trial']} of '{where}' failed {', '.join(row['failed'])} and was not "
            "simulated; name one that has a time"
        )
    return NamedDesign(f"{where}#{row['trial']}", study, result, rows[row["trial"]])


def design_record(
    study: Setup,
    params: Mapping[str, float],
    margins: Mapping[str, float],
    worst: tuple[str, float] | None,
    **known: Any,
) -> Row:
    """Record a design of a study by one set of keys, None where something is not known.

    Parameters
    ----------
    params : the searched keys of the study, edge units; its own dog where there are none.
    margins : margins of all checks by name.
    worst : check with the smallest margin at worst-case tolerances, and that margin.
    known : what else is known of the design, by the keys of the record.
    """
    dog, (weakest, least) = study.dog_with(dict(params)), least_margins(margins)[0]
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
        "passes": all(margin >= 0.0 for margin in margins.values()),
        "smallest_margin": least,
        "weakest_check": weakest,
        "margin_worst_case": worst and number_or_none(worst[1]),
        "weakest_check_worst_case": worst and worst[0],
        "locking_friction": friction,
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
    simulated: Row = {"engaged": known["engaged"], "source": "search"}
    if confirmed is not None:
        counts = list(engaged_shifts(confirmed))
        simulated |= {"source": "new angles", "confirmed": True, "shifts_engaged": counts}
    if is_measured(known):
        simulated |= {key: known[key] or 0.0 for key in (SIMULATED, "standard_error_s")}
        if confirmed is not None:
            slow, place = max(confirmed["points"], key=lambda p: p["mean_s"]), PLACE
            simulated["slowest_point"] = {
                k: slow[k] for k in (*place, "mean_s", "standard_error_s")
            }
            own = result["confirmation"]["prototype"]
            if not row["prototype"] and is_measured(own):
                errors = [one["standard_error_s"] or 0.0 for one in (own, confirmed)]
                simulated["gain_s"] = own[SIMULATED] - confirmed[SIMULATED]
                simulated["gain_standard_error_s"] = math.hypot(*errors)
                against = point_differences(own, confirmed)
                worst = max(against, key=lambda one: float(one["difference_s"]), default=None)
                simulated["worst_against_prototype"] = worst
    return design_record(
        study,
        {name: row[name] for name in study.variables},
        margins_of(row, confirmed),
        weakest_at_worst(row),
        design=int(row["trial"]),
        prototype=bool(row["prototype"]),
        **simulated,
    )


def point_differences(prototype: Row, chosen: Row) -> list[Row]:
    """List the time of the chosen design less the prototype's, s, at each point confirmed of both.

    The standard error is None where one of either is not known.
    """
    best = {tuple(p[key] for key in PLACE): p for p in chosen["points"]}
    found = []
    for point in prototype["points"]:
        other = best.get(tuple(point[key] for key in PLACE))
        if other and None not in (point["mean_s"], other["mean_s"]):
            errors = [p["standard_error_s"] for p in (point, other)]
            found.append({
                **{key: point[key] for key in PLACE},
                "difference_s": other["mean_s"] - point["mean_s"],
                "standard_error_s": None if None in errors else math.hypot(*errors),
            })  # fmt: skip
    return found


def difference(one: Row, other: Row) -> tuple[float, float] | None:
    """Take the second record's time less the first's, with the error of independent means, s."""
    if None in (one["expected_shift_time_s"], other["expected_shift_time_s"]):
        return None
    error = math.hypot(one["standard_error_s"], other["standard_error_s"])
    return other["expected_shift_time_s"] - one["expected_shift_time_s"], error


def words_of(one: Row) -> dict[str, str]:
    """Print times, margins and friction of a record with their errors; a dash where unknown."""
    margin, check = one["margin_worst_case"], one["weakest_check_worst_case"]
    surface = check_name(one["locking_surface"]).removesuffix(" release")
    time, counts = ms_or_dash(one[SIMULATED], one["standard_error_s"]), one["shifts_engaged"]
    if one[SIMULATED] is None and counts:
        time = "engages in {} of {}".format(*counts)
    elif not one["confirmed"]:
        time += f" ({one['source']})"
    engaged = "-" if one["engaged"] is None else percent(one["engaged"])
    least = f"{percent(one['smallest_margin'])} {check_name(one['weakest_check'])}"
    return {
        "expected shift time, ms": time,
        "gain over the prototype, ms": ms_or_dash(one["gain_s"], one["gain_standard_error_s"]),
        "worst point against the prototype, ms": _place_words(one["worst_against_prototype"]),
        "slowest point, ms": _place_words(one["slowest_point"]),
        "engage at the first try, least": engaged,
        "smallest margin, nominal size": least,
        "at worst-case tolerances": "no dog"
        if margin is None
        else f"{percent(margin)} {check_name(check)}",
        "locks above friction": f"{one['locking_friction']:.3f} ({surface})",
        "length, mm": f"{one['axial_length_mm']:.2f}",
    }  # fmt: skip


def ms_or_dash(time: float | None, error: float | None, sign: str = "") -> str:
    """Print a time and its standard error, both in s, in ms; a dash where there is none."""
    return "-" if time is None else ms_with_error(time, error or 0.0, sign)


def _place_words(point: Row | None) -> str:
    """Print a time, or a difference to the prototype, with its operating point."""
    if point is None:
        return "-"
    loss, side = point.get("difference_s"), ""
    if loss is not None:
        side = " slower" if loss > 0.0 else " faster"
    time = ms_or_dash(abs(point["mean_s"] if loss is None else loss), point["standard_error_s"])
    return f"{time}{side} at {place_name(*(point[key] for key in PLACE))}"


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


def write_sheet(one: NamedDesign, record: Row, checks: Sequence[Row], why: str, path: Path) -> None:
    """Write the data sheet of a design as a page, or as JSON by the ending of the path.

    Parameters
    ----------
    record, checks : of the design (``design_record``), and each of its checks.
    why : reason of a decision for the design; empty for none.
    """
    study = one.own_study
    own = [check for check in checks if check["name"] not in SUMMARIES]
    own.sort(key=lambda check: list(GROUPS).index(check["group"]))
    sheet = {
        "name": one.title,
        "time": now(),
        "why": why or None,
        **record,
        "dimensions": _dimensions(study),
        "checks": own,
        "provenance": provenance_of(one.study, one.result),
    }
    if path.suffix.lower() == ".json":
        return write_json(path, sheet)
    sizes = [
        (
            check_name(label(row["key"])),
            f"{row['value']:{'.0f' if row['key'] == 'count' else '.2f'}} {row['unit']}",
            "follows" if row["follows"] else "" if row["key"] == "count"
            else GENERAL if row["tolerance"] is None
            else f"± {row['tolerance']:.2f} {row['unit']}",
        )
        for row in sheet["dimensions"]
    ]  # fmt: skip
    page = Report(f"{one.title}: data sheet, {sheet['time']}", why, compact=True)
    page.add("", Markup(dimensioned_svg(study.clutch.dog, study.limits, one.title)))
    page.add(f"Dimensions ({sheet['material']})", Table(("", "", ""), sizes))
    facts = [pair for pair in words_of(sheet).items() if pair[1] != "-"]
    page.add("Times (± one standard error), margins, friction", Table(("", ""), facts))
    columns = ("name", "value", "limit", "unit", "margin", "margin_worst_case")
    known = dict.fromkeys(CheckRow.model_fields)
    named = [{**known, **check, "name": check_name(check["name"])} for check in own]
    rows = [CheckRow.model_construct(**check) for check in named]
    page.add("Margins to the limits", check_table(rows, *columns))
    page.add("Provenance", Table(("", ""), list(sheet["provenance"].items())))
    return page.save(path)


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


def provenance_of(study: Setup, result: Row | None) -> dict[str, str]:
    """List the command, operating points, contact, mechanism, hashes and versions of a result.

    ``result`` is None for a design that was not searched.
    """
    load, contact = study.file.load, study.clutch.contact
    simulated, used, own = "as by 'dogshape check'", versions(), ""
    if result is not None:
        c, used = result["confirmation"], result["versions"]
        simulated = f"{result['n_simulated_designs']} designs, {result['n_simulated_shifts']} "
        simulated += f"shifts by {ENGINES[result['engine']]}"
        simulated += f", confirmed at {c['angles']} new angles of each operating point" if c else ""
        own = f", result {content_key(result)}"
    facts = {
        "command": command_of(study) or f"dogshape study FILE; {study.name} is in study.json",
        "simulated": simulated,
        "operating points": study.operating_text,
        "load": f"{load.torque_Nm:g} N m, application factor {load.application_factor:g}",
        "material": study.limits.material.name,
        "contact": f"{contact.name}: friction {contact.static_friction:g} static, "
        f"{contact.dynamic_friction:g} dynamic, stiffness {contact.stiffness:.3g} Pa/m, "
        f"dissipation {contact.dissipation:g} s/m",
        "mechanism": ", ".join(f"{name} {one:.4g}" for name, one in study.mechanism.items()),
        "versions": ", ".join(f"{name} {version}" for name, version in used.items()),
        "hashes": f"configuration {study.config_hash}, physics {study.physics_hash}{own}",
    }
    return {name: words for name, words in facts.items() if words}
