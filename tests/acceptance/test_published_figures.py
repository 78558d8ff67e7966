"""README.md and docs/*.md publish what kept results and docs/evidence say, and nothing else."""

from __future__ import annotations

import re

import pytest

from benchmarks.entries import ROOT, Entry, differences, rewritten, sections, unvouched
from benchmarks.figures import checked, documents
from benchmarks.sections import OTHERS, RESULTS

ENTRY = Entry("README.md", "took {:.1f} ± {:.1f} ms, {:,d} shifts", lambda: [63.55, -0.04, 20000])
TRUE = "## Found\n\nIt took 63.5 ± 0.0 ms,\n20 000 shifts.\n"


def test_every_figure_is_the_one_of_its_source() -> None:
    found = checked()
    assert not found, "run `make figures`, or mend the sentence:\n" + "\n".join(map(str, found))


@pytest.mark.parametrize("file", documents())
def test_every_section_is_one_of_results_or_has_a_reason(file: str) -> None:
    """So that a section that is new, or has another name, cannot pass unseen."""
    text = (ROOT / file).read_text(encoding="utf-8")
    held, others = RESULTS.get(file, {}), OTHERS.get(file, {})
    assert not set(held) & set(others)
    assert sorted(name for name, _, _ in sections(text)) == sorted([*held, *others])


@pytest.mark.parametrize("file", sorted(RESULTS))
def test_every_reason_is_of_something(file: str) -> None:
    """A pattern that matches nothing any more would let the next figure pass."""
    text = (ROOT / file).read_text(encoding="utf-8")
    for name, begin, end in sections(text):
        for pattern, _ in RESULTS[file].get(name, ()):
            assert re.compile(pattern).search(text, begin, end), f"{file}, {name}: {pattern}"


def test_a_wrong_figure_is_found_with_its_line_and_written() -> None:
    wrong = TRUE.replace("20 000", "19 999")
    assert not differences(TRUE, [ENTRY])
    (finding,) = differences(wrong, [ENTRY])
    assert finding.line == 4
    assert "'19 999'" in str(finding)
    assert "'20 000'" in str(finding)
    assert rewritten(wrong, [ENTRY]) == TRUE


@pytest.mark.parametrize(
    ("text", "words"), [("", "is not there"), (TRUE + TRUE, "is there 2 times")]
)
def test_a_piece_that_is_not_there_once_is_found(text: str, words: str) -> None:
    (finding,) = differences(text, [ENTRY])
    assert words in str(finding)
    assert rewritten(text, [ENTRY]) == text


def test_a_figure_that_nobody_vouches_for_is_found() -> None:
    text = TRUE + "A gain of 33 % and Q² of 0.981 at 249 1/min, with 3 of them\n"
    found = unvouched("README.md", text, [ENTRY], {"Found": ()})
    assert [f.published.split("'")[1] for f in found] == ["33", "0.981"]
    assert not unvouched("README.md", text, [ENTRY], {"Found": ((r"33 %|0\.981", "aims"),)})
    assert not unvouched("README.md", text, [ENTRY], {})


def test_a_source_with_other_numbers_than_formats_is_refused() -> None:
    with pytest.raises(ValueError, match="has 1 formats, its source 2"):
        Entry("README.md", "{:.1f} ms", lambda: [1.0, 2.0]).figures()
