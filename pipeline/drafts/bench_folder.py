"""A bench folder from foreign tables: rows in the project's units, and a commented ``bench.toml``.

Values that a table lacks are those of a known clutch, or defaults, and are listed as assumptions.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas import DataFrame

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.foreign_columns import NONE
from dogshape.diagnosis.bench.foreign_readings import Report, TableReader
from dogshape.diagnosis.bench.foreign_table import (
    ForeignTable,
    read_foreign,
    read_sheet,
    table_of,
)
from dogshape.diagnosis.bench.quantities import SHIFTS, TRACE
from dogshape.diagnosis.bench.row_marks import RowChoice
from dogshape.diagnosis.bench.table import COLUMNS, NUMERIC
from dogshape.diagnosis.bench.traces import READERS
from dogshape.pipeline.config.toml_text import with_values
from dogshape.pipeline.diagnose.study_keys import Data, rounded
from dogshape.pipeline.drafts.study_folder import PUBLISHED, Source, draft_folder, source_of
from dogshape.sim.decoding import TableLimits
from dogshape.sim.errors import DataError, DogshapeError, InputError, number
from dogshape.sim.raw_sheet import OTHER_BOOKS, file_of, is_workbook
from dogshape.sim.shift.drive import NO_DRIVE
from dogshape.sim.shift.mechanism import NOTHING
from dogshape.sim.texts import text_of
from dogshape.sim.units import MM
from dogshape.sim.versions import bundled_root

OF_TRACES = "trace."  #: before the name of a quantity that is a column of traces
QUOTES = ("cells", "none")  #: what quotation marks of a text enclose
SCATTER = 0.2  #: of a set value, up to which measured values lie off it
#: Copies of traces by path in the folder: the user's file, and the rows of a table in it.
Traces = dict[str, tuple[Path, tuple[int, ...]]]
#: Suffixes of tables, also of those that are refused with a remedy.
TABLE_SUFFIXES = frozenset((".csv", ".dat", ".lvm", ".tsv", ".txt", ".xlsx", *OTHER_BOOKS))
TEMPLATE = Path("bench") / "template.toml"  #: the commented ``bench.toml``, among bundled files


@dataclass(frozen=True)
class BenchDraft:
    """Content of a bench folder before it is written: tables of a stand and how to read them.

    ``dogshape.write_bench`` writes the folder, ``dogshape.diagnose`` takes the draft in its place.
    Example: ``ds.BenchDraft("measured.csv", columns={"shift_time_s": "t 90 %:ms"})``

    Parameters
    ----------
    tables : one or several CSV or .xlsx files, ``FILE.xlsx#SHEET`` for a sheet; none for a folder
        with an empty table to fill in.
    origin : study or bench with clutch, contact, set values and rise times of the force.
    columns : column, ``COLUMN:UNIT``, formula, or value for all rows, by quantity.
    rise_s : rise time of the force of rows without one, s; None for that of the origin.
    values : values of ``bench.toml`` by dotted key.
    decimal : decimal sign of the tables, ``.`` or ``,``; None to find it.
    rows : rows of the file that are shifts, such as ``2-41,45``; empty to find them.
    drop, keep : ``COLUMN=VALUE`` of rows that are no shifts, and of those that alone are shifts.
    fill_down : whether an empty set value is that of the row above.
    limits : sizes up to which tables are read.
    quotes : ``cells`` where quotation marks enclose cells of a text, ``none`` where they are
        ordinary signs.
    """

    tables: str | Path | Sequence[str | Path] = ()
    origin: str = PUBLISHED
    columns: Mapping[str, str] = field(default_factory=dict)
    rise_s: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    decimal: str | None = None
    rows: str = ""
    drop: Sequence[str] = ()
    keep: Sequence[str] = ()
    fill_down: bool = False
    limits: TableLimits = field(default_factory=TableLimits)
    quotes: str = QUOTES[0]

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of the tables, with the sheet behind a workbook."""
        tables = (self.tables,) if isinstance(self.tables, str | Path) else self.tables
        return tuple(map(Path, tables))

    @property
    def folder_name(self) -> str:
        """Name of a folder after the first table."""
        return self.paths[0].stem.replace(" ", "_") if self.paths else "my_bench"

    @property
    def choice(self) -> RowChoice:
        """Answers of the user on rows."""
        return RowChoice(tuple(self.drop), tuple(self.keep), bool(self.rows), self.fill_down)

    @property
    def quoted(self) -> bool:
        """Whether quotation marks enclose cells."""
        return self.quotes == QUOTES[0]

    @property
    def ranges(self) -> list[range]:
        """Rows of the file that are shifts; raises InputError for a text that names none."""
        spans = [re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part) for part in self.rows.split(",")]
        if self.rows and not all(spans):
            raise InputError(f"--rows is '{self.rows}', but must name rows, such as 2-41,45")
        return [range(int(span[1]), int(span[2] or span[1]) + 1) for span in spans if span]


