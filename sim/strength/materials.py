r"""Materials of a dog: named sets of strength values, each with its source.

Values hold from room to gearbox-oil temperature; sets do not rank the steels, as test pieces
differ. Proof stress: core of blanks of 11 to 16 mm. Bending endurance: :math:`\sigma_{F,lim}` of
ISO 6336-5, MQ; the root endures :math:`Y_{ST} = 2` times that locally. Life: :math:`Y_{NT} = (3
\cdot 10^6/n)^x` from ``static_factor`` at 1000 cycles to 1, 0.85 at 1e10 (ISO 6336-3). Case depth
to 550 HV. Pressure: 100 to 200 MPa for hard fixed splines (DIN 5466-1); 0.7 of that nitrided, 0.8
induction-hardened (assumed). *Spectrum* (Miner, ISO 6336-6): :math:`D = \sum_i n_i/N(\sigma_i)`,
:math:`N = 3 \cdot 10^6\, (\sigma/\sigma_{3 \cdot 10^6})^{-1/x}`; none beyond the static strength.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dogshape.sim.elementwise import bisect
from dogshape.sim.errors import require_known
from dogshape.sim.quantity import quantity, require_ranges
from dogshape.sim.units import MM, MPA

STRESS_CORRECTION = 2.0  #: Y_ST of ISO 6336-3
STATIC_CYCLES = 1e3  #: below them the static strength holds, ISO 6336-3
ENDURANCE_CYCLES = 3e6  #: of the endurance limit, ISO 6336-3
LONG_CYCLES = 1e10  #: at the end of the curve, ISO 6336-3
LONG_FACTOR = 0.85  #: Y_NT at LONG_CYCLES
HARDNESS = 9.80665 * MPA  #: Pa of one HV
YOUNG = 210e9  #: of steel, Pa
POISSON = 0.3  #: of steel
DENSITY = 7850.0  #: of steel, kg/m3
LIMIT_HARDNESS_HV = 550  #: down to which a case depth is measured


@dataclass(frozen=True)
class Treatment:
    """Heat treatment: its words, and the symbol of its depth in ISO 15787."""

    words: str
    depth_symbol: str


CASE_HARDENED = Treatment("case-hardened", "CHD")
INDUCTION_HARDENED = Treatment("quenched and tempered, flanks and root induction-hardened", "SHD")
NITRIDED = Treatment("quenched and tempered, gas-nitrided", "NHD")


@dataclass(frozen=True)
class Material:
    """Strength of the dogs' material, SI; ``surface_hardness`` in HV.

    ``bending_endurance`` is the nominal bending stress number of ISO 6336-5, ``static_factor`` the
    endurance at 1000 load cycles over it, ``allowable_pressure`` the mean one on a flank.
    """

    name: str
    treatment: Treatment
    source: str  #: of the values
    proof_stress: float = quantity("proof_stress_MPa", 10.0, 5000.0)
    bending_endurance: float = quantity("bending_endurance_MPa", 10.0, 2000.0)
    static_factor: float = quantity("static_factor", 1.0, 5.0)
    allowable_pressure: float = quantity("allowable_pressure_MPa", 1.0, 5000.0)
    surface_hardness: float = quantity("surface_hardness_HV", 80.0, 1500.0)
    case_depth: float = quantity("case_depth_mm", 0.0, 10.0)

    def __post_init__(self) -> None:
        require_ranges(self, "material", "correct the material")

    @property
    def description(self) -> str:
        """Heat treatment, and source of the values."""
        return f"{self.treatment.words}; {self.source}"

    @property
    def heat_treatment(self) -> str:
        """Note of a drawing on treatment, hardness and case depth, as ISO 15787 words it."""
        note = f"{self.treatment.words}, surface hardness {self.surface_hardness:.0f} HV"
        if self.case_depth == 0.0:
            return note
        depth = f"{self.treatment.depth_symbol} {LIMIT_HARDNESS_HV} HV"
        return f"{note}, {depth} = {self.case_depth / MM:.1f} mm"

    def life_factor(self, cycles: float) -> float:
        """Compute the life factor Y_NT: endurance at ``cycles`` over the one at 3e6 cycles."""
        if cycles <= ENDURANCE_CYCLES:
            slope = math.log(self.static_factor) / math.log(ENDURANCE_CYCLES / STATIC_CYCLES)
            return float((ENDURANCE_CYCLES / max(cycles, STATIC_CYCLES)) ** slope)
        slope = -math.log(LONG_FACTOR) / math.log(LONG_CYCLES / ENDURANCE_CYCLES)
        return float((ENDURANCE_CYCLES / min(cycles, LONG_CYCLES)) ** slope)

    def endurance(self, cycles: float) -> float:
        """Compute the endurable local root stress for ``cycles`` pulsating loads, Pa."""
        return self.bending_endurance * STRESS_CORRECTION * self.life_factor(cycles)

    @property
    def edge_pressure(self) -> float:
        """Endurable Hertz pressure of a rounded edge, Pa.

        Shakedown limit of a line contact, four times the yield stress in shear.
        """
        return 4.0 * self.case_yield / math.sqrt(3.0)

    @property
    def case_yield(self) -> float:
        """Yield stress of the case, Pa: a third of its hardness (Tabor 1951)."""
        return self.surface_hardness * HARDNESS / 3.0


_SETS = (
    Material(
        "16MnCr5",
        treatment=CASE_HARDENED,
        proof_stress=735.0 * MPA,
        bending_endurance=430.0 * MPA,
        static_factor=2.5,
        allowable_pressure=200.0 * MPA,
        surface_hardness=700.0,
        case_depth=0.4 * MM,
        source="core: UNI 7846 test blanks of 11 mm, Rm 1030-1370 MPa; "
        "ISO 6336-5 MQ, lowest core hardness",
    ),
    Material(
        "20MnCr5",
        treatment=CASE_HARDENED,
        proof_stress=930.0 * MPA,
        bending_endurance=461.0 * MPA,
        static_factor=2.5,
        allowable_pressure=200.0 * MPA,
        surface_hardness=700.0,
        case_depth=0.4 * MM,
        source="core: UNI 7846 test blanks of 11 mm, Rm 1230-1570 MPa; "
        "ISO 6336-5 MQ, middle core hardness",
    ),
    Material(
        "18CrNiMo7-6",
        treatment=CASE_HARDENED,
        proof_stress=835.0 * MPA,
        bending_endurance=500.0 * MPA,
        static_factor=2.5,
        allowable_pressure=200.0 * MPA,
        surface_hardness=720.0,
        case_depth=0.4 * MM,
        source="core: DIN 17210 (as 17CrNiMo6) test blanks of 11 mm, Rm 1180-1430 "
        "MPa; ISO 6336-5 MQ, core of 30 HRC and more",
    ),
    Material(
        "42CrMo4",
        treatment=INDUCTION_HARDENED,
        proof_stress=900.0 * MPA,
        bending_endurance=369.0 * MPA,
        static_factor=2.5,
        allowable_pressure=160.0 * MPA,
        surface_hardness=600.0,
        case_depth=1.0 * MM,
        source="ISO 683-2 up to 16 mm, Rm 1100-1300 MPa; ISO 6336-5 MQ, hardened root",
    ),
    Material(
        "31CrMoV9",
        treatment=NITRIDED,
        proof_stress=900.0 * MPA,
        bending_endurance=420.0 * MPA,
        static_factor=1.6,
        allowable_pressure=140.0 * MPA,
        surface_hardness=750.0,
        case_depth=0.3 * MM,
        source="ISO 683-5 up to 40 mm, Rm 1100-1300 MPa; ISO 6336-5 MQ, nitriding steel",
    ),
)
MATERIALS: dict[str, Material] = {material.name: material for material in _SETS}


def material_of(name: str) -> Material:
    """Return the set ``name``; raises InputError with the valid names for an unknown one."""
    require_known("material.set", name, "a material set", MATERIALS)
    return MATERIALS[name]


def cycles_endured(material: Material, strength: float) -> float:
    """Compute the endurable cycles of a root; 0 beyond the static strength.

    ``strength`` is the stress over the endurance at 3e6 cycles.
    """
    if strength <= 0.0:
        return math.inf
    if strength > material.static_factor * (1.0 + 1e-12):  # the end of the slope belongs to it
        return 0.0
    if strength <= 1.0:
        cycle_ratio = LONG_CYCLES / ENDURANCE_CYCLES
        stress_ratio = 1.0 / LONG_FACTOR
    else:
        cycle_ratio = ENDURANCE_CYCLES / STATIC_CYCLES
        stress_ratio = material.static_factor
    slope = math.log(stress_ratio) / math.log(cycle_ratio)
    exponent = -math.log(strength) / slope if slope > 0.0 else -math.inf
    return ENDURANCE_CYCLES * math.exp(min(exponent, 600.0))


def damage(material: Material, strengths: Sequence[float], cycles: Sequence[float]) -> float:
    """Compute Miner's sum of load classes with ``cycles`` each.

    ``strengths`` are the stresses of the classes over the endurance at 3e6 cycles.
    """
    total = 0.0
    for count, strength in zip(cycles, strengths, strict=True):
        endurable = cycles_endured(material, strength)
        total += count / endurable if endurable else math.inf
    return total


def stress_reserve(material: Material, cycles: Sequence[float], *strengths: float) -> float:
    """Compute the factor on all stresses at which ``damage`` is 1; inf without a load."""
    peak = max(strengths, default=0.0)
    if peak <= 0.0:
        return math.inf

    def endures(factor: float) -> bool:
        return damage(material, [factor * strength for strength in strengths], cycles) <= 1.0

    # scipy.optimize takes half a second to load, which a quick check does not have.
    static_reserve = material.static_factor / peak
    if endures(static_reserve):
        return static_reserve
    return bisect(endures, 0.0, static_reserve, share=1e-12)[1]
