"""The study file: every key with its type and default, and the value of ``sim`` that a section is.

Lengths, angles and speeds are in the unit that a key ends in. Values are SI.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from dogshape.pipeline.config.operating import (
    ActuationSection,
    Numbers,
    OperatingSection,
)
from dogshape.sim.clutch_tables import (
    DogSection,
    MechanismSection,
    OutputSection,
    Section,
    SlidingSection,
    later,
    section_in,
    si_fields,
)
from dogshape.sim.errors import InputError, refusal, require_between
from dogshape.sim.shift.clutch import (
    PLANAR_ACCURACY,
    SCHEMES,
    ContactSet,
    OperatingPoint,
    Solver,
    accuracy_of,
    contact_set,
    solver_for,
)
from dogshape.sim.shift.geometry import SCOPE, Dog
from dogshape.sim.shift.mechanism import NOTHING, Mechanism
from dogshape.sim.statistics.uncertainty import Distribution
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits, Tolerances
from dogshape.sim.strength.materials import Material, material_of
from dogshape.sim.strength.strike import RESTITUTION, Strike
from dogshape.sim.strength.wear import Wear
from dogshape.sim.units import DEG, MM, RPM, to_si, unit_of

FORMAT = 1  #: version of the study file and of the folder that a study writes

QUANTILE = 0.95  #: of a shift's time, for ``shift_time_quantile_s``

MOST_TRIALS = 10_000  #: designs of a search
AUDIT_SHIFTS = 200  #: of a search, again in Drake
MIX_SHIFTS = 135_000  #: of a fit, at all operating points of designs

Range = Annotated[list[float], Field(min_length=2, max_length=2)]


class ContactSection(Section):
    """A named contact set and what is to differ from it."""

    set: str = "lubricated_steel"
    static_friction: float | None = None
    dynamic_friction: float | None = None
    stiction_velocity_m_s: float | None = None
    stiffness_Pa_m: float | None = None
    dissipation_s_m: float | None = None

    @property
    def own(self) -> dict[str, float]:
        """Fields of the contact set that the file has beside its name, SI."""
        return si_fields(self.model_dump(exclude={"set"}, exclude_none=True))

    @property
    def contact(self) -> ContactSet:
        """The contact set; InputError for mistakes."""
        return replace(contact_set(self.set), **self.own)  # type: ignore[arg-type]


class ShiftSection(Section):
    """When a shift is done or given up, what a retry costs, and how far a rebound goes."""

    timeout_s: float = 1.0
    retraction_s: float = 0.2
    seated_tolerance_mm: float = 0.05
    rebound_mm: float = 1.0

    def require(self) -> None:
        """Raise InputError for a value that is no time or length of a shift."""
        _positive("shift.timeout_s", self.timeout_s, 60.0)
        _positive("shift.seated_tolerance_mm", self.seated_tolerance_mm, 1.0)
        retraction, rebound = self.retraction_s, self.rebound_mm
        require_between("shift.retraction_s", retraction, 0.0, 60.0, "give a time in seconds")
        require_between("shift.rebound_mm", rebound, 0.0, 100.0, "give a length in mm")


def _positive(key: str, value: float, most: float) -> None:
    if not 0.0 < value <= most:
        unit = unit_of(key)
        rule = f"it must be positive and at most {most:.6g} {unit}"
        raise InputError(refusal(key, value, unit, rule, "check the value and its unit"))


class UncertainSection(Section):
    """Factors that differ from shift to shift; absent ones are one."""

    friction_factor: Distribution | None = None
    force_factor: Distribution | None = None
    inertia_factor: Distribution | None = None
    dissipation_factor: Distribution | None = later()


class ExpectationSection(Section):
    """Number of relative angles of an operating point, and the seed of their draw.

    With 96 the standard error of a mean over 28 operating points is about 0.2 % of it, 0.5 % where
    friction and dissipation are drawn.
    """

    angles: Annotated[int, Field(ge=3, le=4096)] = 96
    seed: Annotated[int, Field(ge=0)] = 1


class DrivelineSection(Section):
    """Shafts between the clutch and the vehicle; for the torque peak only."""

    stiffness_Nm_rad: float | None = None

    def require(self) -> None:
        """Raise InputError for a stiffness that no shaft has."""
        if self.stiffness_Nm_rad is not None:
            _positive("driveline.stiffness_Nm_rad", self.stiffness_Nm_rad, 1e7)


class LoadSection(Section):
    """Load case of the strength checks (``sim.strength.load_case``)."""

    torque_Nm: float = LoadCase.torque
    application_factor: float = LoadCase.application_factor
    load_sharing: float = LoadCase.load_sharing
    load_height: float = LoadCase.load_height
    safety: float = LoadCase.safety
    safety_fatigue: float = LoadCase.safety_fatigue
    shifts: float = LoadCase.shifts
    reversal: float = LoadCase.reversal
    friction_release: float = LoadCase.friction_release
    friction_hold: float = LoadCase.friction_hold
    separating_force_limit_N: float = LoadCase.separating_force_limit
    coast_share: float = later(1.0)
    pull_out_force_limit_N: float | None = later()
    accuracy: int | None = later()
    pitch_sd_um: float | None = later()
    dog_stiffness_N_um: float | None = later()
    spectrum: list[list[float]] | None = later()
    abuse_torque_Nm: float | None = later()
    axial_vibration_m_s2: float = later(0.0)
    run_out_um: float = later(0.0)
    tilt_mrad: float = later(0.0)
    release_by_itself: bool = later(True)
    landing_share: float | None = later()

    @property
    def case(self) -> LoadCase:
        """The load case without what contact and mechanism make of it; InputError for mistakes."""
        given = self.model_dump(exclude={"spectrum", "axial_vibration_m_s2"})
        classes = self.spectrum or []
        if any(len(one) != 2 for one in classes):
            raise InputError(
                f"load.spectrum is {classes}, but a class is [torque over the rated one, cycles]; "
                "give two numbers for each, e.g. [[1.0, 1e5], [-0.4, 2e6]]"
            )
        spectrum = tuple((share, cycles) for share, cycles in classes)
        return LoadCase(**si_fields(given), spectrum=spectrum)  # type: ignore[arg-type]


class StrikeSection(Section):
    """Flank strike of the strength checks (``sim.strength.strike``); absent, it is not judged."""

    ring_inertia_kgm2: float
    input_stiffness_Nm_rad: float
    wheel_inertia_kgm2: float | None = later()
    output_stiffness_Nm_rad: float | None = later()
    backlash_deg: float = 0.0
    restitution: float = RESTITUTION
    mismatch_rpm: Numbers | None = later()
    strikes: float | None = later()

    def strike(
        self, sliding: SlidingSection, output: OutputSection, points: Sequence[OperatingPoint]
    ) -> Strike:
        """Build the strike, at the mismatches of the points where it gives none of its own."""
        if (self.wheel_inertia_kgm2 is None) != (self.output_stiffness_Nm_rad is None):
            raise InputError(
                "strike.wheel_inertia_kgm2 and strike.output_stiffness_Nm_rad go together; "
                "give both, or none for a rigid output side"
            )
        own = self.mismatch_rpm
        return Strike(
            ring_inertia=self.ring_inertia_kgm2,
            sliding_inertia=sliding.inertia_kgm2,
            input_stiffness=self.input_stiffness_Nm_rad,
            wheel_inertia=self.wheel_inertia_kgm2 or output.inertia_kgm2,
            output_inertia=output.inertia_kgm2,
            output_stiffness=self.output_stiffness_Nm_rad,
            backlash=self.backlash_deg * DEG,
            restitution=self.restitution,
            mismatch=tuple([p.mismatch for p in points] if own is None else [v * RPM for v in own]),
            strikes=self.strikes,
        )


class MaterialSection(Section):
    """A named material set (``sim.strength.materials``) and what is to differ from it."""

    set: str = "16MnCr5"
    proof_stress_MPa: float | None = None
    bending_endurance_MPa: float | None = None
    static_factor: float | None = None
    allowable_pressure_MPa: float | None = None
    surface_hardness_HV: float | None = None
    case_depth_mm: float | None = None

    @property
    def material(self) -> Material:
        """The material; InputError for mistakes."""
        given = si_fields(self.model_dump(exclude={"set"}, exclude_none=True))
        return replace(material_of(self.set), **given)  # type: ignore[arg-type]


class ManufacturingSection(Section):
    """Limits of the workshop (``sim.strength.manufacture``)."""

    tip_width_mm: float = ManufacturingLimits.tip_width / MM
    slot_width_mm: float = ManufacturingLimits.slot_width / MM
    cutter_reach: float = ManufacturingLimits.cutter_reach
    flank_height_mm: float = ManufacturingLimits.flank_height / MM
    root_radius_mm: float = ManufacturingLimits.root_radius / MM
    tip_core_mm: float = ManufacturingLimits.tip_core / MM
    chamfer_share: float = ManufacturingLimits.chamfer_share
    module_mm: float = ManufacturingLimits.module / MM
    rim_mm: float | None = later()

    @property
    def limits(self) -> ManufacturingLimits:
        """The limits; InputError for mistakes."""
        return ManufacturingLimits(**si_fields(self.model_dump()))


class ToleranceSection(Section):
    """Largest deviation of each dimension either way (``sim.strength.manufacture``)."""

    chamfer_deg: float = Tolerances.chamfer / DEG
    traction_deg: float = Tolerances.traction / DEG
    braking_deg: float = Tolerances.braking / DEG
    height_mm: float = Tolerances.height / MM
    outer_diameter_mm: float = Tolerances.outer_diameter / MM
    inner_diameter_mm: float = Tolerances.inner_diameter / MM
    axial_gap_mm: float = Tolerances.axial_gap / MM
    root_radius_mm: float = Tolerances.root_radius / MM
    contact_ratio: float = Tolerances.contact_ratio
    clearance_mm: float = Tolerances.clearance / MM

    @property
    def tolerances(self) -> Tolerances:
        """The tolerances; InputError for mistakes."""
        return Tolerances(**si_fields(self.model_dump()))


class WearSection(Section):
    """Wear over the life (``sim.strength.wear``): of faces by one of two keys, and of edges."""

    rate_mm3_Nm: float | None = later()
    crest_loss_mm: float | None = later()
    edge_radius_mm: float | None = later()

    def wear(self, dog: Dog) -> Wear:
        """Build what wears the dogs; InputError for mistakes."""
        given = {k: v if v is None else to_si(k, v) for k, v in self}
        wear = Wear(given["rate_mm3_Nm"], given["crest_loss_mm"], given["edge_radius_mm"])
        wear.edges(dog, 1.0)
        return wear


class VariablesSection(Section):
    """Search ranges ``[low, high]``; what is absent stays as in ``[dog]`` and ``[operating]``.

    ``mismatch_set_rpm`` is the mean that the speed control aims at, ``force_factor`` and
    ``rise_factor`` scale the shift force and its rise time (``pipeline.config.operating``).
    """

    chamfer_deg: Range | None = None
    traction_deg: Range | None = None
    braking_deg: Range | None = None
    height_mm: Range | None = None
    count: Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    mismatch_set_rpm: Range | None = later()
    force_factor: Range | None = later()
    rise_factor: Range | None = later()

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Ranges of the searched keys, edge units; InputError for mistakes."""
        found = self.model_dump(exclude_none=True)
        for key, (low, high) in found.items():
            if not low < high:
                raise InputError(
                    f"variables.{key} is [{low:.6g}, {high:.6g}], but the first must be below the "
                    "second; exchange them, or leave the key out to keep the dog's own value"
                )
            if key.endswith("_deg") and not 0.0 <= low <= high < 60.0:
                rule, wrong = "angles must lie between 0 and 60 deg", low if low < 0.0 else high
                remedy = SCOPE if low < 0.0 else "narrow the range"
                raise InputError(refusal(f"variables.{key}", wrong, "deg", rule, remedy))
        return {key: (low, high) for key, (low, high) in found.items()}


