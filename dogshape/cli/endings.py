"""Ends of the program from outside: Ctrl-C, a signal to terminate, a closed pipe.

The exit status is that of shells: 128 and the number of the signal.
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
