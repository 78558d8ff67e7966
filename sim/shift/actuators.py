r"""Actuators by the numbers of a data sheet, each a small law of ``sim.kernel.actuator``.

A kind states the largest static force that it gives to the fork at full command, net of its return
spring. An operating point asks for a static force up to that one, and its command gives it: the
preload of a spring, the limit of a cam's drive or a motor's torque, the supply pressure of a
cylinder, the voltage of a solenoid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, Refusal, join_faults
from dogshape.sim.kernel_layout import (
    AMBIENT_PA,
    CAM,
    HYDRAULIC,
    MOTOR,
    PNEUMATIC,
    REFERENCE_PA,
    SOLENOID,
    SPRING,
)
from dogshape.sim.quantity import (
    Quantity,
    quantities_of,
    quantity,
    record_quantities,
    require_ranges,
)
from dogshape.sim.shift.actuation import SMALLEST_FORCE, ForceProfile, RiseTable
from dogshape.sim.shift.mechanism import DAMPING_RATIO
from dogshape.sim.units import from_si, short, to_si, unit_of

PROFILE = "profile"  #: kind of a shift force over time, which is no actuator
SECTION = "actuation"  #: table of a study
COMMAND_RISE_S = 1e-4  #: rise of the command, which is switched
MAX_COMMAND_N = 1e5  #: largest force of a command
#: Rise of the command of any force.
COMMAND_RISES = RiseTable((SMALLEST_FORCE, MAX_COMMAND_N), (COMMAND_RISE_S, COMMAND_RISE_S))
FORCE_TOLERANCE = 1e-9  #: share by which a force may exceed the full one, for rounding
STROKE_TOLERANCE_M = 1e-9  #: by which a stroke may miss the travel, for rounding
OFF_FORCE_N = 1e-3  #: of a lagged spring without a command, of which its level is a share


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """An actuator of one kind."""

    kind: ClassVar[str]
    code: ClassVar[int]  #: of ``sim.kernel_layout``
    #: what delays the force by itself, in words; empty for a kind that a lag of first order may
    own_course: ClassVar[str] = ""
    command: ClassVar[str]  #: quantity that gives the force of a point, in words
    remedy: ClassVar[str] = "raise its force"  #: for a static force that is too small
    reach_remedy: ClassVar[str] = "raise actuation.stroke_mm"  #: for a travel that is too short
    #: columns of a bench's table that set the command, beside the force
    set_keys: ClassVar[tuple[str, ...]] = ()
    #: channel of a bench's trace that gives the force, beside the force; empty without one
    logged_key: ClassVar[str] = ""

    def __post_init__(self) -> None:
        require_ranges(self, SECTION, "correct the actuator")
        if self.full_force < SMALLEST_FORCE:
            rule = f"it must leave {SMALLEST_FORCE:g} N or more at full {self.command}"
            name = f"static force of the {self.kind} actuator"
            raise InputError(Refusal(name, self.full_force, "N", rule, self.remedy))

    @property
    def full_force(self) -> float:
        """Largest static force at full command, N."""
        raise NotImplementedError

    def reach(self, force: float) -> float:
        """Compute the travel at which the force of a command of ``force`` in N is used up, m."""
        raise NotImplementedError

    def release_force(self, travel: float) -> float | None:
        """Return the force that draws the fork back from a travel in m, N; None if not stated."""
        return None

    def initial_level(self, force: float) -> float:
        """Compute the level of the own state before a command of ``force`` in N."""
        return 0.0

    def _static_force(self, key: str, value: float) -> float:
        """Compute the static force of a set value of ``set_keys``, SI, N."""
        raise NotImplementedError

    def set_force(self, key: str, value: float) -> float:
        """Compute the static force of a set value in the unit of its key, N.

        Raises InputError for a value that leaves no force, or beyond that of full command.
        """
        force = self._static_force(key, to_si(key, value))
        if force < SMALLEST_FORCE:
            rule = f"it leaves {force:.6g} N at the fork of the {self.kind} actuator"
            remedy = f"correct it, or the numbers of [{SECTION}]"
            raise InputError(Refusal(key, value, unit_of(key), rule, remedy))
        if force > self.full_force * (1.0 + FORCE_TOLERANCE):
            rule = (
                f"its {force:.6g} N exceed the {self.full_force:.6g} N of the {self.kind} "
                f"actuator at its full {self.command}"
            )
            remedy = f"correct it, or raise the {self.command} in [{SECTION}]"
            raise InputError(Refusal(key, value, unit_of(key), rule, remedy))
        return force

    def logged_level(self, force: float) -> float:
        """Compute the final value of the logged channel at a static force in N, SI."""
        raise NotImplementedError

    def channel(self, levels: Array, force: float) -> Array:
        """Compute the logged channel from levels of the own state at a command of ``force``, SI."""
        raise NotImplementedError

    def logged_force(self, values: Array, travel: Array) -> Array:
        """Compute the force at the fork from its logged channel, SI, N, (n,).

        ``travel`` of the fork is in m. A spring that holds the fork gives no force.
        """
        raise NotImplementedError

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        """Write the numbers of the kind at a command of ``force`` in N."""
        raise NotImplementedError

    def write(self, numbers: np.record, profile: ForceProfile, driven_mass: float) -> None:
        """Write a record of ``ACTUATOR_NUMBERS`` for a command.

        ``profile`` has force, loss and lag; ``driven_mass`` is that of the fork, kg.
        """
        numbers.kind = self.code
        numbers.command = profile.force
        numbers.force_share = profile.net_force / profile.force
        numbers.lag = profile.lag
        self._write(numbers, profile.force, driven_mass)

    def switch_off(self, numbers: Any) -> None:
        """Write the numbers without a command into those of the last one."""
        numbers.command = 0.0

    def level_unit(self, numbers: Any) -> float:
        """Return the pressure, Pa, or lagged force, N, of a level of 1; 1 for other levels."""
        return 1.0

    def require_force(self, force: float, key: str = "shift force", remedy: str = "") -> None:
        """Raise InputError for a static force in N beyond the full one."""
        if force <= self.full_force * (1.0 + FORCE_TOLERANCE):
            return
        rule = f"the {self.kind} actuator gives {self.full_force:.6g} N at its full {self.command}"
        remedy = remedy or (
            f"lower it, raise the actuator's {self.command}, or leave operating.force_N out to use "
            "all of it"
        )
        raise InputError(Refusal(key, force, "N", rule, remedy))

    def require_reach(self, force: float, travel: float, of: str = "") -> None:
        """Raise InputError where a command of ``force`` in N ends before the ``travel`` in m.

        ``of`` is the key of a search whose end has that travel.
        """
        reach = self.reach(force)
        if reach >= travel - STROKE_TOLERANCE_M:
            return
        rule = f"the ring travels {1e3 * travel:.6g} mm into engagement"
        remedy = self.reach_remedy
        if of:
            rule += f" at the end of {of}"
            remedy = f"narrow {of}, or {remedy}"
        name = f"travel over which the {self.kind} actuator pushes with {force:.6g} N"
        raise InputError(Refusal(name, 1e3 * reach, "mm", rule, remedy))

    def require_course(self, lag: float, rise_factor: float) -> None:
        """Raise InputError for a lag, s, or a factor on a rise that the kind has no use for."""
        if rise_factor != 1.0:
            rule = f"the {self.kind} actuator has no rise time that it could scale"
            remedy = f'leave it out, or take {SECTION}.kind = "{PROFILE}"'
            raise InputError(Refusal("mechanism.rise_factor", rise_factor, "", rule, remedy))
        if lag and self.own_course:
            rule = f"the {self.kind} actuator has a course of its own, {self.own_course}"
            remedy = f'leave it out, or take {SECTION}.kind = "{PROFILE}"'
            raise InputError(Refusal("mechanism.lag_s", lag, "s", rule, remedy))

    @property
    def record(self) -> dict[str, Any]:
        """Kind and numbers, flat and in the edge's units."""
        numbers = {f"{self.kind}_{key}": v for key, v in record_quantities(self).items()}
        return {"actuator": self.kind, **numbers}

    @property
    def text(self) -> str:
        """Kind, full force and numbers in words."""
        numbers = []
        for name, declared in declared_quantities(self.kind).items():
            value = getattr(self, name)
            if value:
                amount = f"{short(from_si(declared.key, value))} {unit_of(declared.key)}"
                numbers.append(f"{name.replace('_', ' ')} {amount}".rstrip())
        return f"{self.kind}, at most {short(self.full_force)} N: {', '.join(numbers)}"


