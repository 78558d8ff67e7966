"""Cases of a field set: two engines of truths, three clutches, and data as a stand gives them.

Kinds and numbers of cases are fixed by engine (``COUNTS``); clutch, contact, operating points,
numbers of shifts, effects, strengths and form are drawn; true force and mismatch are off the
nominal ones by some percent. Of some kinds several candidates are drawn on the same operating
points; the first that is clear by the yardstick is kept (``CANDIDATE_COUNTS``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal, cast

import numpy as np

from dogshape.validation.blind.stand import Point, Truth
from dogshape.validation.blind.true_effects import RANGES, Values, contact_of, truth_of, values_of

Kind = Literal["none", "single", "pair", "outside"]
Form = Literal["means", "singles", "traces"]

#: Clutches by name: folders of the bundled data.
CLUTCHES = {"prototype": "bench/mq200_adams", "large": "blind/large", "hub": "blind/hub"}
SEED = 7042  #: of the draws, unless another is given
#: Cases by engine and kind; those outside the list by name.
COUNTS: dict[str, dict[str, int]] = {
    "planar": {"none": 4, "single": 10, "pair": 6},
    "mujoco": {"none": 6, "single": 12, "pair": 14},
}
OUTSIDE: dict[str, dict[str, int]] = {
    "planar": {
        "sticking_valve": 1,
        "hanging_valve": 1,
        "swapped_forces": 1,
        "swapped_speeds": 1,
        "clock_drift": 1,
        "elastic_dogs": 1,
    },
    "mujoco": {
        "sticking_valve": 1,
        "hanging_valve": 1,
        "swapped_speeds": 1,
        "speed_ripple": 1,
        "high_dog": 2,
        "two_stages": 2,
        "clock_drift": 1,
        "galling": 2,
        "stribeck_friction": 2,
        "elastic_dogs": 1,
    },
}
#: Cases of each engine in a small set, on the first clutch.
SMALL_COUNTS = {"none": 1, "single": 1, "pair": 1}
#: Candidates of a case by engine and kind, where there are several.
CANDIDATE_COUNTS: dict[str, dict[str, int]] = {
    "planar": {"single": 6, "pair": 3, "outside": 4},
    "mujoco": {"single": 3, "pair": 2, "outside": 2},
}
#: Effects of the reading of a shift: a pair has none, so that both act on the contact.
READING_EFFECTS = ("actuation_delay", "relative_angle", "reversed_mismatch")
POINT_COUNTS = (12, 28)  #: range of the operating points of a case
SHIFT_COUNTS = (3, 20)  #: range of the shifts of an operating point, even in the logarithm
TRACE_COUNTS = (3, 5)  #: range of the shifts of an operating point with traces
FORCE_ERRORS = (0.01, 0.03)  #: range of the relative standard deviation of forces
SPEED_ERRORS = (0.01, 0.02)  #: range of the relative standard deviation of mismatches
SHUFFLED_SHARE = 0.5  #: of series of single shifts in random order
MEANS_SHARE = 0.6  #: of cases with means only
TRACES_SHARE = 0.1  #: of cases with traces
SPREADS_SHARE = 0.5  #: of cases with means only that have standard deviations
UNKNOWN_SHARE = 0.25  #: of records that leave a convention unknown
STRENGTHS = (0.5, 1.0)  #: range of an effect's strength
BEYOND_SHARE = 0.25  #: of effects whose size lies beyond the prior
BEYOND = 2.0  #: greatest strength of these
LOG_BEYOND = 1.3  #: greatest strength of these on a logarithmic scale: up to six times the end
OUTSIDE_STRENGTHS = (0.7, 1.0)  #: range of the strength of a cause outside the list
DRIFT_SHARE = 0.5  #: of series of single shifts whose force falls
DRIFTS = (0.02, 0.1)  #: range of the share of the force that is lost
#: Causes outside the list that the spread of single shifts shows.
SPREAD_CAUSES = ("sticking_valve", "hanging_valve", "speed_ripple", "high_dog", "two_stages")
#: Causes outside the list that the order of single shifts shows.
ORDER_CAUSES = ("clock_drift", "galling")


@dataclass(frozen=True)
class Case:
    """Truth of a case, form of its data, engine, clutch and test series."""

    kind: Kind
    form: Form
    engine: str  #: ``planar`` or ``mujoco``
    stand: str  #: name of the clutch
    seed: int
    parameters: dict[str, Values] = field(default_factory=dict)  #: values by effect of the list
    outside: dict[str, float] = field(default_factory=dict)  #: strengths of unlisted causes
    contact: dict[str, float] = field(default_factory=dict)  #: fields of the truth, no cause
    places: tuple[int, ...] = ()  #: indices of operating points among those of the clutch
    numbers: tuple[int, ...] = ()  #: shifts at each operating point
    force_error: float = 0.0  #: standard deviation of true over nominal forces
    speed_error: float = 0.0  #: standard deviation of true over nominal mismatches
    shuffled: bool = False  #: whether shifts are in random order
    spreads: bool = False  #: whether a table of means has standard deviations
    sensor: str = "sleeve"  #: side of the linkage that is read
    displacement_at: str = "sleeve"  #: side of the linkage, as stated
    time_zero: str = "command"  #: start of the shift time, as stated

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects in alphabetical order; ``unknown`` for a cause outside the list."""
        return ("unknown",) if self.outside else tuple(sorted(self.parameters))

    @property
    def truth(self) -> Truth:
        """Truth of the stand."""
        return truth_of(self.parameters, self.outside, self.contact, self.sensor)

    @property
    def baseline(self) -> Truth:
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
    """Draw the cases of a field set in shuffled order, each as a tuple of its candidates.

    ``grids`` are the operating points of each clutch. A ``small`` set has a case of each kind and
    engine.
    """
    generator = np.random.default_rng(SEED if seed is None else seed)
    cases = []
    for engine in COUNTS:
        stands = generator.permutation(list(grids)).tolist()
        for k, (kind, name) in enumerate(_list_kinds(generator, engine, small=small)):
            # Each clutch has a third of each kind, since the list is sorted by kind.
            stand = stands[k % len(stands)]
            blank = Case(kind, "singles", engine, stand=stand, seed=0)
            candidates = [_draw_case(generator, blank, name, grids[stand])]
            count = 1 if small else CANDIDATE_COUNTS.get(engine, {}).get(kind, 1)
            for _ in range(count - 1):
                candidates.append(_draw_candidate(generator, candidates[0], name, grids[stand]))
            cases.append(tuple(candidates))
    return tuple(cases[k] for k in generator.permutation(len(cases)))


