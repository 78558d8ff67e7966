r"""Verdict on a design: failed checks, checks not judged, and the assumptions that decide it.

A check is clear where its margin keeps its sign within its interval (``sim.strength.landing``).
A design *fails* by a check that clearly fails, is *not clear* if a check may pass or fail, and is
*not judged* if all checks pass and a standard one is missing. Else it *passes*.

*Assumptions* are moved to either end of their ranges, one at a time. The checks follow by their
closed forms; engagement stays. Friction counts by the upper end of its interval, as retention is
frictionless.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple

from dogshape.sim.shift.geometry import FLANKS, Dog
from dogshape.sim.shift.mechanism import NO_MECHANISM, Mechanism
from dogshape.sim.strength.checks import LimitCheck, smallest_margin
from dogshape.sim.strength.dog_strength import Limits, strength_checks
from dogshape.sim.strength.landing import LANDING_RULES, Landings, demand_checks
from dogshape.sim.strength.locking import blocking_force
from dogshape.sim.strength.strike import Strike
from dogshape.sim.units import MM, short, suffix_of, unit_of

State = Literal["passes", "fails", "not_judged", "not_clear"]
WORDS: dict[State, str] = {
    "passes": "passes",
    "fails": "fails",
    "not_judged": "not judged",
    "not_clear": "not clear",
}


@dataclass(frozen=True)
class Standard:
    """A check that a design needs, and the key that judges it."""

    name: str
    rules: tuple[str, ...]  #: names of checks, any of which judges it
    key: str
    reason: str
    #: whether a dog with its limits needs the check
    applies: Callable[[Dog, Limits], bool] = lambda _dog, _limits: True


def _needs_retention(dog: Dog, limits: Limits) -> bool:
    return blocking_force(dog, limits.load) > 0.0 or limits.load.vibration_force > 0.0


SIMULATION = "a simulation, as by check without a surrogate"
STANDARD = (
    Standard(
        "flank_strike",
        ("flank_strike_root", "flank_strike_flank"),
        "strike.ring_inertia_kgm2 and strike.input_stiffness_Nm_rad",
        "flanks meet in each shift, and that load can exceed the rated torque many times",
    ),
    Standard(
        "landing",
        tuple(rule.name for rule in LANDING_RULES),
        SIMULATION,
        "crests land on each other in each shift that is not direct",
    ),
    Standard(
        "engagement",
        ("engagement",),
        SIMULATION,
        "a dog that does not engage has neither a shift time nor a use",
    ),
    Standard(
        "retention",
        (*(f"retention_{flank}" for flank in FLANKS), "retention_reversal"),
        "load.separating_force_limit_N, or mechanism.detent_N and mechanism.detent_seat_mm",
        "a worn flank that pushes the ring out without friction, or vibration as the torque "
        "reverses, needs a force that holds it",
        applies=_needs_retention,
    ),
    Standard(
        "pull_out_force",
        ("pull_out_force", *(f"{flank}_release" for flank in FLANKS)),
        "mechanism.spline_friction, or load.pull_out_force_limit_N",
        "a ring that does not come out under torque locks the gearbox; flanks that release by "
        "themselves judge it too",
    ),
    Standard(
        "sleeve_hoop",
        ("sleeve_hoop",),
        "manufacturing.rim_mm",
        "inclined flanks widen the sleeve, and its speed too",
        applies=lambda _dog, limits: limits.sleeve is not None,
    ),
)
#: Optional checks with their keys; a ring without ``rim_mm`` is taken for a thick one.
OPTIONAL = {"rim": "manufacturing.rim_mm"}


@dataclass(frozen=True)
class Missing:
    """A standard check that nobody judged, with the key that judges it."""

    check: str
    key: str

    @property
    def text(self) -> str:
        """The check with its key."""
        return f"{self.check.replace('_', ' ')} (give {self.key})"


def missing_checks(dog: Dog, limits: Limits, names: Iterable[str]) -> tuple[Missing, ...]:
    """List the standard checks that are not among the ``names`` of checks."""
    judged = set(names)
    return tuple(
        Missing(check.name, check.key)
        for check in STANDARD
        if judged.isdisjoint(check.rules) and check.applies(dog, limits)
    )


Status = Literal["standard", "estimate", "assumption"]


@dataclass(frozen=True)
class Span:
    """Range of an assumption in the unit of its key."""

    low: float
    high: float
    source: str
    status: Status
    #: meaning of the ends: values, factors on the value, or steps from it
    kind: Literal["value", "factor", "step"] = "value"

    def ends(self, value: float) -> tuple[float, float]:
        """Compute the ends of the range of ``value``; they include it."""
        if self.kind == "factor":
            return self.low * value, self.high * value
        if self.kind == "step":
            return self.low + value, self.high + value
        return min(self.low, value), max(self.high, value)


OILED = "oiled steel, VDI 2230-1, table A5, class B"


@dataclass(frozen=True)
class Spans:
    """Ranges of the assumptions on which checks depend."""

    friction_release: Span = Span(0.08, 0.16, OILED, "standard")
    spline_friction_release: Span = Span(0.08, 0.16, OILED, "standard")
    #: of 0.8 of the inner radius, up to a sleeve that slides on the roots of its own teeth
    spline_radius: Span = Span(
        0.75, 1.4, "shaft below the ring, or a sleeve on its own teeth", "assumption", "factor"
    )
    application_factor: Span = Span(
        -0.25, 0.25, "a step of the table of ISO 6336-6, annex B", "assumption", "step"
    )
    load_sharing: Span = Span(0.7, 1.4, "a third to two thirds carry", "assumption", "factor")
    accuracy: Span = Span(-1.0, 1.0, "a class of ISO 1328-1", "assumption", "step")
    ring_inertia: Span = Span(0.5, 2.0, "what turns with the ring", "assumption", "factor")
    input_stiffness: Span = Span(
        0.5, 2.0, "diameter of the shaft by a fifth", "assumption", "factor"
    )
    dog_stiffness_factor: Span = Span(
        0.7,
        1.3,
        "body of two to half a pitch behind the dogs, and the fit",
        "estimate",
        "factor",
    )


SPANS = Spans()
MIN_MARGIN = -1e6  #: of a hinge, as a record holds no infinite number
MIN_EFFECT = 5e-4  #: change of the margin from which an assumption is listed


@dataclass(frozen=True)
class Hinge:
    """Effect of an assumption on the smallest margin of a design."""

    key: str  #: of the study file
    value: float  #: in the unit of the key, as its range
    low: float
    high: float
    source: str
    status: Status
    margin: float  #: smallest margin at the value
    margin_low: float  #: smallest margin at the low end, with its check
    check_low: str
    margin_high: float
    check_high: str

    @property
    def flips(self) -> bool:
        """Whether the smallest margin changes its sign within the range."""
        signs = {margin >= 0.0 for margin in (self.margin, self.margin_low, self.margin_high)}
        return len(signs) == 2

    @property
    def effect(self) -> float:
        """Largest change of the smallest margin."""
        return max(abs(end - self.margin) for end in (self.margin_low, self.margin_high))

    @property
    def range_text(self) -> str:
        """The range with its unit."""
        return f"{short(self.low)} to {short(self.high)} {unit_of(self.key)}".rstrip()

    def to_dict(self) -> dict[str, Any]:
        """Return the assumption as a dictionary for JSON."""
        return {
            "assumption": self.key,
            "value": self.value,
            "range": [self.low, self.high],
            "unit": unit_of(self.key),
            "source": self.source,
            "status": self.status,
            "smallest_margin": [self.margin_low, self.margin_high],
            "weakest_check": [self.check_low, self.check_high],
            "flips": self.flips,
        }


class AssumedValue(NamedTuple):
    """Value of a study file that nobody gave for its clutch."""

    key: str
    value: Any  #: None for the default of an absent key
    source: str


class HangShare(NamedTuple):
    """Share of shifts that hang at the operating point where most do, with its limits."""

    share: float  #: posterior mean
    low: float  #: ends of the 95 % interval
    high: float
    warning_share: float  #: share above which the verdict warns
    max_share: float  #: share above which ``engagement`` fails

    @property
    def warns(self) -> bool:
        """Whether the share exceeds the one of the warning, or its interval holds that one."""
        return self.share > self.warning_share or not self.is_clear

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes the share of the warning."""
        return not self.low <= self.warning_share < self.high

    @property
    def text(self) -> str:
        """Share with its interval."""
        share = short(100.0 * self.share, 2)
        low = short(round(100.0 * self.low, 2), 2)
        interval = f"95 %: {low} to {short(100.0 * self.high, 2)} %"
        return f"{share} % of the shifts hang at the worst operating point ({interval})"

    @property
    def limits_text(self) -> str:
        """Share with both limits that it is judged by."""
        relation = "warning above"
        if self.share > self.warning_share:
            relation = "above"
        return (
            f"{self.text}; {relation} {100.0 * self.warning_share:g} % "
            f"(shift.hang_warning_share), engagement fails above {100.0 * self.max_share:g} %"
        )


