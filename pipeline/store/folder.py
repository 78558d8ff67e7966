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
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
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
from dogshape.sim.interface import argument, verb
from dogshape.sim.statistics.shift_records import Record, key_of, landing_of, result_of, unfinished
from dogshape.sim.versions import versions

MAX_LINE = 1 << 22  #: bytes, longest line of a journal: a shift has less than 4 kB
MAX_FILE = 1 << 28  #: bytes, largest JSON document: 8000 designs of a search at 33 kB each
#: Settings that a resumed run may change, by table: budgets.
FREE_SETTINGS = {
    "search": {"trials", "confirm_designs", "audit_shifts"},
    "solver": {"time_limit_s"},
}
#: Keys that each result of a study has, besides its trials.
RESULT_KEYS = ("objectives", "best", "front", "confirmation", "surrogate", "versions")

_KEY_PATTERN = re.compile(rb'"key": "([^"]*)"')


def _intern_keys(pairs: Sequence[tuple[str, Any]]) -> Record:
    """Build a row whose keys are in memory once for all rows."""
    return {intern(key): value for key, value in pairs}


_DECODER = json.JSONDecoder(object_pairs_hook=_intern_keys)


class ShiftJournal:
    """Shifts by their content key: those that are finished on disk too."""

    def __init__(self, path: Path) -> None:
        self.path = path.absolute()  # workers may stand in another folder
        self.rows: dict[str, Record] = {}
        self.read_new()

    def read_new(self) -> list[Record]:
        """Read the rows that other processes appended, and return them."""
        rows = read_lines(self.path, _require_shift, "a finished shift")
        new_rows = {key_of(row): row for row in rows if key_of(row) not in self.rows}
        self.rows.update(new_rows)
        return list(new_rows.values())

    def sync(self) -> None:
        """Force the file to the disk, so that it survives a power cut."""
        if self.path.exists():
            sync(self.path)

    def drop(self, keys: Collection[str]) -> None:
        """Remove shifts by their keys; StorageError as ``append``.

        A kill leaves the file before or after, whole; lines of other processes stay.
        """
        with _locked_file(self.path):
            content = self.path.read_bytes()
            lines = content[: content.rfind(b"\n") + 1].splitlines(keepends=True)
            remaining_lines = []
            for line in lines:
                match = _KEY_PATTERN.search(line)  # to parse lines takes far longer
                if match is None or match[1].decode() not in keys:
                    remaining_lines.append(line)
            write_whole(self.path, b"".join(remaining_lines))
        self.rows = {key: row for key, row in self.rows.items() if key not in keys}

    def say_unfinished(self, say: Say) -> None:
        """Report the number of shifts that the clock ended, if any."""
        count = sum(map(unfinished, self.rows.values()))
        if count:
            say(
                f"{count} of the shifts failed at solver.time_limit_s, as on a busy machine; "
                "they are not kept"
            )


def _require_shift(row: Record) -> None:
    """Raise KeyError, TypeError or ValueError unless a row is a finished shift."""
    result_of(row)
    landing_of(row)


def read_lines(path: Path, require: Callable[[Record], Any], kind: str) -> Iterator[Record]:
    """Yield the rows of a file of JSON lines, without an unfinished last line.

    ``require`` raises for a row that is not ``kind``, which raises StorageError.
    """
    remedy = "remove the line or give another folder"
    with path.open("rb") if path.exists() else BytesIO() as file:
        for number, line in enumerate(iter(lambda: file.readline(MAX_LINE), b""), start=1):
            if len(line) == MAX_LINE and not line.endswith(b"\n"):
                raise StorageError(f"{path}, line {number} is too long for {kind}; {remedy}")
            if not line.endswith(b"\n"):
                return
            try:
                row = _DECODER.decode(line.decode())
                require(row)
            except (ValueError, KeyError, TypeError, RecursionError) as error:
                raise StorageError(f"{path}, line {number} is not {kind}; {remedy}") from error
            yield row


