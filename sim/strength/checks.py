"""A check: a number of a design against its limit, with the rule that it follows.

The module with the closed form computes value and limit by the name in ``RULES`` (``Row``).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from dogshape.sim.elementwise import largest, smallest, where
from dogshape.sim.shift.geometry import FLANKS
from dogshape.sim.units import from_si

Group = Literal["make", "load", "lock", "impact", "tolerance", "goal"]

#: Subject of each group, in the order of reports.
GROUPS: dict[Group, str] = {
    "make": "manufacture",
    "load": "strength",
    "lock": "engagement and release",
    "impact": "landing, dog on dog",
    "tolerance": "contact within tolerances",
    "goal": "limits of the study",
}

STUDY_SOURCE = "the study's own limit"
#: Short forms of sources that name neither a standard nor an author.
_SHORT_FORMS = {
    "geometry": "geometry",
    "equilibrium": "equilibrium",
    "parabola over a rectangle": "beam theory",
    "simulated blow": "simulation",
    "judged": "judged",
    "assumption": "assumption",
    STUDY_SOURCE: "study",
}
_STANDARD = r"(?:DIN|ISO) \d[\d-]*\d"
_AUTHOR = r"[A-Z]\w+ (?:et al\. )?(?:19|20)\d\d|Rao|Timoshenko|von Mises"
_REFERENCE = re.compile("|".join((_STANDARD, _AUTHOR, *_SHORT_FORMS)))


def references_of(source: str) -> str:
    """Pick standards, authors or short forms from the source of a check, separated by commas."""
    references = dict.fromkeys(_SHORT_FORMS.get(word, word) for word in _REFERENCE.findall(source))
    texts = list[str]()
    standard = ""
    for reference in references:
        number, _, part = reference.rpartition("-")
        # Further parts of the standard before are their numbers alone: ISO 6336-3, -5.
        texts.append(f"-{part}" if standard and number == standard else reference)
        standard = number
    return ", ".join(texts)


@dataclass(frozen=True)
class Rule:
    """Declaration of a check: meaning, formula and unit of its value, sources, key of its limit."""

    name: str
    group: Group
    meaning: str
    formula: str
    source: str
    unit: str
    key: str  #: key of the study file that sets the limit
    at_most: bool
    summary: bool = False  #: whether the value sums up other checks

    @property
    def assumed(self) -> bool:
        """Whether the limit has no source."""
        return "assumption" in self.source

    @property
    def references(self) -> str:
        """Standards and authors that value and limit follow, or their kind."""
        return references_of(self.source)


@dataclass(frozen=True)
class LimitCheck:
    """Value against limit, both in the unit of ``rule``; of many designs arrays (n,)."""

    rule: Rule
    value: float
    limit: float
    ends: str = ""  #: ends of ranges in the study file at which the margin is smallest
    interval: tuple[float, float] | None = None  #: of the value, 95 %; None where it is exact
    ring: str = ""  #: of unlike rings the one with the smaller margin; empty where both are alike

    @property
    def name(self) -> str:
        """Name of the rule."""
        return self.rule.name

    @property
    def margin(self) -> float:
        """Distance to the limit over the limit; negative when the check fails."""
        return self._margin_of(self.value)

    def _margin_of(self, value: float) -> float:
        distance = self.limit - value if self.rule.at_most else value - self.limit
        return distance / (abs(self.limit) + (self.limit == 0.0))  # over 1 where the limit is 0

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
        numerator, denominator = self.limit, self.value
        if self.rule.at_most:
            numerator, denominator = self.value, self.limit
        share = largest(numerator, 0.0) / where(denominator > 0.0, denominator, 1.0)
        return where(denominator > 0.0, smallest(share, 1e3), 1e3)

    @property
    def remedy(self) -> str:
        """Dimensions and settings that raise the margin, or the limit."""
        name = self.name.removesuffix("_traction").removesuffix("_braking")
        change = f"change {self.rule.key}"
        remedy = REMEDIES.get(name) or REMEDIES.get(self.rule.group)
        return f"{remedy}, or {change}" if remedy else change

    @property
    def fault(self) -> str:
        """Value and limit in words, for a check that fails."""
        value = f"{self.value:.4g} {self.rule.unit}".strip()
        limit = f"{self.limit:.4g} {self.rule.unit}".strip()
        if self.ends:
            value = f"{value} at {self.ends}"
        bound = "at most" if self.rule.at_most else "at least"
        ring = f" (of the {self.ring})" if self.ring else ""
        return f"{self.rule.meaning}{ring} is {value}, but it must be {bound} {limit}"

    @property
    def passed(self) -> bool:
        """Whether the value keeps the limit."""
        return self.margin >= 0.0


def safety_factor(rule: Rule, margin: float) -> float | None:
    """Compute the upper limit of a stress or force over its value; None for other checks."""
    if not rule.at_most or rule.unit not in ("MPa", "N") or margin >= 1.0:
        return None
    return 1.0 / (1.0 - margin)


def feasible(checks: Iterable[LimitCheck]) -> bool:
    """Test whether every check passes."""
    return all(check.passed for check in checks)


def smallest_margin(checks: Iterable[LimitCheck]) -> LimitCheck:
    """Return the check with the smallest margin, without those that sum up others."""
    return min((c for c in checks if not c.rule.summary), key=lambda check: check.margin)


def worse_check(first: LimitCheck, second: LimitCheck) -> LimitCheck:
    """Return the check with the smaller margin of two of one rule, design by design."""
    is_first = first.margin <= second.margin
    return LimitCheck(
        first.rule,
        value=where(is_first, first.value, second.value),
        limit=where(is_first, first.limit, second.limit),
        ends=where(is_first, first.ends, second.ends),
    )


RINGS = ("sliding ring", "output ring")  #: names of unlike rings


def worse_ring(sliding: LimitCheck, output: LimitCheck) -> LimitCheck:
    """Return the check with the smaller margin of both rings, with the name of its ring."""
    check = worse_check(sliding, output)
    sliding_name = where(sliding.margin < output.margin, RINGS[0], "")
    return replace(check, ring=where(output.margin < sliding.margin, RINGS[1], sliding_name))


_NARROW = "use fewer or lower dogs or smaller side angles"
_LOW_FLANK = "use a smaller chamfer, more dogs or a higher dog"
_SIDE = (
    "use larger side angles or less friction, or where the actuator pulls, as out of undercut "
    "flanks, load.release_by_itself = false"
)
_BLOW = "use less shift force or moving mass, a wider ring"
#: Dimensions and settings that raise the margin of a check, by its name or group.
REMEDIES: dict[str, str] = {
    "tip_width": _NARROW,
    "tip_core": f"{_NARROW}, or a shallower case (material.case_depth_mm)",
    **dict.fromkeys(("slot_width", "cutter_reach"), f"{_NARROW}, or less undercut"),
    **dict.fromkeys(("flank_height", "chamfer_share"), _LOW_FLANK),
    "root_radius": "use a smaller radius, fewer dogs, or a smaller chamfer",
    "edge_clearance": "use a larger dog.edge_radius_mm, or smaller root fillets",
    "module": "use fewer dogs or a larger diameter",
    "chamfer_release": "use a larger chamfer, less friction of the faces "
    "(contact.face_friction, by default load.friction_release), or for flat tips "
    "load.faces_release = false",
    **{f"{flank}_release": _SIDE for flank in FLANKS},
    "retention": "use undercut of more than load.wear_angle_deg, smaller side angles, or a detent "
    "or latch that holds the force",
    "pull_out_force": "use larger side angles or less undercut, or less torque left then "
    "(load.pull_out_share), or less friction (mechanism.spline_friction, load.friction_release)",
    "engagement": "use a larger chamfer, less friction of the faces (contact.face_friction) or "
    "less shift force where faces hold each other, less mismatch or more backlash where dogs skip",
    "load": "use a wider or larger ring, finer load.accuracy or larger root fillets",
    "flank_pressure": "use higher or more dogs, a wider or larger ring or finer load.accuracy",
    "rim": "use a thicker ring behind the roots",
    "sleeve_hoop": "use a thicker sleeve (manufacturing.rim_mm), higher dogs or a smaller "
    "sleeve.pressure_angle_deg",
    **dict.fromkeys(
        ("tooth_bending", "tooth_shear"),
        "use higher dogs, a larger ring, less backlash or finer load.accuracy",
    ),
    "face_pressure_impact": f"{_BLOW} or a larger dog.edge_radius_mm",
    "core_pressure_impact": f"{_BLOW} or a deeper case (material.case_depth_mm)",
    "edge_bedding_impact": f"{_BLOW} or a larger dog.edge_radius_mm",
    "contact_ratio": "use a higher dog, a smaller chamfer or smaller tolerances",
    "clearance": "use a larger dog.axial_gap_mm or smaller tolerances",
    "mouth_play": "use more backlash, less undercut, a larger chamfer or smaller tolerances",
}
_STATIC = "Jasny et al. 2019, with the static coefficient"
_STRIKE = "two-mass impact coupled through the shafts (Rao); limit: "
#: Rules of all checks but a study's own limits; ``{flank}`` stands for either flank.
_TABLE = (
    Rule(
        "tip_width",
        "make",
        meaning="width of the tip at the inner radius",
        formula="(pitch angle - backlash angle) r_i/2 - h (tan beta + tan gamma)/2",
        source="handling and distortion in hardening (assumption)",
        unit="mm",
        key="manufacturing.tip_width_mm",
        at_most=False,
    ),
    Rule(
        "slot_width",
        "make",
        meaning="width of the slot's floor, of undercut flanks of its mouth, at the inner radius",
        formula="pitch at r_i less the larger of root and tip width",
        source="smallest cutter (assumption)",
        unit="mm",
        key="manufacturing.slot_width_mm",
        at_most=False,
    ),
    Rule(
        "cutter_reach",
        "make",
        meaning="depth of the slot over the width of its floor",
        formula="h over the slot's width at the inner radius",
        source="reach of a short end mill, three diameters (assumption)",
        unit="",
        key="manufacturing.cutter_reach",
        at_most=True,
    ),
    Rule(
        "flank_height",
        "make",
        meaning="height of the lower flank at the outer radius, where it is lowest",
        formula="h - d, d depth of the tip at its lower edge there",
        source="keeps a flank on either side (assumption)",
        unit="mm",
        key="manufacturing.flank_height_mm",
        at_most=False,
    ),
    Rule(
        "root_radius",
        "make",
        meaning="largest root radius that fits into slot and tip",
        formula="two fillets on the slot's floor, two roundings on the tip, one of each on a flank",
        source="geometry; wear of the cutter sets the limit (assumption)",
        unit="mm",
        key="manufacturing.root_radius_mm",
        at_most=False,
    ),
    Rule(
        "edge_clearance",
        "make",
        meaning="radius of the tip edges, which meet the root fillets of the other ring",
        formula="R of the edges, at least that of the roots",
        source="geometry: a ball that fits into the tip fits into the slot",
        unit="mm",
        key="manufacturing.root_radius_mm",
        at_most=False,
    ),
    Rule(
        "chamfer_share",
        "make",
        meaning="depth of the tip at its lower edge over the height of the dog",
        formula="d/h",
        source="leaves a flank of two thirds (assumption)",
        unit="",
        key="manufacturing.chamfer_share",
        at_most=True,
    ),
    Rule(
        "module",
        "make",
        meaning="mean diameter over the number of dogs",
        formula="2 r/N",
        source="distortion in hardening (assumption)",
        unit="mm",
        key="manufacturing.module_mm",
        at_most=False,
    ),
    Rule(
        "tip_core",
        "make",
        meaning="soft core of the tip at the inner radius",
        formula="width of the tip less a case depth from either side",
        source="a tip hardened through chips; limit an assumption",
        unit="mm",
        key="manufacturing.tip_core_mm",
        at_most=False,
    ),
    Rule(
        "chamfer_release",
        "lock",
        meaning="chamfer, of a roof the smaller, which slides from rest above the friction angle",
        formula="angle against arctan of the static coefficient",
        source=_STATIC,
        unit="deg",
        key="load.friction_release",
        at_most=False,
    ),
    Rule(
        "{flank}_release",
        "lock",
        meaning="{flank} flank, which is self-locking below the friction angle",
        formula="angle against arctan of the static coefficient + arctan(mu_t r/r_t) of the spline",
        source=_STATIC,
        unit="deg",
        key="load.friction_release",
        at_most=False,
    ),
    Rule(
        "retention_{flank}",
        "lock",
        meaning="axial force that pushes the worn {flank} flank out of gear without friction, "
        "below 0 it pulls in",
        formula="K_A T/r tan(worn side angle) + m a, T of coast on the braking flank; a flank up "
        "to 0 wears by load.wear_angle_deg",
        source="Jasny et al. 2019 without friction, which gives way under vibration; limit: what "
        "latch, detent or fork hold",
        unit="N",
        key="load.separating_force_limit_N",
        at_most=True,
    ),
    Rule(
        "retention_reversal",
        "lock",
        meaning="axial force on the blocking mechanism as the torque reverses",
        formula="m a of ring and fork: flanks without torque hold nothing",
        source="equilibrium of the ring; limit: what latch, detent or fork hold",
        unit="N",
        key="load.separating_force_limit_N",
        at_most=True,
    ),
    Rule(
        "pull_out_force",
        "lock",
        meaning="axial force that pulls the ring out under load.pull_out_share of the torque, the "
        "worse flank",
        formula="mu_t T/r_t - T/r tan(side angle - rho), mu_t and r_t of the spline, rho static; "
        "a flank with a negative one pushes the ring out",
        source="equilibrium of the ring; limit: load.pull_out_force_limit_N, or else the return "
        "spring of the actuator, or else the smallest shift force of the operating points",
        unit="N",
        key="load.pull_out_force_limit_N",
        at_most=True,
    ),
    Rule(
        "engagement",
        "lock",
        meaning="least share of the shifts that engage, of any operating point",
        formula="engaged over simulated shifts",
        source="judged: below it the time-out makes the expected time, and not the dogs",
        unit="",
        key="[shift] and the shape",
        at_most=False,
    ),
    Rule(
        "flank_pressure_{flank}",
        "load",
        meaning="mean pressure on the {flank} flank",
        formula="F/A, A what touches at full depth",
        source="DIN 5466-1; limit of the material set",
        unit="MPa",
        key="material.allowable_pressure_MPa",
        at_most=True,
    ),
    Rule(
        "root_bending_{flank}",
        "load",
        meaning="tension in the fillet below the loaded {flank} flank",
        formula="notch factor times nominal root stress, load at the load height",
        source="Heywood 1948, fitted to finite elements; limit: static strength, ISO 6336-3",
        unit="MPa",
        key="material.bending_endurance_MPa",
        at_most=True,
    ),
    Rule(
        "shear_stress",
        "load",
        meaning="shear stress of the root",
        formula="1.5 F/(b s)",
        source="parabola over a rectangle; limit: proof stress of the core over safety and sqrt(3)",
        unit="MPa",
        key="material.proof_stress_MPa",
        at_most=True,
    ),
    Rule(
        "tooth_bending_{flank}",
        "load",
        meaning="tension in the root fillet of a sleeve's tooth under the loaded {flank} flank",
        formula="Y_S 6 F l/(L s^2), l from root to pitch circle, s thickness at the root circle, "
        "L engaged length",
        source="radial cantilever, stress correction of ISO 6336-3; limit: static strength, "
        "ISO 6336-3",
        unit="MPa",
        key="material.bending_endurance_MPa",
        at_most=True,
    ),
    Rule(
        "tooth_shear",
        "load",
        meaning="shear stress of a sleeve's tooth at the pitch circle, the worse flank",
        formula="F/(L s), L engaged length, s thickness at the pitch circle",
        source="Dudley 1957; limit: proof stress of the core over safety and sqrt(3)",
        unit="MPa",
        key="material.proof_stress_MPa",
        at_most=True,
    ),
    Rule(
        "sleeve_hoop",
        "load",
        meaning="hoop stress of the sleeve outside its teeth, the worse flank",
        formula="T tan(phi)/(2 pi r t L) + rho w^2/4 ((3 + nu) r_o^2 + (1 - nu) r_i^2), phi "
        "pressure angle, t rim, w speed",
        source="Dudley 1957, rotating annulus (Timoshenko); limit: proof stress of the core over "
        "safety",
        unit="MPa",
        key="material.proof_stress_MPa",
        at_most=True,
    ),
    Rule(
        "equivalent_stress",
        "load",
        meaning="equivalent stress of the core at the root, the worse flank",
        formula="sqrt(sigma_c^2 + 3 tau^2), sigma_c the tension below the case",
        source="von Mises; limit: proof stress of the core over safety",
        unit="MPa",
        key="material.proof_stress_MPa",
        at_most=True,
    ),
    Rule(
        "root_fatigue",
        "load",
        meaning="tension in the fillet, the worse flank, over the shifts of the life",
        formula="as root bending; limit: bending_endurance 2 Y_NT(shifts) "
        "reversal/safety_fatigue, or at the largest torque of load.spectrum what it is "
        "when Miner's sum of all classes is 1",
        source="ISO 6336-3, ISO 6336-5, ISO 6336-6",
        unit="MPa",
        key="load.shifts",
        at_most=True,
    ),
    Rule(
        "rim",
        "load",
        meaning="thickness of the ring behind the roots; below 1.2 heights it raises the stress "
        "of the root",
        formula="manufacturing.rim_mm against 0.5 h; root stress times Y_B = 1.6 ln(2.242 h/rim)",
        source="ISO 6336-3, rim thickness factor, whose range ends there",
        unit="mm",
        key="dog.height_mm",
        at_most=False,
    ),
    Rule(
        "flank_strike_root",
        "load",
        meaning="tension in the fillet when flanks strike, the worse flank",
        formula="as root bending, F = T/(r N sqrt(K_l)); T = sum |k D q/omega| over the modes of "
        "ring, wheel and shafts, or nu w sqrt(k J) of a second strike",
        source=f"{_STRIKE}static strength, or less where strike.strikes allow less, ISO 6336-3",
        unit="MPa",
        key="material.bending_endurance_MPa",
        at_most=True,
    ),
    Rule(
        "flank_strike_flank",
        "load",
        meaning="mean pressure on the flank when flanks strike, the worse flank",
        formula="F/A, F as in flank_strike_root",
        source=f"{_STRIKE}yield stress of the case, HV/3, over safety",
        unit="MPa",
        key="material.surface_hardness_HV",
        at_most=True,
    ),
    Rule(
        "face_pressure_impact",
        "impact",
        meaning="mean pressure over the overlap of the faces, hardest landing",
        formula="w/(L sqrt(K_l)), w = sqrt(2 u k) of elastic dogs, u energy of the blow",
        source="simulated blow on elastic dogs; limit: yield stress of the case, HV/3, over safety",
        unit="MPa",
        key="material.surface_hardness_HV",
        at_most=True,
    ),
    Rule(
        "core_pressure_impact",
        "impact",
        meaning="mean pressure below the case of the faces, hardest landing",
        formula="w/((L - 2 c + 2 t) sqrt(K_l)), w as on the faces, c what a rounded crest takes, t "
        "case depth",
        source="simulated blow on elastic dogs; limit: proof stress of the core over safety",
        unit="MPa",
        key="material.proof_stress_MPa",
        at_most=True,
    ),
    Rule(
        "edge_bedding_impact",
        "impact",
        meaning="depth by which new rounded edges bed in, hardest landing",
        formula="a^2 (1/rho - 1/R')/2, a = 2 w/(pi p), R' = 2 w E*/(pi p^2), p = 0.77 HV; 0 where "
        "the pressure of Hertz is below p",
        source="simulated blow on elastic dogs; shakedown of a line contact (Johnson 1985); limit: "
        "share of the case depth (judged)",
        unit="um",
        key="load.edge_bedding_share",
        at_most=True,
    ),
    Rule(
        "contact_ratio",
        "tolerance",
        meaning="share of the height that touches on the worse flank, within the tolerances",
        formula="(height that touches - seated tolerance)/h less the root sum of squares of all "
        "losses",
        source="normal dimensions at tolerance.reject_rate; limit an assumption",
        unit="",
        key="tolerance.contact_ratio",
        at_most=False,
    ),
    Rule(
        "clearance",
        "tolerance",
        meaning="gap between the crests in neutral, within the tolerances of gap and heights",
        formula="axial gap less the root sum of squares of its tolerance and twice that of the "
        "height",
        source="dogs that meet in neutral ratchet; limit an assumption",
        unit="mm",
        key="tolerance.clearance_mm",
        at_most=False,
    ),
    Rule(
        "mouth_play",
        "tolerance",
        meaning="play at the mouth of a slot as undercut dogs enter, at the inner radius, within "
        "the tolerances",
        formula="j r_i/r + (h - d_1 - d_2)(tan beta + tan gamma) less the root sum of squares of "
        "all losses, j backlash, d depth of either tip at its lower edge",
        source="geometry; limit: pitch errors of both rings (assumption)",
        unit="mm",
        key="tolerance.mouth_play_mm",
        at_most=False,
    ),
)


def _rules_of(rule: Rule) -> tuple[Rule, ...]:
    """Expand a rule with ``{flank}`` into the rules of both flanks."""
    if "{flank}" not in rule.name:
        return (rule,)
    return tuple(
        replace(rule, name=rule.name.format(flank=flank), meaning=rule.meaning.format(flank=flank))
        for flank in FLANKS
    )


#: By name, all but a study's own limits.
RULES = {rule.name: rule for row in _TABLE for rule in _rules_of(row)}

Row = tuple[str, float, float]  #: name of a rule, value and limit, SI


def checks_of(rows: Iterable[Row], ends: str = "") -> tuple[LimitCheck, ...]:
    """Build the checks of values and limits in SI, in the units of their rules."""
    checks = []
    for name, value, limit in rows:
        rule = RULES[name]
        suffix = f"_{rule.unit}"
        checks.append(LimitCheck(rule, from_si(suffix, value), from_si(suffix, limit), ends))
    return tuple(checks)
