"""Tables of files (study, bench data) that describe a clutch, and messages on their mistakes.

A section declares keys and types; ranges are those of the values of ``sim`` that it builds. The
validator names each broken rule by a kind, which ``RULES`` words.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    Optional,
    TypeVar,
    cast,
    get_args,
    get_type_hints,
)

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails

from dogshape.sim.errors import InputError, Refusal, did_you_mean, join_faults, meant_number
from dogshape.sim.quantity import Quantity, quantities_of
from dogshape.sim.shift.actuators import (
    Actuator,
    Cam,
    Hydraulic,
    Motor,
    Pneumatic,
    Solenoid,
    Spring,
    actuator_of,
)
from dogshape.sim.shift.clutch import Rings
from dogshape.sim.shift.drive import Drive, EngineSide, SpeedControl
from dogshape.sim.shift.geometry import SCOPE, Dog, Mount
from dogshape.sim.shift.mechanism import FIELDS, NO_MECHANISM, SPLINE, Mechanism
from dogshape.sim.shift.pair import OutputDog
from dogshape.sim.units import DEG, from_si, suffix_of, to_si, unit_of

DECLARATION = "quantity"  #: of a key, in the extras of its field
MAX_VALUE_CHARACTERS = 60  #: of a value in a message
MATING_KEYS = ("traction_deg", "braking_deg")  #: of a dog, in which both rings agree
ANGLE_ERROR_DEG = 1e-9  #: of equal side angles
NAME = "letters, digits, '_', '-' and '.' only, without blanks, beginning with no '-' or '.'"

_INTEGER = "a whole number"
_NUMBER = "a number"
_BOOL = "true or false"
_TABLE = "a table of keys"
_LIST = "a list in square brackets"
LIST_TAG = "a list"  #: of a value that is a list or a distribution; tags have a space
#: Between the ends of a typed range.
RANGE_WORD = re.compile(r"\s+(?:to|bis)\s+|\s*(?:\.\.\.?|\N{HORIZONTAL ELLIPSIS})\s*")
#: Requirement on a value by the kind of the rule; braces hold the validator's limits.
RULES: Mapping[str, str] = {
    **dict.fromkeys(("bool_parsing", "bool_type"), _BOOL),
    **dict.fromkeys(("dict_type", "model_attributes_type", "model_type"), _TABLE),
    **dict.fromkeys(("float_parsing", "float_type"), _NUMBER),
    **dict.fromkeys(("int_from_float", "int_parsing", "int_type"), _INTEGER),
    "int_parsing_size": f"{_INTEGER} of a few digits",
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
    "list_type": _LIST,
    "too_long": "a list of at most {max_length} values",
    "too_short": "a list of at least {min_length} values",
}

#: Remedy for a value beyond a limit, by the first words of the rule.
LIMIT_REMEDIES = {
    "at least": "raise it",
    "above": "raise it",
    "at most": "lower it",
    "below": "lower it",
}


class BrokenRule(NamedTuple):
    """A rule of the validator that a value breaks."""

    kind: str  #: of the rule, a key of ``RULES``
    value: Any
    limits: Mapping[str, Any]  #: of the rule by name; the exception of a rule in code as ``error``
    path: tuple[str, ...]  #: tables and key of the value
    takes_distribution: bool = False  #: whether a distribution may stand in place of a list

    @classmethod
    def of(cls, error: ErrorDetails) -> BrokenRule:
        """Read an error of the validator."""
        # Pydantic adds the kind of value that it tried, which unlike a key has a space.
        path = tuple(str(part) for part in error["loc"] if " " not in str(part))
        takes_distribution = LIST_TAG in error["loc"]
        return cls(error["type"], error["input"], error.get("ctx", {}), path, takes_distribution)

    @property
    def key(self) -> str:
        """Dotted key of the value."""
        return ".".join(self.path) or "the file"

    def sentence(self, name: str) -> str:
        """Word the mistake of a value called ``name``: name, value, rule and remedy."""
        rule = RULES.get(self.kind, "of another kind")
        rule = rule.format(**self.limits).replace(" 1 values", " one value")
        remedy = _remedy(rule, self.value, takes_distribution=self.takes_distribution)
        unit = unit_of(name)
        if unit and rule == _NUMBER:
            rule += f" in {unit}"
        text = repr(self.value)
        if len(text) > MAX_VALUE_CHARACTERS:
            text = f"{text[:MAX_VALUE_CHARACTERS]}... ({len(text)} characters)"
        return f"{name} is {text}, but it must be {rule}; {remedy}"


def _remedy(rule: str, value: Any, *, takes_distribution: bool = False) -> str:
    """Return the remedy for a ``value`` that breaks a rule in words."""
    if "number" in rule and isinstance(value, str):
        meant = meant_number(value)
        if meant is None:
            return "write the number alone, without a unit"
        if rule == _NUMBER or meant == round(meant):
            return f"write {meant:g}"
    if rule == _LIST:
        remedy = f"write [{_list_text(str(value))}]"
        ends = _range_ends(str(value)) if takes_distribution else None
        if ends is None:
            return remedy
        low, high = ends
        distribution = f'{{distribution="uniform",low={low:g},high={high:g}}}'
        return f"{remedy} for two values, {distribution} for a range"
    if rule == _TABLE:
        return "give its keys one by one"
    remedies = (remedy for prefix, remedy in LIMIT_REMEDIES.items() if rule.startswith(prefix))
    return next(remedies, "correct the value")


def _range_ends(text: str) -> tuple[float, float] | None:
    """Read both ends of a text ``LOW to HIGH``; None for another text."""
    parts = RANGE_WORD.split(text.strip("[]() "))
    if len(parts) != 2:
        return None
    low, high = map(meant_number, map(str.strip, parts))
    return None if low is None or high is None else (low, high)


def _list_text(text: str) -> str:
    """Return the numbers of a text with commas between, or the text in quotation marks."""
    stripped = text.strip("[]() ")
    separator = r",?[\s;]+" if re.search(r"[\s;]", stripped) else ","
    numbers = map(meant_number, re.split(separator, stripped))
    texts = [f"{number:g}" for number in numbers if number is not None]
    return ",".join(texts) or repr(stripped[:MAX_VALUE_CHARACTERS])


Model = TypeVar("Model", bound=BaseModel)


class Section(BaseModel):
    """A table of a file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def key(
    meaning: str = "",
    unit: str = "",
    default: Any = ...,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    head: str = "",
    scale: float = 1.0,
    form: str = ".4g",
    late: bool = False,
) -> Any:
    """Declare a key of a section or a record; required without a default.

    Parameters
    ----------
    meaning, unit
        Of the value, for schema and reference page.
    default
        Value of an absent key.
    low, high
        Range of a value of a file.
    head
        Head of its column in a table; none is printed without it.
    scale
        Factor from the stored to the printed number.
    form
        Format of the printed number.
    late
        Whether earlier versions of a record lack the key; its default then is None. Late keys of
        files are declared by ``later``.

    """
    if late:
        meaning = f"{meaning}; absent in earlier versions"
        default = None
    declared = Quantity(low=low, high=high, late=late, unit=unit, head=head, scale=scale, form=form)
    return Field(
        default, description=meaning or None, json_schema_extra={DECLARATION: cast(Any, declared)}
    )


