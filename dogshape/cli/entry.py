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
END_SIGNALS = (signal.SIGTERM, signal.SIGHUP)
SIGNAL_STATUS = 128  #: exit status by a signal, less its number
CLOSED_PIPE_STATUS = SIGNAL_STATUS + 13  #: SIGPIPE, when the reader of a pipe has gone
REPLACEMENT_HANDLER = "dogshape.replaced"  #: error handler of standard output and error
#: First and last code point for a byte of a path that is no text.
BYTE_SURROGATES = (0xDC80, 0xDCFF)
#: Spellings of signs that an encoding lacks; letters with accents lose these.
SPELLINGS = {
    "\N{PLUS-MINUS SIGN}": "+/-",
    "\N{GREATER-THAN OR EQUAL TO}": ">=",
    "\N{LESS-THAN OR EQUAL TO}": "<=",
    "\N{MINUS SIGN}": "-",
    "\N{EN DASH}": "-",
    "\N{EM DASH}": "-",
    "\N{MULTIPLICATION SIGN}": "x",
    "\N{MIDDLE DOT}": "*",
    "\N{DEGREE SIGN}": " deg",
    "\N{MICRO SIGN}": "u",
    "\N{GREEK SMALL LETTER MU}": "u",
    "\N{SQUARE ROOT}": "sqrt",
    "\N{INFINITY}": "inf",
    "\N{ALMOST EQUAL TO}": "~",
    "\N{NOT EQUAL TO}": "!=",
    "\N{RIGHTWARDS ARROW}": "->",
    "\N{GREEK CAPITAL LETTER DELTA}": "D",
    "\N{GREEK SMALL LETTER ALPHA}": "alpha",
    "\N{GREEK SMALL LETTER BETA}": "beta",
    "\N{GREEK SMALL LETTER GAMMA}": "gamma",
    "\N{GREEK SMALL LETTER OMEGA}": "omega",
    "\N{GREEK SMALL LETTER SIGMA}": "sigma",
    "\N{LATIN SMALL LETTER SHARP S}": "ss",
    "\N{LEFT SINGLE QUOTATION MARK}": "'",
    "\N{RIGHT SINGLE QUOTATION MARK}": "'",
    "\N{LEFT DOUBLE QUOTATION MARK}": '"',
    "\N{RIGHT DOUBLE QUOTATION MARK}": '"',
    "\N{BOX DRAWINGS HEAVY HORIZONTAL}": "-",
    "\N{BOX DRAWINGS HEAVY LEFT}": "-",
    "\N{BOX DRAWINGS HEAVY RIGHT}": "-",
    "\N{SUPERSCRIPT MINUS}": "^-",
    "\N{SUPERSCRIPT ONE}": "^1",
    "\N{SUPERSCRIPT TWO}": "^2",
    "\N{SUPERSCRIPT THREE}": "^3",
}
_received_signals = [int(signal.SIGINT)]


def main() -> None:
    """Load and run the command line; exits with the status of the contract."""
    _print_in_any_encoding()
    for number in END_SIGNALS:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _interrupt)
    try:
        status = _run()
    except (BrokenPipeError, SystemExit):  # typer exits by itself where a pipe is closed
        status = CLOSED_PIPE_STATUS
    if status == SIGNAL_STATUS + signal.SIGINT:  # of typer too
        status = SIGNAL_STATUS + _received_signals[-1]
        print("dogshape: stopped", file=sys.stderr)
    for stream in filter(None, (sys.__stdout__, sys.__stderr__)):
        try:
            stream.flush()
        except BrokenPipeError:  # drops the buffer, of which Python complains at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            status = CLOSED_PIPE_STATUS
    sys.exit(status)


def _print_in_any_encoding() -> None:
    """Let standard output and error replace signs that the encoding of the terminal lacks."""
    codecs.register_error(REPLACEMENT_HANDLER, _replace_sign)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=REPLACEMENT_HANDLER)


def _replace_sign(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace a sign that an encoding lacks; a byte of a path that is no text stays itself.

    Returns the replacement, and the position after the sign.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    sign = error.object[error.start]
    end = error.start + 1
    first, last = BYTE_SURROGATES
    if first <= ord(sign) <= last:
        return bytes([ord(sign) - first + 0x80]), end
    for spelling in (SPELLINGS.get(sign, ""), *_plain_letters(sign)):
        try:
            spelling.encode(error.encoding)
        except UnicodeEncodeError:
            continue
        if spelling:
            return spelling, end
    return "?", end


def _plain_letters(sign: str) -> Iterator[str]:
    """Spell a letter without its accents, and a mathematical or wide one as the plain one."""
    plain = unicodedata.normalize("NFKD", sign)
    yield plain
    yield plain.encode("ascii", "ignore").decode()


def _interrupt(number: int, _: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)  # once: the rest of the program only tidies up
    _received_signals.append(number)
    raise KeyboardInterrupt


def _run() -> int:
    """Run the command line; returns its exit status."""
    try:
        from dogshape.cli.app import app  # noqa: PLC0415

        arguments = sys.argv[1:]
        empty = _empty_argument(arguments)
        if empty is not None:
            print(f"dogshape: {empty} is empty; give a value", file=sys.stderr)
            return 2
        status = app(arguments or ["--help"], prog_name="dogshape", standalone_mode=False)
        return int(status or 0)
    except KeyboardInterrupt:
        return SIGNAL_STATUS + signal.SIGINT
    except ModuleNotFoundError as error:
        if error.name != "dogshape.validation":
            raise
        remedy = "a clone of the repository, installed in place with 'pip install -e .'"
        print(f"dogshape: validation is not installed; it needs {remedy}", file=sys.stderr)
        return 2
    except Exception as error:
        # Typer brings its own copy of click, whose errors have this method.
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        sentence = _sentence(error, message().strip().rstrip("."))
        verb = getattr(getattr(error, "ctx", None), "command_path", "dogshape")
        print(f"dogshape: {sentence}; see '{verb} --help'", file=sys.stderr)
        return 2


def _empty_argument(arguments: list[str]) -> str | None:
    """Name the first option or argument without a value, e.g. of an unset variable of a shell."""
    for previous, text in pairwise(["", *arguments]):
        if text.startswith("--") and text.endswith("="):
            return text[:-1]
        if not text:
            return previous if previous.startswith("--") else "an argument"
    return None


def _sentence(error: Exception, message: str) -> str:
    """Describe a faulty option in the project's terms, with the study keys that resemble it."""
    details = getattr(error.__cause__, "errors", None)
    names = getattr(getattr(error, "param", None), "opts", None)
    if details is not None and names:
        from dogshape.sim.clutch_tables import BrokenRule  # noqa: PLC0415

        return BrokenRule.of(details()[0]).sentence(names[-1])
    option = getattr(error, "option_name", None)
    command: Any = getattr(getattr(error, "ctx", None), "command", None)
    options = [name for parameter in getattr(command, "params", ()) for name in parameter.opts]
    if not isinstance(option, str) or "--set" not in options:
        return message
    from dogshape.pipeline.config.schema import keys_like  # noqa: PLC0415

    keys = keys_like(option.lstrip("-").replace("-", "_").lower())
    if not keys:
        return message
    value = _option_value(option)
    settings = " or ".join(f"--set {key}={value}" for key in keys)
    return f"{message}. A key of the study is set by {settings}"


def _option_value(option: str) -> str:
    """Look up the value of an option in the arguments; ``VALUE`` without one."""
    arguments = [*sys.argv[1:], ""]
    value = arguments[arguments.index(option) + 1] if option in arguments else ""
    return "VALUE" if not value or value.startswith("--") else value