def _coupling_damping(stiffness: float, mass: float) -> float:
    """Compute the damping of a coupling to a mass in kg, as that of a linkage, N s/m."""
    return 2.0 * DAMPING_RATIO * math.sqrt(stiffness * mass)


@dataclass(frozen=True, kw_only=True)
class Spring(Actuator):
    """A preloaded fork that pushes as soon as the dogs let it."""

    kind: ClassVar[str] = "spring"
    code: ClassVar[int] = SPRING
    command: ClassVar[str] = "preload"
    reach_remedy: ClassVar[str] = "raise the force, or lower actuation.rate_N_mm"

    preload: float = quantity("preload_N", 1.0, 1e5)  #: at the start, N
    rate: float = quantity("rate_N_mm", 0.0, 1e5)  #: N/m

    @property
    def full_force(self) -> float:
        """Preload, N."""
        return self.preload

    def reach(self, force: float) -> float:
        """Compute the travel after which the spring is relaxed, m."""
        return force / self.rate if self.rate else math.inf

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        numbers.rate = self.rate

    def switch_off(self, numbers: Any) -> None:
        """Relax the spring; a lagged force decays through its lag."""
        numbers.command = OFF_FORCE_N if numbers.lag > 0.0 else 0.0

    def level_unit(self, numbers: Any) -> float:
        """Return the force of a level of 1 behind a lag, N."""
        return float(numbers.command) if numbers.lag > 0.0 else 1.0