def later(default: Any = None, *, low: float = -math.inf, high: float = math.inf) -> Any:
    """Declare a key added later; a file's hash omits the key at its default."""
    declared = Quantity(low=low, high=high, late=True)
    return Field(
        default=default,
        exclude_if=lambda value: value == default,
        json_schema_extra={DECLARATION: cast(Any, declared)},
    )


def declared_key(kind: type[BaseModel], name: str) -> Quantity:
    """Return the declaration of a key of a section or a record, an empty one without."""
    extra = kind.model_fields[name].json_schema_extra
    return cast(Quantity, extra[DECLARATION]) if isinstance(extra, dict) else Quantity()


def or_one(*kinds: type) -> BeforeValidator:
    """Accept a single value of one of ``kinds`` in place of a list."""
    return BeforeValidator(lambda value: [value] if type(value) in kinds else value)


class Keys(Section):
    """A section that builds a value of ``sim``, whole or over a named set.

    Its keys are the quantities of a dataclass: ``class DogSection(Keys, of=Dog)``. Late quantities
    and those with the default None are no part of a hash at their default.

    Parameters
    ----------
    of : dataclass of ``sim`` that the section builds.
    named_by : function that returns a set by name; absent keys then keep the values of the set.
    leave : fields without a key.
    optional : fields without a default that a file may lack, None then.
    absent : whether a file may lack any key, None then.
    kind_of_number : type of the keys if it is not that of the fields.
    """

    builds: ClassVar[Any]
    set_named: ClassVar[Any] = None  #: function that returns a set by its name

    if TYPE_CHECKING:  # its keys are those of the dataclass

        def __getattr__(self, name: str) -> Any: ...

    def __init_subclass__(
        cls,
        *,
        of: Any = None,
        named_by: Any = None,
        leave: Sequence[str] = (),
        optional: Sequence[str] = (),
        absent: bool = False,
        kind_of_number: Any = None,
        **settings: Any,
    ) -> None:
        """Add the keys of the dataclass ``of`` before those of the class itself."""
        super().__init_subclass__(**settings)
        if of is None:
            return
        cls.builds = of
        cls.set_named = named_by
        keys: dict[str, Any] = {}
        hints = get_type_hints(of)
        for name, declared in quantities_of(of).items():
            if name in leave:
                continue
            default: Any = None
            if not named_by and not absent:
                is_optional = declared.late or name in optional
                default = getattr(of, name, None if is_optional else ...)
            hint = kind_of_number or hints[name]
            if default is None:
                hint = Optional[hint]  # noqa: UP045  # no '|' for Annotated
            elif default is not ...:
                default = from_si(declared.key, default)
            if declared.late or (default is None and not named_by):
                default = later(default)
            keys[declared.key] = hint
            if default is not ...:
                setattr(cls, declared.key, default)
        cls.__annotations__ = keys | cls.__annotations__

    def si(self, *without: str) -> dict[str, Any]:
        """Return the keys in the file as SI fields, except ``set`` and ``without``."""
        values = self.model_dump(exclude={"set", *without}, exclude_none=True)
        numbers = {key: value for key, value in values.items() if isinstance(value, float)}
        others = {key: value for key, value in values.items() if key not in numbers}
        return others | si_fields(numbers)

    @property
    def value(self) -> Any:
        """The value; InputError for mistakes."""
        if self.set_named is None:
            return self.builds(**self.si())
        base = type(self).set_named(getattr(self, "set"))  # noqa: B009
        return replace(base, **self.si())


