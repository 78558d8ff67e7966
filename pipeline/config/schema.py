"""The study file: every key with its type and default, and nothing else.

Lengths, angles and speeds are in the unit that a key ends in.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from dogshape.sim.clutch_tables import (
    DogSection,
    MechanismSection,
    OutputSection,
    Section,
    SlidingSection,
    section_in,
)
from dogshape.sim.statistics.uncertainty import Distribution
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits
from dogshape.sim.strength.strike import RESTITUTION
from dogshape.sim.strength.tolerance import Tolerances
from dogshape.sim.units import DEG, MM

FORMAT = 1  #: version of the study file and of the folder that a study writes

QUANTILE = 0.95  #: of a shift's time, for ``shift_time_quantile_s``

MOST_TRIALS = 10_000  #: designs of a search
AUDIT_SHIFTS = 200  #: of a search, again in Drake
MIX_SHIFTS = 135_000  #: of a fit, at all operating points of designs

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Numbers = Annotated[list[float], Field(min_length=1)]


def _unless_given() -> Any:
    """Return the default of a key that came later: unset, it is no part of a file's hash."""
    return Field(default=None, exclude_if=lambda value: value is None)


class ContactSection(Section):
    """A named contact set and what is to differ from it."""

    set: str = "lubricated_steel"
    static_friction: float | None = None
    dynamic_friction: float | None = None
    stiction_velocity_m_s: float | None = None
    stiffness_Pa_m: float | None = None
    dissipation_s_m: float | None = None


class ShiftSection(Section):
    """When a shift is done or given up, what a retry costs, and how far a rebound goes."""

    timeout_s: float = 1.0
    retraction_s: float = 0.2
    seated_tolerance_mm: float = 0.05
    rebound_mm: float = 1.0


class ActuationSection(Section):
    """Rise time of the shift force by its final value; linear in between."""

    force_N: Numbers
    rise_s: Numbers


def _absent(value: Any) -> bool:
    """Recognise a key that is not given; such keys are neither stored nor hashed."""
    return value is None


class DistributionSection(Section):
    """A distribution in place of a number (``sim.statistics.uncertainty``)."""

    distribution: str
    mean: float | None = None
    sd: float | None = None
    median: float | None = None
    factor: float | None = None
    low: float | None = None
    mode: float | None = None
    high: float | None = None

    def named(self, key: str) -> Distribution:
        """Build the distribution that stands at ``key``; mistakes raise InputError."""
        numbers = self.model_dump(exclude={"distribution"})
        return Distribution(key, self.distribution, **numbers)


#: A list of numbers or a distribution; tags have a space, which no key has.
Spread = Annotated[
    Annotated[Numbers, Tag("a list")] | Annotated[DistributionSection, Tag("a distribution")],
    Discriminator(
        lambda v: "a distribution" if isinstance(v, dict | DistributionSection) else "a list"
    ),
]


class PointSection(Section):
    """One operating point of a list."""

    mismatch_rpm: float
    force_N: float
    weight: float = 1.0


class OperatingSection(Section):
    """Operating points: a set, grid, list or draw (``pipeline.config.operating_points``)."""

    set: str | None = Field(default=None, exclude_if=_absent)
    mismatch_rpm: Spread | None = Field(default=None, exclude_if=_absent)
    force_N: Spread | None = Field(default=None, exclude_if=_absent)
    mismatch_weight: Numbers | None = Field(default=None, exclude_if=_absent)
    force_weight: Numbers | None = Field(default=None, exclude_if=_absent)
    points: Annotated[list[PointSection], Field(min_length=1)] | None = Field(
        default=None, exclude_if=_absent
    )
    samples: Annotated[int, Field(ge=1, le=4096)] | None = Field(default=None, exclude_if=_absent)
    seed: Annotated[int, Field(ge=0)] | None = Field(default=None, exclude_if=_absent)


