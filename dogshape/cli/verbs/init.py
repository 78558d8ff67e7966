"""``init``: commented folders to begin with, for a study or a bench of one's own."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from dogshape.cli.console import emit, rich_table, say, terminal, verb
from dogshape.cli.options import Json, Sets
from dogshape.pipeline.config.study_file import pair_of
from dogshape.pipeline.drafts.bench_folder import BenchDraft, guessed, write_bench
from dogshape.pipeline.drafts.sources import require_free, source_of
from dogshape.pipeline.drafts.study_folder import (
    CLUTCH,
    HEIGHT,
    USE,
    askable,
    use_of,
    write_study,
)
from dogshape.pipeline.record import Table
from dogshape.sim.errors import InputError, meant_number
from dogshape.sim.units import unit_of

init = typer.Typer(
    name="init",
    help="Begin a study or a bench of your own: a folder with commented files.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

EMPTY = "record.empty_cells"
RECORD = {
    "record.time_zero": ("event at which the times start", ("command", "force", "unknown")),
    "record.displacement_at": ("place of the travel sensor", ("sleeve", "actuator", "unknown")),
    EMPTY: ("shifts of rows without a time", ("not_made", "failed", "unknown")),
    "record.sense": (
        "way in which the rings turned past each other (docs/mismatch.md)", ("known", "unknown")
    ),
}  # fmt: skip

Yes = Annotated[bool, typer.Option("--yes", help="ask nothing and take the defaults")]
Force = Annotated[bool, typer.Option("--force", help="write over files of the same name")]


@init.command()
@verb
def study(
    out: Annotated[Path, typer.Option(help="folder to write")] = Path("my_clutch"),
    origin: Annotated[
        str, typer.Option("--from", help="study to copy, or bench whose clutch is taken")
    ] = "mq200",
    set_: Sets = None,
    yes: Yes = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a commented study file; in a terminal it asks for your clutch.

    Example: dogshape init study --out my_clutch --set dog.count=20 --set dog.height_mm=3.2
    """
    require_free(out, force)
    values = dict(pair_of(text) for text in set_ or [])
    if may_ask(yes):
        found = _asked_study(out, origin, values, force=force)
    else:
        found = write_study(out, origin, values, force=force)
    emit(found, json, lambda: study_text(found))


def _asked_study(out: Path, origin: str, values: dict[str, Any], *, force: bool) -> dict[str, Any]:
    origin = ask("begin from (a study, or the folder of a bench)", origin)
    before = source_of(origin).dog_values
    before |= {key: value for key, value in values.items() if key in CLUTCH and askable(value)}
    answers = ask_values(before, CLUTCH)
    # What follows from the clutch is the default of the other questions.
    use = use_of(origin, values | changed(answers, before))
    before, answers = before | use, answers | ask_values(use, USE)
    while True:
        height = {HEIGHT: answers[HEIGHT]}  # as answered, also where it is the default
        try:
            return write_study(out, origin, values | changed(answers, before) | height, force=force)
        except InputError as error:
            say(str(error))
            say("nothing is written yet; your answers are kept")
            answers = ask_values(answers, CLUTCH | USE)