@dataclass(frozen=True)
class Verdict:
    """State of a design, with its failed checks and the assumptions that decide it."""

    state: State
    failed: tuple[str, ...]  #: checks with a negative margin
    unclear: tuple[str, ...]  #: checks whose interval of the margin contains zero
    not_judged: tuple[Missing, ...]
    count: int  #: number of checks
    hangs_on: tuple[Hinge, ...] = field(default=(), repr=False)  #: strongest assumption first
    #: of unlike rings the worse one by the name of a failed or unclear check
    rings: Mapping[str, str] = field(default_factory=dict)
    assumed: tuple[AssumedValue, ...] = ()  #: values of the study that nobody gave
    hangs: HangShare | None = None  #: None without simulated shifts

    @property
    def passes(self) -> bool:
        """Whether every standard check is judged and clearly passes."""
        return self.state == "passes"

    @property
    def line(self) -> str:
        """The verdict in one sentence, with the number of assumed values and a warning of hangs."""
        line = self._state_line
        if self.assumed:
            plural = "" if len(self.assumed) == 1 else "s"
            line += f"; under {len(self.assumed)} assumed value{plural}"
        if self.hangs is not None and self.hangs.warns:
            doubt = "" if self.hangs.is_clear else " (not clear by so few shifts, give more angles)"
            line += f"; warning{doubt}: {self.hangs.limits_text}"
        return line

    @property
    def _state_line(self) -> str:
        """State with failed, unclear and missing checks."""
        missing = f"not judged: {', '.join(check.text for check in self.not_judged)}"
        clear_failures = [name for name in self.failed if name not in self.unclear]
        if not clear_failures and not self.unclear:
            if self.not_judged:
                return f"{missing}; all {self.count} checks given pass"
            return f"passes: all {self.count} checks pass"
        parts = []
        if clear_failures:
            parts.append(f"fails: {_words_of(clear_failures, self.rings)}")
        if self.unclear:
            unclear = _words_of(self.unclear, self.rings)
            parts.append(f"not clear: {unclear} (limit within the 95 % interval)")
        if self.not_judged:
            parts.append(missing)
        return "; ".join(parts)

    @property
    def flipping(self) -> tuple[Hinge, ...]:
        """Assumptions that change the sign of the smallest margin within their range."""
        return tuple(hinge for hinge in self.hangs_on if hinge.flips)

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as a dictionary for JSON."""
        return {
            "state": self.state,
            "line": self.line,
            "failed": list(self.failed),
            "not_clear": list(self.unclear),
            "not_judged": [{"check": m.check, "key": m.key} for m in self.not_judged],
            "hangs_on": [hinge.to_dict() for hinge in self.hangs_on],
            "assumed": [value._asdict() for value in self.assumed],
            "hangs": None if self.hangs is None else self.hangs._asdict(),
        }


#: Margins within the tolerances, by their keys without underscores.
TOLERANCE_WORDS = {
    "smallest margin worst": "smallest margin at worst-case tolerances",
    "smallest margin statistical": "smallest margin at statistical tolerances",
}


def _words_of(names: Sequence[str], rings: Mapping[str, str]) -> str:
    """Join the names of checks in words, without units, each with its ring of unlike ones."""
    words = []
    for name in names:
        text = name.removesuffix(suffix_of(name)).replace("_", " ")
        text = TOLERANCE_WORDS.get(text, text)
        words.append(f"{text} ({rings[name]})" if name in rings else text)
    return ", ".join(words)


class Margin(NamedTuple):
    """Margin of a check."""

    name: str
    value: float
    clear: bool = True  #: whether its interval excludes zero
    ring: str = ""  #: of unlike rings the worse one

    @classmethod
    def of(cls, check: LimitCheck) -> Margin:
        """Return the margin of a check."""
        return cls(check.name, check.margin, check.clear, check.ring)


#: Verdict on an impossible shape.
NO_DOG = Verdict("fails", ("geometry",), (), (), 0)


def judge(
    margins: Sequence[Margin], missing: Sequence[Missing], hangs_on: Sequence[Hinge] = ()
) -> Verdict:
    """Return the verdict by the margins of a design, its missing checks and its assumptions."""
    failed = tuple(margin.name for margin in margins if not margin.value >= 0.0)
    unclear = tuple(margin.name for margin in margins if not margin.clear)
    state: State = "passes"
    if set(failed) - set(unclear):
        state = "fails"
    elif unclear:
        state = "not_clear"
    elif missing:
        state = "not_judged"
    return Verdict(
        state,
        failed,
        unclear,
        tuple(missing),
        count=len(margins),
        hangs_on=tuple(hangs_on),
        rings={m.name: m.ring for m in margins if m.ring and m.name in failed + unclear},
    )


@dataclass(frozen=True)
class _Move:
    """An assumption with functions of its value."""

    key: str
    value: float
    ends: tuple[float, float]
    span: Span
    limits: Callable[[float], Limits]


def hinges(
    dog: Dog,
    limits: Limits,
    landings: Landings | None = None,
    fixed: Mapping[str, float] | None = None,
    *,
    mechanism: Mechanism = NO_MECHANISM,
    given: Collection[str] = (),
) -> tuple[Hinge, ...]:
    """Compute the effect of each assumption on the smallest margin, the strongest first.

    Parameters
    ----------
    landings : of the simulated shifts; None without a simulation.
    fixed : margins by check that have no closed form.
    mechanism : nominal ring and shaft of a strike.
    given : keys of toothing and strike in the study file.

    Assumptions without an effect are left out.
    """
    fixed_margins = dict(fixed or {})

    def weakest_check(case: Limits) -> tuple[float, str]:
        checks = strength_checks(dog, case)
        if landings is not None:
            checks += demand_checks(dog, landings.demand(dog, case), case)
        margins = fixed_margins | {check.name: check.margin for check in checks}
        margin, name = min((margin, name) for name, margin in margins.items())
        return max(margin, MIN_MARGIN), name

    nominal, _ = weakest_check(limits)
    moves = [
        *_load_moves(dog, limits, given),
        *_strike_moves(limits, mechanism, given),
    ]
    effective = []
    for move in moves:
        low, high = move.ends
        margin_low, check_low = weakest_check(move.limits(low))
        margin_high, check_high = weakest_check(move.limits(high))
        hinge = Hinge(
            move.key,
            move.value,
            low=low,
            high=high,
            source=move.span.source,
            status=move.span.status,
            margin=nominal,
            margin_low=margin_low,
            check_low=check_low,
            margin_high=margin_high,
            check_high=check_high,
        )
        if hinge.effect > MIN_EFFECT:
            effective.append(hinge)
    return tuple(sorted(effective, key=lambda hinge: (not hinge.flips, -hinge.effect)))


#: Assumed numbers of a load case with their keys and bounds.
_LOAD_KEYS: dict[str, tuple[str, tuple[float, float]]] = {
    "friction_release": ("load.friction_release", (0.0, 1.0)),
    "application_factor": ("load.application_factor", (0.5, 10.0)),
    "load_sharing": ("load.load_sharing", (0.01, 1.0)),
    "accuracy": ("load.accuracy", (1, 11)),
    "dog_stiffness_factor": ("load.dog_stiffness_factor", (0.05, 20.0)),
}


def _load_moves(dog: Dog, limits: Limits, given: Collection[str]) -> Iterable[_Move]:
    """List the moves of the load case: friction, toothing and sharing of the dogs."""
    load = limits.load
    has_scatter = load.scatter(dog) is not None or load.run_out > 0.0
    for name, (key, (minimum, maximum)) in _LOAD_KEYS.items():
        value = getattr(load, name)
        if name == "dog_stiffness_factor":
            value = None if value is not None else load.stiffness_factor  # a measured one is known
        if value is None or (name == "load_sharing" and has_scatter):
            continue
        span: Span = getattr(SPANS, name)
        low, high = (min(max(end, minimum), maximum) for end in span.ends(value))
        if name == "friction_release":
            low = max(low, load.friction_hold)  # the upper end of the interval by its meaning
        yield _Move(key, value, (low, high), span=span, limits=partial(_with_load, limits, name))
    if load.spline_friction == 0.0:
        return
    friction_span = SPANS.spline_friction_release
    low, high = friction_span.ends(load.release_friction)
    yield _Move(
        "load.spline_friction_release",
        load.release_friction,
        (max(low, load.spline_friction), high),
        span=friction_span,
        limits=partial(_with_load, limits, "spline_friction_release"),
    )
    if "mechanism.spline_radius_mm" not in given:
        radius = load.spline_radius / MM
        yield _Move(
            "mechanism.spline_radius_mm",
            radius,
            SPANS.spline_radius.ends(radius),
            span=SPANS.spline_radius,
            limits=lambda end: _with_load(limits, "spline_radius", end * MM),
        )


def _with_load(limits: Limits, name: str, value: float) -> Limits:
    """Return the limits with another ``value`` of a field of the load case."""
    changes: dict[str, Any] = {name: value}
    return replace(limits, load=replace(limits.load, **changes))


def _strike_moves(limits: Limits, mechanism: Mechanism, given: Collection[str]) -> Iterable[_Move]:
    """List the moves of a strike to the ends of the study's range, or of the assumed range.

    Ring and shaft without a key in ``[strike]`` are those of ``[mechanism]``.
    """
    strikes = limits.strikes
    if not strikes:
        return
    for key, name in (
        ("ring_inertia_kgm2", "ring_inertia"),
        ("input_stiffness_Nm_rad", "input_stiffness"),
    ):
        values = [getattr(strike, name) for strike in strikes]
        low = min(values)
        high = max(values)
        ends = (low, high)
        span = Span(low, high, "range of the study", "estimate")
        if low == high:
            span = getattr(SPANS, name)
            ends = span.ends(low)
        nominal: float = getattr(mechanism, name)
        section = "mechanism" if nominal and f"strike.{key}" not in given else "strike"
        value = nominal or math.sqrt(low * high)
        strike_limits = partial(_strike_limits, limits, name)
        yield _Move(f"{section}.{key}", value, ends, span=span, limits=strike_limits)


def _strike_limits(limits: Limits, name: str, end: float) -> Limits:
    """Return the limits with the strikes at an end of a range, or with their value set to it."""
    strikes = [strike for strike in limits.strikes if getattr(strike, name) == end]
    if not strikes:
        strikes = [_with_strike_value(strike, name, end) for strike in limits.strikes]
    return replace(limits, strikes=tuple(strikes))


def _with_strike_value(strike: Strike, name: str, value: float) -> Strike:
    """Return the strike with another ``value``; a ring is limited to the sliding side's inertia."""
    maximum = strike.sliding_inertia if name == "ring_inertia" else math.inf
    changes: dict[str, Any] = {name: min(value, maximum)}
    return replace(strike, **changes)


def landing_by_stiffness(
    dog: Dog, limits: Limits, landings: Landings
) -> list[tuple[float, LimitCheck]]:
    """Compute the landing check of smallest margin at the ends of the dogs' stiffness.

    Returns factors on the stiffness with their checks: one for a measured stiffness, else two.
    """
    load = limits.load
    factors: tuple[float, ...] = SPANS.dog_stiffness_factor.ends(1.0)
    if load.dog_stiffness_factor is not None:
        factors = (load.dog_stiffness_factor,)
    weakest = []
    for factor in factors:
        case = _with_load(limits, "dog_stiffness_factor", factor)
        checks = demand_checks(dog, landings.demand(dog, case), case)
        weakest.append((factor, smallest_margin(checks)))
    return weakest
