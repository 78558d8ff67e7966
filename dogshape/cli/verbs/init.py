"""``init``: commented folders of a new study or bench."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer import Argument, Option

from dogshape.cli import dialogue
from dogshape.cli.options import (
    PLAIN,
    Columns,
    Decimal,
    Drop,
    FillDown,
    Json,
    Keep,
    Origin,
    Quotes,
    RiseTime,
    Rows,
    Sets,
    SizeLimits,
    bench_draft,
    emit,
)
from dogshape.sim.errors import GeometryError, InputError

if TYPE_CHECKING:
    from dogshape.bench.bench_draft import BenchDraft
    from dogshape.pipeline.drafts.rexs_coupling import RexsReading
    from dogshape.pipeline.drafts.study_folder import WrittenStudy
    from dogshape.pipeline.record import Table

init = typer.Typer(name="init", help="Begin a study or a bench: a commented folder.", **PLAIN)

EMPTY_CELLS = "record.empty_cells"
#: Question and choices by the keys that say how a table was recorded.
RECORD_QUESTIONS = {
    "record.time_zero": ("event at which the times start", ("command", "force", "unknown")),
    "record.displacement_at": ("place of the travel sensor", ("sleeve", "actuator", "unknown")),
    EMPTY_CELLS: ("shifts of rows without a time", ("not_made", "failed", "unknown")),
    "record.sense": (
        "way in which the rings turned past each other (docs/scope.md)",
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
    mount: Annotated[
        str | None, Option(help="root of the dogs: face, or sleeve for teeth rooted radially")
    ] = None,
    rexs: Annotated[
        Path | None,
        Option(metavar="FILE", help="gearbox in REXS, .rexsj or .rexs, with a coupling"),
    ] = None,
    coupling: Annotated[
        int | None, Option(metavar="ID", help="with --rexs: id of its switchable_coupling")
    ] = None,
    sliding_side: Annotated[
        Literal["inner", "outer"] | None, Option(help="with --rexs: side that slides")
    ] = None,
    set_: Sets = None,
    yes: Yes = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a commented study file; a terminal asks for your clutch.

    A gearbox in REXS gives torque, speed and inertias of a switchable coupling. Readings that it
    leaves open are asked about in a terminal, and refused without one.

    Example: dogshape init study --out my_clutch --set dog.count=20 --set dog.height_mm=3.2
    """
    from dogshape.pipeline.config.study_file import pair_of  # noqa: PLC0415
    from dogshape.pipeline.config.toml_text import toml_value  # noqa: PLC0415
    from dogshape.pipeline.drafts import draft_keys, study_folder  # noqa: PLC0415
    from dogshape.pipeline.drafts.reading_table import remark_lines  # noqa: PLC0415

    study_folder.require_free(out, force)
    values = dict(pair_of(text) for text in set_ or [])
    if mount is not None:
        values[draft_keys.MOUNT] = mount
    if rexs is None and (coupling is not None or sliding_side is not None):
        raise InputError("--coupling and --sliding-side are for a gearbox; give --rexs with a file")
    asks = dialogue.may_ask(yes)
    reading = None
    if rexs is not None:
        reading = _read_gearbox(rexs, coupling, sliding_side, asks=asks)
        if not asks:
            reading.require_answers([*values])
    write = _ask_study if asks else study_folder.write_study
    written = write(out, origin, values, force=force, reading=reading)
    lines = [
        f"wrote {written.file} from {written.origin}: {written.dogs} dogs, "
        f"{written.points} operating points"
    ]
    for key, value in written.values.items():
        lines.append(f"left out {key}" if value is None else f"set {key} = {toml_value(value)}")
    lines += remark_lines(written.assumed, written.warnings)
    lines.append(f"next: look through {written.file}, then")
    folder = quote(str(written.folder))
    for command in (f"check {folder}", f"export {folder} --sheet sheet.html", f"search {folder}"):
        lines.append(f"  dogshape {command}")
    emit(written.to_dict(), json, lambda: lines)


