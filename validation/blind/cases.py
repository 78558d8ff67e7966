"""Cases of a set: effects of the list, none, plausible pairs, and things outside the list.

Two sets differ in strengths and in draws: *tuning* is for looking at while the diagnosis is made,
*published* for its figures. ``small`` sets have a handful of cases, for tests and a first look.
A *wide* set asks for what a bench may bring beyond these: any pairs and threes, strengths drawn
anywhere and beyond the priors, a mismatch off by a factor, 3 to 50 shifts at a point.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from dogshape.sim.errors import InputError, did_you_mean
from dogshape.validation.blind.stand import Truth
from dogshape.validation.blind.true_effects import OUTSIDE, RANGES, Values, truth_of, values_of

Form = Literal["means", "singles", "traces"]

#: Share of the way to the end of the prior: of a uniform one and of a log-uniform one.
STRENGTHS: dict[str, dict[str, tuple[float, float]]] = {
    "published": {"barely": (0.12, 0.30), "clear": (0.45, 0.60), "gross": (0.90, 0.90)},
    "tuning": {"barely": (0.18, 0.38), "clear": (0.35, 0.52), "gross": (0.75, 0.80)},
}
SEEDS = {"published": 20260, "tuning": 411, "wide": 5077}  #: of the draws, unless another is given
SPREAD = 0.1  #: by which a strength is off its nominal one, at most
SHIFTS = {"means": 10, "singles": 10, "traces": 3}  #: shifts of an operating point
#: Pairs: what comes with every actuator and every ring, with something else.
PAIRS = (
    ("actuation_delay", "moving_mass"),
    ("actuation_delay", "sleeve_friction"),
    ("actuation_delay", "linkage_compliance"),
    ("actuation_delay", "contact_friction"),
    ("actuation_delay", "force_scale"),
    ("actuation_delay", "relative_angle"),
    ("moving_mass", "sleeve_friction"),
    ("contact_friction", "sleeve_friction"),
    ("actuation_lag", "sleeve_friction"),
    ("mismatch_speed", "sleeve_friction"),
    ("free_play", "sleeve_friction"),
    ("actuation_delay", "mismatch_speed"),
)
SINGLES = (  # effects with single shifts too, at the clear strength
    "actuation_lag", "contact_friction", "detent_force", "drag_torque", "force_scale",
    "linkage_compliance", "mismatch_speed", "moving_mass", "relative_angle", "sleeve_friction",
    "spline_friction", "viscous_damping",
)  # fmt: skip
TRACED = (  # effects with traces too, at the clear strength
    "actuation_delay", "actuation_lag", "axial_gap", "detent_force", "force_scale", "free_play",
    "linkage_compliance", "moving_mass", "sleeve_friction", "viscous_damping",
)  # fmt: skip

REVERSED = "reversed_mismatch"

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
#: How much of each a wide set has beside each single effect twice; things outside the list by name.
WIDE = {"none": 30, "pair": 24, "three": 12, "beyond": 14, "other": 6}
WIDE_OUTSIDE = {"drift": 4, "sticking_valve": 6, "swapped_column": 4}
NUMBERS: dict[Form, tuple[int, ...]] = {"means": (3, 5, 10, 20, 50), "singles": (3, 5, 10, 20)}
LEAST = 0.3  #: least strength of an effect that is drawn anywhere


@dataclass(frozen=True)
class Case:
    """One case: its causes with their parameters, and the form of its data.

    ``strength`` is a name, or none; ``outside`` has strengths by name. ``number`` of shifts at an
    operating point, None for that of the form.
    """

    kind: Literal["none", "single", "pair", "three", "beyond", "other", "outside"]
    form: Form
    seed: int
    strength: str = "none"
    parameters: dict[str, Values] = field(default_factory=dict)
    outside: dict[str, float] = field(default_factory=dict)
    number: int | None = None

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects of the list, in alphabetical order; unknown for one outside."""
        return ("unknown",) if self.outside else tuple(sorted(self.parameters))

    @property
    def truth(self) -> Truth:
        """Truth of the stand."""
        return truth_of(self.parameters, self.outside)

    @property
    def shifts(self) -> int:
        """Shifts of an operating point."""
        return self.number or SHIFTS[self.form]

    @property
    def swapped(self) -> bool:
        """Test that rise times stand beside the wrong forces."""
        return "swapped_column" in self.outside

    def record(self) -> dict[str, Any]:
        """Write the entry of the key."""
        number = {} if self.number is None else {"number": self.number}
        return {
            **number,
            "kind": self.kind,
            "strength": self.strength,
            "form": self.form,
            "seed": self.seed,
            "causes": list(self.causes),
            "parameters": self.parameters,
            "outside": self.outside,
        }


def cases_of(which: str, size: str, seed: int | None = None) -> tuple[Case, ...]:
    """Return the cases of a set in shuffled order.

    Parameters
    ----------
    which : ``published``, ``tuning`` or ``wide``.
    size : ``small`` or ``full``.
    seed : of strengths, places and angles; each set has its own.
    """
    for name, value, valid in (("set", which, SEEDS), ("size", size, ("small", "full"))):
        if value not in valid:
            raise InputError(
                f"--{name} is '{value}', which there is not; {did_you_mean(value, valid)}"
            )
    generator = np.random.default_rng(SEEDS[which] if seed is None else seed)
    if which == "wide":
        found = list(_wide(generator))[:: 1 if size == "full" else 12]
    else:
        maker = _Maker(STRENGTHS[which], generator)
        found = list(_small(maker) if size == "small" else _full(maker))
    return tuple(found[k] for k in generator.permutation(len(found)))


