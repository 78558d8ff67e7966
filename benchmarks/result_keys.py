"""Write the keys of ``result.json`` into docs/studies.md, from the descriptions of its schema."""

from __future__ import annotations

from pathlib import Path

from dogshape.pipeline.store.result_schema import key_table

PAGE = Path(__file__).parents[1] / "docs" / "studies.md"
BEGIN, END = "<!-- keys: written by benchmarks/result_keys.py -->\n", "<!-- end of keys -->\n"


def with_keys(page: str) -> str:
    """Replace the keys of the page by those of the schema."""
    head, _, rest = page.partition(BEGIN)
    return head + BEGIN + key_table() + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(with_keys(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