def append(path: Path, *rows: Record) -> None:
    """Append finished shifts, all of them or none, without those that the clock ended.

    Raises StorageError where there is no room or no right to write.
    """
    finished_rows = [row for row in rows if not unfinished(row)]
    text = "".join(json.dumps(row, allow_nan=False) + "\n" for row in finished_rows)
    remaining_bytes = text.encode()
    with _locked_file(path) as descriptor:
        end = os.fstat(descriptor).st_size
        if end and os.pread(descriptor, 1, end - 1) != b"\n":
            end = os.pread(descriptor, end, 0).rfind(b"\n") + 1
            os.ftruncate(descriptor, end)
        try:
            while remaining_bytes:  # a disk that fills up takes a part first and then refuses
                written_count = os.write(descriptor, remaining_bytes)
                remaining_bytes = remaining_bytes[written_count:]
        except OSError:
            os.ftruncate(descriptor, end)
            raise


def sync(path: Path) -> None:
    """Force a file to the disk; StorageError as ``append``."""
    with _locked_file(path) as descriptor:
        os.fsync(descriptor)
        sync_folder(path.parent)


def create_folder(root: Path) -> None:
    """Create a folder if missing; StorageError where that is not possible."""
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable_folder(root, error) from error


def unwritable_folder(root: Path, error: OSError) -> StorageError:
    """Build the error of a folder that cannot be written."""
    return StorageError(f"{root} cannot be written ({error.strerror}); choose another folder")


@contextmanager
def _locked_file(path: Path) -> Iterator[int]:
    """Open a file for appending and hold its lock, which ends with the process.

    A process that waited while the file was exchanged (``ShiftJournal.drop``) takes the new file.
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
            "or give the right to write, and run the command again to go on, "
            f"{verb('search', resume=True)}"
        ) from error


def rewrite_remedy() -> str:
    """Write the remedy of a damaged file that a resumed search writes again."""
    return f"run {verb('search', resume=True)} to write it again"


class StudyFolder:
    """Paths of a study's results, and the rules for opening them."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.manifest = root / "study.json"  # study file as it was run, hashes and versions
        self.trials = root / "trials.log"  # Optuna's journal
        self.running = root / "running.jsonl"  # shifts of designs under way
        self.shifts = root / "shifts.jsonl"  # shifts of Drake, which stay
        self.result = root / "result.json"  # front, best design, confirmation and audit
        self.rows = root / "rows.json"  # data for the surrogate from a search
        self.surrogate = root / "surrogate.json"  # the surrogate with its data
        self.points = root / "points.csv"  # its data as a table
        self.simulated = root / "simulated.jsonl"  # rows of each design of a fit
        self.chosen = root / "chosen.json"  # designs of a fit that are expected to be best
        self.effects = root / "effects.json"  # effects and indices, for the report
        self.designs = root / "designs.csv"  # every simulated design of the search
        self.report = root / "report.html"

    def open(self, study: Setup, resume: bool) -> None:
        """Start or resume the folder; StorageError if another study is there."""
        if self.manifest.exists():
            stored_study = self.stored_study()
            if not resume:
                resume_argument = argument("resume", value=True)
                remedy = f"add {resume_argument} to go on with it or choose another"
                raise StorageError(f"{self.root} holds a study already; {remedy} {argument('out')}")
            differences = differing(comparable(stored_study.file), comparable(study.file))
            if differences:
                text = "; ".join(differences)
                raise StorageError(
                    f"{self.root} was started with another configuration ({text}); "
                    "give the one it was started with, remove that folder, or begin another: by "
                    f"{argument('out')}, of 'fit' by another name of the study"
                )
            return
        if any(path.exists() for path in (self.trials, self.shifts, self.simulated)):
            remedy = f"choose another {argument('out')} or remove the folder"
            raise StorageError(f"{self.root} holds results without study.json; {remedy}")
        manifest = {
            "format": FORMAT,
            "study": study.file.model_dump(exclude_none=True),
            "config_hash": study.config_hash,
            "physics_hash": study.physics_hash,
            "versions": versions(),
        }
        write_json(self.manifest, manifest)

    def stored_study(self) -> Setup:
        """Read the study that the folder was started with; StorageError for a bad manifest."""
        remedy = f"run {verb('search')} first"
        if self.manifest.exists():
            remedy = f"start the study in another {argument('out')}"
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
        """Read ``result.json``; StorageError if the file is missing or damaged."""
        result = read_json(self.result, rewrite_remedy())
        has_trials = isinstance(result.get("trials"), list)
        if not has_trials or any(key not in result for key in RESULT_KEYS):
            raise StorageError(f"{self.result} is damaged; {rewrite_remedy()}")
        return result


