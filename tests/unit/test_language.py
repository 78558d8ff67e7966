"""The language of docstrings: a verb and a concrete noun first, and the field's words."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("sim", "surrogate", "diagnosis", "pipeline", "dogshape", "validation")
#: First words that name no thing: what a value is has a noun.
EMPTY = re.compile(
    r"(Return (what|which|whether|how|when|where|by how|that|those|it)\b|Tell |What |Say )"
)
#: Words with a better one in the glossary: predict, posterior, outlier, new, zero.
WORN = re.compile(
    r"\b(fore(tell|told|tells)|beliefs?|lateness|afresh|fresh|nought)\b", re.IGNORECASE
)


def _docstrings(room: str) -> Iterator[tuple[str, str]]:
    for path in sorted((ROOT / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                text = ast.get_docstring(node)
                if text:
                    name = getattr(node, "name", "")
                    yield f"{path.relative_to(ROOT)} {name}", text


@pytest.mark.parametrize("room", ROOMS)
def test_first_lines_name_a_thing(room: str) -> None:
    assert [(place, text) for place, text in _docstrings(room) if EMPTY.match(text)] == []


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_use_the_words_of_the_glossary(room: str) -> None:
    # ``foretold`` is a key of records that are kept.
    quoted = re.compile(r"``[^`]*``")
    found = [
        (place, match.group())
        for place, text in _docstrings(room)
        for match in WORN.finditer(quoted.sub("", text))
    ]
    assert found == []
