"""The command line ``dogshape``: all verbs of the program, each loaded when it is called."""

from __future__ import annotations

import re
import textwrap
from collections import UserDict
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from dogshape.sim.versions import versions

#: Module of each verb, in which a function bears the verb's name, with ``_`` between two words; in
#: the order of the help.
VERBS = {
    "init": "dogshape.cli.verbs.init",
    "shift": "dogshape.cli.verbs.study",
    "expect": "dogshape.cli.verbs.study",
    "strength": "dogshape.cli.verbs.study",
    "check": "dogshape.cli.verbs.check",
    "app": "dogshape.cli.verbs.design",
    "export": "dogshape.cli.verbs.design",
    "study": "dogshape.cli.verbs.study",
    "report": "dogshape.cli.verbs.study",
    "compare": "dogshape.cli.verbs.study",
    "fit": "dogshape.cli.verbs.study",
    "validate": "dogshape.cli.verbs.study",
    "gap": "dogshape.cli.verbs.gap",
    "gap plan": "dogshape.cli.verbs.gap",
    "gap update": "dogshape.cli.verbs.gap",
}
#: Verbs of the project's own proof, which the help does not list and only a clone has.
PROOF = {"blind": "dogshape.validation.blind.verbs"}
#: Plain text for people and programs alike.
PLAIN: dict[str, Any] = {
    "add_completion": False,
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
}


class _Commands(UserDict[str, Any]):
    """Commands by verb. Names are known at once; a command's module is loaded with it.

    Simulation, search and report take seconds to load, and no verb needs all of them.
    """

    def __getitem__(self, name: str) -> Any:
        found = getattr(import_module(super().__getitem__(name)), name.replace(" ", "_"))
        if isinstance(found, typer.Typer):
            return typer.main.get_command(found)
        program = typer.Typer(**PLAIN)
        program.command(name)(found)
        return typer.main.get_command(program)


def _summary(verb: str, limit: int) -> str:
    """Read the first sentence about a verb from the source of its module."""
    place = find_spec(VERBS[verb])
    assert place is not None
    assert place.origin is not None
    source = Path(place.origin).read_text(encoding="utf-8")
    name = verb.replace(" ", "_")
    pattern = rf'^def {name}\(.*?"""(.*?)(?:\n\n|""")|^{name} = typer.*?help="(.*?)"'
    found = re.search(pattern, source, re.DOTALL | re.MULTILINE)
    first = " ".join((found[1] or found[2] if found else "").split()).partition(". ")[0]
    return textwrap.shorten(f"{first.removesuffix('.')}.", limit, placeholder="...")


class _Verbs(TyperGroup):
    """The program's verbs."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = _Commands(VERBS | PROOF)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the verbs with what each does, read from its source: loading all takes seconds."""
        limit = formatter.width - 6 - max(map(len, VERBS))
        with formatter.section("Commands"):
            formatter.write_dl([(verb, _summary(verb, limit)) for verb in VERBS])

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command; ``gap plan`` is one of two words, ``gap ./plan`` a data set."""
        two = " ".join(args[:2])
        return super().resolve_command(ctx, [two, *args[2:]] if two in VERBS else args)


app = typer.Typer(
    cls=_Verbs,
    name="dogshape",
    help="Simulate, search and check the shape of the dogs of a dog clutch.",
    no_args_is_help=True,
    **PLAIN,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"dogshape {versions()['dogshape']}, drake {versions()['drake']}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="and exit")
    ] = False,
) -> None:
    """Simulate, search and check the shape of the dogs of a dog clutch."""
