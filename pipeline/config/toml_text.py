"""Values and tables as TOML text, which the standard library reads but does not write."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

WIDE = 88  #: characters of a line of comment
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_value(value: Any) -> str:
    """Write a value in one line; entries of tables that are None are left out."""
    if isinstance(value, Mapping):
        pairs = (f"{toml_key(k)}={toml_value(v)}" for k, v in value.items() if v is not None)
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    return json.dumps(value, ensure_ascii=False)


def toml_key(name: str) -> str:
    """Write the name of a key, in quotes where it needs them."""
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def toml_text(data: Mapping[str, Any], comments: Mapping[str, Sequence[str]]) -> str:
    """Write a file of tables, with comments.

    Parameters
    ----------
    data : values and tables by name; tables within tables are written in one line.
    comments : sentences by the dotted key that they stand before, ``""`` for the top.
    """
    plain = {key: value for key, value in data.items() if not isinstance(value, Mapping)}
    tables = {key: value for key, value in data.items() if isinstance(value, Mapping)}
    lines = [*_remarks(comments.get("", ())), *_keys(plain, "", comments)]
    for name, table in tables.items():
        lines += ["", *_remarks(comments.get(name, ())), f"[{toml_key(name)}]"]
        lines += _keys(table, f"{name}.", comments)
    return "\n".join(lines) + "\n"


def _keys(
    table: Mapping[str, Any], stem: str, comments: Mapping[str, Sequence[str]]
) -> Iterator[str]:
    for key, value in table.items():
        yield from _remarks(comments.get(f"{stem}{key}", ()))
        if isinstance(value, list) and value and isinstance(value[0], Mapping):
            rows = ",\n    ".join(toml_value(one) for one in value)
            yield f"{toml_key(key)} = [\n    {rows},\n]"
        elif value is not None:
            yield f"{toml_key(key)} = {toml_value(value)}"


def _remarks(sentences: Sequence[str]) -> Iterator[str]:
    """Break sentences into lines of comment; no word is cut."""
    for sentence in sentences:
        line = "#"
        for word in sentence.split():
            if len(line) + 1 + len(word) > WIDE and line != "#":
                yield line
                line = "#"
            line += f" {word}"
        yield line
