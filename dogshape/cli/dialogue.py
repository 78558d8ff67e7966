"""Dialogue of a terminal: one question at a time, and corrections of how a table is read."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from dogshape.cli.options import column_pair
from dogshape.sim.errors import InputError
from dogshape.terminal import print_parts, terminal

if TYPE_CHECKING:
    from dogshape.bench.bench_draft import BenchDraft, DraftTables
    from dogshape.bench.reading_report import ReadingReport

PIPE_WIDTH = 160  #: characters of a table where standard error is no terminal
#: Fields of a draft with one text, by their options.
TEXT_OPTIONS = ("decimal", "rows", "quotes")


def may_ask(yes: bool = False) -> bool:
    """Decide whether to ask: in a terminal, unless all defaults were accepted beforehand."""
    return not yes and sys.stdin.isatty()


class DialogueAnswer(NamedTuple):
    """Answer to a question: its value, and whether the user typed it or took the default."""

    value: Any
    is_typed: bool


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
    if not isinstance(default, bool):
        return ask_value(question, default, choices, read).value
    try:
        return typer.confirm(question, default=default, err=True)
    except typer.Abort:
        raise KeyboardInterrupt from None


def ask_value(
    question: str,
    default: Any,
    choices: Sequence[str] = (),
    read: Callable[[str], Any] | None = None,
) -> DialogueAnswer:
    """Ask for a number, numbers or text as ``ask`` does, with the way in which it was answered."""
    from dogshape.pipeline.drafts.answers import choice_of, number_of, shown_value  # noqa: PLC0415

    def answer_of(text: str) -> DialogueAnswer:
        if not text:
            return DialogueAnswer(default, is_typed=False)
        try:
            if isinstance(default, str):
                return DialogueAnswer(choice_of(text, choices), is_typed=True)
            return DialogueAnswer((read or number_of)(text), is_typed=True)
        except InputError as error:
            raise typer.BadParameter(str(error)) from None

    shown = shown_value(default)
    words = f"{question} [{shown}]" if shown else question
    try:
        answer: DialogueAnswer = typer.prompt(
            words, default="", show_default=False, err=True, value_proc=answer_of
        )
    except typer.Abort:
        raise KeyboardInterrupt from None
    return answer


def print_reading(report: ReadingReport) -> None:
    """Print the columns as read and the excluded rows and columns on standard error."""
    from dogshape.pipeline.drafts.reading_table import reading_parts  # noqa: PLC0415

    width = None if sys.stderr.isatty() else PIPE_WIDTH
    print_parts(terminal(stderr=True, width=width), reading_parts(report))


def correct_reading(draft: BenchDraft, *, confirm: bool) -> DraftTables:
    """Ask about columns and rows until the tables of a draft are read without a fault.

    With ``confirm`` a reading without a fault is asked about too. Returns the tables of the draft
    with the answers.
    """
    from dogshape.bench.bench_draft import read_tables  # noqa: PLC0415

    tables = read_tables(draft)
    while draft.paths:
        report = tables.report
        print_reading(report)
        for fault in report.faults:
            typer.echo(fault, err=True)
        if not report.faults and (not confirm or ask("is that right?", True)):
            break
        answer = ask("say one, as shift_time_s=COLUMN:UNIT or drop Remark=x (empty: go on)", "")
        if not answer:
            break
        draft = add_answer(draft, answer)
        tables = read_tables(draft)
    return tables


def add_answer(draft: BenchDraft, answer: str) -> BenchDraft:
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
    if option in TEXT_OPTIONS:
        changes: dict[str, Any] = {option: value}
        return replace(draft, **changes)
    sheet = value if option == "sheet" else _sheet_of(text, draft)
    if sheet:
        return replace(draft, tables=_with_sheet(draft, sheet))
    name, column = column_pair(text.removeprefix("column "))
    return replace(draft, columns={**draft.columns, name: column.strip("'")})


def _sheet_of(answer: str, draft: BenchDraft) -> str:
    """Extract the sheet from an answer ``FILE.xlsx#SHEET``; empty for another answer."""
    for path in draft.paths:
        for name in (str(path), path.name):
            if answer.strip("'").startswith(f"{name}#"):
                return answer.strip("'")[len(name) + 1 :]
    return ""


def _with_sheet(draft: BenchDraft, sheet: str) -> tuple[str, ...]:
    """Name the sheet behind each workbook of a draft that has none."""
    from dogshape.bench.raw_sheet import file_of, is_workbook  # noqa: PLC0415

    tables = []
    for path in draft.paths:
        lacks_sheet = is_workbook(path) and file_of(path) == path
        tables.append(f"{path}#{sheet}" if lacks_sheet else str(path))
    return tuple(tables)
