"""List the published figures, document by document, with what each comes from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from benchmarks.entries import Entry
from benchmarks.field_table import FIGURE, headline_of
from benchmarks.field_table import SCORE as FIELD_SCORE
from benchmarks.kept import bank_shifts, gap, numbers, result, surrogate, trial

CONTROL, STANDARD = "mq200_actuation", "standard_error_s"
README = "README.md"
RESULTS = "docs/results.md"
COMMANDS = "docs/commands.md"
DIAGNOSIS = "docs/diagnosis.md"
MODEL = "docs/model.md"
PLANAR = "docs/planar.md"
SIMULATION = "docs/simulation.md"
SURROGATE = "docs/surrogate.md"
STRENGTH = "docs/strength.md"
#: Effects that move the mean by half a millisecond or less.
SMALL_EFFECTS = ("contact_dissipation", "detent_force", "spline_friction")
MS = 1e3
#: Rows of two workers.
TWO_WORKERS = ("processes           2", "Dask                2")
PERCENT = 100.0
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


def _study(name: str) -> Any:
    return result(name)["confirmation"]


def _pair(estimate: Any, scale: float = MS) -> list[float]:
    return [scale * estimate["value"], scale * estimate["standard_error"]]


#: Samplers of Optuna's, alone with Drake, in benchmarks/samplers.py, and this project's there.
OPTUNAS, OWN_LEVELS = ("TPE", "NSGA-II", "GPSampler", "quasi-random"), "own, two levels"


def _shares(name: str) -> list[float]:
    """Give a sampler's shares of the hypervolume, three for each column, and its seeds."""
    return numbers("samplers", "share of the reference front", name)


def _found(name: str, place: int) -> float:
    return _shares(name)[place]


def _raced() -> list[float]:
    """Give what the search in two levels has at few shifts, and the others at few and at all."""
    few = max(_found(name, 0) for name in OPTUNAS)
    return [_found(OWN_LEVELS, 0), 230, few, 1152, _found("GPSampler", 3)]


def _share(row: list[float], first: int = 0) -> list[float]:
    return [PERCENT * value for value in row[first : first + 3]]


def _rounded(radius: str) -> list[float]:
    """Give times and errors of three designs whose edges have a radius in mm, ms."""
    row = numbers("edge_radius", "expected shift time", "radius, mm", f"{float(radius):.1f}")
    return [row[k] for k in (0, 1, 4, 5, 8, 9)]


def _steel(radius: str) -> list[float]:
    """Give pressures on edges of a radius, as simulated and on steel by design, and the limit."""
    return numbers("edge_radius", "edge pressure that one landing", "radius, mm", radius)


#: Clutches of ``benchmarks/two_fidelities.py`` as docs/surrogate.md names them.
CLUTCHES = {"prototype": "prototype", "small": "small, 40 mm", "large": "large, 92 mm"}


def _name(clutch: str) -> str:
    """Give the name of a clutch's study in two_fidelities.txt."""
    return f"two_fidelities-{clutch}"


def _fitted(clutch: str, row: str) -> list[float]:
    """Give what references say of a fit in two levels: rmse, bias, Q2 and so on."""
    return numbers("two_fidelities", _name(clutch), row)


def _most(clutch: str) -> str:
    """Give the row of all designs of a clutch at its own operating points."""
    return f"all points{334 if clutch == 'prototype' else 800:>11}"


def _clutch(clutch: str) -> list[float]:
    """Give the row of docs/surrogate.md on a clutch."""
    rmse, bias, q2, inside, points, inside_points, rank, _ = _fitted(clutch, _most(clutch))
    return [q2, rmse, bias, inside, points, inside_points, rank]


def _bundled() -> list[float]:
    """Give Q2, that of points and the rank of the bundled surrogate and of a fit in two levels."""
    both = _fitted("prototype", "bundled")[1:], _fitted("prototype", _most("prototype"))
    return [found[place] for found in both for place in (2, 4, 6)]


def _grown(clutch: str) -> list[float]:
    """Give Q2 of more and more designs of a clutch, of rows alone and of one engine."""
    rows = [f"all points{c:>11}" for c in (100, 200, 300)]
    found = [_fitted(clutch, row)[2] for row in (*rows, _most(clutch), f"own points{250:>11}")]
    return [*found, _fitted(clutch, "one engine")[3]]


def _prototype(name: str) -> Any:
    return result(name)["trials"][0]


def _slower() -> list[float]:
    """Give by how much the chosen design is slower where it is, in ms, least first."""
    both = _study("mq200_paper")
    pairs = zip(both["prototype"]["points"], both["best"]["points"], strict=True)
    return sorted(MS * (b["mean_s"] - a["mean_s"]) for a, b in pairs if b["mean_s"] > a["mean_s"])


def _failed(name: str) -> list[Any]:
    """Give the confirmed designs that fail a check there, as kept."""
    designs = _study(name)["designs"]
    return [one for one in designs if not all(check["passed"] for check in one["checks"])]


def _search_shifts(name: str) -> float:
    kept = result(name)
    return sum(row["shifts"] for row in kept["trials"]) - kept["replication"]["shifts"]


def _replication(name: str) -> list[float]:
    """Give shifts of search and replication, unclear designs, and those on the wrong side."""
    told = result(name)["replication"]
    unclear = [len(told["unclear_before"]), len(told["unclear"])]
    sides = [told["misplaced_before"], told["misplaced"]]
    return [_search_shifts(name), told["shifts"], *unclear, *sides]


def _both_levels(name: str) -> list[float]:
    """Give designs, shifts of both engines, and designs on the wrong side, of a search in two."""
    kept = result(name)
    told = kept["replication"]
    return [
        kept["n_simulated_designs"],
        len(kept["trials"]),
        _search_shifts(name),
        kept["n_compiled_shifts"] - told["compiled_shifts"],
        told["shifts"],
        told["compiled_shifts"],
        kept["n_simulated_shifts"],
        told["misplaced"],
        told["misplaced_before"],
    ]


def _robust_row() -> list[float]:
    both = _study("mq200_robust")
    old, new = (both[k]["estimates"]["shift_time_quantile_s"] for k in ("prototype", "best"))
    axial = result("mq200_robust")["best"]["axial_length_mm"]
    return [*_pair(old), _prototype("mq200_robust")["axial_length_mm"], *_pair(new), axial]


def _three_row() -> list[float]:
    both, row = _study("mq200_three"), []
    lengths = {
        "prototype": _prototype("mq200_three")["axial_length_mm"],
        "best": result("mq200_three")["best"]["axial_length_mm"],
    }
    for who, axial in lengths.items():
        told = both[who]["estimates"]
        row += [*_pair(told["expected_shift_time_s"]), axial]
        row += _pair(told["peak_impact_force_N"], 1e-3)
    return row


def _of_31() -> list[float]:
    told = trial("mq200_three", 31)["estimates"]
    rows = {row["trial"]: row for row in result("mq200_three")["trials"]}
    time, force = told["expected_shift_time_s"], told["peak_impact_force_N"]
    return [*_pair(time), rows[31]["axial_length_mm"], *_pair(force, 1e-3)]


