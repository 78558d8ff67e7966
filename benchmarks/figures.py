"""Hold the figures that README.md and docs/*.md publish against what they come from.

    python -m benchmarks.figures --check    list figures that differ from their source, or have none
    python -m benchmarks.figures            put what the sources give in their place

``benchmarks.published`` has the table of figures: kept results, docs/evidence or a quick
computation. Some passages are written as a whole (``benchmarks.blocks``). ``benchmarks.sections``
says which sections hold results: every number in them that has a unit or a decimal point needs an
entry, or a pattern with a reason.
"""

from __future__ import annotations

import sys

from benchmarks.blocks import filled, outdated, spans
from benchmarks.entries import ROOT, Finding, differences, rewritten, unvouched
from benchmarks.field_table import FIELD
from benchmarks.published import ENTRIES
from benchmarks.sections import RESULTS

BLOCKS = (FIELD,)


def documents() -> list[str]:
    """List README.md and the notes of docs, as paths below the root."""
    return ["README.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))]


def checked() -> list[Finding]:
    """List all that is wrong with the figures of all documents."""
    found = []
    for file in documents():
        text = (ROOT / file).read_text(encoding="utf-8")
        entries = [entry for entry in ENTRIES if entry.file == file]
        blocks = [block for block in BLOCKS if block.file == file]
        found += outdated(text, blocks) + differences(text, entries)
        found += unvouched(file, text, entries, RESULTS.get(file, {}), spans(text, blocks))
    return found


def main() -> int:
    """Write the figures unless ``--check`` is given; list what is wrong, with status 1."""
    if "--check" not in sys.argv[1:]:
        for file in documents():
            path = ROOT / file
            old = path.read_text(encoding="utf-8")
            new = filled(old, [block for block in BLOCKS if block.file == file])
            new = rewritten(new, [entry for entry in ENTRIES if entry.file == file])
            if new != old:
                path.write_text(new, encoding="utf-8")
                print(f"{file} written")
    found = checked()
    print("\n".join(map(str, found)) or f"{len(ENTRIES)} pieces agree with their sources")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
