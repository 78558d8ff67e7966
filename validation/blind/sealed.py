"""Diagnoses of sealed cases from their data alone, and the key that is opened after them.

``validation.blind.field_set`` makes a set; ``DIR/results/case_000.json`` has the diagnosis of a
case. ``run`` reads ``manifest.json`` and ``cases`` and never opens the key. It refuses data that
differ from the manifest, and a stopped run goes on.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from dogshape.sim.errors import DogshapeError, InputError, StorageError
from dogshape.sim.files import write_whole

Record = dict[str, Any]  #: key, manifest and results of a set, as they are kept in JSON
Diagnose = Callable[[Path], Record]
Advance = Callable[[int], None]

FORMAT = 2
RESULTS = "results"  #: folder of the results of the diagnosis within a set


def ignore(_: int) -> None:
    """Count nothing."""


def run_all(
    function: Callable[..., Any], calls: Sequence[tuple[Any, ...]], jobs: int, advance: Advance
) -> list[Any]:
    """Call a function with each tuple of arguments in ``jobs`` processes; return all results.

    ``advance`` counts calls.
    """
    results = []
    parallel = Parallel(jobs, return_as="generator")
    for result in parallel(delayed(function)(*call) for call in calls):
        results.append(result)
        advance(1)
    return results


def hash_of(folder: Path) -> str:
    """Hash all files of a folder, names and contents."""
    total = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        content = path.read_bytes()
        total.update(f"{path.relative_to(folder).as_posix()} {len(content)}\n".encode())
        total.update(content)
    return total.hexdigest()


def manifest_of(folder: Path) -> Record:
    """Read the manifest of a set; StorageError where it is missing or of another format."""
    manifest = read(folder / "manifest.json", "make it with: dogshape blind make DIR")
    if manifest.get("format") != FORMAT or "cases" not in manifest:
        raise StorageError(
            f"{folder / 'manifest.json'} is no manifest of a field set; make it again"
        )
    return manifest


def run(
    folder: Path,
    diagnose: Diagnose,
    jobs: int = 1,
    advance: Advance = ignore,
    results_name: str = RESULTS,
) -> dict[str, Record]:
    """Diagnose the cases without a result; return the results of all cases by name.

    ``diagnose`` maps the folder of a case to the record of a diagnosis; where it refuses the data,
    the refusal is the result. It has to be picklable for ``jobs`` above 1. Results lie in the
    folder ``results_name`` of the set.
    """
    manifest = manifest_of(folder)
    results = folder / results_name
    results.mkdir(exist_ok=True)
    names = list(manifest["cases"])
    open_names = [name for name in names if not _is_done(results / f"{name}.json", manifest)]
    for name in open_names:
        if hash_of(folder / "cases" / name) != manifest["cases"][name]:
            raise StorageError(
                f"{folder / 'cases' / name} is not as it was made; make the cases again"
            )
    advance(len(names) - len(open_names))
    calls = [(results, name, diagnose, manifest) for name in open_names]
    run_all(_diagnose_case, calls, jobs, advance)
    return {name: read(results / f"{name}.json", "run again") for name in names}


def _diagnose_case(results: Path, name: str, diagnose: Diagnose, manifest: Record) -> None:
    """Diagnose a case and write its result with the processor time."""
    start = time.process_time()
    record: Record = {"key_sha256": manifest["key_sha256"]}
    try:
        record["diagnosis"] = diagnose(results.parent / "cases" / name)
    except StorageError:
        raise  # the fault of the folder, not of the data
    except DogshapeError as error:
        record["refused"] = str(error)
    record["cpu_s"] = time.process_time() - start
    write_whole(results / f"{name}.json", json.dumps(record, indent=1))


def _is_done(path: Path, manifest: Record) -> bool:
    """Test whether a result exists; StorageError for a result of another set of cases."""
    if not path.exists():
        return False
    if read(path, "remove it").get("key_sha256") != manifest["key_sha256"]:
        raise StorageError(f"{path} is the result of another set of cases; remove the results")
    return True


def open_key(folder: Path) -> Record:
    """Read the key; StorageError where its hash differs from the manifest's."""
    manifest = manifest_of(folder)
    path = folder / "key.json"
    try:
        content = path.read_bytes()
    except OSError as error:
        raise StorageError(f"{path} cannot be read ({error.strerror}); bring the key") from error
    if hashlib.sha256(content).hexdigest() != manifest["key_sha256"]:
        raise StorageError(f"{path} is not the key that was sealed; bring that one")
    return json.loads(content)


def results_of(folder: Path, results_name: str = RESULTS) -> dict[str, Record]:
    """Read all results; InputError where cases are not diagnosed yet."""
    manifest = manifest_of(folder)
    paths = {name: folder / results_name / f"{name}.json" for name in manifest["cases"]}
    open_names = [name for name, path in paths.items() if not _is_done(path, manifest)]
    if open_names:
        method = "" if results_name == RESULTS else f" --method {results_name}"
        raise InputError(
            f"{len(open_names)} of {len(paths)} cases are not diagnosed yet; go on with: "
            f"dogshape blind run DIR{method}"
        )
    return {name: read(path, "remove it and run again") for name, path in paths.items()}


def read(path: Path, remedy: str) -> Record:
    """Read a JSON object; StorageError with a remedy where the file has none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StorageError(f"{path} cannot be read ({type(error).__name__}); {remedy}") from error
    if not isinstance(content, dict):
        raise StorageError(f"{path} holds no JSON object; {remedy}")
    return content
