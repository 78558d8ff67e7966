"""Tables of files (study, bench data) that describe a clutch, and their mistakes.

Here are only keys and types; what a value may be is the business of the physics that uses it. The
validator names each broken rule by a kind; ``RULES`` has its words.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Optional, TypeVar, get_args, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import ErrorDetails

from dogshape.sim.errors import InputError, did_you_mean, meant_number, ranges_of, refusal
from dogshape.sim.shift.clutch import Rings
from dogshape.sim.shift.drive import Drive, EngineSide, SpeedControl
from dogshape.sim.shift.geometry import SCOPE, Dog
from dogshape.sim.shift.mechanism import FIELDS, NOTHING, SPLINE, Mechanism
from dogshape.sim.texts import join_faults
from dogshape.sim.units import DEG, from_si, suffix_of, to_si, unit_of

SHOWN = 60  #: characters of a value that a sentence shows
NAME = "letters, digits, '_', '-' and '.' only, without blanks, beginning with no '-' or '.'"

_WHOLE, _NUMBER, _BOOL, _TABLE = "a whole number", "a number", "true or false", "a table of keys"
#: What a value must be, by the kind of the rule; in braces what the rule limits it to.
RULES: Mapping[str, str] = {
    **dict.fromkeys(("bool_parsing", "bool_type"), _BOOL),
    **dict.fromkeys(("dict_type", "model_attributes_type", "model_type"), _TABLE),
    **dict.fromkeys(("float_parsing", "float_type"), _NUMBER),
    **dict.fromkeys(("int_from_float", "int_parsing", "int_type"), _WHOLE),
    "int_parsing_size": f"{_WHOLE} of a few digits",
    "greater_than": "above {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "below {lt}",
    "less_than_equal": "at most {le}",
    "literal_error": "one of {expected}",
    "path_type": "a path",
    "string_type": "a text in quotation marks",
    "string_pattern_mismatch": NAME,
    "string_too_long": "not longer than {max_length} characters",
    "string_too_short": "not empty",
    "list_type": "a list in square brackets",
    "too_long": "a list of at most {max_length} values",
    "too_short": "a list of at least {min_length} values",
}


def broken_rule(name: str, error: ErrorDetails) -> str:
    """Return the sentence on a value that breaks a rule: name, value, rule and remedy."""
    rule, unit = RULES.get(error["type"], "of another kind"), unit_of(name)
    rule = rule.format(**error.get("ctx", {})).replace(" 1 values", " one value")
    remedy = _remedy(rule, error.get("input"))
    rule += f" in {unit}" if unit and rule == _NUMBER else ""
    text = repr(error.get("input"))
    shown = text if len(text) <= SHOWN else f"{text[:SHOWN]}... ({len(text)} characters)"
    return f"{name} is {shown}, but it must be {rule}; {remedy}"


def _remedy(rule: str, given: Any) -> str:
    if "number" in rule and isinstance(given, str):
        meant = meant_number(given)
        if meant is None:
            return "write the number alone, without a unit"
        if rule == _NUMBER or meant == round(meant):
            return f"write {meant:g}"
    if rule == RULES["list_type"]:
        text = str(given).strip("[]() ")
        parts = re.split(r",?[\s;]+" if re.search(r"[\s;]", text) else ",", text)
        numbers = [f"{one:g}" for one in map(meant_number, parts) if one is not None]
        return f"write [{','.join(numbers or [repr(text[:SHOWN])])}]"
    if rule == _TABLE:
        return "give its keys one by one"
    low, high = rule.startswith(("at least", "above")), rule.startswith(("at most", "below"))
    return "raise it" if low else "lower it" if high else "correct the value"


Model = TypeVar("Model", bound=BaseModel)


class Section(BaseModel):
    """A table of a file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def later(default: Any = None) -> Any:
    """Return the default of a key that came later: as such it is no part of a file's hash."""
    return Field(default=default, exclude_if=lambda value: value == default)