def _read_gearbox(
    path: Path, coupling: int | None, sliding_side: str | None, *, asks: bool
) -> RexsReading:
    """Read a coupling of a gearbox; ``asks`` about coupling and side that are not given."""
    from dogshape.pipeline.drafts import rexs_coupling  # noqa: PLC0415
    from dogshape.pipeline.drafts.rexs_model import read_rexs  # noqa: PLC0415

    model = read_rexs(path)
    couplings = rexs_coupling.couplings_of(model)
    if asks and coupling is None and len(couplings) > 1:
        typer.echo(f"couplings of {path}: {', '.join(part.text for part in couplings)}", err=True)
        numbers = [str(part.number) for part in couplings]
        coupling = int(dialogue.ask("coupling of the study, by its id", numbers[0], numbers))
    chosen = rexs_coupling.coupling_of(model, coupling)
    reading = rexs_coupling.read_coupling(model, chosen, sliding_side)
    if not asks:
        return reading
    if "sliding_side" in reading.questions:
        typer.echo(reading.questions["sliding_side"], err=True)
        sides = rexs_coupling.SIDES
        sliding_side = dialogue.ask("side that slides, inner or outer", sides[0], sides)
        reading = rexs_coupling.read_coupling(model, chosen, sliding_side)
    for line in (*reading.sentences(reading.values), *reading.questions.values()):
        typer.echo(line, err=True)
    return reading


def _ask_study(
    out: Path,
    origin: str,
    values: dict[str, Any],
    *,
    force: bool,
    reading: RexsReading | None,
) -> WrittenStudy:
    """Ask for the values of a study, part by part, and write its folder."""
    from dogshape.pipeline.drafts import draft_keys, study_folder  # noqa: PLC0415
    from dogshape.pipeline.drafts.draft_source import bundled_kinds  # noqa: PLC0415
    from dogshape.pipeline.simulate.ahead import compile_ahead  # noqa: PLC0415

    compile_ahead()
    settled_keys = study_folder.settled_keys(values)
    replaced_keys = settled_keys - values.keys()  # no answer to these may stand beside the values
    values = study_folder.values_with(reading, values)
    typer.echo(f"kinds of clutch: {bundled_kinds()}", err=True)
    origin = dialogue.ask("begin from (a kind, a study, or the folder of a bench)", origin)
    defaults: dict[str, Any] = {}
    answers: dict[str, Any] = {}
    questions: dict[str, str] = {}
    used_keys: set[str] = set()  # with a default that the study uses
    typed_keys: set[str] = set()

    def user_keys() -> dict[str, Any]:
        return study_folder.user_values(values, answers, defaults, typed_keys & used_keys)

    def add_answers(part_defaults: Mapping[str, Any], known_keys: Collection[str]) -> None:
        for key, answer in ask_values(part_defaults, questions, known_keys).items():
            answers[key] = answer.value
            if answer.is_typed:
                typed_keys.add(key)

    def repeat_until_valid(make: Callable[[dict[str, Any]], Any]) -> Any:
        while True:
            try:
                return make(user_keys())
            except (InputError, GeometryError) as error:
                typer.echo(f"{error}\nnothing is written yet; your answers are kept", err=True)
                add_answers(defaults | answers, replaced_keys)

    for part in draft_keys.PARTS.values():
        part_questions = study_folder.questions_of(origin, user_keys(), part)
        defaults |= part_questions.defaults
        questions |= part_questions.words
        used_keys |= part_questions.used_keys
        add_answers(part_questions.defaults, settled_keys)
        if part is draft_keys.OPERATION:
            repeat_until_valid(partial(study_folder.draft_study, origin))
    write = partial(study_folder.write_study, out, origin, force=force, reading=reading)
    return repeat_until_valid(write)


