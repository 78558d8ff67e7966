"""The options that the verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dogshape.cli.console import warn
from dogshape.sim.errors import InputError

StudyArg = Annotated[
    str, typer.Argument(metavar="STUDY", help="TOML file, folder with study.toml, or bundled name")
]


def _said_twice(sets: list[str] | None) -> list[str] | None:
    """Warn of keys that ``--set`` gives twice: the last one counts."""
    last = {text.partition("=")[0].strip(): text for text in sets or []}
    for key, text in last.items():
        if [one.partition("=")[0].strip() for one in sets or []].count(key) > 1:
            warn([f"--set gives {key} more than once; the last one counts, {text}"])
    return sets


Sets = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="override a key, e.g. dog.chamfer_deg=14",
        callback=_said_twice,
    ),
]
Engine = Annotated[
    str | None,
    typer.Option(help="drake, or planar: compiled, many times faster; default: the study's"),
]
Json = Annotated[bool, typer.Option("--json", help="print one JSON document")]
Cluster = Annotated[
    str | None, typer.Option(help="Dask scheduler to simulate on, e.g. tcp://scheduler:8786")
]
Corrections = Annotated[
    list[str] | None,
    typer.Option("--correct", metavar="QUANTITY=WAY", help="take a column so, e.g. time=ms"),
]
Angles = Annotated[
    str | None,
    typer.Option(help="how many evenly spaced ones, or relative angles in degrees: A,B,C"),
]
Jobs = Annotated[int, typer.Option("--jobs", min=0, help="worker processes, 0: one a core")]
SurrogateFile = Annotated[
    Path | None, typer.Option(help="default: of results/NAME, or the package's")
]
OneMismatch = Annotated[float | None, typer.Option(help="one operating point only")]
OneForce = Annotated[float | None, typer.Option("--force-N", help="with --mismatch-rpm")]


def angles_of(text: str | None) -> int | tuple[float, ...] | None:
    """Read a number of angles, or the angles in degrees where they are listed."""
    if text is None:
        return None
    try:
        if "," in text:
            listed = tuple(float(part) for part in text.split(","))
            if all(abs(angle) < 5e5 for angle in listed):
                return listed
        elif 1 <= int(text) <= 100_000:
            return int(text)
    except ValueError:
        pass
    raise InputError(
        f"--angles is '{text}', but it must be a whole number from 1 to 100000 "
        "or a list of angles in degrees; write for instance 24 or 0,6,12,18"
    )


def with_engine(overrides: list[str] | None, engine: str | None) -> list[str]:
    """Add the engine to what ``--set`` overrides."""
    return [*(overrides or []), *([f"solver.engine={engine}"] if engine else [])]