def or_one(*kinds: type) -> BeforeValidator:
    """Let one value of some kinds stand for a list of it."""
    return BeforeValidator(lambda value: [value] if type(value) in kinds else value)


class Keys(Section):
    """A section of keys that make a value of ``sim``: all of it, or what differs from a set."""

    kind: ClassVar[Any]
    named: ClassVar[Any] = None  #: gives a set by its name

    def si(self, *without: str) -> dict[str, Any]:
        """Return the values that are given as SI fields, but for the set and some keys."""
        given = self.model_dump(exclude={"set", *without}, exclude_none=True)
        numbers = {key: value for key, value in given.items() if isinstance(value, float)}
        return {k: v for k, v in given.items() if k not in numbers} | si_fields(numbers)

    @property
    def value(self) -> Any:
        """The value; InputError for mistakes."""
        if self.named is None:
            return self.kind(**self.si())
        return replace(type(self).named(getattr(self, "set")), **self.si())  # noqa: B009


def keys_of(
    of: Any,
    named_by: Any = None,
    *,
    leave: Sequence[str] = (),
    late: Sequence[str] = (),
    kind_of_number: Any = None,
) -> Any:
    """Make the base of a section from the ranges of a value of ``sim`` (``within``).

    An absent key has the value's default, or None beside the ``set`` that a name gives. Fields of
    ``leave`` have no key. Those of ``late``, and of the default None, came later (``later``).
    ``kind_of_number`` is what keys hold where that is not a number alone.
    """

    class Base(Keys):
        kind = of
        named = named_by

    keys: dict[str, Any] = {}
    hints = get_type_hints(of)
    for name, (key, *_) in ranges_of(of).items():
        default: Any = None if named_by else getattr(of, name, None if name in late else ...)
        hint = kind_of_number or hints[name]
        hint = Optional[hint] if default is None else hint  # noqa: UP045  # no '|' for Annotated
        if default not in (None, ...):
            default = from_si(key, default)
        if name in late or (default is None and not named_by):
            default = later(default)
        if name not in leave:
            keys[key] = (hint, default)
    return create_model(f"{of.__name__}Keys", __base__=Base, **keys)


def mm_per_deg(outer: float, inner: float) -> float:
    """Convert a degree about the shaft to mm at the mean radius of two diameters, mm."""
    return 0.25 * DEG * (outer + inner)


class DogSection(keys_of(Dog, late=("edge_radius", "crest", "chamfer_back", "backlash"))):  # type: ignore[misc]
    """Geometry of the dogs of both rings."""

    @model_validator(mode="before")
    @classmethod
    def _lengths(cls, data: Any) -> Any:
        """Turn ``backlash_deg`` into ``backlash_mm``; its faults join those of other keys."""
        if not isinstance(data, dict) or "backlash_deg" not in data:
            return data
        given, name = dict(data), "dog.backlash_deg"
        angle = given.pop("backlash_deg")
        if "backlash_mm" in data:
            raise ValueError(
                f"{name} is {angle} deg beside dog.backlash_mm = {given['backlash_mm']}, but both "
                "are one play; give one of them"
            )
        if isinstance(angle, bool) or not isinstance(angle, int | float):
            wrong: Any = {"type": "float_type", "input": angle}
            raise ValueError(broken_rule(name, wrong))
        try:
            per_deg = mm_per_deg(data["outer_diameter_mm"], data["inner_diameter_mm"])
            most = ranges_of(Dog)["backlash"].high / per_deg
        except (KeyError, TypeError, ZeroDivisionError):  # keys that are refused in their own words
            return given
        if not 0.0 <= angle <= abs(most):
            rule = f"it must lie between 0 and {abs(most):.6g} deg"
            raise ValueError(refusal(name, angle, "deg", rule, "check the angle and its unit"))
        return given | {"backlash_mm": angle * per_deg}


class SlidingSection(Section):
    """The ring that is shifted."""

    mass_kg: float
    inertia_kgm2: float
    initial_speed_rpm: float = 0.0  #: of earlier files, which may say that the ring stands


