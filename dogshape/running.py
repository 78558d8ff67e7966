"""Where simulations run, and where finished ones wait while the work goes on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.executor import Executor, kept_shifts, scratch_executor, work_folder
from dogshape.sim.errors import InputError, refusal


@dataclass(frozen=True)
class Where:
    """Where shifts run, and where finished ones are kept until all of the work is done.

    ``jobs`` is 0 for one worker a core, ``cluster`` the address of a Dask scheduler, ``keep`` the
    folder in which a run that was stopped leaves its finished shifts.
    """

    jobs: int = 0
    cluster: str | None = None
    keep: Path | None = None
    progress: Progress = SILENT

    @contextmanager
    def executor(self, name: str, asked: tuple[Any, ...], shifts: int) -> Iterator[Running]:
        """Give what simulates the shifts of one question, and counts them."""
        with WorkCounter(self.progress, shifts) as counter:
            if self.keep is None:
                executor = scratch_executor(self.jobs, counter.advance, self.cluster)
                yield Running(executor, counter)
                return
            folder = work_folder(self.keep, name, *asked)
            with kept_shifts(folder, counter, self.jobs, self.cluster) as executor:
                yield Running(executor, counter)


@dataclass(frozen=True)
class Running:
    """An executor with the counter that it counts into."""

    executor: Executor
    counter: WorkCounter


def angles_text(angles: int | Sequence[float] | None) -> str | None:
    """Write angles as the command line takes them; a question has the same folder either way."""
    if angles is None or isinstance(angles, int):
        return None if angles is None else str(angles)
    return ",".join(f"{angle:.12g}" for angle in angles)


def require_angles(angles: int | Sequence[float] | None) -> None:
    """Raise InputError for relative angles, deg, of which one is no finite angle."""
    listed = () if angles is None or isinstance(angles, int) else angles
    for angle in listed:
        if not abs(angle) <= 1e6:
            rule, remedy = "it must be a finite angle", "give an angle in degrees"
            raise InputError(refusal("relative angle", angle, "deg", rule, remedy))
