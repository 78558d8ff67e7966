"""A bench folder from foreign tables: rows in the project's units, and a commented ``bench.toml``.

Values that a table lacks are those of a known clutch, or defaults, and are listed as assumptions.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from pandas import DataFrame

from dogshape.bench.bench_data import Bench, load_bench
from dogshape.bench.bench_draft import (
    BenchDraft,
    DraftTables,
    Traces,
    copy_trace,
    read_tables,
    row_numbers,
)
from dogshape.bench.draft_arguments import column_argument
from dogshape.bench.quantities import stated_rise
from dogshape.bench.raw_sheet import file_of
from dogshape.bench.reading_report import ReadingReport
from dogshape.bench.table import COLUMNS, FORCE, RISE
from dogshape.bench.texts import text_of
from dogshape.pipeline.config.operating import KIND
from dogshape.pipeline.config.toml_text import with_values
from dogshape.pipeline.diagnose.study_keys import Data, actuator_table, rounded
from dogshape.pipeline.drafts.draft_source import Source, source_of
from dogshape.pipeline.drafts.reading_table import BenchFolder, BenchReading
from dogshape.pipeline.drafts.study_folder import draft_folder
from dogshape.sim.errors import DogshapeError, InputError, number
from dogshape.sim.interface import argument, key_argument, listed_argument
from dogshape.sim.shift.actuators import KINDS, PROFILE, SECTION, SET_KEYS, required_keys
from dogshape.sim.shift.drive import NO_DRIVE
from dogshape.sim.shift.mechanism import NO_MECHANISM
from dogshape.sim.units import MM, short
from dogshape.sim.versions import bundled_root

SCATTER = 0.2  #: of a set value, up to which measured values lie off it
#: Set values of an actuator in words.
SET_WORDS = {"supply_bar": "pressure", "voltage_V": "voltage", "current_A": "current"}
TEMPLATE = Path("bench") / "template.toml"  #: the commented ``bench.toml``, among bundled files


def write_bench(out: str | Path, draft: BenchDraft, *, force: bool = False) -> BenchFolder:
    """Write a bench folder for ``validate`` and ``diagnose``.

    Example: ``ds.write_bench("my_bench", ds.BenchDraft("measured.csv", rise_s=0.18))``

    Parameters
    ----------
    out : folder to write.
    draft : tables of the stand and how to read them.
    force : whether files of the same names in ``out`` are replaced.

    Returns
    -------
    BenchFolder
        ``folder``, and the ``reading``: numbers of ``rows``, ``shifts`` and ``timed_shifts``, the
        ``report`` on columns and exclusions, ``assumed`` values and ``warnings``.

    Raises
    ------
    DataError
        For all faults of tables and traces at once, or for rows that cannot be true.
    StorageError
        For a folder that holds files, without ``force``.

    """
    target = Path(out)
    with draft_folder(target, force) as folder:
        tables = read_tables(draft)
        reading, _ = _fill_folder(folder, target, tables, _name_setting)
        for path in map(file_of, draft.paths):
            (folder / "as_measured").mkdir(exist_ok=True)
            shutil.copyfile(path, folder / "as_measured" / path.name)
    return BenchFolder(target, reading)


@contextmanager
def draft_bench(
    tables: DraftTables, corrections: Sequence[str]
) -> Iterator[tuple[Bench, BenchReading]]:
    """Yield the data set of a draft's tables, and its reading; raises as ``write_bench``.

    Its folder is a temporary one, for as long as the context lasts. ``corrections`` are made beside
    those of the draft.
    """
    draft = tables.draft
    if not draft.paths:
        raise InputError("the draft has no table to diagnose; name its tables")
    settings = dict(draft.values)
    stated = [*settings.get("corrections", ()), *corrections]
    if stated:
        settings["corrections"] = stated
    tables = replace(tables, draft=replace(draft, values=settings))
    with tempfile.TemporaryDirectory(prefix="dogshape-") as place:
        name = Path(draft.folder_name)
        folder = Path(place) / name
        folder.mkdir()
        try:
            reading, bench = _fill_folder(folder, name, tables, partial(listed_argument, "correct"))
        except DogshapeError as error:
            paths = ", ".join(map(str, draft.paths))
            text = str(error).replace(str(name / "bench.toml"), paths)
            raise type(error)(text) from error
        yield bench, reading


def _name_setting(correction: str) -> str:
    return key_argument("values", "corrections", [correction])


def _fill_folder(
    folder: Path,
    out: Path,
    tables: DraftTables,
    name_correction: Callable[[str], str],
) -> tuple[BenchReading, Bench]:
    """Write ``bench.toml``, ``shifts.csv`` and traces into a folder that messages call ``out``.

    Returns the reading and the data set. ``name_correction`` writes the option of a
    correction.
    """
    draft = tables.draft
    rows = tables.rows.copy()
    report = deepcopy(tables.report)
    source = source_of(draft.origin)
    actuation = _actuation_values(draft, source)
    where = ", ".join(map(str, draft.paths)) or str(out)
    if not draft.paths:
        points = [
            (m, f, source.table.rise(f), 10) for m in source.mismatches for f in source.forces
        ]
        rows = pd.DataFrame(points, columns=[*COLUMNS[:4]]).reindex(columns=[*COLUMNS])
        report.assumed.append(
            "shifts.csv has the operating points of the origin, to be filled in: one row for "
            "each shift or mean"
        )
    else:
        _require_actuator(rows, actuation, report)
    traces: Traces = {}
    for place in rows.index[rows.trace.notna()]:
        rows.loc[place, "trace"] = copy_trace(rows.loc[place], draft, report, folder, traces)
    report.require(where)
    values = _values(draft, source, rows, out, report, actuation=actuation)
    report.require(where)
    text = with_values(text_of(bundled_root() / TEMPLATE), values)
    (folder / "bench.toml").write_text(text, encoding="utf-8")
    absent_names = [*COLUMNS[7:]]
    if actuation:
        absent_names += [FORCE, RISE]
    empty = [name for name in absent_names if rows[name].isna().all()]
    outcomes = rows.engaged.map({True: "true", False: "false"})
    table = rows[[*COLUMNS]].assign(engaged=outcomes).drop(columns=empty)
    table.to_csv(folder / "shifts.csv", index=False, lineterminator="\n", float_format="%.9g")
    try:
        bench = load_bench(folder)
    except DogshapeError as error:
        text = _with_given_traces(str(error), folder, traces)
        text = _fault_of(text, folder, out, rows, name_correction)
        raise type(error)(text.replace(str(out / "shifts.csv"), where)) from error
    counts = rows.n_shifts
    reading = BenchReading(
        rows=len(rows),
        shifts=int(counts.sum()),
        timed_shifts=int(counts[rows.shift_time_s.notna()].sum()),
        report=report,
        warnings=[finding.sentence for finding in bench.warnings],
    )
    return reading, bench


def _actuation_values(draft: BenchDraft, source: Source) -> Data:
    """Collect ``[actuation]`` of the stand by dotted key: the user's, over that of the origin.

    Empty for a force over time.
    """
    stated = {key: value for key, value in draft.values.items() if key.startswith(f"{SECTION}.")}
    kind = stated.get(KIND)
    if kind == PROFILE:
        return {}
    actuator = source.clutch.actuator
    values: Data = {}
    if actuator is not None and kind in (None, actuator.kind):
        values = {f"{SECTION}.{key}": v for key, v in actuator_table(actuator).items()}
    return values | stated


def _require_actuator(rows: DataFrame, actuation: Data, report: ReadingReport) -> None:
    """Add a fault for set values without an actuator; leave out rise times where there is one."""
    kind = actuation.get(KIND)
    for name in SET_KEYS:
        if name not in rows or rows[name].isna().all():
            continue
        if kind in KINDS and name in KINDS[kind].set_keys:
            continue
        readings = [r for r in report.readings if r.quantity == name]
        head = readings[0].column if readings else name
        kinds = [key for key, value in KINDS.items() if name in value.set_keys]
        ways = " or ".join(key_argument("values", KIND, key) for key in kinds)
        number_keys = " ".join(
            key_argument("values", f"{SECTION}.{key}", "...") for key in required_keys(kinds[0])
        )
        stand = f"the {kind} actuator takes no {name}" if kind else "the stand has no actuator"
        product = ""
        if name == "supply_bar":
            area = column_argument(FORCE, f"{head} * 4.9 cm2")
            product = f" or say the area of the piston, such as {area},"
        report.faults.append(
            f"'{head}' is a {SET_WORDS[name]} and no {FORCE}, and {stand}; say the actuator, "
            f"{ways} with its numbers ({number_keys}),{product} or add the force"
        )
    if kind and rows[RISE].notna().any():
        rows[RISE] = np.nan
        report.assumed.append(f"{RISE} is left out: the {kind} actuator has a course of its own")


def _with_given_traces(text: str, folder: Path, traces: Traces) -> str:
    """Name the user's files and their rows in a fault of copied traces."""
    for copy, (path, lines) in traces.items():
        name = re.escape(str(folder / copy))
        for row_match in re.finditer(rf"{name}, row (\d+)", text) if lines else ():
            text = text.replace(row_match[0], f"{path}, row {lines[int(row_match[1]) - 2]}")
        text = text.replace(str(folder / copy), str(path))
    return text


