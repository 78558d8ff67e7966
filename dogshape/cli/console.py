"""Printing for people or for programs, and turning errors into exit status."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable, Iterable
from typing import Any, ParamSpec

import typer
from rich.console import Console, RenderableType
from rich.table import Table

from dogshape.cli.endings import CLOSED, reader_gone
from dogshape.sim.errors import DogshapeError

P = ParamSpec("P")


def verb(function: Callable[P, None]) -> Callable[P, None]:
    """Give a command the exit status of the contract: 2 bad input, 141 a closed pipe."""

    @functools.wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            function(*args, **kwargs)
        except DogshapeError as error:
            print(f"dogshape: {error}", file=sys.stderr)
            raise typer.Exit(2) from error
        except OSError as error:
            if isinstance(error, BrokenPipeError) and reader_gone():
                raise typer.Exit(CLOSED) from error
            where = f" ({error.filename})" if error.filename else ""
            reason = error.strerror or str(error)
            print(f"dogshape: {reason}{where}; check path, space and rights", file=sys.stderr)
            raise typer.Exit(2) from error

    return run


def warn(notes: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for note in notes:
        print(f"warning: {note}", file=sys.stderr)


def emit(data: dict[str, Any], as_json: bool, text: Callable[[], RenderableType]) -> None:
    """Print ``data`` as JSON, or what ``text`` makes for people."""
    if as_json:
        print(json.dumps(data, indent=1, allow_nan=False))
    else:
        terminal(width=None if sys.stdout.isatty() else 160).print(text())


def terminal(*, stderr: bool = False, width: int | None = None) -> Console:
    """Make a console that prints names and paths as they are: no markup, emoji or colours.

    Every console of the program comes from here; ``[v2]`` in a path is no markup.
    """
    return _PlainConsole(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


class _PlainConsole(Console):
    """Console that leaves a closed pipe to ``verb``."""

    def on_broken_pipe(self) -> None:
        """Raise the BrokenPipeError that is being handled."""
        self.quiet = True
        raise  # noqa: PLE0704


def columns(*names: str) -> Table:
    """Return an empty table: words in its first column, numbers in the others."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(names):
        table.add_column(name, justify="left" if index == 0 else "right")
    return table