class _Maker:
    """Makes cases with draws of their own."""

    def __init__(
        self, strengths: dict[str, tuple[float, float]], generator: np.random.Generator
    ) -> None:
        self._strengths, self._generator = strengths, generator

    def none(self, form: Form) -> Case:
        return Case("none", form, self._seed())

    def single(self, name: str, strength: str, form: Form = "means") -> Case:
        return Case("single", form, self._seed(), strength, {name: self._values(name, strength)})

    def pair(self, names: tuple[str, str], strength: str = "clear", form: Form = "means") -> Case:
        parameters = {name: self._values(name, strength) for name in names}
        return Case("pair", form, self._seed(), strength, parameters)

    def outside(self, name: str, strength: str, form: Form) -> Case:
        share = self._near(self._strengths[strength][0])
        return Case("outside", form, self._seed(), strength, outside={name: share})

    def _seed(self) -> int:
        return int(self._generator.integers(2**31))

    def _near(self, strength: float) -> float:
        off = SPREAD * float(self._generator.uniform(-1.0, 1.0))
        return min(1.0, strength * (1.0 + off))

    def _values(self, name: str, strength: str) -> Values:
        if not RANGES[name]:
            return {}
        # A logarithmic prior with what the stand has inside it is measured from there.
        inside = RANGES[name][0]
        log = inside.log and inside.neutral <= inside.low
        return values_of(name, self._near(self._strengths[strength][int(log)]), self._generator)


def _small(maker: _Maker) -> Iterator[Case]:
    yield maker.none("means")
    yield maker.single("actuation_delay", "gross")
    yield maker.single("sleeve_friction", "gross", "singles")
    yield maker.pair(("actuation_delay", "moving_mass"), "gross")
    yield maker.outside("sticking_valve", "gross", "singles")


def _full(maker: _Maker) -> Iterator[Case]:
    """Yield 54 single effects, 12 with single shifts, 10 traced, 12 none, 24 pairs, 18 outside.

    At last come four with the reversed sense, which has no strength: alone and beside a delay.
    """
    for name in (effect for effect, ranges in RANGES.items() if ranges):
        for strength in ("barely", "clear", "gross"):
            yield maker.single(name, strength)
    for name in SINGLES:
        yield maker.single(name, "clear", "singles")
    for name in TRACED:
        yield maker.single(name, "clear", "traces")
    forms: tuple[Form, ...] = ("means",) * 8 + ("singles",) * 3 + ("traces",)
    for form in forms:
        yield maker.none(form)
    for names in PAIRS:
        yield maker.pair(names)
        yield maker.pair(names, "gross", "singles")
    for name in OUTSIDE:
        yield maker.outside(name, "clear", "means")
        yield maker.outside(name, "gross", "means")
        yield maker.outside(name, "gross", "singles")
    # Speeds of traces show the sense at once, and the data set is refused.
    for form in ("means", "singles"):
        yield maker.single(REVERSED, "gross", form)
    yield maker.pair(("actuation_delay", REVERSED))
    yield maker.pair(("actuation_delay", REVERSED), "gross", "singles")


def _wide(generator: np.random.Generator) -> Iterator[Case]:
    """Yield single effects, none, pairs, threes, and what is beyond the priors or outside."""
    listed = [name for name, ranges in RANGES.items() if ranges]
    for kind, many in (("single", 1), ("pair", 2), ("three", 3)):
        drawn = (
            generator.choice(listed, many, replace=False).tolist() for _ in range(WIDE.get(kind, 0))
        )
        for names in [[n] for n in listed * 2] if kind == "single" else drawn:
            parameters = {
                name: values_of(name, float(generator.uniform(LEAST, 1.0)), generator)
                for name in sorted(names)
            }
            yield _drawn(generator, kind, parameters)
    for _ in range(WIDE["none"]):
        yield _drawn(generator, "none", {})
    for name in list(BEYOND) * (WIDE["beyond"] // len(BEYOND)):
        parameter, low, high = BEYOND[name]
        yield _drawn(generator, "beyond", {name: {parameter: float(generator.uniform(low, high))}})
    for place in range(WIDE["other"]):
        factor = 1.0 + (-1.0) ** place * float(generator.uniform(0.1, 0.25))
        yield _drawn(generator, "other", {"mismatch_speed": {"mismatch_factor": factor}})
    for name in [name for name, many in WIDE_OUTSIDE.items() for _ in range(many)]:
        yield _drawn(generator, "outside", {}, {name: float(generator.uniform(0.4, 1.0))})


def _drawn(
    generator: np.random.Generator,
    kind: Any,
    parameters: dict[str, Values],
    outside: dict[str, float] | None = None,
) -> Case:
    """Make a case of any form, with a number of shifts that is drawn."""
    form: Form = "singles" if generator.random() < 0.5 else "means"
    number, seed = int(generator.choice(NUMBERS[form])), int(generator.integers(2**31))
    return Case(kind, form, seed, "drawn", parameters, outside or {}, number)