def mm_per_deg(outer: float, inner: float) -> float:
    """Compute the arc of 1 degree at the mean radius, mm; diameters ``outer``, ``inner`` in mm."""
    return 0.25 * DEG * (outer + inner)


class DogSection(Keys, of=Dog):
    """Geometry of the dogs of both rings; ``mount`` changes no motion (``sim.strength.spline``)."""

    mount: Mount = later("face")

    @property
    def sizes(self) -> dict[str, float]:
        """Numbers of the dog by key, without those at a later default."""
        return self.model_dump(exclude={"mount"})

    @property
    def value(self) -> Dog:
        """The dog; InputError or GeometryError for mistakes."""
        return Dog(**self.si("mount"))

    @model_validator(mode="before")
    @classmethod
    def _lengths(cls, data: Any) -> Any:
        """Convert ``backlash_deg`` to ``backlash_mm``; ValueError, which the validator collects."""
        if not isinstance(data, dict) or "backlash_deg" not in data:
            return data
        name = "dog.backlash_deg"
        lengths = dict(data)
        angle = lengths.pop("backlash_deg")
        if "backlash_mm" in data:
            raise ValueError(
                f"{name} is {angle} deg beside dog.backlash_mm = {lengths['backlash_mm']}, but "
                "both are one play; give one of them"
            )
        if isinstance(angle, bool) or not isinstance(angle, int | float):
            raise ValueError(BrokenRule("float_type", angle, {}, ()).sentence(name))
        try:
            per_deg = mm_per_deg(data["outer_diameter_mm"], data["inner_diameter_mm"])
            max_angle = abs(quantities_of(Dog)["backlash"].high / per_deg)
        except (KeyError, TypeError, ZeroDivisionError):  # the validator refuses these diameters
            return lengths
        if not 0.0 <= angle <= max_angle:
            rule = f"it must lie between 0 and {max_angle:.6g} deg"
            remedy = "check the angle and its unit"
            raise ValueError(Refusal(name, angle, "deg", rule=rule, remedy=remedy))
        return lengths | {"backlash_mm": angle * per_deg}


class OutputDogSection(Keys, of=OutputDog):
    """Dimensions of the output ring's dog that differ from ``[dog]`` (``sim.shift.pair``).

    ``material`` names the set of that ring; side angles are those of ``[dog]``. ``sparse_ring`` is
    the one whose dogs are missing or low.
    """

    traction_deg: float | None = later()
    braking_deg: float | None = later()
    material: str | None = later()
    sparse_ring: EngineSide = later("output")

    @property
    def value(self) -> OutputDog:
        """Dimensions that differ; InputError for mistakes."""
        sizes = self.si(*MATING_KEYS, "material", "sparse_ring")
        return OutputDog(**sizes, is_sliding_sparse=self.sparse_ring == "sliding")

    def require_mate(self, dog: Dog) -> None:
        """Raise InputError for a side angle with which the flanks of ``dog`` do not mate."""
        for name in MATING_KEYS:
            angle = getattr(self, name)
            mate = from_si(name, getattr(dog, name.removesuffix("_deg")))
            if angle is not None and not math.isclose(angle, mate, abs_tol=ANGLE_ERROR_DEG):
                rule = f"flanks lie on each other at the {mate:.6g} deg of dog.{name} alone"
                remedy = f"give {mate:.6g} or leave it out"
                raise InputError(Refusal(f"output_dog.{name}", angle, "deg", rule, remedy))


