"""Cases of a field set: three engines of truths, three clutches, and data as a stand gives them.

Each case has an engine and a clutch of its own, some of the clutch's operating points, another
number of shifts at each, and a true force and mismatch at each that are off the nominal ones by
some percent. Kinds and numbers of cases are fixed by engine (``COUNTS``, ``OUTSIDE``); clutch,
effects, strengths and form are drawn. Pairs and threes have neither dead time nor friction of the
sleeve, which come with every bench.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np

from dogshape.sim.errors import InputError, did_you_mean
from dogshape.validation.blind.stand import Point, Truth
from dogshape.validation.blind.true_effects import RANGES, Values, truth_of, values_of

Form = Literal["means", "singles", "traces"]

WHICH = "field"
REVERSED = "reversed_mismatch"
CLUTCHES = ("half", "fine", "large")  #: folders of ``studies/blind``
SEED = 6021  #: of the draws, unless another is given
#: Cases of each kind by engine; ``single`` is how often each effect of the list comes alone.
COUNTS: dict[str, dict[str, int]] = {
    "planar": {"none": 60, "single": 2, "pair": 26, "three": 12, "beyond": 10, "other": 6},
    "mujoco": {"none": 24, "single": 1, "pair": 10, "three": 4, "beyond": 4, "other": 2},
    "drake": {"none": 24, "single": 1, "pair": 10, "three": 4, "beyond": 4, "other": 2},
}
#: Things outside the list by engine and name: in how many cases, the first of them with traces.
OUTSIDE: dict[str, dict[str, tuple[int, int]]] = {
    "planar": {"drift": (4, 0), "sticking_valve": (4, 0), "swapped_column": (2, 0)},
    "mujoco": {
        "drift": (3, 1),
        "sticking_valve": (3, 1),
        "speed_ripple": (3, 1),
        "high_dog": (2, 1),
        "two_stages": (3, 2),
        "swapped_column": (2, 0),
    },
    "drake": {"drift": (2, 0), "sticking_valve": (2, 0), "swapped_column": (1, 0)},
}
#: A small set, on the first clutch: cases of each kind in each engine.
SMALL = {"none": 1, "single": 1, "pair": 1, "outside": 1}
SHOWN = ("actuation_lag", "detent_force", "moving_mass", "viscous_damping")
COMMON = ("actuation_delay", "sleeve_friction")  #: come with every bench
POINTS = (6, 12)  #: operating points of a case, at least and at most
NUMBERS = (3, 4, 5, 6, 7, 8, 10, 12, 16, 24, 50)  #: shifts of an operating point
SLOW = 16  #: shifts at most where a shift takes tens of milliseconds
FEW = (3, 4, 5)  #: shifts of an operating point with traces
FORCE_ERRORS, SPEED_ERRORS = (0.01, 0.03), (0.01, 0.02)  #: standard deviations, least and most
OTHERWISE = (0.1, 0.25)  #: share by which a force or a mismatch is off by another law
FORCE = 500.0  #: N, of which that is a share
SHUFFLED = 0.5  #: share of series of single shifts that were made in random order
DRIFTS = (0.2, 0.7)  #: strengths of a drift, least and most
STRENGTHS = (0.4, 1.0)  #: the same of anything else outside the list
SINGLES = 0.6  #: share of cases with single shifts
LEAST = 0.5  #: least strength of an effect
#: Draws of a case by engine and kind, of which the clearest by the yardstick is kept: of pairs
#: drawn at random hardly one in thirty is clear, of single effects one in five. Drake's are dear.
DRAWS: dict[str, dict[str, int]] = {
    "planar": {"single": 3, "pair": 10, "three": 3, "beyond": 3},
    "mujoco": {"single": 2, "pair": 3, "beyond": 2},
    "drake": {},
}
#: Effects beyond their priors, in units of the parameters, from and to.
BEYOND: dict[str, tuple[str, float, float]] = {
    "actuation_delay": ("delay_s", 0.42, 0.55),
    "actuation_lag": ("lag_s", 0.48, 0.7),
    "viscous_damping": ("damping_Ns_m", 1700.0, 2600.0),
    "moving_mass": ("added_mass_kg", 19.0, 30.0),
    "linkage_compliance": ("compliance_mm_kN", 37.0, 60.0),
    "force_scale": ("force_factor", 0.35, 0.47),
    "drag_torque": ("drag_Nm", 8.4, 13.0),
}


@dataclass(frozen=True)
class Case:
    """One case: its causes, the form of its data, its engine, its clutch and its test series.

    Parameters
    ----------
    kind, form : of the truth and of the data.
    seed : of the draws.
    strength : how sizes came about.
    parameters, outside : values by effect of the list, and strengths of unlisted things by name.
    engine, stand : names of the engine and of the clutch.
    places : of its operating points among those of the clutch, (points,).
    numbers : shifts at each of them, (points,).
    force_error, speed_error : standard deviations of true over nominal force and mismatch.
    shuffled : whether shifts were made in random order, and not point by point in the table's.
    group : number of the draws of which one is kept; 0 for a case that is kept anyway.
    """

    kind: Literal["none", "single", "pair", "three", "beyond", "other", "outside"]
    form: Form
    seed: int
    strength: str = "none"
    parameters: dict[str, Values] = field(default_factory=dict)
    outside: dict[str, float] = field(default_factory=dict)
    engine: str = "planar"
    stand: str = "half"
    places: tuple[int, ...] = ()
    numbers: tuple[int, ...] = ()
    force_error: float = 0.0
    speed_error: float = 0.0
    shuffled: bool = False
    group: int = 0

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects of the list, in alphabetical order; unknown for one outside."""
        return ("unknown",) if self.outside else tuple(sorted(self.parameters))

    @property
    def truth(self) -> Truth:
        """Truth of the stand."""
        return truth_of(self.parameters, self.outside)

    @property
    def swapped(self) -> bool:
        """Test that rise times stand beside the wrong forces."""
        return "swapped_column" in self.outside

    def record(self) -> dict[str, Any]:
        """Write the entry of the key."""
        return {
            "kind": self.kind,
            "strength": self.strength,
            "form": self.form,
            "seed": self.seed,
            "causes": list(self.causes),
            "parameters": self.parameters,
            "outside": self.outside,
            "engine": self.engine,
            "stand": self.stand,
            "places": list(self.places),
            "numbers": list(self.numbers),
            "force_error": self.force_error,
            "speed_error": self.speed_error,
            "shuffled": self.shuffled,
            "group": self.group,
        }


