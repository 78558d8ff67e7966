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

from dogshape.sim.errors import InputError
from dogshape.sim.texts import place_of

WIDE = 86  #: characters of a line of comment
SOURCE = "source:"


def toml_value(value: Any, *, lines: bool = False) -> str:
    """Write a value in one line, with ``lines`` each of several tables in its own; None is left."""
    return _item(value, lines=lines).as_string()


def toml_text(data: Mapping[str, Any], comments: Mapping[str, Sequence[str]]) -> str:
    """Write a file of tables, those within tables in one line, with comments.

    ``comments`` are sentences by the dotted key that they stand before, ``""`` for the top.
    """
    tables = {key: value for key, value in data.items() if isinstance(value, Mapping)}
    text = []
    for name, table in {"": {k: v for k, v in data.items() if k not in tables}, **tables}.items():
        text += [*_remarks(comments.get(name, ())), *([f"[{name}]"] if name else [])]
        for key, value in table.items():
            if value is not None:
                text += _remarks(comments.get(f"{name}.{key}", ()))
                text.append(f"{tomlkit.key(key).as_string()} = {toml_value(value, lines=True)}")
        text.append("")
    return "\n".join(text)


def _remarks(sentences: Sequence[str]) -> list[str]:
    """Break sentences into lines of comment; no word is cut."""
    unbroken = {"break_long_words": False, "break_on_hyphens": False}
    return [f"# {line}" for one in sentences for line in textwrap.wrap(one, WIDE, **unbroken)]  # type: ignore[arg-type]


def _item(value: Any, *, lines: bool) -> Any:
    if isinstance(value, (list, tuple)):
        array = tomlkit.array()
        array.extend(_item(one, lines=False) for one in value)
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

    None takes a key out; a mapping replaces a table. With ``comments``, by dotted key, a replaced
    value and its table have the comment that is given there, or none: their own may be about the
    old value. Raises InputError for a key below a value, or one to take out that is not there.
    """
    document = tomlkit.parse(text)
    for key, value in values.items():
        table, name = place_of(document, key)
        there = table.get(name)
        if value is None and name not in table:
            raise InputError(f"there is no key {key} to take out; check the key, or leave it out")
        if value is None:
            table.remove(name)
        elif there != value:
            whole = isinstance(value, Mapping) and ("." not in key or isinstance(there, Table))
            item = tomlkit.item(dict(value)) if whole else _item(value, lines=True)
            _put(table, name, item)
            _renew_comment(table[name], key, comments)
            _drop_sources_before(table, name)
        if there != value:
            _renew_comment(table, key.rpartition(".")[0], comments)
    return tomlkit.dumps(document).rstrip("\n") + "\n"


def sources_of(text: str) -> dict[str, str]:
    """List where values of a TOML text are from, by dotted key: its own comment or its table's."""
    found = {}
    for name, table in tomlkit.parse(text).items():
        for key in table if isinstance(table, Table) else ():
            comments = [one.trivia.comment for one in (table.value.item(key), table)]
            sources = (comment.partition(SOURCE)[2].strip() for comment in comments)
            found[f"{name}.{key}"] = next(filter(None, sources), "")
    return found


def meanings_of(text: str) -> dict[str, str]:
    """List the comments of values and tables of a TOML text by dotted key, without sources."""
    found = {}
    for name, table in tomlkit.parse(text).items():
        if isinstance(table, Table):
            items = {name: table} | {f"{name}.{key}": table.value.item(key) for key in table}
            for key, item in items.items():
                _drop_source(item)
                found[key] = item.trivia.comment if isinstance(item, Item) else ""
    return {key: comment for key, comment in found.items() if comment}


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
    """Take the source from a comment, or with ``comments`` replace it by that of the key."""
    if comments is None:
        _drop_source(item)
    elif isinstance(item, Item):
        comment = comments.get(key, "")
        item.trivia.comment = comment
        item.trivia.comment_ws = (item.trivia.comment_ws or "  ") if comment else ""


def _drop_sources_before(table: Any, name: str) -> None:
    """Take away the lines of comment before a key that say where its value is from."""
    if not isinstance(table, Table):
        return
    body = table.value.body
    place = next(k for k, (key, _) in enumerate(body) if key is not None and key.key == name)
    while place and isinstance(body[place - 1][1], Comment):
        place -= 1
        if not body[place][1].trivia.comment.lstrip("# ").startswith(SOURCE):
            return
        body[place] = (None, Null())


def _drop_source(item: Any) -> None:
    if isinstance(item, Item) and SOURCE in item.trivia.comment:
        kept = item.trivia.comment.partition(SOURCE)[0].rstrip(" ;")
        item.trivia.comment = kept if kept != "#" else ""
        item.trivia.comment_ws = item.trivia.comment_ws if kept != "#" else ""