def _few_trials(trials: int) -> int:
    if trials > MOST_TRIALS:
        why = "which take a day to propose"
        limit = {"most": f"{MOST_TRIALS} designs", "why": why}
        raise PydanticCustomError("too_large", "too many designs", limit)
    return trials


class SearchSection(Section):
    """Objectives, sampler and budget of the search.

    ``limits``: bounds on any quantity of ``pipeline.simulate.design``. ``within_s``: time of the
    share that engages at the first try. ``confirm_designs``: designs of the front that are
    confirmed, at most; others are not on the front of the result. ``confirm_angles``: new relative
    angles of each operating point at which Drake simulates such a design. ``audit_shifts``: shifts
    of the search that Drake simulates again, drawn at random.
    """

    objectives: list[str] = Field(
        min_length=1, default_factory=lambda: ["expected_shift_time_s", "axial_length_mm"]
    )
    sampler: Literal["surrogate", "space_filling"] = "surrogate"
    trials: Annotated[int, Field(ge=1), AfterValidator(_few_trials)] = 32
    startup: Annotated[int, Field(ge=1)] = 16
    batch: Annotated[int, Field(ge=1)] = 4
    seed: Annotated[int, Field(ge=0)] = 1
    confirm_designs: Annotated[int, Field(ge=1)] = 24
    confirm_angles: Annotated[int, Field(ge=3, le=256)] = 16
    audit_shifts: Annotated[int, Field(ge=0)] = later(AUDIT_SHIFTS)
    quantile: Annotated[float, Field(gt=0.0, lt=1.0)] = later(QUANTILE)
    limits: dict[str, float] | None = later()
    within_s: Annotated[float, Field(gt=0.0)] | None = later()


