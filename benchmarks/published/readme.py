"""List the published figures of README.md."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from benchmarks.entries import Entry
from benchmarks.field_table import SCORE as FIELD_SCORE
from benchmarks.field_table import headline_of
from benchmarks.kept import gap, numbers, result
from benchmarks.published.sources import (
    CLUTCHES,
    MS,
    PERCENT,
    SPAN,
    best_design,
    clutch_row,
    confirmed,
    confirmed_design,
    gain,
    gearbox,
    prototype,
    raced,
    size,
    slower,
)

PAGE = "README.md"


def _field(words: str) -> Callable[[], Sequence[float]]:
    """Give a headline share of the field set with its interval, in percent."""

    def values() -> Sequence[float]:
        (row,) = (one for one in headline_of(FIELD_SCORE) if one[0] == words)
        factor = 1.0 if "%" in row[1] else PERCENT
        return [factor * float(one) for one in re.findall(r"-?[\d.]+", row[1])]

    return values


def _said_and_so(kind: str) -> list[float]:
    """Give what the leading hypothesis has on average in a kind of case, and how often it is so."""
    # Two spaces: the row by evidence goes on with other words.
    rows = ("probability of the leading one  ", "it is the truth, but for causes")
    return [numbers("blind_field", f"{kind}: {row}")[0] for row in rows]


def _leading(kind: str) -> tuple[float, float]:
    """Give the clear cases of a kind whose cause leads, and all; none where none was drawn."""
    try:
        numbers("blind_field", f"clear, {kind}: ")
    except LookupError:
        return 0.0, 0.0
    share, *_, count = numbers("blind_field", f"clear, {kind}: cause or class right")
    return share * count, count


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "| {:.1f} ± {:.1f} ms instead of {:.1f} ± {:.1f} ms, {:.1f} mm instead of {:.1f} mm long "
        "| smallest margin {:.1f} % at worst-case tolerances |",
        lambda: [
            *gearbox(),
            *(row["axial_length_mm"] for row in (result("mq200")["best"], prototype("mq200"))),
            PERCENT * result("mq200")["best"]["margin_worst_case"],
        ],
    ),
    Entry(
        PAGE,
        "| {:.2f} ± {:.2f} ms instead of {:.2f} ± {:.2f} ms, another design, {:.1f} mm long; "
        "{:.2f} ± {:.2f} ms at {:.1f} mm | slower",
        lambda: [
            *(
                MS * confirmed("mq200_paper")[who][key]
                for who in ("best", "prototype")
                for key in ("expected_shift_time_s", "standard_error_s")
            ),
            best_design()["axial_length_mm"],
            *confirmed_design(47),
        ],
    ),
    Entry(
        PAGE,
        "would need {:.0f} N to be pulled out",
        lambda: numbers("gearbox_loads", "toothing 0.1:", "chosen", "pulled out with"),
    ),
    Entry(PAGE, "slower by {:.0f} and {:.0f} ms at two points", slower),
    Entry(
        PAGE,
        "smallest margin {:.1f} %, with worst tolerances {:.0f} %; it",
        lambda: [PERCENT * best_design()[key] for key in ("smallest_margin", "margin_worst_case")],
    ),
    Entry(
        PAGE,
        "| gain {:.1f} ± {:.1f} ms ({:.0f} %) at other angles | {:.1f} ± {:.1f} ms ({:.0f} %) with",
        lambda: [*gain("lubricated_steel"), *gain("friction 0.080")],
    ),
    Entry(
        PAGE,
        "{:.1f} ± {:.1f} ms ({:.0f} %) with friction in the ring's toothing",
        lambda: gain("toothing;"),
    ),
    Entry(
        PAGE,
        "{:.1f} ± {:.1f} ms ({:.0f} %) if faces throw back as dry steel",
        lambda: gain("dissipation 1 s/m"),
    ),
    Entry(
        PAGE,
        "above a friction of {:.3f} its flank",
        lambda: numbers("contact_sets", "friction above", "chosen"),
    ),
    Entry(
        PAGE,
        "| {:.2f} of the best hypervolume known with {:d} shifts of Drake, the best of four "
        "samplers of Optuna {:.2f} | with {:d} GPSampler, given the closed forms, has {:.2f}, "
        "ahead at one seed of five |",
        raced,
    ),
    Entry(
        PAGE,
        "| Q² {:.3f}, {:.3f} and {:.3f} on three clutches, at a single point {:.3f}, {:.3f} and "
        "{:.3f} | rank correlation in the best tenth {:.2f}, {:.2f} and {:.2f}; "
        "intervals hold {:.0f}, {:.0f} and {:.0f} % |",
        lambda: [clutch_row(clutch)[place] for place in (0, 4, 6, 3) for clutch in CLUTCHES],
    ),
    Entry(
        PAGE,
        "root-mean-square deviation {:.1f} % at the ten published angles, {:.1f} % over all angles "
        "| fast shifts that skip no slot take {:.2f} of",
        lambda: [
            *numbers("adams", "as published")[:1],
            *numbers("adams", "all angles, as published")[:1],
            *numbers("adams", "shifts of the compiled engine that skip no slot")[-2:-1],
        ],
    ),
    Entry(
        PAGE,
        "dead time of the actuation {:.0f} to {:.0f} ms and",
        lambda: size("actuation_delay", "delay_s", MS)[1:],
    ),
    Entry(PAGE, "and drag {:.1f} to {:.1f} N m;", lambda: size("drag_torque", "drag_Nm")[1:]),
    Entry(
        PAGE,
        "gap {:.0f} ms, {:.0f} ms at held-out points, {:.0f} ms by chance alone",
        lambda: [MS * gap("stand")["gap"][f"{k}_rmse_s"] for k in ("baseline", "heldout", "floor")],
    ),
    *(
        Entry(PAGE, words, _field(figure))
        for words, figure in (
            (
                f"what is named is the whole truth in {SPAN};",
                "named exactly, of all that is named, outside included",
            ),
            (
                f"an effect is named in {SPAN} of 108 cases without any;",
                "no effect: one is named",
            ),
            (
                f"a cause that rivals leave clear leads, or its class does, in {SPAN}:",
                "clear: cause or its class leads",
            ),
            (f"the 90 % set holds the truth in {SPAN};", "90 % set holds the truth"),
            (
                f"*none* is said in {SPAN} of the cases without any;",
                "no effect: none within the margin said",
            ),
            (
                f"the advised test settles {SPAN} of what is open,",
                "cause left open: the advised test settles it",
            ),
            (
                f"and {SPAN} wrongly |",
                "cause left open: it settles on what is not true",
            ),
        )
    ),
    Entry(
        PAGE,
        "leads has {:.2f} and {:.2f} on average, and is right in {:.2f} and {:.2f} of the cases |",
        lambda: [
            one
            for both in zip(_said_and_so("none"), _said_and_so("single"), strict=True)
            for one in both
        ],
    ),
    Entry(
        PAGE,
        "{:.0f} of {:.0f} single effects, {:.0f} of {:.0f} beyond their prior, {:.0f} of {:.0f} "
        "threes, {:.0f} of {:.0f} pairs (",
        lambda: [one for kind in ("single", "beyond", "three", "pair") for one in _leading(kind)],
    ),
]