class UncertainSection(Section):
    """Factors that differ from shift to shift; absent ones are one."""

    friction_factor: DistributionSection | None = None
    force_factor: DistributionSection | None = None
    inertia_factor: DistributionSection | None = None
    dissipation_factor: DistributionSection | None = _unless_given()


class ExpectationSection(Section):
    """Number of relative angles of an operating point, and the seed of their draw.

    With 96 the standard error of a mean over 28 operating points is about 0.3 % of it.
    """

    angles: Annotated[int, Field(ge=3, le=4096)] = 96
    seed: Annotated[int, Field(ge=0)] = 1


class DrivelineSection(Section):
    """Shafts between the clutch and the vehicle; for the torque peak only."""

    stiffness_Nm_rad: float | None = None


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
    coast_share: float = Field(default=1.0, exclude_if=lambda value: value == 1.0)
    pull_out_force_limit_N: float | None = _unless_given()
    accuracy: int | None = _unless_given()
    pitch_sd_um: float | None = _unless_given()
    dog_stiffness_N_um: float | None = _unless_given()
    spectrum: list[list[float]] | None = _unless_given()
    abuse_torque_Nm: float | None = _unless_given()
    axial_vibration_m_s2: float = Field(default=0.0, exclude_if=lambda value: value == 0.0)
    run_out_um: float = Field(default=0.0, exclude_if=lambda value: value == 0.0)
    tilt_mrad: float = Field(default=0.0, exclude_if=lambda value: value == 0.0)
    release_by_itself: bool = Field(default=True, exclude_if=lambda value: value is True)
    landing_share: float | None = _unless_given()
    edge_contact: Literal["bed", "line"] = Field(
        default="bed", exclude_if=lambda value: value == "bed"
    )


class StrikeSection(Section):
    """Flank strike of the strength checks (``sim.strength.strike``); absent, it is not judged."""

    ring_inertia_kgm2: float
    input_stiffness_Nm_rad: float
    wheel_inertia_kgm2: float | None = _unless_given()
    output_stiffness_Nm_rad: float | None = _unless_given()
    backlash_deg: float = 0.0
    restitution: float = RESTITUTION
    mismatch_rpm: Numbers | None = _unless_given()
    strikes: float | None = _unless_given()


class MaterialSection(Section):
    """A named material set (``sim.strength.materials``) and what is to differ from it."""

    set: str = "16MnCr5"
    proof_stress_MPa: float | None = None
    bending_endurance_MPa: float | None = None
    static_factor: float | None = None
    allowable_pressure_MPa: float | None = None
    surface_hardness_HV: float | None = None
    case_depth_mm: float | None = None


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
    rim_mm: float | None = _unless_given()


class ToleranceSection(Section):
    """Largest deviation of each dimension either way (``sim.strength.tolerance``)."""

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
    distribution: str = Field(
        default=Tolerances.distribution,
        exclude_if=lambda value: value == Tolerances.distribution,
    )


class WearSection(Section):
    """Wear over the life (``sim.strength.wear``): of faces by one of two keys, and of edges."""

    rate_mm3_Nm: float | None = _unless_given()
    crest_loss_mm: float | None = _unless_given()
    edge_radius_mm: float | None = _unless_given()


class VariablesSection(Section):
    """Search ranges ``[low, high]``; what is absent stays as in ``[dog]`` and ``[operating]``.

    ``mismatch_set_rpm`` is the mean that the speed control aims at, ``force_factor`` and
    ``rise_factor`` scale the shift force and its rise time (``pipeline.config.set_point``).
    """

    chamfer_deg: Range | None = None
    traction_deg: Range | None = None
    braking_deg: Range | None = None
    height_mm: Range | None = None
    count: Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    mismatch_set_rpm: Range | None = _unless_given()
    force_factor: Range | None = _unless_given()
    rise_factor: Range | None = _unless_given()


