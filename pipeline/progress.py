"""Progress of long work: what a library tells whoever waits for it.

A library prints nothing. It counts into a ``WorkCounter``, which tells a ``Progress``: the command
line's bar (``pipeline.cli.progress_bar``), a notebook's, or ``SILENT``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol

from dogshape.pipeline.forecast import NO_GUESS, Forecast, Kind


@dataclass(frozen=True)
class Count:
    """Progress of long work.

    Parameters
    ----------
    done, total : counted so far, and expected in all.
    known : of ``done``, those that an earlier run finished: they say nothing of the time left.
    at_most : whether ``total`` is an upper bound.
    unit : what is counted.
    ended : whether the work is over, finished or not.
    left_s : foreseen time left, s; None where it follows from the counts alone.
    """

    done: int
    total: int
    known: int = 0
    at_most: bool = False
    unit: str = "shifts"
    ended: bool = False
    left_s: float | None = None


class Progress(Protocol):
    """Whoever waits for long work."""

    def update(self, count: Count) -> None:
        """Take the count, each time that it changes."""
        ...

    def say(self, line: str) -> None:
        """Take a sentence for the user."""
        ...


class _Silent:
    """Progress that nobody watches."""

    def update(self, count: Count) -> None:
        """Ignore a count."""

    def say(self, line: str) -> None:
        """Ignore a sentence."""


SILENT: Progress = _Silent()


class WorkCounter:
    """Count finished shifts into a progress; a context manager that says when the work ends.

    ``most`` says that ``total`` is an upper bound, ``unit`` what is counted. ``forecast`` foresees
    the time left where shifts are not all of the work; without it the time follows from what was
    counted so far, each shift weighed by what it likely costs; ``extra`` is how many usual ones
    more than ``total`` the whole work costs.
    """

    def __init__(
        self, progress: Progress, total: int, *, most: bool = False, unit: str = "shifts",
        forecast: Forecast | None = None, extra: float = 0.0,
    ) -> None:  # fmt: skip
        self._progress = progress
        self._total = total
        self._most = most
        self._unit = unit
        self._bare = forecast is None  # nothing but shifts, and no guess of their cost
        self._forecast = forecast or Forecast({"shift": total + extra}, weight=NO_GUESS)
        self._done = self._known = 0
        self._kind: Kind = "shift"
        self._factor, self._weighed = 1.0, False

    def __enter__(self) -> WorkCounter:
        self._update()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self._update(ended=True)

    def _update(self, *, ended: bool = False) -> None:
        foreseen = not self._bare or (self._weighed and self._forecast.done)
        left = self._forecast.seconds if foreseen else None
        count = Count(self._done, self._total, self._known, self._most, self._unit, ended, left)
        self._progress.update(count)

    def advance(self, count: int) -> None:
        """Count ``count`` more finished shifts; more than were expected raise the total."""
        self.of(self._kind)(count)

    def of(self, kind: Kind) -> Callable[[int], None]:
        """Give what counts finished shifts of a kind."""

        def advance(count: int) -> None:
            self._forecast.report(kind, count * self._factor)
            self._add(count)

        return advance

    def known_of(self, kind: Kind) -> Callable[[int], None]:
        """Give what counts shifts of a kind that an earlier run finished."""

        def known(count: int) -> None:
            self._known += count
            self._forecast.skip(kind, count)
            self._add(count)

        return known

    def weigh(self, factor: float) -> None:
        """Take that each of the shifts counted next costs ``factor`` times the mean of its kind."""
        self._factor, self._weighed = factor, True

    def worked(self, kind: Kind, count: int = 1) -> None:
        """Take that work was finished that is no shift."""
        self._forecast.report(kind, count)
        self._update()

    def foresee(self, kind: Kind, count: float) -> None:
        """Expect ``count`` more shifts of a kind, which the total has already."""
        self._forecast.left[kind] = count
        self._update()

    def confirms(self, other: bool = True) -> None:
        """Take all further shifts for those of another engine, which confirms, or of the same."""
        self._kind = "confirm" if other else "shift"

    def quick(self, count: int) -> None:
        """Take ``count`` more finished shifts of the compiled engine, which are not counted."""
        self._forecast.report("quick", count * self._factor)
        self._update()

    def proposed(self) -> None:
        """Take that what went before was no simulation but a proposal of designs."""
        self._forecast.report("design", 0)

    def asked(self, count: int) -> None:
        """Take ``count`` more designs as proposed; the first ones fill the space."""
        first = self._forecast.left.get("first", 0.0) > 0.0
        self._forecast.report("first" if first else "design", count)
        self._update()

    def told(self, left: Mapping[Kind, float]) -> None:
        """Take what is expected of each kind after a round of designs was told."""
        self._forecast.report("design", 0)
        self.expects(left)

    def expects(self, left: Mapping[Kind, float]) -> None:
        """Take what is expected of each kind from now on."""
        self._forecast.expect(left)
        self._update()

    def _add(self, count: int) -> None:
        self._done += count
        self._total = max(self._total, self._done)
        self._update()

    def known(self, count: int) -> None:
        """Count shifts that an earlier run finished."""
        self.known_of(self._kind)(count)

    def extend(self, count: int) -> None:
        """Expect ``count`` more shifts than was said at first."""
        self._total += count
        if self._bare:
            self._forecast.left["shift"] += count
        self._update()

    def rest(self, count: int) -> None:
        """Expect ``count`` more shifts after those that are done, whatever was said before."""
        self._total = self._done + count
        if self._bare:
            self._forecast.left["shift"] = count
        self._update()

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