@dataclass(frozen=True, kw_only=True)
class Cam(Actuator):
    """A drum whose groove, without corners, prescribes the travel, with a compliant fork."""

    kind: ClassVar[str] = "cam"
    code: ClassVar[int] = CAM
    own_course: ClassVar[str] = "the travel of its groove"
    command: ClassVar[str] = "force limit"

    stroke: float = quantity("stroke_mm", 0.1, 100.0)  #: of the groove, m
    ramp: float = quantity("ramp_deg", 1.0, 720.0)  #: angle over which the groove rises, rad
    drum_speed: float = quantity("drum_speed_rpm", 0.1, 1e4)  #: rad/s
    stiffness: float = quantity("stiffness_N_mm", 1.0, 1e6)  #: between drum and fork, N/m
    force_limit: float = quantity("force_limit_N", 1.0, 1e5)  #: of the drum's drive, N
    dwell: float = quantity("dwell_deg", 0.0, 720.0, 0.0)  #: angle before the rise, rad

    @property
    def full_force(self) -> float:
        """Force limit, or that of the coupling over the whole stroke, N."""
        return min(self.force_limit, self.stiffness * self.stroke)

    def reach(self, force: float) -> float:
        """Return the stroke, m."""
        return self.stroke

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        numbers.stroke = self.stroke
        numbers.dwell_time = self.dwell / self.drum_speed
        numbers.ramp_time = self.ramp / self.drum_speed
        numbers.stiffness = self.stiffness
        numbers.damping = _coupling_damping(self.stiffness, driven_mass)


