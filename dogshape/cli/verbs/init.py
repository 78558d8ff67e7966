"""``init``: commented folders to begin with, for a study or a bench of one's own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from dogshape.cli.console import emit, terminal, verb
from dogshape.cli.options import Json, Sets
from dogshape.cli.progress_bar import say
from dogshape.cli.questions import (
    ask_choice,
    ask_number,
    ask_text,
    ask_values,
    ask_yes,
    changed,
    may_ask,
)
from dogshape.cli.tables.init_tables import bench_text, reading_text, study_text
from dogshape.drafts import (
    CLUTCH,
    HEIGHT,
    USE,
    BenchDraft,
    askable,
    default_use,
    default_values,
    guessed,
    require_free,
    searched_keys,
    write_bench,
    write_study,
)
from dogshape.pipeline.config.study_file import key_and_value, pair_of
from dogshape.sim.errors import InputError

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
    """Ask about clutch and use until they make a study; what was answered is the next default."""
    origin = ask_text("begin from (a study, or the folder of a bench)", origin)
    before = default_values(origin)
    before |= {key: value for key, value in values.items() if key in CLUTCH and askable(value)}
    answers = ask_values(before, CLUTCH)
    # What follows from the clutch is the default of the other questions.
    use = default_use(origin, values | changed(answers, before))
    before, answers = before | use, answers | ask_values(use, USE)
    searched = _asked_search(searched_keys(origin))
    while True:
        height = {HEIGHT: answers[HEIGHT]}  # as answered, also where it is the default
        given = values | changed(answers, before) | height | searched
        try:
            return write_study(out, origin, given, force=force)
        except InputError as error:
            say(str(error))
            say("nothing is written yet; your other answers are kept")
            answers = answers | ask_values(_named(answers, str(error)), CLUTCH | USE)


def _asked_search(names: list[str]) -> dict[str, None]:
    """Ask which keys of the dog a search may change; give the others, to be taken out."""
    while names:
        said = ask_text("what the search may change, with blanks between", " ".join(names)).split()
        if said and set(said) <= set(names):
            return {f"variables.{name}": None for name in names if name not in said}
        say(f"a search may change {', '.join(names)}; give some of them")
    return {}


def _named(answers: dict[str, Any], fault: str) -> dict[str, Any]:
    """Return the answers that a fault names, all of them where it names none.

    Forces stand in two tables, which have to agree.
    """
    forces = {key for key in answers if key.endswith("force_N") and "force" in fault}
    found = {key: answers[key] for key in answers if key in fault or key in forces}
    return found or answers


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
    them. A column option may be a formula: --column mismatch_rpm='n_out - n_in'.

    Example: dogshape init bench measured.csv --from mq200_stand --out my_bench
    """
    paths = tuple(tables or ())
    target = out or Path(paths[0].stem.replace(" ", "_") if paths else "my_bench")
    require_free(target, force)
    columns = dict(_pair(text) for text in column or [])
    values = dict(key_and_value(text) for text in set_ or [])
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


def _asked_columns(draft: BenchDraft) -> tuple[BenchDraft, dict[str, Any]]:
    """Ask about the columns of the tables; give what is read of them with the draft."""
    found = guessed(draft)
    while draft.tables:
        terminal(stderr=True).print(reading_text(found))
        for fault in found["faults"]:
            say(fault)
        if not found["faults"] and ask_yes("is that right?", default=True):
            break
        told = ask_text("say one, as shift_time_s=COLUMN:UNIT or decimal=, (empty: go on)", "")
        if not told:
            break
        name, text = _pair(told.removeprefix("--column ").removeprefix("--"))
        if name == "decimal":
            draft = replace(draft, decimal=text)
        elif name == "rows":
            draft = replace(draft, rows=text)
        else:
            draft = replace(draft, columns={**draft.columns, name: text.strip("'")})
        found = guessed(draft)
    return draft, found


def _asked(draft: BenchDraft, target: Path) -> BenchDraft:
    """Ask about columns, clutch and stand."""
    draft, found = _asked_columns(draft)
    values = dict(draft.values)
    values = {"name": ask_text("name of the data set", target.name)} | values
    values = {"source": ask_text("who measured it, and when", "not said")} | values
    origin = ask_text("clutch of the stand, as in (study or bench)", draft.origin)
    if not ask_yes(f"is the clutch exactly that of '{origin}'?", default=True):
        before = default_values(origin)
        values = changed(ask_values(before, CLUTCH), before) | values
    for key, (question, choices) in RECORD.items():
        if key not in values and (key != EMPTY or found["empty"]):
            values[key] = ask_choice(question, choices, "unknown")
    if "timeout_s" not in values and ask_yes("has the stand a time-out of its own?", default=False):
        values["timeout_s"] = ask_number("time-out, s", 1.0)
    return replace(draft, origin=origin, values=values)
