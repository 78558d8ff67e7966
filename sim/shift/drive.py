r"""Drive of both shafts: their speed before the shift and torques on them during it.

The ring on the engine's side is the faster one at a positive mismatch (``docs/scope.md``), which
fixes the sense in which both shafts turn about the axis from the output to the sliding ring: with
the engine at the sliding ring they turn against it, :math:`s = -1`, with the engine at the output
ring along it, :math:`s = +1`. The ring on the wheels' side turns at :math:`s n`, the other one
follows from the mismatch. Without a speed the sliding ring stands, and the output ring turns at the
mismatch, as on a stand. Torques on the sliding and on the output side, about the axis,

.. math::
    M_1 &= s T_1(t) + M_s \sigma(\Delta\omega) + [P + s U], \\
    M_2 &= s T_2(t) - M_s \sigma(\Delta\omega) + [P + s U], \qquad
    P = M_p \sigma(s n_p - \omega) + d_p (s n_p - \omega),

with :math:`\Delta\omega` the output less the sliding speed, :math:`T` tables over time, :math:`M_s`
of a synchroniser, *P* of a wet pack whose other side turns at :math:`n_p`, and *U* of a speed
control; what stands in brackets acts on the engine's side alone. At :math:`t_k = k T_c` the control
measures :math:`e_k = \Delta\omega_{set} - \Delta\omega` and gives, held for a cycle from
:math:`t_k + t_d` on,

.. math:: I_k = [I_{k-1} + k_i T_c e_k]_{\pm L}, \qquad U_k = [k_p e_k + I_k]_{\pm L}.

Time counts from the start of the shift force.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, Refusal, require_between, require_known
from dogshape.sim.quantity import quantity, record_quantities, require_ranges
from dogshape.sim.shift.mechanism import SMOOTH_TURN_RAD_S, smooth_sign
from dogshape.sim.units import RPM

EngineSide = Literal["sliding", "output"]
ENGINE_SIDES: tuple[EngineSide, ...] = get_args(EngineSide)
MAX_TORQUE_NM = 1e5
SAME_TIME_S = 1e-9  #: within which a measurement, a torque and a knot are at one time
STEADY = 0.01  #: share of the limit that a control's torque may still change by as settled


@dataclass(frozen=True)
class SpeedControl:
    """Proportional-integral control of the mismatch by a torque on the engine's side."""

    #: of output less sliding speed, rad/s
    set_point: float = quantity("set_point_rpm", -5e3, 5e3, 0.0)
    proportional: float = quantity("proportional_Nms_rad", 0.0, 1e5, 0.0)  #: N m s/rad
    integral: float = quantity("integral_Nm_rad", 0.0, 1e7, 0.0)  #: N m/rad
    limit: float = quantity("limit_Nm", 1e-6, MAX_TORQUE_NM, 100.0)  #: of the torque, N m
    dead_time: float = quantity("dead_time_s", 0.0, 1.0, 0.0)  #: from measurement to torque, s
    cycle: float = quantity("cycle_s", 1e-4, 1.0, 0.01)  #: from one measurement to the next, s

    def __post_init__(self) -> None:
        require_ranges(self, "drive.control", "correct the control")
        if self.proportional == 0.0 and self.integral == 0.0:
            raise InputError(
                "drive.control.proportional_Nms_rad and drive.control.integral_Nm_rad are both 0, "
                "but a control needs a gain; give one of them, or leave [drive.control] out"
            )