@init.command()
@verb
def bench(
    tables: Annotated[
        list[Path] | None, typer.Argument(metavar="[CSV ...]", help="tables of the stand")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="default: the name of the first table")] = None,
    origin: Annotated[
        str, typer.Option("--from", help="study or bench whose clutch the stand has")
    ] = "mq200_stand",
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="QUANTITY=COLUMN[:UNIT]", help="e.g. shift_time_s='t 90 %:ms', or a formula"
        ),
    ] = None,
    rise_s: Annotated[
        float | None, typer.Option(help="rise time of the force where no column has it")
    ] = None,
    decimal: Annotated[str | None, typer.Option(help="decimal sign of the tables, . or ,")] = None,
    rows: Annotated[
        str | None, typer.Option(help="rows of the file that are shifts, e.g. 2-41,45")
    ] = None,
    set_: Sets = None,
    yes: Yes = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a bench folder from tables of any layout, or one to fill in.

    Each quantity is printed as it was read: column, unit, decimal sign, first, least and largest
    value, and the reason; so is each row and column that was left out. Cells that can be read in
    two ways are asked about in a terminal, and refused without one, with the option that settles
    them. A column option may be a formula: --column mismatch_rpm='n_out - n_in'; --column engaged=-
    leaves a quantity out.

    Example: dogshape init bench measured.csv --from mq200_stand --out my_bench
    """
    paths = tuple(tables or ())
    target = out or Path(paths[0].stem.replace(" ", "_") if paths else "my_bench")
    require_free(target, force)
    columns = dict(_pair(text) for text in column or [])
    values = dict(pair_of(text) for text in set_ or [])
    draft = BenchDraft(paths, origin, columns, rise_s, values, decimal, rows or "")
    if may_ask(yes):
        draft = _asked(draft, target)
    found = write_bench(target, draft, force=force)
    emit(found, json, lambda: bench_text(found))


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
    found = guessed(draft)
    while draft.tables:
        for part in reading_text(found):
            shown = part if isinstance(part, str) else rich_table(part)
            terminal(stderr=True).print(shown)
        for fault in found["faults"]:
            say(fault)
        if not found["faults"] and ask("is that right?", True):
            break
        answer = ask("say one, as shift_time_s=COLUMN:UNIT or decimal=, (empty: go on)", "")
        if not answer:
            break
        name, text = _pair(answer.removeprefix("--column ").removeprefix("--"))
        own = (
            {name: text}
            if name in ("decimal", "rows")
            else {"columns": {**draft.columns, name: text.strip("'")}}
        )
        draft = replace(draft, **own)
        found = guessed(draft)
    values = dict(draft.values)
    values = {"name": ask("name of the data set", target.name)} | values
    values = {"source": ask("who measured it, and when", "not said")} | values
    origin = ask("clutch of the stand, as in (study or bench)", draft.origin)
    if not ask(f"is the clutch exactly that of '{origin}'?", True):
        before = source_of(origin).dog_values
        values = changed(ask_values(before, CLUTCH), before) | values
    for key, (question, choices) in RECORD.items():
        if key not in values and (key != EMPTY or found["empty"]):
            values[key] = ask(f"{question}: {', '.join(choices)}", "unknown", choices)
    if "timeout_s" not in values and ask("has the stand a time-out of its own?", False):
        values["timeout_s"] = ask("time-out, s", 1.0)
    return replace(draft, origin=origin, values=values)


def may_ask(yes: bool) -> bool:
    """Decide whether to ask: in a terminal, unless all defaults were accepted beforehand."""
    return not yes and sys.stdin.isatty()


def ask(question: str, default: Any, choices: Sequence[str] = ()) -> Any:
    """Ask for a value of the kind of the default: yes or no, a number, numbers, or words.

    A decimal comma is taken as a point. An answer of another kind is asked about again; the end of
    the input stops the program as Ctrl-C does.
    """

    def value_of(text: Any) -> Any:
        if not isinstance(text, str) or isinstance(default, str):
            if choices and text not in choices:
                raise typer.BadParameter(f"give one of {', '.join(choices)}")
            return text.strip() if isinstance(text, str) else text
        numbers = [meant_number(word.rstrip(";")) for word in text.split()]
        if not numbers or None in numbers or (not many and len(numbers) > 1):
            raise typer.BadParameter(
                "give " + ("numbers with blanks between" if many else "a number")
            )
        if isinstance(default, int) and numbers[0] != round(numbers[0] or 0.0):
            raise typer.BadParameter("give a whole number")
        return numbers if many else type(default)(numbers[0])

    many = isinstance(default, (list, tuple))
    try:
        if isinstance(default, bool):
            return typer.confirm(question, default=default, err=True)
        shown = " ".join(f"{one:g}" for one in default) if many else default
        shown = f"{shown:g}" if isinstance(shown, float) else str(shown)
        return typer.prompt(question, default=shown, err=True, value_proc=value_of)
    except typer.Abort:
        raise KeyboardInterrupt from None


def ask_values(values: Mapping[str, Any], words: Mapping[str, str]) -> dict[str, Any]:
    """Ask for values by their keys."""
    return {key: ask(words.get(key, key), value) for key, value in values.items()}


def changed(found: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Give the values that differ from their defaults."""
    return {key: value for key, value in found.items() if value != values[key]}


def study_text(found: dict[str, Any]) -> list[str | Table]:
    """List the file that was written, its values, and the next commands."""
    folder = found["folder"]
    return [
        f"wrote {found['file']} from {found['from']}: {found['dogs']} dogs, "
        f"{found['operating_points']} operating points",
        *(
            f"set {key} = {value}" if value is not None else f"left out {key}"
            for key, value in found["set"].items()
        ),
        *(f"assumed: {line}" for line in found["assumed"]),
        *(f"warning: {line}" for line in found["warnings"]),
        f"next: look through {found['file']}, then",
        f"  dogshape strength {folder} --no-simulation",
        f"  dogshape study {folder}",
    ]


def reading_text(found: dict[str, Any]) -> list[str | Table]:
    """Tabulate how columns were read, and list the rows and columns that were left out."""
    heads = "quantity", "column", "unit in file", "decimals", "first", "least", "largest", "why"
    rows = []
    for row in found["columns"]:
        unit = unit_of(row["quantity"])  # of the values, whatever that of the file
        values = (row[name] for name in ("first", "least", "largest"))
        texts = (
            f"{v:.6g} {unit}".rstrip() if isinstance(v, float) else "-" if v is None else str(v)
            for v in values
        )
        rows.append((row["quantity"], row["column"], row["unit"] or "-", row["decimals"] or "-",
                     *texts, row["why"]))  # fmt: skip
    reasons: dict[str, list[str]] = {}
    for one in found["left_out"]:
        what = f"row {one['row']}" if "row" in one else f"column '{one['column']}'"
        reasons.setdefault(one["reason"], []).append(what)
    left = [f"left out: {', '.join(those)}: {why}" for why, those in reasons.items()]
    shown: list[str | Table] = [Table(heads, rows, {}, (1, 7)), ""] if rows else []
    return [*shown, *left]


def bench_text(found: dict[str, Any]) -> list[str | Table]:
    """Tabulate the columns that were read, all assumptions, and the next commands."""
    folder = found["folder"]
    return [
        *reading_text(found),
        f"wrote {folder}: {found['rows']} rows, {found['shifts']} shifts, {found['with_time']} of "
        "them with a time",
        *(f"assumed: {line}" for line in found["assumed"]),
        *(f"warning: {line}" for line in found["warnings"]),
        "next:" if found["with_time"] else "next: fill in shifts.csv, then",
        f"  dogshape validate {folder}",
        f"  dogshape gap {folder} --out {folder}/gap",
    ]
