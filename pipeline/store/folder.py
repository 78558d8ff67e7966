"""The folder of a study: manifest, trials, journal of shifts, surrogate, report; one writer.

The journal has one JSON line for every finished simulation. Workers append one at a time, under a
lock of the operating system's. What a kill or a full disk left of a line is not read, and cut off
before the next one is written.

A shift that the clock ended, on a machine that was too busy, is a result of this run alone: it
is in memory, not in the file, and the next run simulates it again.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from sys import intern
from tempfile import TemporaryFile
from typing import Any

from dogshape.pipeline.config.schema import FORMAT, StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study
from dogshape.pipeline.progress import Say
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import StorageError
from dogshape.sim.files import sync_folder, write_whole
from dogshape.sim.statistics.shift_records import Record, landing_of, result_of, unfinished
from dogshape.sim.versions import versions

WRITE_AGAIN = "run 'dogshape study' with --resume to write it again"  #: remedy


_KEY = re.compile(rb'"key": "([^"]*)"')


class ShiftJournal:
    """Shifts by their content key: those that are finished on disk too."""

    def __init__(self, path: Path) -> None:
        self.path = path.absolute()  # workers may stand in another folder
        self.rows: dict[str, Record] = {}
        self.read_new()

    def read_new(self) -> list[Record]:
        """Read what workers wrote and did not hand over; return the rows that are new."""
        rows = read_lines(self.path, lambda r: (result_of(r), landing_of(r)), "a finished shift")
        new = {row["key"]: row for row in rows if row["key"] not in self.rows}
        self.rows.update(new)
        return list(new.values())

    def sync(self) -> None:
        """Put what is written on the disk; from now on a power cut leaves it."""
        if self.path.exists():
            sync(self.path)

    def drop(self, keys: Collection[str]) -> None:
        """Remove shifts whose results are stored elsewhere; StorageError as ``append``.

        A kill leaves the file before or after, whole; lines of other processes stay.
        """
        with _alone_in(self.path):
            content = self.path.read_bytes()
            lines = content[: content.rfind(b"\n") + 1].splitlines(keepends=True)
            found = ((line, _KEY.search(line)) for line in lines)  # to parse lines takes far longer
            left = [line for line, key in found if not (key and key[1].decode() in keys)]
            write_whole(self.path, b"".join(left))
        self.rows = {key: row for key, row in self.rows.items() if key not in keys}

    def say_unfinished(self, say: Say) -> None:
        """Report the number of shifts that the clock ended, if any."""
        if ended := sum(map(unfinished, self.rows.values())):
            say(
                f"{ended} of the shifts failed at solver.time_limit_s, as on a busy machine; "
                "they are not kept"
            )


def read_lines(path: Path, require: Callable[[Record], Any], kind: str) -> Iterator[Record]:
    """Yield the whole lines of a file; StorageError for one that ``require`` raises at."""
    with path.open("rb") if path.exists() else BytesIO() as file:
        for number, line in enumerate(file, start=1):
            if not line.endswith(b"\n"):
                return
            try:
                # Keys are in memory once for all rows.
                row = json.loads(line, object_pairs_hook=lambda p: {intern(k): v for k, v in p})
                require(row)
            except (ValueError, KeyError, TypeError) as error:
                remedy = "remove the line or give another folder"
                raise StorageError(f"{path}, line {number} is not {kind}; {remedy}") from error
            yield row


def append(path: Path, *rows: Record) -> None:
    """Append finished shifts, all of them or none; those that the clock ended are left out.

    Raises StorageError where there is no room or no right to write.
    """
    kept = [row for row in rows if not unfinished(row)]
    lines = "".join(json.dumps(row, allow_nan=False) + "\n" for row in kept).encode()
    with _alone_in(path) as descriptor:
        end = os.fstat(descriptor).st_size
        if end and os.pread(descriptor, 1, end - 1) != b"\n":
            end = os.pread(descriptor, end, 0).rfind(b"\n") + 1
            os.ftruncate(descriptor, end)
        try:
            while lines:  # a disk that fills up takes a part first and then refuses
                lines = lines[os.write(descriptor, lines) :]
        except OSError:
            os.ftruncate(descriptor, end)
            raise


def sync(path: Path) -> None:
    """Put what is written to a file on the disk; StorageError as ``append``."""
    with _alone_in(path) as descriptor:
        os.fsync(descriptor)
        sync_folder(path.parent)


@contextmanager
def _alone_in(path: Path) -> Iterator[int]:
    """Open a file for appending and hold its lock, which ends with the process.

    Who waited while the file was exchanged (``ShiftJournal.drop``) takes the new one.
    """
    try:
        while True:
            descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX)
                if path.exists() and os.path.samestat(os.stat(path), os.fstat(descriptor)):
                    yield descriptor
                    return
            finally:
                os.close(descriptor)
    except OSError as error:
        raise StorageError(
            f"{path} cannot be written ({error.strerror}); the shifts before are kept: make room "
            "or give the right to write, and run the command again to go on"
        ) from error


class StudyFolder:
    """Paths of a study's results, and the rules for opening them."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.manifest = root / "study.json"  # study file as it was run, hashes and versions
        self.trials = root / "trials.log"  # Optuna's journal
        self.running = root / "running.jsonl"  # shifts of designs under way
        self.shifts = root / "shifts.jsonl"  # shifts of Drake: kept
        self.result = root / "result.json"  # front, best design, confirmation and audit
        self.rows = root / "rows.json"  # what the surrogate learns of a search
        self.surrogate = root / "surrogate.json"  # the surrogate with its data
        self.points = root / "points.csv"  # its data as a table
        self.simulated = root / "simulated.jsonl"  # rows of each design of a fit
        self.chosen = root / "chosen.json"  # those chosen as likely to be among the best
        self.effects = root / "effects.json"  # effects and indices, for the report
        self.designs = root / "designs.csv"  # every simulated design of the search
        self.report = root / "report.html"

    def open(self, study: Setup, resume: bool) -> None:
        """Start the folder or go on with it; refuse what would mix two studies."""
        if self.manifest.exists():
            stored = self.stored_study()
            if not resume:
                remedy = "add --resume to go on with it or choose another --out"
                raise StorageError(f"{self.root} holds a study already; {remedy}")
            if apart := differing(comparable(stored.file), comparable(study.file)):
                raise StorageError(
                    f"{self.root} was started with another configuration ({'; '.join(apart)}); "
                    "give the one it was started with, remove that folder, or begin another: by "
                    "--out, of 'fit' by another name of the study"
                )
            return
        if any(path.exists() for path in (self.trials, self.shifts, self.simulated)):
            remedy = "choose another --out or remove the folder"
            raise StorageError(f"{self.root} holds results without study.json; {remedy}")
        write_json(
            self.manifest,
            {
                "format": FORMAT,
                "study": study.file.model_dump(exclude_none=True),
                "config_hash": study.config_hash,
                "physics_hash": study.physics_hash,
                "versions": versions(),
            },
        )

    def stored_study(self) -> Setup:
        """Read the study that the folder was started with; StorageError for a bad manifest."""
        there = self.manifest.exists()
        remedy = "start the study in another --out" if there else "run 'dogshape study' first"
        content = read_json(self.manifest, remedy)
        if content.get("format") != FORMAT:
            raise StorageError(
                f"{self.root} was written in format {content.get('format')!r}, but this version "
                f"reads format {FORMAT}; use the version that wrote it or start a new folder"
            )
        if "study" not in content:
            raise StorageError(f"{self.manifest} is damaged; start the study in another folder")
        return build_study(validate(StudyFile, content["study"], str(self.manifest)))

    def stored_result(self) -> dict[str, Any]:
        """Read what the study found so far; raise StorageError where that is damaged."""
        result = read_json(self.result, WRITE_AGAIN)
        keys = ("objectives", "best", "front", "confirmation", "surrogate", "versions")
        if not isinstance(result.get("trials"), list) or any(key not in result for key in keys):
            raise StorageError(f"{self.result} is damaged; {WRITE_AGAIN}")
        return result


