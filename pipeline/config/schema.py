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
    MechanismSection,
    OutputSection,
    Section,
    SlidingSection,
    keys_of,
    later,
    or_one,
    section_in,
    si_fields,
)
from dogshape.sim.errors import InputError, ranges_of, refusal, require_between
from dogshape.sim.shift.clutch import (
    PLANAR_ACCURACY,
    SCHEMES,
    Clutch,
    ContactSet,
    OperatingPoint,
    Solver,
    accuracy_of,
    contact_set,
    require_engine,
    solver_for,
)
from dogshape.sim.shift.drive import NO_DRIVE, Drive
from dogshape.sim.shift.geometry import SCOPE
from dogshape.sim.shift.mechanism import NOTHING, Mechanism
from dogshape.sim.statistics.expectation import FIRST_WINDOW_SHARE
from dogshape.sim.statistics.uncertainty import Distribution
from dogshape.sim.strength.landing import Wear
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits, Tolerances
from dogshape.sim.strength.materials import Material, material_of
from dogshape.sim.strength.strike import Strike
from dogshape.sim.units import RPM, from_si, unit_of

FORMAT = 1  #: version of the study file and of the folder that a study writes
QUANTILE = 0.95  #: of a shift's time, for ``shift_time_quantile_s``
#: Fields that strike and mechanism share.
PARTS = ("ring_inertia", "input_stiffness", "backlash", "wheel_inertia", "output_stiffness")
ROUNDING = 1e-9  #: share by which a nominal value may lie outside its range
#: Fields of ``LoadCase`` that came later.
LOAD_LATE = ("coast_share", "run_out", "tilt", "pull_out_share", "wear_angle")
#: Fields of ``Tolerances`` that came later.
TOLERANCE_LATE = ("chamfer_back", "backlash", "reject_rate", "capability")

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
#: A number, or the range that it lies in, which is judged at its worst end; tags as in ``Spread``.
Ends = Annotated[
    Annotated[float, Tag("a number")] | Annotated[Range, Tag("a range")],
    Discriminator(lambda value: "a range" if isinstance(value, list) else "a number"),
]


def ranged(low: float, high: float, default: Any = None, *, late: bool = False) -> Any:
    """Declare a key that no value of ``sim`` checks: its range, default, and if it came later."""
    excluded = (lambda value: value == default) if late else None
    return Field(default, exclude_if=excluded, json_schema_extra={"range": [low, high]})


class ContactSection(keys_of(ContactSet, contact_set)):  # type: ignore[misc]
    """A named contact set and what is to differ from it."""

    set: str = "lubricated_steel"


class AlternatingSection(Section):
    """Speed that frees blocked shifts (``SetPoint``), from ``after_s`` of the force on."""

    amplitude_rpm: Annotated[float, Field(gt=0.0)]
    period_s: Annotated[float, Field(gt=0.0)]
    after_s: Annotated[float, Field(ge=0.0)]


class ShiftSection(Section):
    """When a shift is done or given up, what a retry costs, and how far a rebound goes."""

    timeout_s: float = ranged(1e-3, 60.0, 1.0)
    retraction_s: float = ranged(0.0, 60.0, 0.2)
    seated_tolerance_mm: float = ranged(1e-4, 1.0, 0.05)
    rebound_mm: float = ranged(0.0, 100.0, 1.0)
    alternating: AlternatingSection | None = later()


class UncertainSection(Section):
    """Factors that differ from shift to shift; absent ones are one."""

    friction_factor: Distribution | None = None
    force_factor: Distribution | None = None
    inertia_factor: Distribution | None = None
    dissipation_factor: Distribution | None = later()


class ExpectationSection(Section):
    """Number of relative angles of an operating point, and the seed of their draw.

    ``first_window_share`` defines the limit engagement speed (``sim.statistics.shiftability``).
    With 96 the standard error of a mean over 28 operating points is about 0.2 % of it, 0.5 % where
    friction and dissipation are drawn.
    """

    angles: Annotated[int, Field(ge=3, le=4096)] = 96
    seed: Annotated[int, Field(ge=0)] = 1
    first_window_share: float = ranged(0.01, 0.999, FIRST_WINDOW_SHARE, late=True)


class DrivelineSection(Section):
    """Shafts between the clutch and the vehicle; for the torque peak only."""

    stiffness_Nm_rad: float | None = ranged(1.0, 1e7)


class LoadSection(keys_of(LoadCase, late=LOAD_LATE)):  # type: ignore[misc]
    """Load case of the strength checks (``sim.strength.load_case``)."""

    spectrum: list[Range] | None = later()
    axial_vibration_m_s2: float = ranged(0.0, 1e4, 0.0, late=True)
    release_by_itself: bool = later(True)
    faces_release: bool = later(True)

    def case(self, **more: Any) -> LoadCase:
        """Build the load case with fields that follow from the clutch; InputError for mistakes."""
        spectrum = tuple((share, cycles) for share, cycles in self.spectrum or ())
        given = self.si("spectrum", "axial_vibration_m_s2")
        return LoadCase(**{**more, **given}, spectrum=spectrum)


