"""How a study operates its clutch: shift force, operating points, mechanism, keys of a search.

Operating points are a bundled set, a grid, a list, or a draw from distributions: once, points of a
scrambled Sobol sequence with equal weights. A list beside a distribution goes with every draw.

The points of a design that keys of ``OPERATED`` are searched for are those of the study, with the
mismatch moved so that its mean over the mix is the set-point (the spread about it is the error of
the speed control, and stays); the final force times its factor, with the rise time that
``[actuation]`` has for it; and that rise time times its factor.

``[mechanism]`` and ``[effects]`` change clutch and shift force, and say the same in other words: a
mechanism by its parts, effects by the names and parameters of the diagnosis. Each changes fields of
a setting, and no two may change the same one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Field, Tag

from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import MechanismSection, Section, later, or_one
from dogshape.sim.effect import Effect
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import (
    DogshapeError,
    InputError,
    did_you_mean,
    ranges_of,
    require_known,
    require_ranges,
    within,
)
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile, RiseTable
from dogshape.sim.shift.clutch import Clutch, ContactSet, OperatingPoint
from dogshape.sim.shift.mechanism import NOTHING, Mechanism
from dogshape.sim.statistics.uncertainty import Distribution, sobol_shares
from dogshape.sim.texts import read_toml
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root

#: Quantities of an operating point, each with its weights in a grid.
AXES = {"mismatch_rpm": "mismatch_weight", "force_N": "force_weight"}
SAMPLES = 24  #: points that are drawn where the study does not say
DECIMALS = {"drawn": 3, "set-point": 6}  #: of drawn speeds and forces, and of the own set-point
#: Keys that state one quantity in two ways.
SAME = (
    ("dog.backlash_mm", "dog.backlash_deg"),
    ("load.accuracy", "load.pitch_sd_um"),
    ("wear.rate_mm3_Nm", "wear.crest_loss_mm"),
)
TABLE = "duty_cycles.toml"  #: beside the bundled studies
MISMATCH, FORCE, RISE = "mismatch_set_rpm", "force_factor", "rise_factor"
OPERATED = (MISMATCH, FORCE, RISE)  #: keys of ``[variables]`` that are none of the dog


Numbers = Annotated[list[float], or_one(int, float), Field(min_length=1)]
Weights = Annotated[list[Annotated[float, Field(gt=0.0)]], or_one(int, float), Field(min_length=1)]
Profiles = Callable[[float], ForceProfile]  #: the force profile of a nominal force in N


class ActuationSection(Section):
    """Rise time of the shift force by its final value; linear in between."""

    force_N: Numbers
    rise_s: Numbers


@dataclass(frozen=True)
class Actuation:
    """Rise times by the nominal final force, and how the sleeve's force differs from that.

    Dead time before the force starts and lag of first order behind its course, s; constant loss, N;
    factors on force and rise time. The rise keeps its time with a loss or a factor of the force.
    """

    nominal: RiseTable
    delay: float = within("delay_s", 0.0, 10.0, 0.0)
    lag: float = within("lag_s", 0.0, 10.0, 0.0)
    loss: float = within("force_loss_N", 0.0, 1e5, 0.0)
    factor: float = within("force_factor", 0.01, 10.0, 1.0)
    rise_factor: float = within("rise_factor", 0.01, 10.0, 1.0)

    def __post_init__(self) -> None:
        require_ranges(self, "mechanism", "correct the mechanism")

    @property
    def table(self) -> RiseTable:
        """Rise time by the final force at the sleeve, before the loss."""
        forces = tuple(self.factor * force for force in self.nominal.forces)
        return RiseTable(forces, tuple(self.rise_factor * rise for rise in self.nominal.rises))

    def profile(self, force: float, rise: float | None = None, other_way: str = "") -> ForceProfile:
        """Compute the force at the sleeve, N, from a nominal final ``force`` in N.

        A nominal ``rise`` in s overrides the table; ``other_way`` is what a user may do beside
        extending it where it lacks the force.
        """
        if rise is None:
            rise = self.nominal.profile(force, other_way).rise
        return self._shaped(self.factor * ForceProfile(force, rise).force, self.rise_factor * rise)

    def at_sleeve(self, force: float) -> ForceProfile:
        """Return the profile of a final ``force`` at the sleeve before the loss, N."""
        return self._shaped(force, self.table.profile(force).rise)

    def _shaped(self, force: float, rise: float) -> ForceProfile:
        return ForceProfile(force, rise, lag=self.lag, delay=self.delay, loss=self.loss)


#: A list of numbers or a distribution; tags have a space, which no key has.
Spread = Annotated[
    Annotated[Numbers, Tag("a list")] | Annotated[Distribution, Tag("a distribution")],
    Discriminator(lambda v: "a distribution" if isinstance(v, dict | Distribution) else "a list"),
]


class PointSection(Section):
    """One operating point of a list."""

    mismatch_rpm: float
    force_N: float
    weight: float = 1.0


class OperatingSection(Section):
    """Operating points: a set, grid, list or draw."""

    set: str | None = later()
    mismatch_rpm: Spread | None = later()
    force_N: Spread | None = later()
    mismatch_weight: Weights | None = later()
    force_weight: Weights | None = later()
    points: Annotated[list[PointSection], or_one(dict), Field(min_length=1)] | None = later()
    samples: Annotated[int, Field(ge=1, le=4096)] | None = later()
    seed: Annotated[int, Field(ge=0)] | None = later()

    def operating_points(self, profile: Profiles) -> tuple[OperatingPoint, ...]:
        """Return the operating points; mistakes raise InputError."""
        rows = self.rows()
        (place, count), *_ = Counter(row[:2] for row in rows).most_common(1)
        if count > 1:
            fault = f"[operating] has {place[0]:.6g} 1/min with {place[1]:.6g} N {count} times"
            raise InputError(f"{fault}; give it once with the sum of the weights")
        return tuple(OperatingPoint(m * RPM, profile(force), w) for m, force, w in rows)

    def rows(self) -> Sequence[tuple[float, float, float]]:
        """Return mismatch in 1/min, nominal force in N and weight of each operating point."""
        names = [name for name in AXES if isinstance(getattr(self, name), Distribution)]
        beside, keys = _statement({name: value for name, value in self if value is not None})
        for name, value in self:
            if value is not None and name not in keys:
                out, also = (
                    (name, "")
                    if len(keys) > 1
                    else (
                        keys[0],
                        (", or set operating.mismatch_rpm and operating.force_N, which replace it"),
                    )
                )
                raise InputError(
                    f"operating.{name} cannot stand beside {beside}; remove one of the two "
                    f"(--set operating.{out}=){also}"
                )
        if self.set is not None:
            known = read_toml(bundled_root() / TABLE)
            require_known("operating.set", self.set, "a set of points", known)
            return [(float(m), float(f), float(w)) for m, f, w in known[self.set]["rows"]]
        if self.points is not None:
            return [(p.mismatch_rpm, p.force_N, p.weight) for p in self.points]
        seed = 1 if self.seed is None else self.seed
        shares = iter(sobol_shares(self.samples or SAMPLES, len(names), seed).T if names else ())
        speeds, forces = (self._axis(name, shares) for name in AXES)
        if len(names) == len(AXES):
            return [(m, f, 1.0) for (m, _), (f, _) in zip(speeds, forces, strict=True)]
        return [(speed, force, v * w) for speed, v in speeds for force, w in forces]

    def _axis(self, name: str, shares: Iterator[Array]) -> list[tuple[float, float]]:
        """Return the values of an axis with their weights, drawn at the next of the shares."""
        values, key = getattr(self, name), AXES[name]
        if values is None:
            remedy = "add it, or list the points as [[operating.points]]"
            raise InputError(f"'operating.{name}' is missing; {remedy}")
        if isinstance(values, Distribution):
            drawn = values.checked(f"operating.{name}").at(next(shares))
            values = np.round(drawn, DECIMALS["drawn"]).tolist()
        weights = getattr(self, key) or [1.0] * len(values)
        if len(weights) != len(values):
            raise InputError(
                f"operating.{key} has {len(weights)} and operating.{name} {len(values)} values, "
                "but each needs its weight; give lists of equal length"
            )
        return list(zip(values, weights, strict=True))


def _statement(operating: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Name what states the points of ``[operating]``, and list the keys that belong to it."""
    for alone in ("set", "points"):
        if alone in operating:
            return f"operating.{alone}", [alone]
    if any(isinstance(operating.get(name), Mapping | Distribution) for name in AXES):
        return "a distribution", [*AXES, "samples", "seed"]
    return "lists of values", [*AXES, *AXES.values()]


