"""Write the table of the settings of the diagnosis, with unit, status and source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from dogshape.diagnosis.settings import USUAL

HEAD = "| setting | value | unit | meaning | source | status |\n|---|---|---|---|---|---|\n"


def format_value(value: Any) -> str:
    """Write a value as a table shows it."""
    if isinstance(value, Mapping):
        return "; ".join(f"{key}: {format_value(inner)}" for key, inner in value.items())
    if isinstance(value, tuple | list):
        return ", ".join(map(format_value, value))
    return f"`{value}`" if isinstance(value, str) else f"{value:g}"


def table() -> str:
    """Write the table of all settings."""
    rows = []
    for setting in fields(USUAL):
        value = format_value(getattr(USUAL, setting.name))
        facts = setting.metadata
        rows.append(
            f"| `{setting.name}` | {value} | {facts['unit']} | {facts['meaning']} | "
            f"{facts['source'] or '-'} | {facts['status']} |\n"
        )
    return HEAD + "".join(rows)