def guess_readings(draft: BenchDraft) -> Data:
    """Read the tables of a draft: columns, excluded rows and columns, and faults.

    ``empty`` counts the rows with neither a time nor an outcome.
    """
    report = Report()
    empty = int(_silent(_read_tables(draft, report)).sum())
    return {
        "columns": report.readings,
        "left_out": report.left_out,
        "faults": report.faults,
        "empty": empty,
    }


def explain_reading(draft: BenchDraft) -> Data:
    """Read the tables of a draft step by step: lines of each finished step, and faults."""
    _require_readable(draft)
    steps: list[dict[str, str]] = []
    report = Report()
    for path in draft.paths:
        try:
            sheet, stated = read_sheet(path, draft.limits, draft.ranges, quoted=draft.quoted)
            rows = [("raw sheet", line) for line in sheet.lines()]
            steps += [{"file": str(path), "step": step, "line": line} for step, line in rows]
            table = table_of(sheet, stated, draft.ranges)
        except FileNotFoundError:
            raise InputError(f"there is no {path}; give a CSV or .xlsx of the stand") from None
        except DataError as error:
            report.faults.append(str(error))
            continue
        reader, _ = _read_rows(table, draft, report)
        rows = [(step, line) for step, line in reader.lines() if step != "raw sheet"]
        steps += [{"file": str(path), "step": step, "line": line} for step, line in rows]
    return {
        "steps": steps,
        "columns": report.readings,
        "left_out": report.left_out,
        "assumed": report.assumed,
        "faults": list(dict.fromkeys(report.faults)),
    }


def write_bench(out: str | Path, draft: BenchDraft, *, force: bool = False) -> Data:
    """Write a bench folder for ``validate`` and ``diagnose``.

    Example: ``ds.write_bench("my_bench", ds.BenchDraft("measured.csv", rise_s=0.18))``

    Parameters
    ----------
    out : folder to write.
    draft : tables of the stand and how to read them.
    force : whether files of the same names in ``out`` are replaced.

    Returns
    -------
    dict
        ``folder``; numbers of ``rows``, ``shifts`` and shifts ``with_time``; readings of
        ``columns``; rows and columns ``left_out``; ``assumed`` values; ``warnings``.

    Raises
    ------
    DataError
        For all faults of tables and traces at once, or for rows that cannot be true.
    StorageError
        For a folder that holds files, without ``force``.

    """
    target = Path(out)
    with draft_folder(target, force) as folder:
        record, _ = _fill_folder(folder, target, draft, _name_setting)
        for path in map(file_of, draft.paths):
            (folder / "as_measured").mkdir(exist_ok=True)
            shutil.copyfile(path, folder / "as_measured" / path.name)
    return {"folder": str(target), **record}


@contextmanager
def draft_bench(draft: BenchDraft, corrections: Sequence[str] = ()) -> Iterator[tuple[Bench, Data]]:
    """Yield the data set of a draft and the record of its reading; raises as ``write_bench``.

    Its folder is a temporary one, for as long as the context lasts. ``corrections`` are made beside
    those of the draft.
    """
    if not draft.paths:
        raise InputError("the draft has no table to diagnose; name its tables")
    settings = dict(draft.values)
    stated = [*settings.get("corrections", ()), *corrections]
    if stated:
        settings["corrections"] = stated
    draft = replace(draft, values=settings)
    with tempfile.TemporaryDirectory(prefix="dogshape-") as place:
        name = Path(draft.folder_name)
        folder = Path(place) / name
        folder.mkdir()
        try:
            record, bench = _fill_folder(folder, name, draft, _name_correction)
        except DogshapeError as error:
            tables = ", ".join(map(str, draft.paths))
            text = str(error).replace(str(name / "bench.toml"), tables)
            raise type(error)(text) from error
        yield bench, record