def replaced_keys(settings: Mapping[str, Any], tables: Mapping[str, Any]) -> list[str]:
    """List the keys of a file's ``tables`` that ``settings`` replace by saying the same otherwise.

    Own points, an own set, or mismatch and force together state all points; one of the two does
    not. ``settings`` are by dotted key, None takes one out.
    """
    given = {key for key, value in settings.items() if value is not None}
    old = [
        key
        for name, table in tables.items()
        for key in (f"{name}.{one}" for one in (table if isinstance(table, Mapping) else ()))
        if key not in given
    ]
    void = {other for pair in SAME for one, other in (pair, pair[::-1]) if one in given}
    own = {key.partition(".")[2]: settings[key] for key in given if key.startswith("operating.")}
    if own.keys() & {"points", "set"} or AXES.keys() <= own.keys():
        stated = {f"operating.{key}" for key in _statement(own)[1]}
        void |= {key for key in old if key.startswith("operating.")} - stated
    return [key for key in old if key in void]


def own_set_point(points: Sequence[OperatingPoint]) -> dict[str, float]:
    """Return the keys of ``OPERATED`` as a study has them without any search."""
    weight = sum(point.weight for point in points)
    mean = sum(point.weight * point.mismatch for point in points) / weight
    return {MISMATCH: round(mean / RPM, DECIMALS["set-point"]), FORCE: 1.0, RISE: 1.0}


