"""Entry of the command line: quiet when stopped, one sentence for a wrong option."""

from __future__ import annotations

import sys

from dogshape.cli.endings import CLOSED, STOPPED, listen, reader_gone, stopped, written


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
        from dogshape.sim.rules import broken_rule  # noqa: PLC0415

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