def is_table(where: str | Path) -> bool:
    """Test that a path names a table: a file that is there, a sheet, or a table's suffix."""
    path = Path(where)
    if path.is_dir() or path.name == "bench.toml":
        return False
    return path.is_file() or is_workbook(path) or path.suffix.lower() in TABLE_SUFFIXES


def _name_setting(correction: str) -> str:
    return f"""--set 'corrections=["{correction}"]'"""


def _name_correction(correction: str) -> str:
    return f"--correct {correction}"


def _fill_folder(
    folder: Path, out: Path, draft: BenchDraft, name_correction: Callable[[str], str]
) -> tuple[Data, Bench]:
    """Write ``bench.toml``, ``shifts.csv`` and traces into a folder that messages call ``out``.

    Returns the record of the reading and the data set. ``name_correction`` writes the option of a
    correction.
    """
    source, report = source_of(draft.origin), Report()
    where = ", ".join(map(str, draft.paths)) or str(out)
    if draft.paths:
        rows = _read_tables(draft, report)
    else:
        points = [
            (m, f, source.table.rise(f), 10) for m in source.mismatches for f in source.forces
        ]
        rows = pd.DataFrame(points, columns=[*COLUMNS[:4]]).reindex(columns=[*COLUMNS])
        report.assumed.append(
            "shifts.csv has the operating points of the origin, to be filled in: one row for "
            "each shift or mean"
        )
    traces: Traces = {}
    for place in rows.index[rows["trace"].notna()]:
        rows.loc[place, "trace"] = _copy_trace(rows.loc[place], draft, report, folder, traces)
    report.require(where)
    values = _values(draft, source, rows, out, report)
    report.require(where)
    text = with_values(text_of(bundled_root() / TEMPLATE), values)
    (folder / "bench.toml").write_text(text, encoding="utf-8")
    empty = [name for name in COLUMNS[7:] if rows[name].isna().all()]
    table = rows[[*COLUMNS]].drop(columns=empty)
    table["engaged"] = table["engaged"].map({True: "true", False: "false"})
    table.to_csv(folder / "shifts.csv", index=False, lineterminator="\n", float_format="%.9g")
    try:
        bench = load_bench(folder)
    except DogshapeError as error:
        text = _with_given_traces(str(error), folder, traces)
        text = _fault_of(text, folder, out, rows, name_correction)
        raise type(error)(text.replace(str(out / "shifts.csv"), where)) from error
    record = {
        "rows": len(rows),
        "shifts": int(rows["n_shifts"].sum()),
        "with_time": int(rows["n_shifts"][rows["shift_time_s"].notna()].sum()),
        "columns": report.readings,
        "left_out": report.left_out,
        "assumed": list(dict.fromkeys(report.assumed)),
        "warnings": [finding.sentence for finding in bench.warnings],
    }
    return record, bench


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
    text = re.sub(r"--correct (\S+)", lambda option: name_correction(option[1]), text)
    if "set values of others" in text:
        sets = "; name with --from a study or bench that has the set values, correct"
        text = text.replace("; correct", sets)
    # A table rarely has its times in s, as the folder has.
    rule = r"time_s is '(-?0\.\d+)', but it must be a time in s,?"
    text = re.sub(rule, lambda t: f"time_s is {1e3 * float(t[1]):.6g} ms, but must be a time", text)
    remedy = ", or say --set timeout_s=... where the stand gives up later"
    text += remedy if "at most the time-out" in text else ""
    return text.replace(str(folder), str(out))


