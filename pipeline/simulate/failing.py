"""Checks that designs fail: how many fail each, by how much the nearest does, and what helps.

Designs that fill the search ranges, and some about the one with the largest smallest margin, are
checked by the closed forms. At the nearest design each variable moves alone, beyond its range too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import WORST, Design, design_of, margins_kept
from dogshape.sim.units import suffix_of

FILLING, ABOUT = 9, 64  #: power of two of designs that fill the ranges, and designs of a round
NEAR = (0.1, 0.05, 0.02, 0.01)  #: shares of the ranges about the nearest, one for each round
STEP = 0.05  #: share of its range by which a variable moves
MOST = 3  #: checks that are named
COUNTS = 0.001  #: margin that a variable must gain to be named

Margins = Mapping[str, float]


def failing_words(margins: Sequence[Margins]) -> str:
    """Count the designs that fail each check, with the nearest of them; empty where none fails."""
    failing = Counter(name for row in margins for name, margin in row.items() if margin < 0.0)
    said = []
    for name, count in failing.most_common(MOST):
        short = -max(row[name] for row in margins if row.get(name, 0.0) < 0.0)
        said.append(f"{count} of {len(margins)} fail {_words(name)}, the nearest of them by "
                    f"{_percent(short)}")  # fmt: skip
    return "; ".join(said)


def none_passes(study: Setup, whose: str) -> str:
    """Explain why no design of a study passes its closed-form checks, and what would help.

    ``whose`` begins the sentence, such as *none of 80000 designs*.
    """
    made = _designs(study)
    said = [f"{whose} passes every check"]
    if not made:
        return f"{said[0]}: no dog has such a shape; widen [variables]"
    worst = " with tolerances at their worst" if WORST in (study.file.search.limits or {}) else ""
    said[0] += f"{worst}. Of those that fill the ranges {failing_words([m for _, m in made])}"
    nearest, margins = max(made, key=_least)
    name = min(margins, key=lambda one: margins[one])
    at = ", ".join(f"{key} {value:.4g}" for key, value in nearest.params.items())
    if margins[name] >= 0.0:
        return f"{said[0]}. One passes ({at}): narrow [variables] about it"
    said.append(f"Nearest is {at}: {_words(name)} fails by {_percent(-margins[name])}")
    said.append(_helping(study, nearest.params, name, margins[name]))
    own = margins_kept(study, design_of(study, {})).get(name, 0.0)
    if own < 0.0:
        said.append(f"The study's own dog fails it too, by {_percent(-own)}")
    key = next(check.rule.key for check in nearest.checks if check.name == name)
    return f"{'. '.join(said)}. Widen [variables], or change {key}"


def _least(one: tuple[Design, Margins]) -> float:
    return min(one[1].values())


def _helping(study: Setup, params: dict[str, float], check: str, margin: float) -> str:
    """Name the variable that moves the margin of a check most at a design."""
    found = []
    for name, (low, high) in study.variables.items():
        step = max(1.0, round(STEP * (high - low))) if name == "count" else STEP * (high - low)
        for value in (params[name] + step, params[name] - step):
            margins = _margins(study, params | {name: value})[1]
            if check in margins:
                found.append((margins[check], name, value, not low <= value <= high))
    best = max(found, default=None)
    if best is None or best[0] < margin + COUNTS:
        return "No variable moves that margin"
    moved, name, value, beyond = best
    where = ", beyond its range," if beyond else ""
    return (
        f"{name} moves that most: {value:.4g} instead of {params[name]:.4g}{where} makes its "
        f"margin {_percent(moved)}"
    )


def _designs(study: Setup) -> list[tuple[Design, Margins]]:
    """Check dogs that fill the ranges, and rounds of them about the nearest."""
    bounds = np.array(list(study.variables.values()), dtype=float)
    rng = np.random.default_rng(study.file.search.seed)
    shares = qmc.Sobol(len(bounds), seed=rng).random_base2(FILLING)
    found = [_margins(study, _params(study, bounds, row)) for row in shares]
    for near in NEAR:
        if not (made := [one for one in found if one[1]]):
            break
        best = max(made, key=_least)[0].params
        middle = np.array([best[name] for name in study.variables]) - bounds[:, 0]
        about = middle / np.ptp(bounds, axis=1) + rng.normal(0.0, near, (ABOUT, len(bounds)))
        found += [_margins(study, _params(study, bounds, np.clip(row, 0, 1))) for row in about]
    return [one for one in found if one[1]]


def _params(study: Setup, bounds: np.ndarray, shares: np.ndarray) -> dict[str, float]:
    values = bounds[:, 0] + shares * np.ptp(bounds, axis=1)
    pairs = zip(study.variables, values.tolist(), strict=True)
    return {name: round(value) if name == "count" else value for name, value in pairs}


def _margins(study: Setup, params: dict[str, float]) -> tuple[Design, Margins]:
    """Work out a design and its margins; none of what is no dog."""
    design = design_of(study, params)
    return design, margins_kept(study, design)


def _words(name: str) -> str:
    return name.removesuffix(suffix_of(name)).replace("_", " ")


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"
