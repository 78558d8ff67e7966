"""The page of results has of the blind check what ``blind score`` prints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.blocks import Block, filled, outdated, spans
from benchmarks.field_table import FIELD, headline_of
from dogshape.pipeline.cli.tables.blind_tables import score_table
from dogshape.validation.blind.score import field_mark, scored_field
from tests.unit.test_blind_score import CASES, FREE, RESULTS

PAGE = "docs/results.md"
BLOCK = replace(FIELD, build=lambda: "| 82 % |\n")


def test_what_a_score_prints_today_can_be_read(tmp_path: Path) -> None:
    """So that other words or columns of the table cannot pass unseen."""
    key = {"references": {"planar_half": {"times_s": FREE}}}
    marks = [field_mark(n, CASES[n], key, RESULTS[n]) for n in CASES]
    found = scored_field(marks, {}, {}) | {"code": {"changed": [], "figures_as_sealed": True}}
    path = tmp_path / "score.txt"
    with path.open("w", encoding="utf-8") as file:
        file.write("$ dogshape blind score DIR\n\n")
        Console(file=file, width=200).print(score_table(found))
    read = {words: rest for words, *rest in headline_of(path)}
    assert list(read) == [one["words"] for one in found["headline"]]
    assert read["no effect: one is named"] == ["1.00 (0.21 to 1.00)", "1", "at most 2 %", "no"]


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
