"""Progress of long work, for a library that prints nothing.

Work counts into a ``WorkCounter``, which informs a ``Progress`` such as the command line's bar.
"""

from __future__ import annotations

from collections.abc import Callable

Say = Callable[[str], None]  #: takes a sentence for people


class Progress:
    """Receiver of the progress of long work; this one ignores it."""

    def update(self, count: WorkCounter) -> None:
        """Take the count, each time that it changes."""

    def say(self, line: str) -> None:
        """Take a sentence for the user."""


SILENT = Progress()


class WorkCounter:
    """Counter of finished work that informs a progress; a context manager that reports the end.

    ``done`` of ``total`` are finished, an upper bound if ``at_most``, ``known`` of them by an
    earlier run; ``unit`` is a plural. ``ended`` is the work finished or not. On Ctrl-C it names the
    folder of finished shifts and the way to go on, ``kept``.
    """

    def __init__(
        self,
        progress: Progress,
        total: int,
        *,
        most: bool = False,
        unit: str = "shifts",
        kept: str = "",
    ) -> None:
        self._progress, self._kept, self.done, self.known = progress, kept, 0, 0
        self.total, self.at_most, self.unit, self.ended = total, most, unit, False

    def __enter__(self) -> WorkCounter:
        self._progress.update(self)
        return self

    def __exit__(self, _kind: object, error: object, _trace: object) -> None:
        if self._kept and isinstance(error, KeyboardInterrupt):
            self.say(f"finished shifts are kept in {self._kept}")
        self.ended = True
        self._progress.update(self)

    def advance(self, count: int, known: int = 0) -> None:
        """Count ``count`` more as done, ``known`` of them by an earlier run; raise the total."""
        self.done, self.known = self.done + count, self.known + known
        self.total = max(self.total, self.done)
        self._progress.update(self)

    def rest(self, count: int) -> None:
        """Expect ``count`` more than those that are done."""
        self.total = self.done + count
        self._progress.update(self)

    def say(self, line: str) -> None:
        """Hand on a sentence for the user."""
        self._progress.say(line)
