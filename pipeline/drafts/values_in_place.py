"""Values of a TOML text replaced in place, so that its comments stay.

A comment says what a key is. What follows ``SOURCE`` in it says where the value is from, and goes
with the value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.items import Item, Table

from dogshape.sim.errors import InputError

SOURCE = "source:"


def with_values(text: str, values: Mapping[str, Any]) -> str:
    """Replace values of a TOML text by their dotted keys, and add those that are missing.

    None takes a key out, and the last key of a table the table. A mapping replaces a whole table.
    Raises InputError for a key below a plain value.
    """
    document = tomlkit.parse(text)
    for key, value in values.items():
        _put(document, key.split("."), value)
    return tomlkit.dumps(document).rstrip("\n") + "\n"


def _put(table: Any, path: list[str], value: Any) -> None:
    """Put a value, or a table, into a table of the document."""
    name, *inner = path
    there = table.get(name)
    if there == value and not inner:
        return
    if inner or (isinstance(value, Mapping) and (there is None or isinstance(there, Table))):
        if there is None and value is None:
            return
        if there is None:
            table[name] = tomlkit.table()
        elif not isinstance(there, Mapping):
            raise InputError(f"{'.'.join(path)} cannot be set: {name} is a value and not a table")
        keys = {**(there or {}), **value} if not inner else {}
        for deeper, new in [(inner, value)] if inner else [([k], value.get(k)) for k in keys]:
            _put(table[name], deeper, new)
        if not table[name]:
            table.remove(name)
    elif value is None:
        table.remove(name)
    else:
        table[name] = _item(value)
        _drop_source(table[name])
    _drop_source(table)


def _drop_source(item: Any) -> None:
    if isinstance(item, Item) and SOURCE in item.trivia.comment:
        kept = item.trivia.comment.partition(SOURCE)[0].rstrip(" ;")
        item.trivia.comment = kept if kept != "#" else ""
        item.trivia.comment_ws = item.trivia.comment_ws if kept != "#" else ""


def _item(value: Any) -> Any:
    """Round numbers to twelve digits, whose last are lost on the way through SI; tables inline."""
    if isinstance(value, (list, tuple)):
        return [_item(one) for one in value]
    if isinstance(value, Mapping):
        inline = tomlkit.inline_table()
        inline.update({key: _item(one) for key, one in value.items() if one is not None})
        return inline
    return float(f"{value:.12g}") if isinstance(value, float) else value