def _require_readable(draft: BenchDraft) -> None:
    """Raise InputError for tables of one file name, and for another decimal sign."""
    files_by_name: dict[str, set[Path]] = {}
    for path in draft.paths:
        file = file_of(path)
        files_by_name.setdefault(file.name, set()).add(file.resolve())
    same_file_names = any(len(files) > 1 for files in files_by_name.values())
    if same_file_names or len({path.name for path in draft.paths}) < len(draft.paths):
        raise InputError(
            "two of the tables have the same file name, but both are kept beside each other; "
            "rename one"
        )
    if draft.decimal not in (None, ".", ","):
        raise InputError(f"--decimal is '{draft.decimal}', but must be a point or a comma: . or ,")
    if draft.quotes not in QUOTES:
        raise InputError(f"--quotes is '{draft.quotes}', but must be {' or '.join(QUOTES)}")


def _read_rows(
    table: ForeignTable, draft: BenchDraft, report: Report
) -> tuple[TableReader, DataFrame]:
    """Read the rows of a table, with its file and their numbers, and complete them."""
    columns = {k: v for k, v in draft.columns.items() if not k.startswith(OF_TRACES)}
    reader = TableReader(table, SHIFTS, columns, draft.decimal, report, choice=draft.choice)
    values = {"file": str(table.path), "row": reader.table.rows, **reader.read()}
    return reader, _completed(pd.DataFrame(values), reader)


def _read_tables(draft: BenchDraft, report: Report) -> DataFrame:
    """Read the rows of all tables, with their file and row beside the columns of ``shifts.csv``."""
    _require_readable(draft)
    frames = [pd.DataFrame(columns=["file", "row", *COLUMNS])]
    for path in draft.paths:
        try:
            table = read_foreign(path, draft.ranges, limits=draft.limits, quoted=draft.quoted)
        except DataError as error:
            report.faults.append(str(error))
            continue
        frames.append(_read_rows(table, draft, report)[1])
    return pd.concat(frames[len(frames) > 1 :], ignore_index=True)


def _completed(rows: DataFrame, reader: TableReader) -> DataFrame:
    """Fill cells of a table from its other columns."""
    path, report = reader.table.path, reader.report
    numbers = [name for name in NUMERIC if name not in ("n_shifts", "timestamp")]
    rows[numbers] = rows[numbers].astype(float)
    rows["n_shifts"] = rows["n_shifts"].astype(float).fillna(1.0).astype(int)
    failed = rows["engaged"].eq(False)
    is_late = failed & rows["shift_time_s"].notna()
    rows.loc[failed, "shift_time_s"] = np.nan
    rows.loc[(rows["n_shifts"] < 2) | rows["shift_time_s"].isna(), "shift_time_sd_s"] = np.nan
    if rows["order"][rows["shift_time_s"].notna()].dropna().duplicated().any():
        report.faults.append(
            f"{path}: '{reader.matches['order'].head}' has a number twice, so it is no place in "
            f"the whole series; --column order={NONE} leaves it out"
        )
    silent = _silent(rows).sum()
    report.assumed += [
        f"{path}: {sentence}"
        for sentence, holds in (
            ("each row is one shift, as no column counts them", "n_shifts" not in reader.matches),
            (
                f"times of shifts that did not engage are left out (row {_places(rows[is_late])})",
                is_late.any(),
            ),
            *(
                (
                    f"'{reader.matches[name].head}' is the order of the shifts, so a diagnosis "
                    f"looks for a drift; --column {name}={NONE} leaves it out",
                    True,
                )
                for name in ("order", "timestamp")
                if name in reader.matches
            ),
            (
                f"nothing is known of rows without a time ({silent}); record.empty_cells says "
                "whether they were tried, or a column engaged of each with yes and no",
                silent,
            ),
        )
        if holds
    ]
    return rows


def _silent(rows: DataFrame) -> Any:
    """Mark the rows with neither a time nor an outcome."""
    return rows["shift_time_s"].isna() & rows["engaged"].isna()


def _places(rows: DataFrame) -> str:
    return ", ".join(map(str, rows["row"]))