def _fault_of(
    text: str,
    folder: Path,
    out: Path,
    rows: DataFrame,
    name_correction: Callable[[str], str],
) -> str:
    """Write a fault with the rows of the tables and the options of the verb."""

    def row_text(row_match: re.Match[str]) -> str:
        return "{file}, row {row}".format(**rows.iloc[int(row_match[1]) - 2])

    text = re.sub(rf"{re.escape(str(folder / 'shifts.csv'))}, row (\d+)", row_text, text)
    before, after = listed_argument("correct", "WAY").split("WAY")
    answer = rf"{re.escape(before)}([^\s\"]+){re.escape(after)}"
    text = re.sub(answer, lambda match: name_correction(match[1]), text)
    if "set values of others" in text:
        origin = argument("origin")
        sets = f"; name with {origin} a study or bench that has the set values, correct"
        text = text.replace("; correct", sets)
    # A table rarely has its times in s, as the folder has.
    rule = r"time_s is '(-?0\.\d+)', but it must be a time in s,?"
    text = re.sub(rule, lambda t: f"time_s is {1e3 * float(t[1]):.6g} ms, but must be a time", text)
    if "at most the time-out" in text:
        timeout = key_argument("values", "timeout_s", "...")
        text += f", or say {timeout} where the stand gives up later"
    return text.replace(str(folder), str(out))


