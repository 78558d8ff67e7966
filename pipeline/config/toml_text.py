"""TOML text with comments: written from tables, or changed in place.

A comment says what a key is. What follows ``SOURCE`` in it says where the value is from, and goes
with the value.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import tomlkit
from tomlkit.items import Item, Table

from dogshape.sim.errors import InputError

WIDE = 88  #: characters of a line of comment
SOURCE = "source:"


def toml_value(value: Any) -> str:
    """Write a value in one line; entries of tables that are None are left out."""
    return _item(value, lines=False).as_string()


def toml_text(data: Mapping[str, Any], comments: Mapping[str, Sequence[str]]) -> str:
    """Write a file of tables, with comments.

    Parameters
    ----------
    data : values and tables by name; tables within tables are written in one line.
    comments : sentences by the dotted key that they stand before, ``""`` for the top.
    """
    document = tomlkit.document()
    _remark(document, comments.get("", ()))
    tables = {key: value for key, value in data.items() if isinstance(value, Mapping)}
    _fill(document, {key: data[key] for key in data if key not in tables}, "", comments)
    for name, values in tables.items():
        document.add(tomlkit.nl())
        _remark(document, comments.get(name, ()))
        document[name] = tomlkit.table()
        document[name].trivia.indent = ""  # its comment stands right above
        _fill(document[name], values, f"{name}.", comments)
    return tomlkit.dumps(document)


def _fill(
    table: Any, values: Mapping[str, Any], stem: str, comments: Mapping[str, Sequence[str]]
) -> None:
    for key, value in values.items():
        _remark(table, comments.get(f"{stem}{key}", ()))
        if value is not None:
            table[key] = _item(value)


def _remark(table: Any, sentences: Sequence[str]) -> None:
    """Break sentences into lines of comment; no word is cut."""
    for sentence in sentences:
        for line in textwrap.wrap(
            sentence, WIDE - 2, break_long_words=False, break_on_hyphens=False
        ):
            table.add(tomlkit.comment(line))


def _item(value: Any, *, lines: bool = True) -> Any:
    """Make a value in one line; of a list of tables with ``lines`` each in its own."""
    if isinstance(value, (list, tuple)):
        array = tomlkit.array()
        array.extend(_item(one, lines=False) for one in value)
        return array.multiline(lines and isinstance(next(iter(value), None), Mapping))
    if isinstance(value, Mapping):
        inline = tomlkit.inline_table()
        some = {key: one for key, one in value.items() if one is not None}
        inline.update({key: _item(one, lines=False) for key, one in some.items()})
        return inline
    return tomlkit.item(value)


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