def operated_points(
    points: Sequence[OperatingPoint], actuation: Actuation, params: Mapping[str, float]
) -> tuple[OperatingPoint, ...]:
    """Return the operating points of a design; keys that are absent change nothing.

    Raises InputError for a force that ``[actuation]`` has no rise time for.
    """
    own = own_set_point(points)[MISMATCH]  # rounded alike, so that a study's own moves nothing
    move = (params.get(MISMATCH, own) - own) * RPM
    force, rise = params.get(FORCE, 1.0), params.get(RISE, 1.0)
    found = []
    for point in points:
        profile = point.profile
        if force != 1.0:
            profile = actuation.at_sleeve(profile.force * force)
        if rise != 1.0:
            profile = replace(profile, rise=profile.rise * rise)
        found.append(replace(point, mismatch=point.mismatch + move, profile=profile))
    return tuple(found)


#: Where effects show what they change; a factor of a power of two is exact.
PROBE = OperatingPoint(1.0, ForceProfile(1024.0, 0.125))
Fields = dict[str, Any]  #: of a setting, by table and name
#: Keys of ``[mechanism]`` by the field of the shift force that they set.
ACTUATION = {name: one.key for name, one in ranges_of(Actuation).items()}
#: Keys of a study by the field of a setting that they set, as far as an effect may set it.
KEYS = {"rings.sliding_inertia": "sliding.inertia_kgm2"} | {
    f"{part}.{name}": f"{table}.{one.key}"
    for part, table, kind in (
        ("contact", "contact", ContactSet),
        ("mechanism", "mechanism", Mechanism),
        ("actuation", "mechanism", Actuation),
    )
    for name, one in ranges_of(kind).items()
}


