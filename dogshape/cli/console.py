"""Printing for people or for programs, and progress."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import typer
from rich import progress as rich_progress
from rich.console import Console
from rich.table import Table as RichTable

from dogshape.pipeline.progress import Count, about

if TYPE_CHECKING:
    from dogshape.pipeline.record import Result, Table

LINE_EVERY = 15.0  #: s between lines of progress where standard error is no terminal


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
    for part in [] if as_json else parts():
        console.print(part if isinstance(part, str) else rich_table(part))
    if not ok:
        raise typer.Exit(1)


def rich_table(table: Table) -> RichTable:
    """Draw a table: words to the left, numbers to the right, groups in bold."""
    drawn = RichTable(box=None, pad_edge=False, header_style="bold", show_header=any(table.heads))
    for place, head in enumerate(table.heads):
        words = place == 0 or place in table.words or not any(table.heads)
        drawn.add_column(head, justify="left" if words else "right", overflow="fold")
    for place, row in enumerate(table.rows):
        drawn.add_row(*row, style="bold" if table.looks.get(place) == "group" else None)
    return drawn


def terminal(*, stderr: bool = False, width: int | None = None) -> Console:
    """Make a console that prints names and paths as they are: no markup, emoji or colours.

    Every console of the program comes from here; ``[v2]`` in a path is no markup.
    """
    return Console(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


class ProgressBar:
    """Counts and sentences on standard error; the bar is cleared at the end.

    The time left follows from the mean rate since the start: proposals between
    shifts count, and a total that changes does not reset it, as it resets rich's own rate.
    """

    def __init__(self) -> None:
        self._console = terminal(stderr=True)
        self._bar: rich_progress.Progress | None = None
        self._printed = self._moved = 0.0

    def update(self, count: Count) -> None:
        """Show a count: move the bar, or print a line now and then."""
        if self._bar is None:
            if count.ended:
                return
            columns = rich_progress.BarColumn(), rich_progress.TextColumn("{task.description}")
            self._bar = rich_progress.Progress(
                "simulating", *columns, rich_progress.TimeElapsedColumn(), console=self._console,
                transient=True, disable=not self._console.is_terminal,
            )  # fmt: skip
            self._bar.add_task("", total=count.total)
            self._bar.start()
            self._printed, self._moved = self._console.get_time(), 0
        (task,) = self._bar.tasks
        total = f"at most {count.total}" if count.at_most else f"{count.total}"
        words, new = f"{count.done} of {total} {count.unit}", count.done - count.known
        if new:
            left = (task.elapsed or 0.0) / new * (count.total - count.done)
            words += f", {about(left)} left"
        moved = new > self._moved
        self._bar.update(task.id, total=count.total, completed=count.done, description=words)
        now = self._console.get_time()
        if count.ended:
            self._bar.stop()
            self._bar = None
        elif not self._console.is_terminal and moved and now - self._printed >= LINE_EVERY:
            self._printed, self._moved = now, new
            self._console.print(words, soft_wrap=True)

    def say(self, line: str) -> None:
        """Print a sentence above the bar."""
        self._console.print(line, soft_wrap=True)


def say(line: str) -> None:
    """Print a sentence on standard error."""
    terminal(stderr=True).print(line, soft_wrap=True)
