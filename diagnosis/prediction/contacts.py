r"""Marks of the contact under any effects in closed form, and their density.

Faces under an axial force *N* slide by *v* on the chamfer :math:`\alpha` with friction
:math:`\tan\varphi = \mu(v)`. In the sense *s* = 1 in which the ring moves on, -1 in which the
chamfer pushes it back, at the radius *r* where faces meet,

.. math:: J_1 \dot\omega_1 = N r \tan(\varphi - s \alpha) - M, \qquad
          \frac{dx}{r\,d\theta} = s \tan\alpha, \qquad
          N = F - R - c\dot x - D(x) - k_s r N |\tan(\varphi - s\alpha)|,

with drag *M*, and friction, damping and detent of ``sim.shift.mechanism``. From touch to end
:math:`J_2 |\Delta\omega_2| = J_1 \Delta\omega_1 + M t`. Before, the speeds differ by the mismatch.

Faces of the width *w* part at the gap where *s* = -1, else deeper by :math:`2 w \tan\alpha`.

Quantities of a clutch change along each parameter apart from all others, so that a table along each
parameter gives them for any hypothesis. The force of the trace is the one that acts or the nominal
one, and so are its speeds. Each kind of mark has a Student distribution with an error of its law in
common. *Unknown* has the baseline's marks, or these with larger errors.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dogshape.bench.bench_data import Bench
from dogshape.bench.contact_marks import SPEED_GAIN, TURNING_RAD_S, SeenContacts
from dogshape.diagnosis.prediction.flights import log_student
from dogshape.diagnosis.prediction.simulations import Level
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import NONE, REVERSED, Array, Hypothesis, strip_sense
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.kernel.contact import FALL_AT_REST, FALL_SLIP
from dogshape.sim.setting import Setting

TABLE_NODES = 17  #: along each parameter
#: Shares of the other parameters of an effect, of which the first that exist are taken.
REFERENCE_SHARES = (0.5, 0.0, 1.0)
MIN_FORCE_N = 0.5  #: of a profile, below which it has no ratio to another one
MAX_FORCE_RATIO = 20.0


class ClutchQuantities(NamedTuple):
    """Quantities that decide the marks, at m values or one setting: (m,), or (m, k) as stated."""

    static_friction: Array
    dynamic_friction: Array
    stiction_velocity: Array  #: m/s
    chamfer: Array  #: rad
    gap: Array  #: m
    sliding_inertia: Array  #: kg m2
    output_inertia: Array  #: kg m2
    drag: Array  #: N m
    friction: Array  #: N
    damping: Array  #: N s/m
    detent: Array  #: N
    detent_position: Array  #: m
    spline: Array  #: 1/m
    compliance: Array  #: of the linkage before the sensor, m/N
    play: Array  #: of that linkage, m
    mismatch: Array  #: magnitude at each marked operating point, rad/s, (m, a)
    log_force: Array  #: ln of the force over the nominal one on each face, (m, w NODES)


class FaceTorques(NamedTuple):
    """Torques of w faces on the sliding ring at m values, N m, (m, w) each."""

    mean: Array
    single_error: Array  #: standard error by the law, of each face by itself
    common_error: Array  #: the same in common


#: Number of the first columns of a row, which are scalars.
SCALARS = len(ClutchQuantities._fields) - 2


class Contacts:
    """Marks of the contact that a bench shows, and their density under any hypothesis."""

    def __init__(
        self,
        bench: Bench,
        marks: SeenContacts,
        effects: Mapping[str, Effect],
        settings: Sequence[Setting],
        constants: Settings,
    ) -> None:
        self.constants = constants
        self.freedom = constants.flight_freedom
        self.marks = marks
        self.effects = effects
        self.settings = settings
        self.dog = bench.clutch.dog
        self.detent_width = settings[0].clutch.mechanism.detent_width
        inner = self.dog.inner_radius
        self.face_radius = inner + constants.face_radius * (self.dog.mean_radius - inner)
        self.senses = np.array([np.sign(s.point.mismatch) or 1.0 for s in settings])
        share = bench.errors.each_point.sizes[2]
        offset = bench.errors.each_point.sizes[3]
        self.speed_share = max(share, constants.speed_error)
        self.speed_offset = offset
        systematic = bench.errors.systematic.sizes
        self.common_speed = float(np.hypot(systematic[2], SPEED_GAIN))
        self.common_offset = systematic[3]
        self._baseline = self._row(settings)
        self._tables: dict[str, tuple[Array, list[tuple[Array, Array]]]] = {}

    def log_density(self, h: Hypothesis, values: Array, factor: float = 1.0) -> Array:
        """Compute log densities at values (m, p), with acting and nominal force, (2, m).

        ``factor`` multiplies all errors of laws.
        """
        q = self._quantities(h, values)
        sense = -1.0 if REVERSED in h else 1.0
        log = self._log_speeds(q, factor) + self._log_balances(q, factor)
        log = log + self._log_ends(q, sense, factor)
        acting = self._log_faces(q, sense, np.zeros_like(q.log_force), factor)
        nominal = acting
        if q.log_force.any():
            nominal = self._log_faces(q, sense, q.log_force, factor)
        return np.asarray(log + np.stack([acting, nominal]))

    def log_unknown(self) -> float:
        """Compute the log density of the marks if no known effect moved them."""
        logs = []
        factors = self.constants.contact_factors
        for factor in (1.0, *factors):  # both forces are the nominal one
            logs.append(float(self.log_density(NONE, np.zeros((1, 0)), factor)[0, 0]))
        log_moved = np.logaddexp.reduce(logs[1:]) - np.log(len(factors))
        return float(np.logaddexp(logs[0], log_moved) - np.log(2.0))

    def _log_speeds(self, q: ClutchQuantities, factor: float) -> Array:
        """Compute the log density of the speed differences, as acting or nominal ones, (m,)."""
        seen = self.marks.speeds
        nominal = self._split(self._baseline[None]).mismatch
        logs = []
        for mismatch in (q.mismatch, np.broadcast_to(nominal, q.mismatch.shape)):
            single = seen.error**2 + self.speed_offset**2
            single = single + (factor * self.speed_share * mismatch) ** 2
            common = factor * np.hypot(self.common_speed * mismatch, self.common_offset)
            logs.append(_log_density(seen.value - mismatch, single, common, self.freedom))
        return np.asarray(np.logaddexp(*logs) - np.log(2.0))

    def _log_balances(self, q: ClutchQuantities, factor: float) -> Array:
        """Compute the log density of the balances of both sides, (m,)."""
        seen = self.marks.balances
        gain = (q.sliding_inertia / q.output_inertia)[:, None] * seen.rise
        loss = (q.drag / q.output_inertia)[:, None] * seen.turning_time
        single = seen.error**2 + (factor * self.constants.balance_held * loss) ** 2
        common = factor * self.constants.balance_law * gain
        return _log_density(seen.fall - gain - loss, single, common, self.freedom)

    def _log_ends(self, q: ClutchQuantities, sense: float, factor: float) -> Array:
        """Compute the log density of where faces part, median of each sense, (m,)."""
        seen = self.marks.faces
        senses = sense * self.senses[seen.cell]
        tangent = np.tan(q.chamfer)
        tip = self.dog.tip_width_at(self.face_radius)
        drop = 2.0 * tip * tangent / (1.0 - tangent * np.tan(self.dog.braking))
        residuals = []
        for moves_on in (True, False):
            group = (senses > 0.0) == moves_on
            if group.any():
                force = float(np.median(seen.force[group, -1]))
                end = q.gap + moves_on * drop + q.compliance * force + 0.5 * q.play
                residuals.append(float(np.median(seen.end[group])) - end)
        if not residuals:
            return np.zeros(len(q.gap))
        residual = np.stack(residuals, axis=1)
        variance = np.full(residual.shape, (factor * self.constants.face_end) ** 2)
        return _log_density(residual, variance, np.zeros_like(residual), self.freedom)

    def _log_faces(
        self, q: ClutchQuantities, sense: float, log_force: Array, factor: float
    ) -> Array:
        """Compute the log density of slopes and accelerations on the faces, (m,)."""
        seen = self.marks.faces
        senses = sense * self.senses[seen.cell]
        radius = self.face_radius
        tangent = np.tan(q.chamfer)[:, None]
        slope = senses * tangent * (radius / self.dog.mean_radius)
        slope = slope + q.compliance[:, None] * seen.force_slope
        single = seen.slope_error**2 + (factor * self.constants.face_single * tangent) ** 2
        common = np.broadcast_to(factor * self.constants.face_law * tangent, slope.shape)
        log = _log_density(seen.slope - slope, single, common, self.freedom)
        torques = self._face_torques(q, senses, log_force, radius)
        torque = torques.mean
        drag = q.drag[:, None]
        speed = seen.sliding_speed
        turning = torque - drag * np.sign(speed)
        resting = np.sign(torque) * np.maximum(abs(torque) - drag, 0.0)
        net = np.where(abs(speed) > TURNING_RAD_S, turning, resting)
        inertia = q.sliding_inertia[:, None]
        single = seen.acceleration_error**2 + (factor * torques.single_error / inertia) ** 2
        residual = seen.acceleration - net / inertia
        return log + _log_density(
            residual, single, factor * torques.common_error / inertia, self.freedom
        )

    def _face_torques(
        self, q: ClutchQuantities, senses: Array, log_force: Array, radius: float
    ) -> FaceTorques:
        """Compute mean torques of the faces on the sliding ring."""
        seen = self.marks.faces
        shape = (len(q.chamfer), *seen.slip.shape)
        friction = friction_coefficient(
            abs(seen.slip),
            static=q.static_friction[:, None, None],
            dynamic=q.dynamic_friction[:, None, None],
            stiction_velocity=q.stiction_velocity[:, None, None],
        )
        angle = np.arctan(friction)
        chamfer = q.chamfer[:, None, None]
        ratio = np.tan(angle - senses[:, None] * chamfer)
        direction = np.sign(seen.axial_speed)[:, None]
        force = seen.force * np.exp(log_force.reshape(shape))
        distance = (seen.displacement - q.detent_position[:, None, None]) / self.detent_width
        climb = np.maximum(1.0 - 4.0 * distance**2, 0.0) ** 2
        axial = force - q.friction[:, None, None] * direction
        axial = axial - q.damping[:, None, None] * seen.axial_speed[:, None]
        axial = axial - q.detent[:, None, None] * climb
        spline = q.spline[:, None, None] * radius * abs(ratio) * direction
        normal = np.maximum(axial, 0.0) / np.maximum(1.0 + spline, 0.1)
        sum_of_slopes = friction + np.tan(chamfer)
        creep_share = 1.0 / (1.0 + (seen.slip / q.stiction_velocity[:, None, None]) ** 2)
        constants = self.constants
        creep_law = constants.nuisance["contact_creep"] - 1.0  # of the stiction velocity
        common = np.hypot(constants.face_law * sum_of_slopes, creep_law * creep_share * friction)
        return FaceTorques(
            mean=(normal * ratio).mean(axis=2) * radius,
            single_error=constants.face_single * (normal * sum_of_slopes).mean(axis=2) * radius,
            common_error=(normal * common).mean(axis=2) * radius,
        )

    def _quantities(self, h: Hypothesis, values: Array) -> ClutchQuantities:
        """Interpolate the quantities of a hypothesis at parameter values (m, p), (m,) each."""
        rows = np.tile(self._baseline, (len(values), 1))
        first = 0
        for name in strip_sense(h):
            change, tables = self._table(name)
            rows = rows + change
            for nodes, changes in tables:
                rows = rows + _interpolate(values[:, first], nodes, changes)
                first += 1
        return self._split(rows)

    def _table(self, name: str) -> tuple[Array, list[tuple[Array, Array]]]:
        """Tabulate the changes by an effect: at a reference, and along each parameter from it.

        A parameter has its nodes, (n,), and the changes there, (n, K).
        """
        if name not in self._tables:
            self._tables[name] = self._tabulate(self.effects[name])
        return self._tables[name]

    def _tabulate(self, effect: Effect) -> tuple[Array, list[tuple[Array, Array]]]:
        """Tabulate an effect about the reference with the most benches along its parameters."""
        parameters = effect.parameters
        best: tuple[Array, list[tuple[Array, Array]]] = np.zeros_like(self._baseline), []
        most = -1
        for shares in itertools.product(REFERENCE_SHARES, repeat=len(parameters)):
            reference = [p.at(share) for p, share in zip(parameters, shares, strict=True)]
            row = self._effect_row(effect, reference)
            if row is None:
                continue
            tables = []
            count = 0
            for k, parameter in enumerate(parameters):
                nodes = []
                changes = []
                for share in np.linspace(0.0, 1.0, TABLE_NODES).tolist():
                    value = parameter.at(share)
                    moved = self._effect_row(effect, [*reference[:k], value, *reference[k + 1 :]])
                    if moved is not None:
                        nodes.append(value)
                        changes.append(moved - row)
                tables.append((np.array(nodes), np.array(changes)))
                count += len(nodes)
            if count > most:
                most = count
                best = row - self._baseline, tables
            if count == TABLE_NODES * len(parameters):
                break
        return best

    def _effect_row(self, effect: Effect, values: Sequence[float]) -> Array | None:
        """Compute the row of one effect at values, None without such a bench."""
        level = Level((effect.name,), tuple(values))
        effects = {effect.name: effect}
        try:
            first = level.setting(effects, self.settings[0])
            point = first.point == self.settings[0].point and first.delay == self.settings[0].delay
            if point:  # operating points stay
                return self._row([first], self._baseline)
            return self._row([level.setting(effects, s) for s in self.settings])
        except DogshapeError:
            return None

    def _row(self, settings: Sequence[Setting], baseline: Array | None = None) -> Array:
        """Compute the quantities of a bench as one row, its operating points from ``baseline``."""
        first = settings[0]
        clutch = first.clutch
        mechanism = clutch.mechanism
        contact = clutch.contact
        is_elastic = mechanism.has_linkage and first.sensor == "actuator"
        numbers = clutch.numbers
        scalars = [
            contact.static_friction,
            contact.dynamic_friction,
            contact.stiction_velocity,
            clutch.dog.chamfer,
            clutch.dog.axial_gap,
            numbers.sliding_inertia,
            numbers.output_inertia,
            mechanism.drag_torque,
            mechanism.friction,
            mechanism.damping,
            mechanism.detent,
            mechanism.detent_position,
            numbers.spline_force_per_torque,
            1.0 / numbers.linkage_stiffness if is_elastic else 0.0,
            mechanism.free_play if is_elastic else 0.0,
        ]
        if baseline is not None:
            return np.concatenate([scalars, baseline[SCALARS:]])
        mismatches = [abs(settings[cell].point.mismatch) for cell in self.marks.speeds.cell]
        log_forces = []
        for cell, times in zip(self.marks.faces.cell, self.marks.faces.time, strict=True):
            setting = settings[cell]
            nominal = self.settings[cell].point.profile.at(times)
            force = setting.point.profile.at(times - setting.delay)
            ratio = np.maximum(force, MIN_FORCE_N) / np.maximum(nominal, MIN_FORCE_N)
            log_forces.append(np.log(np.clip(ratio, 1.0 / MAX_FORCE_RATIO, MAX_FORCE_RATIO)))
        return np.concatenate([scalars, mismatches, *log_forces])

    def _split(self, rows: Array) -> ClutchQuantities:
        """Divide rows (m, K) into quantities."""
        speeds = SCALARS + self.marks.speeds.cell.size
        scalars = rows[:, :SCALARS].T
        columns = [*scalars, rows[:, SCALARS:speeds], rows[:, speeds:]]
        return ClutchQuantities._make(columns)


def friction_coefficient(
    slip: Array, *, static: Array, dynamic: Array, stiction_velocity: Array
) -> Array:
    """Compute the coefficient of friction at a slip, m/s, by the law of ``sim.kernel.contact``."""
    ratio = slip / stiction_velocity
    beyond_fall = ratio - FALL_SLIP
    fall = beyond_fall / np.sqrt(1.0 + beyond_fall**2) / FALL_AT_REST
    falling = dynamic + 0.5 * (static - dynamic) * (1.0 - fall)
    falling = falling * ratio / np.sqrt(1.0 + ratio**2)
    constant = dynamic * (2.0 / np.pi) * np.arctan(ratio)
    return np.asarray(np.where(static == dynamic, constant, falling))


def _interpolate(values: Array, nodes: Array, changes: Array) -> Array:
    """Interpolate changes (n, K) at ascending nodes (n,) linearly at values (m,), (m, K)."""
    if nodes.size == 0:
        return np.zeros((values.size, 1))
    if nodes.size == 1:
        return np.tile(changes, (values.size, 1))
    place = np.clip(np.searchsorted(nodes, values) - 1, 0, nodes.size - 2)
    share = (values - nodes[place]) / (nodes[place + 1] - nodes[place])
    share = np.clip(share, 0.0, 1.0)[:, None]
    return np.asarray((1.0 - share) * changes[place] + share * changes[place + 1])


def _log_density(residual: Array, variance: Array, common: Array, freedom: float) -> Array:
    """Compute Student's log density of residuals (m, k) with a common error, (m,).

    ``variance`` of each by itself, and ``common``, the error by one standard deviation of what all
    share, are (m, k) or (k,). ``freedom`` are the degrees of freedom.
    """
    size = residual.shape[1]
    if size == 0:
        return np.zeros(len(residual))
    variance = np.broadcast_to(variance, residual.shape)
    common = np.broadcast_to(common, residual.shape)
    information = 1.0 + (common**2 / variance).sum(axis=1)
    projection = (common * residual / variance).sum(axis=1)
    squared = (residual**2 / variance).sum(axis=1) - projection**2 / information
    log_determinant = np.log(variance).sum(axis=1) + np.log(information)
    return log_student(squared, log_determinant, size, freedom)
