"""Options that verbs share, and printing for people or for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit, Option

from dogshape.sim.errors import InputError
from dogshape.terminal import print_parts, terminal

if TYPE_CHECKING:
    from dogshape.bench.bench_draft import BenchDraft
    from dogshape.pipeline.record import Table
    from dogshape.result import Result

    Parts = Callable[[], Sequence[str | Table]]

#: Plain text for people and programs alike; without arguments the help.
PLAIN: dict[str, Any] = {
    "add_completion": False,
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
    "no_args_is_help": True,
}


def warn(notes: Iterable[str]) -> None:
    """Print warnings on standard error."""
    for note in notes:
        print(f"warning: {note}", file=sys.stderr)


def show(result: Result, as_json: bool, *extra_parts: str | Table, ok: bool = True) -> None:
    """Print a result as JSON, or its sentences and tables for people, then ``extra_parts``."""
    emit(result.to_dict(), as_json, lambda: [*result.to_parts(), *extra_parts], ok=ok)


def emit(data: dict[str, Any], json_only: bool, parts: Parts, ok: bool = True) -> None:
    """Print ``data`` as JSON, or ``parts`` for people; end with status 1 unless ``ok``."""
    console = terminal(width=None if sys.stdout.isatty() else 160)
    if json_only:
        print(json.dumps(data, indent=1, allow_nan=False))
    else:
        print_parts(console, parts())
    if not ok:
        raise Exit(1)


def _warn_of_repeats(sets: list[str] | None) -> list[str] | None:
    """Warn of keys that ``--set`` gives twice: the last one counts."""
    keys = [text.partition("=")[0].strip() for text in sets or []]
    last_settings = dict(zip(keys, sets or [], strict=True))
    for key, setting in last_settings.items():
        if keys.count(key) > 1:
            warn([f"--set gives {key} more than once; the last one counts, {setting}"])
    return sets


StudyArg = Annotated[
    str, Argument(metavar="STUDY", help="TOML file, folder with study.toml, or bundled name")
]
BenchArg = Annotated[str, Argument(metavar="BENCH_DIR", help="folder of a data set")]
BenchOrTable = Annotated[
    str, Argument(metavar="BENCH_DIR|TABLE", help="folder of a data set, CSV, or .xlsx[#SHEET]")
]
Sets = Annotated[
    list[str] | None,
    Option("--set", metavar="KEY=VALUE", help="list: 'KEY=[1, 2]'", callback=_warn_of_repeats),
]
Engine = Annotated[str | None, Option(help="drake or planar; default: the study's")]
Json = Annotated[bool, Option("--json", help="print one JSON document")]
#: Options of reading a table, in the order of ``bench_draft``.
Origin = Annotated[
    str | None, Option("--from", help="whose clutch the stand has; default: mq200_stand")
]
Columns = Annotated[list[str] | None, Option("--column", metavar="QUANTITY=COLUMN[:UNIT]")]
RiseTime = Annotated[float | None, Option("--rise-s", help="rise time where no column has it")]
Decimal = Annotated[str | None, Option(help="decimal sign of the tables, . or ,")]
Rows = Annotated[str | None, Option(help="rows that are shifts, e.g. 2-41,45")]
Drop = Annotated[list[str] | None, Option(metavar="COLUMN=VALUE", help="rows that are no shifts")]
Keep = Annotated[
    list[str] | None, Option(metavar="COLUMN=VALUE", help="rows that alone are shifts")
]
FillDown = Annotated[bool, Option("--fill-down", help="empty set values have the value above")]
SizeLimits = Annotated[
    list[str] | None,
    Option("--limit", metavar="NAME=NUMBER", help="size up to which a table is read"),
]
Quotes = Annotated[
    str | None, Option(help="none: quotation marks are ordinary signs; default: cells")
]
Cluster = Annotated[str | None, Option(help="Dask scheduler, e.g. tcp://scheduler:8786")]
Corrections = Annotated[
    list[str] | None, Option("--correct", metavar="QUANTITY=WAY", help="e.g. time=ms")
]
Journal = Annotated[Path | None, Option(help="folder of the shifts of a stopped run")]
Jobs = Annotated[int, Option("--jobs", min=0, help="worker processes, 0: one a core")]
SurrogateFile = Annotated[Path | None, Option(help="default: of results/NAME, or the package's")]
OneMismatch = Annotated[float | None, Option(help="one operating point only")]
OneForce = Annotated[float | None, Option("--force-N", help="with --mismatch-rpm")]
Rise = Annotated[float | None, Option(help="rise time; default: the study's table")]


def bench_draft(
    tables: Sequence[str | Path],
    *,
    origin: str | None,
    column: Sequence[str] | None,
    rise_s: float | None,
    decimal: str | None,
    rows: str | None,
    drop: Sequence[str] | None,
    keep: Sequence[str] | None,
    fill_down: bool,
    limit: Sequence[str] | None,
    quotes: str | None,
    set_: Sequence[str] | None,
) -> BenchDraft:
    """Build the draft of a bench folder from the options of reading; InputError for a wrong one."""
    from dogshape.bench.bench_draft import BenchDraft  # noqa: PLC0415
    from dogshape.bench.decoding import parse_limits  # noqa: PLC0415
    from dogshape.pipeline.config.study_file import pair_of  # noqa: PLC0415

    defaults = BenchDraft(tuple(tables))
    return BenchDraft(
        tables=tuple(tables),
        origin=origin or defaults.origin,
        columns=dict(column_pair(text) for text in column or ()),
        rise_s=rise_s,
        values=dict(pair_of(text) for text in set_ or ()),
        decimal=decimal,
        rows=rows or "",
        drop=tuple(drop or ()),
        keep=tuple(keep or ()),
        fill_down=fill_down,
        limits=parse_limits(dict(_limit_pair(text) for text in limit or ())),
        quotes=quotes or defaults.quotes,
    )


def column_pair(text: str) -> tuple[str, str]:
    """Split a column option into quantity and column; InputError without both."""
    name, sign, column = text.partition("=")
    if not sign or not column:
        raise InputError(
            f"--column is '{text}', but it must be QUANTITY=COLUMN or QUANTITY=COLUMN:UNIT; "
            "write for instance shift_time_s=t_shift:ms"
        )
    return name.strip(), column


def _limit_pair(text: str) -> tuple[str, str]:
    name, sign, size = text.partition("=")
    if not sign:
        raise InputError(f"--limit is '{text}', but it must be NAME=NUMBER, such as rows=600000")
    return name.strip(), size.strip()


def run_arguments(
    jobs: int, cluster: str | None, journal: Path | None, engine: str | None
) -> dict[str, Any]:
    """Compose the arguments of a simulating verb, with a bar of progress.

    Shifts of a stopped run are kept in ``results/shifts`` unless ``journal`` names another folder.
    """
    from dogshape.pipeline.simulate.executor import SHIFTS  # noqa: PLC0415

    return {
        "jobs": jobs,
        "cluster": cluster,
        "journal": journal or SHIFTS,
        "progress": True,
        "engine": engine,
    }


def angles_of(text: str | None) -> int | tuple[float, ...] | None:
    """Read a number of angles or, from a list with commas, the angles in degrees."""
    if text is None:
        return None
    try:
        return tuple(map(float, text.split(","))) if "," in text else int(text)
    except ValueError:
        raise InputError(
            f"--angles is '{text}', but it must be a whole number or a list of angles in degrees; "
            "write for instance 24 or 0,6,12,18"
        ) from None