def _group_set_points(
    rows: DataFrame, draft: BenchDraft, source: Source, report: ReadingReport
) -> Data:
    """Give measured values the set values of the origin, and their scatter as errors.

    Measured values hardly recur, are not round, and lie around few set values.
    """
    if any(text.startswith("points=") for text in draft.values.get("corrections", ())):
        return {}
    errors: Data = {}
    signed_mismatches = [sign * m for m in source.mismatches for sign in (1.0, -1.0)]
    for name, set_values, key in (
        ("mismatch_rpm", signed_mismatches, "mismatch_rpm"),
        ("force_N", source.forces, "force_percent"),
    ):
        values = rows[name].to_numpy()
        if np.isnan(values).any():  # another column sets the force
            continue
        levels = np.array(set_values)[abs(values[:, None] - np.array(set_values)).argmin(axis=1)]
        distinct, sets = set(values.tolist()), sorted(set(levels.tolist()))
        deviation = values / levels - 1.0
        if (
            min(len(distinct), len(rows) / 2) < 2 * len(sets)
            or 2 * len(distinct) < len(rows)
            or abs(deviation).max() > SCATTER
            or all(v == float(f"{v:.2g}") or v % 5.0 == 0.0 for v in distinct)
        ):
            continue
        off = 100.0 * deviation if key == "force_percent" else values - levels
        error = f"errors.each_point.{key}"
        errors[error] = float(f"{np.sqrt((off**2).sum() / (len(rows) - len(sets))):.2g}")
        rows[name] = levels
        answer = key_argument("values", "corrections", ["points=given"])
        report.assumed.append(
            f"{name.partition('_')[0]} is measured: {len(rows)} values are grouped at "
            f"{', '.join(map(number, sets))}, the set values of '{source.name}', with their "
            f"scatter as {error} = {errors[error]:g}; {answer} keeps each"
        )
    return errors


