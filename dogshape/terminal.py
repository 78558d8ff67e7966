"""Sentences, tables and progress as a terminal or a notebook shows them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from rich import progress as rich_progress
from rich.console import Console
from rich.table import Table as RichTable

from dogshape.pipeline.progress import Progress, WorkCounter

if TYPE_CHECKING:
    from dogshape.pipeline.record import Table

CELL_EVERY = 0.5  #: s between counts in a notebook
LINE_EVERY = 15.0  #: s between lines of progress where standard error is no terminal


def terminal(*, stderr: bool = False, width: int | None = None) -> Console:
    """Make a console that prints names and paths as they are: no markup, emoji or colours.

    Every console of the program comes from here; ``[v2]`` in a path is no markup.
    """
    return Console(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


def print_parts(console: Console, parts: Iterable[str | Table]) -> None:
    """Print sentences, and tables with words to the left, numbers to the right, groups in bold."""
    for part in parts:
        for one in [part] if isinstance(part, str) else _drawn(part, console.width):
            console.print(one)


def _drawn(table: Table, width: int) -> Iterator[RichTable]:
    """Lay a table out in ``width`` characters: words whole, columns too many below the others."""
    facts, least, most = not any(table.heads), list[int](), list[int]()
    texts = [facts or place == 0 or place in table.words for place in range(len(table.heads))]
    for place, head in enumerate(table.heads):
        lines = [line for row in table.rows for cell in row[place : place + 1]
                 for line in cell.split("\n")]  # fmt: skip
        whole = " ".join(lines).split() if texts[place] else lines
        least.append(max(map(len, (*head.split(), *whole)), default=0))
        most.append(max(map(len, (head, *lines))))
    columns = [0]
    for place in range(1, len(least) + 1):
        spare = width + 2 - sum(least[k] + 2 for k in columns)
        if place < len(least) and least[place] + 2 <= spare:
            columns.append(place)
            continue
        drawn = RichTable(box=None, pad_edge=False, header_style="bold", show_header=not facts)
        for left, k in enumerate(sorted(columns, key=lambda k: most[k] - least[k])):
            more = max(0, min(most[k] - least[k], spare // (len(columns) - left)))
            least[k], spare = least[k] + more, spare - more
        for k in columns:
            justify: Any = "left" if texts[k] else "right"
            drawn.add_column(table.heads[k], justify=justify, overflow="fold", width=least[k])
        for number, row in enumerate(table.rows):
            style = "bold" if table.looks.get(number) == "group" else None
            drawn.add_row(*(row[k] for k in columns if k < len(row)), style=style)
        yield drawn
        columns = [0, place]


class ProgressBar(Progress):
    """Bar and sentences of long work: cleared at the end, in a notebook counts that stay in a cell.

    The time left follows from the mean rate since the start, from a hundredth of the work on:
    proposals between shifts count, and a total that changes does not reset it, as rich's own.
    """

    def __init__(self) -> None:
        self._console = terminal(stderr=True)
        self._bar: rich_progress.Progress | None = None
        self._cell: Any = None  #: what a notebook shows
        self._printed = self._moved = 0.0

    def update(self, count: WorkCounter) -> None:
        """Show a count: move the bar, or now and then a line, in a notebook always the same."""
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
            if self._console.is_jupyter:
                from IPython.display import display  # noqa: PLC0415  # there is a notebook

                show: Any = display  # has no types
                self._cell = show({"text/plain": ""}, raw=True, display_id=True)
            self._printed, self._moved = self._console.get_time(), 0
        (task,) = self._bar.tasks
        total = f"at most {count.total}" if count.at_most else f"{count.total}"
        words, new = f"{count.done} of {total} {count.unit}", count.done - count.known
        if new > 0.01 * count.total and not count.ended:
            left = (task.elapsed or 0.0) / new * (count.total - count.done) / 60.0
            words += f", {left:.0f} min left" if left < 120.0 else f", {left / 60.0:.1f} h left"
        moved = new > self._moved and not self._console.is_terminal
        self._bar.update(task.id, total=count.total, completed=count.done, description=words)
        now = self._console.get_time()
        if count.ended:
            self._bar.stop()
            self._bar = None
        if self._cell is not None and (count.ended or now - self._printed >= CELL_EVERY):
            self._printed = now
            self._cell.update({"text/plain": f"simulating: {words}"}, raw=True)
        elif self._bar is not None and moved and now - self._printed >= LINE_EVERY:
            self._printed, self._moved = now, new
            self._console.print(words, soft_wrap=True)

    def say(self, line: str) -> None:
        """Print a sentence above the bar."""
        self._console.print(line, soft_wrap=True)
