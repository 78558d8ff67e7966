"""Compare pieces of documents with what their numbers come from.

An entry is a piece of a document with a format for each number, ``"prototype {:.1f} ± {:.1f} ms"``,
and a function that gives the numbers. Spaces in it match any line break, so a document stays
readable as source.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Formatter

from benchmarks.sections import EVERYWHERE

ROOT = Path(__file__).resolve().parents[1]

#: A number as documents write it: a proper minus, spaces between thousands.
NUMBER = r"[\u2212+-]?\d+(?:[ \u00a0]\d{3}(?!\d))*(?:\.\d+)?"
UNITS = (
    r"%|ms|min|s|h|µs|µm|mm/kN|mm/s|mm|m/s|kN|N m s|N m|N s/m|N/mm|N|1/min|MPa|kg|°|degrees|"
    r"minutes|seconds|shifts|designs|cells|cases|angles|in\s\d+"
)
#: What must have a source: a number with one of these units after it, or with a decimal point.
FIGURE = re.compile(rf"(?<![\w.\-/`=])({NUMBER})(?=\s?(?:{UNITS})(?![\w/]))")
DECIMAL = re.compile(r"(?<![\w.\-/`=])[\u2212+-]?\d+\.\d+(?![\w.])")


@dataclass(frozen=True)
class Entry:
    """Hold one piece of a document and where its numbers come from.

    Parameters
    ----------
    file : path of the document below the root of the project.
    text : the piece, with a format such as ``{:.1f}`` or ``{:,.0f}`` for each number.
    values : gives the numbers, in the order of the formats.
    """

    file: str
    text: str
    values: Callable[[], Sequence[float]]

    def pattern(self) -> re.Pattern[str]:
        """Build the expression that finds the piece, whatever its numbers and line breaks."""
        parts = []
        for literal, name, _, _ in Formatter().parse(self.text):
            escaped = r"\s+".join(re.escape(word) for word in re.split(r"\s+", literal))
            parts.append(escaped + (f"({NUMBER})" if name is not None else ""))
        return re.compile("".join(parts))

    def figures(self) -> list[str]:
        """Write the numbers of the source as the document would.

        Raises
        ------
        ValueError : the source gives more or fewer numbers than the piece has formats.
        """
        formats = [
            spec or "" for _, name, spec, _ in Formatter().parse(self.text) if name is not None
        ]
        values = list(self.values())
        if len(formats) != len(values):
            raise ValueError(f"{self.text!r} has {len(formats)} formats, its source {len(values)}")
        return [_written(value, spec) for value, spec in zip(values, formats, strict=True)]


@dataclass(frozen=True)
class Finding:
    """Say what is wrong with a figure, and where."""

    file: str
    line: int
    published: str
    source: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: published {self.published}; {self.source}"


def _written(value: float, spec: str) -> str:
    text = format(value, spec)
    if float(text.replace(",", "")) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", "\u2212").replace(",", " ")


def _line(text: str, place: int) -> int:
    return text.count("\n", 0, place) + 1


def differences(text: str, entries: Sequence[Entry]) -> list[Finding]:
    """List the figures of one document that differ from their source.

    An entry whose piece is not there, or is there more than once, is a finding too.
    """
    found = []
    for entry in entries:
        matches = list(entry.pattern().finditer(text))
        if len(matches) != 1:
            times = "is not there" if not matches else f"is there {len(matches)} times"
            line = _line(text, matches[0].start()) if matches else 1
            found.append(Finding(entry.file, line, repr(entry.text), f"this piece {times}"))
            continue
        for k, figure in enumerate(entry.figures(), 1):
            if matches[0][k] != figure:
                line = _line(text, matches[0].start(k))
                words = f"{matches[0][k]!r} in {entry.text!r}"
                found.append(Finding(entry.file, line, words, f"the source gives {figure!r}"))
    return found


def rewritten(text: str, entries: Sequence[Entry]) -> str:
    """Build the document with the figures of the sources in their places.

    Pieces that are not there, or more than once, are left alone.
    """
    for entry in entries:
        matches = list(entry.pattern().finditer(text))
        if len(matches) == 1:
            for k, figure in reversed(list(enumerate(entry.figures(), 1))):
                begin, end = matches[0].span(k)
                text = text[:begin] + figure + text[end:]
    return text


def sections(text: str) -> Iterator[tuple[str, int, int]]:
    """Give heading, begin and end of each part below a second-level heading, and of the opening."""
    heads = [("", 0), *((m[1], m.start()) for m in re.finditer(r"^## (.+)$", text, re.MULTILINE))]
    ends = [begin for _, begin in heads[1:]] + [len(text)]
    for (name, begin), end in zip(heads, ends, strict=True):
        yield name, begin, end


def unvouched(
    file: str,
    text: str,
    entries: Sequence[Entry],
    results: Mapping[str, Sequence[tuple[str, str]]],
    written: Sequence[tuple[int, int]] = (),
) -> list[Finding]:
    """List the figures in the sections of results that have neither an entry nor a reason.

    Parameters
    ----------
    results : patterns with a reason each, by heading; other sections are not looked at.
    written : begin and end of what is written from a source as a whole (``benchmarks.blocks``).
    """
    covered = [
        m.span(k + 1)
        for e in entries
        for m in e.pattern().finditer(text)
        for k in range(m.re.groups)
    ]
    found = []
    for name, begin, end in sections(text):
        if name not in results:
            continue
        allowed = [
            m.span()
            for pattern, _ in (*EVERYWHERE, *results[name])
            for m in re.compile(pattern).finditer(text, begin, end)
        ]
        places = {m.span() for form in (FIGURE, DECIMAL) for m in form.finditer(text, begin, end)}
        for place, stop in sorted(places):
            if not any(a < stop and place < b for a, b in (*covered, *allowed, *written)):
                words = " ".join(text[max(place - 30, begin) : stop + 15].split())
                found.append(
                    Finding(
                        file,
                        _line(text, place),
                        f"'{text[place:stop]}' in '… {words} …'",
                        "no entry of benchmarks.published and no reason has it",
                    )
                )
    return found