def comparable(file: StudyFile) -> dict[str, Any]:
    """Select the settings that must not change between runs of a study, by table and key."""
    return file.model_dump(exclude=FREE_SETTINGS)


def differing(old: Any, new: Any, name: str = "") -> list[str]:
    """List the differences of two configurations, a clause for each key with both values."""
    if isinstance(old, dict) and isinstance(new, dict):
        differences = []
        for key in sorted({*old, *new}):
            inner_name = f"{name}.{key}".lstrip(".")
            differences += differing(old.get(key), new.get(key), inner_name)
        return differences
    if old == new:
        return []
    return [f"{name} was {_value_text(old)} and is now {_value_text(new)}"]


def _value_text(value: Any) -> str:
    """Write a value of a configuration for a message."""
    return "not given" if value is None else json.dumps(value, default=str)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write a JSON file in one step: a kill or a power cut leaves the old or the new file."""
    write_whole(path, json.dumps(content, indent=1, allow_nan=False))


def read_json(path: Path, remedy: str) -> dict[str, Any]:
    """Read a JSON object; StorageError with ``remedy`` if the file is missing or damaged."""
    try:
        if path.stat().st_size > MAX_FILE:
            raise StorageError(f"{path} has more than {MAX_FILE >> 20} MB; {remedy}")
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise StorageError(f"there is no {path.name} in {path.parent}; {remedy}") from error
    except (OSError, ValueError, RecursionError) as error:
        raise StorageError(f"{path} cannot be read or is damaged; {remedy}") from error
    if not isinstance(content, dict):
        raise StorageError(f"{path} is damaged; {remedy}")
    return content


def default_out(study: Setup, part: str = "") -> Path:
    """Return the default folder of a study's results; ``part`` ``-space`` is for its fit."""
    return Path("results") / f"{study.name}{part}"


def require_targets(
    targets: Mapping[str, Path | None], endings: Mapping[str, tuple[str, ...]] | None = None
) -> None:
    """Raise StorageError unless all output files can be written; no existing file changes.

    Parameters
    ----------
    targets
        Path by option, None where the option is not given.
    endings
        Permitted endings of a path by option, ``.csv`` for instance; any by default.

    """
    for option, path in targets.items():
        if path is None or (path.exists() and not path.is_file() and not path.is_dir()):
            continue  # a device or a pipe is taken as it is
        permitted = (endings or {}).get(option)
        fault = _target_fault(path, permitted)
        if fault:
            raise StorageError(f"{option} is {path}, {fault}")


def _target_fault(path: Path, endings: tuple[str, ...] | None) -> str:
    """Explain why an output file cannot be written, with the remedy; empty if it can."""
    if path.is_dir():
        return "which is a folder; name a file"
    if endings is not None and path.suffix.lower() not in endings:
        example = path.with_suffix(endings[0])
        return f"but its file must end in {endings[0]}; write for instance {example}"
    try:
        # A new file is made and removed; the time of an existing file does not change.
        with path.open("ab") if path.exists() else TemporaryFile(dir=path.parent):
            pass
    except FileNotFoundError:
        return f"but there is no folder {path.parent}; make it or name another file"
    except OSError as error:
        return f"which cannot be written ({error.strerror}); name another file"
    return ""