def _list_kinds(
    generator: np.random.Generator, engine: str, *, small: bool
) -> list[tuple[Kind, str]]:
    """List the kinds of an engine's cases, each with its cause where that is fixed, else ''.

    Single effects of an engine are different ones.
    """
    effects = generator.permutation(sorted(RANGES)).tolist()
    kinds: list[tuple[Kind, str]] = []
    for kind, count in (SMALL_COUNTS if small else COUNTS[engine]).items():
        names = effects if kind == "single" else []
        names = [*names, *[""] * count][:count]
        kinds += [(cast(Kind, kind), name) for name in names]
    outside = OUTSIDE[engine]
    if small:
        outside = {next(iter(outside)): 1}
    for name, count in outside.items():
        kinds += [("outside", name)] * count
    return kinds


def _draw_causes(
    generator: np.random.Generator, kind: Kind, name: str
) -> tuple[dict[str, Values], dict[str, float]]:
    """Draw parameters by effect, and strengths of causes outside the list."""
    if kind == "none":
        return {}, {}
    if kind == "outside":
        return {}, {name: float(generator.uniform(*OUTSIDE_STRENGTHS))}
    effects = sorted({*RANGES} - {*READING_EFFECTS}) if kind == "pair" else sorted(RANGES)
    count = 2 if kind == "pair" else 1
    names = [name] if name else generator.choice(effects, count, replace=False).tolist()
    strengths = {effect: _draw_strength(generator, effect) for effect in sorted(names)}
    parameters = {
        effect: values_of(effect, strength, generator) for effect, strength in strengths.items()
    }
    return parameters, {}


def _draw_strength(generator: np.random.Generator, effect: str) -> float:
    """Draw the strength of an effect, one in four beyond its prior."""
    if generator.random() < BEYOND_SHARE:
        is_log = any(parameter.log for parameter in RANGES[effect])
        return float(generator.uniform(1.0, LOG_BEYOND if is_log else BEYOND))
    return float(generator.uniform(*STRENGTHS))


def _draw_candidate(
    generator: np.random.Generator, case: Case, name: str, grid: Sequence[Point]
) -> Case:
    """Draw causes and their sizes for a case, and a seed.

    They are drawn again where the force does not move the ring at an operating point.
    """
    points = [grid[k] for k in case.places]
    while True:
        parameters, outside = _draw_causes(generator, case.kind, name)
        seed = int(generator.integers(2**31))
        candidate = replace(case, parameters=parameters, outside=outside, seed=seed)
        if all(candidate.truth.moves_ring(point) for point in points):
            return candidate


def _draw_case(
    generator: np.random.Generator, case: Case, name: str, grid: Sequence[Point]
) -> Case:
    """Draw form, test series, conventions and causes of a case.

    ``case`` has the kind, engine and clutch.
    """
    chance = generator.random()
    places = _draw_places(generator, grid)
    form: Form = "singles"
    if chance < MEANS_SHARE and name not in (*SPREAD_CAUSES, *ORDER_CAUSES):
        form = "means"
    if chance > 1.0 - TRACES_SHARE:
        form = "traces"
    low, high = TRACE_COUNTS if form == "traces" else SHIFT_COUNTS
    drift = generator.uniform(*DRIFTS) if generator.random() < DRIFT_SHARE else 0.0
    numbers = np.exp(generator.uniform(np.log(low - 0.5), np.log(high + 0.5), len(places)))
    sensor = str(generator.choice(("actuator", "sleeve")))
    case = replace(
        case,
        form=form,
        contact={**contact_of(generator), "drift": 0.0 if form == "means" else float(drift)},
        places=places,
        numbers=tuple(np.round(numbers).astype(int).tolist()),
        force_error=float(generator.uniform(*FORCE_ERRORS)),
        speed_error=float(generator.uniform(*SPEED_ERRORS)),
        shuffled=form != "means" and bool(generator.random() < SHUFFLED_SHARE),
        spreads=form == "means" and bool(generator.random() < SPREADS_SHARE),
        sensor=sensor,
        displacement_at="unknown" if generator.random() < UNKNOWN_SHARE else sensor,
        time_zero="unknown" if generator.random() < UNKNOWN_SHARE else "command",
    )
    return _draw_candidate(generator, case, name, grid)


def _draw_places(generator: np.random.Generator, grid: Sequence[Point]) -> tuple[int, ...]:
    """Draw indices of operating points: at least three mismatches, two of them with two forces."""
    max_count = min(POINT_COUNTS[1], len(grid))
    while True:
        count = int(generator.integers(POINT_COUNTS[0], max_count + 1))
        places = tuple(sorted(generator.choice(len(grid), count, replace=False).tolist()))
        speeds = [grid[k].mismatch for k in places]
        repeated_count = sum(speeds.count(speed) > 1 for speed in set(speeds))
        if repeated_count > 1 and len(set(speeds)) > 2:
            return places
