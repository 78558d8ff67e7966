"""Let the API pages read ``name : what it is``, as the docstrings of this project have it.

NumPy's form has the type there; here types stand in the signature, so the parser gets the name
alone and the words below it. Formulas become MathML, which a browser draws without a script.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Module, Object
from latex2mathml.converter import convert

SECTION = re.compile(r"^(\w+)\n-{3,}$", re.MULTILINE)
NAMED = re.compile(r"^([\w*]+(?:, [\w*]+)*) : (.+(?:\n +\S.*)*)$", re.MULTILINE)
INLINE_FORMULA = re.compile(r":math:`([^`]+)`")
#: The directive, and its lines that are indented further, up to an empty one.
FORMULA = re.compile(r"^( *)\.\. math::(.*(?:\n\1 +\S.*)*)", re.MULTILINE)
TYPED_IN = re.compile(r"^>>> .*(?:\n\S.*)*", re.MULTILINE)


def spelled_out(text: str) -> str:
    """Write a docstring of this project as the parser and Markdown have it.

    Parameters and errors lose the colon, names that share their words get a copy each, examples in
    running text become code, and formulas MathML.
    """
    text = FORMULA.sub(lambda match: match[1] + mathml(match[2], "block"), text)
    # In a span, as Markdown takes a line that begins with a formula for a block.
    text = INLINE_FORMULA.sub(lambda match: f"<span>{mathml(match[1], 'inline')}</span>", text)
    begins = [match.start() for match in SECTION.finditer(text)]
    pieces = [text[a:b] for a, b in zip([0, *begins], [*begins, len(text)], strict=True)]
    opening, *others = pieces
    named = ("Parameters", "Raises")
    return TYPED_IN.sub(r"```pycon\n\g<0>\n```", opening) + "".join(
        NAMED.sub(_each_name, piece) if piece.startswith(named) else piece for piece in others
    )


def mathml(formula: str, display: str) -> str:
    """Write a formula in LaTeX as MathML on one line; ``display`` is block or inline."""
    latex = " ".join(formula.split())
    if "&" in latex:
        latex = rf"\begin{{align}} {latex} \end{{align}}"
    return convert(latex, display=display)


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
