"""List the published figures of docs/results.md on the stand."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks.entries import Entry
from benchmarks.kept import bank_shifts, gap, numbers
from benchmarks.published.sources import (
    MS,
    PERCENT,
    STAND_TOP,
    hypothesis,
    interval,
    on_stand,
)

PAGE = "docs/results.md"


WITH_RISE = ("actuation_delay", "actuation_lag", "drag_torque")


def _reversed(effect: str, name: str) -> Callable[[], Sequence[float]]:
    """Give a time of an effect beside drag, were the sense of rotation reversed, in ms."""
    effects = sorted(("drag_torque", effect))

    def values() -> Sequence[float]:
        found = next(one for one in gap("stand")["senses"] if one["reversed"])
        mine = next(h for h in found["hypotheses"] if h["effects"] == effects)
        return interval(mine, name, MS)

    return values


def _thirds() -> list[float]:
    """Give probabilities of mass, damping, friction, lag and detent as the third, percent."""
    names = (
        "moving_mass", "viscous_damping", "sleeve_friction", "actuation_lag", "detent_force"
    )  # fmt: skip
    return [PERCENT * gap("stand")["inclusion"][name] for name in names]


def _other_delays() -> list[float]:
    """Give the least and the largest mean dead time beside the other thirds, in ms."""
    thirds = ("actuation_lag", "viscous_damping", "detent_force", "sleeve_friction")
    each = [sorted(("actuation_delay", "drag_torque", third)) for third in thirds]
    means = [MS * hypothesis("stand", one)["parameters"]["delay_s"]["mean"] for one in each]
    return [min(means), max(means)]


def _given_compliance() -> list[float]:
    """Give the probabilities of thirds with the linkage in the simulation, percent."""
    rows = gap("stand")["sensitivity"]["given_compliance_mm_kN"]
    names = ("sleeve_friction", "moving_mass", "actuation_lag", "viscous_damping")
    return [PERCENT * sum(r["probability"] for r in rows if n in r["effects"]) for n in names]


def _linkage() -> list[float]:
    """Give the compliance of the linkage at the sleeve by the static readings, mm/kN."""
    found = next(f for f in gap("stand")["facts"] if f["parameter"] == "compliance_mm_kN")
    return [found["low"], found["high"]]


def _widened_mass() -> list[float]:
    """Give the end of the range of the mass, and that after widening, kg."""
    found = next(one for one in gap("stand")["range_ends"] if one["parameter"] == "added_mass_kg")
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
    return lambda: [hypothesis("adams", [effect])["parameters"][name]["mean"]]


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "{:.1f} ms with the sign of the table and",
        lambda: numbers("sense", "of the table")[:1],
    ),
    Entry(PAGE, "and {:.1f} ms reversed (", lambda: numbers("sense", "reversed")[:1]),
    Entry(
        PAGE,
        "({:.1f} and {:.1f} ms from 25 1/min up)",
        lambda: [numbers("sense", name)[1] for name in ("of the table", "reversed")],
    ),
    Entry(PAGE, "from the {:,.0f} simulated shifts", lambda: [bank_shifts()]),
    Entry(
        PAGE,
        "root mean square | {:.0f} ms; scatter and numerics of the simulation make {:.0f} ms |",
        lambda: [MS * gap("stand")["gap"][k] for k in ("baseline_rmse_s", "floor_rmse_s")],
    ),
    Entry(
        PAGE,
        "{:.0f} ms ({:.0f} to {:.0f}) beside a mass,",
        on_stand(STAND_TOP, "delay_s", MS),
    ),
    Entry(PAGE, "mass, {:.0f} to {:.0f} ms beside the other thirds", _other_delays),
    Entry(PAGE, "| {:.1f} N m ({:.1f} to {:.1f}),", on_stand(STAND_TOP, "drag_Nm")),
    Entry(PAGE, "constant {:.2f} s ({:.2f} to {:.2f}):", on_stand(WITH_RISE, "lag_s")),
    Entry(PAGE, "end of its range, {:.0f} kg, which is widened to {:.0f} kg", _widened_mass),
    Entry(
        PAGE,
        "where nothing was fitted, {:.0f} ms with the mass and {:.0f} ms with the damping",
        lambda: [
            MS * gap("stand")["gap"][name] for name in ("heldout_rmse_s", "rival_heldout_rmse_s")
        ],
    ),
    Entry(PAGE, "linkage, {:.1f} kg ({:.1f} to {:.1f}):", on_stand(STAND_TOP, "added_mass_kg")),
    Entry(
        PAGE,
        "): {:.0f} %; oil damping: {:.0f} %; dry friction of the ring: {:.0f} %; a force that",
        lambda: _thirds()[:3],
    ),
    Entry(PAGE, "): {:.0f} %; a detent: {:.0f} % |", lambda: _thirds()[3:]),
    Entry(
        PAGE,
        "never saw | {:.0f} ms, where chance alone would leave {:.0f} ms; with damping instead "
        "{:.0f} ms |",
        lambda: [
            MS * gap("stand")["gap"][name]
            for name in ("heldout_rmse_s", "leading_floor_rmse_s", "rival_heldout_rmse_s")
        ],
    ),
    Entry(
        PAGE,
        "a slow rise of {:.0f} ms ({:.0f} to {:.0f}) or",
        _reversed("actuation_lag", "lag_s"),
    ),
    Entry(
        PAGE,
        "or a dead time of {:.0f} ms ({:.0f} to {:.0f}) |",
        _reversed("actuation_delay", "delay_s"),
    ),
    Entry(PAGE, "(p = {:.2f}).", lambda: [hypothesis("stand", STAND_TOP)["predictive_p"]]),
    Entry(
        PAGE,
        "is then friction ({:.0f} %), mass ({:.0f} %), a slow rise ({:.0f} %) or damping "
        "({:.0f} %)",
        _given_compliance,
    ),
    Entry(PAGE, "linkage of {:.1f} to {:.1f} mm/kN at the sleeve", _linkage),
    Entry(
        PAGE,
        "takes {:.0f} ± {:.0f} ms and the prototype {:.0f} ± {:.0f} ms, a gain of {:.0f} %.",
        _price,
    ),
    Entry(PAGE, "take {:.0f} to {:.0f} ms longer with them", _other_prices),
    Entry(
        PAGE,
        "of each, with the mass by {:.0f} % and more",
        lambda: [
            PERCENT
            * min(one["with_landing_margin"] for one in gap("stand")["so_what"]["candidates"])
        ],
    ),
    Entry(
        PAGE,
        "published simulation is {:.1f} ms off, where chance makes {:.0f} ms",
        lambda: [MS * gap("adams")["gap"][k] for k in ("baseline_rmse_s", "floor_rmse_s")],
    ),
    Entry(
        PAGE,
        "No effect leads ({:.0f} %) before friction",
        lambda: [PERCENT * gap("adams")["hypotheses"][0]["probability"]],
    ),
    Entry(PAGE, "oil damping of {:.0f} N s/m", _adams("viscous_damping", "damping_Ns_m")),
    Entry(PAGE, "dry friction of {:.0f} N that", _adams("sleeve_friction", "friction_N")),
]
