"""Printing for people or for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import typer

from dogshape.terminal import print_parts, terminal

if TYPE_CHECKING:
    from dogshape.pipeline.record import Result, Table


def warn(notes: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for note in notes:
        print(f"warning: {note}", file=sys.stderr)


def show(result: Result, as_json: bool, *more: str | Table, ok: bool = True) -> None:
    """Print a result as JSON, or its sentences and tables for people, ``more`` after them."""
    emit(result.to_dict(), as_json, lambda: [*result.to_parts(), *more], ok=ok)


def emit(
    data: dict[str, Any], as_json: bool, parts: Callable[[], Sequence[str | Table]],
    *, ok: bool = True,
) -> None:  # fmt: skip
    """Print ``data`` as JSON, or ``parts`` for people; end with status 1 unless ``ok``."""
    console = terminal(width=None if sys.stdout.isatty() else 160)
    if as_json:
        print(json.dumps(data, indent=1, allow_nan=False))
    print_parts(console, [] if as_json else parts())
    if not ok:
        raise typer.Exit(1)
