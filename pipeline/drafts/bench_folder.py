"""A bench folder from foreign tables: rows in the project's units, and a commented ``bench.toml``.

Values that a table lacks are those of a known clutch, or defaults, and are listed as assumptions.
The folder is examined as every data set is before it is written; all faults are listed at once.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
import shutil
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import ceil, gcd
from pathlib import Path
from statistics import fmean
from typing import Any

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.corrections import corrected, parse
from dogshape.diagnosis.bench.foreign_columns import SHIFTS, TRACE
from dogshape.diagnosis.bench.foreign_table import read_foreign
from dogshape.diagnosis.bench.foreign_values import Report, TableReader
from dogshape.diagnosis.bench.mdf4 import SUFFIXES
from dogshape.diagnosis.bench.near_points import set_values
from dogshape.diagnosis.bench.slips import examine, impossible
from dogshape.diagnosis.bench.stand_file import Stand, load_stand
from dogshape.diagnosis.bench.table import COLUMNS, Sheet
from dogshape.diagnosis.bench.table import Row as SheetRow
from dogshape.diagnosis.bench.table_slips import SCALED
from dogshape.pipeline.config.toml_text import with_values
from dogshape.pipeline.drafts.bench_template import TEMPLATE
from dogshape.pipeline.drafts.sources import PUBLISHED, Source, source_of
from dogshape.pipeline.drafts.targets import drafted
from dogshape.sim.errors import DataError, DogshapeError, InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM

Row = dict[str, Any]  #: a table of a TOML file
COARSE = 5e-3  #: s, step of a clock that is worth a word
OF_TRACES = "trace."  #: before the name of a quantity that is a column of traces


@dataclass(frozen=True)
class BenchDraft:
    """Content of a bench folder before it is written.

    Parameters
    ----------
    tables : CSV files of the stand; none gives a table to fill in.
    origin : study or bench whose clutch, contact, set values and rise of the force are taken.
    columns : quantity to column, unit or formula (``foreign_columns.said_match``).
    rise_s : rise time of the force for all rows that have none; None takes the origin's.
    values : values of ``bench.toml`` by dotted key.
    decimal : decimal sign of the tables, None to find it.
    rows : rows of the file that are shifts, such as ``2-41,45``; empty to find them.
    """

    tables: tuple[Path, ...] = ()
    origin: str = PUBLISHED
    columns: Mapping[str, str] = field(default_factory=dict)
    rise_s: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    decimal: str | None = None
    rows: str = ""

    @property
    def ranges(self) -> list[range]:
        """Rows of the file that are shifts; raises InputError for a text that names none."""
        found = [re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part) for part in self.rows.split(",")]
        if self.rows and not all(found):
            raise InputError(f"--rows is '{self.rows}', but must name rows, such as 2-41,45")
        return [range(int(one[1]), int(one[2] or one[1]) + 1) for one in found if one]


def guessed(draft: BenchDraft) -> Row:
    """Read the tables of a draft: readings of columns, rows and columns left out, and faults."""
    report = Report()
    _tables(draft, report)
    return {"columns": report.readings, "left_out": report.left_out, "faults": report.faults}


def write_bench(out: Path, draft: BenchDraft, *, force: bool = False) -> Row:
    """Write a bench folder that ``validate`` and ``gap`` take as it is; record all assumptions.

    Raises
    ------
    DataError
        For all faults of tables, rows and traces at once.
    StorageError
        For a folder that holds files, without ``force``.
    """
    source, report = source_of(draft.origin), Report()
    where = ", ".join(map(str, draft.tables)) or str(out)
    with drafted(out, force) as folder:
        rows = _tables(draft, report) if draft.tables else _empty_rows(source, report)
        for row in rows:
            if row["trace"]:
                _copy_trace(row, draft, report, folder)
        report.require(where)
        values = _values(draft, source, rows, out, report)
        (folder / "bench.toml").write_text(with_values(TEMPLATE, values), encoding="utf-8")
        (folder / "shifts.csv").write_text(_table(rows), encoding="utf-8")
        _examine(folder, rows, report)
        report.require(where)
        warnings = _warnings(folder, out)
        for path in draft.tables:
            (folder / "as_measured").mkdir(exist_ok=True)
            shutil.copyfile(path, folder / "as_measured" / path.name)
    return {
        "folder": str(out),
        "rows": len(rows),
        "shifts": sum(row["n"] for row in rows),
        "with_time": sum(row["n"] for row in rows if row["time"] is not None),
        "columns": report.readings,
        "left_out": report.left_out,
        "assumed": list(dict.fromkeys(report.assumed)),
        "warnings": warnings,
    }


def _tables(draft: BenchDraft, report: Report) -> list[Row]:
    """Read the rows of all tables."""
    names = [path.name for path in draft.tables]
    if len(set(names)) < len(names):
        raise InputError(
            "two of the tables have the same file name, but both are kept beside each other; "
            "rename one"
        )
    if draft.decimal not in (None, ".", ","):
        raise InputError(f"--decimal is '{draft.decimal}', but must be a point or a comma: . or ,")
    said = {k: v for k, v in draft.columns.items() if not k.startswith(OF_TRACES)}
    rows: list[Row] = []
    for path in draft.tables:
        try:
            table = read_foreign(path, draft.ranges)
        except DataError as error:
            report.faults.append(str(error))
            continue
        rows += _table_rows(TableReader.of(table, SHIFTS, said, draft.decimal, report))
    return rows


def _empty_rows(source: Source, report: Report) -> list[Row]:
    report.assumed.append(
        "shifts.csv has the operating points of the origin, to be filled in: one row for each "
        "shift or mean"
    )
    return [
        {"file": "", "row": 0, "mismatch": m, "force": f, "rise": source.rise(f)[0], "n": 10,
         "time": None, "engaged": None, "trace": ""}
        for m in source.mismatches for f in source.forces
    ]  # fmt: skip


def _table_rows(reader: TableReader) -> list[Row]:
    """Convert the rows of a table, as far as its columns are known."""
    path, report = reader.table.path, reader.report
    numbers = {name: reader.numbers(name, needed=name in ("mismatch_rpm", "force_N"))
               for name in ("mismatch_rpm", "force_N", "force_rise_s", "shift_time_s")}  # fmt: skip
    columns = {
        "row": reader.table.rows, "mismatch": numbers["mismatch_rpm"], "force": numbers["force_N"],
        "rise": numbers["force_rise_s"], "n": reader.counts(), "time": numbers["shift_time_s"],
        "engaged": reader.answers(), "trace": reader.texts("trace"),
    }  # fmt: skip
    rows = [{"file": str(path), **dict(zip(columns, values, strict=True))}
            for values in zip(*columns.values(), strict=True)]  # fmt: skip
    _add_series(reader, rows)
    late = [str(r["row"]) for r in rows if r["engaged"] is False and r["time"] is not None]
    if late:
        report.assumed.append(
            f"{path}: times of shifts that did not engage are left out (row {', '.join(late)})"
        )
    for one in rows:
        one["time"] = None if one["engaged"] is False else one["time"]
    times = [round(1e6 * row["time"]) for row in rows if row["time"] is not None]
    if len(times) > 5 and (step := gcd(*times)) >= COARSE * 1e6:
        report.assumed.append(
            f"{path}: all times are multiples of {number(1e-3 * step)} ms, the step of a clock; "
            "where it rounds up, their mean is half a step too long"
        )
    silent = sum(row["time"] is None and row["engaged"] is None for row in rows)
    if silent:
        report.assumed.append(
            f"{path}: nothing is known of rows without a time ({silent}); a column engaged "
            "with yes and no says which of them were tried and failed"
        )
    return rows


def _add_series(reader: TableReader, rows: list[Row]) -> None:
    """Add spreads, order and time stamps; a column that cannot be read is left out."""
    report, file = reader.report, str(reader.table.path)
    for name in ("shift_time_sd_s", "order", "timestamp"):
        if name not in reader.matches:
            continue
        own = replace(reader, report=Report())
        head, values = own.matches[name].head, []
        try:
            values = own.stamps() if name == "timestamp" else own.numbers(name)
            reason = own.report.faults[0] if own.report.faults else _gap(name, rows, values)
        except DataError as error:
            reason = str(error)
        except InputError as question:
            report.faults.append(f"{file}, column '{head}': {question}")
            continue
        if reason:
            report.left_out.append({"file": file, "column": head, "reason": f"{name}: {reason}"})
            continue
        report.readings += own.report.readings
        report.assumed += own.report.assumed
        for row, value in zip(rows, values, strict=True):
            row[name] = f"{value:.9g}" if isinstance(value, float) else value
            if name == "shift_time_sd_s" and value and (row["n"] < 2 or row["time"] is None):
                row[name] = None
                reason = f"row {row['row']}: {name} without a mean of several shifts"
                report.left_out.append({"file": file, "column": head, "reason": reason})
        if name != "shift_time_sd_s":
            report.assumed.append(
                f"{file}: '{head}' is the order of the shifts, so a diagnosis looks for a drift"
            )


def _gap(name: str, rows: list[Row], values: list[Any]) -> str:
    """Give the reason why a column does not place all shifts in a series, empty where it does."""
    timed = [(r["row"], v) for r, v in zip(rows, values, strict=True) if r["time"] is not None]
    lacking = [row for row, value in timed if value is None]
    if name != "shift_time_sd_s" and lacking:
        return f"it is empty in row {lacking[0]}, but every shift with a time needs its place"
    twice = name == "order" and len({value for _, value in timed}) < len(timed)
    return "a number is there twice, so it is no place in the whole series" if twice else ""


def _set_points(rows: list[Row], draft: BenchDraft, source: Source, report: Report) -> Row:
    """Group measured mismatches and forces at set values, and give their scatter as errors."""
    if any(one.quantity == "points" for one in parse(draft.values.get("corrections", ()))):
        return {}
    errors: Row = {}
    both = [sign * m for m in source.mismatches for sign in (1.0, -1.0)]
    for name, known in (("mismatch", both), ("force", source.forces)):
        found = set_values([row[name] for row in rows], known)
        if found is None:
            continue
        values, size, share = found
        for row, value in zip(rows, values.tolist(), strict=True):
            row[name] = value
        key = "mismatch_rpm" if name == "mismatch" else "force_percent"
        scatter = float(f"{size if name == 'mismatch' else 100.0 * share:.2g}")
        errors[f"errors.each_point.{key}"] = scatter
        levels = ", ".join(map(number, sorted(set(values.tolist()))))
        report.assumed.append(
            f"{name} is measured: {len(rows)} values are grouped at {levels}, with their scatter "
            f"as errors.each_point.{key} = {scatter:g}; --set 'corrections=[\"points=given\"]' "
            "keeps each"
        )
    groups: dict[tuple[float, float], list[Row]] = {}
    for row in rows if errors else []:
        groups.setdefault((row["mismatch"], row["force"]), []).append(row)
    for those in groups.values():
        rises = {row["rise"] for row in those} - {None}
        if len(rises) > 1 and max(rises) < 1.2 * min(rises):
            for row in those:
                row["rise"] = float(f"{fmean(rises):.4g}")
    return errors


def _time_outs(rows: list[Row], draft: BenchDraft, source: Source, report: Report) -> None:
    """Take times at the stated time-out as shifts that did not engage; ask where none is stated."""
    open_ = [row for row in rows if row["time"] is not None and row["engaged"] is None]
    stated = draft.values.get("timeout_s")
    if isinstance(stated, int | float):
        late = [row for row in open_ if 0.999 <= row["time"] / stated <= 1.02]
        for row in late:
            row |= {"time": None, "engaged": False}
        if late:
            report.assumed.append(
                f"times at the time-out of {number(stated)} s are shifts that did not engage (row "
                f"{', '.join(str(row['row']) for row in late)})"
            )
        return
    often = Counter(row["time"] for row in open_)
    if not often:
        return
    most = max(often)
    others = [time for time in often if time < most]
    limit = source.clutch.timeout
    piled = often[most] > 1 and others and most >= 1.5 * max(others)
    mode = often[most] > 2 and others and often[most] > max(often[time] for time in others)
    if piled or mode or abs(most / limit - 1.0) < 1e-6:
        report.faults.append(
            f"the largest time, {number(most)} s, is there {often[most]} times (row "
            f"{next(row['row'] for row in open_ if row['time'] == most)}), as where a stand gives "
            f"up; say --set timeout_s={number(most)} where these shifts did not engage, or a "
            "longer time-out where they did"
        )


def _fill_rises(rows: list[Row], draft: BenchDraft, source: Source, report: Report) -> None:
    lacking = [row for row in rows if row["rise"] is None and row["force"] is not None]
    if not lacking:
        return
    if draft.rise_s is not None:
        for row in lacking:
            row["rise"] = draft.rise_s
        report.assumed.append(f"the force rises in {number(draft.rise_s)} s where no row says it")
        return
    found = {row["force"]: source.rise(row["force"]) for row in lacking}
    for row in lacking:
        row["rise"] = round(found[row["force"]][0], 6)
    times = sorted(rise for rise, _ in found.values())
    said = (
        f"the force rises in {number(times[0])} to {number(times[-1])} s, by its size as in "
        f"'{source.name}'; --rise-s says another time"
    )
    beyond = [force for force, (_, within) in found.items() if not within]
    if beyond:
        said += f"; {number(min(beyond))} to {number(max(beyond))} N lie beyond its forces"
    report.assumed.append(said)


def _copy_trace(row: Row, draft: BenchDraft, report: Report, folder: Path) -> None:
    """Write the trace of a row in the project's units; other files than CSV as they are."""
    said = {k.removeprefix(OF_TRACES): v for k, v in draft.columns.items() if OF_TRACES in k}
    target = folder / "traces"
    path = Path(row["file"]).parent / row["trace"].replace("\\", "/")
    if not path.is_file():
        report.faults.append(
            f"{row['file']}, row {row['row']}: there is no trace {path}; add the file, or empty "
            "the cell"
        )
        return
    target.mkdir(exist_ok=True)
    row["trace"] = f"traces/{path.name}"
    if path.suffix.lower() in (".tdms", *SUFFIXES):
        shutil.copyfile(path, target / path.name)
        return
    row["trace"] = f"traces/{path.stem}.csv"
    try:
        text = _trace_text(path, said, draft.decimal, report)
    except DataError as error:
        report.faults.append(str(error))
        return
    (target / f"{path.stem}.csv").write_text(text, encoding="utf-8")


