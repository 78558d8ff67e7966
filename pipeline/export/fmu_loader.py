"""The end of an FMU's loader, for both versions of FMI.

On Linux the loaders of pythonfmu 0.7.0 and pythonfmu3 0.3.4 release their last reference to Python
twice at the end of a process, by a static destructor and by ``onLibraryUnload``, which may abort
the process. Released before both of them, it is empty for them.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

_LIBRARIES: dict[Path, ctypes.CDLL] = {}  # of this process, loaded until its end


def release_at_exit(library: Path) -> None:
    """Release the reference of a loader to Python before the destructors of its library."""
    on_linux = sys.platform.startswith("linux") and library.is_file()
    if library in _LIBRARIES or not on_linux:
        return
    loader = _LIBRARIES[library] = ctypes.CDLL(str(library))
    release = ctypes.cast(loader.finalizePythonInterpreter, ctypes.c_void_p)
    no_argument = no_library = None
    ctypes.CDLL(None)["__cxa_atexit"](release, no_argument, no_library)
