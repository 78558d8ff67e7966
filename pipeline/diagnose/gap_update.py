"""Change of a diagnosis by new readings: before and after, and why in a sentence.

In the folder of the diagnosis stand ``gap.json`` of the last diagnosis, ``gap-0.json`` of the first
one, ``gap-1.json`` of that after the first update, and ``updates.json``, a list of all updates.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.table import Sheet
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN, plain
from dogshape.diagnosis.report.wording import chance, ms
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.errors import StorageError, number
from dogshape.sim.files import write_whole

UPDATES, RECORD, TABLE = "updates.json", "gap.json", "cells.csv"
SHOWN = 0.001  #: probability from which a hypothesis is in the record of an update
MOST_ODDS = 1e6  #: above which odds are said as more than that
Record = dict[str, Any]  #: gap.json


def require_no_updates(folder: Path) -> None:
    """Raise StorageError where a new diagnosis would write over the record of updates."""
    if (folder / UPDATES).is_file():
        raise StorageError(
            f"{folder} holds a diagnosis with updates ({UPDATES}), which a new one would write "
            "over; name another folder for --out, or join readings with 'dogshape gap update'"
        )


def updates_of(folder: Path, count: int) -> list[Record]:
    """Read the first updates of a folder; StorageError for a file that is damaged."""
    path = folder / UPDATES
    if not path.is_file():
        return []
    found = _json(path)
    return list(found)[:count]


def before_of(folder: Path, count: int) -> tuple[Record, dict[tuple[float, float], Record]]:
    """Give the diagnosis before an update: its record, and its operating points by their place.

    Both are kept under the number of updates that were made before.
    """
    for name in (RECORD, TABLE):
        kept, stem, suffix = folder / _kept(name, count), Path(name).stem, Path(name).suffix
        if not kept.is_file():
            source = folder / f"{stem}{suffix}"
            if not source.is_file():
                raise StorageError(
                    f"{source} is missing, so that nothing says what was known before; diagnose "
                    "the data set anew with --out"
                )
            write_whole(kept, source.read_bytes())
    with (folder / _kept(TABLE, count)).open(newline="", encoding="utf-8") as file:
        cells = {_place(row): row for row in csv.DictReader(file)}
    return dict(_json(folder / _kept(RECORD, count))), cells


def write_updates(folder: Path, updates: Sequence[Record]) -> None:
    """Write all updates of a folder."""
    write_whole(folder / UPDATES, json.dumps(list(updates), indent=1, allow_nan=False) + "\n")


def _kept(name: str, count: int) -> str:
    return f"{Path(name).stem}-{count}{Path(name).suffix}"


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise StorageError(
            f"{path} is damaged ({type(error).__name__}); diagnose the data set anew with --out"
        ) from error


def _place(row: Mapping[str, Any]) -> tuple[float, float]:
    return round(float(row["mismatch_rpm"]), 6), round(float(row["force_N"]), 6)


def update_record(
    before: Record,
    cells: Mapping[tuple[float, float], Record],
    found: Diagnosis,
    new: Sheet,
    count: int,
) -> Record:
    """Compare a diagnosis with the one before.

    Parameters
    ----------
    before, cells : record and operating points of the earlier one.
    found : with the new readings.
    new : these alone.
    count : updates that were made before.
    """
    after = found.as_dict()
    points = _points(new, cells)
    return {
        "update": count + 1,
        "file": new.path.name,
        "rows": len(new.rows),
        "shifts": sum(row.n for row in new.rows),
        "points": points,
        "before": _state(before),
        "after": _state(after),
        "sentence": sentence(before, after, points, found.effects),
    }


def _state(record: Record) -> Record:
    return {
        "verdict": record["verdict"],
        "causes": record["causes"],
        "headline": record["headline"],
        "probabilities": {
            " + ".join(one["effects"]) or "none": one["probability"]
            for one in record["hypotheses"]
            if one["probability"] >= SHOWN
        },
    }


def _points(new: Sheet, cells: Mapping[tuple[float, float], Record]) -> list[Record]:
    """List the operating points of new rows: their mean time, and what was predicted of it."""
    groups: dict[tuple[float, float], list[Any]] = {}
    for row in new.rows:
        groups.setdefault((round(row.mismatch, 6), round(row.force, 6)), []).append(row)
    found = []
    for (mismatch, force), rows in groups.items():
        timed = [row for row in rows if row.time is not None]
        n = sum(row.n for row in timed)
        mean = sum(row.n * row.time for row in timed) / n if n else None
        said = cells.get((mismatch, force), {})
        expected = _number(said, "foretold_s", "simulated_s")
        error = _number(said, "foretold_error_s", "simulated_error_s")
        shifts, scatter = _number(said, "shifts"), _number(said, "bench_error_s")
        z = None
        if mean is not None and expected is not None and error is not None and scatter and shifts:
            z = (mean - expected) / math.hypot(error, scatter * math.sqrt(shifts / n))
        found.append(
            {
                "mismatch_rpm": mismatch,
                "force_N": force,
                "shifts": sum(row.n for row in rows),
                "mean_s": mean,
                "foretold_s": expected,
                "z": z,
            }
        )
    return found


def _number(row: Mapping[str, Any], *names: str) -> float | None:
    """Return the first of some columns that has a number."""
    return next((float(row[name]) for name in names if row.get(name)), None)


def sentence(
    before: Record, after: Record, points: Sequence[Record], effects: Mapping[str, Effect]
) -> str:
    """Explain what new readings changed, and why."""
    first, now = _leading(before), _leading(after)
    chances = [_chances(record) for record in (before, after)]
    shifts = sum(point["shifts"] for point in points)
    many = "1 operating point" if len(points) == 1 else f"{len(points)} operating points"
    new = f"the {shifts} new shifts at {many}"
    if first != now:
        moved = (
            f"The answer moves from {plain(first, effects)} ({chance(chances[0][first])} before, "
            f"{chance(chances[1].get(first, 0.0))} now) to {plain(now, effects)} "
            f"({chance(chances[0].get(now, 0.0))} before, {chance(chances[1][now])} now)"
        )
        rival, whose = first, ""
    else:
        rivals = [h for h in chances[0] if h != first and h in _evidences(after)]
        rival, whose = (rivals[0] if rivals else first), ", the next before"
        moved = (
            f"The answer stays {plain(now, effects)}: {chance(chances[0][now])} before, "
            f"{chance(chances[1][now])} now"
        )
    told = _weight(before, after, (now, rival), effects)
    why = "have no known cause to speak for" if told is None else f"speak {told}{whose}"
    if now == UNKNOWN:
        why = "fit no known cause together with the earlier ones"
    return f"{moved}; {new} {why}{_most_missed(points, plain(first, effects))}."


def _weight(
    before: Record,
    after: Record,
    two: tuple[Hypothesis, Hypothesis],
    effects: Mapping[str, Effect],
) -> str | None:
    """Write the odds by which new readings speak for one of two hypotheses, if any do.

    The ratio of evidences with them over that without is their Bayes factor.
    """
    old, new = _evidences(before), _evidences(after)
    now, rival = two
    if now == rival or any(h not in logs for h in two for logs in (old, new)):
        return None
    log = (new[now] - old[now]) - (new[rival] - old[rival])
    better, worse = (plain(h, effects) for h in ((now, rival) if log >= 0.0 else (rival, now)))
    odds = math.exp(min(abs(log), math.log(MOST_ODDS)))
    said = f"{odds:.2g}" if odds < 100.0 else f"{odds:.0f}"
    more = "more than " if abs(log) > math.log(MOST_ODDS) else ""
    return f"{more}{said} : 1 for {better} against {worse}"


def _most_missed(points: Sequence[Record], name: str) -> str:
    """Name the operating point whose new mean lies farthest from what was predicted."""
    those = [point for point in points if point["z"] is not None]
    if not those:
        return ""
    one = max(those, key=lambda point: abs(point["z"]))
    return (
        f"; at {number(one['mismatch_rpm'])} 1/min and {number(one['force_N'])} N they took "
        f"{ms(one['mean_s'])}, where {name} foretold {ms(one['foretold_s'])} "
        f"({one['z']:+.1f} standard errors)"
    )


def _leading(record: Record) -> Hypothesis:
    return tuple(record["hypotheses"][0]["effects"])


def _chances(record: Record) -> dict[Hypothesis, float]:
    return {tuple(one["effects"]): one["probability"] for one in record["hypotheses"]}


def _evidences(record: Record) -> dict[Hypothesis, float]:
    return {
        tuple(one["effects"]): one["log_evidence"]
        for one in record["hypotheses"]
        if one.get("log_evidence") is not None and tuple(one["effects"]) != UNKNOWN
    }
