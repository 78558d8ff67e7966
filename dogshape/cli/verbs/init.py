"""``init``: commented folders to begin with, for a study or a bench of one's own."""

from __future__ import annotations

import re
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
from dogshape.sim.errors import GeometryError, InputError
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
        "way in which the rings turned past each other (docs/mismatch.md)",
        ("known", "unknown"),
    ),
}

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
                answers.update(ask_values(before | answers, words))

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
    rows: Annotated[str | None, Option(help="rows that are shifts, e.g. 2-41,45")] = None,
    drop: Annotated[
        list[str] | None, Option(metavar="COLUMN=VALUE", help="rows that are no shifts")
    ] = None,
    keep: Annotated[
        list[str] | None, Option(metavar="COLUMN=VALUE", help="rows that alone are shifts")
    ] = None,
    fill_down: Annotated[
        bool, Option("--fill-down", help="empty set values have the value above")
    ] = False,
    limit: Annotated[
        list[str] | None, Option(metavar="NAME=NUMBER", help="size up to which a table is read")
    ] = None,
    explain: Annotated[
        bool, Option("--explain", help="print the steps of reading and write nothing")
    ] = False,
    set_: Sets = None,
    yes: Yes = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a bench folder from tables of any layout, or one to fill in.

    Each quantity is printed with its reading and the reason, then columns and rows left out.
    Ambiguous cells are asked about in a terminal, and refused without one. A column has a unit,
    --column shift_time_s='t 90 %:ms', or is a formula, --column mismatch_rpm='n_out - n_in';
    --column engaged=- leaves a quantity out, --column n_shifts=5 holds for all rows.
    Rows with a sign or a mark are asked about: --drop 'Remark=x' leaves them out, --keep 'gear=2'
    takes these alone, '*' is any sign, --keep 'Remark=*' takes all rows; a workbook's own marks
    are the column row, --drop 'row=hidden'. FILE.xlsx#SHEET is a sheet of a workbook.

    Example: dogshape init bench measured.csv --from mq200_stand --out my_bench
    """
    from dogshape.pipeline.config.study_file import pair_of  # noqa: PLC0415
    from dogshape.pipeline.drafts.bench_folder import BenchDraft, write_bench  # noqa: PLC0415
    from dogshape.pipeline.drafts.study_folder import require_free  # noqa: PLC0415
    from dogshape.sim.decoding import limits_of  # noqa: PLC0415

    paths = tuple(tables or ())
    target = out or Path(paths[0].stem.replace(" ", "_") if paths else "my_bench")
    if not explain:
        require_free(target, force)
    columns = dict(_pair(text) for text in column or [])
    values = dict(pair_of(text) for text in set_ or [])
    limits = limits_of(dict(_limit(text) for text in limit or []))
    draft = BenchDraft(
        paths,
        origin,
        columns,
        rise_s,
        values,
        decimal,
        rows or "",
        tuple(drop or ()),
        tuple(keep or ()),
        fill_down,
        limits,
    )
    if explain:
        _explain(draft, json)
        return
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


def _limit(text: str) -> tuple[str, str]:
    name, sign, size = text.partition("=")
    if not sign:
        raise InputError(f"--limit is '{text}', but it must be NAME=NUMBER, such as rows=600000")
    return name.strip(), size.strip()


def _explain(draft: BenchDraft, json: bool) -> None:
    """Print the steps of reading; raises DataError with the faults."""
    from dogshape.pipeline.drafts.bench_folder import explained  # noqa: PLC0415
    from dogshape.sim.errors import DataError  # noqa: PLC0415

    found = explained(draft)
    lines: list[str | Table] = []
    before = ("", "")
    for step in found["steps"]:
        place = step["file"], step["step"]
        if place != before:
            lines.append(": ".join(place) if before[0] != place[0] else place[1])
        lines.append(f"  {step['line']}")
        before = place
    lines += ["readings", *_reading(found), *(f"assumed: {line}" for line in found["assumed"])]
    emit(found, json, lambda: lines)
    if found["faults"]:
        raise DataError("\n".join(found["faults"]))


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
    from dogshape.pipeline.drafts.study_folder import MASS, WORDS, source_of  # noqa: PLC0415

    found = guessed(draft)
    while draft.tables:
        print_parts(terminal(stderr=True), _reading(found))
        for fault in found["faults"]:
            typer.echo(fault, err=True)
        if not found["faults"] and ask("is that right?", True):
            break
        answer = ask("say one, as shift_time_s=COLUMN:UNIT or drop Remark=x (empty: go on)", "")
        if not answer:
            break
        draft = _answered(draft, answer)
        found = guessed(draft)
    values = {"name": ask("name of the data set", target.name)} | dict(draft.values)
    values = {"source": ask("who measured it, and when", "not said")} | values
    origin = ask("clutch of the stand, as in (study or bench)", draft.origin)
    if not ask(f"is the clutch exactly that of '{origin}'?", True):
        before = source_of(origin).dog_values
        words = WORDS | {MASS: "moving mass, with fork and rod, kg"}
        values = changed(ask_values(before, words), before) | values
    for key, (question, choices) in RECORD.items():
        if key not in values and (key != EMPTY or found["empty"]):
            values[key] = ask(f"{question}: {', '.join(choices)}", "unknown", choices)
    if "timeout_s" not in values and ask("has the stand a time-out of its own?", False):
        values["timeout_s"] = ask("time-out, s", 1.0)
    return replace(draft, origin=origin, values=values)


def _answered(draft: BenchDraft, answer: str) -> BenchDraft:
    """Add an answer that is an option, with or without its dashes, to a draft."""
    text = answer.strip().removeprefix("--").replace("fill-down", "fill_down")
    if text == "fill_down":
        return replace(draft, fill_down=True)
    match = re.match(r"(\w+)[ =](.*)", text)
    option, words = (match[1], match[2].strip("'")) if match else ("", "")
    if option == "drop":
        return replace(draft, drop=(*draft.drop, words))
    if option == "keep":
        return replace(draft, keep=(*draft.keep, words))
    if option == "decimal":
        return replace(draft, decimal=words)
    if option == "rows":
        return replace(draft, rows=words)
    name, column = _pair(text.removeprefix("column "))
    return replace(draft, columns={**draft.columns, name: column.strip("'")})


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
        rows.append(
            (
                row["quantity"],
                row["column"],
                row["unit"] or "-",
                row["decimals"] or "-",
                *texts,
                row["why"],
            )
        )
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


def ask(
    question: str,
    default: Any,
    choices: Sequence[str] = (),
    read: Callable[[str], Any] | None = None,
) -> Any:
    """Ask for a value of the kind of the default: yes or no, a number, numbers, or words.

    ``read`` makes a value of an answer that is neither yes or no nor a word, by default a number.
    An answer of another kind is asked about again; the end of the input stops the program as Ctrl-C
    does.
    """
    from dogshape.pipeline.drafts.answers import number_of, shown_value  # noqa: PLC0415

    def value_of(text: str) -> Any:
        if isinstance(default, str):
            if choices and text not in choices:
                raise typer.BadParameter(f"give one of {', '.join(choices)}")
            return text.strip()
        try:
            return (read or number_of)(text)
        except InputError as error:
            raise typer.BadParameter(str(error)) from None

    try:
        if isinstance(default, bool):
            return typer.confirm(question, default=default, err=True)
        return typer.prompt(question, default=shown_value(default), err=True, value_proc=value_of)
    except typer.Abort:
        raise KeyboardInterrupt from None


def ask_values(values: Mapping[str, Any], words: Mapping[str, str]) -> dict[str, Any]:
    """Ask for values by their keys; keys that earlier answers make void are left out."""
    from dogshape.pipeline.drafts.study_folder import CHOICES, is_void, value_of  # noqa: PLC0415

    answers: dict[str, Any] = {}
    for key, default in values.items():
        if not is_void(key, answers):
            read = partial(value_of, key, default=default, answers=answers)
            answers[key] = ask(words.get(key, key), default, CHOICES.get(key, ()), read)
    return answers


def changed(found: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Give the values that differ from their defaults."""
    return {key: value for key, value in found.items() if value != values[key]}
