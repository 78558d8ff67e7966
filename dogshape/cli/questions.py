"""Questions in a terminal, each with a default; none where nobody can answer."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import typer

from dogshape.cli.progress_bar import say
from dogshape.sim.errors import meant_number


def may_ask(yes: bool) -> bool:
    """Decide whether to ask: in a terminal, unless all defaults were accepted beforehand."""
    return not yes and sys.stdin.isatty()


def ask_text(question: str, default: str) -> str:
    """Ask for words; the end of the input stops the program as Ctrl-C does."""
    try:
        found: str = typer.prompt(question, default=default, err=True)
    except typer.Abort:
        raise KeyboardInterrupt from None
    return found.strip()


def ask_yes(question: str, *, default: bool) -> bool:
    """Ask for yes or no; the end of the input stops the program as Ctrl-C does."""
    try:
        return typer.confirm(question, default=default, err=True)
    except typer.Abort:
        raise KeyboardInterrupt from None


def ask_choice(question: str, choices: Sequence[str], default: str) -> str:
    """Ask for one of some words."""
    while True:
        found = ask_text(f"{question}: {', '.join(choices)}", default)
        if found in choices:
            return found
        say(f"give one of {', '.join(choices)}")


def ask_number(question: str, default: Any) -> Any:
    """Ask for a number, whole where the default is; a decimal comma is taken as a point."""
    while True:
        found = meant_number(ask_text(question, f"{default:g}"))
        if found is not None and (not isinstance(default, int) or found == round(found)):
            return round(found) if isinstance(default, int) else found
        say("that is no " + ("whole number" if isinstance(default, int) else "number"))


def ask_numbers(question: str, default: Sequence[float]) -> list[float]:
    """Ask for one number and more, with blanks between them."""
    while True:
        words = ask_text(question, " ".join(f"{one:g}" for one in default)).split()
        found = [meant_number(word.rstrip(";")) for word in words]
        numbers = [one for one in found if one is not None]
        if numbers and len(numbers) == len(found):
            return numbers
        say("that are no numbers with blanks between them")


def ask_values(values: Mapping[str, Any], words: Mapping[str, str]) -> dict[str, Any]:
    """Ask for values by their keys: a number, a list or a word, as the default."""
    found = {}
    for key, value in values.items():
        ask: Callable[[str, Any], Any] = ask_text
        if not isinstance(value, str):
            ask = ask_numbers if isinstance(value, (list, tuple)) else ask_number
        found[key] = ask(words.get(key, key), value)
    return found


def changed(found: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Give the values that differ from their defaults."""
    return {key: value for key, value in found.items() if value != values[key]}
