r"""Marks of the contact in bench traces: speeds of both rings before, on and after the faces.

None depends on the relative angle at the first touch, which no trace shows:

- *speed difference* before the touch, the mismatch;
- *balance* of both sides from the touch to the end: the output side loses :math:`J_2 \Delta
  \omega_2`, the sliding side gains :math:`J_1 \Delta\omega_1` and what its drag takes;
- *face*: while faces slide on each other, displacement over slip has the slope of the chamfer, and
  the acceleration of the sliding ring is the friction under the force at that time. The faces part
  at the gap, or deeper by the depth of the chamfers.

The face is the longest run of samples whose displacement is linear in the slip, flatter than any
flank, behind a faster approach. Speeds have the sense of the observed difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dogshape.bench.bench_data import Bench, Cell
from dogshape.bench.samples import scatter, smoothed
from dogshape.bench.traces import BenchTrace
from dogshape.sim.elementwise import Array
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.units import RPM

NODES = 3  #: parts of a face of which each has its slip and force
MAX_SAMPLES = 600  #: of a trace; longer ones are averaged in blocks
MIN_FACE_SAMPLES = 9  #: of a face
MIN_FACE_SHARE = 0.6  #: of the dog's width, least slip on a face: its end meets at other radii
MAX_FACE_SLOPE = 0.45  #: of displacement over slip, between a chamfer and a flank
FACE_NOISE = 4.0  #: scatters by which a sample of a face may be off the line
MIN_FACE_NOISE_M = 3e-6  #: m, least scatter of the displacement
MIN_APPROACH_RATIO = 1.5  #: of the speed before the touch to that on the face
MAX_TRAVEL_SHARE = 0.95  #: of the travel, to which a face may reach
TOUCH_SHARE = 0.3  #: of the axial gap, up to which no dogs have touched
REST_TIME_S = 0.05  #: s, before the touch and after the shift, of which speeds are taken
MIN_REST_SAMPLES = 5  #: before the touch, and after the shift
END_SHARE = 0.98  #: of the travel, from which the rings are engaged
MIN_SPEED_SHARE = 0.25  #: of the nominal mismatch, below which speeds were not recorded
TURNING_RAD_S = 0.2  #: rad/s, sliding speed from which the ring counts as turning
SPEED_ERROR_RAD_S = 0.2 * RPM  #: rad/s, error of a mean speed beside its noise
MAX_BEND = 2.0  #: scatters by which the speed on a face may be off a cubic: beyond, a blow moved it
SPEED_GAIN = 0.01  #: error of a speed difference by the sensors' gain


@dataclass(frozen=True)
class SpeedMarks:
    """Speed differences before the touch at a operating points, (a,) each."""

    cell: np.ndarray  #: index of the operating point
    value: Array  #: magnitude, rad/s
    error: Array  #: by itself, rad/s


@dataclass(frozen=True)
class BalanceMarks:
    """Changes of both rings' speeds from touch to end in b traces, (b,) each."""

    fall: Array  #: of the output ring's speed, rad/s
    rise: Array  #: of the sliding ring's speed, rad/s
    turning_time: Array  #: s, in the sense of the rise
    error: Array  #: of the fall by itself, rad/s


@dataclass(frozen=True)
class FaceMarks:
    """Faces that slide on each other in w traces, (w,) or (w, NODES)."""

    cell: np.ndarray  #: index of the operating point, (w,)
    time: Array  #: after time zero, s, (w, NODES)
    slip: Array  #: at the mean radius, m/s, (w, NODES)
    force: Array  #: of the trace, N, (w, NODES)
    displacement: Array  #: m, (w, NODES)
    axial_speed: Array  #: of the ring, m/s, (w,)
    sliding_speed: Array  #: rad/s, (w,)
    slope: Array  #: displacement over slip at the mean radius, (w,)
    slope_error: Array  #: (w,)
    force_slope: Array  #: force over slip, N/m, (w,)
    acceleration: Array  #: of the sliding ring, rad/s^2, (w,)
    acceleration_error: Array  #: (w,)
    end: Array  #: displacement where the faces part, m, (w,)


FACE_SIZE = 4 * NODES + 8  #: values of a face


@dataclass(frozen=True)
class SeenContacts:
    """Marks of the contact in all traces of a bench."""

    speeds: SpeedMarks
    balances: BalanceMarks
    faces: FaceMarks


def _has_marks(clutch: Clutch) -> bool:
    """Test that a clutch has marks of the contact.

    Shafts that turn, their drive and elastic shafts take part in the balance, a tip may fall to
    the traction flank, and faces may have a friction of their own: such clutches have none.
    """
    mechanism = clutch.mechanism
    has_shafts = mechanism.ring_inertia > 0.0 or mechanism.wheel_inertia > 0.0
    has_drive = clutch.drive.turns or clutch.drive.has_torques
    has_two_laws = clutch.contact.impact is not None or clutch.contact.face_friction is not None
    return not (has_drive or has_shafts or has_two_laws or clutch.dog.crest < 1.0)


