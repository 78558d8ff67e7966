r"""Verdict on a design: what fails, what nobody judged, and which assumptions decide it.

A check is clear where its margin keeps its sign within its interval (``sim.strength.landing``).
A design *fails* by a check that clearly fails, is *not clear* where a check may pass or fail, and
is *not judged* where all checks pass and a standard one is missing. Else it *passes*.

*Assumptions* are moved to either end of their ranges, one at a time. The checks follow by their
closed forms. Dogs are as stiff as the contact; landings scale with the root of its stiffness, and
engagement stays. Friction counts by the upper end of its interval: what holds a ring has none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple

from dogshape.sim.shift.geometry import FLANKS, Dog
from dogshape.sim.shift.mechanism import NOTHING, Mechanism
from dogshape.sim.strength.checks import Check
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
    """A check that a design needs, and the key that judges it.

    ``rules`` are the names of checks, any of which judges it; ``wanted`` decides for a dog.
    """

    name: str
    rules: tuple[str, ...]
    key: str
    reason: str
    wanted: Callable[[Dog, Limits], bool] = lambda _dog, _limits: True


SIMULATION = "a simulation (dogshape check, without --surrogate)"
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
        lambda dog, limits: (
            blocking_force(dog, limits.load) > 0.0 or limits.load.vibration_force > 0.0
        ),
    ),
    Standard(
        "pull_out_force",
        ("pull_out_force", *(f"{flank}_release" for flank in FLANKS)),
        "mechanism.spline_friction, or load.pull_out_force_limit_N",
        "a ring that does not come out under torque locks the gearbox; flanks that release by "
        "themselves judge it too",
    ),
)
#: Checks that a design may have, with their keys. A rim is one of a thin ring alone, and a drawing
#: shows a thicker one.
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
    known = set(names)
    return tuple(
        Missing(one.name, one.key)
        for one in STANDARD
        if not known & set(one.rules) and one.wanted(dog, limits)
    )


Status = Literal["standard", "estimate", "assumption"]


@dataclass(frozen=True)
class Span:
    """Range of an assumption in the unit of its key.

    ``kind`` says whether the ends are values, factors on the value, or steps from it.
    """

    low: float
    high: float
    source: str
    status: Status
    kind: Literal["value", "factor", "step"] = "value"

    def ends(self, value: float) -> tuple[float, float]:
        """Compute the ends about a ``value``, which always lies within them."""
        if self.kind == "factor":
            return self.low * value, self.high * value
        if self.kind == "step":
            return self.low + value, self.high + value
        return min(self.low, value), max(self.high, value)


OILED = "oiled steel, VDI 2230-1, table A5, class B"


@dataclass(frozen=True)
class Spans:
    """Ranges of the assumptions that checks depend on."""

    friction_release: Span = Span(0.08, 0.16, OILED, "standard")
    spline_friction_release: Span = Span(0.08, 0.16, OILED, "standard")
    #: over 0.8 of the inner radius, up to a sleeve that slides on the roots of its own teeth
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
    contact_stiffness: Span = Span(
        0.5, 1.8, "ring that gives as much as the dogs, to 25 N/(mm um)", "estimate", "factor"
    )


SPANS = Spans()
LEAST_MARGIN = -1e6  #: of a hinge: a record holds no infinite number


@dataclass(frozen=True)
class Hinge:
    """Effect of an assumption on the smallest margin of a design.

    ``key`` of the study file with its value and its range, in the unit of the key; smallest margin
    with its check at either end.
    """

    key: str
    value: float
    low: float
    high: float
    source: str
    status: Status
    margin: float
    margin_low: float
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
        """Give the assumption as JSON takes it."""
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


@dataclass(frozen=True)
class Verdict:
    """Answer about a design, with what was not judged and what decides it.

    ``failed`` are the checks with a negative margin, ``unclear`` those whose interval holds zero,
    ``count`` is the number of checks; ``hangs_on`` has the strongest assumption first.
    """

    state: State
    failed: tuple[str, ...]
    unclear: tuple[str, ...]
    not_judged: tuple[Missing, ...]
    count: int
    hangs_on: tuple[Hinge, ...] = field(default=(), repr=False)

    @property
    def passes(self) -> bool:
        """Whether every standard check is judged and clearly passes."""
        return self.state == "passes"

    @property
    def line(self) -> str:
        """The verdict in one sentence."""
        parts = []
        surely = [name for name in self.failed if name not in self.unclear]
        if surely:
            parts.append(f"fails: {_listed(surely)}")
        if self.unclear:
            parts.append(f"not clear: {_listed(self.unclear)} (limit within the 95 % interval)")
        if not (surely or self.unclear):
            given = " given" if self.not_judged else ""
            parts.append(f"all {self.count} checks{given} pass")
        if self.not_judged:
            parts.append(f"not judged: {', '.join(one.text for one in self.not_judged)}")
        if not (surely or self.unclear):
            parts.reverse()
        if self.state == "passes":
            return f"passes: {parts[0]}"
        return "; ".join(parts)

    @property
    def flipping(self) -> tuple[Hinge, ...]:
        """Assumptions that change the sign of the smallest margin within their range."""
        return tuple(hinge for hinge in self.hangs_on if hinge.flips)

    def to_dict(self) -> dict[str, Any]:
        """Give the verdict as JSON takes it."""
        return {
            "state": self.state,
            "line": self.line,
            "failed": list(self.failed),
            "not_clear": list(self.unclear),
            "not_judged": [{"check": one.check, "key": one.key} for one in self.not_judged],
            "hangs_on": [hinge.to_dict() for hinge in self.hangs_on],
        }


#: Margins within the tolerances, by their keys without underscores.
TOLERANCE_WORDS = {
    "smallest margin worst": "smallest margin at worst-case tolerances",
    "smallest margin statistical": "smallest margin at statistical tolerances",
}


def _listed(names: Sequence[str]) -> str:
    """List checks in words; a quantity of the study that is bounded ends in its unit."""
    words = (name.removesuffix(suffix_of(name)).replace("_", " ") for name in names)
    return ", ".join(TOLERANCE_WORDS.get(name, name) for name in words)


class Margin(NamedTuple):
    """Margin of a check; ``clear`` unless its interval holds zero."""

    name: str
    value: float
    clear: bool = True

    @classmethod
    def of(cls, check: Check) -> Margin:
        """Take the margin of a check."""
        return cls(check.name, check.margin, check.clear)


#: A shape that no dog can have.
NO_DOG = Verdict("fails", ("geometry",), (), (), 0)


def judge(
    margins: Sequence[Margin], missing: Sequence[Missing], hangs_on: Sequence[Hinge] = ()
) -> Verdict:
    """Judge a design by its margins; ``missing`` and ``hangs_on`` are what else is known of it."""
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
    )


@dataclass(frozen=True)
class _Move:
    """An assumption with its value, and what the limits and landings are at another one."""

    key: str
    value: float
    ends: tuple[float, float]
    span: Span
    limits: Callable[[float], Limits]
    landing_scale: Callable[[float], float] = lambda _value: 1.0


def hinges(
    dog: Dog,
    limits: Limits,
    landings: Landings | None = None,
    fixed: Mapping[str, float] | None = None,
    *,
    contact_stiffness: float | None = None,
    mechanism: Mechanism = NOTHING,
    given: Collection[str] = (),
    spans: Spans = SPANS,
) -> tuple[Hinge, ...]:
    """Compute the effect of each assumption on the smallest margin, the strongest first.

    ``fixed`` are margins by check that no closed form has. ``contact_stiffness`` in Pa/m is None
    for a contact without one, ``mechanism`` has the nominal ring and shaft of a strike, ``given``
    are the keys of toothing and strike in the study file. Those without any effect are left out.
    """
    constant = dict(fixed or {})

    def smallest(case: Limits, scale: float = 1.0) -> tuple[float, str]:
        checks = strength_checks(dog, case)
        if landings is not None:
            checks += demand_checks(landings.demand(dog, case, scale), case)
        margins = constant | {check.name: check.margin for check in checks}
        margin, name = min((margin, name) for name, margin in margins.items())
        return max(margin, LEAST_MARGIN), name

    nominal, found = smallest(limits)[0], list[Hinge]()
    moves = [*_load_moves(dog, limits, given, spans)]
    moves += _strike_moves(limits, mechanism, given, spans)
    if contact_stiffness is not None:
        span = spans.contact_stiffness
        moves.append(
            _Move(
                "contact.stiffness_Pa_m",
                contact_stiffness,
                span.ends(contact_stiffness),
                span,
                partial(_stiffened, limits, contact_stiffness),
                lambda end: math.sqrt(end / contact_stiffness),
            )
        )
    for move in moves:
        (low, check_low), (high, check_high) = (
            smallest(move.limits(end), move.landing_scale(end)) for end in move.ends
        )
        one = Hinge(
            move.key,
            move.value,
            *move.ends,
            source=move.span.source,
            status=move.span.status,
            margin=nominal,
            margin_low=low,
            check_low=check_low,
            margin_high=high,
            check_high=check_high,
        )
        if one.effect > 5e-4:
            found.append(one)
    return tuple(sorted(found, key=lambda one: (not one.flips, -one.effect)))


#: Numbers of a load case that its friction, toothing and loads are assumed by, and their bounds.
_LOADS: dict[str, tuple[str, tuple[float, float]]] = {
    "friction_release": ("load.friction_release", (0.0, 1.0)),
    "application_factor": ("load.application_factor", (0.5, 10.0)),
    "load_sharing": ("load.load_sharing", (0.01, 1.0)),
    "accuracy": ("load.accuracy", (1, 11)),
}


def _load_moves(dog: Dog, limits: Limits, given: Collection[str], spans: Spans) -> Iterable[_Move]:
    """List the moves of the load case: friction, toothing and sharing of the dogs."""
    load = limits.load
    scattered = load.scatter(dog) is not None or load.run_out > 0.0
    for name, (key, (least, most)) in _LOADS.items():
        value = getattr(load, name)
        if value is None or (name == "load_sharing" and scattered):
            continue
        span: Span = getattr(spans, name)
        low, high = (min(max(end, least), most) for end in span.ends(value))
        if name == "friction_release":
            low = max(low, load.friction_hold)  # the upper end of the interval by its meaning
        yield _Move(key, value, (low, high), span, partial(_loaded, limits, name))
    if load.spline_friction == 0.0:
        return
    span = spans.spline_friction_release
    low, high = span.ends(load.release_friction)
    yield _Move(
        "load.spline_friction_release",
        load.release_friction,
        (max(low, load.spline_friction), high),
        span,
        partial(_loaded, limits, "spline_friction_release"),
    )
    if "mechanism.spline_radius_mm" not in given:
        radius, span = load.spline_radius / MM, spans.spline_radius
        yield _Move(
            "mechanism.spline_radius_mm",
            radius,
            span.ends(radius),
            span,
            lambda end: _loaded(limits, "spline_radius", end * MM),
        )


def _loaded(limits: Limits, name: str, value: float) -> Limits:
    changed: dict[str, Any] = {name: value}
    return replace(limits, load=replace(limits.load, **changed))


def _stiffened(limits: Limits, nominal: float, value: float) -> Limits:
    """Return limits with dogs as stiff as a contact of ``value``, where they are so at nominal."""
    if limits.load.contact_stiffness != nominal:  # a published set is softer than steel
        return limits
    return _loaded(limits, "contact_stiffness", value)


def _strike_moves(
    limits: Limits, mechanism: Mechanism, given: Collection[str], spans: Spans
) -> Iterable[_Move]:
    """List the moves of a strike: to an end of the study's own range, or of the assumed one.

    Ring and shaft that ``[strike]`` does not give are those of ``[mechanism]``.
    """
    strikes = limits.strikes
    if not strikes:
        return

    def at_end(name: str, end: float) -> Limits:
        kept = [one for one in strikes if getattr(one, name) == end]
        return replace(limits, strikes=tuple(kept or (_struck(one, name, end) for one in strikes)))

    for key, name in (
        ("ring_inertia_kgm2", "ring_inertia"),
        ("input_stiffness_Nm_rad", "input_stiffness"),
    ):
        values = [getattr(strike, name) for strike in strikes]
        span: Span = getattr(spans, name)
        ends = min(values), max(values)
        if ends[0] == ends[1]:
            ends = span.ends(ends[0])
        else:
            span = Span(*ends, source="range of the study", status="estimate")
        nominal: float = getattr(mechanism, name)
        section = "mechanism" if nominal and f"strike.{key}" not in given else "strike"
        value = nominal or math.sqrt(min(values) * max(values))
        yield _Move(f"{section}.{key}", value, ends, span, partial(at_end, name))


def _struck(strike: Strike, name: str, end: float) -> Strike:
    """Return a strike with another value; a ring is part of the sliding side."""
    largest = strike.sliding_inertia if name == "ring_inertia" else math.inf
    changed: dict[str, Any] = {name: min(end, largest)}
    return replace(strike, **changed)


def landing_by_stiffness(
    dog: Dog,
    limits: Limits,
    landings: Landings,
    contact_stiffness: float,
    span: Span = SPANS.contact_stiffness,
) -> tuple[float, float]:
    """Compute the smallest margin of a landing at either end of the contact's stiffness, Pa/m."""
    margins = []
    for end in span.ends(contact_stiffness):
        case = _stiffened(limits, contact_stiffness, end)
        demand = landings.demand(dog, case, math.sqrt(end / contact_stiffness))
        margins.append(min(check.margin for check in demand_checks(demand, case)))
    return margins[0], margins[1]