@init.command()
def bench(
    tables: Annotated[list[Path] | None, Argument(metavar="[CSV|XLSX ...]")] = None,
    out: Annotated[Path | None, Option(help="default: the name of the first table")] = None,
    origin: Origin = None,
    column: Columns = None,
    rise_s: RiseTime = None,
    decimal: Decimal = None,
    rows: Rows = None,
    drop: Drop = None,
    keep: Keep = None,
    fill_down: FillDown = False,
    limit: SizeLimits = None,
    quotes: Quotes = None,
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
    from dogshape.pipeline.drafts.bench_folder import write_bench  # noqa: PLC0415
    from dogshape.pipeline.drafts.reading_table import reading_parts, remark_lines  # noqa: PLC0415
    from dogshape.pipeline.drafts.study_folder import require_free  # noqa: PLC0415

    draft = bench_draft(
        tables or (),
        origin=origin,
        column=column,
        rise_s=rise_s,
        decimal=decimal,
        rows=rows,
        drop=drop,
        keep=keep,
        fill_down=fill_down,
        limit=limit,
        quotes=quotes,
        set_=set_,
    )
    target = out or Path(draft.folder_name)
    if not explain:
        require_free(target, force)
    if explain:
        _explain(draft, json)
        return
    if dialogue.may_ask(yes):
        draft = _ask_bench(draft, target)
    written = write_bench(target, draft, force=force)
    reading = written.reading
    folder = str(written.folder)
    lines = [
        f"wrote {folder}: {reading.count_text}",
        *remark_lines(reading.assumed, reading.warnings),
        "next:" if reading.timed_shifts else "next: fill in shifts.csv, then",
        f"  dogshape validate {quote(folder)}",
        f"  dogshape diagnose {quote(folder)} --out {quote(folder + '/gap')}",
    ]
    emit(written.to_dict(), json, lambda: [*reading_parts(reading.report), *lines])


def _explain(draft: BenchDraft, json: bool) -> None:
    """Print the steps of reading; raises DataError with the faults."""
    from dogshape.bench.bench_draft import explain_reading  # noqa: PLC0415
    from dogshape.pipeline.drafts.reading_table import (  # noqa: PLC0415
        assumption_lines,
        reading_parts,
    )
    from dogshape.sim.errors import DataError  # noqa: PLC0415

    reading = explain_reading(draft)
    report = reading.report
    lines: list[str | Table] = []
    previous_file = ""
    previous_step = ""
    for file, step, line in reading.lines:
        if file != previous_file:
            lines.append(f"{file}: {step}")
        elif step != previous_step:
            lines.append(step)
        lines.append(f"  {line}")
        previous_file = file
        previous_step = step
    lines += ["readings", *reading_parts(report), *assumption_lines(report.assumed)]
    emit(reading.to_dict(), json, lambda: lines)
    if report.faults:
        raise DataError("\n".join(dict.fromkeys(report.faults)))


def _ask_bench(draft: BenchDraft, target: Path) -> BenchDraft:
    """Ask about columns, clutch and stand; returns the draft with the answers."""
    from dogshape.pipeline.drafts.draft_keys import MASS, WORDS  # noqa: PLC0415
    from dogshape.pipeline.drafts.draft_source import source_of  # noqa: PLC0415
    from dogshape.pipeline.drafts.study_folder import changed_values  # noqa: PLC0415

    tables = dialogue.correct_reading(draft, confirm=True)
    draft = tables.draft
    values = {"name": dialogue.ask("name of the data set", target.name)} | dict(draft.values)
    values = {"source": dialogue.ask("who measured it, and when", "not said")} | values
    origin = dialogue.ask("clutch of the stand, as in (study or bench)", draft.origin)
    if not dialogue.ask(f"is the clutch exactly that of '{origin}'?", True):
        dog_values = source_of(origin).dog_values
        questions = WORDS | {MASS: "moving mass, with fork and rod, kg"}
        answers = ask_values(dog_values, questions)
        dog_answers = {key: answer.value for key, answer in answers.items()}
        values = changed_values(dog_answers, dog_values) | values
    for key, (question, choices) in RECORD_QUESTIONS.items():
        if key not in values and (key != EMPTY_CELLS or tables.report.empty_rows):
            values[key] = dialogue.ask(f"{question}: {', '.join(choices)}", "unknown", choices)
    if "timeout_s" not in values and dialogue.ask("has the stand a time-out of its own?", False):
        values["timeout_s"] = dialogue.ask("time-out, s", 1.0)
    return replace(draft, origin=origin, values=values)


def ask_values(
    defaults: Mapping[str, Any], questions: Mapping[str, str], known_keys: Collection[str] = ()
) -> dict[str, dialogue.DialogueAnswer]:
    """Ask for values by their keys, except for known ones and those that others make void.

    The value of a known key is its default.
    """
    from dogshape.pipeline.drafts.draft_keys import CHOICES  # noqa: PLC0415
    from dogshape.pipeline.drafts.study_folder import is_void, value_of  # noqa: PLC0415

    known_values = {key: value for key, value in defaults.items() if key in known_keys}
    answers: dict[str, dialogue.DialogueAnswer] = {}
    for key, default in defaults.items():
        answered_values = {answered_key: answer.value for answered_key, answer in answers.items()}
        values = known_values | answered_values
        if key not in known_keys and not is_void(key, values):
            read = partial(value_of, key, default=default, answers=values)
            answers[key] = dialogue.ask_value(
                questions.get(key, key), default, CHOICES.get(key, ()), read
            )
    return answers
