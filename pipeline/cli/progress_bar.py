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
    TimeRemainingColumn,
)

from dogshape.pipeline.cli.console import terminal
from dogshape.pipeline.progress import Count

LINE_EVERY = 15.0  #: s between lines where standard error is no terminal


def duration(seconds: float) -> str:
    """Return a time as people say it: in s below two minutes, then in min, then in h and min."""
    minutes = round(seconds / 60.0)
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    if minutes < 120:
        return f"{minutes} min"
    return f"{minutes // 60} h" if minutes >= 600 else f"{minutes // 60} h {minutes % 60} min"


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

    def _draw(self, count: Count) -> None:
        if self._bar is None:
            unit = f"{count.unit} at most" if count.at_most else count.unit
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[unit]}"),
                TimeElapsedColumn(),
                TextColumn("left"),
                TimeRemainingColumn(),
                console=self._console,
                transient=True,
            )
            self._task = self._bar.add_task("simulating", total=count.total, unit=unit)
            self._bar.start()
        self._bar.update(self._task, completed=count.done, total=count.total)

    def _line(self, count: Count) -> None:
        if count.done == 0:  # new work begins
            self._start = self._said = time.monotonic()
            self._told = 0
        now, new = time.monotonic(), count.done - count.known
        if new and count.done > self._told and now - self._said >= LINE_EVERY:
            self._said, self._told = now, count.done
            left = (now - self._start) / new * max(0, count.total - count.done)
            total = f"at most {count.total}" if count.at_most else f"{count.total}"
            line = f"{count.done} of {total} {count.unit}, about {duration(left)} left"
            self._console.print(line, soft_wrap=True, highlight=False)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def say(line: str) -> None:
    """Print a sentence on standard error."""
    terminal(stderr=True).print(line, soft_wrap=True)
