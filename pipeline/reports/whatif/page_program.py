"""The program of the page's checks: modules of the package as they are, for Brython.

Modules that ``page_checks`` imports are found by their import statements. ``numpy`` is a stand-in
that can be imported and no more, since no check of the page calls it (``page_checks.Known``).
"""

from __future__ import annotations

import ast
import re
import unicodedata
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.dog_strength import Limits

OWN = "dogshape"
START = "dogshape.pipeline.reports.whatif.page_checks"
STAND_INS = {
    "numpy": "float64 = float\n\nclass ndarray:\n    pass\n",
    "numpy.typing": "class NDArray:\n    def __class_getitem__(cls, _):\n        return cls\n",
}
MAIN = """
import json
from browser import window
from dogshape.pipeline.reports.whatif.page_checks import Desk, with_known
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits
from dogshape.sim.strength.materials import Material
from dogshape.sim.strength.strike import Strike
from dogshape.sim.strength.tolerance import Tolerances
desk = Desk({dog!r}, with_known({limits!r}, json.loads(window.python_known)))
window.python_checks = lambda asked: desk.answer(asked)
"""

Module = list[Any]  #: of Brython's files: suffix, source, imported modules, 1 for a package


def program(dog: Dog, limits: Limits) -> str:
    """Write the program that the page runs after its modules; it reads ``window.python_known``."""
    return MAIN.format(dog=dog, limits=limits)


def modules() -> dict[str, Module]:
    """Return all modules of the package that the program needs, in the form of Brython's files."""
    found: dict[str, Module] = {}
    left = [START]
    for name, source in STAND_INS.items():
        found[name] = [".py", source, [], int(name == "numpy")]
    while left:
        name = left.pop()
        if name in found:
            continue
        source = _source(name)
        wanted = [one for one in _imported(source) if one.split(".")[0] == OWN]
        found[name] = [".py", readable(source), wanted]
        left += wanted
    packages = {part for name in list(found) if name.startswith(OWN) for part in _above(name)}
    found |= {name: [".py", "", [], 1] for name in packages}
    return found


def readable(source: str) -> str:
    """Write characters that a source names as numbers: Brython has no list of names offline."""
    return re.sub(
        r"\\N\{([^}]+)\}", lambda named: f"\\u{ord(unicodedata.lookup(named[1])):04x}", source
    )


def interpreter() -> tuple[str, str]:
    """Return Brython and its standard library, as scripts."""
    data = resources.files("brython") / "data"
    files = (data / "brython.js", data / "brython_stdlib.js")
    return files[0].read_text("utf-8"), files[1].read_text("utf-8")


def _source(name: str) -> str:
    spec = find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_text("utf-8")


def _imported(source: str) -> list[str]:
    tree = ast.parse(source)
    found = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return sorted({name for name in found if name})


def _above(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:k]) for k in range(1, len(parts))]