def _mark_time_outs(
    rows: DataFrame, draft: BenchDraft, source: Source, report: ReadingReport
) -> None:
    """Take times at the stated time-out as shifts that did not engage; ask where none is stated."""
    times = rows.shift_time_s[rows.engaged.isna()].dropna()
    stated = draft.values.get("timeout_s")
    if isinstance(stated, int | float):
        late_rows = times.index[(times / stated).between(0.999, 1.02)]
        rows.loc[late_rows, ["shift_time_s", "engaged"]] = np.nan, False
        if late_rows.size:
            report.assumed.append(
                f"times at the time-out of {number(stated)} s are shifts that did not engage (row "
                f"{row_numbers(rows.loc[late_rows])})"
            )
        return
    counts, largest = times.value_counts(), times.max()
    piled = len(counts) > 1 and counts[largest] > counts.drop(largest).max()
    if piled or abs(largest / source.clutch.timeout - 1.0) < 1e-6:
        answer = key_argument("values", "timeout_s", float(number(largest)))
        report.faults.append(
            f"the largest time, {number(largest)} s, is there {counts[largest]} times (row "
            f"{rows.row[times.idxmax()]}), as where a stand gives up; say {answer} where these "
            "shifts did not engage, or a longer time-out where they did"
        )


def _fill_rises(rows: DataFrame, draft: BenchDraft, source: Source, report: ReadingReport) -> None:
    lacks_rise = rows.force_rise_s.isna()
    if not lacks_rise.any():
        return
    rises = rows.force_N.map(lambda force: round(source.table.rise(force), 6))
    rows.loc[lacks_rise, "force_rise_s"] = rises if draft.rise_s is None else draft.rise_s
    filled = rows.force_rise_s[lacks_rise]
    low = number(min(filled))
    if draft.rise_s is not None:
        report.assumed.append(f"the force rises in {low} s where no row says it")
        return
    low_force, high_force = number(min(source.table.forces)), number(max(source.table.forces))
    outer_forces = sorted({f for f in rows.force_N[lacks_rise] if not source.table.covers(f)})
    remark = ""
    if outer_forces:
        outer_text = ", ".join(map(number, outer_forces))
        remark = f"; {outer_text} N lie beyond and have the rise time of the nearest force"
    report.assumed.append(
        f"the force rises in {low} to {number(max(filled))} s, by its size as in '{source.name}' "
        f"({low_force} to {high_force} N){remark}; {argument('rise_s')} says another time"
    )
    for exclusion in report.left_out:
        stated = stated_rise(exclusion.reason)
        if stated is not None:
            words, rise = stated
            report.assumed.append(
                f"{exclusion.place} of {exclusion.file} states '{words}', which is not taken: "
                f"{argument('rise_s', short(rise))} takes it for all rows without a rise time"
            )


