"""Values of a TOML text replaced in place, so that its comments stay."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from dogshape.pipeline.config.toml_text import toml_value
from dogshape.sim.errors import InputError

_TABLE = re.compile(r"^\s*\[([\w.]+)\]\s*(#.*)?$")
_ANY_TABLE = re.compile(r"^\s*\[")


def _rounded(value: Any) -> Any:
    """Round numbers to twelve digits: their way through SI may cost the last ones."""
    if isinstance(value, (list, tuple)):
        return [_rounded(one) for one in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


def with_values(text: str, values: Mapping[str, Any]) -> str:
    """Replace values of a TOML text by their dotted keys; keys that are not there are added.

    Raises InputError where the text says something else afterwards than was asked, as with values
    that go over several lines.
    """
    lines = text.splitlines()
    for key, value in values.items():
        table, _, name = key.rpartition(".")
        lines = _with_value(lines, table, name, toml_value(_rounded(value)))
    done = "\n".join(lines) + "\n"
    _require(done, values)
    return done


def _with_value(lines: list[str], table: str, name: str, value: str) -> list[str]:
    start, end = _span(lines, table)
    if start is None:
        return [*lines, "", f"[{table}]", f"{name} = {value}"]
    for place in range(start, end):
        found = re.match(rf"^(\s*{re.escape(name)}\s*=\s*)(.*)$", lines[place])
        if found:
            comment = _comment(found.group(2))
            wide = max(1, len(found.group(2)) - len(comment) - len(value)) if comment else 0
            lines[place] = found.group(1) + value + " " * wide + comment
            return lines
    last = max((k for k in range(start, end) if lines[k].strip()), default=start - 1)
    return [*lines[: last + 1], f"{name} = {value}", *lines[last + 1 :]]


def _span(lines: list[str], table: str) -> tuple[int | None, int]:
    """Find the lines of a table, without its head; the lines before all tables for no name."""
    start: int | None = None if table else 0
    for place, line in enumerate(lines):
        if start is not None and _ANY_TABLE.match(line):
            return start, place
        found = _TABLE.match(line)
        if start is None and found and found.group(1) == table:
            start = place + 1
    return start, len(lines)


def _comment(rest: str) -> str:
    """Return the comment behind a value, which may hold a number sign in quotes."""
    quoted = False
    for place, letter in enumerate(rest):
        if letter == '"':
            quoted = not quoted
        elif letter == "#" and not quoted:
            return rest[place:]
    return ""


def _require(text: str, values: Mapping[str, Any]) -> None:
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"the file cannot be changed in place ({error}); write each of its values in one line"
        ) from error
    for key, value in values.items():
        found: Any = data
        for part in key.split("."):
            found = found.get(part) if isinstance(found, dict) else None
        wanted = tomllib.loads(f"value = {toml_value(_rounded(value))}")["value"]
        if found != wanted:
            raise InputError(
                f"{key} cannot be changed in place; write its table as [{key.rpartition('.')[0]}] "
                "with a line for each key"
            )