class SlidingSection(Section):
    """The ring that is shifted."""

    mass_kg: float
    inertia_kgm2: float
    initial_speed_rpm: float = 0.0  #: of earlier files, where it may be 0


class OutputSection(Section):
    """The ring that it engages."""

    inertia_kgm2: float


class SpeedControlSection(Keys, of=SpeedControl):
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


class _SpringKeys(Keys, of=Spring, absent=True):
    """Numbers of a spring."""


class _CamKeys(Keys, of=Cam, absent=True):
    """Numbers of a cam."""


class _MotorKeys(Keys, of=Motor, absent=True):
    """Numbers of a motor."""


class _PneumaticKeys(Keys, of=Pneumatic, absent=True):
    """Numbers of a pneumatic cylinder."""


class _HydraulicKeys(Keys, of=Hydraulic, absent=True):
    """Numbers of a hydraulic cylinder."""


class _SolenoidKeys(Keys, of=Solenoid, absent=True):
    """Numbers of a solenoid."""


class ActuatorKeys(
    _SpringKeys, _CamKeys, _MotorKeys, _PneumaticKeys, _HydraulicKeys, _SolenoidKeys
):
    """Numbers of all kinds of actuators (``sim.shift.actuators``)."""


class ActuatorSection(ActuatorKeys):
    """Kind of an actuator with its numbers."""

    kind: Literal["spring", "cam", "motor", "pneumatic", "hydraulic", "solenoid"]

    @property
    def actuator(self) -> Actuator:
        """The actuator; InputError for mistakes."""
        numbers = self.model_dump(exclude={"kind"}, exclude_none=True)
        actuator = actuator_of(self.kind, {key: to_si(key, v) for key, v in numbers.items()})
        assert actuator is not None  # the kind is no profile
        return actuator


class MechanismSection(Keys, of=Mechanism, absent=True):
    """Mechanism around the ring (``sim.shift.mechanism``); an absent key is no mechanism.

    The last keys change the shift force (``sim.shift.actuation``).
    """

    delay_s: float | None = later()
    lag_s: float | None = later()
    force_factor: float | None = later()
    force_loss_N: float | None = later()
    rise_factor: float | None = later()

    @property
    def given(self) -> dict[str, float]:
        """Keys that the file gives, with their values."""
        return self.model_dump(exclude_none=True)

    def mechanism(self, dog: Dog) -> Mechanism:
        """Build the mechanism around a ring with this dog.

        A part that is 0 resets the values that belong to it, so that equal mechanisms have equal
        records. Raises InputError for a value out of range, or without the part it belongs to.
        """
        fields = {FIELDS[key]: to_si(key, v) for key, v in self.given.items() if key in FIELDS}
        for name, part in PARTS.items():
            if name in fields and part not in fields:
                key = f"mechanism.{_KEYS[name]}"
                part_key = f"mechanism.{_KEYS[part]}"
                raise InputError(f"{key} belongs to {part_key}, which is not given; give it too")
        fields.setdefault("spline_radius", SPLINE * dog.inner_radius)
        mechanism = Mechanism(**fields)
        unused = [name for name, part in PARTS.items() if getattr(mechanism, part) == 0.0]
        return replace(mechanism, **{name: getattr(NO_MECHANISM, name) for name in unused})


#: Field of a mechanism that has a meaning only with a part, and that part.
PARTS = {
    "spline_radius": "spline_friction",
    "detent_position": "detent",
    "detent_width": "detent",
    "detent_seat": "detent",
    "input_stiffness": "ring_inertia",
    "backlash": "ring_inertia",
    "output_stiffness": "wheel_inertia",
}
_KEYS = {name: key for key, name in FIELDS.items()}

#: Parts of the names of unknown keys for geometry beyond ``SCOPE``.
UNMODELLED = (
    *("play", "lash", "clearance", "window", "slot_", "space", "undercut", "taper", "dovetail"),
    *("roof", "ridge", "dog2", "mating", "second"),
)