@dataclass(frozen=True, kw_only=True)
class Motor(Actuator):
    """A motor with a linear line of torque over speed, a gear, and a spindle or rack."""

    kind: ClassVar[str] = "motor"
    code: ClassVar[int] = MOTOR
    command: ClassVar[str] = "torque limit"
    own_course: ClassVar[str] = "the run-up of its inertia"
    remedy: ClassVar[str] = "raise actuation.torque_limit_Nm or gear_ratio, or lower lead_mm"

    stall_torque: float = quantity("stall_torque_Nm", 1e-4, 1e3)  #: of the motor, N m
    no_load_speed: float = quantity("no_load_speed_rpm", 10.0, 1e5)  #: of the motor, rad/s
    torque_limit: float = quantity("torque_limit_Nm", 1e-4, 1e3)  #: of its control, N m
    inertia: float = quantity("rotor_inertia_kgm2", 1e-9, 1.0)  #: of rotor and gear, kg m2
    gear_ratio: float = quantity("gear_ratio", 0.1, 1e3)  #: motor over spindle or pinion
    lead: float = quantity("lead_mm", 0.1, 1e3)  #: fork travel per revolution behind the gear, m
    stiffness: float = quantity("stiffness_N_mm", 1.0, 1e6)  #: between spindle and fork, N/m
    efficiency: float = quantity("efficiency", 0.01, 1.0, 1.0)  #: of gear and spindle

    @property
    def ratio(self) -> float:
        """Turn of the motor per travel of the fork, rad/m."""
        return 2.0 * math.pi * self.gear_ratio / self.lead

    @property
    def stall_force(self) -> float:
        """Force at the fork at stall torque, N."""
        return self.stall_torque * self.ratio * self.efficiency

    @property
    def full_force(self) -> float:
        """Force at the fork at the torque limit, or at stall where that is less, N."""
        return min(self.torque_limit, self.stall_torque) * self.ratio * self.efficiency

    def reach(self, force: float) -> float:
        """Return infinity: a spindle pushes over any travel."""
        return math.inf

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        drive_mass = self.inertia * self.ratio**2 * self.efficiency
        numbers.drive_mass = drive_mass
        numbers.stall_force = self.stall_force
        numbers.no_load_speed = self.no_load_speed / self.ratio
        numbers.stiffness = self.stiffness
        reduced_mass = drive_mass * driven_mass / (drive_mass + driven_mass)
        numbers.damping = _coupling_damping(self.stiffness, reduced_mass)


class _ReturnSpring:
    """Return spring of an actuator with its ``return_preload`` and ``return_rate``."""

    return_preload: float
    return_rate: float

    def spring_force(self, travel: Any) -> Any:
        """Compute the force of the spring at a travel from the start, m, or at many; N."""
        return self.return_preload + self.return_rate * travel

    def release_force(self, travel: float) -> float | None:
        """Compute the force of the return spring at a travel in m, N; None without a spring."""
        force: float = self.spring_force(travel)
        return force if force > 0.0 else None


@dataclass(frozen=True, kw_only=True)
class Cylinder(_ReturnSpring, Actuator):
    """A piston with a back side and a return spring; pressures are above the ambient one."""

    command: ClassVar[str] = "supply pressure"
    own_course: ClassVar[str] = "the filling of its cylinder"
    remedy: ClassVar[str] = "raise actuation.supply_bar or area_cm2"
    reach_remedy: ClassVar[str] = "raise the force, or lower actuation.return_rate_N_mm"
    set_keys: ClassVar[tuple[str, ...]] = ("supply_bar",)
    logged_key: ClassVar[str] = "pressure_bar"

    supply: float = quantity("supply_bar", 0.1, 1e3)  #: pressure, Pa
    area: float = quantity("area_cm2", 0.01, 1e3)  #: of the piston, m2
    dead_volume: float = quantity("dead_volume_cm3", 0.1, 1e5)  #: at the start, with pipes, m3
    back_pressure: float = quantity("back_pressure_bar", 0.0, 1e3, 0.0)  #: on the back side, Pa
    back_area: float = quantity("back_area_cm2", 0.0, 1e3, 0.0)  #: of the back side, m2
    return_preload: float = quantity("return_preload_N", 0.0, 1e5, 0.0)  #: of the spring, N
    return_rate: float = quantity("return_rate_N_mm", 0.0, 1e5, 0.0)  #: of the spring, N/m

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.back_pressure == 0.0) != (self.back_area == 0.0):
            raise InputError(
                "actuation.back_pressure_bar and actuation.back_area_cm2 go together; give both, "
                "or none for a back side at ambient pressure"
            )

    @property
    def back_force(self) -> float:
        """Force of the back side, N."""
        return self.back_pressure * self.back_area

    @property
    def full_force(self) -> float:
        """Force at the supply pressure and the start of the travel, N."""
        return self._static_force("supply_bar", self.supply)

    def _static_force(self, key: str, value: float) -> float:
        return value * self.area - self.back_force - self.return_preload

    def logged_level(self, force: float) -> float:
        """Compute the supply pressure of a static force in N, Pa."""
        return self.supply_at(force)

    def channel(self, levels: Array, force: float) -> Array:
        """Compute the pressure above the ambient one, Pa, (n,)."""
        return levels * self.supply_at(force)

    def logged_force(self, values: Array, travel: Array) -> Array:
        """Compute piston area times pressure less back side and return spring, N, (n,)."""
        spring = self.spring_force(np.maximum(travel, 0.0))
        return np.maximum(values * self.area - self.back_force - spring, 0.0)

    def reach(self, force: float) -> float:
        """Compute the travel at which the return spring takes all of the force, m."""
        return force / self.return_rate if self.return_rate else math.inf

    def release_force(self, travel: float) -> float | None:
        """Compute the return spring's force at a travel in m, N; None beside a back pressure."""
        return None if self.back_pressure else super().release_force(travel)

    def supply_at(self, force: float) -> float:
        """Compute the supply pressure of a static force in N, Pa."""
        return (force + self.back_force + self.return_preload) / self.area

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        numbers.area = self.area
        numbers.back_force = self.back_force
        numbers.dead_volume = self.dead_volume
        numbers.preload = self.return_preload
        numbers.rate = self.return_rate

    def level_unit(self, numbers: Any) -> float:
        """Return the supply pressure, Pa."""
        return float(numbers.supply)


