"""List the published figures of docs/results.md on designs."""

from __future__ import annotations

from functools import partial
from typing import Any

from benchmarks.entries import Entry
from benchmarks.kept import numbers, result, trial
from benchmarks.published.sources import (
    MS,
    PERCENT,
    best_design,
    confirmed,
    confirmed_design,
    gain,
    gearbox,
    prototype,
    searched,
    slower,
)

PAGE = "docs/results.md"
CONTROL, STANDARD = "mq200_actuation", "standard_error_s"
#: Settings of the contact that the best designs were simulated under.
CONTACTS = (
    "adams2019", "lubricated_steel", "friction 0.080", "friction 0.160", "dissipation 1 s/m",
    "dissipation 3 s/m", "dissipation 60 s/m",
    "toothing;", "toothing, fork, drag",
)  # fmt: skip
#: Settings of the ranking whose rows are quoted.
TOOTHING, FORK = "friction in the toothing 0.1", "fork of 0.3 kg, drag of 0.1 N m"
SHAFTS, DRY = "shafts that give way", "faces that throw back (1 s/m)"
RANKED = (TOOTHING, FORK, SHAFTS, DRY, "and play of 0.2 degrees", "friction a third smaller",
          "friction a third larger")  # fmt: skip


def _pair(estimate: Any, scale: float = MS) -> list[float]:
    return [scale * estimate["value"], scale * estimate["standard_error"]]


def _robust_row() -> list[float]:
    both = confirmed("mq200_robust")
    old, new = (both[k]["estimates"]["shift_time_quantile_s"] for k in ("prototype", "best"))
    axial = result("mq200_robust")["best"]["axial_length_mm"]
    return [*_pair(old), prototype("mq200_robust")["axial_length_mm"], *_pair(new), axial]


def _three_row() -> list[float]:
    both, row = confirmed("mq200_three"), []
    lengths = {
        "prototype": prototype("mq200_three")["axial_length_mm"],
        "best": result("mq200_three")["best"]["axial_length_mm"],
    }
    for who, axial in lengths.items():
        told = both[who]["estimates"]
        row += [*_pair(told["expected_shift_time_s"]), axial]
        row += _pair(told["peak_impact_force_N"], 1e-3)
    return row


def _gentle() -> list[float]:
    """Give time, length and blow of the design that is better in all three objectives."""
    told = trial("mq200_three", 5)["estimates"]
    time, force = told["expected_shift_time_s"], told["peak_impact_force_N"]
    return [*_pair(time), searched("mq200_three", 5)["axial_length_mm"], *_pair(force, 1e-3)]


def _harder() -> list[float]:
    """Give by how much the blows of the design chosen of three objectives are harder, kN."""
    found = confirmed("mq200_three")["gains"]["peak_impact_force_N"]
    return [-1e-3 * found["value"], 1e-3 * found["standard_error"]]


def _spent() -> list[float]:
    """Give the shifts of both engines and the designs of the paper's study."""
    found = result("mq200_paper")
    trials = len(found["trials"])
    return [
        found["n_simulated_shifts"],
        found["n_compiled_shifts"],
        trials,
        trials - found["n_simulated_designs"],
    ]


def _landing() -> list[float]:
    """Give the margin of the landing of the paper's choice, %."""
    checks = {one["name"]: one["margin"] for one in confirmed("mq200_paper")["best"]["checks"]}
    return [PERCENT * checks["edge_pressure_impact"]]


def _restitution(name: str) -> list[float]:
    """Give the restitution of one of the contact sets, from the head of its table."""
    return [numbers("contact_sets", name)[-2]]


def _asked(design: str) -> list[float]:
    """Give time and error, gain, loss at the worst point and both least margins of a design."""
    row = numbers("question", design)
    return [*row[:2], *row[4:]]


def _worth(row: str) -> list[float]:
    """Give time and error, ms, and blow and error, N s, of a design under some control."""
    return numbers("control_worth", row)


