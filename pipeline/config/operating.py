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

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from dogshape.bench.texts import read_toml
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import (
    LIST_TAG,
    ActuatorKeys,
    MechanismSection,
    Section,
    later,
    or_one,
)
from dogshape.sim.effect import Effect
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import (
    DogshapeError,
    InputError,
    Refusal,
    did_you_mean,
    join_faults,
    require_known,
)
from dogshape.sim.interface import key_argument
from dogshape.sim.quantity import quantities_of, quantity, require_ranges
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile, RiseTable
from dogshape.sim.shift.actuators import (
    COMMAND_RISES,
    KINDS,
    PROFILE,
    SECTION,
    Actuator,
    actuator_of,
    keys_of,
)
from dogshape.sim.shift.clutch import Clutch, ContactSet, OperatingPoint
from dogshape.sim.shift.mechanism import NO_MECHANISM, Mechanism
from dogshape.sim.statistics.uncertainty import Distribution, sobol_shares
from dogshape.sim.units import RPM, to_si
from dogshape.sim.versions import bundled_root

#: Quantities of an operating point, each with its weights in a grid.
AXES = {"mismatch_rpm": "mismatch_weight", "force_N": "force_weight"}
DEFAULT_SAMPLES = 24  #: points of a draw without ``samples``
DRAW_DECIMALS = 3  #: of drawn speeds, 1/min, and forces, N
SET_POINT_DECIMALS = 6  #: of the set-point of a study, 1/min
#: Pairs of keys that state one quantity.
ALTERNATIVE_KEYS = (
    ("dog.backlash_mm", "dog.backlash_deg"),
    ("load.accuracy", "load.pitch_sd_um"),
    ("wear.rate_mm3_Nm", "wear.crest_loss_mm"),
)
POINT_SETS = "duty_cycles.toml"  #: beside the bundled studies
KIND = f"{SECTION}.kind"
MISMATCH = "mismatch_set_rpm"
FORCE = "force_factor"
RISE = "rise_factor"
OPERATED = (MISMATCH, FORCE, RISE)  #: keys of ``[variables]`` for the operation


Numbers = Annotated[list[float], or_one(int, float), Field(min_length=1)]
Weights = Annotated[list[Annotated[float, Field(gt=0.0)]], or_one(int, float), Field(min_length=1)]
Profiles = Callable[[float], ForceProfile]  #: the force profile of a nominal force in N
PROFILE_KEYS = ("force_N", "rise_s")  #: of ``[actuation]``, of a force over time


class ActuationSection(ActuatorKeys):
    """Kind of the actuator (``sim.shift.actuators``) with its numbers.

    A profile has rise times of the shift force by its final value, linear in between.
    """

    kind: Literal["profile", "spring", "cam", "motor", "pneumatic", "hydraulic", "solenoid"] = (
        later(PROFILE)
    )
    force_N: Numbers | None = later()
    rise_s: Numbers | None = later()

    @property
    def actuator(self) -> Actuator | None:
        """Build the actuator, None for a profile; InputError for mistakes."""
        given = self.model_dump(exclude={"kind"}, exclude_none=True)
        for key in PROFILE_KEYS:
            if self.kind != PROFILE and given.pop(key, None) is not None:
                raise InputError(
                    f'{SECTION}.{key} belongs to {SECTION}.kind = "{PROFILE}", but the kind is '
                    f'"{self.kind}"; leave it out or change the kind'
                )
            given.pop(key, None)
        return actuator_of(self.kind, {key: to_si(key, value) for key, value in given.items()})

    @property
    def actuation(self) -> Actuation:
        """Build the actuation without mechanism and effects; InputError for mistakes."""
        actuator = self.actuator
        if actuator is not None:
            return Actuation(COMMAND_RISES, actuator=actuator)
        if self.force_N is None or self.rise_s is None:
            missing = [key for key in PROFILE_KEYS if getattr(self, key) is None]
            faults = [f"'{SECTION}.{key}' is missing; add it" for key in missing]
            raise InputError(join_faults(f'{SECTION}.kind = "{PROFILE}"', faults))
        return Actuation(RiseTable(tuple(self.force_N), tuple(self.rise_s)))


