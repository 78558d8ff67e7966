r"""A planar model of rigid dogs, cheap enough for thousands of shifts at once.

Unrolled at the mean radius and seen from one ring, the other is a point (s, x)
outside a periodic outline, since the rings only shift against each other: *s* along
the circumference with the reduced inertia as mass :math:`J/r^2`, *x* along the shaft with the
sliding ring's mass. Two dogs' outlines make that of the point: face, traction flank
and braking flank, each twice as wide as a dog's. Faces touch at the inner radius,
where the turn of one against the other leaves them closest.

Time stepping after Moreau (1988): in each step the free velocity is corrected by an
impulse of the line that is crossed deepest, with Coulomb friction (stick or slip) and
the restitution of the contact set. It follows face contact and sliding within three
percent (a ring's motion turns from the steepest line of a face, the model's does not);
what flanks do to each other at speed, the compliance of the contact decides,
and there it is no more than a guess. It is a check on the simulation of its own, and
was tried as a control variate of the expected shift time, which hardly paid
(``benchmarks/expectation.py``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dogshape.sim.shift.actuation import cubic_step
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.contact import ContactSet
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.impact import restitution
from dogshape.sim.shift.trace import Series

STEP = 1e-4  #: s, of the time stepping
BOUNCE = 0.02  #: m/s of approach below which an impact is taken as dead


@dataclass(frozen=True)
class _Outline:
    """The periodic outline: lengths in m, lines by tangent of their lean."""

    pitch: float
    height: float
    face: float  # width of the face of the outline
    drop: float  # depth at which its braking edge lies
    crest: float  # overlap at dogs facing dogs
    traction: float
    braking: float
    chamfer: float
    inner: float  # inner over mean radius

    @classmethod
    def of(cls, dog: Dog) -> _Outline:
        return cls(
            pitch=dog.pitch,
            height=dog.height,
            face=2.0 * dog.face_width,
            drop=2.0 * dog.edge_drop,
            crest=dog.crest_overlap,
            traction=math.tan(dog.traction),
            braking=math.tan(dog.braking),
            chamfer=math.tan(dog.chamfer),
            inner=dog.inner_radius / dog.mean_radius,
        )

    def contact(self, s: Series, x: Series) -> tuple[Series, Series, Series]:
        """Return how deep the point is in, m, (n,), inward normal and tangent there, (2, n).

        Both are directions of a generalised force: a face touches at the inner
        radius, where a force has that much less of a lever.
        """
        foot = self.height * self.traction
        place = (s + self.crest + foot) % self.pitch - foot
        lines = self._lines(place, x)
        here = np.argmin(lines, axis=0)
        depth = np.take_along_axis(lines, here[None], 0)[0]
        beyond = self._lines(place - self.pitch, x)[:2]  # the next dog: face, traction flank
        ahead = np.argmin(beyond, axis=0)
        further = np.take_along_axis(beyond, ahead[None], 0)[0]
        line = np.where(further > np.maximum(depth, 0.0), ahead, here)
        slope = np.array([-self.chamfer, 1.0 / max(self.traction, 1e-9), 0.0])
        slope[2] = -1.0 / max(self.braking, 1e-9)
        lever = np.array([self.inner, 1.0, 1.0])[line]
        across, axial = slope[line], 1.0 / np.hypot(slope[line], 1.0)
        normal = np.array([across * axial * lever, axial])
        tangent = np.array([-axial * lever, across * axial])
        return np.maximum(depth, further), normal, tangent

    def _lines(self, place: Series, x: Series) -> Series:
        """Return the depth below face, traction and braking flank of one dog, (3, n)."""
        foot = self.height * self.traction
        touch = self.chamfer * (self.inner * (place + foot) - foot)
        return np.array(
            [
                (x - touch) / math.hypot(1.0, self.chamfer),
                (place + x * self.traction) / math.hypot(1.0, self.traction),
                (self.face - place + (x - self.drop) * self.braking)
                / math.hypot(1.0, self.braking),
            ]
        )


@lru_cache(maxsize=8)
def _restitutions(contact: ContactSet) -> tuple[Series, Series]:
    speeds = np.geomspace(1e-3, 10.0, 200)
    return speeds, np.array([restitution(contact, float(v)) for v in speeds])


def planar_times(
    clutch: Clutch, points: Sequence[OperatingPoint], angles: Series, bounce: float = 0.5
) -> Series:
    """Return shift times in s, NaN where a shift does not end, shaped as ``angles``.

    Parameters
    ----------
    points : operating points.
    angles : relative angles in rad, (points, n).
    bounce : factor on the restitution of the contact set.
    """
    run = _Run(clutch, points, angles, bounce)
    while run.lanes.size and run.time < clutch.timeout:
        run.step()
    return run.times.reshape(angles.shape)


class _Run:
    """All shifts at once; a lane is left out as soon as its shift has ended."""

    def __init__(
        self, clutch: Clutch, points: Sequence[OperatingPoint], angles: Series, bounce: float
    ) -> None:
        count, radius = angles.shape[1], clutch.dog.mean_radius
        self.outline, self.contact, self.bounce = _Outline.of(clutch.dog), clutch.contact, bounce
        self.masses = (clutch.rings.reduced_inertia / radius**2, clutch.rings.mass)
        self.force = np.repeat([p.profile.force for p in points], count)
        self.rise = np.repeat([p.profile.rise for p in points], count)
        self.end = clutch.dog.height - clutch.seated_tolerance
        self.stop = -clutch.dog.axial_gap - clutch.rebound
        start = np.full(angles.size, -clutch.dog.axial_gap)
        speed = np.repeat([p.mismatch * radius for p in points], count)
        #: s, x and their rates, (4, n)
        self.state = np.array([angles.ravel() * radius, start, speed, np.zeros(angles.size)])
        self.times = np.full(angles.size, np.nan)
        self.lanes = np.arange(angles.size)
        self.time = 0.0

    def step(self) -> None:
        """Make one step in all lanes."""
        s, x, along, axial = self.state
        part = (self.time + 0.5 * STEP) / self.rise
        push = cubic_step(part, self.force) / self.masses[1]
        before, speed = np.array([along, axial]), np.array([along, axial + push * STEP])
        at_stop = (x + speed[1] * STEP < self.stop) & (speed[1] < 0.0)
        speed[1, at_stop] = 0.0
        for _ in range(2):  # a slot's bottom has two flanks
            touched = self.outline.contact(s + speed[0] * STEP, x + speed[1] * STEP)
            if not (touched[0] > 0.0).any():
                break
            speed = self._corrected(speed, before, *touched)
        moved = x + speed[1] * STEP
        self.state = np.array([s + speed[0] * STEP, moved, *speed])
        self._finish(x, moved)

    def _corrected(
        self, speed: Series, before: Series, depth: Series, normal: Series, tangent: Series
    ) -> Series:
        """Return the speeds after an impulse along ``normal`` with friction, (2, n)."""
        inverse = 1.0 / np.array(self.masses)[:, None]
        closing, sliding = (speed * normal).sum(axis=0), (speed * tangent).sum(axis=0)
        approach = np.maximum((before * normal).sum(axis=0), 0.0)
        rebound = np.where(approach > BOUNCE, self.bounce, 0.0)
        rebound *= np.interp(approach, *_restitutions(self.contact)) * approach
        w_n, w_t = (normal**2 * inverse).sum(axis=0), (tangent**2 * inverse).sum(axis=0)
        w_c = (normal * tangent * inverse).sum(axis=0)
        wanted, friction = -closing - rebound, self.contact.dynamic_friction
        whole = w_n * w_t - w_c**2
        push, drag = (w_t * wanted + w_c * sliding) / whole, (-w_c * wanted - w_n * sliding) / whole
        slips = np.abs(drag) > -friction * push
        sense = -np.sign(sliding)
        slipping = wanted / (w_n - friction * sense * w_c)
        push = np.where(slips, slipping, push)
        drag = np.where(slips, -friction * slipping * sense, drag)
        acts = (depth > 0.0) & (closing > 0.0)
        impulse = np.where(acts, normal * push + tangent * drag, 0.0)
        return speed + impulse * inverse

    def _finish(self, before: Series, after: Series) -> None:
        done = after >= self.end
        self.time += STEP
        if not done.any():
            return
        left = (after[done] - self.end) / (after[done] - before[done])
        self.times[self.lanes[done]] = self.time - left * STEP
        keep = ~done
        self.state, self.lanes = self.state[:, keep], self.lanes[keep]
        self.force, self.rise = self.force[keep], self.rise[keep]
