"""The page of a surrogate: one HTML file that opens without a network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dogshape.pipeline.reports.kit.html import figure_html, render
from dogshape.pipeline.reports.surrogate.figures import (
    effects_figure,
    indices_figure,
    slice_series,
    slices_figure,
)
from dogshape.pipeline.reports.surrogate.variable_labels import label, value
from dogshape.sim.files import naming
from dogshape.surrogate.validation_figures import validation_of

Row = dict[str, Any]


def write_page(record: Row, path: Path) -> None:
    """Write the page of what was explored."""
    effects, slices = record["effects"], record["slices"]
    page = render(
        "explore.html.j2",
        record=record,
        effects=figure_html(effects_figure(effects), "effects"),
        indices=[
            (found, figure_html(indices_figure(found), f"indices-{place}"))
            for place, found in enumerate(record["indices"])
        ],
        slices=figure_html(slices_figure(slices[0]), "slices"),
        choices=_choices(slices),
        useful=validation_of(record["validation"]).useful,
        label=label,
        value=value,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    with naming(path):
        path.write_text(page, encoding="utf-8")


def _choices(slices: list[Row]) -> str:
    """Return the series and words of every base and choice of operating points, as JSON."""
    every = [
        [{"series": slice_series(base, one), "said": _said(base, one)} for one in base["operating"]]
        for base in slices
    ]
    # Words of a study file stand in it: none of them may end the script.
    return json.dumps(every, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _said(base: Row, choice: Row) -> list[str]:
    """Return lines on a base: its shape, its time, and what speaks against either."""
    shape = ", ".join(f"{label(name)} {value(name, v)}" for name, v in base["design"].items())
    time, low, high = (1e3 * choice[key] for key in ("expected_shift_time_s", "low_s", "high_s"))
    lines = [
        f"{shape}.",
        f"Expected shift time {time:.1f} ms, 95 % interval {low:.1f} to {high:.1f} ms.",
    ]
    lines += [
        f"{label(name)[0].upper()}{label(name)[1:]} is varied at "
        f"{' and '.join(value(key, number) for key, number in curve['fixed'].items())}."
        for name, curve in choice["curves"].items()
        if "fixed" in curve
    ]
    if base["failed"]:
        lines.append(f"It fails {', '.join(base['failed']).replace('_', ' ')}.")
    return lines + [f"Caution: {warning}." for warning in base["warnings"]]