def _blows(*rows: str) -> list[float]:
    """Give the mean blow of designs under some control, N s."""
    return [_worth(row)[2] for row in rows]


def _controlled(own: str, chosen: str) -> list[float]:
    """Give the times of a shape under both controls with their errors, ms."""
    return [*_worth(own)[:2], *_worth(chosen)[:2]]


def _aged(row: str) -> list[float]:
    """Give loss (um), chamfer, time and error, share engaged, margin and energy of an age."""
    return numbers("wear_drift", row)


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "braking \u03b3 | {:.2f}°, {:.2f}°, {:.2f}° | {:.2f}°, {:.2f}°, {:.2f}° |",
        lambda: [
            row[key]
            for row in (prototype("mq200_paper"), best_design())
            for key in ("chamfer_deg", "traction_deg", "braking_deg")
        ],
    ),
    Entry(
        PAGE,
        "| height h, number N | {:.3f} mm, {:d} | {:.3f} mm, {:d} |",
        lambda: [
            row[key]
            for row in (prototype("mq200_paper"), best_design())
            for key in ("height_mm", "count")
        ],
    ),
    Entry(
        PAGE,
        "root to root | {:.1f} mm | {:.1f} mm |",
        lambda: [row["axial_length_mm"] for row in (prototype("mq200_paper"), best_design())],
    ),
    Entry(
        PAGE,
        "| expected shift time | {:.2f} ± {:.2f} ms | {:.2f} ± {:.2f} ms |",
        lambda: [
            MS * confirmed("mq200_paper")[who][key]
            for who in ("prototype", "best")
            for key in ("expected_shift_time_s", "standard_error_s")
        ],
    ),
    Entry(
        PAGE,
        "smallest margin | {:.1f} % (root fatigue) | {:.1f} % (traction",
        lambda: [
            PERCENT * row["smallest_margin"] for row in (prototype("mq200_paper"), best_design())
        ],
    ),
    Entry(
        PAGE,
        "(all checks but the landing) | {:.0f} % | {:.0f} % |",
        lambda: [
            PERCENT * row["margin_worst_case"] for row in (prototype("mq200_paper"), best_design())
        ],
    ),
    Entry(
        PAGE,
        "The gain is {:.1f} ± {:.1f} ms, {:.0f} %.",
        lambda: [
            MS * confirmed("mq200_paper")["gain_s"],
            MS * confirmed("mq200_paper")["gain_standard_error_s"],
            PERCENT * confirmed("mq200_paper")["gain_share"],
        ],
    ),
    Entry(PAGE, "slower than the prototype, by {:.0f} and {:.0f} ms.", slower),
    Entry(
        PAGE,
        "All {:d} designs of the front pass every check",
        lambda: [len(result("mq200_paper")["front"])],
    ),
    Entry(
        PAGE,
        "{:.2f} ± {:.2f} ms at {:.1f} mm (design 44), {:.2f} ± {:.2f} ms at {:.1f} mm (47), "
        "{:.2f} ± {:.2f} ms at {:.1f} mm (34) and {:.2f} ± {:.2f} ms at {:.1f} mm (40).",
        lambda: [v for number in (44, 47, 34, 40) for v in confirmed_design(number)],
    ),
    Entry(PAGE, "The landing keeps a margin of {:.0f} %", _landing),
    Entry(
        PAGE,
        "tolerances {:.0f} % of its smallest margin are left.",
        lambda: [PERCENT * best_design()["margin_root_sum_square"]],
    ),
    Entry(
        PAGE,
        "confirmation took {:d} shifts of Drake and {:d} of the compiled engine: {:d} designs, of "
        "which {:d} failed their screen.",
        _spent,
    ),
    Entry(
        PAGE,
        "the best design gains {:.1f} ± {:.1f} ms ({:.0f} %), with the design set {:.1f} ± "
        "{:.1f} ms ({:.0f} %); with a friction a third lower {:.1f} ± {:.1f} ms ({:.0f} %), a "
        "third higher {:.1f} ± {:.1f} ms ({:.0f} %).",
        lambda: [
            *gain("adams2019"),
            *gain("lubricated_steel"),
            *gain("friction 0.080"),
            *gain("friction 0.160"),
        ],
    ),
    Entry(
        PAGE,
        "with a restitution of {:.2f} it is {:.1f} ± {:.1f} ms ({:.0f} %), with {:.2f} only {:.1f} "
        "± {:.1f} ms ({:.0f} %). The design set has {:.2f},",
        lambda: [
            *_restitution("dissipation 3 s/m"),
            *gain("dissipation 3 s/m"),
            *_restitution("dissipation 1 s/m"),
            *gain("dissipation 1 s/m"),
            *_restitution("lubricated_steel"),
        ],
    ),
    Entry(
        PAGE,
        "takes it to {:.1f} ± {:.1f} ms ({:.0f} %); with a fork's mass of 0.3 kg and a drag of 0.1 "
        "N m it is {:.1f} ± {:.1f} ms ({:.0f} %)",
        lambda: [*gain("toothing;"), *gain("toothing, fork, drag")],
    ),
    Entry(
        PAGE,
        "above a friction of {:.3f} it would",
        lambda: numbers("contact_sets", "friction above", "chosen"),
    ),
    Entry(
        PAGE,
        "other angles alone leave Kendall's tau at {:.2f}, and",
        lambda: numbers("ranking", "the same at other angles")[1:2],
    ),
    Entry(
        PAGE,
        "Friction in the toothing has {:.2f} and {:.1f} % of the pairs, shafts that give way "
        "{:.2f} and {:.1f} %, faces that throw back {:.2f} and {:.1f} %, a fork's mass with drag "
        "{:.2f} and {:.1f} %.",
        lambda: [
            v for name in (TOOTHING, SHAFTS, DRY, FORK) for v in numbers("ranking", name)[1:3]
        ],
    ),
    Entry(
        PAGE,
        "rounded have {:.2f} and {:.1f} %.",
        lambda: numbers("ranking", "edge radius 0.2")[1:3],
    ),
    Entry(
        PAGE,
        "earlier choice for the paper gains {:.0f} to {:.0f} % under each",
        lambda: [f(numbers("ranking", name)[3] for name in RANKED) for f in (min, max)],
    ),
    Entry(
        PAGE,
        "{:.0f} % with shafts that give way, where that of the default study has {:.0f} %, and "
        "{:.0f} % if faces throw back, where one of 20 that were drawn without a search has "
        "{:.0f} %.",
        lambda: [numbers("ranking", name)[place] for name in (SHAFTS, DRY) for place in (3, -1)],
    ),
    Entry(
        PAGE,
        "gains {:.0f} to {:.0f} % under each of the nine settings, and lets go up to {:.3f}",
        lambda: [
            *(
                f(numbers("contact_sets", name, "gearbox's")[5] for name in CONTACTS)
                for f in (min, max)
            ),
            *numbers("contact_sets", "friction above", "gearbox's"),
        ],
    ),
    Entry(
        PAGE,
        "that study asks for other things and takes {:.1f} ms here instead of {:.1f} ms",
        lambda: [
            numbers("contact_sets", "lubricated_steel", design)[0]
            for design in ("gearbox's", "chosen")
        ],
    ),
    Entry(
        PAGE,
        "(#as-the-paper-asks) | expected time; axial length | {:.2f} ± {:.2f} ms; {:.1f} mm "
        "| {:.2f} ± {:.2f} ms; {:.1f} mm |",
        lambda: [
            v
            for who, row in (("prototype", prototype("mq200_paper")), ("best", best_design()))
            for v in (
                MS * confirmed("mq200_paper")[who]["expected_shift_time_s"],
                MS * confirmed("mq200_paper")[who]["standard_error_s"],
                row["axial_length_mm"],
            )
        ],
    ),
    Entry(
        PAGE,
        "95 % quantile of the time; axial length | {:.0f} ± {:.0f} ms; {:.1f} mm | {:.0f} ± "
        "{:.0f} ms; {:.1f} mm |",
        _robust_row,
    ),
    Entry(
        PAGE,
        "peak impact force | {:.0f} ± {:.0f} ms; {:.1f} mm; {:.1f} ± {:.1f} kN | {:.0f} ± "
        "{:.0f} ms; {:.1f} mm; {:.1f} ± {:.1f} kN |",
        _three_row,
    ),
    Entry(
        PAGE,
        "`mq200_robust` is unsure: its probability of the front is {:.0f} %.",
        lambda: [PERCENT * result("mq200_robust")["best"]["probability_on_front"]],
    ),
    Entry(
        PAGE,
        "Of {:d} that were confirmed {:d} stay on",
        lambda: [len(confirmed("mq200_three")["designs"]), len(result("mq200_three")["front"])],
    ),
    Entry(PAGE, "its blows are harder by {:.1f} ± {:.1f} kN.", _harder),
    Entry(
        PAGE,
        "Its smallest margin is {:.1f} %, of which tolerances leave {:.1f} % by",
        lambda: [
            PERCENT * result("mq200_three")["best"][key]
            for key in ("smallest_margin", "margin_root_sum_square")
        ],
    ),
    Entry(PAGE, "at the new angles: {:.1f} ± {:.1f} ms, {:.1f} mm, {:.1f} ± {:.1f} kN.", _gentle),
    Entry(
        PAGE,
        "root-mean-square deviation {:.1f} ms or {:.1f} % over the 25 cells that have a time; over "
        "all angles it is {:.1f} %",
        lambda: [
            *numbers("adams", "as published")[2::-2],
            *numbers("adams", "all angles, as published")[:1],
        ],
    ),
    Entry(
        PAGE,
        "is {:.1f} ± {:.1f} ms with all limits, {:.1f} ± {:.1f} ms if a design may be slower at "
        "some points, and {:.1f} ± {:.1f} ms without any",
        lambda: [
            v
            for name in ("all limits", "slower at some points", "no limits")
            for v in numbers("question", "searched by", name)[5:7]
        ],
    ),
    *(
        Entry(PAGE, template, partial(_asked, name))
        for name, template in {
            "mq200_paper, 19": "choice (19) | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % pull-out force | {:.1f} % |",
            "mq200_paper, 43": "`mq200_paper`, earlier 43 | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % slot width | {:.1f} % |",
            "mq200_paper, 6": "`mq200_paper`, earlier 6 | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % pull-out force | {:.1f} % |",
            "mq200, chosen": "`mq200`, an earlier choice | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % contact ratio | {:.1f} % |",
        }.items()
    ),
    Entry(
        PAGE,
        "| prototype | {:.1f} ± {:.1f} | | {:.1f} | {:.1f} % edge pressure | {:.1f} % |",
        lambda: [_asked("prototype")[k] for k in (0, 1, 3, 4, 5)],
    ),
    Entry(
        PAGE,
        "(#the-default-study) | expected time; axial length | {:.1f} ± {:.1f} ms; {:.1f} mm "
        "| {:.1f} ± {:.1f} ms; {:.1f} mm |",
        lambda: [
            *gearbox()[2:],
            prototype("mq200")["axial_length_mm"],
            *gearbox()[:2],
            result("mq200")["best"]["axial_length_mm"],
        ],
    ),
    Entry(
        PAGE,
        "(#shift-control-searched-with-the-shape) | expected time; axial length "
        "| {:.1f} ± {:.1f} ms; {:.1f} mm | {:.1f} ± {:.1f} ms; {:.1f} mm |",
        lambda: [
            value
            for who, row in (
                ("prototype", prototype(CONTROL)),
                ("best", result(CONTROL)["best"]),
            )
            for value in (
                *(MS * confirmed(CONTROL)[who][k] for k in ("expected_shift_time_s", STANDARD)),
                row["axial_length_mm"],
            )
        ],
    ),
    Entry(
        PAGE,
        "aims at {:.0f} 1/min instead of {:.0f}, with {:.2f} times the force and {:.2f} times its",
        lambda: [
            result(CONTROL)["best"]["mismatch_set_rpm"],
            prototype(CONTROL)["mismatch_set_rpm"],
            *(result(CONTROL)["best"][key] for key in ("force_factor", "rise_factor")),
        ],
    ),
    *(
        Entry(
            PAGE,
            f"| {name} | {{:.1f}} ± {{:.1f}} ms | {{:.1f}} ± {{:.1f}} ms |",
            partial(_controlled, *rows),
        )
        for name, rows in {
            "prototype": ("prototype  ", "prototype, chosen control"),
            "chosen": ("chosen shape, own control", "chosen shape and control"),
        }.items()
    ),
    Entry(
        PAGE,
        "the control alone takes {:.0f} % off the prototype's time, the shape alone {:.0f} %, and "
        "both together {:.0f} %",
        lambda: [
            100.0 * (1.0 - _worth(row)[0] / _worth("prototype  ")[0])
            for row in (
                "prototype, chosen control",
                "chosen shape, own control",
                "chosen shape and control",
            )
        ],
    ),
    Entry(
        PAGE,
        "rise take {:.1f}, {:.1f} and {:.1f} ms from the prototype, each",
        lambda: [
            _worth("prototype  ")[0] - _worth(f"prototype, {key}")[1]
            for key in ("mismatch_set_rpm", "force_factor", "rise_factor")
        ],
    ),
    Entry(
        PAGE,
        "makes its mean blow {:.2f} N s",
        lambda: _worth("prototype, mismatch_set_rpm")[3:4],
    ),
    *(
        Entry(PAGE, sentence, partial(_blows, *rows))
        for sentence, rows in {
            "own control has {:.2f} N s.": ("chosen shape, own control",),
            "Together they have {:.2f} N s, the prototype {:.2f} N s.": (
                "chosen shape and control",
                "prototype  ",
            ),
        }.items()
    ),
    Entry(
        PAGE,
        "sampler searched it, {:.0f} designs and {:.0f} shifts",
        lambda: [len(result(CONTROL)["trials"]), result(CONTROL)["n_simulated_shifts"]],
    ),
    Entry(
        PAGE,
        "takes {:.1f} µm from the crest of the chosen design of `mq200_paper` at a wear rate of "
        "1e-6 mm³/(N m), and {:.0f} µm at 1e-5: from {:.1f} ± {:.1f} it goes to "
        "{:.1f} ± {:.1f} ms",
        lambda: [
            _aged("chosen, rate 1e-6 mm3/(N m), 100 %:")[0],
            _aged("chosen, rate 1e-5 mm3/(N m), 100 %:")[0],
            *_aged("chosen, rate 1e-5 mm3/(N m), 0 %:")[2:4],
            *_aged("chosen, rate 1e-5 mm3/(N m), 100 %:")[2:4],
        ],
    ),
    Entry(
        PAGE,
        "{:.1f}° of its {:.1f}° are left. It then takes {:.1f} ± {:.1f} ms, and its smallest "
        "margin stays {:.1f} %; the prototype takes {:.1f} ± {:.1f} ms, and "
        "by {:.1f} %",
        lambda: [
            _aged("chosen, crest 0.1 mm, 100 %:")[1],
            _aged("chosen, crest 0.1 mm, 0 %:")[1],
            *_aged("chosen, crest 0.1 mm, 100 %:")[2:4],
            _aged("chosen, crest 0.1 mm, 100 %:")[5],
            *_aged("prototype, crest 0.1 mm, 100 %:")[2:4],
            -_aged("prototype, crest 0.1 mm, 100 %:")[5],
        ],
    ),
]