def _behind() -> list[float]:
    """Give how far the search has design 31 behind the chosen one, with the error of both."""
    rows = {row["trial"]: row for row in result("mq200_three")["trials"]}
    a, b = rows[31], rows[_study("mq200_three")["chosen"]]
    error = math.hypot(a["standard_error_s"], b["standard_error_s"])
    return [MS * (a["expected_shift_time_s"] - b["expected_shift_time_s"]), MS * error]


def _gain(name: str) -> list[float]:
    """Give gain, error and percent of the chosen design under one of the contact sets."""
    return numbers("contact_sets", name, "chosen (19)")[-3:]


def _restitution(name: str) -> list[float]:
    """Give the restitution of one of the contact sets, from the head of its table."""
    return [numbers("contact_sets", name)[-2]]


def _deviations(speed: str) -> list[float]:
    """Give median and 90 % quantile of a shift's deviation, and the variance left, in percent."""
    return [numbers("engines", speed)[k] for k in (2, 3, 5)]


def _table(name: str, key: str) -> Callable[[], Sequence[float]]:
    return lambda: numbers(name, key)


_FINE, _FINE_SEEN = "all 130 cases", "gap of two sampling errors or more (77)"
_SPAN = "{:.0f} % ({:.0f} to {:.0f})"

FINE = [
    (_FINE, 3, f"the truth is in the leading class in {_SPAN} of all"),
    (_FINE, 9, f"what is named is the truth in {_SPAN},"),
    (_FINE, 12, f"the 90 % set holds it in {_SPAN} of all"),
    (_FINE_SEEN, 12, f"and {_SPAN} of the visible ones"),
]


def _blind(table: str, label: str, first: int) -> Callable[[], Sequence[float]]:
    return lambda: _share(numbers(table, label), first)


def _wide(label: str) -> Callable[[], Sequence[float]]:
    """Give a share of the wide set with its interval, in percent."""
    return lambda: [PERCENT * one for one in numbers("blind_wide", label)[:3]]


def _field(words: str) -> Callable[[], Sequence[float]]:
    """Give a headline share of the field set with its interval, in percent."""

    def values() -> Sequence[float]:
        (row,) = (one for one in headline_of(FIELD_SCORE) if one[0] == words)
        found = FIGURE.fullmatch(row[1])
        assert found is not None, words
        return [PERCENT * float(one) for one in found.groups()]

    return values


def _said_and_so(kind: str) -> list[float]:
    """Give what the leading hypothesis has on average in a kind of case, and how often it is so."""
    # Two spaces: the row by evidence goes on with other words.
    rows = ("probability of the leading one  ", "it is the truth, but for causes")
    return [numbers("blind_field", f"{kind}: {row}")[0] for row in rows]


STAND_TOP = ("actuation_delay", "actuation_lag", "drag_torque")
WITH_MASS = ("actuation_delay", "drag_torque", "moving_mass")


def _hypothesis(bench: str, effects: Sequence[str]) -> Any:
    return next(h for h in gap(bench)["hypotheses"] if h["effects"] == list(effects))


def _interval(found: Any, name: str, scale: float = 1.0) -> list[float]:
    return [scale * found["parameters"][name][end] for end in ("mean", "low", "high")]


def _stand(effects: Sequence[str], name: str, scale: float = 1.0) -> Callable[[], Sequence[float]]:
    return lambda: _interval(_hypothesis("stand", effects), name, scale)


def _reversed(effect: str, name: str) -> Callable[[], Sequence[float]]:
    """Give a time of an effect beside drag, were the sense of rotation reversed, in ms."""
    effects = sorted(("drag_torque", effect))

    def values() -> Sequence[float]:
        found = next(one for one in gap("stand")["senses"] if one["reversed"])
        mine = next(h for h in found["hypotheses"] if h["effects"] == effects)
        return _interval(mine, name, MS)

    return values


def _thirds() -> list[float]:
    """Give the probabilities of lag, mass, detent and friction as the third effect, percent."""
    names = ("actuation_lag", "moving_mass", "detent_force", "sleeve_friction")
    return [PERCENT * gap("stand")["inclusion"][name] for name in names]


def _other_delays() -> list[float]:
    """Give the least and the largest mean dead time beside the other thirds, in ms."""
    thirds = ("moving_mass", "detent_force", "sleeve_friction")
    each = [sorted(("actuation_delay", "drag_torque", third)) for third in thirds]
    means = [MS * _hypothesis("stand", one)["parameters"]["delay_s"]["mean"] for one in each]
    return [min(means), max(means)]


def _given_compliance() -> list[float]:
    """Give the probabilities of lag and friction with the linkage in the simulation, percent."""
    rows = gap("stand")["sensitivity"]["given_compliance_mm_kN"]
    names = ("actuation_lag", "sleeve_friction")
    return [PERCENT * sum(r["probability"] for r in rows if n in r["effects"]) for n in names]


def _linkage() -> list[float]:
    """Give the compliance of the linkage at the sleeve by the static readings, mm/kN."""
    found = next(f for f in gap("stand")["facts"] if f["parameter"] == "compliance_mm_kN")
    return [found["low"], found["high"]]


def _widened_lag() -> list[float]:
    """Give the end of the range of the slow rise, and that after widening, s."""
    found = next(one for one in gap("stand")["range_ends"] if one["parameter"] == "lag_s")
    return [found["end"], found["moved"]]


def _prices() -> list[list[float]]:
    """Give the time with the causes and its error for each design of the price, ms."""
    told = gap("stand")["so_what"]["candidates"]
    return [[MS * one["with_s"], MS * one["with_standard_error_s"]] for one in told]


def _price() -> list[float]:
    prototype, chosen, *_ = _prices()
    return [*chosen, *prototype, PERCENT * (1.0 - chosen[0] / prototype[0])]


def _other_prices() -> list[float]:
    """Give by how much the other designs take longer than the best, least and most, ms."""
    _, chosen, *others = _prices()
    longer = [time - chosen[0] for time, _ in others]
    return [min(longer), max(longer)]


def _adams(effect: str, name: str) -> Callable[[], Sequence[float]]:
    return lambda: [_hypothesis("adams", [effect])["parameters"][name]["mean"]]


def _asked(design: str) -> list[float]:
    """Give time and error, gain, loss at the worst point and both least margins of a design."""
    row = numbers("question", design)
    return [*row[:2], *row[4:]]


def _gearbox() -> list[float]:
    """Give the time of the gearbox study's choice and of the prototype with their errors, ms."""
    return [
        MS * _study("mq200")[who][key]
        for who in ("best", "prototype")
        for key in ("expected_shift_time_s", "standard_error_s")
    ]


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


def _best() -> Any:
    return result("mq200_paper")["best"]