def _group_set_points(rows: DataFrame, draft: BenchDraft, source: Source, report: Report) -> Data:
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
        report.assumed.append(
            f"{name.partition('_')[0]} is measured: {len(rows)} values are grouped at "
            f"{', '.join(map(number, sets))}, the set values of '{source.name}', with their "
            f"scatter as {error} = {errors[error]:g}; --set 'corrections=[\"points=given\"]' keeps "
            "each"
        )
    return errors


def _mark_time_outs(rows: DataFrame, draft: BenchDraft, source: Source, report: Report) -> None:
    """Take times at the stated time-out as shifts that did not engage; ask where none is stated."""
    times = rows["shift_time_s"][rows["engaged"].isna()].dropna()
    stated = draft.values.get("timeout_s")
    if isinstance(stated, int | float):
        late_rows = times.index[(times / stated).between(0.999, 1.02)]
        rows.loc[late_rows, ["shift_time_s", "engaged"]] = np.nan, False
        if late_rows.size:
            report.assumed.append(
                f"times at the time-out of {number(stated)} s are shifts that did not engage (row "
                f"{_places(rows.loc[late_rows])})"
            )
        return
    counts, largest = times.value_counts(), times.max()
    piled = len(counts) > 1 and counts[largest] > counts.drop(largest).max()
    if piled or abs(largest / source.clutch.timeout - 1.0) < 1e-6:
        report.faults.append(
            f"the largest time, {number(largest)} s, is there {counts[largest]} times (row "
            f"{rows['row'][times.idxmax()]}), as where a stand gives up; say --set timeout_s="
            f"{number(largest)} where these shifts did not engage, or a longer time-out where "
            "they did"
        )


def _fill_rises(rows: DataFrame, draft: BenchDraft, source: Source, report: Report) -> None:
    lacks_rise = rows["force_rise_s"].isna()
    if not lacks_rise.any():
        return
    rises = rows["force_N"].map(lambda force: round(source.table.rise(force), 6))
    rows.loc[lacks_rise, "force_rise_s"] = rises if draft.rise_s is None else draft.rise_s
    low, high, low_force, high_force = (
        number(end(values))
        for values in (rows["force_rise_s"][lacks_rise], source.table.forces)
        for end in (min, max)
    )
    outer_forces = sorted({f for f in rows["force_N"][lacks_rise] if not source.table.covers(f)})
    outer_text = ", ".join(map(number, outer_forces))
    remark = f"; {outer_text} N lie beyond and have the rise time of the nearest "
    report.assumed.append(
        f"the force rises in {low} to {high} s, by its size as in '{source.name}' ({low_force} to "
        f"{high_force} N){f'{remark}force' if outer_forces else ''}; --rise-s says another time"
        if draft.rise_s is None
        else f"the force rises in {low} s where no row says it"
    )


def _copy_trace(row: Any, draft: BenchDraft, report: Report, folder: Path, traces: Traces) -> str:
    """Write the trace of a row: CSV in the project's units, a recorder's file unchanged.

    Returns its path in the folder, and enters it in ``traces``.
    """
    path, target = Path(row["file"]).parent / row["trace"].replace("\\", "/"), folder / "traces"
    if not path.is_file():
        report.faults.append(
            f"{row['file']}, row {row['row']}: there is no trace {path}; add the file, or empty "
            "the cell"
        )
        return ""
    target.mkdir(exist_ok=True)
    is_recorder_file = path.suffix.lower() in READERS
    name = _trace_name(path, path.suffix if is_recorder_file else ".csv", traces)
    traces[name] = path, ()
    if is_recorder_file:
        shutil.copyfile(path, folder / name)
        return name
    columns_of_trace = {
        k.removeprefix(OF_TRACES): v for k, v in draft.columns.items() if k.startswith(OF_TRACES)
    }
    trace_report = Report()
    try:
        table = read_foreign(path, sums=False, limits=draft.limits, quoted=draft.quoted)
        reader = TableReader(table, TRACE, columns_of_trace, draft.decimal, trace_report)
        columns = pd.DataFrame(reader.read(), dtype=float)
        columns.to_csv(folder / name, index=False, float_format="%.15g")
        traces[name] = path, reader.table.rows
    except DataError as error:
        report.faults.append(str(error))
    report.faults += trace_report.faults
    report.assumed += [f"traces: {line}" for line in trace_report.assumed]
    report.left_out += [item for item in trace_report.left_out if "row" in item]
    return name