def contacts_of(bench: Bench) -> SeenContacts | None:
    """Gather the marks of the contact; None without traces that show speeds."""
    clutch = bench.clutch
    if not _has_marks(clutch):
        return None
    speeds = list[tuple[float, ...]]()
    balances = list[tuple[float, ...]]()
    faces = list[Array]()
    face_cells = []
    for k, cell in enumerate(bench.cells):
        motions = _motions_of(cell, clutch)
        if not motions:
            continue
        values, errors = np.array([motion.difference for motion in motions]).T
        error = float(np.sqrt((errors**2).mean() / len(errors)))
        speeds.append((float(k), float(values.mean()), error))
        for motion in motions:
            if motion.balance is not None:
                balances.append(motion.balance)
            face = _face_of(motion, clutch)
            if face is not None:
                faces.append(face)
                face_cells.append(k)
    if not speeds:
        return None
    cell, value, error = np.array(speeds).T
    face_table = np.array(faces).reshape(len(faces), FACE_SIZE)
    nodes = face_table[:, : 4 * NODES].reshape(-1, 4, NODES).swapaxes(0, 1)
    return SeenContacts(
        speeds=SpeedMarks(cell.astype(int), value, error),
        balances=BalanceMarks(*np.array(balances).reshape(-1, 4).T),
        faces=FaceMarks(np.array(face_cells, dtype=int), *nodes, *face_table[:, 4 * NODES :].T),
    )


@dataclass(frozen=True)
class _Motion:
    """Motion in a trace, speeds in the sense of the observed difference, (n,) each."""

    time: Array  #: s
    displacement: Array  #: m
    force: Array  #: N
    sliding_speed: Array  #: rad/s
    slip: Array  #: way at the mean radius, m
    touch: int  #: index of the first sample that dogs may touch at
    difference: tuple[float, float]  #: of the speeds before the touch, and its error, rad/s
    balance: tuple[float, float, float, float] | None  #: as in ``BalanceMarks``
    speed_noise: float  #: scatter of the sliding speed, rad/s


def _motions_of(cell: Cell, clutch: Clutch) -> list[_Motion]:
    """Read the motions in the traces of an operating point, as far as these show them."""
    motions = (_motion_of(trace, clutch, cell.point.mismatch) for trace in cell.traces)
    return [motion for motion in motions if motion is not None]


def _motion_of(trace: BenchTrace, clutch: Clutch, mismatch: float) -> _Motion | None:
    """Read the motion of a trace; None where a part of it is missing.

    ``mismatch`` is the nominal one, rad/s.
    """
    time, displacement, force, sliding, output = _shift_samples(trace, clutch)
    count = time.size
    is_touching = smoothed(displacement) > TOUCH_SHARE * clutch.dog.axial_gap
    touch = int(np.argmax(is_touching))
    if not is_touching.any() or touch < MIN_REST_SAMPLES:
        return None
    difference = float((output[:touch] - sliding[:touch]).mean())
    if mismatch == 0.0 or abs(difference) < MIN_SPEED_SHARE * abs(mismatch):
        return None
    sense = float(np.sign(difference))
    noise = scatter(sliding)
    output_noise = scatter(output)
    mean_error = float(np.hypot(noise, output_noise)) / touch**0.5
    is_end = smoothed(displacement) > END_SHARE * float(displacement.max())
    is_end &= displacement > 0.5 * clutch.dog.travel
    balance = None
    if is_end.sum() >= MIN_REST_SAMPLES:
        fall = float(output[:touch].mean() - output[is_end].mean()) * sense
        rise = float(sliding[is_end].mean() - sliding[:touch].mean()) * sense
        is_turning = abs(sliding) > np.maximum(TURNING_RAD_S, 4.0 * noise)
        is_turning &= np.arange(count) >= touch
        end = int(np.argmax(is_end)) + int(is_end.sum()) // 2
        turning = (np.sign(sliding) * is_turning * sense)[:end]
        turning_time = float((0.5 * (turning[1:] + turning[:-1]) * np.diff(time[:end])).sum())
        share = 1.0 / touch + 1.0 / float(is_end.sum())
        error = float(np.hypot(output_noise * share**0.5, SPEED_ERROR_RAD_S))
        balance = (fall, rise, turning_time, error)
    relative = (output - sliding) * sense
    steps = 0.5 * (relative[1:] + relative[:-1]) * np.diff(time)
    slip = clutch.dog.mean_radius * np.concatenate([[0.0], np.cumsum(steps)])
    return _Motion(
        time=time,
        displacement=displacement,
        force=force,
        sliding_speed=sliding * sense,
        slip=slip,
        touch=touch,
        difference=(abs(difference), float(np.hypot(mean_error, SPEED_ERROR_RAD_S))),
        balance=balance,
        speed_noise=noise,
    )


