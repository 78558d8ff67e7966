"""Simulate, search, check and diagnose dog clutches.

A problem is a frozen value, a verb turns it into a frozen result that carries it.
"""

from __future__ import annotations

import ast
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from typing import Any

from dogshape.python_words import in_python

#: Module of each public name, as ``__init__.pyi`` imports it for type checkers. Modules are loaded
#: when asked for: simulation, search and pages take seconds, which a quick answer does not need.
_HOMES = {
    alias.name: str(node.module)
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
__all__ = sorted(_HOMES)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"dogshape has no '{name}'; it has {', '.join(__all__)}")
    found = getattr(import_module(_HOMES[name]), name)
    return in_python(found) if isfunction(found) else found


def __dir__() -> list[str]:
    return __all__