def _trace_text(path: Path, said: Mapping[str, str], decimal: str | None, report: Report) -> str:
    reader = TableReader.of(read_foreign(path, sums=False), TRACE, said, decimal, own := Report())
    columns = {q.name: reader.numbers(q.name) for q in TRACE if q.name in reader.matches}
    report.faults += own.faults
    report.assumed += [f"traces: {line}" for line in own.assumed]
    report.left_out += [one for one in own.left_out if "row" in one]
    lines = [",".join(columns)]
    for values in zip(*columns.values(), strict=True):
        lines.append(",".join("" if v is None else f"{v:.15g}" for v in values))
    return "\n".join(lines) + "\n"


def _table(rows: list[Row]) -> str:
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n")
    more = [name for name in COLUMNS[7:] if any(row.get(name) is not None for row in rows)]
    writer.writerow((*COLUMNS[:7], *more))
    for row in rows:
        cells = [row["mismatch"], row["force"], row["rise"], row["n"], row["time"]]
        said = "" if row["engaged"] is None else str(row["engaged"]).lower()
        known = ["" if v is None else f"{v:.9g}" for v in cells]
        writer.writerow([*known, said, row["trace"], *(row.get(name) for name in more)])
    return written.getvalue()


def _values(draft: BenchDraft, source: Source, rows: list[Row], out: Path, report: Report) -> Row:
    """Collect the values of ``bench.toml``, and group and complete the rows by them."""
    values: Row = {"name": out.resolve().name, **source.bench_values}
    given, assumed = dict(draft.values), report.assumed
    if draft.tables:
        values |= _set_points(rows, draft, source, report)
        _fill_rises(rows, draft, source, report)
        _time_outs(rows, draft, source, report)
    files = [f"{p.name} (SHA-256 {hashlib.sha256(p.read_bytes()).hexdigest()[:16]})"
             for p in draft.tables]  # fmt: skip
    values["source"] = ", ".join(files) or "not measured yet"
    if "source" in given and files:
        given["source"] = f"{given['source']}; {values['source']}"
    if any(row["trace"] for row in rows):
        assumed.append(
            "the traces' displacement and force are those at the sleeve; [sensor] says otherwise"
        )
    if not any(key.startswith(("dog.", "sliding.", "output.")) for key in given):
        assumed.append(f"dogs, masses and inertias are those of '{source.name}': check bench.toml")
    if not any(key.startswith("contact.") for key in given):
        assumed.append(f"the contact is that of '{source.name}'")
    moved = "" if "sliding.mass_kg" in given else source.moved_along
    assumed += [said for said in (moved, source.left_out) if said]
    if "timeout_s" not in given:
        assumed.append(f"the stand gives up after {number(values['timeout_s'])} s")
    if "mismatch_sense" not in given:
        signed = any(float(row["mismatch"]) < 0.0 for row in rows)
        values["mismatch_sense"] = "known" if signed else "unknown"
        assumed.append(
            "the sign of the mismatch is the project's (docs/mismatch.md), as some are negative"
            if signed
            else "the sense of the mismatch is not known (mismatch_sense); a diagnosis weighs both"
        )
    if "dog.height_mm" in given or "dog.axial_gap_mm" in given:
        tolerance = source.clutch.dog.travel * 1e3 - values["shift_travel_mm"]
        whole = {**values, **given}
        travel = float(whole["dog.height_mm"]) + float(whole["dog.axial_gap_mm"])
        values["shift_travel_mm"] = float(f"{travel - tolerance:.9g}")
    return {**values, **given}