def rings(sliding: SlidingSection, output: OutputSection) -> Rings:
    """Build both rings; InputError for the speed that ``[drive]`` has replaced."""
    if sliding.initial_speed_rpm != 0.0:
        sentence = Refusal(
            "sliding.initial_speed_rpm",
            sliding.initial_speed_rpm,
            "1/min",
            rule="drive.shaft_speed_rpm, of the ring on the wheels' side, and drive.engine_side "
            "have replaced it",
            remedy="give these, and leave it out",
        )
        raise InputError(sentence)
    return Rings(sliding.mass_kg, sliding.inertia_kgm2, output.inertia_kgm2)


def dog_fields(values: dict[str, float]) -> dict[str, Any]:
    """Convert keys of a dog in the units of files (``height_mm``) to fields of ``Dog`` in SI."""
    fields: dict[str, Any] = si_fields(values)
    if "count" in values:
        fields["count"] = int(values["count"])
    return fields


def si_fields(values: dict[str, float]) -> dict[str, float]:
    """Convert keys in the units of files (``height_mm``) to SI fields (``height``)."""
    return {key.removesuffix(suffix_of(key)): to_si(key, value) for key, value in values.items()}


def validate(model: type[Model], data: dict[str, Any], source: str) -> Model:
    """Validate ``data`` against the section ``model``.

    Raises one InputError for all mistakes; it names ``source``, and key, value and rule of each.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        faults = _faults(model, [BrokenRule.of(details) for details in error.errors()])
        raise InputError(join_faults(source, faults)) from error


def _faults(model: type[BaseModel], broken_rules: Sequence[BrokenRule]) -> list[str]:
    """Word the errors of the validator: unknown keys, missing keys, broken rules."""
    unknown = [_unknown_key(model, b.path) for b in broken_rules if b.kind == "extra_forbidden"]
    # A misspelt key is also a missing one; the spelling is the better hint.
    hints = " ".join(unknown)
    missing_keys = [f"'{broken.key}'" for broken in broken_rules if broken.kind == "missing"]
    missing = [f"{key} is missing; add it" for key in missing_keys if key not in hints]
    sentences = []
    for broken in broken_rules:
        if broken.kind not in {"extra_forbidden", "missing"}:
            sentences.append(str(broken.limits.get("error") or broken.sentence(broken.key)))
    return [*unknown, *missing, *sentences]


def _is_unmodelled(path: list[str]) -> bool:
    """Test whether an unknown key asks for geometry beyond ``SCOPE``."""
    *tables, name = path
    if tables in (["sliding"], ["output"], ["output_dog"]):
        return name in DogSection.model_fields
    if tables == ["variables", "output_dog"]:
        output_keys = {declared.key for declared in quantities_of(OutputDog).values()}
        return name in DogSection.model_fields and name not in output_keys
    return tables in ([], ["dog"], ["variables"], ["tolerance"]) and any(
        word in name.lower() for word in UNMODELLED
    )


def _unknown_key(model: type[BaseModel], path: Sequence[str]) -> str:
    """Word the error of an unknown key; suggest a similar key, or its name in another table."""
    key = ".".join(path)
    *tables, name = path
    stem = "".join(f"{table}." for table in tables)
    names_with_unit = [valid for valid in _keys(model, tables) if _without_unit(valid) == name]
    if names_with_unit:
        keys = " or ".join(f"'{stem}{valid}'" for valid in names_with_unit)
        return f"'{key}' is not a known key; did you mean {keys}?"
    if _is_unmodelled([*tables, name]):
        return f"'{key}' is not a known key: {SCOPE}; leave it out"
    for table in sorted(_keys(model, []), key=lambda table: table not in tables):
        for valid in _keys(model, [table]):
            if name in (valid, _without_unit(valid)):
                return f"'{key}' is not a known key; did you mean '{table}.{valid}'?"
    valid_keys = [stem + valid_name for valid_name in _keys(model, tables)]
    return f"'{key}' is not a known key; {did_you_mean(key, valid_keys)}"


def _without_unit(key: str) -> str:
    """Return a key without the unit at its end."""
    return key.removesuffix(suffix_of(key))


def _keys(model: type[BaseModel], path: list[str]) -> list[str]:
    """Return the keys of the table at ``path``; empty for a path without a table."""
    for name in path:
        if name.isdecimal():  # index in a list
            continue
        field = model.model_fields.get(name)
        section = section_in(field.annotation) if field else None
        if section is None:
            return []
        model = section
    return list(model.model_fields)


def section_in(annotation: Any) -> type[BaseModel] | None:
    """Return the section in a type annotation, alone or in a union or list; None without one."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    sections = map(section_in, get_args(annotation))
    return next((section for section in sections if section is not None), None)
