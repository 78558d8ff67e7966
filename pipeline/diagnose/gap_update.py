"""Update of a diagnosis by new readings: its data set, both answers, and the Bayes factor.

The folder of a diagnosis holds ``gap.json``, that of earlier diagnoses (``gap-0.json`` and so on),
``updates.json``, and ``data`` with the data set and ``asked.json``. New readings are joined in
``joining``, which takes the place of ``data`` once the new diagnosis is written. So a run that is
stopped leaves the folder as it was, or finished.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
from pydantic import BaseModel

from dogshape.bench.bench_data import Bench, corrected_sheet, load_bench, readings_of
from dogshape.bench.raw_sheet import file_of
from dogshape.bench.slips import examine, require_no_slip
from dogshape.bench.stand_file import load_stand
from dogshape.bench.table import COLUMNS, NUMERIC, Sheet
from dogshape.bench.texts import read_table
from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.inference.verdict import CauseVerdict, Kind
from dogshape.diagnosis.report.wording import chance, headline_of
from dogshape.diagnosis.terms import UNKNOWN, Hypothesis, hypothesis_name
from dogshape.pipeline.record import Record
from dogshape.sim.clutch_tables import key
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.interface import argument, verb

DATA = "data"
JOINING = "joining"
PREVIOUS_DATA = "data.before"
REQUEST = "asked.json"
UPDATES = "updates.json"
RECORD = "gap.json"
TABLE = "cells.csv"
COPY_LENGTH = 8  #: successive rows equal to rows of the bench, which then are copies
MIN_DISTINCT = 5  #: distinct rows in a copy: a stand may repeat few values
MIN_PROBABILITY = 0.001  #: of a hypothesis in the record of an update
MAX_ODDS = 1e5  #: largest odds in a sentence
T = TypeVar("T")


class HypothesisRecord(BaseModel):
    """Keys of a hypothesis in ``gap.json`` that an update compares; others are ignored."""

    effects: tuple[str, ...]
    probability: float  #: posterior
    evidence_probability: float  #: by the evidence alone


class DiagnosisRecord(BaseModel):
    """Keys of ``gap.json`` that an update compares; others are ignored."""

    engine: str
    verdict: Kind
    causes: list[str]
    credible_set: list[tuple[str, ...]]
    hypotheses: list[HypothesisRecord]  #: the most probable first

    @property
    def probabilities(self) -> dict[Hypothesis, float]:
        """Posterior probabilities of the hypotheses."""
        return {entry.effects: entry.probability for entry in self.hypotheses}

    @property
    def evidence(self) -> dict[Hypothesis, float]:
        """Probabilities of the hypotheses by the evidence alone."""
        return {entry.effects: entry.evidence_probability for entry in self.hypotheses}


class DiagnosisState(Record):
    """Answer of a diagnosis before or after new readings."""

    verdict: str = key("`effect`, `none`, `unknown` or `ambiguous`")
    causes: list[str] = key("effects of the verdict")
    headline: str = key("verdict in words")
    probabilities: dict[str, float] = key("of the hypotheses of at least 0.001", "1")


class UpdateRecord(Record):
    """Update of a diagnosis, an entry of ``updates.json``."""

    update: int = key("number of the update, from 1")
    file: str = key("table of the new readings")
    rows: int = key("rows of the table")
    shifts: int = key("shifts of these rows")
    before: DiagnosisState = key("answer without the new readings")
    after: DiagnosisState = key("answer with them")
    sentence: str = key("change of the leading hypothesis, and Bayes factor of the new readings")


@dataclass(frozen=True)
class Request:
    """Request of a diagnosis besides its data; its fields are the keys of ``asked.json``."""

    corrections: Sequence[str]
    effects: str | None  #: folder of the user's own effects
    joined: Sequence[str]  #: digests of the files of earlier updates

    def write(self, folder: Path) -> None:
        """Write to the folder of the data."""
        write_whole(folder / REQUEST, json.dumps(vars(self), indent=1) + "\n")


def settle_data(folder: Path) -> None:
    """Replace the data of a diagnosis by joined data; a stop leaves ``PREVIOUS_DATA``."""
    data = folder / DATA
    previous_data = folder / PREVIOUS_DATA
    shutil.rmtree(previous_data, ignore_errors=True)
    if data.is_dir():
        os.replace(data, previous_data)
    os.replace(folder / JOINING, data)
    shutil.rmtree(previous_data, ignore_errors=True)


def keep_data(bench: Bench, folder: Path, effects: Path | None) -> None:
    """Copy the data set of a diagnosis into its folder; a set that was made in memory has none."""
    if bench.folder is None:
        return
    target = folder / JOINING
    shutil.rmtree(target, ignore_errors=True)
    names = [Path("bench.toml"), Path("shifts.csv")]
    for reading in bench.readings:
        if reading.trace is not None:
            names.append(reading.trace.path.relative_to(bench.folder))
    for name in names:
        _copy(bench.folder / name, target / name)
    effects_folder = None if effects is None else str(effects.resolve())
    Request(bench.corrections, effects_folder, ()).write(target)
    settle_data(folder)


def read_request(folder: Path) -> Request:
    """Read the request of the diagnosis in a folder; StorageError where its data are missing."""
    data = folder / DATA
    if not data.is_dir() and (folder / PREVIOUS_DATA).is_dir():
        os.replace(folder / PREVIOUS_DATA, data)  # an update was stopped between two names
    path = data / REQUEST
    if not path.is_file():
        raise StorageError(
            f"{folder} holds no diagnosis with its data; make it with "
            f"{verb('diagnose', 'BENCH', out=str(folder))}"
        )
    return _read_json(path, lambda content: Request(**content))


def join_readings(folder: Path, new: Path, request: Request) -> tuple[Bench, Sheet]:
    """Join new readings to the data of a diagnosis in its folder; ``settle_data`` is to follow.

    Parameters
    ----------
    folder
        Folder of the diagnosis.
    new
        Table with the columns and units of ``shifts.csv``.
    request
        Request of the diagnosis; its corrections apply to the new readings too.

    Returns
    -------
    bench
        Data set with the new readings.
    sheet
        New readings alone.

    Raises
    ------
    DataError
        For a table that is wrong, has slips of units, has joined before, repeats rows, or has set
        values that are nearly those of the bench.

    """
    digest = _new_digest(new, request)
    data = folder / DATA
    target = folder / JOINING
    stand = load_stand(data / "bench.toml")
    sheet, corrections = corrected_sheet(stand, new, request.corrections)
    bench_sheet, _ = corrected_sheet(stand, data / "shifts.csv", request.corrections)
    joint_sheet = replace(sheet, rows=(*bench_sheet.rows, *sheet.rows))
    for examined_sheet in (sheet, joint_sheet):
        remedy = "write them as the data set of the diagnosis has them"
        require_no_slip(str(new), examine(stand, examined_sheet, corrections), remedy)
    readings_of(stand, sheet, corrections)
    _require_no_copies(bench_sheet, sheet)
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(data, target)
    traces = Path("traces") / f"update-{len(request.joined) + 1}"
    bench_table = _read_frame(data / "shifts.csv")
    new_table = _read_frame(new)
    for name in filter(None, new_table.trace):
        _copy(new.parent / name, target / traces / name)
    new_table["trace"] = [name and (traces / name).as_posix() for name in new_table.trace]
    write_whole(target / "shifts.csv", _joint_text(bench_table, new_table))
    replace(request, joined=(*request.joined, digest)).write(target)
    return load_bench(target, request.corrections), sheet


def _new_digest(new: Path, request: Request) -> str:
    """Compute the digest of a table; DataError if unreadable or joined before."""
    try:
        digest = hashlib.sha256(file_of(new).read_bytes()).hexdigest()[:16]
    except OSError as error:
        rule = "name a table with the columns of shifts.csv"
        raise DataError(f"{new} cannot be read ({error.strerror}); {rule}") from error
    if digest in request.joined:
        number = request.joined.index(digest) + 1
        raise DataError(
            f"{new} joined this diagnosis already (update {number}), and copies would count as "
            "shifts of their own; give new readings"
        )
    return digest


def _read_frame(path: Path) -> pd.DataFrame:
    """Read a table of shifts as text with all columns of ``shifts.csv``, empty if missing."""
    table = read_table(path, NUMERIC, COLUMNS)
    frame = pd.DataFrame([cells for _, cells in table.rows], columns=[*table.head])
    return frame.reindex(columns=[*COLUMNS], fill_value="")


def _joint_text(bench_table: pd.DataFrame, new_table: pd.DataFrame) -> str:
    """Write the rows of a bench and new rows, which follow in the series, as a table.

    An order or timestamp that some timed rows lack is left out of all rows.
    """
    last_order = max(map(float, filter(None, bench_table.order)), default=0.0)
    if last_order:
        new_table = new_table.assign(
            order=[order and f"{last_order + float(order):.9g}" for order in new_table.order]
        )
    rows = pd.concat([bench_table, new_table])
    timed_rows = rows[rows.shift_time_s != ""]
    incomplete = [name for name in ("order", "timestamp") if (timed_rows[name] == "").any()]
    return rows.assign(**dict.fromkeys(incomplete, "")).to_csv(index=False, lineterminator="\n")


def _copy(source: Path, target: Path) -> None:
    """Copy a file; make its folder."""
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, target)


def _require_no_copies(bench_sheet: Sheet, new_sheet: Sheet) -> None:
    """Raise DataError where a mean, or some successive rows, are rows of the bench."""
    is_stamped = all(row.timestamp is not None for row in (*bench_sheet.rows, *new_sheet.rows))

    def values(sheet: Sheet) -> list[tuple[Any, ...]]:
        return [
            (
                row.mismatch,
                row.force,
                row.rise,
                row.n,
                row.time,
                row.sd,
                is_stamped and row.timestamp,
            )
            for row in sheet.rows
        ]

    bench_values = values(bench_sheet)
    new_values = values(new_sheet)
    bench_runs = {
        tuple(bench_values[start : start + COPY_LENGTH])
        for start in range(len(bench_values) - COPY_LENGTH + 1)
    }
    for index, row in enumerate(new_sheet.rows):
        run = tuple(new_values[index : index + COPY_LENGTH])
        is_copied_run = run in bench_runs and len(set(run)) >= MIN_DISTINCT
        is_copied_mean = row.n > 1 and row.time and new_values[index] in bench_values
        if is_copied_run or is_copied_mean:
            raise DataError(
                f"{new_sheet.path}: rows from row {row.row} on repeat rows of the bench, and "
                "copies would count as shifts of their own; leave them out (a timestamp in each "
                "row of bench and table distinguishes shifts with equal times)"
            )


def require_no_updates(folder: Path) -> None:
    """Raise StorageError where a new diagnosis would replace the record of updates."""
    if (folder / UPDATES).is_file():
        raise StorageError(
            f"{folder} holds a diagnosis with updates ({UPDATES}), which a new one would replace; "
            f"name another folder for {argument('out')}, or join readings with "
            f"{verb('update-diagnosis')}"
        )


def keep_previous(folder: Path, count: int) -> DiagnosisRecord:
    """Copy the record of the diagnosis before an update to a numbered file, and return it.

    ``count`` is the number of earlier updates.
    """
    for name in (TABLE, RECORD):
        copy = folder / name.replace(".", f"-{count}.")
        if not copy.is_file():
            if not (folder / name).is_file():
                raise StorageError(
                    f"{folder / name}, the record of the diagnosis, is missing; diagnose the data "
                    f"set again with {argument('out')}"
                )
            write_whole(copy, (folder / name).read_bytes())
    return _read_json(copy, DiagnosisRecord.model_validate)


def add_update(folder: Path, record: UpdateRecord, count: int) -> dict[str, str]:
    """Write an update after the first ``count`` ones; return all sentences by ``update N``."""
    path = folder / UPDATES
    updates: list[UpdateRecord] = []
    if path.is_file():
        updates = _read_json(path, lambda entries: [UpdateRecord(**entry) for entry in entries])
    updates = [*updates[:count], record]
    entries = [update.to_dict() for update in updates]
    write_whole(path, json.dumps(entries, indent=1, allow_nan=False) + "\n")
    return {f"update {update.update}": update.sentence for update in updates}


def _read_json(path: Path, kind: Callable[[Any], T]) -> T:
    """Read a JSON file, and convert it by ``kind``; StorageError for a damaged file."""
    try:
        return kind(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise StorageError(
            f"{path} is damaged ({type(error).__name__}); diagnose the data set again "
            f"with {argument('out')}"
        ) from error


def update_record(
    before: DiagnosisRecord, diagnosis: Inference, new: Sheet, count: int
) -> UpdateRecord:
    """Compare a diagnosis with the record before new readings, made after ``count`` updates."""
    after = DiagnosisRecord(**diagnosis.to_dict())
    return UpdateRecord(
        update=count + 1,
        file=new.path.name,
        rows=len(new.rows),
        shifts=sum(row.n for row in new.rows),
        before=_state(before, diagnosis.effects),
        after=_state(after, diagnosis.effects),
        sentence=sentence(before, after, diagnosis.effects),
    )


def _state(record: DiagnosisRecord, effects: Mapping[str, Effect]) -> DiagnosisState:
    """Summarise the record of a diagnosis: verdict, causes and probable hypotheses."""
    verdict = CauseVerdict(record.verdict, record.causes, record.credible_set)
    probabilities = {}
    for hypothesis, probability in record.probabilities.items():
        if probability >= MIN_PROBABILITY:
            probabilities[" + ".join(hypothesis) or "none"] = probability
    return DiagnosisState(
        verdict=record.verdict,
        causes=record.causes,
        headline=headline_of(verdict, effects),
        probabilities=probabilities,
    )


def sentence(before: DiagnosisRecord, after: DiagnosisRecord, effects: Mapping[str, Effect]) -> str:
    """State the change of the leading hypothesis, and the Bayes factor of the new readings."""
    old = before.probabilities
    new = after.probabilities
    old_first = next(iter(old))
    new_first = next(iter(new))
    answers = [
        f"{hypothesis_name(h, effects)} "
        f"({chance(old.get(h, 0.0))} before, {chance(new.get(h, 0.0))} now)"
        for h in dict.fromkeys((old_first, new_first))
    ]
    verb = "stays" if old_first == new_first else "moves from"
    change = f"The answer {verb} {' to '.join(answers)}"
    rival = old_first
    if old_first == new_first:
        rival = next((h for h in old if h not in (new_first, UNKNOWN)), new_first)
    if rival == new_first or UNKNOWN in (new_first, rival):
        return f"{change}."
    odds = _bayes_factor(before, after, new_first, rival=rival)
    if odds is None:
        return f"{change}."
    better, worse = (new_first, rival) if odds >= 1.0 else (rival, new_first)
    odds = round(min(max(odds, 1.0 / odds), MAX_ODDS), 1)
    return (
        f"{change}; the new shifts alone are {odds:g} : 1 for {hypothesis_name(better, effects)} "
        f"against {hypothesis_name(worse, effects)}."
    )


def _bayes_factor(
    before: DiagnosisRecord, after: DiagnosisRecord, hypothesis: Hypothesis, rival: Hypothesis
) -> float | None:
    """Compute the Bayes factor of the new readings for a hypothesis; None without evidence."""
    old = before.evidence
    new = after.evidence
    new_evidence, old_evidence = new.get(hypothesis, 0.0), old.get(hypothesis, 0.0)
    new_rival, old_rival = new.get(rival, 0.0), old.get(rival, 0.0)
    if min(new_evidence, old_evidence, new_rival, old_rival) <= 0.0:
        return None
    return new_evidence / new_rival * old_rival / old_evidence
