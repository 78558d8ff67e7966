"""The page of results says of the blind check what ``blind score`` prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from benchmarks.blind_table import BLOCKS, Figure, has_both, passage, score_of
from benchmarks.blocks import Block, filled, outdated, spans
from benchmarks.entries import ROOT, differences, unvouched
from benchmarks.published import ENTRIES
from benchmarks.sections import RESULTS
from dogshape.pipeline.cli.tables.blind_tables import score_table
from dogshape.validation.blind.case_marks import mark_of
from dogshape.validation.blind.score import scored
from tests.unit.test_blind_score import CASES, FREE, PAIR_SIZES
from tests.unit.test_blind_score import RESULTS as FOUND

#: What ``dogshape blind score`` prints of a small set.
SMALL = Path(__file__).parents[1] / "data" / "blind" / "score.txt"
PAGE = "docs/results.md"
BLOCK = replace(BLOCKS[0], build=lambda: passage(SMALL))


def test_a_new_score_needs_the_lines_and_nothing_else() -> None:
    """The page with a score of both ways: every figure has its source."""
    text = filled((ROOT / PAGE).read_text(encoding="utf-8"), [BLOCK])
    entries = [e for e in ENTRIES if e.file == PAGE]
    assert not outdated(text, [BLOCK])
    assert not differences(text, entries)
    written = spans(text, [BLOCK, *(one for one in BLOCKS[1:] if one.file == PAGE)])
    assert not unvouched(PAGE, text, entries, RESULTS[PAGE], written)
    assert filled(text, [BLOCK]) == text


def test_rows_have_both_ways_the_headline_first() -> None:
    text = passage(SMALL)
    assert text is not None
    assert "5 sealed cases: each effect" in text
    rows = dict(line.split(" | ", 1) for line in text.splitlines() if line.startswith("| "))
    named = "| where causes are named: they are the truth, no more and no less"
    assert rows[named] == "- | 100 % (21 to 100), n 1 | 98 % |"
    assert (
        rows["| hypotheses in that set"]
        == "4.60 (2.60 to 6.80), n 5 | 5.60 (3.40 to 7.80), n 5 | |"
    )
    kind = rows["| sticking valve: unknown or refused; an effect named"]
    assert kind == "1 of 1; 0 of 1 | 1 of 1; 0 of 1 | |"
    settled = rows["| the advised test settles an ambiguous case; wrongly"]
    assert settled == "33 % (6 to 79), n 3; 0 % (0 to 56), n 3 | | 80 % |"
    assert all(len(line) <= 105 for line in text.splitlines() if not line.startswith("|"))


def test_what_a_score_prints_today_can_be_read(tmp_path: Path) -> None:
    """So that other words or columns of the table cannot pass unseen."""
    marks = [mark_of(n, CASES[n], {"reference_s": FREE}, FOUND[n]) for n in CASES]
    found: Mapping[str, Any] = scored(marks, None, {"case_03": PAIR_SIZES})
    path = tmp_path / "score.txt"
    with path.open("w", encoding="utf-8") as file:
        file.write("$ dogshape blind score DIR\n\n")
        Console(file=file, width=200).print(score_table({**found, "told": scored(marks)}))
    read = score_of(path)
    named = found["all"]["precision_when_named"]
    assert named["n"] == 2
    assert read["all cases: named exactly, of what is named"][0] == Figure(
        (round(named["value"], 2), round(named["low"], 2), round(named["high"], 2)), 2
    )
    refit = "pairs, second effect visible after refit of the first: both found"
    assert [one.n for one in read[refit]] == [1, 0]
    assert [one.n for one in read["all cases: right"]] == [5, 5]
    text = passage(path)
    assert text is not None
    assert "| drift: unknown or refused; an effect named | 1 of 1; 0 of 1 |" in text


def test_a_score_with_one_way_leaves_what_stands_there(tmp_path: Path) -> None:
    old = tmp_path / "blind.txt"
    old.write_text("cases            right\nall 130 cases    0.48 (0.40 to 0.57)\n")
    assert not has_both(old)
    block = Block(PAGE, "blind score", lambda: passage(old))
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
    assert filled(wrong, [BLOCK]) == f"# Title\n\n{first}{passage(SMALL)}{last}"


def test_a_figure_in_another_form_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "score.txt"
    path.write_text("figure  not told (a user's)  n  told  n\nall cases: right  0.5  3  0.5  3\n")
    with pytest.raises(ValueError, match=r"'0\.5' is no figure"):
        score_of(path)
