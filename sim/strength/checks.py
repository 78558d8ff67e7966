"""A check: a number of a design against its limit, with the rule that it follows.

The module with the closed form gives value and limit by the name in ``RULES`` (``Row``).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from dogshape.sim.elementwise import largest, smallest, where
from dogshape.sim.shift.geometry import FLANKS
from dogshape.sim.units import from_si

Group = Literal["make", "load", "lock", "impact", "tolerance", "goal"]

#: What the groups are about, in the order of reports.
GROUPS: dict[Group, str] = {
    "make": "manufacture",
    "load": "strength",
    "lock": "engagement and release",
    "impact": "landing, dog on dog",
    "tolerance": "contact within tolerances",
    "goal": "limits of the study",
}


@dataclass(frozen=True)
class Rule:
    """Question of a check: value in words, its formula, source of formula and limit."""

    name: str
    group: Group
    meaning: str
    formula: str
    source: str
    unit: str
    key: str  #: of the study file, which sets the limit
    at_most: bool
    summary: bool = False  #: whether the value sums up other checks

    @property
    def assumed(self) -> bool:
        """Whether the limit has no source."""
        return "assumption" in self.source


@dataclass(frozen=True)
class Check:
    """Value against limit, both in the unit of ``rule``; of many designs arrays (n,)."""

    rule: Rule
    value: float
    limit: float
    ends: str = ""  #: of ranges in the study file at which the margin is smallest
    interval: tuple[float, float] | None = None  #: of the value, 95 %; None where it is exact

    @property
    def name(self) -> str:
        """Name of the rule."""
        return self.rule.name

    @property
    def margin(self) -> float:
        """Distance to the limit over the limit; negative when the check fails."""
        return self._margin_of(self.value)

    def _margin_of(self, value: float) -> float:
        left = self.limit - value if self.rule.at_most else value - self.limit
        return left / (abs(self.limit) + (self.limit == 0.0))  # over 1 where the limit is 0

    @property
    def margin_interval(self) -> tuple[float, float] | None:
        """Ends of the margin's interval, 95 %; None where the value is exact."""
        if self.interval is None:
            return None
        first, second = map(self._margin_of, self.interval)
        return min(first, second), max(first, second)

    @property
    def clear(self) -> bool:
        """Whether the margin keeps its sign within its interval."""
        ends = self.margin_interval
        return ends is None or ends[0] >= 0.0 or ends[1] < 0.0

    @property
    def utilisation(self) -> float:
        """Value over an upper limit, or lower limit over value; 1 at the limit, at most 1000."""
        over, under = (self.value, self.limit) if self.rule.at_most else (self.limit, self.value)
        share = largest(over, 0.0) / where(under > 0.0, under, 1.0)
        return where(under > 0.0, smallest(share, 1e3), 1e3)

    @property
    def remedy(self) -> str:
        """Dimensions and settings that raise the margin, or the limit."""
        by = self.name.removesuffix("_traction").removesuffix("_braking")
        known = REMEDIES.get(by) or REMEDIES.get(self.rule.group)
        return f"{known}, or change {self.rule.key}" if known else f"change {self.rule.key}"

    @property
    def fault(self) -> str:
        """Value and limit in words, for a check that fails."""
        value, limit = (f"{one:.4g} {self.rule.unit}".strip() for one in (self.value, self.limit))
        bound = "at most" if self.rule.at_most else "at least"
        at = f" at {self.ends}" if self.ends else ""
        return f"{self.rule.meaning} is {value}{at}, but it must be {bound} {limit}"

    @property
    def passed(self) -> bool:
        """Whether the value keeps the limit."""
        return self.margin >= 0.0


def safety_factor(rule: Rule, margin: float) -> float | None:
    """Compute the upper limit of a stress or force over its value; None for other checks."""
    loaded = rule.at_most and rule.unit in ("MPa", "N") and margin < 1.0
    return 1.0 / (1.0 - margin) if loaded else None


