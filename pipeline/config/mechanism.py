"""``[mechanism]`` and ``[effects]`` of a study: what they make of its clutch and its shift force.

Both say the same in other words: a mechanism by its parts, effects by the names and parameters
of the diagnosis. Each changes fields of a setting, and no two may change the same one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from typing import Any

from dogshape.pipeline.config.operating import Actuation
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import MechanismSection
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError, InputError, did_you_mean, require_between
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.mechanism import FIELDS

#: Where effects show what they change; a factor of a power of two is exact.
PROBE = OperatingPoint(1.0, ForceProfile(1024.0, 0.125))
LEAST_LAG = 1e-5  #: s, of a lag that is not 0
Fields = dict[str, Any]  #: of a setting, by table and name
Source = tuple[str, Fields]  #: key or effect of the file, and the fields of a setting that it sets
INERTIA = "rings.sliding_inertia"
#: Keys of ``[mechanism]`` by the field of the shift force that they set, in the order of checks.
ACTUATION = {
    "delay": "delay_s",
    "lag": "lag_s",
    "loss": "force_loss_N",
    "factor": "force_factor",
    "rise_factor": "rise_factor",
}
RANGES = {"delay": (0.0, 10.0), "lag": (LEAST_LAG, 10.0), "loss": (0.0, 1e5),
          "factor": (0.01, 10.0), "rise_factor": (0.01, 10.0)}  # fmt: skip
#: What a study gives by keys of its own, by the table of a field: what to do instead.
ELSEWHERE = {
    "dog": "the dog, which [dog] and [variables] give; give the true shape there",
    "mismatch": "the mismatch, which [operating] gives; give the true one there",
    "angles": "how often each relative angle comes, but a study takes all alike; leave it out",
}


def with_mechanism(
    clutch: Clutch,
    actuation: Actuation,
    section: MechanismSection | None,
    effects: Mapping[str, Any] | None,
    contact: Mapping[str, float],
) -> tuple[Clutch, Actuation]:
    """Return clutch and shift force of a study with its mechanism and its effects.

    Parameters
    ----------
    clutch, actuation : without them.
    section, effects : of the file, None where they are absent.
    contact : fields of the contact set that the file gives beside its name, SI.

    Raises
    ------
    InputError, EffectError
        A name that is unknown, a value out of range, or two that set the same.
    """
    sources = [
        *((f"contact.{_contact_key(n)}", {f"contact.{n}": v}) for n, v in contact.items()),
        *_of_section(section or MechanismSection(), clutch),
        *_of_effects(effects or {}, Setting(clutch, PROBE)),
    ]
    tables: dict[str, Fields] = {"contact": {}, "mechanism": {}, "rings": {}, "actuation": {}}
    by: dict[str, str] = {}
    for source, found in sources:
        for name, value in found.items():
            if name in by:
                raise InputError(
                    f"{by[name]} and {source} both set {_shown(name)}; leave out one of them"
                )
            by[name] = source
            table, _, own = name.partition(".")
            tables[table][own] = value
    changed = {n: replace(getattr(clutch, n), **tables[n])
               for n in ("contact", "mechanism", "rings")}  # fmt: skip
    return replace(clutch, **changed), replace(actuation, **tables["actuation"])


def mechanism_record(clutch: Clutch, actuation: Actuation) -> dict[str, float]:
    """List values that differ from no mechanism, keys and units as in ``[mechanism]``."""
    own = clutch.mechanism.record.items()
    found = {key.removeprefix("mechanism_"): value for key, value in own}
    neutral = Actuation(actuation.nominal)
    return found | {
        key: getattr(actuation, name)
        for name, key in ACTUATION.items()
        if getattr(actuation, name) != getattr(neutral, name)
    }


def keys_changed(effect: Effect, values: Mapping[str, float], base: Setting) -> set[str]:
    """List the keys of a study that an effect stands for, as ``mechanism.delay_s``.

    Among them are ``mismatch`` and ``angles``, which no key gives. Where the displacement is read
    is no part of a study.
    """
    changed = _difference(base, effect.apply(base, values))
    return {_shown(name) for name in changed if name != "sensor"}


def _of_section(section: MechanismSection, clutch: Clutch) -> Iterator[Source]:
    """Yield what each key of ``[mechanism]`` sets."""
    mechanism, given = section.mechanism(clutch.dog), section.given
    for key in given:
        if key in FIELDS:
            names = [FIELDS[key]]
            if key == "spline_friction" and "spline_radius_mm" not in given:
                names.append("spline_radius")
            yield f"mechanism.{key}", {f"mechanism.{n}": getattr(mechanism, n) for n in names}
    for name, key in ACTUATION.items():
        if key in given:
            low, high = RANGES[name]
            low = 0.0 if name == "lag" and given[key] == 0.0 else low
            require_between(f"mechanism.{key}", given[key], low, high, "correct the mechanism")
            yield f"mechanism.{key}", {f"actuation.{name}": given[key]}


def _of_effects(given: Mapping[str, Any], base: Setting) -> Iterator[Source]:
    """Yield what each effect of ``[effects]`` changes; one that no study takes is refused."""
    known = registry.load() if given else {}
    for name, value in given.items():
        if name not in known:
            raise InputError(f"'effects.{name}' is not a known effect; {did_you_mean(name, known)}")
        values = _values(known[name], value)
        if values is None:
            continue
        try:
            changed = known[name].apply(base, values)
        except DogshapeError as error:
            raise type(error)(f"effects.{name}: {error}") from error
        found = _difference(base, changed)
        for field in found:
            table = field.partition(".")[0]
            if table not in ("contact", "mechanism", "actuation") and field != INERTIA:
                what = f"{field}, which no study takes from an effect; leave it out"
                raise InputError(f"effects.{name} changes {ELSEWHERE.get(table, what)}")
        if "actuation.delay" in found:
            key = f"effects.{name}: mechanism.delay_s"
            require_between(key, found["actuation.delay"], 0.0, 10.0, "correct the effect")
        yield f"effects.{name}", found


def _difference(before: Setting, after: Setting) -> Fields:
    """Return the fields of a setting that differ from those of another."""
    old, new = _flat(before), _flat(after)
    return {name: value for name, value in new.items() if value != old[name]}


def _flat(setting: Setting) -> Fields:
    """Return all fields of a setting by table and name."""
    clutch, profile = setting.clutch, setting.point.profile
    parts = {name: getattr(clutch, name) for name in ("dog", "rings", "contact", "mechanism")}
    return {
        **{f"{n}.{f.name}": getattr(part, f.name) for n, part in parts.items()
           for f in fields(part)},
        "actuation.factor": profile.force / PROBE.profile.force,
        "actuation.loss": profile.loss,
        "actuation.rise_factor": profile.rise / PROBE.profile.rise,
        "actuation.lag": getattr(profile, "lag", 0.0),
        "actuation.delay": setting.delay + profile.delay,
        "mismatch": setting.point.mismatch,
        "angles": (setting.concentration, setting.centre),
        "sensor": setting.sensor,
        "solver": (clutch.solver, clutch.timeout, clutch.seated_tolerance, clutch.rebound),
    }  # fmt: skip


def _values(effect: Effect, given: Any) -> dict[str, float] | None:
    """Return the values of an effect's parameters; None of one that is not there."""
    names = [parameter.name for parameter in effect.parameters]

    def is_number(value: Any) -> bool:
        return isinstance(value, int | float) and not isinstance(value, bool)

    if not names and isinstance(given, bool):
        return {} if given else None
    if len(names) == 1 and is_number(given):
        return {names[0]: float(given)}
    if names and isinstance(given, dict) and all(map(is_number, given.values())):
        return {name: float(value) for name, value in given.items()}
    middles = [f"{one.at(0.5):.3g}" for one in effect.parameters]
    kind, example = (
        "a table of numbers",
        ", ".join(f"{name} = {value}" for name, value in zip(names, middles, strict=True)),
    )
    example = f"{{{example}}}"
    if len(names) < 2:
        kind = f"a number, its {names[0]}" if names else "true or false"
        example = middles[0] if names else "true"
    raise InputError(
        f"effects.{effect.name} is {given!r}, but it must be {kind}; write effects.{effect.name} = "
        f"{example}"
    )


def _shown(field: str) -> str:
    """Return a field as the key of the file that sets it."""
    table, _, name = field.partition(".")
    if table == "mechanism":
        name = next((key for key, one in FIELDS.items() if one == name), name)
    if table == "contact":
        name = _contact_key(name)
    if table == "actuation":
        table, name = "mechanism", ACTUATION[name]
    if field == INERTIA:
        return "sliding.inertia_kgm2"
    return f"{table}.{name}" if name else table


def _contact_key(name: str) -> str:
    units = {"stiction_velocity": "_m_s", "stiffness": "_Pa_m", "dissipation": "_s_m"}
    return name + units.get(name, "")
