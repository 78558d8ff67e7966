"""The page of a surrogate: one HTML file that opens without a network."""

from __future__ import annotations

from pathlib import Path

from dogshape.pipeline.reports.kit import html
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import label, value
from dogshape.pipeline.reports.surrogate.figures import (
    effects_figure,
    indices_html,
    slice_series,
    slices_figure,
)
from dogshape.surrogate.validation_figures import validation_of


def write_page(record: Row, path: Path) -> None:
    """Write the page of an exploration."""
    slices = record["slices"]
    choices = [
        [{"series": slice_series(base, one), "said": _said(base, one)} for one in base["operating"]]
        for base in slices
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    html.write_page(
        path,
        "explore.html.j2",
        record=record,
        effects=html.figure_html(effects_figure(record["effects"]), "effects"),
        indices=indices_html(record["indices"]),
        slices=html.figure_html(slices_figure(slices[0]), "slices"),
        choices=html.as_script_json(choices),
        useful=validation_of(record["validation"]).useful,
        own_s=slices[0]["operating"][0]["expected_shift_time_s"],
        label=label,
        value=value,
    )


def _said(base: Row, choice: Row) -> list[str]:
    """Describe a base in lines: its shape, its time, and cautions."""
    shape = ", ".join(f"{label(name)} {value(name, v)}" for name, v in base["design"].items())
    lines = [f"{shape}."]
    if choice["reason"]:
        lines.append(f"No shift time: {choice['reason']}.")
    else:
        keys = ("expected_shift_time_s", "low_s", "high_s")
        time, low, high = (1e3 * choice[key] for key in keys)
        lines.append(
            f"Expected shift time {time:.1f} ms, 95 % interval {low:.1f} to {high:.1f} ms."
        )
        errors = (1.96e3 * choice[key] for key in ("without_retries_error_s", "retries_error_s"))
        bare, retries = (f"\N{PLUS-MINUS SIGN}{half:.1f} ms" for half in errors)
        lines.append(f"Half width without retries {bare}, of retries {retries}.")
    lines += [
        f"{label(name)[0].upper()}{label(name)[1:]} is varied at "
        f"{' and '.join(value(key, number) for key, number in curve['fixed'].items())}."
        for name, curve in choice["curves"].items()
        if "fixed" in curve
    ]
    if base["failed"]:
        lines.append(f"It fails {', '.join(base['failed']).replace('_', ' ')}.")
    return lines + [f"Caution: {warning}." for warning in base["warnings"]]