@dataclass(frozen=True)
class Actuation:
    """Rise times by the nominal final force, and how the sleeve's force differs from that.

    Dead time before the force starts and lag of first order behind its course, s; constant loss, N;
    factors on force and rise time. The rise keeps its time with a loss or a factor of the force.
    """

    nominal: RiseTable
    delay: float = quantity("delay_s", 0.0, 10.0, 0.0)
    lag: float = quantity("lag_s", 0.0, 10.0, 0.0)
    loss: float = quantity("force_loss_N", 0.0, 1e5, 0.0)
    factor: float = quantity("force_factor", 0.01, 10.0, 1.0)
    rise_factor: float = quantity("rise_factor", 0.01, 10.0, 1.0)
    actuator: Actuator | None = None  #: of which a force is the largest static one

    def __post_init__(self) -> None:
        require_ranges(self, "mechanism", "correct the mechanism")
        if self.actuator is not None:
            self.actuator.require_course(self.lag, self.rise_factor)

    @property
    def full_force(self) -> float | None:
        """Largest static force of the actuator, N; None for a profile."""
        return None if self.actuator is None else self.actuator.full_force

    @property
    def table(self) -> RiseTable:
        """Rise time, s, by the final force at the sleeve before the loss, N."""
        forces = tuple(self.factor * force for force in self.nominal.forces)
        rises = tuple(self.rise_factor * rise for rise in self.nominal.rises)
        return RiseTable(forces, rises)

    def profile(self, force: float, rise: float | None = None, other_way: str = "") -> ForceProfile:
        """Compute the force at the sleeve from a nominal final force.

        Parameters
        ----------
        force
            Nominal final force, N.
        rise
            Nominal rise time, s; by default that of the table.
        other_way
            Remedy for a force outside the table, besides an extension of the table.

        """
        if self.actuator is not None:
            self.actuator.require_force(force)
            if rise is not None:
                rule = f"the {self.actuator.kind} actuator has no rise time"
                remedy = f'leave it out, or take {SECTION}.kind = "{PROFILE}"'
                raise InputError(Refusal("rise time of the force", rise, "s", rule, remedy))
        if rise is None:
            rise = self.nominal.profile(force, other_way).rise
        final_force = self.factor * ForceProfile(force, rise).force
        return self._sleeve_profile(final_force, self.rise_factor * rise)

    def at_sleeve(self, force: float) -> ForceProfile:
        """Return the force profile with a final ``force`` at the sleeve before the loss, N."""
        return self._sleeve_profile(force, self.table.profile(force).rise)

    def _sleeve_profile(self, force: float, rise: float) -> ForceProfile:
        """Add lag, delay and loss to a final force, N, and a rise time, s, at the sleeve."""
        return ForceProfile(force, rise, lag=self.lag, delay=self.delay, loss=self.loss)


#: A list of numbers or a distribution; tags have a space, which no key has.
Spread = Annotated[
    Annotated[Numbers, Tag(LIST_TAG)] | Annotated[Distribution, Tag("a distribution")],
    Discriminator(lambda v: "a distribution" if isinstance(v, dict | Distribution) else LIST_TAG),
]


