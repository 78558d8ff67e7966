"""Give what several pages publish: numbers of kept results and of docs/evidence."""

from __future__ import annotations

import re
from typing import Any

from benchmarks.kept import gap, numbers, result, trial

MS = 1e3
PERCENT = 100.0


def confirmed(name: str) -> Any:
    """Give the confirmation in the kept result of a study."""
    return result(name)["confirmation"]


#: Samplers of Optuna's, alone with Drake, in benchmarks/samplers.py, and this project's there.
OPTUNAS, OWN_LEVELS = ("TPE", "NSGA-II", "GPSampler", "quasi-random"), "own, two levels"


def shares(name: str) -> list[float]:
    """Give a sampler's shares of the hypervolume, three for each column, and its seeds."""
    return numbers("samplers", "share of the reference front", name)


def _found(name: str, place: int) -> float:
    return shares(name)[place]


def raced() -> list[float]:
    """Give what the search in two levels has at few shifts, and the others at few and at all."""
    few = max(_found(name, 0) for name in OPTUNAS)
    return [_found(OWN_LEVELS, 0), 230, few, 1152, _found("GPSampler", 3)]


#: Clutches of ``benchmarks/two_fidelities.py`` as docs/surrogate.md names them.
CLUTCHES = {"prototype": "prototype", "small": "small, 40 mm", "large": "large, 92 mm"}


def study_name(clutch: str) -> str:
    """Give the name of a clutch's study in two_fidelities.txt."""
    return f"two_fidelities-{clutch}"


def fitted(clutch: str, row: str) -> list[float]:
    """Give what references say of a fit in two levels: rmse, bias, Q2 and so on."""
    return numbers("two_fidelities", study_name(clutch), row)


def most_designs(clutch: str) -> str:
    """Give the row of all designs of a clutch at its own operating points."""
    return f"all points{301 if clutch == 'prototype' else 800:>11}"


def clutch_row(clutch: str) -> list[float]:
    """Give the row of docs/surrogate.md on a clutch."""
    rmse, bias, q2, inside, points, inside_points, rank, _ = fitted(clutch, most_designs(clutch))
    return [q2, rmse, bias, inside, points, inside_points, rank]


def prototype(name: str) -> Any:
    """Give the prototype, with which the search of a study begins."""
    return result(name)["trials"][0]


def slower() -> list[float]:
    """Give by how much the chosen design is slower where it is, in ms, least first."""
    both = confirmed("mq200_paper")
    pairs = zip(both["prototype"]["points"], both["best"]["points"], strict=True)
    return sorted(MS * (b["mean_s"] - a["mean_s"]) for a, b in pairs if b["mean_s"] > a["mean_s"])


def confirmation(name: str) -> list[float]:
    """Count the designs that were confirmed, those that failed, and those of the front."""
    designs = confirmed(name)["designs"]
    failed = sum(not all(check["passed"] for check in one["checks"]) for one in designs)
    return [len(designs), failed, len(result(name)["front"])]


def gain(name: str) -> list[float]:
    """Give gain, error and percent of the chosen design under one of the contact sets."""
    return numbers("contact_sets", name, "chosen")[-3:]


SPAN = "{:.0f} % ({:.0f} to {:.0f})"


def size(effect: str, name: str, scale: float = 1.0) -> list[float]:
    """Give mean and 90 % of a size on the stand over all plausible hypotheses."""
    found = gap("stand")["sizes"][effect][name]
    return [scale * found[end] for end in ("mean", "low", "high")]


def included(*effects: str) -> list[float]:
    """Give the probabilities that effects are part of the stand's cause, percent."""
    return [PERCENT * gap("stand")["inclusion"][name] for name in effects]


def unknown() -> float:
    """Give the probability that the stand's cause is not on the list, percent."""
    rows = gap("stand")["hypotheses"]
    return sum(PERCENT * h["probability"] for h in rows if h["effects"] == ["unknown"])


def _of_summary(pattern: str) -> float:
    """Give a number of the paragraph on the stand.

    Raises
    ------
    LookupError : the paragraph has no such words.
    """
    found = re.search(pattern, gap("stand")["summary"])
    if found is None:
        raise LookupError(f"the paragraph on the stand has no {pattern!r}")
    return float(found[1])


def explained_at_rest() -> float:
    """Give what the elasticity of the linkage as read at rest explains, ms."""
    return _of_summary(r"elastic linkage \([\d.]+ mm/kN\) explains ([\d.]+) ms")


def times_ordinary_drag() -> float:
    """Give the stand's drag in multiples of that of bearings and seals."""
    return _of_summary(r"Drag of [\d.]+ N m is ([\d.]+) times")


def gearbox() -> list[float]:
    """Give the time of the gearbox study's choice and of the prototype with their errors, ms."""
    return [
        MS * confirmed("mq200")[who][key]
        for who in ("best", "prototype")
        for key in ("expected_shift_time_s", "standard_error_s")
    ]


def searched(name: str, number: int) -> Any:
    """Give a design of a study as its search has it."""
    return next(row for row in result(name)["trials"] if row["trial"] == number)


def confirmed_design(number: int) -> list[float]:
    """Give time and error at new angles, ms, and length, mm, of a design of the paper's study."""
    found = trial("mq200_paper", number)
    length = searched("mq200_paper", number)["axial_length_mm"]
    return [MS * found["expected_shift_time_s"], MS * found["standard_error_s"], length]


def best_design() -> Any:
    """Give the design that was chosen as the paper asks."""
    return result("mq200_paper")["best"]