def _values(
    draft: BenchDraft,
    source: Source,
    rows: DataFrame,
    out: Path,
    report: ReadingReport,
    *,
    actuation: Data,
) -> Data:
    """Collect the values of ``bench.toml``, and group and complete the rows by them."""
    clutch = source.clutch
    settings = {key: v for key, v in draft.values.items() if not key.startswith(f"{SECTION}.")}
    values: Data = {
        **actuation,
        "name": out.resolve().name,
        "timeout_s": clutch.timeout,
        "shift_travel_mm": rounded(clutch.shift_travel / MM),
        **source.dog_values,
        **{f"drive.{key}": value for key, value in clutch.drive.table.items() if source.is_bench},
        **{f"contact.{key}": value for key, value in clutch.contact.record.items()},
        "source": "not measured yet",
    }
    if draft.paths:
        values |= _group_set_points(rows, draft, source, report)
        if not actuation:
            _fill_rises(rows, draft, source, report)
        _mark_time_outs(rows, draft, source, report)
        digests = [hashlib.sha256(file_of(path).read_bytes()) for path in draft.paths]
        files = ", ".join(
            f"{path.name} (SHA-256 {digest.hexdigest()[:16]})"
            for path, digest in zip(draft.paths, digests, strict=True)
        )
        settings["source"] = "; ".join(filter(None, (settings.get("source"), files)))
    signed = bool((rows.mismatch_rpm < 0.0).any())
    values["record.sense"] = "known" if signed else "unknown"
    report.assumed += _assumptions_of(source, settings, values["timeout_s"], rows, signed=signed)
    if ways := [key for key in ("dog.height_mm", "dog.axial_gap_mm") if key in settings]:
        longer = sum(float(settings[key]) - values[key] for key in ways)
        values["shift_travel_mm"] = float(f"{values['shift_travel_mm'] + longer:.9g}")
    return values | settings


def _assumptions_of(
    source: Source, settings: Data, timeout: float, rows: DataFrame, *, signed: bool
) -> list[str]:
    """List assumptions on the stand: values of the origin, and what neither rows nor user say.

    ``settings`` are the values of the user; ``signed`` says that some mismatches are negative.
    """
    mechanism = source.clutch.mechanism
    drive = source.clutch.drive
    origin_tables = [
        name
        for name in ("dog", "sliding", "output", "contact")
        if not any(key.startswith(f"{name}.") for key in settings)
    ]
    mass, origin_text = mechanism.added_mass, f"of the [mechanism] of '{source.name}'"
    sense = "the sense of the mismatch is not known (record.sense); a diagnosis weighs both"
    if signed:
        sense = "the sign of the mismatch is the project's (docs/scope.md), as some are negative"
    return [
        sentence
        for sentence, holds in (
            (
                "the traces' displacement and force are referred to the sleeve",
                rows.trace.notna().any(),
            ),
            (
                "the event at which the times start is unknown: "
                f"{key_argument('values', 'record.time_zero', 'command')}, or force, states it",
                "record.time_zero" not in settings,
            ),
            (
                "the place of the displacement sensor is unknown: "
                f"{key_argument('values', 'record.displacement_at', 'sleeve')}, or actuator, "
                "states it",
                "record.displacement_at" not in settings,
            ),
            (
                f"[{'], ['.join(origin_tables)}] are those of '{source.name}': check bench.toml",
                origin_tables,
            ),
            (f"{mass:g} kg {origin_text} move with the ring", mass),
            (
                f"{origin_text} friction, drag and linkage are left for the diagnosis",
                replace(mechanism, added_mass=0.0) != NO_MECHANISM,
            ),
            (
                f"the shafts of '{source.name}' {drive.text}, the stand's sliding ring is at rest "
                f"before the shift: {key_argument('values', 'drive.shaft_speed_rpm', 'SPEED')} and "
                "drive.engine_side say otherwise",
                drive != NO_DRIVE
                and not source.is_bench
                and not any("drive" in key for key in settings),
            ),
            (f"the stand gives up after {number(timeout)} s", "timeout_s" not in settings),
            (sense, "record.sense" not in settings),
        )
        if holds
    ]
