"""Progress of long work, for a library that prints nothing.

Work counts into a ``WorkCounter``, which informs a ``Progress`` such as the command line's bar.
"""

from __future__ import annotations

from collections.abc import Callable

Say = Callable[[str], None]  #: takes a sentence for people


class Progress:
    """Receiver of the progress of long work; the base ignores it."""

    def update(self, count: WorkCounter) -> None:
        """Take the count, each time that it changes."""

    def say(self, line: str) -> None:
        """Take a sentence for the user."""


SILENT = Progress()


class WorkCounter:
    """Counter of finished work that informs a progress; a context manager that reports the end.

    Parameters
    ----------
    progress
        Receiver of the counts.
    total
        Number of work units to expect, an upper bound if ``at_most``.
    at_most
        Whether the total is an upper bound.
    unit
        Name of the work units, in the plural.
    resumption
        Folder of finished shifts and the way to go on, for a message after Ctrl-C.
    stage
        Place of this work in a longer one of unknown length, of which no remaining time is known.

    Attributes
    ----------
    done, known
        Numbers of finished units, and of these by an earlier run.
    ended
        Whether the work ended, finished or not.

    """

    def __init__(
        self,
        progress: Progress,
        total: int,
        *,
        at_most: bool = False,
        unit: str = "shifts",
        resumption: str = "",
        stage: str = "",
    ) -> None:
        self._progress = progress
        self._resumption = resumption
        self.total = total
        self.at_most = at_most
        self.unit = unit
        self.stage = stage
        self.done = 0
        self.known = 0
        self.ended = False

    def __enter__(self) -> WorkCounter:
        self._progress.update(self)
        return self

    def __exit__(self, _kind: object, error: object, _trace: object) -> None:
        if self._resumption and isinstance(error, KeyboardInterrupt):
            self.say(f"finished shifts are kept in {self._resumption}")
        self.ended = True
        self._progress.update(self)

    def advance(self, count: int, known: int = 0) -> None:
        """Count units as done, ``known`` of them by an earlier run; raise the total if needed."""
        self.done += count
        self.known += known
        self.total = max(self.total, self.done)
        self._progress.update(self)

    def expect_more(self, count: int) -> None:
        """Set the total to ``count`` more units than are done."""
        self.total = self.done + count
        self._progress.update(self)

    def say(self, line: str) -> None:
        """Pass a sentence to the user."""
        self._progress.say(line)
