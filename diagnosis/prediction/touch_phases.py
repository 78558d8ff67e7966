r"""Phase by which the rings turn until the first touch, as effects change it.

The phase is :math:`\phi = \Omega \tau / p`, with the mismatch :math:`\Omega`, the duration
:math:`\tau` of the flight and the pitch *p*. The flight (``diagnosis.prediction.flight``) meets
neither contact nor relative angle, so it is simulated at a grid of an effect's values, with splines
between. Changes by several effects add up.

Where a prior reaches to where no axial gap is left, or beyond, the nodes lie over the part of which
there is a bench. Near that end the flight is short, and its duration goes with the fourth root of
what is left (:math:`x \propto t^4`, as a force rises that starts smoothly; with the square root
where it is there at once): nodes and splines are even in the fourth root.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from dogshape.diagnosis.prediction.flight import changes_flight, touch_time
from dogshape.diagnosis.prediction.flight_table import (
    filled,
    shares_below,
    spline_weights,
    summed,
)
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.terms import Array
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile

NODES = {1: 17, 2: 9}  #: along each parameter of an effect, by their number
MANY = 5  #: along each of more than two
HALVINGS = 40  #: to the end of the part of a prior of which there is a bench
SHORT = 0.5  #: of the flight without the effect, below which an end of a prior is beside that part
ROOT = 4  #: of what is left beside that end, in which nodes are even


@dataclass(frozen=True)
class _Line:
    """Places from 0 to 1 along a parameter, at shares ``start`` to ``end`` of its prior.

    They are even in the share of the way by the power ``1 / root``.
    """

    start: float = 0.0
    end: float = 1.0
    root: int = 1

    def shares(self, places: Array) -> Array:
        """Return the shares of the prior at places (m,)."""
        return self.start + (self.end - self.start) * places**self.root

    def places(self, shares: Array) -> Array:
        """Return the places of shares of the prior (m,)."""
        way = (shares - self.start) / (self.end - self.start)
        return way if self.root == 1 else np.clip(way, 0.0, 1.0) ** (1.0 / self.root)


@dataclass(frozen=True)
class _Grid:
    """Changes by one effect at the nodes of its parameters, at C operating points.

    ``nodes`` are places along ``lines``, one for each parameter. ``times`` of the flight in s and
    ``speeds`` in rad/s, (n1, n2, ..., C) each.
    """

    effect: Effect
    lines: tuple[_Line, ...]
    nodes: tuple[Array, ...]
    times: Array
    speeds: Array

    def at(self, values: Array) -> tuple[Array, Array]:
        """Return the changes at values (m, p), (C, m) each."""
        columns = zip(self.effect.parameters, self.lines, self.nodes, strict=True)
        smooth = [
            spline_weights(nodes, line.places(shares_below(p, values[:, k])), 3)
            for k, (p, line, nodes) in enumerate(columns)
        ]
        if not smooth:
            ones = np.ones((len(values), 1))
            return (ones * self.times).T, (ones * self.speeds).T
        return summed(smooth, self.times).T, summed(smooth, self.speeds).T


class _Flights:
    """Flights at some operating points, each simulated at its first use."""

    def __init__(self, settings: tuple[Setting, ...]) -> None:
        self.settings = settings
        self._times: dict[tuple[ForceProfile, object], float] = {}

    def touch(self, setting: Setting) -> float:
        """Compute when the ring touches, s from the start of the force."""
        key = setting.point.profile, (setting.clutch.dog.axial_gap, setting.clutch.rings.mass,
                                      setting.clutch.mechanism)  # fmt: skip
        if key not in self._times:
            self._times[key] = touch_time(setting)
        return self._times[key]

    @cached_property
    def still(self) -> Array:
        """Duration of the flight without any effect, s, (C,)."""
        return np.array([self.touch(one) for one in self.settings])

    def grid(self, effect: Effect) -> _Grid:
        """Let the ring fly with an effect at all nodes."""
        sizes = [NODES.get(len(effect.parameters), MANY)] * len(effect.parameters)
        nodes = tuple(np.linspace(0.0, 1.0, size) for size in sizes)
        alone = len(sizes) == 1
        lines = (self._line(effect),) if alone else (_Line(),) * len(sizes)
        flown = (line.shares(places) for line, places in zip(lines, nodes, strict=True))
        rows = [
            [self._changed(effect, shares, cell) for cell in range(len(self.settings))]
            for shares in itertools.product(*flown)
        ]
        times, speeds = np.moveaxis(filled(np.array(rows).reshape(*sizes, -1, 2)), -1, 0)
        return _Grid(effect, lines, nodes, times, speeds)

    def _line(self, effect: Effect) -> _Line:
        """Return the places of an effect's only parameter, over the part that is a bench."""
        (only,) = effect.parameters

        def there(share: float) -> bool:
            return effect.possible(self.settings[0], {only.name: only.at(share)})

        real = [s for s in np.linspace(0.0, 1.0, NODES[1]).tolist() if there(s)]
        for end, far in ((0.0, 1.0), (1.0, 0.0)):
            if not real or not there(far):
                continue
            if not there(end):
                gone, near = end, min(real, key=lambda share: abs(share - end))
                for _ in range(HALVINGS):
                    middle = 0.5 * (gone + near)
                    gone, near = (gone, middle) if there(middle) else (middle, near)
                return _Line(near, far, ROOT)
            later, _ = self._changed(effect, [end], 0)
            if self.still[0] + later < SHORT * self.still[0]:
                return _Line(end, far, ROOT)
        return _Line()

    def _changed(self, effect: Effect, shares: Sequence[float], cell: int) -> tuple[float, float]:
        """Compute the changes of a flight's time and of the speed; NaN where no such bench is."""
        setting = self.settings[cell]
        pairs = zip(effect.parameters, shares, strict=True)
        level = Level((effect.name,), tuple(p.at(float(s)) for p, s in pairs))
        try:
            changed = level.setting({effect.name: effect}, setting)
        except DogshapeError:
            return np.nan, np.nan
        moves = changes_flight(setting, changed)
        time = self.touch(changed) - self.still[cell] if moves else 0.0
        return time, changed.point.mismatch - setting.point.mismatch


