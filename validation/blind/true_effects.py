"""Truth of cases: effects by the names of the contract, and causes outside the list.

Ranges are those of the priors, written out here so that truth does not depend on ``sim.effects``
(a test compares them). A *strength* is a share of the way from neutral to an end
of the prior, beyond it above 1: of the range where the prior is uniform, of the logarithm where it
is log-uniform.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dogshape.sim.units import DEG, MM, RPM
from dogshape.validation.blind.stand import Truth

Values = dict[str, float]


@dataclass(frozen=True)
class Range:
    """Parameter of an effect with its field of the truth and its prior."""

    name: str  #: with the unit of its values
    field: str  #: of the truth
    unit: float  #: in SI units
    low: float
    high: float
    log: bool = False  #: whether the prior is log-uniform
    neutral: float = 0.0  #: value without effect
    by_strength: bool = True  #: False for a position, such as that of a detent
    least: float = -math.inf  #: smallest value with which every clutch of a set is possible
    most: float = math.inf  #: largest such value

    def value_at(self, strength: float, upwards: bool) -> float:
        """Compute the value at a strength from 0, towards the upper or the lower end."""
        if self.log:
            start = self.neutral if self.neutral > self.low else self.low
            end = self.high if upwards or start == self.low else self.low
            return float(start * (end / start) ** strength)
        end = self.high if upwards or self.neutral <= self.low else self.low
        value = self.neutral + strength * (end - self.neutral)
        return min(max(self.least, value), self.most)

    def draw(self, generator: np.random.Generator) -> float:
        """Draw a value from the inner four fifths of the prior."""
        share = 0.1 + 0.8 * float(generator.random())
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)


#: The list: parameters by effect.
RANGES: dict[str, tuple[Range, ...]] = {
    "actuation_delay": (Range("delay_s", "delay", 1.0, 0.0, 0.4),),
    "actuation_lag": (Range("lag_s", "lag", 1.0, 0.003, 0.45, True),),
    "axial_gap": (Range("gap_offset_mm", "gap_offset", MM, -0.8, 0.8, least=-0.7),),
    "chamfer_angle": (
        Range("chamfer_offset_deg", "chamfer_offset", DEG, -4.0, 4.0, least=-7.0, most=5.0),
    ),
    "contact_friction": (
        Range("static_friction", "static_friction", 1.0, 0.05, 0.45, neutral=0.30, least=0.03),
        Range("dynamic_friction", "dynamic_friction", 1.0, 0.03, 0.35, neutral=0.16, least=0.02),
    ),
    "detent_force": (
        Range("detent_N", "detent", 1.0, 10.0, 200.0, True),
        Range("position_mm", "detent_position", MM, 0.5, 4.5, neutral=0.5, by_strength=False),
    ),
    "drag_torque": (Range("drag_Nm", "drag_torque", 1.0, 0.02, 8.0, True),),
    "force_loss": (Range("loss_N", "force_loss", 1.0, 2.0, 150.0, True),),
    "force_rise": (Range("rise_factor", "rise_factor", 1.0, 0.4, 2.5, True, 1.0),),
    "force_scale": (Range("force_factor", "force_factor", 1.0, 0.5, 1.5, neutral=1.0, least=0.3),),
    "free_play": (Range("free_play_mm", "free_play", MM, 0.05, 2.0, True),),
    "linkage_compliance": (
        Range("compliance_mm_kN", "compliance", 1e-6, 0.3, 35.0, True),
        Range("mass_behind_kg", "added_mass", 1.0, 0.03, 18.0, True, by_strength=False),
    ),
    "mismatch_speed": (
        Range("offset_rpm", "mismatch_offset", RPM, -4.0, 4.0),
        Range("mismatch_factor", "mismatch_factor", 1.0, 0.75, 1.25, neutral=1.0),
    ),
    "moving_mass": (Range("added_mass_kg", "added_mass", 1.0, 0.03, 18.0, True),),
    "relative_angle": (
        Range("concentration", "concentration", 1.0, 0.1, 10.0, True),
        Range("centre_pitch", "centre", 1.0, 0.0, 1.0, by_strength=False),
    ),
    "reversed_mismatch": (),
    "sleeve_friction": (Range("friction_N", "friction", 1.0, 3.0, 200.0, True),),
    "sliding_inertia": (Range("inertia_factor", "inertia_factor", 1.0, 1.1, 8.0, True, 1.0),),
    "spline_friction": (Range("spline_friction", "spline_friction", 1.0, 0.01, 0.3, True),),
    "viscous_damping": (Range("damping_Ns_m", "damping", 1.0, 5.0, 1600.0, True),),
}

#: Field of the truth that an effect without parameters sets.
SWITCHES = {"reversed_mismatch": "reversed"}

#: Outside the list: fields of the truth at a strength in [0, 1].
OUTSIDE: dict[str, Callable[[float], dict[str, Any]]] = {
    "sticking_valve": lambda s: {"sticking": 0.2 * s},
    #: Every other shift waits for a valve that hangs.
    "hanging_valve": lambda s: {"hang": 0.5, "hang_time": 0.15 * s},
    "speed_ripple": lambda s: {"ripple": 90.0 * RPM * s},
    "high_dog": lambda s: {"high_dog": 1.6 * MM * s},
    #: A fifth of the force is there before most rings have landed: the first stage lies below.
    "two_stages": lambda s: {"stage": 0.15 - 0.14 * s, "stage_time": 0.1 + 0.2 * s},
    #: Two loggers whose clocks part over the series.
    "clock_drift": lambda s: {"clock_drift": 0.12 * s},
    #: Friction of the dogs rises over the series.
    "galling": lambda s: {"galling": 2.0 * s},
    #: Friction along the shaft that falls with the speed.
    "stribeck_friction": lambda s: {"static_excess": 180.0 * s},
    #: Dogs on an elastic ring: far softer than a contact, and hardly damped.
    "elastic_dogs": lambda s: {"stiffness": 6e11 * 0.02**s, "dissipation": 100.0 * 0.1**s},
    #: Times stand beside the wrong forces or mismatches, in reverse order: the table's fault.
    "swapped_forces": lambda s: {},
    "swapped_speeds": lambda s: {},
}

#: Contact of the clutch, which no case has as a cause: factors of the published values, from and
#: to, of which each case has its own.
NUISANCES: dict[str, tuple[float, float]] = {
    "stiffness": (0.6, 1.6),
    "dissipation": (0.6, 1.4),
    "stiction": (0.8, 1.2),
}


def values_of(effect: str, strength: float, generator: np.random.Generator) -> Values:
    """Draw the parameters of an effect of the list at a strength; the side is drawn.

    Coefficients of friction go the same way, so that the dynamic one stays below.
    """
    upwards = bool(generator.random() < 0.5)
    values = {}
    for parameter in RANGES[effect]:
        if parameter.by_strength:
            values[parameter.name] = parameter.value_at(strength, upwards)
        else:
            values[parameter.name] = parameter.draw(generator)
    return values


def contact_of(generator: np.random.Generator) -> dict[str, float]:
    """Draw the contact of a case, by field of the truth."""
    neutral = Truth()
    contact = {}
    for name, (low, high) in NUISANCES.items():
        factor = float(low * (high / low) ** generator.random())
        contact[name] = factor * float(getattr(neutral, name))
    return contact


def truth_of(
    parameters: Mapping[str, Values],
    outside: Mapping[str, float],
    contact: Mapping[str, float] | None = None,
    sensor: str = "actuator",
) -> Truth:
    """Build the truth of effects of the list and, by strength, of things outside it.

    ``contact`` are fields of the truth; ``sensor`` is the side of a linkage that is read.
    """
    fields: dict[str, Any] = {**(contact or {}), "sensor": sensor}
    fields |= {SWITCHES[effect]: True for effect in parameters if effect in SWITCHES}
    for effect, values in parameters.items():
        for parameter in RANGES[effect]:
            if parameter.name in values:  # a mass behind a linkage and an added mass add up
                value = parameter.unit * values[parameter.name]
                fields[parameter.field] = fields.get(parameter.field, 0.0) + value
    for name, strength in outside.items():
        fields |= OUTSIDE[name](strength)
    return Truth(**fields)
