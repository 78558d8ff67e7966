"""``[mechanism]`` and ``[effects]`` of a study: what they make of its clutch and its shift force.

Both say the same in other words: a mechanism by its parts, effects by the names and parameters
of the diagnosis. Each changes fields of a setting, and no two may change the same one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from dogshape.pipeline.config.actuation import Actuation
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
REMEDY = "correct the mechanism"
Fields = dict[str, Any]  #: of a setting, by table and name
INERTIA = "rings.sliding_inertia"
#: Keys of ``[mechanism]`` by the field of the shift force that they set.
ACTUATION = {
    "factor": "force_factor",
    "loss": "force_loss_N",
    "rise_factor": "rise_factor",
    "delay": "delay_s",
    "lag": "lag_s",
}

#: What a study gives by keys of its own, by the table of a field: what to do instead.
ELSEWHERE = {
    "dog": "the dog, which [dog] and [variables] give; give the true shape there",
    "mismatch": "the mismatch, which [operating] gives; give the true one there",
    "angles": "how often each relative angle comes, but a study takes all alike; leave it out",
}


@dataclass(frozen=True)
class Source:
    """Key or effect of the file with the fields of a setting that it sets."""

    name: str
    fields: Fields


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
    section = section or MechanismSection()
    base = Setting(clutch, PROBE)
    sources = [
        *(Source(f"contact.{_contact_key(name)}", {f"contact.{name}": v})
          for name, v in contact.items()),
        *_of_section(section, clutch),
        *_of_effects(effects or {}, base),
    ]  # fmt: skip
    found = _merged(sources)
    changed = replace(
        clutch,
        contact=replace(clutch.contact, **_table(found, "contact")),
        mechanism=replace(clutch.mechanism, **_table(found, "mechanism")),
        rings=replace(clutch.rings, **_table(found, "rings")),
    )
    return changed, replace(actuation, **_table(found, "actuation"))


def mechanism_record(clutch: Clutch, actuation: Actuation) -> dict[str, float]:
    """List values that differ from no mechanism, keys and units as in ``[mechanism]``."""
    own = clutch.mechanism.record.items()
    found = {key.removeprefix("mechanism_"): value for key, value in own}
    lost = {"delay_s": actuation.delay, "lag_s": actuation.lag, "force_loss_N": actuation.loss}
    found |= {key: value for key, value in lost.items() if value != 0.0}
    factors = {"force_factor": actuation.factor, "rise_factor": actuation.rise_factor}
    return found | {key: value for key, value in factors.items() if value != 1.0}


def keys_changed(effect: Effect, values: Mapping[str, float], base: Setting) -> set[str]:
    """List the keys of a study that an effect stands for, as ``mechanism.delay_s``.

    Among them are ``mismatch`` and ``angles``, which no key gives. Where the displacement is read
    is no part of a study.
    """
    before, after = _flat(base), _flat(effect.apply(base, values))
    return {_shown(name) for name in after if after[name] != before[name] and name != "sensor"}


def _merged(sources: list[Source]) -> Fields:
    """Return all fields that are set; one that is set twice raises InputError."""
    found: Fields = {}
    by: dict[str, str] = {}
    for source in sources:
        for name, value in source.fields.items():
            if name in by:
                raise InputError(
                    f"{by[name]} and {source.name} both set {_shown(name)}; leave out one of them"
                )
            found[name], by[name] = value, source.name
    return found


def _table(found: Fields, table: str) -> dict[str, Any]:
    return {name.partition(".")[2]: v for name, v in found.items() if name.startswith(f"{table}.")}


def _of_section(section: MechanismSection, clutch: Clutch) -> Iterator[Source]:
    """Yield what each key of ``[mechanism]`` sets."""
    mechanism, given = section.mechanism(clutch.dog), section.given
    for key in given:
        if key in FIELDS:
            names = [FIELDS[key]]
            if key == "spline_friction" and "spline_radius_mm" not in given:
                names.append("spline_radius")
            yield Source(
                f"mechanism.{key}", {f"mechanism.{n}": getattr(mechanism, n) for n in names}
            )
    if section.delay_s is not None:
        require_between("mechanism.delay_s", section.delay_s, 0.0, 10.0, REMEDY)
        yield Source("mechanism.delay_s", {"actuation.delay": section.delay_s})
    if section.lag_s is not None:
        least = 0.0 if section.lag_s == 0.0 else LEAST_LAG
        require_between("mechanism.lag_s", section.lag_s, least, 10.0, REMEDY)
        yield Source("mechanism.lag_s", {"actuation.lag": section.lag_s})
    if section.force_loss_N is not None:
        require_between("mechanism.force_loss_N", section.force_loss_N, 0.0, 1e5, REMEDY)
        yield Source("mechanism.force_loss_N", {"actuation.loss": section.force_loss_N})
    for key, factor in (("force_factor", "factor"), ("rise_factor", "rise_factor")):
        if key in given:
            require_between(f"mechanism.{key}", given[key], 0.01, 10.0, REMEDY)
            yield Source(f"mechanism.{key}", {f"actuation.{factor}": given[key]})


def _of_effects(given: Mapping[str, Any], base: Setting) -> Iterator[Source]:
    """Yield what each effect of ``[effects]`` changes."""
    known = registry.load() if given else {}
    for name, value in given.items():
        if name not in known:
            raise InputError(f"'effects.{name}' is not a known effect; {did_you_mean(name, known)}")
        values = _values(known[name], value)
        if values is not None:
            yield Source(f"effects.{name}", _changes(known[name], values, base))


def _changes(effect: Effect, values: Mapping[str, float], base: Setting) -> Fields:
    """Return the fields that an effect changes; one that no study takes raises InputError."""
    try:
        changed = effect.apply(base, values)
    except DogshapeError as error:
        raise type(error)(f"effects.{effect.name}: {error}") from error
    before, after = _flat(base), _flat(changed)
    found = {name: after[name] for name in after if after[name] != before[name]}
    for name in found:
        table = name.partition(".")[0]
        if table not in ("contact", "mechanism", "actuation") and name != INERTIA:
            what = ELSEWHERE.get(
                table, f"{name}, which no study takes from an effect; leave it out"
            )
            raise InputError(f"effects.{effect.name} changes {what}")
    if "actuation.delay" in found:
        name = f"effects.{effect.name}: mechanism.delay_s"
        require_between(name, found["actuation.delay"], 0.0, 10.0, "correct the effect")
    return found


def _flat(setting: Setting) -> Fields:
    """Return all fields of a setting by table and name."""
    clutch, profile = setting.clutch, setting.point.profile
    parts = {name: getattr(clutch, name) for name in ("dog", "rings", "contact", "mechanism")}
    return {
        **{
            f"{table}.{f.name}": getattr(p, f.name) for table, p in parts.items() for f in fields(p)
        },
        "actuation.factor": profile.force / PROBE.profile.force,
        "actuation.loss": profile.loss,
        "actuation.rise_factor": profile.rise / PROBE.profile.rise,
        "actuation.lag": getattr(profile, "lag", 0.0),
        "actuation.delay": setting.delay + profile.delay,
        "mismatch": setting.point.mismatch,
        "angles": (setting.concentration, setting.centre),
        "sensor": setting.sensor,
        "solver": (clutch.solver, clutch.timeout, clutch.seated_tolerance, clutch.rebound),
    }


def _values(effect: Effect, given: Any) -> dict[str, float] | None:
    """Return the values of an effect's parameters; None of one that is not there."""
    names = [parameter.name for parameter in effect.parameters]
    if not names and isinstance(given, bool):
        return {} if given else None
    if len(names) == 1 and _is_number(given):
        return {names[0]: float(given)}
    if names and isinstance(given, dict) and all(map(_is_number, given.values())):
        return {name: float(value) for name, value in given.items()}
    kind = f"a number, its {names[0]}" if len(names) == 1 else "a table of numbers"
    if not names:
        kind = "true or false"
    example = f"effects.{effect.name} = {_example(effect)}"
    raise InputError(f"effects.{effect.name} is {given!r}, but it must be {kind}; write {example}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _example(effect: Effect) -> str:
    middles = {one.name: f"{one.at(0.5):.3g}" for one in effect.parameters}
    if len(middles) < 2:
        return next(iter(middles.values()), "true")
    return "{" + ", ".join(f"{name} = {value}" for name, value in middles.items()) + "}"


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
