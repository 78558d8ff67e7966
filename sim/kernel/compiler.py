"""Decorators of compiled functions, and their cache on disk.

The compiler notices a change of a function's own file, but not of the files of functions that it
calls. Here a cached function also depends on the content of all files of the engine.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

FOLDER = Path(__file__).parent
#: Files whose content decides what any compiled function of the engine does.
SOURCES = (*sorted(FOLDER.glob("*.py")), FOLDER.parent / "kernel_layout.py")
FINGERPRINT = hashlib.sha256(b"".join(path.read_bytes() for path in SOURCES)).hexdigest()

#: To count references to arrays (``_nrt``) takes two fifths of the time here. Sums in any order
#: (``fastmath``) would cost a tenth less, but give other digits where code comes from the cache.
OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}


def _decorator(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Make a decorator that compiles a function and caches it by ``FINGERPRINT``."""
    options = OPTIONS | options

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = njit(cache=True, **options)(function)
        if dispatcher is function:  # NUMBA_DISABLE_JIT
            return function
        index: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
        if not hasattr(index, "_source_stamp"):
            # Another version of the compiler: no cache is slow, a stale one is wrong.
            return njit(**options)(function)
        index._source_stamp = (index._source_stamp, FINGERPRINT)
        return dispatcher

    return decorate


compiled = _decorator()
#: For a function that makes arrays or calls such a function.
making = _decorator(_nrt=True, nogil=True)
#: A call passes every field of every array: without calls a shift costs a fifth less.
inlined = _decorator(forceinline=True)