class PointSection(Section):
    """One operating point of a list."""

    mismatch_rpm: float
    force_N: float | None = later()
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

    def operating_points(
        self, profile: Profiles, full_force: float | None = None
    ) -> tuple[OperatingPoint, ...]:
        """Build the operating points; InputError for a mistake."""
        rows = self.rows(full_force)
        places = Counter((mismatch, force) for mismatch, force, _ in rows)
        (mismatch, force), count = places.most_common(1)[0]
        if count > 1:
            fault = f"[operating] has {mismatch:.6g} 1/min with {force:.6g} N {count} times"
            raise InputError(f"{fault}; give it once with the sum of the weights")
        return tuple(
            OperatingPoint(mismatch * RPM, profile(force), weight)
            for mismatch, force, weight in rows
        )

    def rows(self, full_force: float | None = None) -> Sequence[tuple[float, float, float]]:
        """Return mismatch, 1/min, nominal force, N, and weight of each operating point.

        ``full_force`` is that of an actuator in N, which points without a force take.
        """
        self._require_single_statement()
        if self.set is not None:
            point_sets = read_toml(bundled_root() / POINT_SETS)
            require_known("operating.set", self.set, "a set of points", point_sets)
            rows = point_sets[self.set]["rows"]
            return [
                (float(mismatch), float(force), float(weight)) for mismatch, force, weight in rows
            ]
        if self.points is not None:
            return [
                (point.mismatch_rpm, _point_force(point, place, full_force), point.weight)
                for place, point in enumerate(self.points)
            ]
        drawn_axes = self._drawn_axes()
        seed = 1 if self.seed is None else self.seed
        count = self.samples or DEFAULT_SAMPLES
        shares = iter(sobol_shares(count, len(drawn_axes), seed).T if drawn_axes else ())
        speeds = self._axis("mismatch_rpm", shares)
        if self.force_N is None and self.force_weight is None and full_force is not None:
            forces = [(full_force, 1.0)]
        else:
            forces = self._axis("force_N", shares)
        if len(drawn_axes) == len(AXES):
            pairs = zip(speeds, forces, strict=True)
            return [(speed, force, 1.0) for (speed, _), (force, _) in pairs]
        return [
            (speed, force, speed_weight * force_weight)
            for (speed, speed_weight), (force, force_weight) in itertools.product(speeds, forces)
        ]

    @property
    def mismatch_bounds(self) -> list[float]:
        """Finite bounds of a mismatch that is drawn, 1/min; empty for points that are given."""
        if not isinstance(self.mismatch_rpm, Distribution):
            return []
        return [bound for bound in self.mismatch_rpm.bounds if math.isfinite(bound)]

    def _drawn_axes(self) -> list[str]:
        """List the quantities of ``AXES`` that are distributions."""
        return [name for name in AXES if isinstance(getattr(self, name), Distribution)]

    def _require_single_statement(self) -> None:
        """Raise InputError where keys state the points in two ways."""
        statement, keys = _statement({name: value for name, value in self if value is not None})
        for name, value in self:
            if value is None or name in keys:
                continue
            surplus_key = name
            alternative = ""
            if len(keys) == 1:
                surplus_key = keys[0]
                alternative = (
                    ", or set operating.mismatch_rpm and operating.force_N, which replace it"
                )
            raise InputError(
                f"operating.{name} cannot stand beside {statement}; remove one of the two "
                f"({key_argument('settings', f'operating.{surplus_key}', '')}){alternative}"
            )

    def _axis(self, name: str, shares: Iterator[Array]) -> list[tuple[float, float]]:
        """Return the values of an axis with their weights, drawn at the next of ``shares``."""
        values = getattr(self, name)
        weight_key = AXES[name]
        if values is None:
            remedy = "add it, or list the points as [[operating.points]]"
            raise InputError(f"'operating.{name}' is missing; {remedy}")
        if isinstance(values, Distribution):
            draws = values.checked(f"operating.{name}").at(next(shares))
            values = np.round(draws, DRAW_DECIMALS).tolist()
        weights = getattr(self, weight_key) or [1.0] * len(values)
        if len(weights) != len(values):
            raise InputError(
                f"operating.{weight_key} has {len(weights)} and operating.{name} {len(values)} "
                "values, but each needs its weight; give lists of equal length"
            )
        return list(zip(values, weights, strict=True))


def _point_force(point: PointSection, place: int, full_force: float | None) -> float:
    """Return the nominal force of a listed point, N; InputError where it has none."""
    force = full_force if point.force_N is None else point.force_N
    if force is None:
        raise InputError(f"'operating.points.{place}.force_N' is missing; add it")
    return force