def comparable(file: StudyFile) -> dict[str, Any]:
    """Select the settings that must not change between runs: numbers of designs may."""
    free = {"search": {"trials", "confirm_designs", "audit_shifts"}, "solver": {"time_limit_s"}}
    return file.model_dump(exclude=free)


def differing(before: Any, now: Any, name: str = "") -> list[str]:
    """List the differences of two configurations, a key with both of its values each."""
    if isinstance(before, dict) and isinstance(now, dict):
        inner = ((key, f"{name}.{key}".lstrip(".")) for key in sorted({*before, *now}))
        return [one for k, n in inner for one in differing(before.get(k), now.get(k), n)]
    old, new = ("not given" if v is None else json.dumps(v, default=str) for v in (before, now))
    return [] if before == now else [f"{name} was {old} and is now {new}"]


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write a JSON file so that a kill or a power cut leaves the old one or the new one, whole."""
    write_whole(path, json.dumps(content, indent=1, allow_nan=False))


def read_json(path: Path, remedy: str) -> dict[str, Any]:
    """Read a JSON object; raise StorageError with ``remedy`` where there is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise StorageError(f"there is no {path.name} in {path.parent}; {remedy}") from error
    except (OSError, ValueError) as error:
        raise StorageError(f"{path} cannot be read or is damaged; {remedy}") from error
    if not isinstance(content, dict):
        raise StorageError(f"{path} is damaged; {remedy}")
    return content


def default_out(given: Setup, part: str = "") -> Path:
    """Name the folder of a study's results where none is given; ``-space`` that of its fit."""
    return Path("results") / f"{given.name}{part}"


def require_targets(
    targets: Mapping[str, Path | None], endings: Mapping[str, tuple[str, ...]] | None = None
) -> None:
    """Raise StorageError unless the files that options name can be written; None is not asked for.

    ``endings`` are those that an option's file may have. No file that is there changes.
    """
    for option, path in targets.items():
        if path is None or (path.exists() and not path.is_file() and not path.is_dir()):
            continue  # a device or a pipe is left alone
        fit = (endings or {}).get(option, (path.suffix.lower(),))
        fault = ""
        if path.is_dir():
            fault = "which is a folder; name a file"
        elif path.suffix.lower() not in fit:
            named = path.with_suffix(fit[0])
            fault = f"but its file must end in {fit[0]}; write for instance {named}"
        else:
            try:
                # A new file is made and removed; the time of one that is there does not change.
                with path.open("ab") if path.exists() else TemporaryFile(dir=path.parent):
                    pass
            except FileNotFoundError:
                fault = f"but there is no folder {path.parent}; make it or name another file"
            except OSError as error:
                fault = f"which cannot be written ({error.strerror}); name another file"
        if fault:
            raise StorageError(f"{option} is {path}, {fault}")
