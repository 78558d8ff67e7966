"""The folder of a study: manifest, trials, shifts, surrogate, report; one writer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from dogshape.pipeline.config.schema import FORMAT, StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import StorageError
from dogshape.sim.files import write_whole, writing
from dogshape.sim.versions import versions


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

    def writing(self) -> AbstractContextManager[None]:
        """Hold the folder for writing; another writer raises StorageError."""
        return writing(self.root)

    def open(self, study: Setup, resume: bool) -> None:
        """Start the folder or go on with it; refuse what would mix two studies."""
        if self.manifest.exists():
            stored = self.stored_study()
            if not resume:
                raise StorageError(
                    f"{self.root} holds a study already; add --resume to go on with it "
                    "or choose another --out"
                )
            if apart := differing(comparable(stored.file), comparable(study.file)):
                raise StorageError(
                    f"{self.root} was started with another configuration ({'; '.join(apart)}); "
                    "give the one it was started with, remove that folder, or begin another: by "
                    "--out, of 'fit' by another name of the study"
                )
            return
        if any(path.exists() for path in (self.trials, self.shifts, self.simulated)):
            raise StorageError(
                f"{self.root} holds results without study.json; choose another --out "
                "or remove the folder"
            )
        content = {
            "format": FORMAT,
            "study": study.file.model_dump(exclude_none=True),
            "config_hash": study.config_hash,
            "physics_hash": study.physics_hash,
            "versions": versions(),
        }
        write_json(self.manifest, content)

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
        remedy = "run 'dogshape study' with --resume to write it again"
        result = read_json(self.result, remedy)
        keys = ("objectives", "best", "front", "confirmation", "surrogate", "versions")
        if not isinstance(result.get("trials"), list) or any(key not in result for key in keys):
            raise StorageError(f"{self.result} is damaged; {remedy}")
        return result


def comparable(file: StudyFile) -> dict[str, Any]:
    """Select the settings that must not change between runs: numbers of designs may."""
    content = file.model_dump()
    del content["search"]["trials"], content["search"]["confirm_designs"]
    content["search"].pop("audit_shifts", None)
    content["solver"].pop("time_limit_s", None)
    return content


def differing(before: Any, now: Any, name: str = "") -> list[str]:
    """List the differences of two configurations, a key with both of its values each."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = sorted({*before, *now})
        inner = ((key, f"{name}.{key}" if name else key) for key in keys)
        return [one for k, n in inner for one in differing(before.get(k), now.get(k), n)]
    old, new = (
        "not given" if value is None else json.dumps(value, default=str) for value in (before, now)
    )
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


def default_out(given: Setup) -> Path:
    """Name the folder of a study's results where none is given."""
    return Path("results") / given.name


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