class StrikeSection(
    keys_of(  # type: ignore[misc]
        Strike,
        leave=("sliding_inertia", "output_inertia"),
        late=("ring_inertia", "input_stiffness", "wheel_inertia"),
        kind_of_number=Ends,
    )
):
    """Flank strike of the strength checks (``sim.strength.strike``); absent, it is not judged."""

    mismatch_rpm: Numbers | None = later()

    def _with_mechanism(self, mechanism: Mechanism) -> dict[str, Any]:
        """Return the keys that are given, and those of the mechanism for the others.

        Ring, wheel, shafts and play of ``[mechanism]`` are nominal: a value or range of this
        section that leaves them out raises InputError.
        """
        given = self.model_dump(exclude={"mismatch_rpm"}, exclude_none=True)
        for name in PARTS:
            key, key_there = ranges_of(Strike)[name].key, ranges_of(Mechanism)[name].key
            nominal, own = from_si(key_there, getattr(mechanism, name)), given.get(key)
            if nominal == 0.0:
                continue
            if own in (None, 0.0):
                given[key] = nominal
                continue
            low, high = own if isinstance(own, list) else (own, own)
            if not low * (1.0 - ROUNDING) <= nominal <= high * (1.0 + ROUNDING):
                said = f"[{low:.6g}, {high:.6g}]" if isinstance(own, list) else f"{own:.6g}"
                rule = f"strike.{key} = {said} is to hold it, one value in times and loads"
                remedy = f"correct one of them, or leave out strike.{key}"
                quantity, unit = f"mechanism.{key_there}", unit_of(key)
                raise InputError(refusal(quantity, nominal, unit, rule, remedy))
        for name in ("ring_inertia", "input_stiffness"):
            key = ranges_of(Strike)[name].key
            if key not in given:
                raise InputError(
                    f"'strike.{key}' is missing; add it, or mechanism.{key}, which shifts are "
                    "simulated with too"
                )
        return given

    def at_ends(self, clutch: Clutch, points: Sequence[OperatingPoint]) -> Iterator[Strike]:
        """Build the strike at the ends of all ranges together, or the one that the keys give.

        What the section leaves out is that of ``[mechanism]``. It has the mismatches of the points
        where it gives none of its own.
        """
        given, rings = self._with_mechanism(clutch.mechanism), clutch.rings
        if ("wheel_inertia_kgm2" in given) != ("output_stiffness_Nm_rad" in given):
            fault = "strike.wheel_inertia_kgm2 and strike.output_stiffness_Nm_rad go together"
            raise InputError(f"{fault}; give both, or none for a rigid output side")
        whole = {"sliding_inertia": rings.sliding_inertia, "output_inertia": rings.output_inertia}
        own = self.mismatch_rpm
        speeds = [p.mismatch for p in points] if own is None else [v * RPM for v in own]
        rigid = {"wheel_inertia": rings.output_inertia}
        ranges = [key for key, value in given.items() if isinstance(value, list)]
        for ends in itertools.product(*(given[key] for key in ranges)):
            taken = dict(zip(ranges, ends, strict=True))
            words = ", ".join(f"{key} = {end:g}" for key, end in taken.items())
            values = rigid | whole | si_fields(given | taken)
            yield Strike(**values, mismatch=tuple(speeds), ends=words)


class MaterialSection(keys_of(Material, material_of)):  # type: ignore[misc]
    """A named material set (``sim.strength.materials``) and what is to differ from it."""

    set: str = "16MnCr5"


class ManufacturingSection(keys_of(ManufacturingLimits)):  # type: ignore[misc]
    """Limits of the workshop (``sim.strength.manufacture``)."""


class ToleranceSection(keys_of(Tolerances, late=TOLERANCE_LATE)):  # type: ignore[misc]
    """Largest deviation of each dimension either way (``sim.strength.manufacture``)."""


class WearSection(keys_of(Wear)):  # type: ignore[misc]
    """Wear over the life (``sim.strength.landing``): of faces by one of two keys, and of edges."""


