"""Compilation of the engine ahead of its first shift, while a user answers questions.

The compiler takes some twenty seconds, once after an installation. A process of its own simulates
a check meanwhile; the user's first one reads the compiled functions from the cache.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from dogshape.sim import kernel_layout

#: Cache of the compiled functions; the engine itself is slow to import.
CACHE = Path(kernel_layout.__file__).with_name("kernel") / "__pycache__"
COMMAND = ("check", "mq200")  #: a command that compiles what most others need
COMPILED = "motion.advance-*.nbi"  #: index of the largest compiled function in its cache


def compile_ahead() -> subprocess.Popen[bytes] | None:
    """Start the compilation; None where the engine is compiled already.

    The process outlasts this one.
    """
    if any(CACHE.glob(COMPILED)):
        return None
    return subprocess.Popen(
        [sys.executable, "-m", "dogshape.pipeline", *COMMAND],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
