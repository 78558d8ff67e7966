"""The study file: every key with its type and default, and the value of ``sim`` that a section is.

Lengths, angles and speeds are in the unit that a key ends in. Values are SI.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from dogshape.pipeline.config.operating import ActuationSection, Numbers, OperatingSection
from dogshape.sim.clutch_tables import (
    DogSection,
    DriveSection,
    Keys,
    MechanismSection,
    OutputDogSection,
    OutputSection,
    Section,
    SlidingSection,
    declared_key,
    key,
    later,
    or_one,
    section_in,
    si_fields,
)
from dogshape.sim.errors import InputError, Refusal, require_between
from dogshape.sim.quantity import quantities_of
from dogshape.sim.shift.actuators import Actuator
from dogshape.sim.shift.clutch import (
    PLANAR_ACCURACY,
    SCHEMES,
    Clutch,
    ContactSet,
    Solver,
    accuracy_of,
    contact_set,
    require_engine,
    solver_for,
)
from dogshape.sim.shift.drive import Drive, EngineSide
from dogshape.sim.shift.geometry import SCOPE
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.statistics.expectation import (
    FIRST_WINDOW_SHARE,
    HANG_WARNING_SHARE,
    MIN_ENGAGED_SHARE,
)
from dogshape.sim.statistics.uncertainty import Distribution
from dogshape.sim.strength.landing import Wear
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits, Tolerances
from dogshape.sim.strength.materials import Material, material_of
from dogshape.sim.strength.spline import Sleeve
from dogshape.sim.strength.strike import Strike
from dogshape.sim.units import RPM, from_si, unit_of

FORMAT = 1  #: version of the study file and of the folder that a study writes
QUANTILE = 0.95  #: of a shift's time, for ``shift_time_quantile_s``
#: Fields that strike and mechanism share.
SHARED_FIELDS = ("ring_inertia", "input_stiffness", "backlash", "wheel_inertia", "output_stiffness")
ROUNDING = 1e-9  #: share by which a nominal value may lie outside its range

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
#: A number, or the range that it lies in, which is judged at its worst end; tags as in ``Spread``.
Ends = Annotated[
    Annotated[float, Tag("a number")] | Annotated[Range, Tag("a range")],
    Discriminator(lambda value: "a range" if isinstance(value, list) else "a number"),
]


class ContactSection(Keys, of=ContactSet, named_by=contact_set):
    """Name of a contact set, and values that override it."""

    set: str = "lubricated_steel"


class AlternatingSection(Section):
    """Speed that frees blocked shifts (``SetPoint``), from ``after_s`` of the force on."""

    amplitude_rpm: Annotated[float, Field(gt=0.0)]
    period_s: Annotated[float, Field(gt=0.0)]
    after_s: Annotated[float, Field(ge=0.0)]


class ShiftSection(Section):
    """End, time-out, retry cost and rebound limit of a shift; share of hangs of a warning."""

    timeout_s: float = key(default=1.0, low=1e-3, high=60.0)
    retraction_s: float = key(default=0.2, low=0.0, high=60.0)
    seated_tolerance_mm: float = key(default=0.05, low=1e-4, high=1.0)
    rebound_mm: float = key(default=1.0, low=0.0, high=100.0)
    hang_warning_share: float = later(HANG_WARNING_SHARE, low=0.0, high=1.0 - MIN_ENGAGED_SHARE)
    alternating: AlternatingSection | None = later()


class UncertainSection(Section):
    """Distributions of factors that vary from shift to shift; an absent factor is 1."""

    friction_factor: Distribution | None = None
    force_factor: Distribution | None = None
    inertia_factor: Distribution | None = None
    dissipation_factor: Distribution | None = later()


class ExpectationSection(Section):
    """Number of relative angles of an operating point, and the seed of their draw.

    ``first_window_share`` defines the limits of engagement (``sim.statistics.shiftability``), of
    which that of the torque is computed from shifts at each of ``limit_torques_Nm``.
    With 96 the standard error of a mean over 28 operating points is about 0.2 % of it, 0.5 % where
    friction and dissipation are drawn.
    """

    angles: Annotated[int, Field(ge=3, le=4096)] = 96
    seed: Annotated[int, Field(ge=0)] = 1
    first_window_share: float = later(FIRST_WINDOW_SHARE, low=0.01, high=0.999)
    limit_torques_Nm: Annotated[list[float], or_one(int, float), Field(min_length=1)] | None = (
        later()
    )
    limit_torque_side: EngineSide = later("sliding")


class DrivelineSection(Section):
    """Shafts between the clutch and the vehicle; for the torque peak only."""

    stiffness_Nm_rad: float | None = key(default=None, low=1.0, high=1e7)


class LoadSection(Keys, of=LoadCase):
    """Load case of the strength checks (``sim.strength.load_case``)."""

    spectrum: list[Range] | None = later()
    axial_vibration_m_s2: float = later(0.0, low=0.0, high=1e4)
    release_by_itself: bool = later(True)
    faces_release: bool = later(True)

    def case(self, **clutch_fields: Any) -> LoadCase:
        """Build the load case; InputError for mistakes.

        ``clutch_fields`` are fields that follow from the clutch; keys of the section win.
        """
        spectrum = tuple((share, cycles) for share, cycles in self.spectrum or ())
        section_fields = self.si("spectrum", "axial_vibration_m_s2")
        return LoadCase(**{**clutch_fields, **section_fields}, spectrum=spectrum)


class StrikeSection(
    Keys, of=Strike, leave=("sliding_inertia", "output_inertia"), kind_of_number=Ends
):
    """Flank strike of the strength checks (``sim.strength.strike``); absent, it is not judged."""

    mismatch_rpm: Numbers | None = later()

    def _with_mechanism(self, mechanism: Mechanism) -> dict[str, Any]:
        """Complete the keys of the section by the mechanism, edge units.

        Ring, wheel, shafts and play of ``[mechanism]`` are nominal: a value or range of this
        section that leaves them out raises InputError.
        """
        values = self.model_dump(exclude={"mismatch_rpm"}, exclude_none=True)
        for name in SHARED_FIELDS:
            key = quantities_of(Strike)[name].key
            mechanism_key = quantities_of(Mechanism)[name].key
            nominal = from_si(mechanism_key, getattr(mechanism, name))
            if nominal == 0.0:
                continue
            if values.get(key) in (None, 0.0):
                values[key] = nominal
            else:
                _require_within(key, values[key], mechanism_key, nominal)
        for name in ("ring_inertia", "input_stiffness"):
            key = quantities_of(Strike)[name].key
            if key not in values:
                raise InputError(
                    f"'strike.{key}' is missing; add it, or mechanism.{key}, which shifts are "
                    "simulated with too"
                )
        return values

    def at_ends(self, clutch: Clutch, mismatches: Sequence[float]) -> Iterator[Strike]:
        """Yield the strike at each combination of range ends; just one without ranges.

        Keys that it lacks are those of ``[mechanism]``, its mismatches by default ``mismatches``,
        rad/s. InputError for one of wheel inertia and output stiffness without the other.
        """
        rings = clutch.rings
        values = self._with_mechanism(clutch.mechanism)
        if ("wheel_inertia_kgm2" in values) != ("output_stiffness_Nm_rad" in values):
            fault = "strike.wheel_inertia_kgm2 and strike.output_stiffness_Nm_rad go together"
            raise InputError(f"{fault}; give both, or none for a rigid output side")
        speeds = mismatches
        if self.mismatch_rpm is not None:
            speeds = [speed * RPM for speed in self.mismatch_rpm]
        inertias = {
            "wheel_inertia": rings.output_inertia,  # of a rigid output side, unless a key gives it
            "sliding_inertia": rings.sliding_inertia,
            "output_inertia": rings.output_inertia,
        }
        range_keys = [key for key, value in values.items() if isinstance(value, list)]
        for ends in itertools.product(*(values[name] for name in range_keys)):
            end_values = dict(zip(range_keys, ends, strict=True))
            words = ", ".join(f"{key} = {end:g}" for key, end in end_values.items())
            fields = inertias | si_fields(values | end_values)
            yield Strike(**fields, mismatch=tuple(speeds), ends=words)


def _require_within(
    key: str, value: float | list[float], mechanism_key: str, nominal: float
) -> None:
    """Raise InputError unless a value or range of ``[strike]`` contains the nominal value."""
    low, high = value if isinstance(value, list) else (value, value)
    if low * (1.0 - ROUNDING) <= nominal <= high * (1.0 + ROUNDING):
        return
    text = f"[{low:.6g}, {high:.6g}]" if isinstance(value, list) else f"{value:.6g}"
    raise InputError(
        Refusal(
            f"mechanism.{mechanism_key}",
            nominal,
            unit_of(key),
            rule=f"strike.{key} = {text} is to hold it, one value in times and loads",
            remedy=f"correct one of them, or leave out strike.{key}",
        )
    )


class SleeveSection(Keys, of=Sleeve):
    """Teeth of a sleeve, with ``dog.mount = "sleeve"`` (``sim.strength.spline``)."""


class MaterialSection(Keys, of=Material, named_by=material_of):
    """Name of a material set (``sim.strength.materials``), and values that override it."""

    set: str = "16MnCr5"


class ManufacturingSection(Keys, of=ManufacturingLimits):
    """Limits of the workshop (``sim.strength.manufacture``)."""


class ToleranceSection(Keys, of=Tolerances):
    """Largest deviation of each dimension either way (``sim.strength.manufacture``)."""


class WearSection(Keys, of=Wear):
    """Wear over the life (``sim.strength.landing``): of faces by one of two keys, and of edges."""


class OutputVariablesSection(Section):
    """Search ranges of the output ring's dog; absent keys keep the values of ``[output_dog]``."""

    chamfer_deg: Range | None = later(low=0.0, high=60.0)
    height_mm: Range | None = later(low=0.2, high=100.0)
    crest: Range | None = later(low=0.0, high=1.0)
    chamfer_back_deg: Range | None = later(low=0.0, high=60.0)
    backlash_mm: Range | None = later(low=0.0, high=50.0)


