r"""Effects together: their product, what pairs miss of it, and what joint levels say of the rest.

``diagnosis.prediction.combination`` has the product and the law by which pairs depart from it.
Where a pair, or three, were simulated together at more values than two, these joint levels
(``diagnosis.prediction.joint_levels``) correct it, and their error takes the place of the law's.
Pairs within three correct these too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import expit, logit

from dogshape.diagnosis.prediction.angle_means import (
    binned,
    engaged_count,
    engaged_mean,
    even_variance,
    residuals,
)
from dogshape.diagnosis.prediction.angle_profiles import AngleProfiles, Profiles
from dogshape.diagnosis.prediction.bank import Bank
from dogshape.diagnosis.prediction.combination import (
    FEW,
    LEAST,
    Emulated,
    Interactions,
    clipped_logit,
    log_mean,
    together,
)
from dogshape.diagnosis.prediction.joint_levels import JointLevels
from dogshape.diagnosis.prediction.level_fit import Alone, Fit
from dogshape.diagnosis.prediction.levels import TOGETHER, columns_of
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.terms import Array, Hypothesis

STATED = 0.03  #: least error of a combination that joint levels correct, of ln time
CLOSE = 0.25  #: distance from a neutral value below which a combination errs less


@dataclass(frozen=True)
class Combined:
    """Several effects together.

    ``common`` is the error of the mean's logarithm that all operating points share, (C, m);
    ``weights`` those of the joint levels of some of the effects, (C, m, L).
    """

    emulated: Emulated
    common: Array
    weights: Mapping[Hypothesis, Array]


@dataclass(frozen=True)
class _Joint:
    """Joint levels of some effects with their residuals beside the combination.

    ``odds`` are those of the share engaged, (C, L), ``shapes`` of the logarithm of the shape,
    (C, L, q); ``places`` are those of the levels in the bank. ``alone`` and ``weights`` say what
    was combined there without them.
    """

    levels: JointLevels
    odds: Array
    shapes: Array
    places: tuple[int, ...]
    alone: Mapping[str, Alone]
    weights: Mapping[Hypothesis, Array]


class Combination:
    """Combination of the effects of a bank."""

    def __init__(self, bank: Bank, base: Emulated, fits: Mapping[str, Fit]) -> None:
        self.bank, self.base, self.fits = bank, base, fits
        self.interactions = Interactions.of(bank)
        self._joints: dict[Hypothesis, _Joint | None] = {}
        self._left: dict[Hypothesis, Profiles] = {}

    def at(self, alone: Mapping[str, Alone]) -> Combined:
        """Combine effects that are emulated alone."""
        names = tuple(sorted(alone))
        every = [s for n in range(2, len(names) + 1) for s in combinations(names, n)]
        return self._combined(alone, {s: found for s in every if (found := self._joint(s))})

    def _combined(
        self, alone: Mapping[str, Alone], joints: Mapping[Hypothesis, _Joint]
    ) -> Combined:
        """Correct the product by the laws of pairs, and by joint levels of some."""
        whole = together(
            self.base,
            [one.emulated for one in alone.values()],
            [one.change for one in alone.values()],
        )
        changes = self._changes(alone)
        moved, common, own = np.zeros((3, 1, 1))
        weights: dict[Hypothesis, Array] = {}
        for pair in combinations(sorted(alone), 2):
            joint = joints.get(pair)
            law = self.interactions.missed(pair, changes)
            moved = moved + law.moved
            if joint is None:
                common, own = common + law.common, own + law.own**2
                continue
            stated = self._stated(alone, changes, pair)
            weights[pair], left = joint.levels.weights(_places(alone, pair), stated)
            own = own + left
        for several in (s for s in joints if len(s) > 2):
            stated = self._stated(alone, changes, several)
            weights[several], own = joints[several].levels.weights(_places(alone, several), stated)
            common = np.zeros_like(common)
        whole = replace(
            whole,
            times=whole.times * np.exp(moved)[..., None],
            variance=whole.variance + own,
        )
        for some, mine in weights.items():
            whole = _moved(whole, joints[some], mine)
        return Combined(whole, common, weights)

    def _changes(self, alone: Mapping[str, Alone]) -> dict[str, Array]:
        """Compute by how much each effect alone changes the logarithm of the mean, (C, m)."""
        start = log_mean(self.base)
        return {name: log_mean(one.emulated) - start for name, one in alone.items()}

    def _stated(
        self, alone: Mapping[str, Alone], changes: Mapping[str, Array], some: Hypothesis
    ) -> Array:
        """Compute the error that some effects' combination has before joint levels, (C, m).

        That of the laws of pairs, at least ``STATED``; nothing where an effect is neutral.
        """
        least = np.full((1, 1), STATED)
        for name in some:
            apart = np.abs(alone[name].places - alone[name].neutral[:, None]).max(axis=-1)
            least = least * np.minimum(1.0, apart / CLOSE)
        laws = [self.interactions.missed(pair, changes, FEW) for pair in combinations(some, 2)]
        squares = sum((law.common**2 + law.own**2 for law in laws), start=least**2)
        return np.asarray(np.sqrt(squares))

    def _joint(self, some: Hypothesis) -> _Joint | None:
        """Compare joint levels of effects with the combination without them."""
        if some not in self._joints:
            places = tuple(self.bank.of(some))
            enough = len(TOGETHER) + 1 if len(some) == 2 else 1
            self._joints[some] = self._compared(some, places) if len(places) >= enough else None
        return self._joints[some]

    def _compared(self, some: Hypothesis, places: tuple[int, ...]) -> _Joint:
        values = np.array([self.bank.levels[k].values for k in places])
        columns = columns_of(some, {name: self.fits[name].effect for name in some})
        alone = {name: self.fits[name].at(values[:, mine]) for name, mine in columns.items()}
        smaller = [s for n in range(2, len(some)) for s in combinations(some, n)]
        known = {s: found for s in smaller if (found := self._joint(s))}
        without = self._combined(alone, known)
        combined = without.emulated
        times = bulk(self.bank.times[list(places)]).transpose(1, 0, 2)
        levels = JointLevels(
            _places(alone, some),
            self._stated(alone, self._changes(alone), some),
            np.log(engaged_mean(times)) - log_mean(combined),
            np.sqrt(even_variance(residuals(times))) + LEAST,
            np.concatenate([self.fits[name].curves.lengths for name in some]),
        )
        rest = _rest(self.bank.times[list(places)], times, combined)
        return _Joint(levels, *rest, places, alone, without.weights)

    def profiles(
        self,
        alone: Mapping[str, Alone],
        weights: Mapping[Hypothesis, Array],
        laid: AngleProfiles,
    ) -> Profiles:
        """Mix profiles over the angle at the first touch, corrected by those of joint levels.

        ``weights`` are those of joint levels in what is emulated.
        """
        mixed = laid.mixed(alone)
        for some, mine in weights.items():
            mixed = mixed.corrected(mine, self._left_of(some, laid))
        return mixed

    def _left_of(self, some: Hypothesis, laid: AngleProfiles) -> Profiles:
        """Subtract from joint levels' profiles those that are mixed without them."""
        if some not in self._left:
            joint = self._joint(some)
            assert joint is not None
            alone, weights = joint.alone, joint.weights
            mixed = self.profiles(alone, weights, laid)
            mine = laid.of(joint.places)
            self._left[some] = Profiles(mine.logs - mixed.logs, mine.engaged - mixed.engaged)
        return self._left[some]