class VariablesSection(Section):
    """Search ranges ``[low, high]``; what is absent stays as in ``[dog]`` and ``[operating]``.

    ``mismatch_set_rpm`` is the mean that the speed control aims at, ``force_factor`` and
    ``rise_factor`` scale the shift force and its rise time (``pipeline.config.operating``).
    """

    chamfer_deg: Range | None = ranged(0.0, 60.0)
    traction_deg: Range | None = ranged(-10.0, 60.0)
    braking_deg: Range | None = ranged(-10.0, 60.0)
    height_mm: Range | None = None
    count: Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    crest: Range | None = ranged(0.0, 1.0, late=True)
    chamfer_back_deg: Range | None = ranged(0.0, 60.0, late=True)
    backlash_mm: Range | None = ranged(0.0, 50.0, late=True)
    mismatch_set_rpm: Range | None = ranged(-2000.0, 2000.0, late=True)
    force_factor: Range | None = ranged(0.01, 100.0, late=True)
    rise_factor: Range | None = ranged(0.1, 10.0, late=True)

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Ranges of the searched keys, edge units; InputError for mistakes."""
        found = {k: (low, high) for k, (low, high) in self.model_dump(exclude_none=True).items()}
        for key, (low, high) in found.items():
            if not low < high:
                raise InputError(
                    f"variables.{key} is [{low:.6g}, {high:.6g}], but the first must be below the "
                    "second; exchange them, or leave the key out to keep the dog's own value"
                )
        return found


class SearchSection(Section):
    """Objectives, sampler and budget of the search; ``studies/mq200/study.toml`` explains its keys.

    At most ``confirm_designs`` designs of the front are confirmed; the result's has no others.
    """

    objectives: Annotated[list[str], or_one(str)] = Field(
        min_length=1, default_factory=lambda: ["expected_shift_time_s", "axial_length_mm"]
    )
    sampler: Literal["surrogate", "space_filling"] = "surrogate"
    trials: Annotated[int, Field(ge=1, le=10_000)] = 32  # more take a day to propose
    startup: Annotated[int, Field(ge=1)] = 16
    batch: Annotated[int, Field(ge=1)] = 4
    seed: Annotated[int, Field(ge=0)] = 1
    confirm_designs: Annotated[int, Field(ge=1)] = 24
    confirm_angles: Annotated[int, Field(ge=3, le=256)] = 16
    audit_shifts: Annotated[int, Field(ge=0)] = later(200)
    quantile: Annotated[float, Field(gt=0.0, lt=1.0)] = later(QUANTILE)
    limits: dict[str, float] | None = later()
    within_s: Annotated[float, Field(gt=0.0)] | None = later()


class SolverSection(keys_of(Solver, solver_for, late=("max_steps", "time_limit"))):  # type: ignore[misc]
    """Numerical settings; absent ones follow from the contact set."""

    engine: str | None = later()
    scheme: str | None = None

    def solver(
        self, contact: ContactSet, mechanism: Mechanism = NOTHING, drive: Drive = NO_DRIVE
    ) -> Solver:
        """Build the solver of a contact set, a mechanism and a drive; InputError for mistakes.

        Forces of mechanism or drive with two coefficients of friction are the compiled engine's,
        unless the section names another: Drake's ``cenic`` takes a thousand times the processor
        time for them and is off its limit by percents (``docs/simulation.md``). The law IMPACT is
        the compiled engine's alone.
        """
        plain = solver_for(contact, mechanism, drive)
        forced = mechanism.has_forces or drive.has_torques
        hard = contact.impact or (forced and plain.scheme == "cenic")
        scheme, engine = self.scheme or plain.scheme, self.engine or ("planar" if hard else "drake")
        accuracy = accuracy_of(scheme, forced=forced) if scheme in SCHEMES else plain.accuracy
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


class StudyFile(Section):
    """The whole study file."""

    format: int
    name: Annotated[str, Field(min_length=1, max_length=100, pattern=r"^\w[\w.-]*$")]
    dog: DogSection
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
    material: MaterialSection = MaterialSection()
    manufacturing: ManufacturingSection = ManufacturingSection()
    tolerance: ToleranceSection = ToleranceSection()
    wear: WearSection | None = later()
    variables: VariablesSection = VariablesSection()
    search: SearchSection = SearchSection()
    solver: SolverSection = SolverSection()
    surrogate: SurrogateSection = SurrogateSection()

    def require_ranges(self) -> None:
        """Raise InputError for a value beyond the range that its key declares."""
        for table, section in self:
            varied = section is self.variables
            remedy = "narrow the range" if varied else "check the value and its unit"
            for name, declared in getattr(type(section), "model_fields", {}).items():
                given = getattr(section, name)
                if given is None or not declared.json_schema_extra:
                    continue
                low, high = declared.json_schema_extra["range"]
                more = f": {SCOPE}" if varied and name.endswith("_deg") else ""
                for value in given if isinstance(given, list) else [given]:
                    require_between(f"{table}.{name}", value, low, high, remedy + more)


def keys_like(stem: str) -> list[str]:
    """Return at most three keys of the study file that begin with a word: ``dog.chamfer_deg``."""
    if len(stem) < 3:
        return []
    sections = {name: section_in(one.annotation) for name, one in StudyFile.model_fields.items()}
    found = [f"{name}.{key}" for name, one in sections.items() if one for key in one.model_fields]
    return [key for key in found if key.partition(".")[2].lower().startswith(stem)][:3]
