"""Command line ``dogshape``: its verbs, and the exit status of errors."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from dogshape.cli.options import PLAIN
from dogshape.cli.renamed import current_words
from dogshape.cli.verbs import diagnosis, init, study
from dogshape.sim.errors import DogshapeError, EngineError
from dogshape.sim.interface import command_line
from dogshape.sim.versions import program_versions

SURROGATES = ("\ud800", "\udfff")  #: first and last letter of bytes that are no text, in a path
#: Verbs but ``init``, in the order of the help, by the names of Python's.
VERBS = {
    verb.__name__.replace("_", "-"): verb
    for verb in (
        *(study.shift, study.expect, study.expect_draws, study.strength, study.check),
        *(study.app, study.export, study.search, study.report, study.compare, study.fit),
        *(study.predict, study.validate),
        *(diagnosis.diagnose, diagnosis.plan_shifts, diagnosis.update_diagnosis),
    )
}


class _Verbs(TyperGroup):
    """Verbs of the program; errors print a sentence, status 1 if engines disagree, else 2."""

    def list_commands(self, ctx: Any) -> list[str]:
        """List the verbs in the order of the help."""
        return ["init", *VERBS]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Find a verb; ``blind`` is not listed and only a clone has it."""
        if cmd_name == "blind":
            return typer.main.get_command(import_module("dogshape.validation.blind.verbs").blind)
        return super().get_command(ctx, cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return name, command and remaining arguments, as click asks for them.

        Earlier names of verbs and options work, with a hint in a terminal.
        """
        words, renamed = current_words(args)
        if _shows_hints():
            for old, new in renamed.items():
                print(f"hint: {old} is now {new}", file=sys.stderr)
        return super().resolve_command(ctx, words)

    def invoke(self, ctx: Any) -> Any:
        """Run the verb; its errors name options of the command line."""
        try:
            with command_line():
                return super().invoke(ctx)
        except DogshapeError as error:
            sentence = str(error)
            status = 1 if isinstance(error, EngineError) else 2
        except BrokenPipeError:
            raise
        except UnicodeEncodeError as error:
            is_path = any(SURROGATES[0] <= sign <= SURROGATES[1] for sign in error.object)
            if not is_path:
                raise
            sentence = (
                "a path has letters that the encoding of this locale lacks; set PYTHONUTF8=1, or "
                "LC_ALL=C.UTF-8"
            )
            status = 2
        except OSError as error:
            path = f" ({error.filename})" if error.filename else ""
            sentence = f"{error.strerror or error}{path}; check path, space and rights"
            status = 2
        print(f"dogshape: {sentence}", file=sys.stderr)
        raise typer.Exit(status)


def _shows_hints() -> bool:
    """Decide whether somebody reads hints: a script's standard error holds refusals alone."""
    return sys.stderr.isatty()


app = typer.Typer(cls=_Verbs, name="dogshape", **PLAIN)
app.add_typer(init.init)
for _name, _verb in VERBS.items():
    app.command(_name)(_verb)


def _print_version(requested: bool) -> None:
    if requested:
        print(", ".join(f"{name} {version}" for name, version in program_versions().items()))
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="versions")
    ] = False,
) -> None:
    """Simulate, search and check the shape of the dogs of a dog clutch."""
