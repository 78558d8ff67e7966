r"""Mechanism between actuator and sliding ring, and around the ring: none by default.

.. math::
    m_s \ddot x &= L - R_0 \sigma(\dot x) - D(x) - c \dot x - \mu_s |T| \sigma(\dot x)/r_s - F_c, \\
    m_a \ddot y &= F(t) - L, \qquad J_1 \dot\omega = M_c - M_0 \sigma(\omega), \qquad
    \sigma(v) = v/\sqrt{v^2 + v_0^2}.

Linkage: :math:`L = k u + c_L \dot u`, :math:`u = y - x`, with free play between two stops; without
both :math:`L = F(t)`. Detent: :math:`D = D_0 (b(x - x_0) - b(x - x_1))`, :math:`b(s) = (1 - 4
s^2/w^2)^2_+`, slope of an energy hill of :math:`8 D_0 w/15` that the ring climbs about :math:`x_0`
and falls from into its seat about :math:`x_1`, where there is one: the whole way takes no work, and
out of the seat the ring needs :math:`D_0`. Spline: :math:`T = M_c (1 - m r^2/J_1)`. Shafts turn
ring and wheel by :math:`T = c_1 [u]_b + d_1 \dot u`, the lead of the rest beyond the play *b*; then
*T* presses the spline and the drag holds the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, Refusal
from dogshape.sim.quantity import quantities_of, quantity, record_quantities, require_ranges
from dogshape.sim.units import MM

Number = TypeVar("Number", float, Array)  #: a number or (n,)

SMOOTH_SPEED_M_S = 1e-3  #: below which friction along the shaft is smooth
SMOOTH_TURN_RAD_S = 0.05  #: below which the drag torque is smooth
FORK_MASS_SHARE = 0.1  #: share of the ring's mass that stands on the actuator's side of a linkage
DAMPING_RATIO = 0.3  #: of a linkage; a stop then gives back 0.6 of the speed of a slow blow
STOP_COMPLIANCE_M_N = 1e-6  #: of a linkage that has play and is stiff otherwise
SPLINE = 0.8  #: radius of the spline over the inner radius of the dogs, where none is given
STOP_DEPTH_M = 1e-5  #: depth in a stop at which half of the damping acts
SHAFT_DAMPING = 0.02  #: of a shaft with what hangs on it, over the critical one
STOP_TWIST_RAD = 1e-4  #: twist beyond a play at which half of the damping acts


@dataclass(frozen=True)
class Shaft:
    """Inertias of a ring and of the side behind its shaft."""

    ring_inertia: float  #: of the ring, kg m2
    side_inertia: float  #: of the side behind the shaft, kg m2; 0 where the side is one piece
    stiffness: float  #: N m/rad
    damping: float  #: N m s/rad
    backlash: float = 0.0  #: play between them, rad

    def torque(self, lead: Number, rate: Number) -> Number:
        """Compute the torque on the ring, N m; ``lead`` of its side in rad and its rate."""
        half_play = 0.5 * self.backlash
        law = (self.stiffness, self.damping)
        return spring_force(lead, rate, law, stops=(-half_play, half_play), deep=STOP_TWIST_RAD)


def shaft_of(
    ring_inertia: float, total_inertia: float, stiffness: float, backlash: float = 0.0
) -> Shaft:
    """Build the shaft behind a ring of an inertia in kg m2, 0 for a side in one piece.

    ``total_inertia`` is that of ring and side, kg m2; stiffness in N m/rad, backlash in rad.
    """
    if ring_inertia == 0.0:
        return Shaft(total_inertia, 0.0, 0.0, 0.0)
    side_inertia = total_inertia - ring_inertia
    reduced_stiffness = stiffness * ring_inertia * side_inertia / total_inertia
    damping = 2.0 * SHAFT_DAMPING * reduced_stiffness**0.5
    return Shaft(ring_inertia, side_inertia, stiffness, damping, backlash)


def spring_force(
    stretch: Number, rate: Number, law: tuple[float, float], stops: tuple[float, float], deep: float
) -> Number:
    """Compute the force of a spring, or of two stops that push and never pull.

    ``law`` is stiffness and damping, which acts by half at ``deep`` in a stop; equal stops are one
    spring.
    """
    stiffness, damping = law
    low, high = stops
    if low == high:
        return stiffness * stretch + damping * rate
    high_depth = positive(stretch - high)
    low_depth = positive(low - stretch)
    push = positive(high_depth * (stiffness + damping * rate / (high_depth + deep)))
    return push - positive(low_depth * (stiffness - damping * rate / (low_depth + deep)))


@dataclass(frozen=True)
class Mechanism:
    """Shift mechanism, friction and shafts around the sliding ring; none by default.

    An inertia of 0 stands for a side in one piece, a seat at 0 for a detent without one.
    """

    added_mass: float = quantity("added_mass_kg", 0.0, 1e3, 0.0)  #: as felt at the ring, kg
    #: Coulomb's, of the ring on its shaft, N
    friction: float = quantity("friction_N", 0.0, 1e5, 0.0)
    damping: float = quantity("damping_Ns_m", 0.0, 1e6, 0.0)  #: of the ring along the shaft, N s/m
    detent: float = quantity("detent_N", 0.0, 1e5, 0.0)  #: peak force, N
    detent_position: float = quantity("detent_position_mm", -100.0, 100.0, 0.0)  #: of the peak, m
    detent_width: float = quantity("detent_width_mm", 0.01, 100.0, 1e-3)  #: way of the detent, m
    detent_seat: float = quantity("detent_seat_mm", 0.0, 100.0, 0.0)  #: of the pull's peak, m
    spline_friction: float = quantity("spline_friction", 0.0, 1.5, 0.0)  #: coefficient
    spline_radius: float = quantity("spline_radius_mm", 1.0, 1000.0, 0.02)  #: m
    drag_torque: float = quantity("drag_torque_Nm", 0.0, 1e4, 0.0)  #: against turning, N m
    compliance: float = quantity("compliance_mm_kN", 0.0, 1e3, 0.0)  #: of the linkage, m/N
    free_play: float = quantity("free_play_mm", 0.0, 100.0, 0.0)  #: between linkage and ring, m
    #: with its toothing, kg m2
    ring_inertia: float = quantity("ring_inertia_kgm2", 0.0, 100.0, 0.0)
    #: of the shaft between the ring and the rest of its side, N m/rad
    input_stiffness: float = quantity("input_stiffness_Nm_rad", 0.0, 1e8, 0.0)
    backlash: float = quantity("spline_backlash_deg", 0.0, 30.0, 0.0)  #: of the ring's spline, rad
    #: of what stands at the flanks on the output side, kg m2
    wheel_inertia: float = quantity("wheel_inertia_kgm2", 0.0, 1e4, 0.0)
    #: of the shaft between that and the rest, N m/rad
    output_stiffness: float = quantity("output_stiffness_Nm_rad", 0.0, 1e8, 0.0)

    def __post_init__(self) -> None:
        require_ranges(self, "mechanism", "correct the mechanism")
        if 0.0 < self.detent_seat <= self.detent_position:
            rule = (
                "the ring climbs out of the detent before it falls into the next seat, so that it "
                f"must be above mechanism.detent_position_mm = {self.detent_position / MM:.6g}"
            )
            seat = self.detent_seat / MM
            remedy = "exchange or correct them"
            raise InputError(Refusal("mechanism.detent_seat_mm", seat, "mm", rule, remedy))
        sides = ("ring_inertia", "input_stiffness"), ("wheel_inertia", "output_stiffness")
        for inertia, stiffness in sides:
            if getattr(self, inertia) > 0.0 and getattr(self, stiffness) == 0.0:
                inertia_key = quantities_of(Mechanism)[inertia].key
                stiffness_key = quantities_of(Mechanism)[stiffness].key
                raise InputError(
                    f"mechanism.{inertia_key} needs mechanism.{stiffness_key}, the shaft that it "
                    "hangs on; give it "
                    "too, or leave both out for a rigid shaft"
                )

    @property
    def has_linkage(self) -> bool:
        """Whether the actuator moves apart from the ring."""
        return self.compliance > 0.0 or self.free_play > 0.0

    @property
    def has_forces(self) -> bool:
        """Whether there is more than a mass and a damper."""
        forces = (self.friction, self.detent, self.spline_friction, self.drag_torque)
        ring_inertias = (self.ring_inertia, self.wheel_inertia)
        return self.has_linkage or any(value > 0.0 for value in (*forces, *ring_inertias))

    def sleeve_mass(self, mass: float) -> float:
        """Compute the mass that moves with a ring of ``mass`` in kg, kg."""
        return (1.0 - FORK_MASS_SHARE) * mass if self.has_linkage else mass + self.added_mass

    def actuator_mass(self, mass: float) -> float:
        """Compute the mass on the actuator's side of the linkage, kg; 0 without a linkage."""
        return FORK_MASS_SHARE * mass + self.added_mass if self.has_linkage else 0.0

    def linkage(self, mass: float) -> tuple[float, float]:
        """Compute stiffness, N/m, and damping, N s/m, of the linkage to a ring of ``mass``, kg."""
        stiffness = 1.0 / (self.compliance or STOP_COMPLIANCE_M_N)
        sleeve = self.sleeve_mass(mass)
        actuator = self.actuator_mass(mass)
        critical = (stiffness * sleeve * actuator / (sleeve + actuator)) ** 0.5
        return stiffness, 2.0 * DAMPING_RATIO * critical

    def pull(self, stretch: Number, rate: Number, stiffness: float, damping: float) -> Number:
        """Compute the force of the linkage on the ring, N; ``stretch`` in m and its ``rate``.

        Numbers or (n,), as are all forces below.
        """
        return spring_force(
            stretch, rate, (stiffness, damping), (0.0, self.free_play), STOP_DEPTH_M
        )

    def resistance(self, way: Number, speed: Number, torque: Number) -> Number:
        """Compute friction, detent and spline friction against the ring's motion, N.

        ``way`` and ``speed`` of the ring in m and m/s; ``torque`` through the spline, N m.
        """
        detent = self._climb(way - self.detent_position)
        if self.detent_seat > 0.0:
            detent = detent - self._climb(way - self.detent_seat)
        spline = self.spline_friction / self.spline_radius * abs(torque)
        return detent + (self.friction + spline) * smooth_sign(speed, SMOOTH_SPEED_M_S)

    def _climb(self, way: Number) -> Number:
        """Compute the force of the climb onto the detent, N; ``way`` in m from its peak."""
        bump = positive(1.0 - (2.0 * way / self.detent_width) ** 2)
        return self.detent * bump * bump

    def drag(self, speed: Number) -> Number:
        """Compute the drag torque on a ring that turns at ``speed`` in rad/s, N m."""
        return self.drag_torque * smooth_sign(speed, SMOOTH_TURN_RAD_S)

    def spline_share(self, mass: float, radius: float, inertia: float) -> float:
        """Compute the share of the contact's torque that goes through the spline.

        Of a ring of ``mass`` in kg at the mean ``radius`` in m, with the ``inertia`` of its side.
        """
        return 1.0 - min(1.0, mass * radius**2 / inertia)

    @property
    def record(self) -> dict[str, float]:
        """Values that differ from no mechanism, flat and in the edge's units."""
        absent = record_quantities(NO_MECHANISM)
        return {
            f"mechanism_{key}": value
            for key, value in record_quantities(self).items()
            if value != absent[key]
        }


def positive(value: Number) -> Number:
    """Clip a value below at 0."""
    return 0.5 * (value + abs(value))


def smooth_sign(value: Number, small: float) -> Number:
    """Compute the sign of a value, smooth below ``small``."""
    return value / (value * value + small * small) ** 0.5


NO_MECHANISM = Mechanism()  #: the shift force acts on the ring, which nothing else holds
#: Field by key at the edge.
FIELDS = {declared.key: name for name, declared in quantities_of(Mechanism).items()}
