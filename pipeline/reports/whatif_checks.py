"""Checks of a design as the page asks for them, by the code that the command line runs.

The page carries this module and those it imports, and runs them itself (Brython). So nothing here
may import what a browser has not: numpy, files. What samples or solves eigenvalues is worked out
beforehand for all that the page can ask, and looked up (``Known``).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.geometry import FLANKS, Dog, section
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.dog_strength import (
    Limits,
    margin_losses,
    strength_checks,
    strike_force,
)
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.locking import blocking_force, locking_friction
from dogshape.sim.strength.manufacture import Tolerances
from dogshape.sim.strength.strike import Strike
from dogshape.sim.units import MM, suffix_of, to_si

Known = dict[str, float]  #: values that a browser cannot work out, by function and arguments
DIAMETERS = ("outer_diameter", "inner_diameter")


@dataclass(frozen=True)
class KnownLoad(LoadCase):
    """Load case that keeps what it has worked out of the sharing of loads among dogs."""

    known: Known = field(default_factory=dict)

    def _load_share(self, count: int, scatter: float, wave: float) -> float:
        work = super()._load_share
        return _kept(self.known, "load", (count, scatter, wave), work)

    def _landing_share(self, count: int, scatter: float, wave: float) -> float:
        work = super()._landing_share
        return _kept(self.known, "landing", (count, scatter, wave), work)


@dataclass(frozen=True)
class KnownStrike(Strike):
    """Strike that keeps what it has worked out of the modes of the shafts."""

    known: Known = field(default_factory=dict)

    def _closed(self, speed: float, stiffness: float) -> float:
        work = super()._closed
        return _kept(self.known, "strike", (speed, stiffness), work)


def _kept(known: Known, name: str, asked: tuple[float, ...], work: Callable[..., float]) -> float:
    # Browsers may round the last digit of a logarithm or tangent differently.
    key = " ".join([name, *(f"{value:.9g}" for value in asked)])
    if key not in known:
        known[key] = work(*asked)
    return known[key]


def with_known(limits: Limits, known: Known) -> Limits:
    """Return the same limits, which look up and keep what a browser cannot work out."""
    strike = limits.strike
    if strike is not None:
        strike = KnownStrike(**_given(strike, Strike), known=known)
    return replace(
        limits, load=KnownLoad(**_given(limits.load, LoadCase), known=known), strike=strike
    )


def _given(one: Any, kind: type[Any]) -> dict[str, Any]:
    return {name.name: getattr(one, name.name) for name in fields(kind)}


def known_of(dog: Dog, limits: Limits, counts: range) -> Known:
    """Work out what checks of any shape with one of ``counts`` ask for, tolerances included.

    It depends on the number of dogs and on the diameters, which a search does not change.
    """
    known: Known = {}
    limits = with_known(limits, known)
    load, strike = limits.load, limits.strike
    torques = {load.static_torque(flank) for flank in FLANKS}
    torques |= {load.design_torque * load.share_of(flank) for flank in FLANKS}
    torques |= {abs(share) * load.design_torque for share, _ in load.spectrum}
    for count in counts:
        for shape in _diameters(_slender(dog, count), limits.tolerances):
            for torque in torques:
                load.sharing(shape, torque)
            if strike is not None:
                for flank in strike.flanks:
                    strike_force(shape, limits, strike, flank)
    return known


def _slender(dog: Dog, count: int) -> Dog:
    """Return a shape that exists with any count; its sides matter to no share."""
    return replace(
        dog, count=count, chamfer=0.0, traction=0.0, braking=0.0, height=0.5 * MM, edge_radius=0.0
    )


def _diameters(dog: Dog, tolerances: Tolerances) -> Iterator[Dog]:
    off = [(-one, 0.0, one) for one in (getattr(tolerances, name) for name in DIAMETERS)]
    for outer in off[0]:
        for inner in off[1]:
            yield replace(
                dog,
                outer_diameter=dog.outer_diameter + outer,
                inner_diameter=dog.inner_diameter + inner,
            )


@dataclass(frozen=True)
class Desk:
    """Design that the page changes, and what it is checked against."""

    dog: Dog
    limits: Limits

    def answer(self, asked: str) -> str:
        """Answer a question of the page; both are JSON.

        ``design`` has keys of the dog in edge units, ``friction_release`` and ``friction_hold``
        replace those of the load case, and ``tolerances`` asks for margins within them, too.
        """
        given = json.loads(asked)
        try:
            dog, limits = self._dog(given["design"]), self._limits(given)
        except DogshapeError as error:
            return json.dumps({"refusal": str(error)})
        found: dict[str, Any] = {
            "checks": [_record(check) for check in strength_checks(dog, limits)],
            "section": [[x / MM, z / MM] for x, z in section(dog)],
            "pitch_mm": dog.pitch / MM,
            "axial_length_mm": dog.axial_length / MM,
            "blocking_force_N": blocking_force(dog, limits.load),
            "locks_above": locking_friction(dog, limits.load),
        }
        if given.get("tolerances"):
            lost = margin_losses(dog, limits)
            found["lost"] = {name: spread.worst_case for name, spread in lost.items()}
        return json.dumps(found)

    def _dog(self, design: Mapping[str, float]) -> Dog:
        shape: dict[str, Any] = {
            name.removesuffix(suffix_of(name)): to_si(name, value) for name, value in design.items()
        }
        return replace(self.dog, **{**shape, "count": int(shape.get("count", self.dog.count))})

    def _limits(self, given: Mapping[str, Any]) -> Limits:
        names = ("friction_release", "friction_hold")
        friction = {name: given[name] for name in names if name in given}
        return replace(self.limits, load=replace(self.limits.load, **friction))


def _record(check: Check) -> dict[str, Any]:
    rule = check.rule
    return {
        "name": check.name, "value": check.value, "limit": check.limit, "unit": check.unit,
        "margin": check.margin, "passed": check.passed, "group": rule.group,
        "at_most": rule.at_most, "meaning": rule.meaning, "formula": rule.formula,
        "source": rule.source, "key": rule.key,
    }  # fmt: skip
