"""Progress of long work on standard error: a bar with the time left, or plain lines."""

from __future__ import annotations

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from dogshape.cli.console import terminal
from dogshape.pipeline.progress import Count, about

LINE_EVERY = 15.0  #: s between lines where standard error is no terminal


class ProgressBar:
    """Counts and sentences on standard error; the bar is cleared at the end.

    The time left follows from the mean rate since the start: proposals and screens between
    shifts count, and a total that changes does not reset it, as it resets rich's own rate.
    """

    def __init__(self) -> None:
        self._console = terminal(stderr=True)
        self._bar: Progress | None = None
        self._printed = self._moved = 0.0

    def update(self, count: Count) -> None:
        """Show a count: move the bar, or print a line now and then."""
        if self._bar is None and not count.ended:
            self._start(count)
        if self._bar is None:
            return
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

    def _start(self, count: Count) -> None:
        columns = BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
        self._bar = Progress(
            "simulating",
            *columns,
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._bar.add_task("", total=count.total)
        self._bar.start()
        self._printed, self._moved = self._console.get_time(), 0

    def say(self, line: str) -> None:
        """Print a sentence above the bar."""
        self._console.print(line, soft_wrap=True)


def say(line: str) -> None:
    """Print a sentence on standard error."""
    terminal(stderr=True).print(line, soft_wrap=True)
