"""A bank as one small file, so that a diagnosis need not read a journal of shifts again.

The journal holds every shift and is what an unfinished bank goes on from. The file holds the
times alone, and the key of what they are times of: all inputs of the bank's shifts and the versions
of the programs. With another key it counts for nothing.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from diagnosis.bank import Bank, Plan, blocks_of, collect, settings_of
from diagnosis.bench import Bench
from diagnosis.levels import Level
from sim.errors import StorageError
from sim.numerical import Runner
from sim.records import Record, content_key
from sim.versions import engine

Array = NDArray[np.float64]
Times = list[float | None]

LATE = -1.0  #: stands for a shift that did not engage


def bank_for(plan: Plan, bench: Bench, run: Runner, path: Path | None = None) -> Bank:
    """Return the bank of a bench from ``path``, or else simulate it and write it there.

    Raises StorageError where the file cannot be read or written.
    """
    key = key_of(plan, bench)
    if path is not None and path.exists():
        record = _read(path)
        if record.get("key") == key:
            return bank_of(record, plan, bench, path)
    bank = collect(plan, bench, run)
    if path is not None:
        _write(path, {"key": key, **bank_record(bank)})
    return bank


def key_of(plan: Plan, bench: Bench) -> str:
    """Return the key of all inputs of a bank's shifts, of how they are read, and of versions."""
    first = [block.only([0]).keys[0] for block in blocks_of(plan, bench)]
    read = [effect.name for effect in plan.effects]
    numbers = [plan.angles, plan.dense, plan.seed, bench.sensor.displacement_at]
    return content_key({"shifts": first, "effects": read, "plan": numbers, **engine()})


def bank_record(bank: Bank) -> Record:
    """Return the times of a bank as JSON takes them; None failed, ``LATE`` did not engage."""
    return {
        "angles_rad": bank.angles.tolist(),
        "common": bank.common.tolist(),
        "baseline_s": [_plain(row) for row in bank.baseline],
        "levels": [
            {
                "effects": list(level.hypothesis),
                "values": list(level.values),
                "times_s": [_plain(row) for row in times],
            }
            for level, times in zip(bank.levels, bank.times, strict=True)
        ],
        "numerics": list(bank.numerics),
    }


def bank_of(record: Record, plan: Plan, bench: Bench, path: Path) -> Bank:
    """Return the bank that a record of ``path`` holds; StorageError where it is none."""
    try:
        levels = tuple(Level(tuple(r["effects"]), tuple(r["values"])) for r in record["levels"])
        angles = np.array(record["angles_rad"], dtype=float)
        common = np.array(record["common"], dtype=np.int64)
        times = [[_times(row) for row in r["times_s"]] for r in record["levels"]]
        mean, scatter = record["numerics"]
        return Bank(
            effects=plan.effects,
            settings=settings_of(bench),
            angles=angles,
            common=common,
            baseline=np.array([_times(row) for row in record["baseline_s"]]),
            levels=levels,
            times=np.array(times).reshape(len(levels), *common.shape),
            numerics=(float(mean), float(scatter)),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise StorageError(f"{path} is not a bank of shifts; remove it to make it again") from error


def _plain(times: Array) -> Times:
    return [None if np.isnan(t) else LATE if np.isinf(t) else float(t) for t in times]


def _times(row: Times) -> Array:
    return np.array([np.nan if t is None else np.inf if t == LATE else t for t in row])


def _read(path: Path) -> Record:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StorageError(
            f"{path} cannot be read as a bank of shifts ({type(error).__name__}); remove it to "
            "make it again"
        ) from error
    return found if isinstance(found, dict) else {}


def _write(path: Path, record: Record) -> None:
    """Write a file as a whole or not at all."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(json.dumps(record), encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        raise StorageError(
            f"{path} cannot be written ({error.strerror}); make room or give another folder"
        ) from error