def _places(alone: Mapping[str, Alone], some: Hypothesis) -> Array:
    """Return the coordinates of some effects together, (C, m, d)."""
    return np.concatenate([alone[name].places for name in some], axis=-1)


def _rest(whole: Array, times: Array, combined: Emulated) -> tuple[Array, Array]:
    """Return residuals of odds to engage (C, L) and of logarithms of shapes (C, L, q)."""
    engaged, known = (one.T for one in engaged_count(whole))
    share = (engaged + 0.5) / (known + 1.0)
    expected = (combined.engaged * known + 0.5) / (known + 1.0)
    count = combined.times.shape[-1]
    shapes = np.array([[binned(t, count)[0] for t in mine] for mine in times])
    shapes /= shapes.mean(axis=-1, keepdims=True)
    plain = combined.times / combined.times.mean(axis=-1, keepdims=True)
    odds = logit(share) - logit(expected)
    return odds, np.nan_to_num(np.log(shapes) - np.log(plain))


def _moved(whole: Emulated, joint: _Joint, weights: Array) -> Emulated:
    """Correct emulated times by the residuals of joint levels."""
    residual = np.nan_to_num(joint.levels.residual)
    mean = whole.times.mean(axis=-1) * np.exp((weights @ residual[..., None])[..., 0])
    times = np.sort(whole.times * np.exp(weights @ joint.shapes), axis=-1)
    times *= (mean / times.mean(axis=-1))[..., None]
    odds = (weights @ joint.odds[..., None])[..., 0]
    return replace(whole, times=times, engaged=expit(clipped_logit(whole.engaged) + odds))
