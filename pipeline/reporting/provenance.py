"""How to get a study's results again: the command that runs it as it was run."""

from __future__ import annotations

import json
import shlex
from typing import Any

from pipeline.config import Study, load_study
from sim.errors import DogshapeError

Row = dict[str, Any]


def command_of(study: Study) -> str | None:
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


def _differences(given: Row, wanted: Row, prefix: str = "") -> list[str]:
    """Return ``KEY=VALUE`` for each key whose value differs; None cannot be said."""
    found = []
    for key, value in wanted.items():
        if isinstance(value, dict):
            found += _differences(given.get(key) or {}, value, f"{prefix}{key}.")
        elif value != given.get(key) and value is not None:
            # JSON of numbers, strings and lists is TOML as well.
            found.append(
                f"{prefix}{key}={json.dumps(list(value) if isinstance(value, tuple) else value)}"
            )
    return found