#: Searched keys of the output ring's dog, as a design has them.
OUTPUT_VARIABLES = tuple(f"{OUTPUT_PREFIX}{key}" for key in OutputVariablesSection.model_fields)


def dotted_key(name: str) -> str:
    """Return the key of a searched dimension in a study file: ``output_dog.height_mm``."""
    if name in OUTPUT_VARIABLES:
        return f"output_dog.{name.removeprefix(OUTPUT_PREFIX)}"
    return f"dog.{name}"


def flat_name(key: str) -> str:
    """Return the name that a key of either dog in a study file has in a design."""
    table, _, name = key.rpartition(".")
    return f"{OUTPUT_PREFIX}{name}" if table == "output_dog" else name


def variable_key(name: str) -> str:
    """Return the key of a variable in a study file: ``variables.output_dog.height_mm``."""
    return f"variables.{dotted_key(name).removeprefix('dog.')}"


class VariablesSection(Section):
    """Search ranges ``[low, high]``; absent keys keep the values of ``[dog]`` and ``[operating]``.

    ``mismatch_set_rpm`` is the mean that the speed control aims at, ``force_factor`` and
    ``rise_factor`` scale the shift force and its rise time (``pipeline.config.operating``).
    """

    chamfer_deg: Range | None = key(default=None, low=0.0, high=60.0)
    traction_deg: Range | None = key(default=None, low=-10.0, high=60.0)
    braking_deg: Range | None = key(default=None, low=-10.0, high=60.0)
    height_mm: Range | None = None
    count: Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    crest: Range | None = later(low=0.0, high=1.0)
    chamfer_back_deg: Range | None = later(low=0.0, high=60.0)
    backlash_mm: Range | None = later(low=0.0, high=50.0)
    mismatch_set_rpm: Range | None = later(low=-2000.0, high=2000.0)
    force_factor: Range | None = later(low=0.01, high=100.0)
    rise_factor: Range | None = later(low=0.1, high=10.0)
    output_dog: OutputVariablesSection | None = later()

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Ranges of the searched keys, edge units; InputError for mistakes."""
        tables = self.model_dump(exclude_none=True)
        output_dog = tables.pop("output_dog", {})
        tables |= {f"{OUTPUT_PREFIX}{key}": ends for key, ends in output_dog.items()}
        ranges = {}
        for name, (low, high) in tables.items():
            if not low < high:
                raise InputError(
                    f"{variable_key(name)} is [{low:.6g}, {high:.6g}], but the first must be below "
                    "the second; exchange them, or leave the key out to keep the dog's own value"
                )
            ranges[name] = (low, high)
        return ranges


class SearchSection(Section):
    """Objectives, sampler and budget of the search; ``studies/mq200/study.toml`` explains its keys.

    At most ``confirm_designs`` designs of the front are confirmed; the result's has no others.
    ``confirm_angles`` are those of Drake at each operating point; 1 is enough where many points
    make the sample.
    """

    objectives: Annotated[list[str], or_one(str)] = Field(
        min_length=1, default_factory=lambda: ["expected_shift_time_s", "axial_length_mm"]
    )
    sampler: Literal["surrogate", "space_filling"] = "surrogate"
    trials: Annotated[int, Field(ge=1, le=10_000)] = 32  # more take a day to propose
    startup: Annotated[int, Field(ge=1)] = 16
    batch: Annotated[int, Field(ge=1)] = 4
    seed: Annotated[int, Field(ge=0)] = 1
    polish: Annotated[float, Field(ge=0.0, lt=1.0)] = later(0.25)
    confirm_designs: Annotated[int, Field(ge=1)] = 24
    confirm_angles: Annotated[int, Field(ge=1, le=256)] = 16
    audit_shifts: Annotated[int, Field(ge=0)] = later(200)
    quantile: Annotated[float, Field(gt=0.0, lt=1.0)] = later(QUANTILE)
    limits: dict[str, float] | None = later()
    within_s: Annotated[float, Field(gt=0.0)] | None = later()


class SolverSection(Keys, of=Solver, named_by=solver_for):
    """Numerical settings; absent ones follow from the contact set."""

    engine: str | None = later()
    scheme: str | None = None

    def solver(
        self,
        contact: ContactSet,
        mechanism: Mechanism,
        drive: Drive,
        actuator: Actuator | None,
    ) -> Solver:
        """Build the solver of contact set, mechanism, drive and actuator; InputError for mistakes.

        Forces of mechanism, drive or actuator with two coefficients of friction are the compiled
        engine's, unless the section names another: Drake's ``cenic`` takes a thousand times the
        processor time for them and is off its limit by percents (``docs/simulation.md``). The law
        IMPACT and a friction of faces are the compiled engine's alone.
        """
        default = solver_for(contact, mechanism, drive, actuator)
        has_forces = mechanism.has_forces or drive.has_torques or actuator is not None
        scheme = self.scheme or default.scheme
        engine = self.engine
        if not engine:
            needs_planar = contact.compiled_only or (has_forces and default.scheme == "cenic")
            engine = "planar" if needs_planar else "drake"
        accuracy = default.accuracy
        if scheme in SCHEMES:
            accuracy = accuracy_of(scheme, forced=has_forces)
        require_engine(contact, engine)
        if engine == "planar":
            accuracy = PLANAR_ACCURACY
        return Solver(**{"scheme": scheme, "engine": engine, "accuracy": accuracy, **self.si()})


class SurrogateSection(Section):
    """Simulations of ``fit``: designs at all operating points of the study, and references.

    ``mix_shifts`` are those of all designs. ``references`` fill the space, ``best_references`` are
    of the tenth expected to be best; each has ``reference_angles`` at every operating point.
    """

    references: Annotated[int, Field(ge=3)] = 40
    best_references: Annotated[int, Field(ge=0)] = 20
    reference_angles: Annotated[int, Field(ge=3)] = 32
    mix_shifts: Annotated[int, Field(ge=1)] = later(135_000)
    seed: Annotated[int, Field(ge=0)] = 1


class AssumedKey(Section):
    """A value that nobody gave for this clutch; without ``value`` the default of an absent key."""

    key: str
    value: Any = None
    source: str


class AssumedSection(Section):
    """Values of the file that nobody gave, such as those of an example.

    A row counts as long as the file has its value.
    """

    values: list[AssumedKey] = Field(default_factory=list)


class StudyFile(Section):
    """The whole study file."""

    format: int
    name: Annotated[str, Field(min_length=1, max_length=100, pattern=r"^\w[\w.-]*$")]
    dog: DogSection
    output_dog: OutputDogSection | None = later()
    sliding: SlidingSection
    output: OutputSection
    contact: ContactSection = ContactSection()
    shift: ShiftSection = ShiftSection()
    actuation: ActuationSection
    operating: OperatingSection
    drive: DriveSection = later(DriveSection())
    mechanism: MechanismSection | None = later()
    effects: dict[str, Any] | None = later()
    uncertain: UncertainSection | None = later()
    expectation: ExpectationSection = ExpectationSection()
    driveline: DrivelineSection = DrivelineSection()
    load: LoadSection = LoadSection()
    strike: StrikeSection | None = later()
    sleeve: SleeveSection | None = later()
    material: MaterialSection = MaterialSection()
    manufacturing: ManufacturingSection = ManufacturingSection()
    tolerance: ToleranceSection = ToleranceSection()
    wear: WearSection | None = later()
    variables: VariablesSection = VariablesSection()
    search: SearchSection = SearchSection()
    solver: SolverSection = SolverSection()
    surrogate: SurrogateSection = SurrogateSection()
    assumed: AssumedSection | None = later()

    def assumed_rows(self) -> list[AssumedKey]:
        """List the rows of ``[assumed]`` whose values the file has; InputError for a wrong key."""
        if self.assumed is None:
            return []
        tables = self.model_dump(exclude={"assumed"}, exclude_none=True)
        rows = []
        for row in self.assumed.values:
            table, _, name = row.key.partition(".")
            field = type(self).model_fields.get(table)
            section = section_in(field.annotation) if field else None
            if section is None or name not in section.model_fields:
                fault = f"assumed.values has the key {row.key}, which no study file has"
                raise InputError(f"{fault}; correct it or delete the row")
            default = section.model_fields[name].get_default(call_default_factory=True)
            value = tables.get(table, {}).get(name, default)
            expected_value = default if row.value is None else row.value
            if _has_value(value, expected_value):
                rows.append(row)
        return rows

    def require_ranges(self) -> None:
        """Raise InputError for a value beyond the range that its key declares."""
        sections = {**dict(self), "variables.output_dog": self.variables.output_dog}
        for table, section in sections.items():
            is_search = table.startswith("variables")
            remedy = "narrow the range" if is_search else "check the value and its unit"
            for name in getattr(type(section), "model_fields", ()):
                value = getattr(section, name)
                declared = declared_key(type(section), name)
                if value is None or not declared.is_bounded:
                    continue
                scope = f": {SCOPE}" if is_search and name.endswith("_deg") else ""
                for number in value if isinstance(value, list) else [value]:
                    require_between(
                        f"{table}.{name}", number, declared.low, declared.high, remedy + scope
                    )


def _has_value(value: Any, expected_value: Any) -> bool:
    """Test whether a value of a file is the expected one, defaults of its tables aside."""
    if isinstance(expected_value, dict):
        return isinstance(value, dict) and all(
            _has_value(value.get(name), part) for name, part in expected_value.items()
        )
    if isinstance(expected_value, list):
        return (
            isinstance(value, list)
            and len(value) == len(expected_value)
            and all(map(_has_value, value, expected_value))
        )
    return bool(value == expected_value) or value == [expected_value]


def keys_like(stem: str) -> list[str]:
    """List at most three keys of the study file that begin with a word: ``dog.chamfer_deg``."""
    if len(stem) < 3:
        return []
    keys = []
    for table, field in StudyFile.model_fields.items():
        section = section_in(field.annotation)
        for name in section.model_fields if section else ():
            if name.lower().startswith(stem):
                keys.append(f"{table}.{name}")
    return keys[:3]