def _trace_name(path: Path, suffix: str, traces: Traces) -> str:
    """Give a trace a path in the folder that no other file has: with its folder before it."""
    stems = [path.stem, f"{path.parent.name}_{path.stem}"]
    stems += [f"{path.stem}_{count}" for count in range(2, len(traces) + 3)]
    names = [f"traces/{stem}{suffix}" for stem in stems]
    return next(name for name in names if traces.get(name, (path, ()))[0] == path)


def _values(draft: BenchDraft, source: Source, rows: DataFrame, out: Path, report: Report) -> Data:
    """Collect the values of ``bench.toml``, and group and complete the rows by them."""
    clutch, settings, assumptions = source.clutch, dict(draft.values), report.assumed
    drive = clutch.drive
    values: Data = {
        "name": out.resolve().name,
        "timeout_s": clutch.timeout,
        "shift_travel_mm": rounded(clutch.shift_travel / MM),
        **source.dog_values,
        **{
            f"drive.{key}": value for key, value in (drive.table if source.is_bench else {}).items()
        },
        **{f"contact.{key}": value for key, value in clutch.contact.record.items()},
        "source": "not measured yet",
    }
    if draft.paths:
        values |= _group_set_points(rows, draft, source, report)
        _fill_rises(rows, draft, source, report)
        _mark_time_outs(rows, draft, source, report)
        digests = [hashlib.sha256(file_of(path).read_bytes()) for path in draft.paths]
        files = ", ".join(
            f"{path.name} (SHA-256 {digest.hexdigest()[:16]})"
            for path, digest in zip(draft.paths, digests, strict=True)
        )
        settings["source"] = "; ".join(filter(None, (settings.get("source"), files)))
    origin_tables = [
        name
        for name in ("dog", "sliding", "output", "contact")
        if not any(key.startswith(f"{name}.") for key in settings)
    ]
    mass, origin_text = clutch.mechanism.added_mass, f"of the [mechanism] of '{source.name}'"
    signed = bool((rows["mismatch_rpm"] < 0.0).any())
    values["record.sense"] = "known" if signed else "unknown"
    sense = "the sense of the mismatch is not known (record.sense); a diagnosis weighs both"
    if signed:
        sense = "the sign of the mismatch is the project's (docs/mismatch.md), as some are negative"
    assumptions += [
        sentence
        for sentence, holds in (
            (
                "the traces' displacement and force are referred to the sleeve",
                rows["trace"].notna().any(),
            ),
            (
                "the event at which the times start is unknown: --set record.time_zero=command, "
                "or force, states it",
                "record.time_zero" not in settings,
            ),
            (
                "the place of the displacement sensor is unknown: --set "
                "record.displacement_at=sleeve, or actuator, states it",
                "record.displacement_at" not in settings,
            ),
            (
                f"[{'], ['.join(origin_tables)}] are those of '{source.name}': check bench.toml",
                origin_tables,
            ),
            (f"{mass:g} kg {origin_text} move with the ring", mass),
            (
                f"{origin_text} friction, drag and linkage are left for the diagnosis",
                replace(clutch.mechanism, added_mass=0.0) != NOTHING,
            ),
            (
                f"the shafts of '{source.name}' {drive.text}, the stand's sliding ring is at rest "
                "before the shift: --set drive.shaft_speed_rpm=SPEED and drive.engine_side say "
                "otherwise",
                drive != NO_DRIVE
                and not source.is_bench
                and not any("drive" in key for key in settings),
            ),
            (
                f"the stand gives up after {number(values['timeout_s'])} s",
                "timeout_s" not in settings,
            ),
            (sense, "record.sense" not in settings),
        )
        if holds
    ]
    if ways := [key for key in ("dog.height_mm", "dog.axial_gap_mm") if key in settings]:
        longer = sum(float(settings[key]) - values[key] for key in ways)
        values["shift_travel_mm"] = float(f"{values['shift_travel_mm'] + longer:.9g}")
    return values | settings
