"""Page of a comparison: the table, its notes, and each operating point."""

from __future__ import annotations

from pathlib import Path

from dogshape.pipeline.reports.comparison.rows import notes_of, point_rows, rows_of
from dogshape.pipeline.reports.kit.html import write_page
from dogshape.pipeline.reports.kit.look import Row


def write_comparison(record: Row, path: Path) -> None:
    """Write the page of a comparison, one file that opens offline and prints."""
    differences = record["differences"] if record["kind"] == "designs" else []
    points = [
        (f"{one['of']} less {one['to']}", point_rows(one)) for one in differences if one["points"]
    ]
    write_page(
        path, "compare.html.j2", plotly="", labels=[item["label"] for item in record["items"]],
        rows=rows_of(record), notes=notes_of(record), points=points, designs=bool(differences),
    )  # fmt: skip
