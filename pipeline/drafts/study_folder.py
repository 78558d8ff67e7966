"""A study folder to begin with: the commented study file with values of one's own."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import build_study, load_study
from dogshape.pipeline.drafts.sources import Source, source_of
from dogshape.pipeline.drafts.targets import drafted
from dogshape.pipeline.drafts.values_in_place import with_values
from dogshape.sim.bundled import bundled_root
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import InputError
from dogshape.sim.texts import text_of

Row = dict[str, Any]  #: a table of a TOML file
COMMENTED = "mq200"  #: the bundled study whose file explains its keys
HEAD = """\
# A study of one's own, begun from {origin}. Each key is explained; docs/studies.md has all of them.
# Beside the dog look at [load], [material] and [manufacturing]: they decide what may be built.
"""


#: Tables that describe a clutch; what the others have is said in the file.
CLUTCH = ("dog", "sliding", "output", "actuation", "operating", "mechanism", "driveline", "load")


def write_study(
    out: Path, origin: str = COMMENTED, values: Mapping[str, Any] | None = None,
    *, force: bool = False,
) -> Row:  # fmt: skip
    """Write a folder with a commented ``study.toml``; tell what was taken over and assumed.

    Parameters
    ----------
    origin : study whose file is copied, or bench whose clutch and operating points are taken.
    values : values by dotted key.

    Raises
    ------
    InputError
        For an origin or values that make no study, all mistakes at once.
    StorageError
        For a folder that holds files, without ``force``.
    """
    name = _name_of(out)
    text, taken, assumed, whence = _begun(origin)
    assumed += _kept_of(text, {**taken, **(values or {})}, whence)
    given = {"name": name, **taken, **(values or {})}
    done = HEAD.format(origin=whence) + with_values(_without_head(text), given)
    source = f"{out / 'study.toml'}"
    study = build_study(validate(StudyFile, tomllib.loads(done), source))
    with drafted(out, force) as folder:
        (folder / "study.toml").write_text(done, encoding="utf-8")
    own = study.clutch.dog
    return {
        "folder": str(out),
        "file": source,
        "name": name,
        "from": whence,
        "set": {key: value for key, value in given.items() if key != "name"},
        "assumed": assumed,
        "operating_points": len(study.points),
        "dogs": own.count,
    }


def use_of(origin: str, keys: Iterable[str]) -> Row:
    """Return the numbers, or lists of them, that a draft would have at dotted keys."""
    text, taken, _, _ = _begun(origin)
    tables = tomllib.loads(text)
    found = {}
    for key in keys:
        table, _, name = key.rpartition(".")
        value = taken.get(key, tables.get(table, {}).get(name))
        if askable(value):
            found[key] = value
    return found


def askable(value: Any) -> bool:
    """Test that a value is a number or a list of numbers."""
    parts = value if isinstance(value, list) else [value]
    return all(isinstance(part, (int, float)) for part in parts)


def _kept_of(text: str, given: Mapping[str, Any], whence: str) -> list[str]:
    """List the numbers of the clutch that stay those of the origin, table by table."""
    tables = tomllib.loads(text)
    found = []
    for table in CLUTCH:
        kept = {
            key: value
            for key, value in tables.get(table, {}).items()
            if f"{table}.{key}" not in given and not isinstance(value, dict)
        }
        if kept:
            told = ", ".join(f"{key} {_written(value)}" for key, value in kept.items())
            found.append(f"[{table}] stays as in {whence}: {told}")
    return found


def _written(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _name_of(out: Path) -> str:
    name = out.resolve().name
    if not name or not all(letter.isalnum() or letter in "_.-" for letter in name):
        raise InputError(
            f"--out ends in '{name}', but a study's name has letters, digits, '_', '.' and '-' "
            "alone; name the folder so"
        )
    return name


def _begun(origin: str) -> tuple[str, Row, list[str], str]:
    """Return the text to begin with, values to put into it, assumptions, and where it is from."""
    path = Path(origin)
    file = path / "study.toml" if path.is_dir() else path
    if file.name == "bench.toml" or not file.is_file():
        file = bundled_root() / origin / "study.toml"
    if file.is_file():
        load_study(file)  # refuses what is no study, with its mistakes
        return text_of(file), {}, [], f"the study '{origin}'"
    source = source_of(origin)
    text = text_of(bundled_root() / COMMENTED / "study.toml")
    assumed = [
        "torque, material, limits of making and tolerances are those of the study "
        f"'{COMMENTED}': check [load], [material], [manufacturing] and [tolerance]"
    ]
    return text, _of_bench(source), assumed, f"the bench data of '{source.name}'"


def _of_bench(source: Source) -> Row:
    contact = source.clutch.contact
    rises = sorted(dict(source.rises).items())
    if len(rises) == 1:  # a table needs two forces to lie between
        rises.append((rises[0][0] * 1.01, rises[0][1]))
    return {
        **source.dog_values,
        "contact.static_friction": contact.static_friction,
        "contact.dynamic_friction": contact.dynamic_friction,
        "actuation.force_N": [float(f"{force:.9g}") for force, _ in rises],
        "actuation.rise_s": [float(f"{rise:.9g}") for _, rise in rises],
        "operating.mismatch_rpm": list(source.mismatches),
        "operating.force_N": list(source.forces),
    }


def _without_head(text: str) -> str:
    """Leave out comments above the first key: they are about the study that was copied."""
    lines = text.splitlines()
    first = next((k for k, line in enumerate(lines) if line and not line.startswith("#")), 0)
    return "\n".join(lines[first:]) + "\n"