@dataclass(frozen=True, kw_only=True)
class Pneumatic(Cylinder):
    """A cylinder that fills with air through a valve, isothermal."""

    kind: ClassVar[str] = "pneumatic"
    code: ClassVar[int] = PNEUMATIC

    #: of valve and pipe (ISO 6358-1), m3/(s Pa); some 0.2 dm3/(s bar) per mm2 of opening
    conductance: float = quantity("conductance_dm3_s_bar", 1e-4, 1e3)
    #: of pressures, below which the flow is choked (ISO 6358-1)
    critical_ratio: float = quantity("critical_ratio", 0.0, 0.9, 0.3)

    def channel(self, levels: Array, force: float) -> Array:
        """Compute the pressure above the ambient one, Pa, (n,)."""
        return levels * (AMBIENT_PA + self.supply_at(force)) - AMBIENT_PA

    def initial_level(self, force: float) -> float:
        """Compute ambient over supply pressure, both absolute."""
        return AMBIENT_PA / (AMBIENT_PA + self.supply_at(force))

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        super()._write(numbers, force, driven_mass)
        numbers.supply = AMBIENT_PA + self.supply_at(force)
        numbers.valve_flow = self.conductance * REFERENCE_PA
        numbers.critical_ratio = self.critical_ratio

    def switch_off(self, numbers: Any) -> None:
        """Vent the cylinder through the valve."""
        numbers.supply = AMBIENT_PA


@dataclass(frozen=True, kw_only=True)
class Hydraulic(Cylinder):
    """A cylinder that fills with oil through the orifice of a valve."""

    kind: ClassVar[str] = "hydraulic"
    code: ClassVar[int] = HYDRAULIC

    flow: float = quantity("flow_l_min", 1e-3, 1e3)  #: of the valve at its rated drop, m3/s
    drop: float = quantity("drop_bar", 0.1, 1e3)  #: rated drop of pressure over the valve, Pa
    #: of oil with its air and the walls, Pa
    bulk_modulus: float = quantity("bulk_modulus_MPa", 10.0, 3000.0, 1.4e9)

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        super()._write(numbers, force, driven_mass)
        supply = self.supply_at(force)
        numbers.supply = supply
        numbers.valve_flow = self._valve_flow(supply)
        numbers.bulk_modulus = self.bulk_modulus

    def _valve_flow(self, drop: float) -> float:
        """Compute the flow of the valve at a drop of pressure in Pa, m3/s."""
        return self.flow * math.sqrt(drop / self.drop)

    def switch_off(self, numbers: Any) -> None:
        """Empty the cylinder through the valve, down to the pressure of ``SMALLEST_FORCE``.

        A level is a share of that pressure, which may not be 0; its force is taken off.
        """
        supply = SMALLEST_FORCE / self.area
        numbers.supply = supply
        numbers.valve_flow = self._valve_flow(supply)
        numbers.back_force = self.back_force + SMALLEST_FORCE