def _shift_samples(trace: BenchTrace, clutch: Clutch) -> tuple[Array, ...]:
    """Select the samples about a shift, averaged in blocks: the channels of a trace, (n,) each."""
    displacement = smoothed(trace.displacement)
    touch = int(np.argmax(displacement > TOUCH_SHARE * clutch.dog.axial_gap))
    end = int(np.argmax(displacement > END_SHARE * float(displacement.max())))
    is_near = trace.time >= trace.time[touch] - REST_TIME_S
    is_near &= trace.time <= trace.time[end] + REST_TIME_S
    channels = (
        trace.time,
        trace.displacement,
        trace.force,
        trace.sliding_speed,
        trace.output_speed,
    )
    block = max(1, int(is_near.sum()) // MAX_SAMPLES)
    count = int(is_near.sum()) // block
    return tuple(
        channel[is_near][: count * block].reshape(count, block).mean(axis=1) for channel in channels
    )


def _face_of(motion: _Motion, clutch: Clutch) -> Array | None:
    """Read the marks of a face in the order of ``FaceMarks``, (FACE_SIZE,); None without a face."""
    bounds = _face_samples(motion, clutch)
    if bounds is None:
        return None
    face = slice(*bounds)
    time = motion.time[face]
    slip = motion.slip[face]
    displacement = motion.displacement[face]
    sliding_speed = motion.sliding_speed[face]
    noise = max(scatter(motion.displacement), MIN_FACE_NOISE_M)
    slope = float(np.polyfit(slip, displacement, 1)[0])
    acceleration = float(np.polyfit(time, sliding_speed, 1)[0])
    acceleration_error = float(motion.speed_noise / (time.std() * time.size**0.5))
    centred_time = (time - time.mean()) / time.std()
    curve = np.polyval(np.polyfit(centred_time, sliding_speed, 3), centred_time)
    bend = float((sliding_speed - curve).std())
    if bend > MAX_BEND * max(motion.speed_noise, SPEED_ERROR_RAD_S):
        acceleration_error = float(np.ptp(sliding_speed)) / float(np.ptp(time))
    parts = np.array_split(np.arange(time.size), NODES)
    durations = np.array([time[part[-1]] - time[part[0]] for part in parts])
    ways = np.array([slip[part[-1]] - slip[part[0]] for part in parts])
    force = motion.force[face]
    channels = (time, force, displacement)
    means = [np.array([values[part].mean() for part in parts]) for values in channels]
    scalars = [
        float(np.polyfit(time, displacement, 1)[0]),
        float(sliding_speed.mean()),
        slope,
        noise / float(slip.std() * slip.size**0.5),
        float(np.polyfit(slip, force, 1)[0]),
        acceleration,
        acceleration_error,
        float(displacement[-1]),
    ]
    return np.concatenate([means[0], ways / durations, *means[1:], scalars])


def _face_samples(motion: _Motion, clutch: Clutch) -> tuple[int, int] | None:
    """Find the first sample of the longest face and the one behind its last; None without."""
    slip = motion.slip
    displacement = motion.displacement
    tolerance = FACE_NOISE * max(scatter(displacement), MIN_FACE_NOISE_M)
    max_displacement = MAX_TRAVEL_SHARE * clutch.dog.travel
    end = int(np.argmax(np.append(smoothed(displacement), np.inf) > max_displacement))
    speed = np.gradient(smoothed(displacement), motion.time)
    fastest = np.maximum.accumulate(speed)
    bounds: tuple[int, int] | None = None
    longest = MIN_FACE_SHARE * clutch.dog.tip_width
    for first in range(motion.touch, end - MIN_FACE_SAMPLES):
        if slip[end - 1] - slip[first] <= longest:
            break
        last = _line_end(slip[first:end], displacement[first:end], tolerance)
        if last < MIN_FACE_SAMPLES:
            continue
        stop = first + last
        way = float(slip[stop - 1] - slip[first])
        duration = motion.time[stop - 1] - motion.time[first]
        axial_speed = abs(displacement[stop - 1] - displacement[first]) / duration
        if way > longest and fastest[first] > MIN_APPROACH_RATIO * axial_speed:
            longest = way
            bounds = first, stop
    return bounds


def _line_end(slip: Array, displacement: Array, tolerance: float) -> int:
    """Count the first samples that lie on one line of a face's slope; 0 for too few."""
    accepted = 0
    step = MIN_FACE_SAMPLES
    while step > 0:
        count = accepted + step
        if count <= slip.size and _is_line(slip[:count], displacement[:count], tolerance):
            accepted = count
            step *= 2
        elif accepted == 0:
            break
        else:
            step //= 2
    return accepted


def _is_line(slip: Array, displacement: Array, tolerance: float) -> bool:
    """Test whether displacements lie on a line of a face's slope over the slip."""
    x = slip - slip.mean()
    y = displacement - displacement.mean()
    square = float(x @ x)
    if square == 0.0:
        return False
    slope = float(x @ y) / square
    return abs(slope) <= MAX_FACE_SLOPE and float(abs(y - slope * x).max()) <= tolerance
