"""Cases of a field set: two engines of truths, three clutches, and data as a stand gives them.

Kinds and numbers of cases are fixed by engine (``COUNTS``); clutch, contact, operating points,
numbers of shifts, effects, strengths and form are drawn; true force and mismatch are off the
nominal ones by some percent. Of some kinds several candidates are drawn on the same operating
points, of which the first one that is clear by the yardstick is kept (``DRAWS``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np

from dogshape.validation.blind.stand import Point, Truth
from dogshape.validation.blind.true_effects import RANGES, Values, contact_of, truth_of, values_of

Kind = Literal["none", "single", "pair", "three", "outside"]
Form = Literal["means", "singles", "traces"]

#: Clutches by name: folders of the bundled data.
CLUTCHES = {"prototype": "bench/mq200_adams", "large": "blind/large", "hub": "blind/hub"}
SEED = 7042  #: of the draws, unless another is given
#: Cases by engine and kind; those outside the list by name.
COUNTS: dict[str, dict[str, int]] = {
    "planar": {"none": 24, "single": 36, "pair": 16, "three": 4},
    "mujoco": {"none": 8, "single": 8, "pair": 4, "three": 0},
}
OUTSIDE: dict[str, dict[str, int]] = {
    "planar": {"sticking_valve": 6, "hanging_valve": 6, "swapped_forces": 10, "swapped_speeds": 14},
    "mujoco": {
        "sticking_valve": 2, "hanging_valve": 2, "swapped_speeds": 4, "speed_ripple": 2,
        "high_dog": 4, "two_stages": 2,
    },
}  # fmt: skip
#: Cases of each engine in a small set, on the first clutch.
SMALL = {"none": 1, "single": 1, "pair": 1}
#: Candidates of a case by engine and kind, where there are several.
DRAWS: dict[str, dict[str, int]] = {
    "planar": {"single": 10, "pair": 6, "outside": 8},
    "mujoco": {"single": 4, "outside": 3},
}
COMMON = ("actuation_delay", "sleeve_friction")  #: likely in every bench
WITH_COMMON = 0.4  #: share of pairs and threes with one of them
POINTS = (12, 28)  #: operating points of a case, at least and at most
NUMBERS = (3, 20)  #: shifts of an operating point, even in the logarithm
FEW = (3, 5)  #: the same of a case with traces
FORCE_ERRORS, SPEED_ERRORS = (0.01, 0.03), (0.01, 0.02)  #: standard deviations, least and most
SHUFFLED = 0.5  #: share of series of single shifts that were made in random order
MEANS, TRACES = 0.6, 0.05  #: shares of cases with means only, and with traces
SPREADS = 0.5  #: share of cases with means only that have standard deviations
UNLABELLED = 0.25  #: share of records that leave a convention unknown
LEAST = 0.6  #: least strength of an effect
STRENGTHS = (0.7, 1.0)  #: of anything outside the list
DRIFTING, DRIFTS = 0.5, (0.02, 0.1)  #: share of series of single shifts whose force falls, and how
#: Outside the list, seen by the spread of single shifts.
BY_SINGLES = ("sticking_valve", "hanging_valve", "speed_ripple", "high_dog", "two_stages")


@dataclass(frozen=True)
class Case:
    """One case: its truth, the form of its data, its engine, its clutch and its test series.

    ``parameters`` are values by effect of the list, ``outside`` strengths of unlisted things,
    ``contact`` fields of the truth that are no cause. ``places`` and ``numbers`` are operating
    points among those of the clutch and shifts at each; ``force_error`` and ``speed_error`` the
    standard deviations of true over nominal values. ``shuffled`` shifts were made in random order;
    ``spreads`` if a table of means has standard deviations. ``sensor`` is the side of the linkage
    that is read; ``displacement_at`` and ``time_zero`` are conventions as they are stated.
    """

    kind: Kind
    form: Form
    engine: str
    stand: str
    seed: int
    parameters: dict[str, Values] = field(default_factory=dict)
    outside: dict[str, float] = field(default_factory=dict)
    contact: dict[str, float] = field(default_factory=dict)
    places: tuple[int, ...] = ()
    numbers: tuple[int, ...] = ()
    force_error: float = 0.0
    speed_error: float = 0.0
    shuffled: bool = False
    spreads: bool = False
    sensor: str = "sleeve"
    displacement_at: str = "sleeve"
    time_zero: str = "command"

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects of the list, in alphabetical order; unknown for one outside."""
        return ("unknown",) if self.outside else tuple(sorted(self.parameters))

    @property
    def truth(self) -> Truth:
        """Truth of the stand."""
        return truth_of(self.parameters, self.outside, self.contact, self.sensor)

    @property
    def plain(self) -> Truth:
        """Truth of the stand without any cause, with its contact."""
        return truth_of({}, {}, self.contact, self.sensor)

    def record(self) -> dict[str, Any]:
        """Write the entry of the key."""
        return asdict(self) | {"causes": list(self.causes)}


def case_of(record: Mapping[str, Any]) -> Case:
    """Read the entry of a key."""
    values = {name: record[name] for name in Case.__dataclass_fields__}
    return Case(**values | {name: tuple(values[name]) for name in ("places", "numbers")})