def _few_trials(trials: int) -> int:
    if trials > MOST_TRIALS:
        why = "which take a day to propose"
        limit = {"most": f"{MOST_TRIALS} designs", "why": why}
        raise PydanticCustomError("too_large", "too many designs", limit)
    return trials


class SearchSection(Section):
    """Objectives, sampler and budget of the search.

    ``limits``: bounds on any quantity of ``pipeline.simulate.design``. ``within_s``: time of the
    share that engages at the first try. ``reference``: keys of the dog that no operating point may
    be slower than; those absent are the study's own. ``confirm_designs``: designs of the front that
    are confirmed, at most; others are not on the front of the result. ``confirm_angles``: new
    relative angles of each operating point at which Drake simulates such a design.
    ``audit_shifts``: shifts of the search that Drake simulates again, drawn at random.
    """

    objectives: list[str] = Field(
        min_length=1, default_factory=lambda: ["expected_shift_time_s", "axial_length_mm"]
    )
    sampler: str = "surrogate"
    trials: Annotated[int, Field(ge=1), AfterValidator(_few_trials)] = 32
    startup: Annotated[int, Field(ge=1)] = 16
    batch: Annotated[int, Field(ge=1)] = 4
    seed: Annotated[int, Field(ge=0)] = 1
    confirm_designs: Annotated[int, Field(ge=1)] = 24
    confirm_angles: Annotated[int, Field(ge=3, le=256)] = 16
    audit_shifts: Annotated[int, Field(ge=0)] = Field(
        default=AUDIT_SHIFTS, exclude_if=lambda value: value == AUDIT_SHIFTS
    )
    quantile: Annotated[float, Field(gt=0.0, lt=1.0)] = Field(
        default=QUANTILE, exclude_if=lambda value: value == QUANTILE
    )
    limits: dict[str, float] | None = _unless_given()
    within_s: Annotated[float, Field(gt=0.0)] | None = _unless_given()
    reference: dict[str, float] | None = _unless_given()


class SolverSection(Section):
    """Numerical settings; absent ones follow from the contact set."""

    engine: str | None = _unless_given()
    scheme: str | None = None
    accuracy: float | None = None
    max_step_s: float | None = None
    max_steps: int | None = _unless_given()
    time_limit_s: float | None = _unless_given()


class SurrogateSection(Section):
    """Simulations of ``fit``: designs that fill their space, and references to judge it by.

    ``references`` fill the space too, ``best_references`` are of the tenth found best.

    Each of ``designs`` gets ``points`` operating points of its own with ``angles`` angles.
    ``mix_shifts`` more are of designs that have all of the study's operating points. A reference
    has all of these with ``reference_angles``, and more where the relative standard error of its
    expected time would exceed ``reference_error``.
    """

    designs: Annotated[int, Field(ge=10)] = 250
    points: Annotated[int, Field(ge=1)] = 5
    angles: Annotated[int, Field(ge=3)] = 16
    references: Annotated[int, Field(ge=3)] = 40
    best_references: Annotated[int, Field(ge=0)] = 20
    reference_angles: Annotated[int, Field(ge=3)] = 12
    reference_error: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.007
    mix_shifts: Annotated[int, Field(ge=0)] = Field(
        default=MIX_SHIFTS, exclude_if=lambda value: value == MIX_SHIFTS
    )
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
    mechanism: MechanismSection | None = Field(default=None, exclude_if=_absent)
    effects: dict[str, Any] | None = Field(default=None, exclude_if=_absent)
    uncertain: UncertainSection | None = Field(default=None, exclude_if=_absent)
    expectation: ExpectationSection = ExpectationSection()
    driveline: DrivelineSection = DrivelineSection()
    load: LoadSection = LoadSection()
    strike: StrikeSection | None = Field(default=None, exclude_if=_absent)
    material: MaterialSection = MaterialSection()
    manufacturing: ManufacturingSection = ManufacturingSection()
    tolerance: ToleranceSection = ToleranceSection()
    wear: WearSection | None = Field(default=None, exclude_if=_absent)
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