# Emulators are built anew where a range is widened, and most of their effects stay.
@lru_cache(maxsize=4)
def _flights(settings: tuple[Setting, ...]) -> _Flights:
    return _Flights(settings)


@lru_cache(maxsize=128)
def _grid(effect: Effect, settings: tuple[Setting, ...]) -> _Grid:
    return _flights(settings).grid(effect)


class TouchPhases:
    """Phases at the first touch, in pitches; a flight is simulated at the first use."""

    def __init__(self, effects: Mapping[str, Effect], settings: Sequence[Setting]) -> None:
        self.effects, self.settings = effects, tuple(settings)
        self._pitch = np.array([one.clutch.dog.pitch_angle for one in settings])
        self._speed = np.array([one.point.mismatch for one in settings])
        self._grids: dict[str, _Grid] = {}

    @cached_property
    def _flights(self) -> _Flights:
        return _flights(self.settings)

    def of(self, setting: Setting) -> float:
        """Compute the phase of a bench at one operating point."""
        turned = setting.point.mismatch * self._flights.touch(setting)
        return turned / setting.clutch.dog.pitch_angle

    def at(self, parts: Mapping[str, Array], count: int) -> Array:
        """Predict the phases where effects have values (m, p) by name, (C, m).

        ``count`` is m.
        """
        time = np.tile(self._flights.still[:, None], count)
        speed = np.tile(self._speed[:, None], count)
        for name, values in parts.items():
            if name not in self._grids:
                self._grids[name] = _grid(self.effects[name], self.settings)
            later, faster = self._grids[name].at(values)
            time, speed = time + later, speed + faster
        phases: Array = time * speed / self._pitch[:, None]
        return phases
