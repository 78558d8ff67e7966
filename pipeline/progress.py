"""Progress of long work on standard error: a bar with the time left, or plain lines."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from dogshape.pipeline.console import terminal

LINE_EVERY = 15.0  #: s between lines where standard error is no terminal


def duration(seconds: float) -> str:
    """Return a time as people say it: in s below two minutes, then in min, then in h and min."""
    minutes = round(seconds / 60.0)
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    if minutes < 120:
        return f"{minutes} min"
    return f"{minutes // 60} h" if minutes >= 600 else f"{minutes // 60} h {minutes % 60} min"


class ShiftProgress:
    """Counts finished shifts; a context manager that clears its bar at the end.

    ``most`` says that ``total`` is an upper bound, ``unit`` what is counted.
    """

    def __init__(self, total: int, *, most: bool = False, unit: str = "shifts") -> None:
        self._console = terminal(stderr=True)
        self._total = total
        self._most = most
        self._unit = unit
        self._done = self._known = 0
        self._start = self._said = time.monotonic()
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[unit]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task(
            "simulating", total=total, unit=f"{unit} at most" if most else unit
        )

    def __enter__(self) -> ShiftProgress:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self._bar.stop()

    def advance(self, count: int) -> None:
        """Count ``count`` more finished shifts; more than were expected raise the total."""
        self._done += count
        self._total = max(self._total, self._done)
        self._bar.update(self._task, advance=count, total=self._total)
        now, new = time.monotonic(), self._done - self._known
        if new and not self._console.is_terminal and now - self._said >= LINE_EVERY:
            self._said = now
            left = (now - self._start) / new * max(0, self._total - self._done)
            total = f"at most {self._total}" if self._most else f"{self._total}"
            line = f"{self._done} of {total} {self._unit}, about {duration(left)} left"
            self._console.print(line, soft_wrap=True, highlight=False)

    def known(self, count: int) -> None:
        """Count shifts that an earlier run finished, which say nothing of the time left."""
        self._known += count
        self.advance(count)

    def extend(self, count: int) -> None:
        """Expect ``count`` more shifts than was said at first."""
        self._total += count
        self._bar.update(self._task, total=self._total)

    def rest(self, count: int) -> None:
        """Expect ``count`` more shifts after those that are done, whatever was said before."""
        self._total = self._done + count
        self._bar.update(self._task, total=self._total)

    @contextmanager
    def kept_in(self, root: Path, how: str) -> Iterator[None]:
        """Say on Ctrl-C where finished shifts are, and how to go on."""
        try:
            yield
        except KeyboardInterrupt:
            self.say(f"finished shifts are kept in {root}; {how}")
            raise

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._console.print(line, soft_wrap=True)


def say(line: str) -> None:
    """Print a line on standard error."""
    terminal(stderr=True).print(line, soft_wrap=True)
