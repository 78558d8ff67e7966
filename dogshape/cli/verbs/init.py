"""``init``: commented folders to begin with, for a study or a bench of one's own."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from dogshape.cli.options import PLAIN, Json, Sets, emit
from dogshape.sim.errors import GeometryError, InputError, meant_number
from dogshape.sim.units import unit_of
from dogshape.terminal import print_parts, terminal

if TYPE_CHECKING:
    from dogshape.pipeline.drafts.bench_folder import BenchDraft
    from dogshape.pipeline.record import Table

init = typer.Typer(name="init", help="Begin a study or a bench: a commented folder.", **PLAIN)

EMPTY = "record.empty_cells"
RECORD = {
    "record.time_zero": ("event at which the times start", ("command", "force", "unknown")),
    "record.displacement_at": ("place of the travel sensor", ("sleeve", "actuator", "unknown")),
    EMPTY: ("shifts of rows without a time", ("not_made", "failed", "unknown")),
    "record.sense": (
        "way in which the rings turned past each other (docs/mismatch.md)", ("known", "unknown")
    ),
}  # fmt: skip

Yes = Annotated[bool, Option("--yes", help="ask nothing and take the defaults")]
Force = Annotated[bool, Option("--force", help="write over files of the same name")]


@init.command()
def study(
    out: Annotated[Path, Option(help="folder to write")] = Path("my_clutch"),
    origin: Annotated[
        str, Option("--like", "--from", help="kind of clutch, study, or a bench's clutch")
    ] = "mq200",
    set_: Sets = None,
    yes: Yes = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a commented study file; a terminal asks for your clutch.

    Example: dogshape init study --out my_clutch --set dog.count=20 --set dog.height_mm=3.2
    """
    from dogshape.pipeline.config.study_file import pair_of  # noqa: PLC0415
    from dogshape.pipeline.config.toml_text import toml_value  # noqa: PLC0415
    from dogshape.pipeline.drafts import study_folder  # noqa: PLC0415

    study_folder.require_free(out, force)
    values = dict(pair_of(text) for text in set_ or [])
    write = _asked_study if may_ask(yes) else study_folder.write_study
    found = write(out, origin, values, force=force)
    lines = [
        f"wrote {found['file']} from {found['from']}: {found['dogs']} dogs, "
        f"{found['operating_points']} operating points",
        *(
            f"set {key} = {toml_value(value)}" if value is not None else f"left out {key}"
            for key, value in found["set"].items()
        ),
        *_remarks(found),
        f"next: look through {found['file']}, then",
        *(f"  dogshape {verb} {quote(found['folder'])}" for verb in ("check", "expect", "study")),
    ]
    emit(found, json, lambda: lines)


def _remarks(found: Mapping[str, Any]) -> list[str]:
    kinds = (("assumed", "assumed"), ("warning", "warnings"))
    return [f"{word}: {line}" for word, key in kinds for line in found[key]]


def _asked_study(out: Path, origin: str, values: dict[str, Any], *, force: bool) -> dict[str, Any]:
    from dogshape.pipeline.drafts import study_folder as draft  # noqa: PLC0415

    typer.echo(f"kinds of clutch: {draft.bundled_kinds()}", err=True)
    origin = ask("begin from (a kind, a study, or the folder of a bench)", origin)
    before: dict[str, Any] = {}
    answers: dict[str, Any] = {}
    words: dict[str, str] = {}

    def own() -> dict[str, Any]:
        new = changed(answers, before)
        points = draft.OPERATION if new.keys() & draft.OPERATION else ()
        return values | new | {key: answers[key] for key in points}

    def until_right(make: Callable[[dict[str, Any]], Any]) -> Any:
        while True:
            try:
                return make(own())
            except (InputError, GeometryError) as error:
                typer.echo(f"{error}\nnothing is written yet; your answers are kept", err=True)
                answers.update(ask_values(answers, words))

    # What follows from a part is the default of the next one.
    for part in (draft.ACTUATION, draft.OPERATION, draft.CLUTCH, draft.USE):
        asked, more = draft.questions_of(origin, own(), part)
        before, words = before | asked, words | more
        answers |= ask_values(asked, more)
        if part is draft.OPERATION:
            until_right(partial(draft.check_draft, origin))
    return until_right(partial(draft.write_study, out, origin, force=force))