class OutputSection(Section):
    """The ring that it engages."""

    inertia_kgm2: float


class SpeedControlSection(keys_of(SpeedControl)):  # type: ignore[misc]
    """Speed control of the mismatch (``sim.shift.drive``)."""


_Torques = Annotated[list[float], or_one(int, float), Field(min_length=1)]


class DriveSection(Section):
    """Speed of both shafts before the shift, torques on them during it (``sim.shift.drive``)."""

    shaft_speed_rpm: float = later(0.0)
    engine_side: EngineSide = later("sliding")
    sliding_torque_Nm: _Torques | None = later()
    output_torque_Nm: _Torques | None = later()
    torque_time_s: list[float] | None = later()
    pack_torque_Nm: float = later(0.0)
    pack_viscous_Nms_rad: float = later(0.0)
    pack_speed_rpm: float = later(0.0)
    synchroniser_torque_Nm: float = later(0.0)
    control: SpeedControlSection | None = later()

    @property
    def value(self) -> Drive:
        """The drive; InputError for mistakes."""
        tables = {
            "sliding_torque": self.sliding_torque_Nm,
            "output_torque": self.output_torque_Nm,
            "times": self.torque_time_s,
        }
        return Drive(
            shaft_speed=to_si("_rpm", self.shaft_speed_rpm),
            engine_side=self.engine_side,
            pack_torque=self.pack_torque_Nm,
            pack_viscous=self.pack_viscous_Nms_rad,
            pack_speed=to_si("_rpm", self.pack_speed_rpm),
            synchroniser=self.synchroniser_torque_Nm,
            control=None if self.control is None else self.control.value,
            **{name: tuple(values) for name, values in tables.items() if values is not None},
        )


#: Keys of ``[mechanism]`` that change the shift force.
ACTUATION_KEYS = ("delay_s", "lag_s", "force_factor", "force_loss_N", "rise_factor")
_fields: Any = {key: (float | None, later()) for key in (*FIELDS, *ACTUATION_KEYS)}
_Keys: Any = create_model("_Keys", __base__=Section, **_fields)


class MechanismSection(_Keys):  # type: ignore[misc]
    """Mechanism around the ring (``sim.shift.mechanism``); an absent key is no mechanism."""

    @property
    def given(self) -> dict[str, float]:
        """Keys that the file gives, with their values."""
        return self.model_dump(exclude_none=True)

    def mechanism(self, dog: Dog) -> Mechanism:
        """Build the mechanism around a ring with this dog.

        What belongs to a part is dropped with that part, so that nothing has one key. Raises
        InputError for a value out of range, or one that belongs to a part that is not given.
        """
        given = {FIELDS[key]: to_si(key, v) for key, v in self.given.items() if key in FIELDS}
        for place, part in PLACES.items():
            if place in given and part not in given:
                key, other = (f"mechanism.{_KEYS[name]}" for name in (place, part))
                raise InputError(f"{key} belongs to {other}, which is not given; give it too")
        given.setdefault("spline_radius", SPLINE * dog.inner_radius)
        whole = Mechanism(**given)
        parts = [place for place, part in PLACES.items() if getattr(whole, part) == 0.0]
        return replace(whole, **{name: getattr(NOTHING, name) for name in parts})


#: What belongs to a part of a mechanism (where it acts, what holds it), and that part.
PLACES = {
    "spline_radius": "spline_friction",
    "detent_position": "detent",
    "detent_width": "detent",
    "detent_seat": "detent",
    "input_stiffness": "ring_inertia",
    "backlash": "ring_inertia",
    "output_stiffness": "wheel_inertia",
}
_KEYS = {name: key for key, name in FIELDS.items()}

#: Parts of names that ask for more than ``SCOPE`` has.
UNMODELLED = (
    *("play", "lash", "clearance", "window", "slot_", "space", "undercut", "taper", "dovetail"),
    *("roof", "ridge", "dog2", "mating", "second"),
)


