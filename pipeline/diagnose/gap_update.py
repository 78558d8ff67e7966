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

from dogshape.diagnosis.bench.bench_data import Bench, corrected_sheet, load_bench, readings_of
from dogshape.diagnosis.bench.slips import examine, require_no_slip
from dogshape.diagnosis.bench.stand_file import load_stand
from dogshape.diagnosis.bench.table import COLUMNS, NUMERIC, Sheet
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.verdict import Verdict
from dogshape.diagnosis.report.wording import chance, headline_of
from dogshape.diagnosis.terms import UNKNOWN, Hypothesis, plain
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.texts import file_of, read_table

DATA, JOINING, BEFORE, ASKED = "data", "joining", "data.before", "asked.json"
UPDATES, RECORD, TABLE = "updates.json", "gap.json", "cells.csv"
COPIED = 8  #: equal rows in a row, from which on they are copies
DIFFERENT = 5  #: of these that differ from each other: a stand may repeat few values
SHOWN = 0.001  #: probability from which a hypothesis is in the record of an update
MOST_ODDS = 1e5  #: largest odds that are said
Record = dict[str, Any]  #: gap.json
T = TypeVar("T")


@dataclass(frozen=True)
class Asked:
    """Request of a diagnosis beside its data, and digests of the files that joined since."""

    corrections: Sequence[str]
    effects: str | None
    joined: Sequence[str]

    def write(self, folder: Path) -> None:
        """Write to the folder of the data."""
        write_whole(folder / ASKED, json.dumps(vars(self), indent=1) + "\n")


def settle_data(folder: Path) -> None:
    """Give joined data the place of the earlier ones; a stop between leaves ``BEFORE``."""
    data, before = folder / DATA, folder / BEFORE
    shutil.rmtree(before, ignore_errors=True)
    if data.is_dir():
        os.replace(data, before)
    os.replace(folder / JOINING, data)
    shutil.rmtree(before, ignore_errors=True)


def keep_data(bench: Bench, folder: Path, effects: Path | None) -> None:
    """Copy the data set of a diagnosis into its folder; a set that was made in memory has none."""
    if bench.folder is None:
        return
    fresh = folder / JOINING
    shutil.rmtree(fresh, ignore_errors=True)
    traces = [r.trace.path.relative_to(bench.folder) for r in bench.readings if r.trace is not None]
    for name in (Path("bench.toml"), Path("shifts.csv"), *traces):
        _copy(bench.folder / name, fresh / name)
    Asked(bench.corrections, None if effects is None else str(effects.resolve()), ()).write(fresh)
    settle_data(folder)


def asked_of(folder: Path) -> Asked:
    """Read the request of the diagnosis in a folder; StorageError where it has no whole data."""
    data = folder / DATA
    if not data.is_dir() and (folder / BEFORE).is_dir():
        os.replace(folder / BEFORE, data)  # stopped between two names
    path = data / ASKED
    if not path.is_file():
        raise StorageError(
            f"{folder} holds no diagnosis with its data; make it with: dogshape gap BENCH_DIR "
            f"--out {folder}"
        )
    return _json(path, lambda found: Asked(**found))


def joined(folder: Path, new: Path, asked: Asked) -> tuple[Bench, Sheet]:
    """Join new readings to the data of a diagnosis: the data set, not yet settled, and these alone.

    ``new`` has the columns and units of ``shifts.csv``; the corrections of the data set apply.
    Raises DataError for a table that is wrong, has slips of units, has joined before, repeats rows,
    or has set values that are nearly those of the bench.
    """
    try:
        digest = hashlib.sha256(file_of(new).read_bytes()).hexdigest()[:16]
    except OSError as error:
        rule = "name a table with the columns of shifts.csv"
        raise DataError(f"{new} cannot be read ({error.strerror}); {rule}") from error
    if digest in asked.joined:
        place = asked.joined.index(digest) + 1
        raise DataError(
            f"{new} joined this diagnosis already (update {place}), and copies would count as "
            "shifts of their own; give new readings"
        )
    data, target = folder / DATA, folder / JOINING
    stand = load_stand(data / "bench.toml")
    sheet, corrections = corrected_sheet(stand, new, asked.corrections)
    held, _ = corrected_sheet(stand, data / "shifts.csv", asked.corrections)
    for one in (sheet, replace(sheet, rows=(*held.rows, *sheet.rows))):
        remedy = "write them as the data set of the diagnosis has them"
        require_no_slip(str(new), examine(stand, one, corrections), remedy)
    readings_of(stand, sheet, corrections)
    _require_no_copies(held, sheet)
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(data, target)
    own = Path("traces") / f"update-{len(asked.joined) + 1}"
    before, added = (
        pd.DataFrame([cells for _, cells in table.rows], columns=[*table.head]).reindex(
            columns=[*COLUMNS], fill_value=""
        )
        for table in (read_table(path, NUMERIC, COLUMNS) for path in (data / "shifts.csv", new))
    )
    for name in filter(None, added["trace"]):
        _copy(new.parent / name, target / own / name)
    added["trace"] = [name and (own / name).as_posix() for name in added["trace"]]
    # New rows stand behind the series; where only some rows say their place, none does.
    if last := max(map(float, filter(None, before["order"])), default=0.0):
        added["order"] = [place and f"{last + float(place):.9g}" for place in added["order"]]
    rows = pd.concat([before, added])
    timed = rows[rows["shift_time_s"] != ""]
    lacking = [name for name in ("order", "timestamp") if (timed[name] == "").any()]
    text = rows.assign(**dict.fromkeys(lacking, "")).to_csv(index=False, lineterminator="\n")
    write_whole(target / "shifts.csv", text)
    replace(asked, joined=(*asked.joined, digest)).write(target)
    return load_bench(target, asked.corrections), sheet


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, target)