@dataclass(frozen=True)
class Drive:
    """Speed of both shafts and torques on them; the default is shafts that nothing drives.

    Torques count positive in the sense in which the engine turns. A tuple of several torques is
    linear between the ``times`` and constant beyond them.
    """

    #: of the ring on the wheels' side, rad/s; 0 where the sliding ring stands before the shift
    shaft_speed: float = quantity("shaft_speed_rpm", 0.0, 2e4, 0.0)
    engine_side: EngineSide = "sliding"  #: ring that turns with the engine
    sliding_torque: tuple[float, ...] = (0.0,)  #: on the sliding side, N m
    output_torque: tuple[float, ...] = (0.0,)  #: on the output side, N m
    times: tuple[float, ...] = ()  #: of the torques, s from the start of the force
    #: Coulomb torque of a wet pack between the engine's side and its partner, N m
    pack_torque: float = quantity("pack_torque_Nm", 0.0, MAX_TORQUE_NM, 0.0)
    pack_viscous: float = quantity("pack_viscous_Nms_rad", 0.0, 1e5, 0.0)  #: its oil's, N m s/rad
    #: of the partner, in the engine's sense, rad/s
    pack_speed: float = quantity("pack_speed_rpm", -2e4, 2e4, 0.0)
    #: friction torque between both sides that drives the mismatch to zero, N m
    synchroniser: float = quantity("synchroniser_torque_Nm", 0.0, MAX_TORQUE_NM, 0.0)
    control: SpeedControl | None = None

    def __post_init__(self) -> None:
        require_known("drive.engine_side", self.engine_side, "a side", ENGINE_SIDES)
        require_ranges(self, "drive", "correct the drive")
        for name in ("sliding_torque", "output_torque"):
            self._require_table(f"drive.{name}_Nm", getattr(self, name))
        for time in self.times:
            require_between("drive.torque_time_s", time, 0.0, 60.0, "give it in seconds")
        if any(later <= time for time, later in zip(self.times, self.times[1:], strict=False)):
            raise InputError(
                f"drive.torque_time_s is {list(self.times)}, but each time must be later than the "
                "one before; sort them and give each once"
            )
        if self.pack_speed != 0.0 and not self.has_pack:
            rule = "it belongs to a pack, and there is no drive.pack_torque_Nm or "
            rule += "drive.pack_viscous_Nms_rad"
            remedy = "give one of them, or leave the speed out"
            speed = self.pack_speed / RPM
            raise InputError(Refusal("drive.pack_speed_rpm", speed, "1/min", rule, remedy))

    def _require_table(self, key: str, torques: tuple[float, ...]) -> None:
        for torque in torques:
            remedy = "check the value and its unit"
            require_between(key, torque, -MAX_TORQUE_NM, MAX_TORQUE_NM, remedy)
        if len(torques) not in (1, len(self.times)):
            raise InputError(
                f"{key} has {len(torques)} and drive.torque_time_s {len(self.times)} values, but "
                "each torque of a table needs its time; give lists of equal length, or one torque"
            )

    @property
    def turns(self) -> bool:
        """Whether both shafts turn before the shift."""
        return self.shaft_speed > 0.0

    @property
    def sense(self) -> float:
        """Sense of the engine about the axis from the output to the sliding ring, -1 or 1."""
        return -1.0 if self.engine_side == "sliding" else 1.0

    def loaded(self, side: EngineSide, torque: float) -> Drive:
        """Add a ``torque`` in N m on a side, constant over the shift."""
        if side == "sliding":
            sliding_torque = tuple(value + torque for value in self.sliding_torque)
            return replace(self, sliding_torque=sliding_torque)
        output_torque = tuple(value + torque for value in self.output_torque)
        return replace(self, output_torque=output_torque)

    def sliding_speed(self, mismatch: float) -> float:
        """Compute the speed of the sliding ring about the axis at a ``mismatch`` in rad/s."""
        if not self.turns:
            return 0.0
        wheels = self.sense * self.shaft_speed
        return wheels - mismatch if self.engine_side == "sliding" else wheels

    @property
    def has_pack(self) -> bool:
        """Whether a wet pack drags on the engine's side."""
        return self.pack_torque > 0.0 or self.pack_viscous > 0.0

    @property
    def has_table(self) -> bool:
        """Whether a torque over time acts on either side."""
        return any(self.sliding_torque) or any(self.output_torque)

    @property
    def has_torques(self) -> bool:
        """Whether anything but the speed before the shift is given."""
        acting = self.has_table or self.has_pack or self.synchroniser > 0.0
        return acting or self.control is not None

    def partner_torques(self, sliding_speed: float, output_speed: float) -> tuple[float, float]:
        """Compute the torques of synchroniser and pack on sliding and output side, N m.

        Speeds in rad/s and torques about the axis.
        """
        shared = self.synchroniser * smooth_sign(output_speed - sliding_speed, SMOOTH_TURN_RAD_S)
        on_sliding = self.engine_side == "sliding"
        slip = self.sense * self.pack_speed - (sliding_speed if on_sliding else output_speed)
        pack = self.pack_torque * smooth_sign(slip, SMOOTH_TURN_RAD_S) + self.pack_viscous * slip
        if on_sliding:
            return shared + pack, -shared
        return shared, pack - shared

    def table_at(self, time: float) -> tuple[float, float]:
        """Interpolate the torques on sliding and output side about the axis at ``time``, N m."""
        sliding = self._interpolate(self.sliding_torque, time)
        output = self._interpolate(self.output_torque, time)
        return self.sense * sliding, self.sense * output

    def _interpolate(self, torques: tuple[float, ...], time: float) -> float:
        """Interpolate a table of torques, or one torque for all times, N m."""
        if len(torques) == 1:
            return torques[0]
        return float(np.interp(time, self.times, torques))

    @property
    def table(self) -> dict[str, object]:
        """Keys of ``[drive]`` that differ from no drive, in the edge's units."""
        absent = record_quantities(NO_DRIVE)
        table: dict[str, object] = {
            key: value for key, value in record_quantities(self).items() if value != absent[key]
        }
        if self.engine_side != NO_DRIVE.engine_side:
            table["engine_side"] = self.engine_side
        if self.has_table:
            table["sliding_torque_Nm"] = list(self.sliding_torque)
            table["output_torque_Nm"] = list(self.output_torque)
        if self.times:
            table["torque_time_s"] = list(self.times)
        if self.control is not None:
            table["control"] = record_quantities(self.control)
        return table

    @property
    def record(self) -> dict[str, object]:
        """Values that differ from no drive, as a flat record."""
        return {f"drive_{key}": value for key, value in self.table.items()}

    @property
    def text(self) -> str:
        """Speed of the shafts before the shift, side of the engine and torques, in words."""
        parts = ["stand: sliding ring at rest, output ring at the mismatch"]
        if self.turns:
            speed = f"{self.shaft_speed / RPM:.5g} 1/min on the wheels' side"
            parts = [f"turn at {speed}, engine at the {self.engine_side} ring"]
        if self.has_table:
            parts.append("torque over time")
        if self.has_pack:
            parts.append("wet pack")
        if self.synchroniser > 0.0:
            parts.append("synchroniser")
        if self.control is not None:
            parts.append("speed control")
        return ", ".join(parts)