ENTRIES: list[Entry] = [
    # README: What it found
    Entry(
        README,
        "| {:.1f} ± {:.1f} ms instead of {:.1f} ± {:.1f} ms, {:.1f} mm instead of {:.1f} mm long "
        "| smallest margin {:.1f} %; of the front {:d} designs stay unclear |",
        lambda: [
            *_gearbox(),
            *(row["axial_length_mm"] for row in (result("mq200")["best"], _prototype("mq200"))),
            PERCENT * result("mq200")["best"]["smallest_margin"],
            _replication("mq200")[3],
        ],
    ),
    Entry(
        README,
        "| {:.1f} ± {:.1f} ms instead of {:.1f} ± {:.1f} ms, another design, {:.1f} mm long |",
        lambda: [
            *(
                MS * _study("mq200_paper")[who][key]
                for who in ("best", "prototype")
                for key in ("expected_shift_time_s", "standard_error_s")
            ),
            _best()["axial_length_mm"],
        ],
    ),
    Entry(
        README,
        "would need {:.0f} N to be pulled out",
        lambda: numbers("gearbox_loads", "toothing 0.1:", "chosen (19)", "pulled out with"),
    ),
    Entry(
        COMMANDS,
        "two processes simulate {:.2f} times as fast as one, and two Dask workers {:.2f} times.",
        lambda: [numbers("workers", name)[1] for name in TWO_WORKERS],
    ),
    Entry(README, "| slower by {:.0f} and {:.0f} ms at two points", _slower),
    Entry(
        README,
        "smallest margin {:.1f} %, with worst tolerances {:.0f} %; it",
        lambda: [PERCENT * _best()[key] for key in ("smallest_margin", "margin_worst_case")],
    ),
    Entry(
        README,
        "| gain {:.1f} ± {:.1f} ms ({:.0f} %) at other angles | {:.1f} ± {:.1f} ms ({:.0f} %) with",
        lambda: [*_gain("lubricated_steel"), *_gain("friction 0.080")],
    ),
    Entry(
        README,
        "{:.1f} ± {:.1f} ms ({:.0f} %) with friction in the ring's toothing",
        lambda: _gain("toothing;"),
    ),
    Entry(
        README,
        "{:.1f} ± {:.1f} ms ({:.0f} %) if faces throw back as dry steel",
        lambda: _gain("dissipation 1 s/m"),
    ),
    Entry(
        README,
        "above a friction of {:.3f} its flank",
        lambda: numbers("contact_sets", "friction above", "chosen (19)"),
    ),
    Entry(
        README,
        "| {:.2f} of the best hypervolume known with {:d} shifts of Drake, the best of four "
        "samplers of Optuna {:.2f} | with {:d} GPSampler, given the closed forms, has {:.2f}, "
        "ahead at three seeds of five;",
        _raced,
    ),
    Entry(
        README,
        "of {:d} designs with an unclear place on the front {:d} stay unclear",
        lambda: _replication("mq200_paper")[2:4],
    ),
    Entry(
        README,
        "| Q² {:.3f}, error {:.1f} ms of a mean over the points | Q² {:.3f}, error {:.1f} ms at",
        lambda: [
            surrogate()["validation"]["q2"],
            MS * surrogate()["validation"]["rmse_s"],
            surrogate()["validation"]["q2_points"],
            MS * surrogate()["validation"]["rmse_points_s"],
        ],
    ),
    Entry(
        README,
        "| Q² {:.3f}, {:.3f} and {:.3f} on three clutches, at a single point {:.3f}, {:.3f} and "
        "{:.3f} | rank correlation in the best tenth {:.2f}, {:.2f} and {:.2f}; "
        "intervals hold {:.0f}, {:.0f} and {:.0f} % |",
        lambda: [_clutch(clutch)[place] for place in (0, 4, 6, 3) for clutch in CLUTCHES],
    ),
    Entry(
        README,
        "root-mean-square deviation {:.1f} %",
        lambda: numbers("adams", "as published")[:1],
    ),
    Entry(
        README,
        "dead time of the actuation {:.0f} ms ({:.0f} to {:.0f})",
        _stand(STAND_TOP, "delay_s", MS),
    ),
    Entry(README, "and drag {:.1f} N m ({:.1f} to {:.1f});", _stand(STAND_TOP, "drag_Nm")),
    Entry(
        README,
        "{:.0f} ms shrink to {:.0f} ms where nothing was fitted",
        lambda: [MS * gap("stand")["gap"][k] for k in ("baseline_rmse_s", "heldout_rmse_s")],
    ),
    *(
        Entry(README, words, _field(figure))
        for words, figure in (
            (
                f"what is named is the whole truth in {_SPAN};",
                "named exactly, of all that is named, outside included",
            ),
            (
                f"an effect is named in {_SPAN} of 108 cases without any;",
                "no effect: one is named",
            ),
            (
                f"a cause that rivals leave clear leads, or its class does, in {_SPAN}:",
                "clear: cause or its class leads",
            ),
            (f"the 90 % set holds the truth in {_SPAN};", "90 % set holds the truth"),
            (
                f"*none* is said in {_SPAN} of the cases without any;",
                "no effect: none within the margin said",
            ),
            (
                f"the advised test settles {_SPAN} of what is open,",
                "cause left open: the advised test settles it",
            ),
            (
                f"and {_SPAN} wrongly |",
                "cause left open: it settles on what is not true",
            ),
        )
    ),
    Entry(
        README,
        "leads has {:.2f} and {:.2f} on average, and is right in {:.2f} and {:.2f} of the cases |",
        lambda: [
            one
            for both in zip(_said_and_so("none"), _said_and_so("single"), strict=True)
            for one in both
        ],
    ),
    Entry(
        README,
        "all {:.0f} single effects, no pair and no three;",
        lambda: [numbers("blind_field", "clear, single: cause or class right")[-1]],
    ),
    # docs/results.md: the paper's question
    Entry(
        RESULTS,
        "braking \u03b3 | {:.2f}°, {:.2f}°, {:.2f}° | {:.2f}°, {:.2f}°, {:.2f}° |",
        lambda: [
            row[key]
            for row in (_prototype("mq200_paper"), _best())
            for key in ("chamfer_deg", "traction_deg", "braking_deg")
        ],
    ),
    Entry(
        RESULTS,
        "| height h, number N | {:.3f} mm, {:d} | {:.3f} mm, {:d} |",
        lambda: [
            row[key]
            for row in (_prototype("mq200_paper"), _best())
            for key in ("height_mm", "count")
        ],
    ),
    Entry(
        RESULTS,
        "root to root | {:.1f} mm | {:.1f} mm |",
        lambda: [row["axial_length_mm"] for row in (_prototype("mq200_paper"), _best())],
    ),
    Entry(
        RESULTS,
        "| expected shift time | {:.1f} ± {:.1f} ms | {:.1f} ± {:.1f} ms |",
        lambda: [
            MS * _study("mq200_paper")[who][key]
            for who in ("prototype", "best")
            for key in ("expected_shift_time_s", "standard_error_s")
        ],
    ),
    Entry(
        RESULTS,
        "smallest margin | {:.0f} % (root fatigue) | {:.1f} % (release",
        lambda: [PERCENT * row["smallest_margin"] for row in (_prototype("mq200_paper"), _best())],
    ),
    Entry(
        RESULTS,
        "(all checks but the landing) | {:.0f} % | {:.0f} % |",
        lambda: [
            PERCENT * row["margin_worst_case"] for row in (_prototype("mq200_paper"), _best())
        ],
    ),
    Entry(
        RESULTS,
        "The gain is {:.1f} ± {:.1f} ms, {:.0f} %.",
        lambda: [
            MS * _study("mq200_paper")["gain_s"],
            MS * _study("mq200_paper")["gain_standard_error_s"],
            PERCENT * _study("mq200_paper")["gain_share"],
        ],
    ),
    Entry(RESULTS, "slower than the prototype, by {:.0f} and {:.0f} ms.", _slower),
    Entry(
        RESULTS,
        "All took {:d} shifts: {:d} designs",
        lambda: [
            result("mq200_paper")["n_simulated_shifts"],
            result("mq200_paper")["n_simulated_designs"] - 1,
        ],
    ),
    Entry(
        RESULTS,
        "Replication added {:d} shifts where",
        lambda: [result("mq200_paper")["replication"]["shifts"]],
    ),
    Entry(
        RESULTS,
        "The search had predicted {:.1f} ± {:.1f} ms.",
        lambda: [MS * _best()["expected_shift_time_s"], MS * _best()["standard_error_s"]],
    ),
    Entry(
        RESULTS,
        "They took {:.1f} to {:.1f} ms,",
        lambda: [
            f(MS * one["expected_shift_time_s"] for one in _failed("mq200_paper"))
            for f in (min, max)
        ],
    ),
    Entry(
        RESULTS,
        "of {:d} designs it was unclear whether they are on it. The {:d} shifts more",
        lambda: [
            len(result("mq200_paper")["replication"]["unclear_before"]),
            result("mq200_paper")["replication"]["shifts"],
        ],
    ),
    Entry(
        RESULTS, "a fifth of the search's, leave {:d},", lambda: _replication("mq200_paper")[3:4]
    ),
    Entry(
        RESULTS, "In `mq200_robust` {:d} shifts leave", lambda: [_replication("mq200_robust")[1]]
    ),
    Entry(
        RESULTS,
        "with {:.1f} on the wrong side instead of {:.1f}.",
        lambda: _replication("mq200_robust")[:3:-1],
    ),
    Entry(
        RESULTS,
        "the best design gains {:.1f} ± {:.1f} ms ({:.0f} %), with the design set {:.1f} ± "
        "{:.1f} ms ({:.0f} %); with a friction a third lower {:.1f} ± {:.1f} ms ({:.0f} %), a "
        "third higher {:.1f} ± {:.1f} ms ({:.0f} %).",
        lambda: [
            *_gain("adams2019"),
            *_gain("lubricated_steel"),
            *_gain("friction 0.080"),
            *_gain("friction 0.160"),
        ],
    ),
    Entry(
        RESULTS,
        "with a restitution of {:.2f} it is {:.1f} ± {:.1f} ms ({:.0f} %), with {:.2f} only {:.1f} "
        "± {:.1f} ms ({:.0f} %). The design set has {:.2f},",
        lambda: [
            *_restitution("dissipation 3 s/m"),
            *_gain("dissipation 3 s/m"),
            *_restitution("dissipation 1 s/m"),
            *_gain("dissipation 1 s/m"),
            *_restitution("lubricated_steel"),
        ],
    ),
    Entry(
        RESULTS,
        "takes it to {:.1f} ± {:.1f} ms ({:.0f} %); with a fork's mass of 0.3 kg and a drag of 0.1 "
        "N m it is {:.1f} ± {:.1f} ms ({:.0f} %)",
        lambda: [*_gain("toothing;"), *_gain("toothing, fork, drag")],
    ),
    Entry(
        RESULTS,
        "above a friction of {:.3f} it would",
        lambda: numbers("contact_sets", "friction above", "chosen (19)"),
    ),
    Entry(
        RESULTS,
        "other angles alone leave Kendall's tau at {:.2f}, and",
        lambda: numbers("ranking", "the same at other angles")[1:2],
    ),
    Entry(
        RESULTS,
        "Friction in the toothing has {:.2f} and {:.1f} % of the pairs, shafts that give way "
        "{:.2f} and {:.1f} %, faces that throw back {:.2f} and {:.1f} %, a fork's mass with drag "
        "{:.2f} and {:.1f} %.",
        lambda: [
            v for name in (TOOTHING, SHAFTS, DRY, FORK) for v in numbers("ranking", name)[1:3]
        ],
    ),
    Entry(
        RESULTS,
        "rounded have {:.2f} and {:.1f} %.",
        lambda: numbers("ranking", "edge radius 0.2")[1:3],
    ),
    Entry(
        RESULTS,
        "leads for the paper still gains {:.0f} to {:.0f} % under each",
        lambda: [f(numbers("ranking", name)[3] for name in RANKED) for f in (min, max)],
    ),
    Entry(
        STRENGTH,
        "the prototype's exceed {:.0f} MPa and those of the chosen design {:.0f} MPa, where "
        "{:.0f} MPa are allowed; with edges of 0.5 mm it is {:.0f} and {:.0f} MPa",
        lambda: [
            *(_steel("0.3")[k] for k in (1, 3, 6)),
            *(_steel("0.5")[k] for k in (1, 3)),
        ],
    ),
    *(
        Entry(
            SURROGATE,
            f"| {told} | {{:.3f}} | {{:.2f}} ms | {{:+.2f}} ms | {{:.0f}} % | {{:.3f}} | "
            "{:.0f} % | {:.2f} |",
            partial(_clutch, clutch),
        )
        for clutch, told in CLUTCHES.items()
    ),
    Entry(
        SURROGATE,
        "has Q² {:.3f}, of points {:.3f} and a rank of {:.2f}, where what `dogshape fit "
        "mq200_paper --levels 2` makes has {:.3f}, {:.3f} and {:.2f}:",
        _bundled,
    ),
    *(
        Entry(
            SURROGATE,
            f"| {told} |" + 6 * " {:.3f} |",
            partial(_grown, clutch),
        )
        for clutch, told in CLUTCHES.items()
    ),
    Entry(
        SURROGATE,
        "themselves uncertain by {:.2f}, {:.2f} and {:.2f} ms. What is learnt from took {:.0f}, "
        "{:.0f} and {:.0f} s of a processor, references {:.0f}, {:.0f} and {:.0f} s and fits "
        "{:.0f}, {:.0f} and {:.0f} s.",
        lambda: [
            *(numbers("two_fidelities", _name(one), "references", "")[2] for one in CLUTCHES),
            *(
                numbers("two_fidelities", _name(one), "processor time")[place]
                for place in range(3)
                for one in CLUTCHES
            ),
        ],
    ),
    Entry(
        SIMULATION,
        "an edge of 0.3 mm bears {:.0f} N/mm where",
        lambda: numbers("edge_radius", "edge on edge", "0.3")[2:3],
    ),
    *(
        Entry(
            SIMULATION,
            f"| {radius} |" + 3 * " {:.1f} ± {:.1f} ms |",
            partial(_rounded, radius),
        )
        for radius in ("0", "0.1", "0.2", "0.3")
    ),
    Entry(
        RESULTS,
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
        RESULTS,
        "{:.0f} ms slower, lets go up to {:.3f} and gains at least {:.0f} %",
        lambda: [
            MS
            * (
                trial("mq200_paper", 43)["expected_shift_time_s"]
                - _study("mq200_paper")["best"]["expected_shift_time_s"]
            ),
            *numbers("contact_sets", "friction above", "trial 43"),
            min(numbers("contact_sets", name, "trial 43")[-1] for name in CONTACTS),
        ],
    ),
    Entry(
        RESULTS,
        "Trial 6 would keep {:.0f} %, but its edge bears more than it may in the landing by "
        "{:.1f} %",
        lambda: [
            min(numbers("contact_sets", name, "trial 6 ")[-1] for name in CONTACTS),
            *[
                -PERCENT * check["margin"]
                for one in _failed("mq200_paper")
                if one["trial"] == 6
                for check in one["checks"]
                if not check["passed"]
            ],
        ],
    ),
    Entry(
        RESULTS,
        "(#as-the-paper-asks) | expected time; axial length | {:.1f} ± {:.1f} ms; {:.1f} mm "
        "| {:.1f} ± {:.1f} ms; {:.1f} mm |",
        lambda: [
            v
            for who, row in (("prototype", _prototype("mq200_paper")), ("best", _best()))
            for v in (
                MS * _study("mq200_paper")[who]["expected_shift_time_s"],
                MS * _study("mq200_paper")[who]["standard_error_s"],
                row["axial_length_mm"],
            )
        ],
    ),
    Entry(
        RESULTS,
        "95 % quantile of the time; axial length | {:.0f} ± {:.0f} ms; {:.1f} mm | {:.0f} ± "
        "{:.0f} ms; {:.1f} mm |",
        _robust_row,
    ),
    Entry(
        RESULTS,
        "peak impact force | {:.0f} ± {:.0f} ms; {:.1f} mm; {:.1f} ± {:.1f} kN | {:.0f} ± "
        "{:.0f} ms; {:.1f} mm; {:.1f} ± {:.1f} kN |",
        _three_row,
    ),
    Entry(
        RESULTS,
        "Its probability of the front is {:.0f} %, and its numerical error {:.0f} ms",
        lambda: [
            PERCENT * result("mq200_three")["best"]["probability_on_front"],
            MS * _study("mq200_three")["best"]["numerical_error_s"],
        ],
    ),
    Entry(RESULTS, "at the new angles: {:.1f} ± {:.1f} ms, {:.1f} mm, {:.1f} ± {:.1f} kN.", _of_31),
    Entry(RESULTS, "has it {:.1f} ± {:.1f} ms behind", _behind),
    Entry(
        RESULTS,
        "root-mean-square deviation {:.1f} ms or {:.1f} %",
        lambda: numbers("adams", "as published")[1::-1],
    ),
    # docs/results.md: the stand
    Entry(
        RESULTS,
        "{:.1f} ms with the sign of the table and",
        lambda: numbers("sense", "of the table")[:1],
    ),
    Entry(RESULTS, "and {:.1f} ms reversed (", lambda: numbers("sense", "reversed")[:1]),
    Entry(
        RESULTS,
        "({:.1f} and {:.1f} ms from 25 1/min up)",
        lambda: [numbers("sense", name)[1] for name in ("of the table", "reversed")],
    ),
    Entry(
        DIAGNOSIS,
        "operating points {:.0f} shifts in {:.0f} s of processor time, and the flights in "
        "{:.0f} s.",
        lambda: [
            numbers("unseen_clutch", "7 operating points,")[0],
            numbers("unseen_clutch", "shifts")[1],
            numbers("unseen_clutch", "flights")[1],
        ],
    ),
    Entry(
        DIAGNOSIS,
        "it lasted {:.0f} s instead of {:.0f};",
        lambda: numbers("unseen_clutch", "shifts")[:2],
    ),
    Entry(
        DIAGNOSIS,
        "the mean of {:.2f} ms differs by {:.3f} ± {:.3f} ms, with",
        lambda: numbers("bank_engines", f"{'linkage_compliance':<21}35")[:3],
    ),
    Entry(
        DIAGNOSIS,
        "of play by {:.3f} ± {:.3f} ms,",
        lambda: numbers("bank_engines", f"{'free_play':<21}2 ")[1:3],
    ),
    Entry(
        DIAGNOSIS,
        "without any effect by {:.3f} ± {:.3f} ms.",
        lambda: numbers("bank_engines", "none")[1:3],
    ),
    Entry(
        DIAGNOSIS,
        "by {:.3f} ± {:.3f} ms of {:.2f}.",
        lambda: [numbers("bank_engines", "drag_torque          8")[k] for k in (1, 2, 0)],
    ),
    Entry(RESULTS, "from the {:,.0f} simulated shifts", lambda: [bank_shifts()]),
    Entry(
        RESULTS,
        "root mean square | {:.0f} ms; scatter and numerics of the simulation make {:.0f} ms |",
        lambda: [MS * gap("stand")["gap"][k] for k in ("baseline_rmse_s", "floor_rmse_s")],
    ),
    Entry(
        RESULTS,
        "{:.0f} ms ({:.0f} to {:.0f}) beside a slow rise,",
        _stand(STAND_TOP, "delay_s", MS),
    ),
    Entry(RESULTS, "rise, {:.0f} to {:.0f} ms beside the other thirds", _other_delays),
    Entry(RESULTS, "| {:.1f} N m ({:.1f} to {:.1f}),", _stand(STAND_TOP, "drag_Nm")),
    Entry(RESULTS, "constant {:.2f} s ({:.2f} to {:.2f}):", _stand(STAND_TOP, "lag_s")),
    Entry(RESULTS, "end of its range, {:.2f} s, which is widened to {:.1f} s", _widened_lag),
    Entry(
        RESULTS,
        "Now {:.0f} ms are left there, and {:.0f} ms with the mass",
        lambda: [
            MS * gap("stand")["gap"][name] for name in ("heldout_rmse_s", "rival_heldout_rmse_s")
        ],
    ),
    Entry(RESULTS, "linkage, {:.1f} kg ({:.1f} to {:.1f}):", _stand(WITH_MASS, "added_mass_kg")),
    Entry(
        RESULTS,
        "): {:.0f} %; mass of actuator",
        lambda: _thirds()[:1],
    ),
    Entry(
        RESULTS,
        "): {:.0f} %; a detent: {:.0f} %; dry friction of the ring: {:.0f} % |",
        lambda: _thirds()[1:],
    ),
    Entry(
        RESULTS,
        "never saw | {:.0f} ms, where chance alone would leave {:.0f} ms; with the mass instead "
        "{:.0f} ms |",
        lambda: [
            MS * gap("stand")["gap"][name]
            for name in ("heldout_rmse_s", "leading_floor_rmse_s", "rival_heldout_rmse_s")
        ],
    ),
    Entry(
        RESULTS,
        "a slow rise of {:.0f} ms ({:.0f} to {:.0f}) or",
        _reversed("actuation_lag", "lag_s"),
    ),
    Entry(
        RESULTS,
        "or a dead time of {:.0f} ms ({:.0f} to {:.0f}) |",
        _reversed("actuation_delay", "delay_s"),
    ),
    Entry(RESULTS, "(p = {:.2f}).", lambda: [_hypothesis("stand", STAND_TOP)["predictive_p"]]),
    Entry(RESULTS, "slow rise ({:.0f} %), friction ({:.0f} %),", _given_compliance),
    Entry(RESULTS, "linkage of {:.1f} to {:.1f} mm/kN at the sleeve", _linkage),
    Entry(
        RESULTS,
        "takes {:.0f} ± {:.0f} ms and the prototype {:.0f} ± {:.0f} ms, a gain of {:.0f} %.",
        _price,
    ),
    Entry(RESULTS, "take {:.0f} to {:.0f} ms longer with them", _other_prices),
    Entry(
        RESULTS,
        "published simulation is {:.1f} ms off, where chance makes {:.0f} ms",
        lambda: [MS * gap("adams")["gap"][k] for k in ("baseline_rmse_s", "floor_rmse_s")],
    ),
    Entry(RESULTS, "oil damping of {:.0f} N s/m", _adams("viscous_damping", "damping_Ns_m")),
    Entry(RESULTS, "dry friction of {:.0f} N that", _adams("sleeve_friction", "friction_N")),
    # docs/results.md: the blind score
    *(Entry(RESULTS, text, _blind("blind_fine", label, first)) for label, first, text in FINE),
    Entry(
        "docs/planar.md",
        "0.3 mm/kN one shift of {:.1f} ms takes {:.1f} ms at 1e-6, {:.1f} ms at the set's own 1e-7 "
        "and {:.1f} ms at 1e-9",
        lambda: [
            numbers("linkage_steps", "adams2019, compliance 0.3 mm/kN", line)[4]
            for line in ("planar  1e-05", "drake   1e-06", "drake   1e-07", "drake   1e-09")
        ],
    ),
    # docs/commands.md and docs/model.md
    Entry(
        COMMANDS,
        "factor of {:.2f} in a small study with Drake, {:.2f} in one of the compiled engine, "
        "{:.2f} in a study of few designs most of which fail their screen, {:.2f} for the bank of "
        "an unknown clutch, {:.2f} in an expectation, {:.2f} in one to a wanted precision in "
        "two levels, and {:.2f} for the shifts of a surrogate",
        lambda: [
            numbers("forecasts", f"{name}:", "farthest from 1:")[0]
            for name in ("drake", "compiled", "screened", "gap", "expect", "precision", "fit")
        ],
    ),
    Entry(
        COMMANDS,
        "has {:.2f} of the best hypervolume known with {:d} shifts of Drake, Optuna's TPE, "
        "NSGA-II, GPSampler and quasi-random designs at most {:.2f}. With {:d} GPSampler has "
        "{:.2f}",
        _raced,
    ),
    Entry(
        MODEL,
        "40 designs | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            surrogate()["validation"]["q2"],
            MS * surrogate()["validation"]["rmse_s"],
            PERCENT * surrogate()["validation"]["coverage_95"],
        ],
    ),
    Entry(
        MODEL,
        "single operating point | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            surrogate()["validation"]["q2_points"],
            MS * surrogate()["validation"]["rmse_points_s"],
            PERCENT * surrogate()["validation"]["coverage_points"],
        ],
    ),
    Entry(
        RESULTS,
        "is {:.1f} ± {:.1f} ms with all limits, {:.1f} ± {:.1f} ms if a design may be slower at "
        "some points, and {:.1f} ± {:.1f} ms without any",
        lambda: [
            v
            for name in ("all limits", "slower at some points", "no limits")
            for v in numbers("question", "searched by", name)[5:7]
        ],
    ),
    *(
        Entry(RESULTS, template, partial(_asked, name))
        for name, template in {
            "mq200_paper, 19": "chosen (19) | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % pull-out force | {:.1f} % |",
            "mq200_paper, 43": "`mq200_paper`, 43 | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % slot width | {:.1f} % |",
            "mq200_paper, 6": "`mq200_paper`, 6 | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % pull-out force | {:.1f} % |",
            "mq200, chosen": "`mq200`, chosen | {:.1f} ± {:.1f} | {:.0f} % | {:.1f} "
            "| {:.1f} % contact ratio | {:.1f} % |",
        }.items()
    ),
    Entry(
        RESULTS,
        "| prototype | {:.1f} ± {:.1f} | | {:.1f} | {:.1f} % edge pressure | {:.1f} % |",
        lambda: [_asked("prototype")[k] for k in (0, 1, 3, 4, 5)],
    ),
    Entry(
        RESULTS,
        "(#the-default-study) | expected time; axial length | {:.1f} ± {:.1f} ms; {:.1f} mm "
        "| {:.1f} ± {:.1f} ms; {:.1f} mm |",
        lambda: [
            *_gearbox()[2:],
            _prototype("mq200")["axial_length_mm"],
            *_gearbox()[:2],
            result("mq200")["best"]["axial_length_mm"],
        ],
    ),
    Entry(
        RESULTS,
        "(#shift-control-searched-with-the-shape) | expected time; axial length "
        "| {:.1f} ± {:.1f} ms; {:.1f} mm | {:.1f} ± {:.1f} ms; {:.1f} mm |",
        lambda: [
            value
            for who, row in (
                ("prototype", _prototype(CONTROL)),
                ("best", result(CONTROL)["best"]),
            )
            for value in (
                *(MS * _study(CONTROL)[who][k] for k in ("expected_shift_time_s", STANDARD)),
                row["axial_length_mm"],
            )
        ],
    ),
    Entry(
        RESULTS,
        "aims at {:.0f} 1/min instead of {:.0f}, with {:.2f} times the force and {:.2f} times its",
        lambda: [
            result(CONTROL)["best"]["mismatch_set_rpm"],
            _prototype(CONTROL)["mismatch_set_rpm"],
            *(result(CONTROL)["best"][key] for key in ("force_factor", "rise_factor")),
        ],
    ),
    *(
        Entry(
            RESULTS,
            f"| {name} | {{:.1f}} ± {{:.1f}} ms | {{:.1f}} ± {{:.1f}} ms |",
            partial(_controlled, *rows),
        )
        for name, rows in {
            "prototype": ("prototype  ", "prototype, chosen control"),
            "chosen": ("chosen shape, own control", "chosen shape and control"),
        }.items()
    ),
    Entry(
        RESULTS,
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
        RESULTS,
        "rise take {:.1f}, {:.1f} and {:.1f} ms from the prototype, each",
        lambda: [
            _worth("prototype  ")[0] - _worth(f"prototype, {key}")[1]
            for key in ("mismatch_set_rpm", "force_factor", "rise_factor")
        ],
    ),
    Entry(
        RESULTS,
        "makes its mean blow {:.2f} N s",
        lambda: _worth("prototype, mismatch_set_rpm")[3:4],
    ),
    *(
        Entry(RESULTS, sentence, partial(_blows, *rows))
        for sentence, rows in {
            "own control has {:.2f} N s.": ("chosen shape, own control",),
            "Together they have {:.2f} N s, the prototype {:.2f} N s.": (
                "chosen shape and control",
                "prototype  ",
            ),
        }.items()
    ),
    Entry(
        RESULTS,
        "sampler searched it, {:.0f} designs and {:.0f} shifts",
        lambda: [len(result(CONTROL)["trials"]), result(CONTROL)["n_simulated_shifts"]],
    ),
    Entry(
        RESULTS,
        "takes {:.1f} µm from the crest of the chosen design of `mq200_paper` at a wear rate of "
        "1e-6 mm³/(N m), and {:.0f} µm at 1e-5: it slows from {:.1f} ± {:.1f} to "
        "{:.1f} ± {:.1f} ms",
        lambda: [
            _aged("chosen, rate 1e-6 mm3/(N m), 100 %:")[0],
            _aged("chosen, rate 1e-5 mm3/(N m), 100 %:")[0],
            *_aged("chosen, rate 1e-5 mm3/(N m), 0 %:")[2:4],
            *_aged("chosen, rate 1e-5 mm3/(N m), 100 %:")[2:4],
        ],
    ),
    Entry(
        RESULTS,
        "{:.1f}° of its {:.1f}° are left. It then takes {:.1f} ± {:.1f} ms, and its edges bear "
        "{:.1f} % more than they may in the landing; the prototype takes {:.1f} ± {:.1f} ms, and "
        "by {:.1f} %",
        lambda: [
            _aged("chosen, crest 0.1 mm, 100 %:")[1],
            _aged("chosen, crest 0.1 mm, 0 %:")[1],
            *_aged("chosen, crest 0.1 mm, 100 %:")[2:4],
            -_aged("chosen, crest 0.1 mm, 100 %:")[5],
            *_aged("prototype, crest 0.1 mm, 100 %:")[2:4],
            -_aged("prototype, crest 0.1 mm, 100 %:")[5],
        ],
    ),
    # docs/search.md
    *(
        Entry(
            "docs/search.md",
            f"| `{name}` | {{:d}}, {{:d}} | {{:d}}, {{:d}} | {{:.1f}}, {{:.1f}} |",
            lambda name=name: _replication(name),
        )  # type: ignore[misc]
        for name in ("mq200", "mq200_paper", "mq200_robust", "mq200_three")
    ),
    Entry(
        "docs/search.md",
        "In `mq200` {:d} of {:d} designs passed their screen. The search took {:d} shifts of Drake "
        "and {:d} compiled ones, replication {:d} and {:d} more, all with confirmation {:d} of "
        "Drake. Expected wrongly on or off the front are {:.1f} designs, {:.1f} before "
        "replication.",
        lambda: _both_levels("mq200"),
    ),
    *(
        Entry(
            "docs/search.md",
            f"| {name} | {{:.2f}} ({{:.2f}} to {{:.2f}}) | {{:.2f}} ({{:.2f}} to {{:.2f}}) | "
            "{:.2f} ({:.2f} to {:.2f}) | {:.2f} ({:.2f} to {:.2f}) | {:.0f} |",
            lambda name=name: _shares(name),
        )  # type: ignore[misc]
        for name in (*OPTUNAS, OWN_LEVELS, "TPE, two levels")
    ),
    Entry(
        "docs/search.md",
        "times of Drake are {:.2f} ± {:.2f} % above those of the compiled engine, in the mean",
        lambda: numbers("samplers", "times of Drake less")[1:3],
    ),
    # docs/surrogate.md
    Entry(
        SURROGATE,
        "A cold start takes {:.2f} s of processor time, and {:.2f} s where",
        lambda: [numbers("asking", f"one design, {kept}:")[3] for kept in ("nothing kept", "kept")],
    ),
    Entry(
        SURROGATE,
        "the whole answer takes {:.1f} s, of which the closed-form checks take {:.2f} s",
        lambda: [
            numbers("asking", "100000 designs:")[3],
            numbers("asking", "their closed-form checks alone:")[0],
        ],
    ),
    Entry(
        SURROGATE,
        "one after the other, in {:.0f} s. Without a surrogate the compiled engine simulates a "
        "design in {:.1f} s",
        lambda: [
            numbers("asking", "one after the other, as for a limit of one's own:")[0],
            numbers("asking", "one design by the compiled engine:")[3],
        ],
    ),
    *(
        Entry(
            SURROGATE,
            f"| {form} | {{:.3f}} | {{:.3f}} | {{:.0f}} % |",
            lambda place=place: [  # type: ignore[misc]
                surrogate()["comparison"][place]["log_density"],
                surrogate()["comparison"][place]["log_rmse"],
                PERCENT * surrogate()["comparison"][place]["coverage_95"],
            ],
        )
        for place, form in enumerate(
            (
                "point, smooth, growing steps, growing rough, ridge",
                "smooth, growing rough",
                "smooth, growing steps, growing rough",
                "point, smooth, growing steps, growing rough",
                "smooth, rough",
                "smooth",
            )
        )
    ),
    Entry(
        SURROGATE,
        "standard error {:.1f} ms) | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            MS * surrogate()["validation"]["noise_s"],
            surrogate()["validation"]["q2"],
            MS * surrogate()["validation"]["rmse_s"],
            PERCENT * surrogate()["validation"]["coverage_95"],
        ],
    ),
    Entry(
        SURROGATE,
        "at single operating points | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            surrogate()["validation"]["q2_points"],
            MS * surrogate()["validation"]["rmse_points_s"],
            PERCENT * surrogate()["validation"]["coverage_points"],
        ],
    ),
    Entry(
        SURROGATE,
        "{:d} of their shifts did not engage, where {:.0f} were expected",
        lambda: [surrogate()["validation"]["lost"], surrogate()["validation"]["lost_expected"]],
    ),
    Entry(
        SURROGATE,
        "rank correlation is {:.2f} (0.9",
        lambda: [surrogate()["validation"]["rank_best"]],
    ),
    # docs/proof.md
    Entry(
        "docs/proof.md",
        "means is {:.2f} %, the median error",
        lambda: numbers("convergence", "largest error of a mean, %")[3:4],
    ),
    Entry(
        "docs/proof.md",
        "of a single shift {:.4f} %",
        lambda: numbers("convergence", "median error of a shift, %")[3:4],
    ),
    Entry(
        "docs/proof.md",
        "in the accuracy is {:.1f};",
        lambda: numbers(
            "convergence", "observed order of the median error in the accuracy, 3e-3 to 1e-4:"
        ),
    ),
    Entry(
        "docs/proof.md",
        "at 1e-2 a design loses {:.0f} %.",
        lambda: numbers("convergence", "largest error of a mean, %")[:1],
    ),
    Entry(
        "docs/proof.md",
        "Adams table is {:.1f} %.",
        lambda: numbers("adams", "as published")[:1],
    ),
    Entry(
        "docs/proof.md",
        "the median is {:.3f} % and the worst of these shifts {:.2f} % off; "
        "1e-2 costs {:.2f} as much with {:.2f} % and {:.0f} %",
        lambda: [
            *numbers("work_precision", "Drake rk3                     3e-04")[3:5],
            *(
                numbers("work_precision", "Drake rk3                     1e-02")[k]
                for k in (1, 3, 4)
            ),
        ],
    ),
    Entry(
        "docs/proof.md",
        "All dogs cost {:.1f} times one dog",
        lambda: numbers("work_precision", "Drake rk3, all dogs           3e-04")[1:2],
    ),
    Entry(
        "docs/proof.md",
        "({:.2f} of the default's cost)",
        lambda: numbers("work_precision", "MuJoCo                        20 us")[1:2],
    ),
    Entry(
        "docs/proof.md",
        "At 0.1 % it costs {:.2f},",
        lambda: numbers("work_precision", "MuJoCo                         5 us")[1:2],
    ),
    # docs/blind.md
    Entry(
        "docs/blind.md",
        "they are {:.2f} apart (root mean square)",
        lambda: numbers("blind_engines", "root mean square:")[:1],
    ),
    Entry(
        "docs/blind.md",
        "of the list {:.0f} % as far as data can show it, {:.0f} % of what",
        lambda: [
            PERCENT * numbers("blind_fine", "of them with effects of the list (60)")[6],
            PERCENT
            * numbers("blind_fine", "of the list: what is named is all that can be seen")[0],
        ],
    ),
    Entry(
        "docs/blind.md", "miss by {:.2f} errors,", lambda: numbers("blind_rest", "all cases:")[:1]
    ),
    Entry(
        "docs/blind.md",
        "and by {:.1f} % of the mean time",
        lambda: numbers("blind_rest", "all cases:", "")[:1],
    ),
    Entry(
        "docs/blind.md",
        "(median; {:.1f} % root mean square)",
        lambda: numbers("blind_rest", "all cases:")[1:2],
    ),
    *(
        Entry("docs/blind.md", text, _wide(label))
        for label, text in (
            ("none said: the true gap is within the margin", f"within the margin in {_SPAN},"),
            ("true gap within the margin: none said", f"within it in {_SPAN}. No"),
            ("all cases: all that is named is a cause", f"true in {_SPAN} of 33 cases"),
            ("kind single: an effect named", f"anywhere in its prior in {_SPAN},"),
            ("all cases: right   ", f"the truth leads in {_SPAN} of all"),
            ("pairs: both causes found", f"both are found in {_SPAN},"),
            ("all cases: named exactly, of what is named", f"the whole truth in {_SPAN} only"),
        )
    ),
    Entry(
        "docs/blind.md",
        "the largest is {:.2f} margins",
        lambda: numbers("blind_wide", "largest true gap where none is said:"),
    ),
    # docs/planar.md
    Entry(
        PLANAR,
        "it takes 1/{:.0f} of Drake's processor time",
        lambda: numbers("engines", "all")[-1:],
    ),
    Entry(PLANAR, "has {:.0f} single shifts", lambda: numbers("engines", "all")[:1]),
    Entry(
        PLANAR,
        "The outcome is the same in {:.2f} %. The time of a shift differs by {:.3f} % (median), "
        "its peak force by {:.2f} % and its landing load by {:.2f} %; the mean of eight angles by "
        "{:.3f} %",
        lambda: [numbers("engines", "all")[k] for k in (1, 2, 7, 8, 6)],
    ),
    *(
        Entry(
            PLANAR,
            f"| {speed} 1/min | {{:.3f}} % | {{:.2f}} % | {{:.2f}} % |",
            partial(_deviations, f"{speed} "),
        )
        for speed in (5, 50, 100, 149, 249)
    ),
    Entry(
        PLANAR,
        "With the design set the median is at most {:.3f} %",
        lambda: [
            max(
                numbers("engines", f"{size}, lubricated_steel", "504")[1]
                for size in ("prototype", "small", "large")
            )
        ],
    ),
    Entry(
        PLANAR,
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
        PLANAR,
        "Of {:.0f} shifts that differ",
        lambda: numbers("engines", "what happens", "shifts that differ")[2:3],
    ),
    Entry(
        PLANAR,
        "its own default by more than that in {:.0f} %",
        lambda: numbers("engines", "Drake against itself")[1:],
    ),
    Entry(
        PLANAR,
        "leaves its own in {:.0f} %",
        lambda: numbers("engines", "compiled engine against itself")[1:],
    ),
    Entry(
        PLANAR,
        "Drake with finer steps, {:.0f} % of them no",
        lambda: [100.0 - numbers("engines", "compiled engine against Drake with finer steps")[1]],
    ),
    Entry(
        PLANAR,
        "differ by less than {:.2f} % in nine of ten",
        lambda: numbers("second_engine", "Three engines", "Drake, compiled")[2:3],
    ),
    Entry(
        PLANAR,
        "These differ by up to {:.2f} ms",
        lambda: [max(abs(numbers("engine_effects", name)[2]) for name in SMALL_EFFECTS)],
    ),
    Entry(
        PLANAR,
        "within {:.1f} % of the move, but for three",
        lambda: [
            max(
                numbers("engine_effects", name)[3]
                for name in (
                    "actuation_lag",
                    "contact_friction",
                    "contact_stiffness",
                    "drag_torque",
                    "free_play",
                    "linkage_compliance",
                    "moving_mass",
                    "reversed_mismatch",
                    "sleeve_friction",
                    "viscous_damping",
                )
            )
        ],
    ),
    Entry(
        PLANAR,
        "takes {:.0f} shifts of Drake and {:.0f} of this engine, {:.1f} s of processor time; one "
        "level takes {:.0f} shifts and {:.1f} s, which is {:.1f} times as much",
        lambda: [
            *numbers("expectation", "expect --precision 0.01, two levels:")[2:5],
            *(numbers("expectation", "expect --precision 0.01, one level:")[k] for k in (2, 4)),
            *numbers("expectation", "two levels take 1/"),
        ],
    ),
    Entry(
        PLANAR,
        "hold Drake's mean of 96 angles at {:.1f} % of the operating points and in {:.1f} % of the "
        "runs; without the retries at {:.1f} % and in {:.1f} %. One level: {:.1f} % and {:.1f} %, "
        "without the retries {:.1f} % and {:.1f} %",
        lambda: [
            number
            for level in ("two levels:", "one level:")
            for row in ("with retries:", "without:")
            for number in numbers("expectation", level, row)
        ],
    ),
    Entry(
        PLANAR,
        "one of the {:.0f} shifts does not engage. Its retry moves the mean by {:.2f} ms",
        lambda: [
            numbers("expectation", "of ")[0],
            numbers("expectation", "expected shift time")[0]
            - numbers("expectation", "expected shift time")[1],
        ],
    ),
]
