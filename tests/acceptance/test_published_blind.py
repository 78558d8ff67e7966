"""Passages of pages between two lines, as that of the blind check."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.blocks import Block, filled, outdated, spans
from benchmarks.field_table import FIELD

PAGE = "docs/results.md"
BLOCK = replace(FIELD, build=lambda: "| 82 % |\n")


def test_a_passage_without_a_source_leaves_what_stands_there() -> None:
    block = Block(PAGE, "blind field", lambda: None)
    assert filled("as it was", [block]) == "as it was"
    assert not outdated("as it was", [block])
    assert not spans("as it was", [block])


@pytest.mark.parametrize("text", ["", "{0}a\n", "{1}a\n{0}", "{0}a\n{1}{0}{1}"])
def test_lines_that_are_not_there_once_are_found(text: str) -> None:
    wrong = text.format(*BLOCK.ends)
    (finding,) = outdated(wrong, [BLOCK])
    assert "these lines have to be there once" in str(finding)
    assert filled(wrong, [BLOCK]) == wrong


def test_another_passage_is_found_and_written() -> None:
    first, last = BLOCK.ends
    wrong = f"# Title\n\n{first}48 % are right\n{last}"
    (finding,) = outdated(wrong, [BLOCK])
    assert finding.line == 4
    assert filled(wrong, [BLOCK]) == f"# Title\n\n{first}| 82 % |\n{last}"
