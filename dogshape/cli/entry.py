"""Entry of the command line: quiet when stopped, one sentence for a wrong option.

Ends from outside (Ctrl-C, a signal, a closed pipe) have the exit status of shells: 128 and the
number of the signal.
"""

from __future__ import annotations

import os
import select
import signal
import sys
from types import FrameType
from typing import TextIO

#: Signals that end the program as Ctrl-C does: by ``kill``, a scheduler, a closed terminal.
ENDING = ("SIGTERM", "SIGHUP")
CLOSED = 128 + 13  #: status where the reader of a pipe has gone, SIGPIPE in shells
STOPPED = 128 + signal.SIGINT  #: status of Ctrl-C, which typer gives as well
_received = [int(signal.SIGINT)]


def listen() -> None:
    """Turn signals to end into KeyboardInterrupt; a signal that is ignored stays ignored."""
    for name in ENDING:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _interrupt)


def _interrupt(number: int, _: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)  # once: what follows is tidying up
    _received.append(number)
    raise KeyboardInterrupt


def stopped() -> int:
    """Print that the program was stopped; give the exit status of the signal received."""
    print("dogshape: stopped", file=sys.stderr)
    return 128 + _received[-1]


def reader_gone() -> bool:
    """Decide whether the reader of the output or of the errors has closed its pipe."""
    ends = select.poll()
    for stream in _streams():
        ends.register(stream.fileno(), 0)
    return any(event & select.POLLERR for _, event in ends.poll(0))


def written(status: int) -> int:
    """Write out what is left and give the exit status, which a closed pipe changes.

    What such a pipe does not take is dropped: Python would complain of it at its end.
    """
    for stream in _streams():
        try:
            stream.flush()
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            status = CLOSED
    return status


def _streams() -> list[TextIO]:
    return [one for one in (sys.__stdout__, sys.__stderr__) if one is not None]


def main() -> None:
    """Load and run the command line; exits with the status of the contract."""
    listen()
    try:
        status = _run()
        if status == STOPPED:
            status = stopped()
    except BrokenPipeError:
        if not reader_gone():
            raise
        status = CLOSED
    sys.exit(written(status))


def _run() -> int:
    """Run the command line; give its exit status."""
    try:
        from dogshape.cli.app import app  # noqa: PLC0415

        given = sys.argv[1:]
        if (nothing := _given_nothing(given)) is not None:
            print(f"dogshape: {nothing} is given nothing; give a value", file=sys.stderr)
            return 2
        return int(app(given or ["--help"], standalone_mode=False) or 0)
    except SystemExit as end:  # of a pipe that closed while help was printed
        return CLOSED if reader_gone() else int(end.code or 0)
    except KeyboardInterrupt:
        return STOPPED
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
        print(f"dogshape: {sentence}; see 'dogshape --help'", file=sys.stderr)
        return 2


def _given_nothing(arguments: list[str]) -> str | None:
    """Return the option or argument whose value is empty, as an unset variable of a shell is.

    An empty path would be taken for the current folder.
    """
    for place, text in enumerate(arguments):
        if text.startswith("--") and text.endswith("="):
            return text[:-1]
        if not text:
            before = arguments[place - 1] if place else ""
            return before if before.startswith("--") else "an argument"
    return None


def _sentence(error: Exception, message: str) -> str:
    """Put a fault of an option into the project's own words, where it has some."""
    details = getattr(error.__cause__, "errors", None)
    names = getattr(getattr(error, "param", None), "opts", None)
    if details is not None and names:
        from dogshape.sim.clutch_tables import broken_rule  # noqa: PLC0415

        return broken_rule(names[-1], details()[0])
    option = getattr(error, "option_name", None)
    if isinstance(option, str) and (keys := _keys_like(option)):
        return f"{message}. A key of the study is set by {' or '.join(keys)}"
    return message


def _keys_like(option: str) -> list[str]:
    """Point to the keys of a study that an unknown option resembles."""
    from dogshape.pipeline.config.schema import keys_like  # noqa: PLC0415

    given = [*sys.argv[1:], ""]
    value = given[given.index(option) + 1] if option in given else ""
    value = "VALUE" if not value or value.startswith("--") else value
    stem = option.lstrip("-").replace("-", "_").lower()
    return [f"--set {key}={value}" for key in keys_like(stem)]
