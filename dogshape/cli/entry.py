"""Entry of the command line: exit status, and one sentence for a wrong option.

Exit status 0 done, 1 the answer is no, 2 bad input; ends from outside have 128 and the number of
the signal: 130 Ctrl-C, 143 SIGTERM, 141 a closed pipe.
"""

from __future__ import annotations

import codecs
import io
import os
import signal
import sys
import unicodedata
from collections.abc import Iterator
from itertools import pairwise
from types import FrameType
from typing import Any

#: Signals that end the program as Ctrl-C does: by ``kill``, a scheduler, a closed terminal.
ENDING = (signal.SIGTERM, signal.SIGHUP)
CLOSED = 128 + 13  #: status where the reader of a pipe has gone, SIGPIPE in shells
REPLACED = "dogshape.replaced"  #: name of the error handler of standard output and error
SURROGATES = (0xDC80, 0xDCFF)  #: that stand for bytes of a path that is no text
#: Words for signs, where an encoding lacks them; letters with accents lose these.
SIGNS = {
    "\N{PLUS-MINUS SIGN}": "+/-", "\N{GREATER-THAN OR EQUAL TO}": ">=",
    "\N{LESS-THAN OR EQUAL TO}": "<=", "\N{MINUS SIGN}": "-", "\N{EN DASH}": "-",
    "\N{EM DASH}": "-", "\N{MULTIPLICATION SIGN}": "x", "\N{MIDDLE DOT}": "*",
    "\N{DEGREE SIGN}": " deg", "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u",
    "\N{SQUARE ROOT}": "sqrt", "\N{INFINITY}": "inf", "\N{ALMOST EQUAL TO}": "~",
    "\N{NOT EQUAL TO}": "!=", "\N{RIGHTWARDS ARROW}": "->", "\N{GREEK CAPITAL LETTER DELTA}": "D",
    "\N{GREEK SMALL LETTER ALPHA}": "alpha", "\N{GREEK SMALL LETTER BETA}": "beta",
    "\N{GREEK SMALL LETTER GAMMA}": "gamma", "\N{GREEK SMALL LETTER OMEGA}": "omega",
    "\N{GREEK SMALL LETTER SIGMA}": "sigma", "\N{LATIN SMALL LETTER SHARP S}": "ss",
    "\N{LEFT SINGLE QUOTATION MARK}": "'", "\N{RIGHT SINGLE QUOTATION MARK}": "'",
    "\N{LEFT DOUBLE QUOTATION MARK}": '"', "\N{RIGHT DOUBLE QUOTATION MARK}": '"',
    "\N{BOX DRAWINGS HEAVY HORIZONTAL}": "-", "\N{BOX DRAWINGS HEAVY LEFT}": "-",
    "\N{BOX DRAWINGS HEAVY RIGHT}": "-", "\N{SUPERSCRIPT MINUS}": "^-",
    "\N{SUPERSCRIPT ONE}": "^1", "\N{SUPERSCRIPT TWO}": "^2", "\N{SUPERSCRIPT THREE}": "^3",
}  # fmt: skip
_received = [int(signal.SIGINT)]


def main() -> None:
    """Load and run the command line; exits with the status of the contract."""
    _print_in_any_encoding()
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


def _print_in_any_encoding() -> None:
    """Let standard output and error replace signs that the encoding of the terminal lacks."""
    codecs.register_error(REPLACED, _replaced)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=REPLACED)


def _replaced(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace a sign that an encoding lacks; a byte of a path that is no text stays itself."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    sign, end = error.object[error.start], error.start + 1
    if SURROGATES[0] <= ord(sign) <= SURROGATES[1]:
        return bytes([ord(sign) - SURROGATES[0] + 0x80]), end
    for words in (SIGNS.get(sign, ""), *_spellings(sign)):
        try:
            words.encode(error.encoding)
        except UnicodeEncodeError:
            continue
        if words:
            return words, end
    return "?", end


def _spellings(sign: str) -> Iterator[str]:
    """Spell a letter without its accents, and a mathematical or wide one as the plain one."""
    plain = unicodedata.normalize("NFKD", sign)
    yield plain
    yield plain.encode("ascii", "ignore").decode()


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
    command: Any = getattr(getattr(error, "ctx", None), "command", None)
    options = [name for parameter in getattr(command, "params", ()) for name in parameter.opts]
    if not isinstance(option, str) or "--set" not in options:
        return message
    from dogshape.pipeline.config.schema import keys_like  # noqa: PLC0415

    given = [*sys.argv[1:], ""]
    value = given[given.index(option) + 1] if option in given else ""
    value = "VALUE" if not value or value.startswith("--") else value
    keys = keys_like(option.lstrip("-").replace("-", "_").lower())
    ways = " or ".join(f"--set {key}={value}" for key in keys)
    return f"{message}. A key of the study is set by {ways}" if keys else message
