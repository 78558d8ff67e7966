"""List the published figures of docs/planar.md."""

from __future__ import annotations

from functools import partial

from benchmarks.entries import Entry
from benchmarks.kept import numbers

PAGE = "docs/planar.md"
#: Effects that move the mean by half a millisecond or less.
SMALL_EFFECTS = ("contact_dissipation", "detent_force", "linkage_compliance", "spline_friction")


def _deviations(speed: str) -> list[float]:
    """Give median and 90 % quantile of a shift's deviation, and the variance left, in percent."""
    return [numbers("engines", speed)[k] for k in (2, 3, 5)]


def _error(mechanism: str, solver: str) -> list[float]:
    """Give median and largest error of a shift in percent, and its processor time in s."""
    return [numbers("mechanism_accuracy", f"{mechanism:<17}{solver}")[k] for k in (0, 2, 3)]


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "is off by {:.2f} % at 1e-7 and by {:.2f} % at 1e-9, the worst by {:.1f} and {:.1f} %, and "
        "a shift takes {:.2f} and {:.2f} s of processor time",
        lambda: [
            _error("linkage", f"Drake {accuracy}")[k]
            for k in range(3)
            for accuracy in ("1e-07", "1e-09")
        ],
    ),
    Entry(
        PAGE,
        "with friction of the spline {:.2f} and {:.2f} s",
        lambda: [_error("spline friction", f"Drake {a}")[2] for a in ("1e-07", "1e-09")],
    ),
    Entry(
        PAGE,
        "off by {:.2f} % (median) and {:.1f} % (largest)",
        lambda: _error("none", "Drake 1e-07")[:2],
    ),
    Entry(
        PAGE,
        "0.3 mm/kN one shift of {:.1f} ms takes {:.1f} ms at 1e-6, {:.1f} ms at 1e-7 "
        "and {:.1f} ms at 1e-9",
        lambda: [
            numbers("linkage_steps", "adams2019, compliance 0.3 mm/kN", line)[4]
            for line in ("planar  1e-05", "drake   1e-06", "drake   1e-07", "drake   1e-09")
        ],
    ),
    Entry(
        PAGE,
        "it takes 1/{:.0f} of Drake's processor time",
        lambda: numbers("engines", "all")[-1:],
    ),
    Entry(PAGE, "has {:.0f} single shifts", lambda: numbers("engines", "all")[:1]),
    Entry(
        PAGE,
        "The outcome is the same in {:.2f} %. The time of a shift differs by {:.3f} % (median), "
        "its peak force by {:.2f} % and its landing load by {:.2f} %; the mean of eight angles by "
        "{:.3f} %",
        lambda: [numbers("engines", "all")[k] for k in (1, 2, 7, 8, 6)],
    ),
    *(
        Entry(
            PAGE,
            f"| {speed} 1/min | {{:.3f}} % | {{:.2f}} % | {{:.2f}} % |",
            partial(_deviations, f"{speed} "),
        )
        for speed in (5, 50, 100, 149, 249)
    ),
    Entry(
        PAGE,
        "With the design set the median is at most {:.3f} %",
        lambda: [
            max(
                numbers("engines", f"{size}, lubricated_steel", "504")[1]
                for size in ("prototype", "small", "large")
            )
        ],
    ),
    Entry(
        PAGE,
        "at most {:.2f} % of the variance is left; with the\npublished set it is up to {:.2f} %",
        lambda: [
            max(
                numbers("engines", f"{size}, {contact}", "504")[4]
                for size in ("prototype", "small", "large")
            )
            for contact in ("lubricated_steel", "adams2019")
        ],
    ),
    Entry(
        PAGE,
        "Of {:.0f} shifts that differ",
        lambda: numbers("engines", "what happens", "shifts that differ")[2:3],
    ),
    Entry(
        PAGE,
        "its own default by more than that in {:.0f} %",
        lambda: numbers("engines", "Drake against itself")[1:],
    ),
    Entry(
        PAGE,
        "leaves its own in {:.0f} %",
        lambda: numbers("engines", "compiled engine against itself")[1:],
    ),
    Entry(
        PAGE,
        "Drake with finer steps, {:.0f} % of them no",
        lambda: [100.0 - numbers("engines", "compiled engine against Drake with finer steps")[1]],
    ),
    Entry(
        PAGE,
        "differ by less than {:.2f} % in nine of ten",
        lambda: numbers("second_engine", "Three engines", "Drake, compiled")[2:3],
    ),
    Entry(
        PAGE,
        "These differ by up to {:.2f} ms",
        lambda: [max(abs(numbers("engine_effects", name)[2]) for name in SMALL_EFFECTS)],
    ),
    Entry(
        PAGE,
        "within {:.1f} % of the move, but for four",
        lambda: [
            max(
                numbers("engine_effects", name)[3]
                for name in (
                    "actuation_lag",
                    "contact_friction",
                    "contact_stiffness",
                    "drag_torque",
                    "free_play",
                    "moving_mass",
                    "reversed_mismatch",
                    "sleeve_friction",
                    "viscous_damping",
                )
            )
        ],
    ),
]