def feasible(checks: Iterable[Check]) -> bool:
    """Decide whether every check passes."""
    return all(check.passed for check in checks)


def smallest_margin(checks: Iterable[Check]) -> Check:
    """Return the check with the smallest margin; one that sums up others names none of them."""
    return min((c for c in checks if not c.rule.summary), key=lambda check: check.margin)


def worse(one: Check, other: Check) -> Check:
    """Return the check with the smaller margin of two of one rule, design by design."""
    first = one.margin <= other.margin
    value, limit = where(first, one.value, other.value), where(first, one.limit, other.limit)
    return Check(one.rule, value, limit, where(first, one.ends, other.ends))


_NARROW = "use fewer or lower dogs or smaller side angles"
_LOW_FLANK = "use a smaller chamfer, more dogs or a higher dog"
_SIDE = "use larger side angles, or where the actuator pulls load.release_by_itself = false"
#: Dimensions and settings that raise the margin of a check, by its name or group.
REMEDIES: dict[str, str] = {
    **dict.fromkeys(("tip_width", "slot_width", "cutter_reach", "tip_core"), _NARROW),
    **dict.fromkeys(("flank_height", "chamfer_share"), _LOW_FLANK),
    "root_radius": "use a smaller radius, fewer dogs, or a smaller chamfer",
    "edge_clearance": "use a larger dog.edge_radius_mm, or smaller root fillets",
    "module": "use fewer dogs or a larger diameter",
    "chamfer_release": "use a larger chamfer, or for flat tips load.faces_release = false",
    **{f"{flank}_release": _SIDE for flank in FLANKS},
    "retention": "use undercut of more than load.wear_angle_deg, smaller side angles, or a detent "
    "or latch that holds the force",
    "pull_out_force": "use larger side angles, or less torque left then (load.pull_out_share), or "
    "less mechanism.spline_friction",
    "engagement": "use a larger chamfer where faces hold each other, less mismatch or more "
    "backlash where dogs skip",
    "load": "use a wider or larger ring, finer load.accuracy or larger root fillets",
    "flank_pressure": "use higher or more dogs, a wider or larger ring or finer load.accuracy",
    "rim": "use a thicker ring behind the roots",
    "impact": "use less shift force or moving mass, a wider ring or a larger dog.edge_radius_mm",
    "contact_ratio": "use a higher dog, a smaller chamfer or smaller tolerances",
    "clearance": "use a larger dog.axial_gap_mm or smaller tolerances",
}
_STATIC = "Jasny et al. 2019, with the static coefficient"
_STRIKE = "two-mass impact coupled through the shafts (Rao); limit: "
#: Name (of both flanks at once), unit, key of the limit, whether it is an upper one; then meaning,
#: formula and source.
_TABLE: dict[Group, tuple[tuple[str, str, str, bool, str, str, str], ...]] = {
    "make": (
        ("tip_width", "mm", "manufacturing.tip_width_mm", False,
         "width of the tip at the inner radius",
         "(pitch angle - backlash angle) r_i/2 - h (tan beta + tan gamma)/2",
         "handling and distortion in hardening (assumption)"),
        ("slot_width", "mm", "manufacturing.slot_width_mm", False,
         "width of the slot's floor, of undercut flanks of its mouth, at the inner radius",
         "pitch at r_i less the larger of root and tip width", "smallest cutter (assumption)"),
        ("cutter_reach", "", "manufacturing.cutter_reach", True,
         "depth of the slot over the width of its floor",
         "h over the slot's width at the inner radius",
         "reach of a short end mill, three diameters (assumption)"),
        ("flank_height", "mm", "manufacturing.flank_height_mm", False,
         "height of the lower flank at the outer radius, where it is lowest",
         "h - d, d depth of the tip at its lower edge there",
         "keeps a flank on either side (assumption)"),
        ("root_radius", "mm", "manufacturing.root_radius_mm", False,
         "largest root radius that fits into slot and tip",
         "two fillets on the slot's floor, two roundings on the tip, one of each on a flank",
         "geometry; wear of the cutter sets the limit (assumption)"),
        ("edge_clearance", "mm", "manufacturing.root_radius_mm", False,
         "radius of the tip edges, which meet the root fillets of the other ring",
         "R of the edges, at least that of the roots",
         "geometry: a ball that fits into the tip fits into the slot"),
        ("chamfer_share", "", "manufacturing.chamfer_share", True,
         "depth of the tip at its lower edge over the height of the dog", "d/h",
         "leaves a flank of two thirds (assumption)"),
        ("module", "mm", "manufacturing.module_mm", False, "mean diameter over the number of dogs",
         "2 r/N", "distortion in hardening (assumption)"),
        ("tip_core", "mm", "manufacturing.tip_core_mm", False,
         "soft core of the tip at the inner radius", "width of the tip less a case depth from "
         "either side", "a tip hardened through chips; limit an assumption"),
    ),
    "lock": (
        ("chamfer_release", "deg", "load.friction_release", False,
         "chamfer, of a roof the smaller, which slides from rest above the friction angle",
         "angle against arctan of the static coefficient", _STATIC),
        ("{flank}_release", "deg", "load.friction_release", False,
         "{flank} flank, which is self-locking below the friction angle",
         "angle against arctan of the static coefficient + arctan(mu_t r/r_t) of the spline",
         _STATIC),
        ("retention_{flank}", "N", "load.separating_force_limit_N", True,
         "axial force that pushes the worn {flank} flank out of gear without friction, below 0 it "
         "pulls in",
         "K_A T/r tan(worn side angle) + m a, T of coast on the braking flank; a flank up to 0 "
         "wears by load.wear_angle_deg",
         "Jasny et al. 2019 without friction, which gives way under vibration; limit: what latch, "
         "detent or fork hold"),
        ("retention_reversal", "N", "load.separating_force_limit_N", True,
         "axial force on the blocking mechanism as the torque reverses",
         "m a of ring and fork: flanks without torque hold nothing",
         "equilibrium of the ring; limit: what latch, detent or fork hold"),
        ("pull_out_force", "N", "load.pull_out_force_limit_N", True,
         "axial force that pulls the ring out under load.pull_out_share of the torque, the worse "
         "flank",
         "mu_t T/r_t - T/r tan(side angle - rho), mu_t and r_t of the spline, rho static; a flank "
         "with a negative one pushes the ring out",
         "equilibrium of the ring; limit: load.pull_out_force_limit_N, or else the smallest shift "
         "force of the operating points"),
        ("engagement", "", "[shift] and the shape", False,
         "least share of the shifts that engage, of any operating point",
         "engaged over simulated shifts",
         "judged: below it the time-out makes the expected time, and not the dogs"),
    ),
    "load": (
        ("flank_pressure_{flank}", "MPa", "material.allowable_pressure_MPa", True,
         "mean pressure on the {flank} flank", "F/A, A what touches at full depth",
         "DIN 5466-1; limit of the material set"),
        ("root_bending_{flank}", "MPa", "material.bending_endurance_MPa", True,
         "tension in the fillet below the loaded {flank} flank",
         "notch factor times nominal root stress, load at the load height",
         "Heywood 1948, fitted to finite elements; limit: static strength, ISO 6336-3"),
        ("shear_stress", "MPa", "material.proof_stress_MPa", True, "shear stress of the root",
         "1.5 F/(b s)",
         "parabola over a rectangle; limit: proof stress of the core over safety and sqrt(3)"),
        ("equivalent_stress", "MPa", "material.proof_stress_MPa", True,
         "equivalent stress of the core at the root, the worse flank",
         "sqrt(sigma_c^2 + 3 tau^2), sigma_c the tension below the case",
         "von Mises; limit: proof stress of the core over safety"),
        ("root_fatigue", "MPa", "load.shifts", True,
         "tension in the fillet, the worse flank, over the shifts of the life",
         "as root bending; limit: bending_endurance 2 Y_NT(shifts) reversal/safety_fatigue, or at "
         "the largest torque of load.spectrum what it is when Miner's sum of all classes is 1",
         "ISO 6336-3, ISO 6336-5, ISO 6336-6"),
        ("rim", "mm", "dog.height_mm", False,
         "thickness of the ring behind the roots; below 1.2 heights it raises the stress of the "
         "root",
         "manufacturing.rim_mm against 0.5 h; root stress times Y_B = 1.6 ln(2.242 h/rim)",
         "ISO 6336-3, rim thickness factor, whose range ends there"),
        ("flank_strike_root", "MPa", "material.bending_endurance_MPa", True,
         "tension in the fillet when flanks strike, the worse flank",
         "as root bending, F = T/(r N sqrt(K_l)); T = sum |k D q/omega| over the modes of ring, "
         "wheel and shafts, or nu w sqrt(k J) of a second strike",
         f"{_STRIKE}static strength, or less where strike.strikes allow less, ISO 6336-3"),
        ("flank_strike_flank", "MPa", "material.surface_hardness_HV", True,
         "mean pressure on the flank when flanks strike, the worse flank",
         "F/A, F as in flank_strike_root",
         f"{_STRIKE}yield stress of the case, HV/3, over safety"),
    ),
    "impact": (
        ("face_pressure_impact", "MPa", "material.surface_hardness_HV", True,
         "mean pressure on the flat overlap of the faces, hardest landing",
         "w/((L - 2 c) sqrt(K_s)), w = F/(N b), c what a rounded crest takes",
         "simulated peak; limit: yield stress of the case, HV/3, over safety"),
        ("core_pressure_impact", "MPa", "material.proof_stress_MPa", True,
         "mean pressure below the case of the faces, hardest landing",
         "w/((L - 2 c + 2 t) sqrt(K_s)), t case depth",
         "simulated peak; limit: proof stress of the core over safety"),
        ("edge_pressure_impact", "MPa", "material.surface_hardness_HV", True,
         "pressure of Hertz of rounded edge on rounded edge, hardest landing",
         "sqrt(w E*/(pi rho/2 sqrt(K_s)))",
         "simulated peak; limit 0.77 HV, shakedown of a line contact (Johnson 1985)"),
    ),
    "tolerance": (
        ("contact_ratio", "", "tolerance.contact_ratio", False,
         "share of the height that touches on the worse flank, within the tolerances",
         "(height that touches - seated tolerance)/h less the root sum of squares of all losses",
         "normal dimensions at tolerance.reject_rate; limit an assumption"),
        ("clearance", "mm", "tolerance.clearance_mm", False,
         "gap between the crests in neutral, within the tolerances of gap and heights",
         "axial gap less the root sum of squares of its tolerance and twice that of the height",
         "dogs that meet in neutral ratchet; limit an assumption"),
    ),
}  # fmt: skip
#: By name, all but a study's own limits.
RULES = {
    name.format(flank=flank): Rule(
        name.format(flank=flank), group, meaning.format(flank=flank), formula, source, unit, key,
        at_most,
    )
    for group, rows in _TABLE.items()
    for name, unit, key, at_most, meaning, formula, source in rows
    for flank in (FLANKS if "{flank}" in name else ("",))
}  # fmt: skip

Row = tuple[str, float, float]  #: name of a rule, value and limit, SI


def checks_of(rows: Iterable[Row], ends: str = "") -> tuple[Check, ...]:
    """Return the checks of values and limits, which turn from SI to the units of their rules."""
    return tuple(
        Check(rule, from_si(f"_{rule.unit}", value), from_si(f"_{rule.unit}", limit), ends)
        for rule, value, limit in ((RULES[name], value, limit) for name, value, limit in rows)
    )