def _require_no_copies(held: Sheet, new: Sheet) -> None:
    """Raise DataError where a mean, or some rows in a row, are rows of the bench."""
    stamped = all(row.timestamp is not None for one in (held, new) for row in one.rows)
    ours, theirs = (
        [
            (row.mismatch, row.force, row.rise, row.n, row.time, row.sd, stamped and row.timestamp)
            for row in one.rows
        ]
        for one in (held, new)
    )
    known = {tuple(ours[k : k + COPIED]) for k in range(len(ours) - COPIED + 1)}
    for k, row in enumerate(new.rows):
        run = tuple(theirs[k : k + COPIED])
        copied = run in known and len(set(run)) >= DIFFERENT
        if copied or (row.n > 1 and row.time and theirs[k] in ours):
            raise DataError(
                f"{new.path}: rows from row {row.row} on repeat rows of the bench, and copies "
                "would count as shifts of their own; leave them out (a timestamp in each row of "
                "bench and table distinguishes shifts with equal times)"
            )


def require_no_updates(folder: Path) -> None:
    """Raise StorageError where a new diagnosis would replace the record of updates."""
    if (folder / UPDATES).is_file():
        raise StorageError(
            f"{folder} holds a diagnosis with updates ({UPDATES}), which a new one would replace; "
            "name another folder for --out, or join readings with 'dogshape gap update'"
        )


def before_of(folder: Path, count: int) -> Record:
    """Read the diagnosis before an update; it is kept under the number of earlier updates."""
    for name in (TABLE, RECORD):
        kept = folder / name.replace(".", f"-{count}.")
        if not kept.is_file():
            if not (folder / name).is_file():
                raise StorageError(
                    f"{folder / name}, the record of the diagnosis, is missing; diagnose the data "
                    "set again with --out"
                )
            write_whole(kept, (folder / name).read_bytes())
    return _json(kept, dict)


def add_update(folder: Path, record: Record, count: int) -> dict[str, str]:
    """Write an update after the first ``count`` ones; give the sentence of each by its name."""
    path = folder / UPDATES
    updates = [*(_json(path, list)[:count] if path.is_file() else []), record]
    write_whole(path, json.dumps(updates, indent=1, allow_nan=False) + "\n")
    return {f"update {one['update']}": one["sentence"] for one in updates}


def _json(path: Path, kind: Callable[[Any], T]) -> T:
    try:
        return kind(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError) as error:
        raise StorageError(
            f"{path} is damaged ({type(error).__name__}); diagnose the data set again with --out"
        ) from error


def update_record(before: Record, found: Diagnosis, new: Sheet, count: int) -> Record:
    """Compare a diagnosis with the record before new readings, made after ``count`` updates."""
    after = found.to_dict()
    return {
        "update": count + 1,
        "file": new.path.name,
        "rows": len(new.rows),
        "shifts": sum(row.n for row in new.rows),
        "before": _state(before, found.effects),
        "after": _state(after, found.effects),
        "sentence": sentence(before, after, found.effects),
    }


def _state(record: Record, effects: Mapping[str, Effect]) -> Record:
    kind, causes = record["verdict"], record["causes"]
    said = headline_of(Verdict(kind, causes, [*map(tuple, record["credible_set"])]), effects)
    likely = {" + ".join(h) or "none": p for h, p in _chances(record).items() if p >= SHOWN}
    return {"verdict": kind, "causes": causes, "headline": said, "probabilities": likely}


def _chances(record: Record, key: str = "probability") -> dict[Hypothesis, float]:
    return {tuple(one["effects"]): one[key] for one in record["hypotheses"]}


def sentence(before: Record, after: Record, effects: Mapping[str, Effect]) -> str:
    """State the change of the leading hypothesis, and the Bayes factor of the new readings."""
    old, new = _chances(before), _chances(after)
    first, now = next(iter(old)), next(iter(new))
    rival = first if first != now else next((h for h in old if h not in (now, UNKNOWN)), now)
    sides = [
        f"{plain(h, effects)} ({chance(old.get(h, 0.0))} before, {chance(new.get(h, 0.0))} now)"
        for h in dict.fromkeys((first, now))
    ]
    moved = f"The answer {'stays' if first == now else 'moves from'} {' to '.join(sides)}"
    evidence = [_chances(record, "evidence_probability") for record in (after, before)]
    mine, theirs = ([one.get(h, 0.0) for one in evidence] for h in (now, rival))
    if now == rival or UNKNOWN in (now, rival) or min(*mine, *theirs) <= 0.0:
        return f"{moved}."
    odds = mine[0] / theirs[0] * theirs[1] / mine[1]
    better, worse = (plain(h, effects) for h in ((now, rival) if odds >= 1.0 else (rival, now)))
    odds = round(min(max(odds, 1.0 / odds), MOST_ODDS), 1)
    return f"{moved}; the new shifts alone are {odds:g} : 1 for {better} against {worse}."
