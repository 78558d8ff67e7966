"""Errors of the Python interface name arguments and calls: no option, no command."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

import dogshape as ds
from dogshape.python_words import WORDS
from tests.unit.test_house import MODULES, ROOT

#: Errors that only the command line raises.
OWN = (*(ROOT / "dogshape" / "cli").rglob("*.py"), *(ROOT / "validation").rglob("*.py"))


def _raised() -> Iterator[tuple[str, str]]:
    """Yield the sentences that modules raise, X for what is put into them."""
    for path in sorted({*MODULES} - {*OWN}):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            texts = [*ast.walk(node.exc)] if isinstance(node, ast.Raise) and node.exc else []
            parts = {p for text in texts if isinstance(text, ast.JoinedStr) for p in text.values}
            for text in texts:
                if isinstance(text, ast.JoinedStr):
                    words = [p.value if isinstance(p, ast.Constant) else "X" for p in text.values]
                    yield path.name, "".join(map(str, words))
                elif isinstance(text, ast.Constant) and text not in parts:
                    yield path.name, str(text.value)


def test_no_sentence_names_an_option_or_a_command() -> None:
    left = []
    for name, sentence in _raised():
        said = sentence
        for pattern, words in WORDS:
            said = re.sub(pattern, words, said)
        if re.search(r"(?<!TABLE )--\w|\bdogshape (?!has|init)[a-z]+\b", said):
            left.append((name, said))
    assert left == []


def test_no_angle_and_a_missing_diagnosis_are_refused_in_python() -> None:
    with pytest.raises(ds.InputError, match="angles is 0, but it must lie between 1 and"):
        ds.Study("mq200").expect(angles=0)
    with pytest.raises(ds.DogshapeError, match=r'ds.diagnose\(BENCH, out="nowhere"\)'):
        ds.update_diagnosis("nowhere", "new.csv")