def with_mechanism(
    clutch: Clutch,
    actuation: Actuation,
    section: MechanismSection | None,
    effects: Mapping[str, Any] | None,
    contact: Mapping[str, float],
) -> tuple[Clutch, Actuation]:
    """Return clutch and shift force of a study with its mechanism and its effects.

    ``section`` and ``effects`` are those of the file, ``contact`` the SI fields that it gives
    beside a contact set. Raises InputError or EffectError for a name that is unknown, a value out
    of range, or two that set the same.
    """
    section = section or MechanismSection()
    mechanism, given = section.mechanism(clutch.dog), section.given
    own: Fields = {f"contact.{name}": value for name, value in contact.items()}
    own |= {f"mechanism.{n}": v for n, v in vars(mechanism).items() if v != getattr(NOTHING, n)}
    own |= {f"actuation.{name}": given[key] for name, key in ACTUATION.items() if key in given}
    sources = {name: KEYS[name] for name in own}
    for effect, found in _of_effects(effects or {}, Setting(clutch, PROBE)):
        for name in found:
            if name in own:
                fault = f"{sources[name]} and {effect} both set {KEYS[name]}"
                raise InputError(f"{fault}; leave out one of them")
        own |= found
        sources |= dict.fromkeys(found, effect)

    def changed(part: str, before: Any) -> Any:
        names = {name: name.removeprefix(f"{part}.") for name in own}
        return replace(before, **{new: own[name] for name, new in names.items() if new != name})

    parts = {one: changed(one, getattr(clutch, one)) for one in ("contact", "mechanism", "rings")}
    return replace(clutch, **parts), changed("actuation", actuation)


def keys_changed(effect: Effect, values: Mapping[str, float], base: Setting) -> set[str]:
    """List the keys of a study that an effect stands for, as ``mechanism.delay_s``.

    Among them are ``mismatch`` and ``angles``, which no key gives. Where the displacement is read
    is no part of a study.
    """
    changed = _difference(base, effect.apply(base, values))
    return {KEYS.get(name, name) for name in changed if name != "sensor"}


def _of_effects(given: Mapping[str, Any], base: Setting) -> Iterator[tuple[str, Fields]]:
    """Yield what each effect of ``[effects]`` changes; one that no study takes is refused."""
    known = registry.load() if given else {}
    for name, value in given.items():
        if name not in known:
            raise InputError(f"'effects.{name}' is not a known effect; {did_you_mean(name, known)}")
        if value is False and not known[name].parameters:
            continue
        values = _values(known[name], value)
        try:
            changed = known[name].apply(base, values)
        except DogshapeError as error:
            raise type(error)(f"effects.{name}: {error}") from error
        found = _difference(base, changed)
        for field in found:
            if field not in KEYS:
                raise InputError(
                    f"effects.{name} changes {field}, which no study takes from an effect; give "
                    "the true dog in [dog], the true mismatch in [operating], or leave it out"
                )
        yield f"effects.{name}", found


def _difference(before: Setting, after: Setting) -> Fields:
    """Return the fields of a setting that differ from those of another."""
    old, new = _flat(before), _flat(after)
    return {name: value for name, value in new.items() if value != old[name]}


def _flat(setting: Setting) -> Fields:
    """Return all fields of a setting by table and name."""
    profile, clutch = setting.point.profile, vars(setting.clutch)
    tables = {name: vars(clutch[name]) for name in ("dog", "rings", "contact", "mechanism")}
    return {
        **{f"{n}.{field}": value for n, part in tables.items() for field, value in part.items()},
        "actuation.factor": profile.force / PROBE.profile.force,
        "actuation.loss": profile.loss,
        "actuation.rise_factor": profile.rise / PROBE.profile.rise,
        "actuation.lag": profile.lag,
        "actuation.delay": setting.delay + profile.delay,
        "mismatch": setting.point.mismatch,
        "angles": (setting.concentration, setting.centre),
        "sensor": setting.sensor,
        "rest": {name: value for name, value in clutch.items() if name not in tables},
    }


def _values(effect: Effect, given: Any) -> dict[str, float]:
    """Return the values of an effect's parameters; a single one may stand alone."""
    names = [parameter.name for parameter in effect.parameters]
    table = {names[0]: given} if len(names) == 1 and not isinstance(given, dict) else given
    if not names and given is True:
        return {}
    if names and isinstance(table, dict) and {*map(type, table.values())} <= {int, float}:
        return {name: float(value) for name, value in table.items()}
    middles = ", ".join(f"{one.name} = {one.at(0.5):.3g}" for one in effect.parameters)
    must = f"numbers, as {{{middles}}}" if names else "true or false"
    raise InputError(f"effects.{effect.name} is {given!r}, but it must be {must}; correct it")