def case_of(record: dict[str, Any]) -> Case:
    """Read the entry of a key."""
    values = {one.name: record[one.name] for one in fields(Case)}
    return Case(**values | {name: tuple(values[name]) for name in ("places", "numbers")})


def field_cases(
    size: str, grids: Mapping[str, Sequence[Point]], seed: int | None = None
) -> tuple[Case, ...]:
    """Draw the cases of a field set in shuffled order.

    Parameters
    ----------
    size : ``small`` or ``full``.
    grids : operating points of each clutch, by name.
    seed : of all draws.
    """
    if size not in ("small", "full"):
        raise InputError(
            f"--size is '{size}', which there is not; {did_you_mean(size, ('small', 'full'))}"
        )
    generator = np.random.default_rng(SEED if seed is None else seed)
    found, groups = list[Case](), 0
    for engine in COUNTS:
        mine = list(_full(generator, engine) if size == "full" else _small(generator, engine))
        # Each clutch has a third of each kind, since kinds stand in blocks.
        order = generator.permutation(list(grids)).tolist()
        for k, case in enumerate(mine):
            placed = _placed(generator, case, engine, order[k % len(order)], grids)
            draws = DRAWS[engine].get(case.kind, 1) if size == "full" else 1
            again = [_again(generator, placed, grids) for _ in range(draws - 1)]
            groups += bool(again)
            number = groups if again else 0
            found += [replace(one, group=number) for one in (placed, *again)]
    return tuple(found[k] for k in generator.permutation(len(found)))


def _again(
    generator: np.random.Generator, case: Case, grids: Mapping[str, Sequence[Point]]
) -> Case:
    """Draw another case of the kind on the same clutch: other sizes, of several causes others."""
    if case.kind == "beyond":
        parameters = _beyond(generator, case.causes[0])
    elif case.kind == "single":
        parameters = _anywhere(generator, case.causes)
    else:
        names = generator.choice(_rare(), len(case.causes), replace=False).tolist()
        parameters = _anywhere(generator, names)
    drawn = _drawn(generator, case.kind, parameters, traced=case.form == "traces")
    return _placed(generator, drawn, case.engine, case.stand, grids)


