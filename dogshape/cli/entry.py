"""Entry of the command line: exit status, and one sentence for a wrong option.

Exit status 0 done, 1 the answer is no, 2 bad input; ends from outside have 128 and the number of
the signal: 130 Ctrl-C, 143 SIGTERM, 141 a closed pipe.
"""

from __future__ import annotations

import os
import signal
import sys
from itertools import pairwise
from types import FrameType

#: Signals that end the program as Ctrl-C does: by ``kill``, a scheduler, a closed terminal.
ENDING = (signal.SIGTERM, signal.SIGHUP)
CLOSED = 128 + 13  #: status where the reader of a pipe has gone, SIGPIPE in shells
_received = [int(signal.SIGINT)]


def main() -> None:
    """Load and run the command line; exits with the status of the contract."""
    for number in ENDING:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _interrupt)
    try:
        status = _run()
    except (BrokenPipeError, SystemExit):  # typer exits by itself where a pipe is closed
        status = CLOSED
    if status == 128 + signal.SIGINT:  # of typer too
        status = 128 + _received[-1]
        print("dogshape: stopped", file=sys.stderr)
    for stream in filter(None, (sys.__stdout__, sys.__stderr__)):
        try:
            stream.flush()
        except BrokenPipeError:  # what is left is dropped, or Python complains of it at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            status = CLOSED
    sys.exit(status)


def _interrupt(number: int, _: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)  # once: what follows is tidying up
    _received.append(number)
    raise KeyboardInterrupt


def _run() -> int:
    """Run the command line; give its exit status."""
    try:
        from dogshape.cli.app import app  # noqa: PLC0415

        given = sys.argv[1:]
        if (nothing := _given_nothing(given)) is not None:
            print(f"dogshape: {nothing} is empty; give a value", file=sys.stderr)
            return 2
        return int(app(given or ["--help"], prog_name="dogshape", standalone_mode=False) or 0)
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    except ModuleNotFoundError as error:
        if error.name != "dogshape.validation":
            raise
        needed = "a clone of the repository, installed in place with 'pip install -e .'"
        print(f"dogshape: validation is not installed; it needs {needed}", file=sys.stderr)
        return 2
    except Exception as error:
        # Typer brings its own copy of click, whose errors are known by this method.
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        sentence = _sentence(error, message().strip().rstrip("."))
        verb = getattr(getattr(error, "ctx", None), "command_path", "dogshape")
        print(f"dogshape: {sentence}; see '{verb} --help'", file=sys.stderr)
        return 2


def _given_nothing(arguments: list[str]) -> str | None:
    """Name the option or argument that is empty, as an unset variable of a shell is."""
    for before, text in pairwise(["", *arguments]):
        if text.startswith("--") and text.endswith("="):
            return text[:-1]
        if not text:
            return before if before.startswith("--") else "an argument"
    return None


def _sentence(error: Exception, message: str) -> str:
    """Put a fault of an option into the project's own words, with the study keys like it."""
    details = getattr(error.__cause__, "errors", None)
    names = getattr(getattr(error, "param", None), "opts", None)
    if details is not None and names:
        from dogshape.sim.clutch_tables import broken_rule  # noqa: PLC0415

        return broken_rule(names[-1], details()[0])
    option = getattr(error, "option_name", None)
    if not isinstance(option, str):
        return message
    from dogshape.pipeline.config.schema import keys_like  # noqa: PLC0415

    given = [*sys.argv[1:], ""]
    value = given[given.index(option) + 1] if option in given else ""
    value = "VALUE" if not value or value.startswith("--") else value
    keys = keys_like(option.lstrip("-").replace("-", "_").lower())
    ways = " or ".join(f"--set {key}={value}" for key in keys)
    return f"{message}. A key of the study is set by {ways}" if keys else message