@dataclass(frozen=True, kw_only=True)
class Solenoid(_ReturnSpring, Actuator):
    """A magnet whose force at rated current is known at both ends of its stroke.

    Both forces make the residual gap of the law; the iron is as saturated as at that current.
    """

    kind: ClassVar[str] = "solenoid"
    code: ClassVar[int] = SOLENOID
    command: ClassVar[str] = "voltage"
    own_course: ClassVar[str] = "the rise of its current"
    remedy: ClassVar[str] = "raise actuation.end_force_N or voltage_V"
    reach_remedy: ClassVar[str] = (
        "raise the force or actuation.stroke_mm, or lower actuation.return_preload_N"
    )
    set_keys: ClassVar[tuple[str, ...]] = ("voltage_V", "current_A")
    logged_key: ClassVar[str] = "current_A"

    start_force: float = quantity("start_force_N", 0.1, 1e5)  #: of the open armature, N
    end_force: float = quantity("end_force_N", 0.1, 1e5)  #: at the end of the stroke, N
    stroke: float = quantity("stroke_mm", 0.1, 100.0)  #: m
    voltage: float = quantity("voltage_V", 0.1, 1e3)  #: switched on by the command, V
    resistance: float = quantity("resistance_ohm", 1e-3, 1e4)  #: of the warm coil, ohm
    inductance: float = quantity("inductance_mH", 1e-3, 1e5)  #: of the open armature, H
    return_preload: float = quantity("return_preload_N", 0.0, 1e5, 0.0)  #: of the spring, N
    return_rate: float = quantity("return_rate_N_mm", 0.0, 1e5, 0.0)  #: of the spring, N/m
    #: of both forces, A; 0: voltage over resistance
    rated_current: float = quantity("rated_current_A", 0.0, 1e4, 0.0)

    def __post_init__(self) -> None:
        require_ranges(self, SECTION, "correct the actuator")
        if self.end_force <= self.start_force:
            rule = f"it must exceed actuation.start_force_N = {self.start_force:.6g}"
            remedy = "exchange or correct them"
            raise InputError(Refusal("actuation.end_force_N", self.end_force, "N", rule, remedy))
        super().__post_init__()

    @property
    def residual_gap(self) -> float:
        """Gap of the law at the end of the stroke, m."""
        return self.stroke / (math.sqrt(self.end_force / self.start_force) - 1.0)

    @property
    def force_current(self) -> float:
        """Current of both forces, A."""
        return self.rated_current or self.voltage / self.resistance

    @property
    def end_spring(self) -> float:
        """Force of the return spring at the end of the stroke, N."""
        return float(self.spring_force(self.stroke))

    @property
    def full_force(self) -> float:
        """Force at the end of the stroke, N."""
        return self._static_force("voltage_V", self.voltage)

    def _static_force(self, key: str, value: float) -> float:
        current = value / self.resistance if key == "voltage_V" else value
        return self.end_force * (current / self.force_current) ** 2 - self.end_spring

    def logged_level(self, force: float) -> float:
        """Compute the final current of a static force in N, A."""
        return self.share_at(force) * self.force_current

    def channel(self, levels: Array, force: float) -> Array:
        """Compute the current, A, (n,)."""
        return levels * self.force_current

    def logged_force(self, values: Array, travel: Array) -> Array:
        """Compute the magnet's force over stroke and current less the return spring, N, (n,)."""
        open_gap = self.residual_gap + self.stroke
        gap = open_gap - np.clip(travel, 0.0, self.stroke)
        share = open_gap / gap * values / self.force_current
        spring = self.spring_force(np.maximum(travel, 0.0))
        return np.maximum(self.start_force * share**2 - spring, 0.0)

    def share_at(self, force: float) -> float:
        """Compute the final current over the rated one for a static force in N."""
        return math.sqrt((force + self.end_spring) / self.end_force)

    def reach(self, force: float) -> float:
        """Return the stroke, or 0 where the return spring holds the open armature, m."""
        start_force = self.start_force * self.share_at(force) ** 2
        return self.stroke if start_force > self.return_preload else 0.0

    def _write(self, numbers: Any, force: float, driven_mass: float) -> None:
        numbers.stroke = self.stroke
        numbers.preload = self.return_preload
        numbers.rate = self.return_rate
        numbers.voltage_share = self.share_at(force)
        numbers.time_constant = self.inductance / self.resistance
        numbers.start_force = self.start_force
        numbers.residual_gap = self.residual_gap

    def switch_off(self, numbers: Any) -> None:
        """Short the coil, whose current decays."""
        numbers.voltage_share = 0.0


