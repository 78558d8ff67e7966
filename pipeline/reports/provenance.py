"""Provenance of a study's results: the command that runs it, its file, and dates."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.config.toml_text import toml_value
from dogshape.sim.errors import DogshapeError


def command_of(study: Setup) -> str | None:
    """Compose the command that runs a study like this one; None unless ``--set`` leads to it.

    Checked by the hash of the configuration.
    """
    try:
        bundled = flat_keys(load_study(study.name).file.model_dump())
        wanted = flat_keys(study.file.model_dump())
        changed = {k: v for k, v in wanted.items() if v is not None and bundled.get(k) != v}
        overrides = [f"{key}={toml_value(value)}" for key, value in changed.items()]
        if load_study(study.name, overrides).config_hash != study.config_hash:
            return None
    except DogshapeError:
        return None
    sets = "".join(f" --set {shlex.quote(one)}" for one in overrides)
    return f"dogshape study {study.name}{sets}"


def flat_keys(record: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten nested records into one, keys joined by dots."""
    found: dict[str, Any] = {}
    for key, value in record.items():
        inner = flat_keys(value, f"{prefix}{key}.") if isinstance(value, Mapping) else None
        found |= {f"{prefix}{key}": value} if inner is None else inner
    return found


def dates_of(result: Path) -> str:
    """Write the days (UTC) on which a result was stored, by its file, and its report written."""
    stored = datetime.fromtimestamp(result.stat().st_mtime, UTC)
    return f"result stored {stored:%Y-%m-%d}, report written {datetime.now(UTC):%Y-%m-%d} (UTC)"


def now() -> str:
    """Give the time (UTC), to the second."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
