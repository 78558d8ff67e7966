"""Cases of a set: effects of the list, none, plausible pairs, and things outside the list.

Two sets differ in strengths and in draws: *tuning* is for looking at while the diagnosis is made,
*published* for its figures. ``small`` sets have a handful of cases, for tests and a first look.
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
SEEDS = {"published": 20260, "tuning": 411}  #: of the draws, unless another is given
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


@dataclass(frozen=True)
class Case:
    """One case: its causes with their parameters, and the form of its data.

    ``strength`` is a name, or none; ``outside`` has strengths by name.
    """

    kind: Literal["none", "single", "pair", "outside"]
    form: Form
    seed: int
    strength: str = "none"
    parameters: dict[str, Values] = field(default_factory=dict)
    outside: dict[str, float] = field(default_factory=dict)

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
        return SHIFTS[self.form]

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
        }


def cases_of(which: str, size: str, seed: int | None = None) -> tuple[Case, ...]:
    """Return the cases of a set in shuffled order.

    Parameters
    ----------
    which : ``published`` or ``tuning``.
    size : ``small`` or ``full``.
    seed : of strengths, places and angles; each set has its own.
    """
    for name, value, valid in (("set", which, STRENGTHS), ("size", size, ("small", "full"))):
        if value not in valid:
            raise InputError(
                f"--{name} is '{value}', which there is not; {did_you_mean(value, valid)}"
            )
    generator = np.random.default_rng(SEEDS[which] if seed is None else seed)
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
