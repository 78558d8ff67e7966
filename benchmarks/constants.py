"""Write the settings of the diagnosis, with unit, status and source, into docs/inference.md.

python -m benchmarks.constants
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dogshape.diagnosis.settings import USUAL, described

PAGE = Path(__file__).parents[1] / "docs" / "inference.md"
BEGIN, END = (
    "<!-- constants: written by benchmarks/constants.py -->\n",
    "<!-- end of constants -->\n",
)
HEAD = "| setting | value | unit | meaning | source | status |\n|---|---|---|---|---|---|\n"


def written(value: Any) -> str:
    """Write a value as a table shows it."""
    if isinstance(value, Mapping):
        return "; ".join(f"{key}: {written(one)}" for key, one in value.items())
    if isinstance(value, tuple | list):
        return ", ".join(map(written, value))
    return f"`{value}`" if isinstance(value, str) else f"{value:g}"


def table() -> str:
    """Write the table of all settings."""
    rows = [
        f"| `{name}` | {written(value)} | {facts['unit']} | {facts['meaning']} | "
        f"{facts['source'] or '-'} | {facts['status']} |\n"
        for name, value, facts in described(USUAL)
    ]
    return HEAD + "".join(rows)


def with_constants(page: str) -> str:
    """Put the table into the text of the page."""
    before, after = page.split(BEGIN, maxsplit=1)[0], page.split(END)[1]
    return f"{before}{BEGIN}{table()}{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(with_constants(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