@init.command()
def bench(
    tables: Annotated[list[Path] | None, Argument(metavar="[CSV|XLSX ...]")] = None,
    out: Annotated[Path | None, Option(help="default: the name of the first table")] = None,
    origin: Annotated[str, Option("--from", help="whose clutch the stand has")] = "mq200_stand",
    column: Annotated[list[str] | None, Option(metavar="QUANTITY=COLUMN[:UNIT]")] = None,
    rise_s: Annotated[float | None, Option(help="rise time where no column has it")] = None,
    decimal: Annotated[str | None, Option(help="decimal sign of the tables, . or ,")] = None,
    rows: Annotated[str | None, Option(help="lines that are shifts, e.g. 2-41,45")] = None,
    set_: Sets = None,
    yes: Yes = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a bench folder from tables of any layout, or one to fill in.

    Each quantity is printed with its reading and the reason, then columns and rows left out.
    Ambiguous cells are asked about in a terminal, and refused without one. A column has a unit,
    --column shift_time_s='t 90 %:ms', or is a formula, --column mismatch_rpm='n_out - n_in';
    --column engaged=- leaves a quantity out. FILE.xlsx#SHEET is a sheet of a workbook.

    Example: dogshape init bench measured.csv --from mq200_stand --out my_bench
    """
    from dogshape.pipeline.config.study_file import pair_of  # noqa: PLC0415
    from dogshape.pipeline.drafts.bench_folder import BenchDraft, write_bench  # noqa: PLC0415
    from dogshape.pipeline.drafts.study_folder import require_free  # noqa: PLC0415

    paths = tuple(tables or ())
    target = out or Path(paths[0].stem.replace(" ", "_") if paths else "my_bench")
    require_free(target, force)
    columns = dict(_pair(text) for text in column or [])
    values = dict(pair_of(text) for text in set_ or [])
    draft = BenchDraft(paths, origin, columns, rise_s, values, decimal, rows or "")
    found = write_bench(target, _asked(draft, target) if may_ask(yes) else draft, force=force)
    lines = [
        f"wrote {found['folder']}: {found['rows']} rows, {found['shifts']} shifts, "
        f"{found['with_time']} of them with a time",
        *_remarks(found),
        "next:" if found["with_time"] else "next: fill in shifts.csv, then",
        f"  dogshape validate {quote(found['folder'])}",
        f"  dogshape gap {quote(found['folder'])} --out {quote(found['folder'] + '/gap')}",
    ]
    emit(found, json, lambda: [*_reading(found), *lines])


def _pair(text: str) -> tuple[str, str]:
    name, sign, column = text.partition("=")
    if not sign or not column:
        raise InputError(
            f"--column is '{text}', but it must be QUANTITY=COLUMN or QUANTITY=COLUMN:UNIT; "
            "write for instance shift_time_s=t_shift:ms"
        )
    return name.strip(), column


def _asked(draft: BenchDraft, target: Path) -> BenchDraft:
    """Ask about columns, clutch and stand."""
    from dogshape.pipeline.drafts.bench_folder import guessed  # noqa: PLC0415
    from dogshape.pipeline.drafts.study_folder import WORDS, source_of  # noqa: PLC0415

    found = guessed(draft)
    while draft.tables:
        print_parts(terminal(stderr=True), _reading(found))
        for fault in found["faults"]:
            typer.echo(fault, err=True)
        if not found["faults"] and ask("is that right?", True):
            break
        answer = ask("say one, as shift_time_s=COLUMN:UNIT or decimal=, (empty: go on)", "")
        if not answer:
            break
        name, text = _pair(answer.removeprefix("--column ").removeprefix("--"))
        columns = {"columns": {**draft.columns, name: text.strip("'")}}
        draft = replace(draft, **({name: text} if name in ("decimal", "rows") else columns))
        found = guessed(draft)
    values = {"name": ask("name of the data set", target.name)} | dict(draft.values)
    values = {"source": ask("who measured it, and when", "not said")} | values
    origin = ask("clutch of the stand, as in (study or bench)", draft.origin)
    if not ask(f"is the clutch exactly that of '{origin}'?", True):
        before = source_of(origin).dog_values
        values = changed(ask_values(before, WORDS), before) | values
    for key, (question, choices) in RECORD.items():
        if key not in values and (key != EMPTY or found["empty"]):
            values[key] = ask(f"{question}: {', '.join(choices)}", "unknown", choices)
    if "timeout_s" not in values and ask("has the stand a time-out of its own?", False):
        values["timeout_s"] = ask("time-out, s", 1.0)
    return replace(draft, origin=origin, values=values)


def _reading(found: dict[str, Any]) -> list[str | Table]:
    """Tabulate how columns were read, and list the rows and columns that were left out."""
    from dogshape.pipeline.record import Table  # noqa: PLC0415

    heads = "quantity", "column", "unit in file", "decimals", "first", "least", "largest", "why"
    rows = []
    for row in found["columns"]:
        unit = unit_of(row["quantity"])  # of the values, whatever that of the file
        texts = (
            f"{v:.6g} {unit}".rstrip() if isinstance(v, float) else "-" if v is None else str(v)
            for v in (row["first"], row["least"], row["largest"])
        )
        rows.append((row["quantity"], row["column"], row["unit"] or "-", row["decimals"] or "-",
                     *texts, row["why"]))  # fmt: skip
    reasons: dict[str, list[str]] = {}
    for one in found["left_out"]:
        place = f"row {one['row']}" if "row" in one else f"column '{one['column']}'"
        reasons.setdefault(one["reason"], []).append(place)
    left = [f"left out: {', '.join(places)}: {why}" for why, places in reasons.items()]
    shown: list[str | Table] = [Table(heads, rows, {}, (1, 7)), ""] if rows else []
    return [*shown, *left]


def may_ask(yes: bool) -> bool:
    """Decide whether to ask: in a terminal, unless all defaults were accepted beforehand."""
    return not yes and sys.stdin.isatty()


def ask(question: str, default: Any, choices: Sequence[str] = ()) -> Any:
    """Ask for a value of the kind of the default: yes or no, a number, numbers, or words.

    A decimal comma is taken as a point. An answer of another kind is asked about again; the end of
    the input stops the program as Ctrl-C does.
    """
    many = isinstance(default, (list, tuple))

    def value_of(text: str) -> Any:
        if isinstance(default, str):
            if choices and text not in choices:
                raise typer.BadParameter(f"give one of {', '.join(choices)}")
            return text.strip()
        numbers = [meant_number(word.rstrip(";")) for word in text.split()]
        if not numbers or None in numbers or (not many and len(numbers) > 1):
            kind = "numbers with blanks between" if many else "a number"
            raise typer.BadParameter(f"give {kind}")
        if isinstance(default, int) and numbers[0] != round(numbers[0] or 0.0):
            raise typer.BadParameter("give a whole number")
        return numbers if many else type(default)(numbers[0])

    try:
        if isinstance(default, bool):
            return typer.confirm(question, default=default, err=True)
        words = default if many else [default]
        shown = " ".join(f"{one:g}" if isinstance(one, float) else f"{one}" for one in words)
        return typer.prompt(question, default=shown, err=True, value_proc=value_of)
    except typer.Abort:
        raise KeyboardInterrupt from None


def ask_values(values: Mapping[str, Any], words: Mapping[str, str]) -> dict[str, Any]:
    """Ask for values by their keys."""
    from dogshape.pipeline.drafts.study_folder import CHOICES  # noqa: PLC0415

    return {
        key: ask(words.get(key, key), value, CHOICES.get(key, ())) for key, value in values.items()
    }


def changed(found: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Give the values that differ from their defaults."""
    return {key: value for key, value in found.items() if value != values[key]}
