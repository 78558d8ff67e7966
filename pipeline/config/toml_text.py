"""TOML text with comments: written from tables, or changed in place.

A comment says what a key is. What follows ``SOURCE`` in it says where the value is from, and goes
with the value; so do the lines before a key that begin with it.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import tomlkit
from tomlkit.items import Comment, Item, Null, Table

from dogshape.bench.texts import place_of
from dogshape.sim.errors import InputError

COMMENT_WIDTH = 86  #: characters of a line of comment
SOURCE = "source:"


def toml_value(value: Any, *, lines: bool = False) -> str:
    """Write a value as TOML in one line, with ``lines`` a line for each table of a list."""
    return _item(value, lines=lines).as_string()


def toml_text(data: Mapping[str, Any], comments: Mapping[str, Sequence[str]]) -> str:
    """Write a TOML file of tables with comments, without keys of value None.

    ``comments`` are sentences by the dotted key that they stand before, ``""`` for the top.
    """
    tables: dict[str, Mapping[str, Any]] = {
        "": {key: value for key, value in data.items() if not isinstance(value, Mapping)}
    }
    tables |= {name: table for name, table in data.items() if isinstance(table, Mapping)}
    lines = []
    for name, table in tables.items():
        lines += comment_lines(comments.get(name, ()))
        if name:
            lines.append(f"[{name}]")
        for key, value in table.items():
            if value is not None:
                lines += comment_lines(comments.get(f"{name}.{key}", ()))
                lines.append(f"{tomlkit.key(key).as_string()} = {toml_value(value, lines=True)}")
        lines.append("")
    return "\n".join(lines)


def comment_lines(sentences: Sequence[str]) -> list[str]:
    """Break sentences into lines of comment; no word is cut."""
    lines = []
    for sentence in sentences:
        lines += textwrap.wrap(
            sentence, COMMENT_WIDTH, break_long_words=False, break_on_hyphens=False
        )
    return [f"# {line}" for line in lines]


def _item(value: Any, *, lines: bool) -> Any:
    """Convert a value to an item of tomlkit, tables to inline ones."""
    if isinstance(value, (list, tuple)):
        array = tomlkit.array()
        array.extend(_item(element, lines=False) for element in value)
        return array.multiline(lines and isinstance(next(iter(value), None), Mapping))
    if isinstance(value, Mapping):
        inline = tomlkit.inline_table()
        inline.update({k: _item(v, lines=False) for k, v in value.items() if v is not None})
        return inline
    return tomlkit.item(value)


def with_values(
    text: str, values: Mapping[str, Any], comments: Mapping[str, str] | None = None
) -> str:
    """Replace values of a TOML text by their dotted keys, and add those that are missing.

    Parameters
    ----------
    text
        TOML text.
    values
        Values by dotted key. None takes a key out; a mapping replaces a table.
    comments
        Comments of the values and their tables by dotted key; values without one lose theirs,
        which may be about the old value or its source. By default only sources are dropped, and
        equal values keep theirs.

    Raises
    ------
    InputError
        For a key below a value, or one to take out that is not there.

    """
    document = tomlkit.parse(text)
    for key, value in values.items():
        table, name = place_of(document, key)
        old_value = table.get(name)
        if value is None and name not in table:
            raise InputError(f"there is no key {key} to take out; check the key, or leave it out")
        if value is None:
            table.remove(name)
        elif old_value != value:
            is_table = "." not in key or isinstance(old_value, Table)
            if isinstance(value, Mapping) and is_table:
                _put(table, name, tomlkit.item(dict(value)))
            else:
                _put(table, name, _item(value, lines=True))
        is_new = old_value != value or comments is not None
        if is_new and value is not None:
            _renew_comment(table[name], key, comments)
            _drop_sources_before(table, name)
        if is_new:
            _renew_comment(table, key.rpartition(".")[0], comments)
    return tomlkit.dumps(document).rstrip("\n") + "\n"


def sources_of(text: str) -> dict[str, str]:
    """List the sources of the values of a TOML text by dotted key, empty for none.

    A source is in the comment of a value, else in that of its table.
    """
    sources = {}
    for name, table in tomlkit.parse(text).items():
        if not isinstance(table, Table):
            continue
        table_source = _source(table)
        for key in table:
            sources[f"{name}.{key}"] = _source(table.value.item(key)) or table_source
    return sources


def _source(item: Any) -> str:
    """Return the source that the comment of an item names, or an empty text."""
    comment: str = item.trivia.comment
    return comment.partition(SOURCE)[2].strip()


def meanings_of(text: str) -> dict[str, str]:
    """List the comments of values and tables of a TOML text by dotted key, without sources."""
    meanings = {}
    for name, table in tomlkit.parse(text).items():
        if isinstance(table, Table):
            items = {name: table} | {f"{name}.{key}": table.value.item(key) for key in table}
            for key, item in items.items():
                _drop_source(item)
                meanings[key] = item.trivia.comment if isinstance(item, Item) else ""
    return {key: comment for key, comment in meanings.items() if comment}


def _put(table: Any, name: str, item: Any) -> None:
    """Set a key; a new one goes before the comments at the end, which are about the next table."""
    tail: list[Any] = []
    if isinstance(table, Table) and name not in table:
        body = table.value.body
        while body and body[-1][0] is None:
            tail.insert(0, body.pop())
    table[name] = item
    if tail:
        table.value.body.extend(tail)


def _renew_comment(item: Any, key: str, comments: Mapping[str, str] | None) -> None:
    """Replace the comment of an item from ``comments``; if None, just drop its source."""
    if comments is None:
        _drop_source(item)
    elif isinstance(item, Item):
        comment = comments.get(key, "")
        item.trivia.comment = comment
        item.trivia.comment_ws = (item.trivia.comment_ws or "  ") if comment else ""


def _drop_sources_before(table: Any, name: str) -> None:
    """Remove the lines of comment before a key that name the source of its value."""
    if not isinstance(table, Table):
        return
    body = table.value.body
    index = next(i for i, (key, _) in enumerate(body) if key is not None and key.key == name)
    while index and isinstance(body[index - 1][1], Comment):
        index -= 1
        if not body[index][1].trivia.comment.lstrip("# ").startswith(SOURCE):
            return
        body[index] = (None, Null())


def _drop_source(item: Any) -> None:
    """Remove the source from the comment of an item."""
    if isinstance(item, Item) and SOURCE in item.trivia.comment:
        comment = item.trivia.comment.partition(SOURCE)[0].rstrip(" ;")
        if comment == "#":
            comment = ""
            item.trivia.comment_ws = ""
        item.trivia.comment = comment
