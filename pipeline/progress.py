"""Progress of long work, for a library that prints nothing.

Work counts into a ``WorkCounter``, which informs a ``Progress`` such as the command line's bar.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol


@dataclass(frozen=True)
class Count:
    """Progress of long work, of which an earlier run had finished ``known``.

    ``total`` may be an upper bound, ``unit`` is a plural; ended is the work finished or not.
    """

    done: int
    total: int
    known: int = 0
    at_most: bool = False
    unit: str = "shifts"
    ended: bool = False


class Progress(Protocol):
    """Receiver of the progress of long work."""

    def update(self, count: Count) -> None:
        """Take the count, each time that it changes."""
        return

    def say(self, line: str) -> None:
        """Take a sentence for the user."""
        return


class _Silent(Progress):
    pass


SILENT: Progress = _Silent()  #: ignores what it gets


class WorkCounter:
    """Counter of finished work that informs a progress; a context manager that reports the end.

    ``total`` is expected in all, or an upper bound (``most``), of ``unit``, a plural.
    """

    def __init__(
        self, progress: Progress, total: int, *, most: bool = False, unit: str = "shifts"
    ) -> None:
        self._progress = progress
        self._count = Count(0, total, at_most=most, unit=unit)

    def __enter__(self) -> WorkCounter:
        self._change()
        return self

    def __exit__(self, *_: object) -> None:
        self._change(ended=True)

    def _change(self, **changes: Any) -> None:
        self._count = replace(self._count, **changes)
        self._progress.update(self._count)

    def advance(self, count: int, known: int = 0) -> None:
        """Count ``count`` more as done, ``known`` of them by an earlier run; raise the total."""
        done = self._count.done + count
        total = max(self._count.total, done)
        self._change(done=done, known=self._count.known + known, total=total)

    def rest(self, count: int) -> None:
        """Expect ``count`` more than those that are done."""
        self._change(total=self._count.done + count)

    @contextmanager
    def kept_in(self, root: Path, how: str) -> Iterator[None]:
        """Name on Ctrl-C the folder of finished shifts and the way to go on."""
        try:
            yield
        except KeyboardInterrupt:
            self.say(f"finished shifts are kept in {root}; {how}")
            raise

    def say(self, line: str) -> None:
        """Hand on a sentence for the user."""
        self._progress.say(line)


def about(seconds: float) -> str:
    """Round a time, s, to words: minutes, from two hours on hours and minutes."""
    minutes = round(seconds / 60.0)
    if seconds < 45.0:
        return "less than a minute"
    if minutes <= 1:
        return "about a minute"
    if minutes < 120:
        return f"about {minutes} minutes"
    step = 10 if minutes < 600 else 60  # nobody plans by the minute what takes hours
    hours, left = divmod(step * round(minutes / step), 60)
    return f"about {hours} h {left} min" if left else f"about {hours} h"