#: Kinds by their names in a study.
KINDS: dict[str, type[Actuator]] = {
    actuator.kind: actuator for actuator in (Spring, Cam, Motor, Pneumatic, Hydraulic, Solenoid)
}
#: Set values of any kind, by their keys.
SET_KEYS = tuple(dict.fromkeys(key for kind in KINDS.values() for key in kind.set_keys))
#: Logged channels of any kind.
LOGGED_KEYS = tuple(dict.fromkeys(kind.logged_key for kind in KINDS.values() if kind.logged_key))


def kinds_with(key: str) -> str:
    """Name the kinds that have a set value or a logged channel, in words."""
    names = [n for n, kind in KINDS.items() if key in (*kind.set_keys, kind.logged_key)]
    return " or ".join(f'"{name}"' for name in names)


#: Numbers of each kind for a study that lacks them, assumptions of the size of a vehicle's clutch.
#: Cam: 60 degrees a gear in 40 ms. Cylinders: 8 bar of a truck behind a valve of 8 mm2, 20 bar of a
#: double clutch. Solenoid: 12 V and 5.7 A.
EXAMPLES: dict[str, Actuator] = {
    example.kind: example
    for example in (
        Spring(preload=300.0, rate=2e4),
        Cam(
            stroke=8e-3,
            ramp=math.radians(60.0),
            drum_speed=250.0 * math.pi / 30.0,
            stiffness=5e5,
            force_limit=500.0,
        ),
        Motor(
            stall_torque=0.8,
            no_load_speed=6000.0 * math.pi / 30.0,
            torque_limit=0.5,
            inertia=1e-5,
            gear_ratio=1.0,
            lead=5e-3,
            stiffness=5e6,
            efficiency=0.8,
        ),
        Pneumatic(
            supply=8e5,
            area=12.5e-4,
            dead_volume=0.3e-3,
            return_preload=50.0,
            conductance=1.6e-8,
        ),
        Hydraulic(
            supply=20e5,
            area=2.5e-4,
            dead_volume=20e-6,
            return_preload=50.0,
            flow=6.0 / 60e3,
            drop=5e5,
        ),
        Solenoid(
            start_force=150.0,
            end_force=450.0,
            stroke=6e-3,
            voltage=12.0,
            resistance=2.1,
            inductance=9e-3,
            return_preload=25.0,
        ),
    )
}


def actuator_of(kind: str, numbers: dict[str, float]) -> Actuator | None:
    """Build the actuator of a kind from its numbers by key, SI; None for a force over time.

    Raises InputError for a number that the kind lacks or that belongs to others.
    """
    if kind == PROFILE:
        declared: dict[str, Any] = {}
    else:
        declared = {q.key: name for name, q in declared_quantities(kind).items()}
    for key in numbers:
        if key not in declared:
            owners = [name for name in KINDS if key in keys_of(name)]
            words = " or ".join(f'"{name}"' for name in owners)
            raise InputError(
                f"{SECTION}.{key} belongs to {SECTION}.kind = {words}, but the kind is "
                f'"{kind}"; leave it out or change the kind'
            )
    if kind == PROFILE:
        return None
    missing = [key for key in required_keys(kind) if key not in numbers]
    if missing:
        faults = [f"'{SECTION}.{key}' is missing; add it" for key in missing]
        raise InputError(join_faults(f'{SECTION}.kind = "{kind}"', faults))
    return KINDS[kind](**{declared[key]: value for key, value in numbers.items()})


def declared_quantities(kind: str) -> dict[str, Quantity]:
    """Return the declared quantities of a kind by the names of its fields."""
    actuator: Any = KINDS[kind]
    return quantities_of(actuator)


def keys_of(kind: str) -> list[str]:
    """List the keys of a kind."""
    return [declared.key for declared in declared_quantities(kind).values()]


def optional_values(kind: str) -> dict[str, float]:
    """Return the defaults of the optional keys of a kind, edge units."""
    return {
        declared.key: from_si(declared.key, getattr(KINDS[kind], name))
        for name, declared in declared_quantities(kind).items()
        if hasattr(KINDS[kind], name)
    }


def required_keys(kind: str) -> list[str]:
    """List the keys of a kind that have no default."""
    return [key for key in keys_of(kind) if key not in optional_values(kind)]
