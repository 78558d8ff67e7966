"""List the published figures of docs/results.md on the stand."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import gap
from benchmarks.published.sources import (
    MS,
    PERCENT,
    explained_at_rest,
    included,
    size,
    times_ordinary_drag,
    unknown,
)

PAGE = "docs/results.md"


def _gaps(bench: str, *names: str) -> list[float]:
    return [MS * gap(bench)["gap"][f"{name}_rmse_s"] for name in names]


def _reading(key: str, value: str) -> float:
    found = (one for one in gap("stand")["readings"] if (one["key"], one["value"]) == (key, value))
    return PERCENT * float(next(found)["probability"])


def _linkage() -> list[float]:
    """Give the compliance of the linkage at the sleeve by the static readings, mm/kN."""
    found = next(f for f in gap("stand")["facts"] if f["parameter"] == "compliance_mm_kN")
    return [found["low"], found["high"]]


def _sizes(effect: str, *names: str) -> list[float]:
    return [end for name in names for end in size(effect, name)[1:]]


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "root mean square | {:.0f} ms; chance alone leaves {:.0f} ms |",
        lambda: _gaps("stand", "baseline", "floor"),
    ),
    Entry(
        PAGE,
        "| {:.0f} to {:.0f} ms over all plausible hypotheses, part of the cause with {:.0f} % |",
        lambda: [*size("actuation_delay", "delay_s", MS)[1:], *included("actuation_delay")],
    ),
    Entry(
        PAGE,
        "| {:.1f} N m ({:.1f} to {:.1f}), part of the cause with {:.0f} % |",
        lambda: [*size("drag_torque", "drag_Nm"), *included("drag_torque")],
    ),
    Entry(
        PAGE,
        "linkage with its mass {:.0f} %, mass {:.0f} %, dry friction {:.0f} %, oil damping "
        "{:.0f} %; *unknown* {:.0f} %",
        lambda: [
            *included("linkage_compliance", "moving_mass", "sleeve_friction", "viscous_damping"),
            unknown(),
        ],
    ),
    Entry(
        PAGE,
        "held-out points | {:.0f} ms, of the best rival {:.0f} ms |",
        lambda: _gaps("stand", "heldout", "rival_heldout"),
    ),
    Entry(
        PAGE,
        "sense of the table | {:.0f} % and {:.0f} % |",
        lambda: [_reading("time_zero", "command"), _reading("sense", "as_noted")],
    ),
    Entry(
        PAGE,
        "as read at rest, {:.1f} to {:.1f} mm/kN at the sleeve, explains {:.0f} of {:.0f} ms.",
        lambda: [*_linkage(), explained_at_rest(), *_gaps("stand", "baseline")],
    ),
    Entry(PAGE, "at most, {:.0f} times less", lambda: [times_ordinary_drag()]),
    Entry(
        PAGE,
        "settle it with {:.0f} % foreseen, in {:.1f} h",
        lambda: [
            PERCENT * gap("stand")["next_test"]["chance_to_settle"],
            gap("stand")["next_test"]["hours"],
        ],
    ),
    *(
        Entry(PAGE, words, lambda source=source: _sizes(*source))
        for words, source in (
            (
                "| elastic linkage with its mass | {:.1f} to {:.1f} mm/kN at the sleeve, "
                "{:.1f} to {:.1f} kg |",
                ("linkage_compliance", "compliance_mm_kN", "mass_behind_kg"),
            ),
            ("| mass | {:.0f} to {:.0f} kg at the sleeve |", ("moving_mass", "added_mass_kg")),
            ("| dry friction | {:.0f} to {:.0f} N |", ("sleeve_friction", "friction_N")),
            ("| oil damping | {:.0f} to {:.0f} N s/m |", ("viscous_damping", "damping_Ns_m")),
        )
    ),
    Entry(
        PAGE,
        "finds a gap of {:.1f} ms, where chance alone leaves {:.0f} ms.",
        lambda: _gaps("adams", "baseline", "floor"),
    ),
]
