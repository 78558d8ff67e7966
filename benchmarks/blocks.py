"""Passages of documents that are written from their source as a whole, words and figures.

A passage stands between two lines, ``<!-- blind field: by make figures -->`` and
``<!-- end of blind field -->``, which readers do not see.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.entries import Finding


@dataclass(frozen=True)
class Block:
    """Hold a passage of a document and where it comes from.

    Parameters
    ----------
    file : path of the document below the root of the project.
    name : of the lines around it.
    build : gives the passage; None where the source has none yet, and what stands there stays.
    """

    file: str
    name: str
    build: Callable[[], str | None]

    @property
    def ends(self) -> tuple[str, str]:
        """The lines around the passage."""
        return f"<!-- {self.name}: by make figures -->\n", f"<!-- end of {self.name} -->\n"

    def span(self, text: str) -> tuple[int, int] | None:
        """Find begin and end of the passage; None where its lines are not there once."""
        first, last = self.ends
        if text.count(first) != 1 or text.count(last) != 1:
            return None
        begin, end = text.index(first) + len(first), text.index(last)
        return (begin, end) if begin <= end else None


def outdated(text: str, blocks: Sequence[Block]) -> list[Finding]:
    """List the passages of a document that are not as their source has them."""
    found = []
    for block in blocks:
        passage, span = block.build(), block.span(text)
        if passage is None:
            continue
        if span is None:
            words = " and ".join(repr(line.strip()) for line in block.ends)
            found.append(Finding(block.file, 1, words, "these lines have to be there once"))
        elif text[slice(*span)] != passage:
            line = text.count("\n", 0, span[0]) + 1
            found.append(Finding(block.file, line, block.name, "the source gives another passage"))
    return found


def filled(text: str, blocks: Sequence[Block]) -> str:
    """Build the document with the passages of the sources in their places."""
    for block in blocks:
        passage, span = block.build(), block.span(text)
        if passage is not None and span is not None:
            text = text[: span[0]] + passage + text[span[1] :]
    return text


def spans(text: str, blocks: Sequence[Block]) -> list[tuple[int, int]]:
    """List begin and end of all passages that come from a source."""
    places = [block.span(text) for block in blocks if block.build() is not None]
    return [place for place in places if place is not None]
