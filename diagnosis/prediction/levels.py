r"""Levels of an effect that are simulated, and the coordinates of its values on a curve.

A coordinate *x* runs from 0 to 1 over the prior. It is the share of the prior, except where the
prior is uniform in the logarithm and the neutral value is 0: there
:math:`x = \ln(1 + v/v_{low}) / \ln(1 + v_{high}/v_{low})`, which is 0 at the neutral value, so that
the baseline is a level like any other. A second parameter that changes nothing while the first is
neutral (where a detent of no force stands) is spread by what the first departs from neutral: all
its values meet in one place there. An effect without parameters lies at 1, the baseline at 0.

Levels of one parameter are even in the share of the prior, ends included (of that part of it of
which there is such a bench), without the one beside the neutral value if that lies within: the
baseline stands there. Those of two parameters fill
their plane: each next one is the candidate farthest from all before it, baseline included.

A range that was widened keeps the levels that it had. Those of one parameter go on at the same
spacing where values were added, those of two become as many more as the plane has grown by.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.setting import Setting

Array = NDArray[np.float64]
CANDIDATES = 6  #: two to this power are the places from which a plane is filled
TICKS = np.linspace(0.0, 1.0, 41)  #: shares of the prior, of which the ends give a bench
TOGETHER = (0.7, 0.4)  #: shares of the prior near which two effects are simulated together


@dataclass(frozen=True)
class Level:
    """A hypothesis with values of all its parameters, effect by effect: one bench to simulate."""

    hypothesis: Hypothesis
    values: tuple[float, ...] = ()

    def setting(self, effects: Mapping[str, Effect], baseline: Setting) -> Setting:
        """Return the bench with these effects; InputError where there is none such."""
        setting = baseline
        for name, columns in columns_of(self.hypothesis, effects).items():
            names = [parameter.name for parameter in effects[name].parameters]
            setting = effects[name].apply(
                setting, dict(zip(names, self.values[columns], strict=True))
            )
        return setting


def columns_of(hypothesis: Hypothesis, effects: Mapping[str, Effect]) -> dict[str, slice]:
    """Find the columns of each effect's parameters among a hypothesis' values, effect by effect."""
    found, start = {}, 0
    for name in hypothesis:
        found[name] = slice(start, start + len(effects[name].parameters))
        start = found[name].stop
    return found


def only_read(effect: Effect, setting: Setting) -> bool:
    """Test that an effect only changes the reading of a shift, so that none is simulated."""
    ends = (Level((effect.name,), tuple(p.at(s) for p in effect.parameters)) for s in (0.3, 0.9))
    changed = [level.setting({effect.name: effect}, setting) for level in ends]
    return all((one.clutch, one.point) == (setting.clutch, setting.point) for one in changed)


def levels_of(effect: Effect, setting: Setting, along: int, plane: int) -> tuple[Level, ...]:
    """Return the levels of an effect that are simulated, without those of which no bench is.

    Parameters
    ----------
    along : number of levels of one parameter; one less where the neutral value lies within.
    plane : number of levels of two parameters.
    """
    name = effect.name
    if not effect.parameters:
        return (Level((name,)),) if effect.possible(setting, {}) else ()
    if len(effect.parameters) == 1:
        return tuple(Level((name,), (value,)) for value in _line(effect, setting, along))
    return tuple(Level((name,), values) for values in _plane(effect, setting, plane))


def check_level(
    hypothesis: Hypothesis, levels: Mapping[str, Sequence[Level]], share: float = TOGETHER[0]
) -> Level:
    """Return a level of some effects together, each at one of its own ``levels``.

    Of one parameter at the level nearest to ``share`` of the way; of two at the second, a corner of
    their plane, for the largest share, else in the middle of what fills the plane.
    """
    chosen = []
    for name in hypothesis:
        mine = levels[name]
        if len(mine[0].values) <= 1:
            place = round(share * (len(mine) - 1))
        else:
            place = 1 if share == TOGETHER[0] else len(mine) // 2
        chosen.append(mine[place])
    return Level(hypothesis, tuple(value for one in chosen for value in one.values))


def _but_neutral(shares: Array, parameter: Parameter, neutral: float) -> Array:
    """Return shares without the one beside the neutral value, where that lies within."""
    if not parameter.low <= neutral <= parameter.high:
        return shares
    return np.delete(shares, int(np.argmin(abs(shares - parameter.share(neutral)))))


def _line(effect: Effect, setting: Setting, count: int) -> list[float]:
    """Return the values of one parameter that are simulated, ascending."""
    (only,) = effect.parameters
    real = [s for s in TICKS if effect.possible(setting, {only.name: only.at(float(s))})]
    if not real:
        return []
    kept = _line(effect.before, setting, count) if effect.before else []
    if not kept or effect.before is None:
        even = np.linspace(real[0], real[-1], count)
        shares = _but_neutral(even, only, only.neutral_of(setting))
        return [only.at(float(share)) for share in shares]
    (first,), (last,) = effect.usual.parameters, effect.before.parameters
    spacing = (only.share(first.high) - only.share(first.low)) / (count - 1)
    near, end = (kept[-1], real[-1]) if only.high > last.high else (kept[0], real[0])
    steps = math.ceil(round(abs(end - only.share(near)) / spacing, 6))
    added = np.linspace(only.share(near), end, steps + 1)[1:]
    neutral = only.neutral_of(setting)
    if not last.low <= neutral <= last.high:
        # The baseline stands for a level beside it, but not for the end of what was added.
        inner = _but_neutral(added, only, neutral)
        added = inner if end in inner or only.at(end) == neutral else added
    return sorted([*kept, *(only.at(float(share)) for share in added)])


def _plane(effect: Effect, setting: Setting, count: int) -> list[tuple[float, ...]]:
    """Return the values of several parameters that are simulated."""
    kept = _plane(effect.before, setting, count) if effect.before else []
    size = len(effect.parameters)
    corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * size), axis=-1).reshape(-1, size)
    inner = qmc.Sobol(size, scramble=False).random_base2(CANDIDATES)
    names = [parameter.name for parameter in effect.parameters]
    found = [
        tuple(p.at(float(s)) for p, s in zip(effect.parameters, shares, strict=True))
        for shares in np.concatenate([corners, inner])
    ]
    real = [v for v in found if effect.possible(setting, dict(zip(names, v, strict=True)))]
    axes = Axes.of(effect, setting)
    begin = axes.at(np.array([axes.neutral_values, *kept]))
    first = zip(effect.parameters, effect.usual.parameters, strict=True)
    share = np.prod([p.share(usual.high) - p.share(usual.low) for p, usual in first])
    more = round(count / float(share)) - len(kept)
    every = [*kept, *(real[k] for k in farthest(axes.at(np.array(real)), begin, more))]
    # In the order in which they fill the plane as it is now, from which places are chosen.
    order = farthest(axes.at(np.array(every)), axes.neutral, len(every))
    return [every[k] for k in order]


def farthest(places: Array, begin: Array, count: int) -> list[int]:
    """Choose up to ``count`` places (m, d), each farthest from ``begin`` and all before.

    ``begin`` is one place (d,) or several (k, d). None is chosen where another already lies.
    """
    chosen = list[int]()
    near = np.linalg.norm(places[:, None] - np.atleast_2d(begin), axis=2).min(axis=1)
    while len(chosen) < count and near.any():
        far = int(near.argmax())
        chosen.append(far)
        near = np.minimum(near, np.linalg.norm(places - places[far], axis=1))
    return chosen


@dataclass(frozen=True)
class Axes:
    """Coordinates of an effect's values at one operating point.

    ``low`` and ``high`` are ends of the prior, ``neutral_values`` the neutral values, each (p,),
    ``logarithms`` 0 for the value, 1 for its logarithm, 2 for that of one more; ``dependent`` is
    the place of a parameter that changes nothing while the other is neutral, or None.
    """

    low: Array
    high: Array
    neutral_values: Array
    logarithms: NDArray[np.int64]
    dependent: int | None

    @classmethod
    def of(cls, effect: Effect, setting: Setting) -> Axes:
        """Return the coordinates of an effect in a setting without it."""
        if not effect.parameters:
            return cls(np.zeros(1), np.ones(1), np.zeros(1), np.zeros(1, dtype=np.int64), None)
        neutral = effect.neutral(setting)
        kinds = [_kind(p, neutral[p.name]) for p in effect.parameters]
        axes = cls(
            np.array([p.low for p in effect.parameters]),
            np.array([p.high for p in effect.parameters]),
            np.array(list(neutral.values())),
            np.array(kinds),
            None,
        )
        idle = [k for k, p in enumerate(effect.parameters) if _idle(effect, setting, p)]
        return replace(axes, dependent=idle[0]) if len(idle) == 1 and len(kinds) == 2 else axes

    def at(self, values: Array) -> Array:
        """Return the coordinates of values (m, p), (m, p); 1 (m, 1) of an effect without any."""
        if values.shape[1] == 0:
            return np.ones((len(values), 1))
        places = self._shares(values)
        if self.dependent is not None:
            first = 1 - self.dependent
            apart = places[:, first] - self._shares(self.neutral_values[None])[0, first]
            places[:, self.dependent] = (places[:, self.dependent] - 0.5) * apart
        return places

    def same(self, other: Axes) -> bool:
        """Test that all values have the same coordinates by other axes."""
        mine, theirs = vars(self), vars(other)
        return all(np.array_equal(mine[name], theirs[name]) for name in mine)

    @property
    def neutral(self) -> Array:
        """Coordinates of the neutral values, (p,)."""
        return self.at(self.neutral_values[None])[0]

    def _shares(self, values: Array) -> Array:
        low, high = self.low, self.high
        places = (values - low) / (high - low)
        for k, kind in enumerate(self.logarithms):
            if kind:
                more = 1.0 if kind == 2 else 0.0
                ratio = np.maximum(more + values[:, k] / low[k], 1e-3)
                bottom = np.log(more + 1.0) if kind == 1 else 0.0
                top = np.log(more + high[k] / low[k])
                places[:, k] = (np.log(ratio) - bottom) / (top - bottom)
        return places


def _kind(parameter: Parameter, neutral: float) -> int:
    if parameter.scale == "uniform":
        return 0
    return 1 if neutral > 0.0 else 2


def _idle(effect: Effect, setting: Setting, parameter: Parameter) -> bool:
    """Test that a parameter changes nothing while the others are neutral."""
    neutral = effect.neutral(setting)
    tried = [{**neutral, parameter.name: value} for value in (parameter.low, parameter.high)]
    return all(
        effect.possible(setting, values) and effect.apply(setting, values) == setting
        for values in tried
    )
