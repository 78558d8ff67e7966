"""Let the API pages read ``name : what it is``, as the docstrings of this project have it.

NumPy's form has the type there; here types stand in the signature, so the parser gets the name
alone and the words below it.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Module, Object

SECTION = re.compile(r"^(\w+)\n-{3,}$", re.MULTILINE)
NAMED = re.compile(r"^([\w*]+(?:, [\w*]+)*) : (.+(?:\n +\S.*)*)$", re.MULTILINE)
TYPED_IN = re.compile(r"^>>> .*(?:\n\S.*)*", re.MULTILINE)


def spelled_out(text: str) -> str:
    """Write a docstring of this project as the parser and Markdown have it.

    Parameters and errors lose the colon, names that share their words get a copy each, examples in
    running text become code, and so do formulas.
    """
    text = re.sub(r":math:(?=`)|^ *\.\. math::\n", "", text, flags=re.MULTILINE)
    begins = [match.start() for match in SECTION.finditer(text)]
    pieces = [text[a:b] for a, b in zip([0, *begins], [*begins, len(text)], strict=True)]
    opening, *others = pieces
    named = ("Parameters", "Raises")
    return TYPED_IN.sub(r"```pycon\n\g<0>\n```", opening) + "".join(
        NAMED.sub(_each_name, piece) if piece.startswith(named) else piece for piece in others
    )


def _each_name(match: re.Match[str]) -> str:
    return "\n".join(f"{name}\n    {match[2]}" for name in match[1].split(", "))


class ParameterNames(Extension):
    """Rewrite each docstring before it is parsed."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Rewrite the docstring of one module, class or function."""
        if obj.docstring is not None:
            obj.docstring.value = spelled_out(obj.docstring.value)

    def on_package(self, *, pkg: Module, **_: Any) -> None:
        """Rewrite the docstring of the package itself, which is no object of a module."""
        if pkg.docstring is not None:
            pkg.docstring.value = spelled_out(pkg.docstring.value)