class SolverSection(Section):
    """Numerical settings; absent ones follow from the contact set."""

    engine: str | None = later()
    scheme: str | None = None
    accuracy: float | None = None
    max_step_s: float | None = None
    max_steps: int | None = later()
    time_limit_s: float | None = later()

    def solver(self, contact: ContactSet, mechanism: Mechanism = NOTHING) -> Solver:
        """Build the solver of a contact set and a mechanism; InputError for mistakes.

        Forces of a mechanism with two coefficients of friction are the compiled engine's, unless
        the section names another: Drake's ``cenic`` takes a thousand times the processor time for
        them and is off its limit by percents (``docs/simulation.md``).
        """
        solver, engine = solver_for(contact, mechanism), self.engine
        if mechanism.has_forces and solver.scheme == "cenic" and engine is None:
            engine = "planar"
        if self.scheme is not None:
            known = self.scheme in SCHEMES
            accuracy = accuracy_of(self.scheme, mechanism) if known else solver.accuracy
            solver = Solver(self.scheme, accuracy)
        if engine is not None:
            accuracy = PLANAR_ACCURACY if engine == "planar" else solver.accuracy
            solver = replace(solver, engine=engine, accuracy=accuracy)
        own = {"accuracy": self.accuracy, "max_step": self.max_step_s,
               "max_steps": self.max_steps, "time_limit": self.time_limit_s}  # fmt: skip
        given = {name: value for name, value in own.items() if value is not None}
        return replace(solver, **given)  # type: ignore[arg-type]


class SurrogateSection(Section):
    """Simulations of ``fit``: designs at all operating points of the study, and references.

    ``mix_shifts`` are those of all designs. ``references`` fill the space, ``best_references`` are
    of the tenth expected to be best; each has ``reference_angles`` at every operating point.
    """

    references: Annotated[int, Field(ge=3)] = 40
    best_references: Annotated[int, Field(ge=0)] = 20
    reference_angles: Annotated[int, Field(ge=3)] = 32
    mix_shifts: Annotated[int, Field(ge=1)] = later(MIX_SHIFTS)
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


def keys_like(stem: str) -> list[str]:
    """Return at most three keys of the study file that begin with a word, as ``dog.chamfer_deg``.

    Of the sections the first in the file that has such keys.
    """
    for section, field in StudyFile.model_fields.items():
        inner = section_in(field.annotation)
        keys = inner.model_fields if inner else {}
        found = [f"{section}.{name}" for name in keys if name.lower().startswith(stem)]
        if found and len(stem) > 2:
            return found[:3]
    return []