def rings(sliding: SlidingSection, output: OutputSection) -> Rings:
    """Build both rings; InputError for the speed that ``[drive]`` has replaced."""
    if sliding.initial_speed_rpm != 0.0:
        rule = "drive.shaft_speed_rpm, of the ring on the wheels' side, and drive.engine_side "
        rule += "have replaced it"
        name, speed = "sliding.initial_speed_rpm", sliding.initial_speed_rpm
        raise InputError(refusal(name, speed, "1/min", rule, "give these, and leave it out"))
    return Rings(sliding.mass_kg, sliding.inertia_kgm2, output.inertia_kgm2)


def dog_fields(values: dict[str, float]) -> dict[str, Any]:
    """Turn keys of a dog in edge units (``height_mm``) into fields of ``Dog`` in SI."""
    count = {"count": int(values["count"])} if "count" in values else {}
    return {**si_fields(values), **count}


def si_fields(values: dict[str, float]) -> dict[str, float]:
    """Turn keys in edge units (``height_mm``) into SI fields without them (``height``)."""
    return {key.removesuffix(suffix_of(key)): to_si(key, value) for key, value in values.items()}


def validate(model: type[Model], data: dict[str, Any], source: str) -> Model:
    """Validate ``data`` and turn its mistakes into sentences, all at once.

    Raises InputError that names ``source``, and of each mistake key, value and rule.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(join_faults(source, _faults(model, error.errors()))) from error


def _faults(model: type[BaseModel], errors: list[ErrorDetails]) -> list[str]:
    unknown = [_unknown(model, e) for e in errors if e["type"] == "extra_forbidden"]
    # A misspelt key is also a missing one; the spelling is the better hint.
    missing = [f"'{_key(e)}'" for e in errors if e["type"] == "missing"]
    absent = [f"{key} is missing; add it" for key in missing if key not in " ".join(unknown)]
    broken = [e for e in errors if e["type"] not in {"extra_forbidden", "missing"}]
    own = (e.get("ctx", {}).get("error") or broken_rule(_key(e), e) for e in broken)
    return [*unknown, *absent, *map(str, own)]


def _path(error: ErrorDetails) -> list[str]:
    # Pydantic names which of several kinds a value was taken for; no key has a space.
    return [str(part) for part in error["loc"] if " " not in str(part)]


def _key(error: ErrorDetails) -> str:
    return ".".join(_path(error)) or "the file"


def _unmodelled(path: list[str]) -> bool:
    *tables, name = path
    if tables in (["sliding"], ["output"]):
        return name in DogSection.model_fields
    return tables in ([], ["dog"], ["variables"], ["tolerance"]) and any(
        word in name.lower() for word in UNMODELLED
    )


def _unknown(model: type[BaseModel], error: ErrorDetails) -> str:
    path = _path(error)
    if _unmodelled(path):
        return f"'{_key(error)}' is not a known key: {SCOPE}; leave it out"
    stem = "".join(f"{part}." for part in path[:-1])
    valid = [stem + name for name in _keys(model, path[:-1])]
    meant = [f"{n}.{path[-1]}" for n in _keys(model, []) if path[-1] in _keys(model, [n])]
    hint = f"did you mean '{meant[0]}'?" if meant else did_you_mean(_key(error), valid)
    return f"'{_key(error)}' is not a known key; {hint}"


def _keys(model: type[BaseModel], path: list[str]) -> list[str]:
    for name in (part for part in path if not part.isdecimal()):  # numbers are places in lists
        field = model.model_fields.get(name)
        section = section_in(field.annotation) if field else None
        if section is None:
            return []
        model = section
    return list(model.model_fields)


def section_in(annotation: Any) -> type[BaseModel] | None:
    """Return the section that an annotation allows, alone or beside other kinds of value."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (section_in(one) for one in get_args(annotation))
    return next((section for section in found if section is not None), None)