def _statement(operating: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Return the words and the keys of the statement of points in ``[operating]``."""
    for key in ("set", "points"):
        if key in operating:
            return f"operating.{key}", [key]
    if any(isinstance(operating.get(name), Mapping | Distribution) for name in AXES):
        return "a distribution", [*AXES, "samples", "seed"]
    return "lists of values", [*AXES, *AXES.values()]


def replaced_keys(settings: Mapping[str, Any], tables: Mapping[str, Any]) -> list[str]:
    """List the keys of a file that become void by settings.

    Settings of points, of a set, or of mismatch and force together replace all points.

    Parameters
    ----------
    settings
        Values by dotted key; None takes a key out.
    tables
        Tables of the file.

    """
    setting_keys = {key for key, value in settings.items() if value is not None}
    file_keys = [key for key in dotted_keys(tables) if key not in setting_keys]
    void_keys = _alternatives(setting_keys)
    kind = settings.get(KIND)
    if kind is not None:
        kind_keys = keys_of(kind) if kind in KINDS else PROFILE_KEYS
        void_keys |= {
            key
            for key in file_keys
            if key.startswith(f"{SECTION}.") and key.removeprefix(f"{SECTION}.") not in kind_keys
        }
    prefix = "operating."
    operating = {
        key.removeprefix(prefix): settings[key] for key in setting_keys if key.startswith(prefix)
    }
    if operating.keys() & {"points", "set"} or AXES.keys() <= operating.keys():
        statement_keys = {prefix + key for key in _statement(operating)[1]}
        point_keys = {key for key in file_keys if key.startswith(prefix)}
        void_keys |= point_keys - statement_keys
    return [key for key in file_keys if key in void_keys]


def _alternatives(keys: set[str]) -> set[str]:
    """List the keys that state a quantity of ``keys`` in another way."""
    alternatives = {second for first, second in ALTERNATIVE_KEYS if first in keys}
    return alternatives | {first for first, second in ALTERNATIVE_KEYS if second in keys}


def dotted_keys(tables: Mapping[str, Any]) -> Iterator[str]:
    """Yield the dotted keys within the tables of a file."""
    for name, table in tables.items():
        if isinstance(table, Mapping):
            for key in table:
                yield f"{name}.{key}"


def value_at(tables: Mapping[str, Any], key: str) -> Any:
    """Look up a dotted key; None if it is missing."""
    value: Any = tables
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def nominal_operation(points: Sequence[OperatingPoint]) -> dict[str, float]:
    """Return the values of ``OPERATED`` that leave the points of a study unchanged."""
    weight = sum(point.weight for point in points)
    mean = sum(point.weight * point.mismatch for point in points) / weight
    return {MISMATCH: round(mean / RPM, SET_POINT_DECIMALS), FORCE: 1.0, RISE: 1.0}


def points_of_design(
    points: Sequence[OperatingPoint], actuation: Actuation, params: Mapping[str, float]
) -> tuple[OperatingPoint, ...]:
    """Return the operating points of a design; keys that are absent change nothing.

    Raises InputError for a force that ``[actuation]`` has no rise time for.
    """
    # The nominal set-point is rounded as the searched one, so that the study's own moves nothing.
    nominal_mismatch = nominal_operation(points)[MISMATCH]
    mismatch_change = (params.get(MISMATCH, nominal_mismatch) - nominal_mismatch) * RPM
    force_factor = params.get(FORCE, 1.0)
    rise_factor = params.get(RISE, 1.0)
    design_points = []
    for point in points:
        profile = point.profile
        if force_factor != 1.0:
            profile = actuation.at_sleeve(profile.force * force_factor)
        if rise_factor != 1.0:
            profile = replace(profile, rise=profile.rise * rise_factor)
        mismatch = point.mismatch + mismatch_change
        design_points.append(replace(point, mismatch=mismatch, profile=profile))
    return tuple(design_points)


#: Operating point at which effects are compared; a factor of a power of two is exact.
PROBE = OperatingPoint(1.0, ForceProfile(1024.0, 0.125))
Fields = dict[str, Any]  #: of a setting, by table and name
#: Keys of ``[mechanism]`` by the field of the shift force that they set.
ACTUATION_KEYS = {name: declared.key for name, declared in quantities_of(Actuation).items()}


def _study_keys(part: str, table: str, kind: type) -> dict[str, str]:
    """Map the fields of a part of a setting to dotted keys of a study."""
    quantities = quantities_of(kind).items()
    return {f"{part}.{name}": f"{table}.{declared.key}" for name, declared in quantities}


#: Keys of a study by the field of a setting that they set, as far as an effect may set it.
STUDY_KEYS = {
    "rings.sliding_inertia": "sliding.inertia_kgm2",
    **_study_keys("contact", "contact", ContactSet),
    **_study_keys("mechanism", "mechanism", Mechanism),
    **_study_keys("actuation", "mechanism", Actuation),
}


def with_mechanism(
    clutch: Clutch,
    actuation: Actuation,
    section: MechanismSection | None,
    effects: Mapping[str, Any] | None,
    contact: Mapping[str, float],
) -> tuple[Clutch, Actuation]:
    """Add the mechanism and the effects of a study to its clutch and shift force.

    Parameters
    ----------
    clutch, actuation
        Values without mechanism and effects.
    section, effects
        ``[mechanism]`` and ``[effects]`` of the file.
    contact
        SI fields that the file gives besides a contact set.

    Raises
    ------
    InputError, EffectError
        For a name that is unknown, a value out of range, or two settings of one field.

    """
    section = section or MechanismSection()
    fields = _section_fields(section, clutch, contact)
    sources = {name: STUDY_KEYS[name] for name in fields}
    for effect, changes in _effect_changes(effects or {}, Setting(clutch, PROBE)):
        for name in changes:
            if name in fields:
                fault = f"{sources[name]} and {effect} both set {STUDY_KEYS[name]}"
                raise InputError(f"{fault}; leave out one of them")
        fields |= changes
        sources |= dict.fromkeys(changes, effect)
    parts = {
        name: _replace_fields(name, getattr(clutch, name), fields)
        for name in ("contact", "mechanism", "rings")
    }
    return replace(clutch, **parts), _replace_fields("actuation", actuation, fields)


def _section_fields(
    section: MechanismSection, clutch: Clutch, contact: Mapping[str, float]
) -> Fields:
    """Collect the fields that ``[contact]`` and ``[mechanism]`` set."""
    fields: Fields = {f"contact.{name}": value for name, value in contact.items()}
    for name, value in vars(section.mechanism(clutch.dog)).items():
        if value != getattr(NO_MECHANISM, name):
            fields[f"mechanism.{name}"] = value
    for name, key in ACTUATION_KEYS.items():
        if key in section.given:
            fields[f"actuation.{name}"] = section.given[key]
    return fields


def _replace_fields(part: str, value: Any, fields: Fields) -> Any:
    """Replace the fields of one part of a setting, ``contact`` for instance."""
    prefix = f"{part}."
    changes = {
        name.removeprefix(prefix): change
        for name, change in fields.items()
        if name.startswith(prefix)
    }
    return replace(value, **changes)


def effect_keys(effect: Effect, values: Mapping[str, float], base: Setting) -> set[str]:
    """List the dotted keys of a study that an effect sets, ``mechanism.delay_s`` for instance.

    ``mismatch`` and ``angles``, which are no keys, are listed too. The place at which displacement
    is read is not: it is no part of a study.
    """
    changes = _difference(base, effect.apply(base, values))
    return {STUDY_KEYS.get(name, name) for name in changes if name != "sensor"}


def _effect_changes(table: Mapping[str, Any], base: Setting) -> Iterator[tuple[str, Fields]]:
    """Yield the key of each effect in ``[effects]`` and the fields that it changes.

    InputError for an effect that is unknown or changes what no study takes.
    """
    effects = registry.load() if table else {}
    for name, value in table.items():
        if name not in effects:
            raise InputError(
                f"'effects.{name}' is not a known effect; {did_you_mean(name, effects)}"
            )
        effect = effects[name]
        if value is False and not effect.parameters:
            continue
        values = _parameter_values(effect, value)
        try:
            setting = effect.apply(base, values)
        except DogshapeError as error:
            raise type(error)(f"effects.{name}: {error}") from error
        changes = _difference(base, setting)
        for field in changes:
            if field not in STUDY_KEYS:
                raise InputError(
                    f"effects.{name} changes {field}, which no study takes from an effect; give "
                    "the true dog in [dog], the true mismatch in [operating], or leave it out"
                )
        yield f"effects.{name}", changes


def _difference(base: Setting, changed: Setting) -> Fields:
    """Return the fields of a changed setting that differ from ``base``."""
    base_fields = _flat_fields(base)
    return {
        name: value for name, value in _flat_fields(changed).items() if value != base_fields[name]
    }


def _flat_fields(setting: Setting) -> Fields:
    """Return all fields of a setting by part and name, ``contact.stiffness`` for instance."""
    profile = setting.point.profile
    clutch = {entry.name: getattr(setting.clutch, entry.name) for entry in fields(setting.clutch)}
    parts = ("dog", "rings", "contact", "mechanism")
    part_fields: Fields = {}
    for part in parts:
        part_fields |= {f"{part}.{name}": value for name, value in vars(clutch[part]).items()}
    return {
        **part_fields,
        "actuation.factor": profile.force / PROBE.profile.force,
        "actuation.loss": profile.loss,
        "actuation.rise_factor": profile.rise / PROBE.profile.rise,
        "actuation.lag": profile.lag,
        "actuation.delay": setting.delay + profile.delay,
        "mismatch": setting.point.mismatch,
        "angles": (setting.concentration, setting.centre),
        "sensor": setting.sensor,
        "rest": {name: value for name, value in clutch.items() if name not in parts},
    }


def _parameter_values(effect: Effect, value: Any) -> dict[str, float]:
    """Return the parameters of an effect by name from its value in a study file.

    ``value`` is a table, a number for a single parameter, or true for none.
    """
    names = [parameter.name for parameter in effect.parameters]
    if not names and value is True:
        return {}
    is_single = len(names) == 1 and not isinstance(value, dict)
    table = {names[0]: value} if is_single else value
    if names and isinstance(table, dict):
        kinds = {type(number) for number in table.values()}
        if kinds <= {int, float}:
            return {name: float(number) for name, number in table.items()}
    middles = ", ".join(
        f"{parameter.name} = {parameter.at(0.5):.3g}" for parameter in effect.parameters
    )
    rule = f"numbers, as {{{middles}}}" if names else "true or false"
    raise InputError(f"effects.{effect.name} is {value!r}, but it must be {rule}; correct it")