def _full(generator: np.random.Generator, engine: str) -> Iterator[Case]:
    counts = COUNTS[engine]
    for _ in range(counts["none"]):
        yield _drawn(generator, "none", {})
    for _ in range(counts["single"]):
        for name in sorted(RANGES):
            traced = engine == "mujoco" and name in SHOWN
            yield _drawn(generator, "single", _anywhere(generator, [name]), traced=traced)
    for kind, many in (("pair", 2), ("three", 3)):
        for _ in range(counts[kind]):
            names = generator.choice(_rare(), many, replace=False).tolist()
            yield _drawn(generator, kind, _anywhere(generator, names))
    beyond = generator.permutation(list(BEYOND)).tolist() * 2
    for name in beyond[: counts["beyond"]]:
        yield _drawn(generator, "beyond", _beyond(generator, name))
    for place in range(counts["other"]):
        yield _drawn(generator, "other", _otherwise(generator, place))
    for name, (many, shown) in OUTSIDE[engine].items():
        for k in range(many):
            yield _outside(generator, name, traced=k < shown)


def _small(generator: np.random.Generator, engine: str) -> Iterator[Case]:
    for _ in range(SMALL["none"]):
        yield _drawn(generator, "none", {})
    for name in generator.choice(_rare(), SMALL["single"], replace=False).tolist():
        yield _drawn(generator, "single", _anywhere(generator, [name]))
    for _ in range(SMALL["pair"]):
        names = generator.choice(_rare(), 2, replace=False).tolist()
        yield _drawn(generator, "pair", _anywhere(generator, names))
    name = {"planar": "sticking_valve", "mujoco": "two_stages", "drake": "drift"}[engine]
    yield _outside(generator, name, traced=engine == "mujoco")


def _rare() -> list[str]:
    """List the effects with parameters that do not come with every bench."""
    return sorted(name for name, ranges in RANGES.items() if ranges and name not in COMMON)


def _anywhere(generator: np.random.Generator, names: Sequence[str]) -> dict[str, Values]:
    return {
        name: {}
        if name == REVERSED
        else values_of(name, float(generator.uniform(LEAST, 1.0)), generator)
        for name in sorted(names)
    }


def _beyond(generator: np.random.Generator, name: str) -> dict[str, Values]:
    parameter, low, high = BEYOND[name]
    return {name: {parameter: float(generator.uniform(low, high))}}


def _otherwise(generator: np.random.Generator, place: int) -> dict[str, Values]:
    """Draw an effect of the list with another law: a force, or a mismatch, that is off otherwise.

    The diagnosis has a factor of the force and none alone of the mismatch.
    """
    size, side = float(generator.uniform(*OTHERWISE)), (-1.0) ** (place // 2)
    if place % 2:
        return {"mismatch_speed": {"mismatch_factor": 1.0 + side * size}}
    return {"force_scale": {"force_offset_N": side * size * FORCE}}


def _outside(generator: np.random.Generator, name: str, *, traced: bool) -> Case:
    drift = name == "drift"
    strength = {name: float(generator.uniform(*(DRIFTS if drift else STRENGTHS)))}
    # A mean has no spread, by which a sticking valve is another delay.
    single = name in ("drift", "sticking_valve")
    return _drawn(generator, "outside", {}, strength, traced=traced, single=single)


def _drawn(
    generator: np.random.Generator,
    kind: Any,
    parameters: dict[str, Values],
    outside: dict[str, float] | None = None,
    *,
    traced: bool = False,
    single: bool = False,
) -> Case:
    form: Form = "singles" if generator.random() < SINGLES or single else "means"
    seed = int(generator.integers(2**31))
    return Case(kind, "traces" if traced else form, seed, "drawn", parameters, outside or {})


def _placed(
    generator: np.random.Generator,
    case: Case,
    engine: str,
    stand: str,
    grids: Mapping[str, Sequence[Point]],
) -> Case:
    """Draw operating points, numbers of shifts and errors of the nominal values."""
    grid = grids[stand]
    most = min(POINTS[1], len(grid))
    while True:
        count = int(generator.integers(POINTS[0], most + 1))
        places = tuple(sorted(generator.choice(len(grid), count, replace=False).tolist()))
        speeds = [grid[k].mismatch for k in places]
        # A stand is swept over both: of two mismatches at least there are two forces.
        if sum(speeds.count(one) > 1 for one in set(speeds)) > 1 and len(set(speeds)) > 2:
            break
    usual = [n for n in NUMBERS if engine == "planar" or n <= SLOW]
    numbers = generator.choice(FEW if case.form == "traces" else usual, count).tolist()
    return replace(
        case,
        engine=engine,
        stand=stand,
        places=places,
        numbers=tuple(numbers),
        force_error=float(generator.uniform(*FORCE_ERRORS)),
        speed_error=float(generator.uniform(*SPEED_ERRORS)),
        shuffled=case.form != "means" and bool(generator.random() < SHUFFLED),
    )
