"""Provenance of a study's results: the command that runs it, its file, and dates."""

from __future__ import annotations

import json
import shlex
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.config.toml_text import toml_value
from dogshape.sim.errors import DogshapeError

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.search.result_schema``


def command_of(study: Setup) -> str | None:
    """Return the command that runs a study like this one; None where no bundled study leads to it.

    Checked by the hash of the configuration.
    """
    try:
        bundled = load_study(study.name)
        overrides = _differences(bundled.file.model_dump(), study.file.model_dump())
        again = load_study(study.name, overrides)
    except DogshapeError:
        return None
    if again.config_hash != study.config_hash:
        return None
    sets = "".join(f" --set {shlex.quote(one)}" for one in overrides)
    return f"dogshape study {study.name}{sets}"


def dates_of(result: Path) -> dict[str, str]:
    """Give the days (UTC) on which a report is written and its result was stored.

    Parameters
    ----------
    result : file of the result; its time of change counts.
    """
    stored = datetime.fromtimestamp(result.stat().st_mtime, UTC)
    return {"written": f"{datetime.now(UTC):%Y-%m-%d}", "stored": f"{stored:%Y-%m-%d}"}


def file_of(study: Setup) -> str:
    """Write the study file as it was run, overrides included, as JSON."""
    return json.dumps(study.file.model_dump(exclude_none=True), indent=1, ensure_ascii=False)


def _differences(given: Row, wanted: Row, prefix: str = "") -> list[str]:
    """Return ``KEY=VALUE`` for each key whose value differs."""
    found = []
    for key, value in wanted.items():
        before = given.get(key)
        if isinstance(value, dict) and isinstance(before, dict) and not _lacks(before, value):
            found += _differences(before, value, f"{prefix}{key}.")
        elif value != before and value is not None:
            found.append(f"{prefix}{key}={toml_value(value)}")
    return found


def _lacks(given: Row, wanted: Row) -> bool:
    return any(wanted.get(key) is None for key, value in given.items() if value is not None)


def now() -> str:
    """Give the time (UTC), to the second."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