NO_DRIVE = Drive()  #: shafts that stand and that nothing drives


@dataclass(frozen=True)
class TorquePiece:
    """Torques over a part of a shift, each linear in time."""

    start: float  #: s
    end: float  #: s
    torques: tuple[float, float]  #: at the start on sliding and output side, about the axis, N m
    slopes: tuple[float, float]  #: N m/s

    def at(self, time: float) -> tuple[float, float]:
        """Compute the torques on sliding and output side at a time in s, N m."""
        elapsed = time - self.start
        sliding_torque, output_torque = self.torques
        sliding_slope, output_slope = self.slopes
        return sliding_torque + sliding_slope * elapsed, output_torque + output_slope * elapsed


class TorqueCourse:
    """Torques of tables and speed control over one shift, piece by piece, up to ``timeout`` s."""

    def __init__(self, drive: Drive, timeout: float) -> None:
        self.drive = drive
        self.timeout = timeout
        self.control_torque = 0.0
        self.pieces: list[TorquePiece] = []
        self._integral = 0.0
        self._error = 0.0
        self._cycles = 0  # measurements so far
        self._pending = deque[tuple[float, float]]()  # times and torques that were commanded

    def piece(self, time: float, mismatch: float) -> TorquePiece:
        """Begin the piece at ``time`` in s; ``mismatch`` is output less sliding speed, rad/s."""
        drive = self.drive
        ends = [self.timeout, *(knot for knot in drive.times if knot > time + SAME_TIME_S)]
        if drive.control is not None:
            ends += self._control(drive.control, time, mismatch)
        end = min(ends)
        start_sliding, start_output = drive.table_at(time)
        end_sliding, end_output = drive.table_at(end)
        slopes = (
            (end_sliding - start_sliding) / (end - time),
            (end_output - start_output) / (end - time),
        )
        on_sliding = drive.engine_side == "sliding"
        control = drive.sense * self.control_torque
        torques = (
            start_sliding + (control if on_sliding else 0.0),
            start_output + (0.0 if on_sliding else control),
        )
        piece = TorquePiece(time, end, torques, slopes)
        self.pieces.append(piece)
        return piece

    def _control(self, control: SpeedControl, time: float, mismatch: float) -> list[float]:
        """Measure the mismatch and set torques that are due at ``time``.

        Returns the times of the next measurement and of pending torques, s.
        """
        due = time + SAME_TIME_S
        if due >= self._cycles * control.cycle:
            self._cycles += 1
            self._error = control.set_point - mismatch
            step = control.integral * control.cycle * self._error
            self._integral = min(max(self._integral + step, -control.limit), control.limit)
            torque = control.proportional * self._error + self._integral
            torque = min(max(torque, -control.limit), control.limit)
            self._pending.append((time + control.dead_time, torque))
        while self._pending and self._pending[0][0] <= due:
            _, self.control_torque = self._pending.popleft()
        return [self._cycles * control.cycle, *(start for start, _ in self._pending)]

    def settled(self, time: float) -> bool:
        """Decide whether the torques on held rings stay constant from ``time`` in s on."""
        drive = self.drive
        control = drive.control
        if drive.has_table and drive.times and time < drive.times[-1]:
            return False
        if control is None:
            return True
        if self._pending or time < control.dead_time:
            return False
        growth = control.integral * abs(self._error) * (self.timeout - time)
        limited = abs(self.control_torque) >= control.limit
        return limited or growth <= STEADY * control.limit

    @property
    def knots(self) -> Array:
        """Times in s and torques on sliding and output side in N m, linear between, (3, 2 n)."""
        knots = []
        for piece in self.pieces:
            knots.append((piece.start, *piece.at(piece.start)))
            knots.append((piece.end, *piece.at(piece.end)))
        return np.array(knots).T.copy()


def impulses(times: Array, knots: Array) -> Array:
    """Integrate torques from the first knot, N m s, at times in s, (n,), on both sides, (2, n).

    ``knots`` as of ``TorqueCourse``; before the first one and beyond the last there is no torque.
    """
    knot_times = knots[0]
    torques = knots[1:]
    parts = 0.5 * np.diff(knot_times) * (torques[:, 1:] + torques[:, :-1])
    sums = np.concatenate([np.zeros((2, 1)), np.cumsum(parts, axis=1)], axis=1)
    clipped = np.clip(times, knot_times[0], knot_times[-1])
    place = np.searchsorted(knot_times, clipped, side="right") - 1
    place = np.clip(place, 0, knot_times.size - 2)
    width = knot_times[place + 1] - knot_times[place]
    elapsed = clipped - knot_times[place]
    share = np.divide(elapsed, width, out=np.zeros_like(elapsed), where=width > 0.0)
    start_torques = torques[:, place]
    end_torques = torques[:, place + 1]
    part_impulses = elapsed * (start_torques + 0.5 * share * (end_torques - start_torques))
    integrals: Array = sums[:, place] + part_impulses
    return integrals
