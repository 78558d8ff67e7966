"""Where simulations run, and where finished ones wait while the work goes on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.executor import Executor, kept_shifts, scratch_executor, work_folder
from dogshape.sim.errors import InputError, refusal, require_between

Angles = int | Sequence[float] | None  #: how many evenly spaced ones, or listed ones, deg


def receiver(wanted: Progress | bool) -> Progress:
    """Give what receives progress: a bar in terminal or notebook for True, nothing for False."""
    from dogshape.terminal import ProgressBar  # noqa: PLC0415  # rich, which few calls need

    bar = ProgressBar() if wanted else SILENT
    return bar if isinstance(wanted, bool) else wanted


@dataclass(frozen=True)
class Where:
    """Where shifts run, and where finished ones are kept until all of the work is done.

    ``jobs`` is 0 for one worker a core, ``cluster`` the address of a Dask scheduler, ``keep`` the
    folder in which a run that was stopped leaves its finished shifts.
    """

    jobs: int = 0
    cluster: str | None = None
    keep: str | Path | None = None
    progress: Progress | bool = False

    @contextmanager
    def executor(
        self, name: str, asked: tuple[Any, ...], shifts: int
    ) -> Iterator[tuple[Executor, WorkCounter]]:
        """Give what simulates the shifts of one question, and the counter that it counts into."""
        with WorkCounter(receiver(self.progress), shifts) as counter:
            if self.keep is None:
                yield scratch_executor(self.jobs, counter.advance, self.cluster), counter
                return
            folder = work_folder(Path(self.keep), name, *asked)
            with kept_shifts(folder, counter, self.jobs, self.cluster) as executor:
                yield executor, counter


def require_angles(angles: Angles) -> None:
    """Raise InputError for no relative angle, or angles, deg, of which one is not finite."""
    if isinstance(angles, int):
        require_between("--angles", angles, 1, 100_000, "give for instance 24")
    for angle in () if angles is None or isinstance(angles, int) else angles:
        if not abs(angle) <= 1e6:
            rule, remedy = "it must be a finite angle", "give an angle in degrees"
            raise InputError(refusal("relative angle", angle, "deg", rule, remedy))