def field_cases(
    grids: Mapping[str, Sequence[Point]], seed: int | None = None, *, small: bool = False
) -> tuple[tuple[Case, ...], ...]:
    """Draw the cases of a field set in shuffled order, each as its candidates.

    ``grids`` are the operating points of each clutch; ``small`` a case of each kind and engine.
    """
    generator = np.random.default_rng(SEED if seed is None else seed)
    found = []
    for engine, counts in COUNTS.items():
        order = generator.permutation(list(grids)).tolist()
        wanted: list[tuple[Kind, str]] = _wanted(generator, engine, SMALL if small else counts)
        for k, (kind, name) in enumerate(wanted):
            # Each clutch has a third of each kind, since kinds stand in blocks.
            stand = order[k % len(order)]
            blank = Case(kind, "singles", engine, stand, 0)
            first = _drawn(generator, blank, name, grids[stand])
            many = 1 if small else DRAWS.get(engine, {}).get(kind, 1)
            more = [_again(generator, first, name) for _ in range(many - 1)]
            found.append((first, *more))
    return tuple(found[k] for k in generator.permutation(len(found)))


def _wanted(
    generator: np.random.Generator, engine: str, counts: Mapping[str, int]
) -> list[tuple[Kind, str]]:
    """List kind, and effect or thing outside the list where it is fixed, of an engine's cases.

    The compiled engine has each effect alone once.
    """
    listed = generator.permutation(sorted(RANGES)).tolist()
    found: list[tuple[Kind, str]] = []
    for kind, count in counts.items():
        fixed = listed if kind == "single" and engine == "planar" else []
        found += [(kind, name) for name in [*fixed, *[""] * count][:count]]  # type: ignore[misc]
    outside = OUTSIDE[engine] if counts is not SMALL else dict.fromkeys([*OUTSIDE[engine]][:1], 1)
    return found + [("outside", name) for name, count in outside.items() for _ in range(count)]


def _causes(
    generator: np.random.Generator, kind: Kind, name: str
) -> tuple[dict[str, Values], dict[str, float]]:
    """Draw parameters by effect, and strengths of things outside the list."""
    if kind == "none":
        return {}, {}
    if kind == "outside":
        return {}, {name: float(generator.uniform(*STRENGTHS))}
    rare = sorted(n for n, ranges in RANGES.items() if ranges and n not in COMMON)
    many = {"single": 1, "pair": 2}.get(kind, 3)
    names = [name] if name else generator.choice(rare, many, replace=False).tolist()
    if many > 1 and generator.random() < WITH_COMMON:
        names[0] = str(generator.choice(COMMON))
    strengths = {n: float(generator.uniform(LEAST, 1.0)) for n in sorted(names)}
    return {n: values_of(n, strength, generator) for n, strength in strengths.items()}, {}


def _again(generator: np.random.Generator, case: Case, name: str) -> Case:
    """Draw a candidate: its sizes, and of several causes which."""
    parameters, outside = _causes(generator, case.kind, name)
    seed = int(generator.integers(2**31))
    return replace(case, parameters=parameters, outside=outside, seed=seed)


def _drawn(generator: np.random.Generator, case: Case, name: str, grid: Sequence[Point]) -> Case:
    """Draw all of a case but its kind, engine and clutch."""
    chance, places = generator.random(), _places(generator, grid)
    form: Form = "means" if chance < MEANS and name not in BY_SINGLES else "singles"
    form = "traces" if chance > 1.0 - TRACES else form
    low, high = FEW if form == "traces" else NUMBERS
    drift = generator.uniform(*DRIFTS) if generator.random() < DRIFTING else 0.0
    numbers = np.exp(generator.uniform(np.log(low - 0.5), np.log(high + 0.5), len(places)))
    sensor = str(generator.choice(("actuator", "sleeve")))
    placed = replace(
        case,
        form=form,
        contact={**contact_of(generator), "drift": 0.0 if form == "means" else float(drift)},
        places=places,
        numbers=tuple(np.round(numbers).astype(int).tolist()),
        force_error=float(generator.uniform(*FORCE_ERRORS)),
        speed_error=float(generator.uniform(*SPEED_ERRORS)),
        shuffled=form != "means" and bool(generator.random() < SHUFFLED),
        spreads=form == "means" and bool(generator.random() < SPREADS),
        sensor=sensor,
        displacement_at="unknown" if generator.random() < UNLABELLED else sensor,
        time_zero="unknown" if generator.random() < UNLABELLED else "command",
    )
    return _again(generator, placed, name)


def _places(generator: np.random.Generator, grid: Sequence[Point]) -> tuple[int, ...]:
    """Draw operating points: three mismatches at least, of two of them two forces."""
    most = min(POINTS[1], len(grid))
    while True:
        count = int(generator.integers(POINTS[0], most + 1))
        places = tuple(sorted(generator.choice(len(grid), count, replace=False).tolist()))
        speeds = [grid[k].mismatch for k in places]
        if sum(speeds.count(one) > 1 for one in set(speeds)) > 1 and len(set(speeds)) > 2:
            return places
