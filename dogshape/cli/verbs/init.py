"""``init``: commented folders of a new study or bench."""

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

EMPTY_CELLS = "record.empty_cells"
#: Question and choices by the keys that say how a table was recorded.
RECORD_QUESTIONS = {
    "record.time_zero": ("event at which the times start", ("command", "force", "unknown")),
    "record.displacement_at": ("place of the travel sensor", ("sleeve", "actuator", "unknown")),
    EMPTY_CELLS: ("shifts of rows without a time", ("not_made", "failed", "unknown")),
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
    write = _ask_study if may_ask(yes) else study_folder.write_study
    record = write(out, origin, values, force=force)
    lines = [
        f"wrote {record['file']} from {record['from']}: {record['dogs']} dogs, "
        f"{record['operating_points']} operating points"
    ]
    for key, value in record["set"].items():
        lines.append(f"left out {key}" if value is None else f"set {key} = {toml_value(value)}")
    lines += _remarks(record)
    lines.append(f"next: look through {record['file']}, then")
    for verb in ("check", "expect", "study"):
        lines.append(f"  dogshape {verb} {quote(record['folder'])}")
    emit(record, json, lambda: lines)


def _remarks(record: Mapping[str, Any]) -> list[str]:
    assumptions = [f"assumed: {line}" for line in record["assumed"]]
    warnings = [f"warning: {line}" for line in record["warnings"]]
    return assumptions + warnings


def _ask_study(out: Path, origin: str, values: dict[str, Any], *, force: bool) -> dict[str, Any]:
    """Ask for the values of a study, part by part, and write its folder; returns the record."""
    from dogshape.pipeline.drafts import study_folder as draft  # noqa: PLC0415

    typer.echo(f"kinds of clutch: {draft.bundled_kinds()}", err=True)
    origin = ask("begin from (a kind, a study, or the folder of a bench)", origin)
    defaults: dict[str, Any] = {}
    answers: dict[str, Any] = {}
    questions: dict[str, str] = {}

    def user_keys() -> dict[str, Any]:
        changes = changed_values(answers, defaults)
        points = draft.OPERATION if changes.keys() & draft.OPERATION else ()
        return values | changes | {key: answers[key] for key in points}

    def repeat_until_valid(make: Callable[[dict[str, Any]], Any]) -> Any:
        while True:
            try:
                return make(user_keys())
            except (InputError, GeometryError) as error:
                typer.echo(f"{error}\nnothing is written yet; your answers are kept", err=True)
                answers.update(ask_values(defaults | answers, questions))

    # The answers to a part decide the defaults of the next one.
    for part in (draft.ACTUATION, draft.OPERATION, draft.CLUTCH, draft.USE):
        part_defaults, part_questions = draft.questions_of(origin, user_keys(), part)
        defaults |= part_defaults
        questions |= part_questions
        answers |= ask_values(part_defaults, part_questions)
        if part is draft.OPERATION:
            repeat_until_valid(partial(draft.check_draft, origin))
    return repeat_until_valid(partial(draft.write_study, out, origin, force=force))


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
    from dogshape.sim.decoding import parse_limits  # noqa: PLC0415

    paths = tuple(tables or ())
    default_name = paths[0].stem.replace(" ", "_") if paths else "my_bench"
    target = out or Path(default_name)
    if not explain:
        require_free(target, force)
    columns = dict(_column_pair(text) for text in column or [])
    values = dict(pair_of(text) for text in set_ or [])
    limits = parse_limits(dict(_limit_pair(text) for text in limit or []))
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
    if may_ask(yes):
        draft = _ask_bench(draft, target)
    record = write_bench(target, draft, force=force)
    folder = record["folder"]
    lines = [
        f"wrote {folder}: {record['rows']} rows, {record['shifts']} shifts, "
        f"{record['with_time']} of them with a time",
        *_remarks(record),
        "next:" if record["with_time"] else "next: fill in shifts.csv, then",
        f"  dogshape validate {quote(folder)}",
        f"  dogshape diagnose {quote(folder)} --out {quote(folder + '/gap')}",
    ]
    emit(record, json, lambda: [*_reading_parts(record), *lines])


def _limit_pair(text: str) -> tuple[str, str]:
    name, sign, size = text.partition("=")
    if not sign:
        raise InputError(f"--limit is '{text}', but it must be NAME=NUMBER, such as rows=600000")
    return name.strip(), size.strip()


def _explain(draft: BenchDraft, json: bool) -> None:
    """Print the steps of reading; raises DataError with the faults."""
    from dogshape.pipeline.drafts.bench_folder import explained  # noqa: PLC0415
    from dogshape.sim.errors import DataError  # noqa: PLC0415

    record = explained(draft)
    lines: list[str | Table] = []
    previous_file = ""
    previous_step = ""
    for step in record["steps"]:
        if step["file"] != previous_file:
            lines.append(f"{step['file']}: {step['step']}")
        elif step["step"] != previous_step:
            lines.append(step["step"])
        lines.append(f"  {step['line']}")
        previous_file = step["file"]
        previous_step = step["step"]
    lines += ["readings", *_reading_parts(record)]
    lines += [f"assumed: {line}" for line in record["assumed"]]
    emit(record, json, lambda: lines)
    if record["faults"]:
        raise DataError("\n".join(record["faults"]))


def _column_pair(text: str) -> tuple[str, str]:
    name, sign, column = text.partition("=")
    if not sign or not column:
        raise InputError(
            f"--column is '{text}', but it must be QUANTITY=COLUMN or QUANTITY=COLUMN:UNIT; "
            "write for instance shift_time_s=t_shift:ms"
        )
    return name.strip(), column


def _ask_bench(draft: BenchDraft, target: Path) -> BenchDraft:
    """Ask about columns, clutch and stand; returns the draft with the answers."""
    from dogshape.pipeline.drafts.study_folder import MASS, WORDS, source_of  # noqa: PLC0415

    draft, has_empty_cells = _ask_columns(draft)
    values = {"name": ask("name of the data set", target.name)} | dict(draft.values)
    values = {"source": ask("who measured it, and when", "not said")} | values
    origin = ask("clutch of the stand, as in (study or bench)", draft.origin)
    if not ask(f"is the clutch exactly that of '{origin}'?", True):
        dog_values = source_of(origin).dog_values
        questions = WORDS | {MASS: "moving mass, with fork and rod, kg"}
        values = changed_values(ask_values(dog_values, questions), dog_values) | values
    for key, (question, choices) in RECORD_QUESTIONS.items():
        if key not in values and (key != EMPTY_CELLS or has_empty_cells):
            values[key] = ask(f"{question}: {', '.join(choices)}", "unknown", choices)
    if "timeout_s" not in values and ask("has the stand a time-out of its own?", False):
        values["timeout_s"] = ask("time-out, s", 1.0)
    return replace(draft, origin=origin, values=values)


def _ask_columns(draft: BenchDraft) -> tuple[BenchDraft, bool]:
    """Ask about columns and rows until the user agrees.

    Returns the draft with the answers, and whether there are rows without a time.
    """
    from dogshape.pipeline.drafts.bench_folder import guessed  # noqa: PLC0415

    reading = guessed(draft)
    while draft.tables:
        print_parts(terminal(stderr=True), _reading_parts(reading))
        for fault in reading["faults"]:
            typer.echo(fault, err=True)
        if not reading["faults"] and ask("is that right?", True):
            break
        answer = ask("say one, as shift_time_s=COLUMN:UNIT or drop Remark=x (empty: go on)", "")
        if not answer:
            break
        draft = _add_answer(draft, answer)
        reading = guessed(draft)
    return draft, bool(reading["empty"])


def _add_answer(draft: BenchDraft, answer: str) -> BenchDraft:
    """Add an option, with or without its dashes, to a draft; InputError for another answer."""
    text = answer.strip().removeprefix("--").replace("fill-down", "fill_down")
    if text == "fill_down":
        return replace(draft, fill_down=True)
    match = re.match(r"(\w+)[ =](.*)", text)
    option, value = (match[1], match[2].strip("'")) if match else ("", "")
    if option == "drop":
        return replace(draft, drop=(*draft.drop, value))
    if option == "keep":
        return replace(draft, keep=(*draft.keep, value))
    if option == "decimal":
        return replace(draft, decimal=value)
    if option == "rows":
        return replace(draft, rows=value)
    name, column = _column_pair(text.removeprefix("column "))
    return replace(draft, columns={**draft.columns, name: column.strip("'")})


def _reading_parts(record: Mapping[str, Any]) -> list[str | Table]:
    """Tabulate columns with unit, decimals and values, then list excluded rows and columns."""
    from dogshape.pipeline.record import Table  # noqa: PLC0415

    parts: list[str | Table] = []
    if record["columns"]:
        heads = "quantity", "column", "unit in file", "decimals", "first", "least", "largest", "why"
        rows = [_column_cells(column) for column in record["columns"]]
        parts += [Table(heads, rows, {}, (1, 7)), ""]
    places_by_reason: dict[str, list[str]] = {}
    for item in record["left_out"]:
        place = f"row {item['row']}" if "row" in item else f"column '{item['column']}'"
        places_by_reason.setdefault(item["reason"], []).append(place)
    for reason, places in places_by_reason.items():
        parts.append(f"left out: {', '.join(places)}: {reason}")
    return parts


def _column_cells(column: Mapping[str, Any]) -> tuple[str, ...]:
    """Format the reading of a column, a cell for each head."""
    unit = unit_of(column["quantity"])  # of the values, whatever that of the file
    values = [_value_text(column[key], unit) for key in ("first", "least", "largest")]
    return (
        column["quantity"],
        column["column"],
        column["unit"] or "-",
        column["decimals"] or "-",
        *values,
        column["why"],
    )


def _value_text(value: Any, unit: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g} {unit}".rstrip()
    return str(value)


def may_ask(yes: bool) -> bool:
    """Decide whether to ask: in a terminal, unless all defaults were accepted beforehand."""
    return not yes and sys.stdin.isatty()


def ask(
    question: str,
    default: Any,
    choices: Sequence[str] = (),
    read: Callable[[str], Any] | None = None,
) -> Any:
    """Ask for a value of the type of the default: yes or no, a number, numbers, or text.

    ``read`` converts an answer that is neither yes or no nor text, by default to a number. The
    question is repeated after an answer of another type; the end of the input stops the program as
    Ctrl-C does.
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


def ask_values(defaults: Mapping[str, Any], questions: Mapping[str, str]) -> dict[str, Any]:
    """Ask for values by their keys, except for keys that earlier answers make void."""
    from dogshape.pipeline.drafts.study_folder import CHOICES, is_void, value_of  # noqa: PLC0415

    answers: dict[str, Any] = {}
    for key, default in defaults.items():
        if not is_void(key, answers):
            read = partial(value_of, key, default=default, answers=answers)
            answers[key] = ask(questions.get(key, key), default, CHOICES.get(key, ()), read)
    return answers


def changed_values(values: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Select the values that differ from their defaults."""
    return {key: value for key, value in values.items() if value != defaults[key]}
