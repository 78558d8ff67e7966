"""The options that the verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.pipeline.config.study_file import Study, profile_for
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.passing import require_stiff_enough
from dogshape.sim.units import DEG, RPM

StudyArg = Annotated[
    str, typer.Argument(metavar="STUDY", help="TOML file, folder with study.toml, or bundled name")
]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="override a key, e.g. dog.chamfer_deg=14"),
]
Json = Annotated[bool, typer.Option("--json", help="print one JSON document")]
Cluster = Annotated[
    str | None, typer.Option(help="Dask scheduler to simulate on, e.g. tcp://scheduler:8786")
]
Corrections = Annotated[
    list[str] | None,
    typer.Option("--correct", metavar="QUANTITY=WAY", help="take a column so, e.g. time=ms"),
]
Jobs = Annotated[int, typer.Option("--jobs", min=0, help="worker processes, 0: one a core")]


SurrogateFile = Annotated[
    Path | None, typer.Option(help="default: of results/NAME, or the package's")
]
OneMismatch = Annotated[float | None, typer.Option(help="one operating point only")]
OneForce = Annotated[float | None, typer.Option("--force-N", help="with --mismatch-rpm")]


def point_of(
    study: Study, mismatch: float, force: float, rise: float | None, other_way: str = ""
) -> OperatingPoint:
    """Return an operating point from 1/min, N and a rise time in s, None for the study's.

    ``other_way`` is what the verb offers for a force that the study's table lacks.
    """
    point = OperatingPoint(mismatch * RPM, profile_for(study.file, force, rise, other_way))
    require_stiff_enough(study.clutch, force)
    return point


def points_of(
    study: Study,
    mismatch: float | None,
    force: float | None,
    rise: float | None = None,
    other_way: str = "",
) -> tuple[OperatingPoint, ...]:
    """Return the one operating point that is asked for, or all of the study's."""
    if (mismatch is None) != (force is None):
        raise InputError("one operating point needs --mismatch-rpm and --force-N; give both")
    if mismatch is None or force is None:
        return study.points
    return (point_of(study, mismatch, force, rise, other_way),)


def angles_of(text: str | None, default: int) -> tuple[int, tuple[float, ...]]:
    """Return how many angles, and the angles in rad where they are listed."""
    if text is None:
        return default, ()
    try:
        if "," in text:
            listed = tuple(float(part) * DEG for part in text.split(","))
            if all(abs(angle) < 1e4 for angle in listed):
                return len(listed), listed
        elif 1 <= int(text) <= 100_000:
            return int(text), ()
    except ValueError:
        pass
    raise InputError(
        f"--angles is '{text}', but it must be a whole number from 1 to 100000 "
        "or a list of angles in degrees; write for instance 24 or 0,6,12,18"
    )