def _examine(folder: Path, rows: list[Row], report: Report) -> None:
    """Add what cannot be true to the faults: slips of whole columns, or else single rows."""
    try:
        stand = load_stand(folder / "bench.toml")
        asked = parse(stand.corrections)
    except DogshapeError as error:
        report.faults.append(str(error).replace(str(folder / "bench.toml"), "bench.toml"))
        return
    sheet = Sheet(folder, tuple(
        SheetRow(r["row"], r["mismatch"], r["force"], r["rise"], r["n"], r["time"], r["engaged"])
        for r in rows
    ))  # fmt: skip
    for correction in asked:
        sheet = corrected(sheet, correction, stand.sensor)
    certain = [f for f in examine(stand, sheet, asked) if f.certain]
    for finding in certain:
        name = SCALED.get(finding.quantity, ("",))[0]
        head = next((r["column"] for r in report.readings if r["quantity"] == name), "")
        option = f"--column {name}='{head}:{finding.way}'"
        if not head:
            option = f"--set 'corrections=[\"{finding.correction}\"]'"
        report.faults.append(finding.with_remedy(f"{option} takes it as that"))
    longest = max((row.time for row in sheet.rows if row.time is not None), default=0.0)
    limit = stand.clutch.timeout
    if not certain and not report.faults and longest > limit:
        report.faults.append(
            f"the longest time is {number(longest)} s, beyond the time-out of {number(limit)} s in "
            "bench.toml; say after which time the stand gives up, such as --set timeout_s="
            f"{ceil(longest)}"
        )
    for given, row in zip(rows, sheet.rows, strict=True):
        if not certain and longest <= limit and (rule := _broken(stand, row)):
            report.faults.append(f"{given['file']}, row {given['row']}: {rule}; correct the row")


def _broken(stand: Stand, row: SheetRow) -> str | None:
    """Return the rule that a row breaks, None where it may be true."""
    try:
        OperatingPoint(row.mismatch * RPM, ForceProfile(row.force, row.rise))
    except InputError as error:
        return str(error).rstrip(".")
    rule = impossible(stand, row)
    if rule is None:
        return None
    plain = rule.partition(" (--correct")[0]
    return f"the shift time is {number(row.time or 0.0)} s, but it must be {plain}"


def _warnings(folder: Path, out: Path) -> list[str]:
    """Read the folder as ``gap`` does, and return its warnings."""
    try:
        bench = load_bench(folder)
    except DogshapeError as error:
        text = re.sub(r"--correct (\S+)", r"""--set 'corrections=["\1"]'""", str(error))
        raise type(error)(text.replace(str(folder), str(out))) from error
    return [finding.sentence for finding in bench.warnings]
