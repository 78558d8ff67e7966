"""Drafts of studies and benches: what was written, what was assumed, and how to go on."""

from __future__ import annotations

from typing import Any

from rich.console import Group, RenderableType

from dogshape.pipeline.cli.console import columns


def study_text(found: dict[str, Any]) -> RenderableType:
    """List the file that was written, its values, and the next commands."""
    folder = found["folder"]
    return Group(
        f"wrote {found['file']} from {found['from']}: {found['dogs']} dogs, "
        f"{found['operating_points']} operating points",
        *(
            f"set {key} = {value}" if value is not None else f"left out {key}"
            for key, value in found["set"].items()
        ),
        *(f"assumed: {line}" for line in found["assumed"]),
        *(f"warning: {line}" for line in found["warnings"]),
        f"next: look through {found['file']}, then",
        f"  dogshape strength {folder} --no-simulation",
        f"  dogshape study {folder}",
    )


def bench_text(found: dict[str, Any]) -> RenderableType:
    """Tabulate the columns that were taken, what was assumed, and the next commands."""
    table = columns("quantity", "column", "unit")
    for row in found["columns"]:
        table.add_row(row["quantity"], row["column"], row["unit"] or "-")
    folder = found["folder"]
    shown: list[RenderableType] = [table, ""] if found["columns"] else []
    return Group(
        *shown,
        f"wrote {folder}: {found['rows']} rows, {found['shifts']} shifts, {found['with_time']} of "
        "them with a time",
        *(f"assumed: {line}" for line in found["assumed"]),
        *(f"warning: {line}" for line in found["warnings"]),
        "next:" if found["with_time"] else "next: fill in shifts.csv, then",
        f"  dogshape validate {folder}",
        f"  dogshape gap {folder} --out {folder}/gap",
    )
