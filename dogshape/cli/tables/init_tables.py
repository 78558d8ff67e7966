"""Drafts of studies and benches: what was written, what was assumed, and how to go on."""

from __future__ import annotations

from typing import Any

from rich.console import Group, RenderableType

from dogshape.cli.console import columns
from dogshape.sim.units import unit_of


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


def reading_text(found: dict[str, Any]) -> RenderableType:
    """Tabulate how columns were read, and list the rows and columns that were left out."""
    table = columns(
        "quantity", "column", "unit in file", "decimals", "first", "least", "largest", "why"
    )
    for row in found["columns"]:
        unit = unit_of(row["quantity"])  # of the values, whatever that of the file
        values = (row[name] for name in ("first", "least", "largest"))
        texts = (
            f"{v:.6g} {unit}".rstrip() if isinstance(v, float) else "-" if v is None else str(v)
            for v in values
        )
        table.add_row(row["quantity"], row["column"], row["unit"] or "-", row["decimals"] or "-",
                      *texts, row["why"])  # fmt: skip
    reasons: dict[str, list[str]] = {}
    for one in found["left_out"]:
        what = f"row {one['row']}" if "row" in one else f"column '{one['column']}'"
        reasons.setdefault(one["reason"], []).append(what)
    left = [f"left out: {', '.join(those)}: {why}" for why, those in reasons.items()]
    shown: list[RenderableType] = [table, ""] if found["columns"] else []
    return Group(*shown, *left)


def bench_text(found: dict[str, Any]) -> RenderableType:
    """Tabulate the columns that were read, all assumptions, and the next commands."""
    folder = found["folder"]
    return Group(
        reading_text(found),
        f"wrote {folder}: {found['rows']} rows, {found['shifts']} shifts, {found['with_time']} of "
        "them with a time",
        *(f"assumed: {line}" for line in found["assumed"]),
        *(f"warning: {line}" for line in found["warnings"]),
        "next:" if found["with_time"] else "next: fill in shifts.csv, then",
        f"  dogshape validate {folder}",
        f"  dogshape gap {folder} --out {folder}/gap",
    )
