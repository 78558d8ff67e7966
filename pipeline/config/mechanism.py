"""``[mechanism]`` and ``[effects]`` of a study: what they make of its clutch and its shift force.

Both say the same in other words: a mechanism by its parts, effects by the names and parameters
of the diagnosis. Each changes fields of a setting, and no two may change the same one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from dogshape.pipeline.config.operating import Actuation
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import MechanismSection
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError, InputError, did_you_mean, ranges_of
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, ContactSet, OperatingPoint
from dogshape.sim.shift.mechanism import NOTHING, Mechanism

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
    own |= {
        f"mechanism.{name}": value
        for name, value in vars(mechanism).items()
        if value != getattr(NOTHING, name)
    }
    own |= {f"actuation.{name}": given[key] for name, key in ACTUATION.items() if key in given}
    sources = {name: KEYS[name] for name in own}
    for effect, found in _of_effects(effects or {}, Setting(clutch, PROBE)):
        for name in found:
            if name in own:
                raise InputError(
                    f"{sources[name]} and {effect} both set {KEYS[name]}; leave out one of them"
                )
        own |= found
        sources |= dict.fromkeys(found, effect)
    tables: dict[str, Fields] = {"contact": {}, "mechanism": {}, "rings": {}, "actuation": {}}
    for name, value in own.items():
        table, _, field = name.partition(".")
        tables[table][field] = value
    actuation = replace(actuation, **tables.pop("actuation"))
    parts = {name: replace(getattr(clutch, name), **new) for name, new in tables.items()}
    return replace(clutch, **parts), actuation


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
