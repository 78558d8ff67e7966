"""Progress of long work on standard error: a bar with the time left, or plain lines."""

from __future__ import annotations

import time

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from dogshape.pipeline.cli.console import terminal
from dogshape.pipeline.duration import about
from dogshape.pipeline.progress import Count

LINE_EVERY = 15.0  #: s between lines where standard error is no terminal


class ProgressBar:
    """Show counts and sentences on standard error; a bar that is cleared at the end."""

    def __init__(self) -> None:
        self._console = terminal(stderr=True)
        self._bar: Progress | None = None
        self._task = TaskID(0)
        self._start = self._said = time.monotonic()
        self._told = 0

    def update(self, count: Count) -> None:
        """Show a count: move the bar, or print a line now and then."""
        if count.ended:
            self._close()
        elif self._console.is_terminal:
            self._draw(count)
        else:
            self._line(count)

    def say(self, line: str) -> None:
        """Print a sentence above the bar."""
        self._console.print(line, soft_wrap=True)

    def _left(self, count: Count) -> float | None:
        """Foresee the time left, s; None before anything is known of it."""
        if count.left_s is not None:
            return count.left_s
        new = count.done - count.known
        lasted = time.monotonic() - self._start
        return lasted / new * max(0, count.total - count.done) if new else None

    def _draw(self, count: Count) -> None:
        if self._bar is None:
            unit = f"{count.unit} at most" if count.at_most else count.unit
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[unit]}"),
                TimeElapsedColumn(),
                TextColumn("{task.fields[left]}"),
                console=self._console,
                transient=True,
            )
            self._task = self._bar.add_task("simulating", total=count.total, unit=unit, left="")
            self._start = time.monotonic()
            self._bar.start()
        left = self._left(count)
        words = "" if left is None else f"{about(left)} left"
        self._bar.update(self._task, completed=count.done, total=count.total, left=words)

    def _line(self, count: Count) -> None:
        if count.done == 0:  # new work begins
            self._start = self._said = time.monotonic()
            self._told = 0
        now, left = time.monotonic(), self._left(count)
        moved = count.left_s is not None or count.done > self._told
        if left is not None and moved and now - self._said >= LINE_EVERY:
            self._said, self._told = now, count.done
            total = f"at most {count.total}" if count.at_most else f"{count.total}"
            line = f"{count.done} of {total} {count.unit}, {about(left)} left"
            self._console.print(line, soft_wrap=True, highlight=False)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def say(line: str) -> None:
    """Print a sentence on standard error."""
    terminal(stderr=True).print(line, soft_wrap=True)
