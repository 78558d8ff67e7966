"""Printing of sentences, tables and progress in a terminal or a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from rich import progress as rich_progress
from rich.console import Console
from rich.table import Table as RichTable

from dogshape.pipeline.progress import Progress, WorkCounter

if TYPE_CHECKING:
    from dogshape.pipeline.record import Table

CELL_INTERVAL_S = 0.5  #: between counts in a notebook
LINE_INTERVAL_S = 15.0  #: between lines of progress where standard error is no terminal
COLUMN_GAP = 2  #: characters between columns of a table
MIN_TIMED_S = 5.0  #: of work, from which less than a minute is estimated
MIN_TIMED_SHARE = 0.01  #: of the work, from which the remaining time is estimated


def terminal(*, stderr: bool = False, width: int | None = None) -> Console:
    """Make a console that prints names and paths unchanged: no markup, emoji or colours.

    Every console of the program comes from here; ``[v2]`` in a path is no markup.
    """
    return Console(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


def print_parts(console: Console, parts: Iterable[str | Table]) -> None:
    """Print sentences, and tables with text to the left, numbers to the right, groups in bold."""
    for part in parts:
        if isinstance(part, str):
            console.print(part)
        else:
            for block in _table_blocks(part, console.width):
                console.print(block)


def _table_blocks(table: Table, width: int) -> Iterator[RichTable]:
    """Split a table into blocks of ``width`` characters; each repeats the first column."""
    is_text = _text_columns(table)
    min_widths, full_widths = _column_widths(table, is_text)
    columns = [0]
    for index in range(1, len(table.heads) + 1):
        spare = width + COLUMN_GAP - sum(min_widths[k] + COLUMN_GAP for k in columns)
        if index < len(table.heads) and min_widths[index] + COLUMN_GAP <= spare:
            columns.append(index)
            continue
        _widen_columns(columns, min_widths, full_widths, spare)
        yield _table_block(table, columns, min_widths, is_text)
        columns = [0, index]


def _text_columns(table: Table) -> list[bool]:
    """Select the columns of text, whose words are not broken."""
    if not any(table.heads):
        return [True] * len(table.heads)
    return [index == 0 or index in table.words for index in range(len(table.heads))]


def _column_widths(table: Table, is_text: list[bool]) -> tuple[list[int], list[int]]:
    """Compute the widths of each column without broken words, and without wrapped lines."""
    min_widths = []
    full_widths = []
    for index, head in enumerate(table.heads):
        cells = [row[index] for row in table.rows if index < len(row)]
        lines = [line for cell in cells for line in cell.split("\n")]
        unbroken = " ".join(lines).split() if is_text[index] else lines
        min_widths.append(max(map(len, (*head.split(), *unbroken)), default=0))
        full_widths.append(max(map(len, (head, *lines))))
    return min_widths, full_widths


def _widen_columns(
    columns: list[int], widths: list[int], full_widths: list[int], spare: int
) -> None:
    """Distribute spare characters over the ``widths`` of a block, in place, narrow lacks first."""
    by_lack = sorted(columns, key=lambda k: full_widths[k] - widths[k])
    for position, k in enumerate(by_lack):
        share = spare // (len(columns) - position)
        growth = max(0, min(full_widths[k] - widths[k], share))
        widths[k] += growth
        spare -= growth


def _table_block(
    table: Table, columns: list[int], widths: list[int], is_text: list[bool]
) -> RichTable:
    """Lay out some columns of a table."""
    block = RichTable(box=None, pad_edge=False, header_style="bold", show_header=any(table.heads))
    for k in columns:
        justify: Any = "left" if is_text[k] else "right"
        block.add_column(table.heads[k], justify=justify, overflow="fold", width=widths[k])
    for number, row in enumerate(table.rows):
        style = "bold" if table.looks.get(number) == "group" else None
        block.add_row(*(row[k] for k in columns if k < len(row)), style=style)
    return block


class ProgressBar(Progress):
    """Bar and sentences of long work: cleared at the end; in a notebook counts in one cell.

    The remaining time follows from the mean rate since the start, from a hundredth of the work on:
    proposals between shifts count, and a total that changes does not reset it, as rich's own.
    """

    def __init__(self) -> None:
        self._console = terminal(stderr=True)
        self._bar: rich_progress.Progress | None = None
        self._cell: Any = None  #: display of a notebook
        self._print_time = 0.0  #: s, of the last line or cell
        self._printed_count = 0.0  #: new work at the last line

    @property
    def is_watched(self) -> bool:
        """Whether standard error is a terminal or the cell of a notebook."""
        return self._console.is_terminal or self._console.is_jupyter

    def update(self, count: WorkCounter) -> None:
        """Show a count: by the bar, at intervals as a line or in the cell of a notebook."""
        if self._bar is None:
            if count.ended:
                return
            self._bar = self._start_bar(count)
        bar = self._bar
        (task,) = bar.tasks
        text = _count_text(count, task.elapsed or 0.0)
        new = count.done - count.known
        bar.update(task.id, total=count.total, completed=count.done, description=text)
        if count.ended:
            bar.stop()
            self._bar = None
        self._print_count(text, new, count.ended)

    def _print_count(self, text: str, new: int, ended: bool) -> None:
        """Show a count in the cell of a notebook, or print new work as a line, at intervals."""
        now = self._console.get_time()
        elapsed = now - self._print_time
        if self._cell is not None and (ended or elapsed >= CELL_INTERVAL_S):
            self._print_time = now
            self._cell.update({"text/plain": f"simulating: {text}"}, raw=True)
            return
        prints_lines = not self._console.is_terminal and not ended
        if prints_lines and new > self._printed_count and elapsed >= LINE_INTERVAL_S:
            self._print_time = now
            self._printed_count = new
            self._console.print(text, soft_wrap=True)

    def _start_bar(self, count: WorkCounter) -> rich_progress.Progress:
        """Start the bar, and the cell in a notebook."""
        bar = rich_progress.Progress(
            "simulating",
            rich_progress.BarColumn(),
            rich_progress.TextColumn("{task.description}"),
            rich_progress.TimeElapsedColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        bar.add_task("", total=count.total)
        bar.start()
        if self._console.is_jupyter:
            from IPython.display import display  # noqa: PLC0415  # there is a notebook

            show: Any = display  # has no types
            self._cell = show({"text/plain": ""}, raw=True, display_id=True)
        # Of several short works one after another a line appears at intervals too.
        self._print_time = self._print_time or self._console.get_time()
        self._printed_count = 0
        return bar

    def say(self, line: str) -> None:
        """Print a sentence above the bar."""
        self._console.print(line, soft_wrap=True)


def _count_text(count: WorkCounter, elapsed: float) -> str:
    """Describe finished work and, from a hundredth of it on, the remaining time if it is known.

    ``elapsed`` is the time since the start, s.
    """
    total = f"at most {count.total}" if count.at_most else f"{count.total}"
    text = f"{count.done} of {total} {count.unit}"
    if count.stage:
        return f"{count.stage}: {text}"
    new = count.done - count.known
    if count.ended or not new > MIN_TIMED_SHARE * count.total:
        return text
    minutes = elapsed / new * (count.total - count.done) / 60.0
    if minutes < 1.0:
        return f"{text}, less than 1 min left" if elapsed >= MIN_TIMED_S else text
    if minutes < 120.0:
        return f"{text}, {minutes:.0f} min left"
    return f"{text}, {minutes / 60.0:.1f} h left"
