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
    explained_at_rest,
    gain,
    gearbox,
    included,
    prototype,
    raced,
    size,
    slower,
    times_ordinary_drag,
    unknown,
)

PAGE = "README.md"


def _row(words: str) -> tuple[str, ...]:
    """Give the row of a headline figure of the field set."""
    (row,) = (one for one in headline_of(FIELD_SCORE) if one[0] == words)
    return row


def _field(words: str) -> Callable[[], Sequence[float]]:
    """Give a headline figure of the field set with its interval, a share in percent."""
    return lambda: [float(one) for one in re.findall(r"-?[\d.]+", _row(words)[1])]


def _counted(words: str) -> Callable[[], Sequence[float]]:
    """Give a headline figure of the field set with its interval and its number of cases."""
    return lambda: [*_field(words)(), int(_row(words)[2])]


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
    Entry(
        PAGE,
        "and drag {:.1f} to {:.1f} N m are part of it with {:.0f} and {:.0f} %;",
        lambda: [
            *size("drag_torque", "drag_Nm")[1:],
            *included("actuation_delay", "drag_torque"),
        ],
    ),
    Entry(
        PAGE,
        "linkage with its mass {:.0f} %, mass {:.0f} %, dry friction {:.0f} %, *unknown* {:.0f} %;",
        lambda: [*included("linkage_compliance", "moving_mass", "sleeve_friction"), unknown()],
    ),
    Entry(
        PAGE,
        "as read at rest explains {:.0f} ms; the drag is {:.0f} times",
        lambda: [explained_at_rest(), times_ordinary_drag()],
    ),
    Entry(
        PAGE,
        "ten shifts settle it with {:.0f} %, as foreseen",
        lambda: [PERCENT * gap("stand")["next_test"]["chance_to_settle"]],
    ),
    Entry(
        PAGE,
        "gap {:.0f} ms, {:.0f} ms at held-out points, {:.0f} ms by chance alone",
        lambda: [MS * gap("stand")["gap"][f"{k}_rmse_s"] for k in ("baseline", "heldout", "floor")],
    ),
    Entry(
        PAGE,
        "({:d} sealed cases of two engines",
        lambda: [int(_row("processor time of a decision, s")[2])],
    ),
    *(
        Entry(PAGE, words, _counted(figure))
        for words, figure in (
            (f"named is the whole truth in {SPAN} of {{:d}} cases;", "named: the whole truth"),
            (f"that data cannot show, are {SPAN} of {{:d}};", "named above 0.95: wrong"),
            (
                f"an effect is named in {SPAN} of {{:d}} cases without any |",
                "no effect: one is named",
            ),
            (f"a clear cause is named in {SPAN} of {{:d}} and", "clear cause: named"),
            (f"*unknown* is said in {SPAN} of {{:d}};", "clear, outside the list: unknown said"),
            (
                f"the advised test settles {SPAN} of {{:d}} open cases,",
                "cause open: the advised test settles it",
            ),
        )
    ),
    *(
        Entry(PAGE, words, _field(figure))
        for words, figure in (
            (f"and leads in {SPAN};", "clear cause: leads"),
            (
                f"*none* in {SPAN} where data can show it;",
                "no effect, and data can show it: none said",
            ),
            (
                "of pairs {:.2f} ({:.2f} to {:.2f}) more is said than is right;",
                "pairs: probability said less share right",
            ),
            (f"but for such causes, in {SPAN},", "90 % set holds the truth"),
            (f"90 % intervals the sizes in {SPAN};", "90 % intervals hold the sizes"),
            (f"and misleads in {SPAN} |", "cause open: the advised test misleads"),
        )
    ),
]
