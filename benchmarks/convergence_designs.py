"""Numerical error of shifts of designs drawn all over the space, at both signs of mismatch.

    python -m benchmarks.convergence_designs

Designs fill the feasible space of the paper's study (``pipeline.train.filling``); each is simulated
at one operating point of either sign, eight even angles each, at the default accuracy and at 1e-5
with half the largest step. A shift *flips* where only one of the two engages or where their times
differ by more than 5 %: a dog caught another slot or was thrown back once more. Counting slots and
landings would not do: a touch of a hair's breadth counts or does not and moves no time. The rest is
the error of shifts that went the same way. Intervals hold 95 %: those of rates after Clopper and
Pearson, all others from designs drawn again with replacement. Takes about ten minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from benchmarks.common import measure, paper_study
from benchmarks.convergence import REFERENCE, with_accuracy
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.train.filling import filling_designs
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.units import RPM

SEED = 2024
DESIGNS = 40
ANGLES = 8
RESAMPLED = 2000
JUMP = 0.05  #: relative difference of two times from which a shift flipped
SLOW, FAST = 50.0, 149.0  #: 1/min, ends of the classes of mismatch

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Pair:
    """Shifts of one design at one point: times in s by default and fine accuracy, each (n,).

    NaN where a shift did not engage.
    """

    design: dict[str, float]
    point: OperatingPoint
    times: Values
    reference: Values

    @cached_property
    def both(self) -> Flags:
        """Which shifts engaged with both accuracies, (n,)."""
        flags: Flags = np.isfinite(self.times) & np.isfinite(self.reference)
        return flags

    @cached_property
    def flipped(self) -> Flags:
        """Which shifts flipped, (n,)."""
        one = np.isfinite(self.times) != np.isfinite(self.reference)
        flags: Flags = one | (self.both & (np.abs(self.times / self.reference - 1.0) > JUMP))
        return flags

    @cached_property
    def errors(self) -> Values:
        """Relative errors of the shifts that went the same way, percent."""
        kept = self.both & ~self.flipped
        return 100.0 * np.abs(self.times[kept] / self.reference[kept] - 1.0)

    @cached_property
    def error(self) -> float:
        """Relative error of the mean with its sign, percent, over shifts that engaged in both."""
        return self._error(self.both)

    @cached_property
    def smooth_error(self) -> float:
        """The same without shifts that flipped."""
        return self._error(self.both & ~self.flipped)

    def _error(self, kept: Flags) -> float:
        return 100.0 * float(self.times[kept].mean() / self.reference[kept].mean() - 1.0)


def pairs(study: Setup, designs: int, angles: int, seed: int = SEED) -> list[Pair]:
    """Simulate ``designs`` designs at one point of either sign, with both accuracies."""
    made, draw = [], np.random.default_rng(seed)
    for index, design in zip(
        range(designs), filling_designs(study, seed, border=False), strict=False
    ):
        clutch = study.clutch.with_dog(study.dog_with(design))
        plants = ClutchPlant(clutch), ClutchPlant(with_accuracy(clutch, REFERENCE))
        for sign in (1.0, -1.0):
            mismatch = sign * draw.choice(study.mismatches)
            force = draw.choice(study.forces)
            profile = next(p.profile for p in study.points if p.profile.force == force)
            point = OperatingPoint(mismatch * RPM, profile)
            block = even_block(clutch, point, angles, (seed, 2 * index + int(sign < 0)))
            default, fine = (measure(plant, point, block.angles).times for plant in plants)
            made.append(Pair(design, point, default, fine))
    return made


def rate(hits: int, of: int) -> str:
    """Return a share in percent with its exact interval."""
    low = beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0
    share = hits / of if of else 0.0
    return f"{hits:4d} of {of:5d}, {100 * share:5.2f} % ({100 * low:.2f} to {100 * high:.2f})"


def interval(made: Sequence[Pair], number: Callable[[Sequence[Pair]], float]) -> str:
    """Return a number over pairs with its interval from designs drawn again."""
    draw = np.random.default_rng(1)
    groups: dict[tuple[float, ...], list[Pair]] = {}
    for pair in made:
        groups.setdefault(tuple(pair.design.values()), []).append(pair)
    each = list(groups.values())
    again = [
        number([p for k in draw.integers(len(each), size=len(each)) for p in each[k]])
        for _ in range(RESAMPLED)
    ]
    low, high = np.quantile(again, [0.025, 0.975])
    return f"{number(made):9.4f} ({low:.4f} to {high:.4f})"


def single(made: Sequence[Pair], share: float) -> float:
    """Return a quantile of the errors of shifts that went the same way, percent."""
    return float(np.quantile(np.concatenate([p.errors for p in made]), share))


def of_means(made: Sequence[Pair], share: float, *, smooth: bool) -> float:
    """Return a quantile of the errors of means, percent."""
    return float(np.quantile([abs(p.smooth_error if smooth else p.error) for p in made], share))


def summary(made: Sequence[Pair]) -> None:
    """Print how often shifts flip, and how large errors are with and without them."""
    print("shifts that flip, by mismatch")
    for sign, name in ((1.0, "positive"), (-1.0, "negative")):
        mine = [p for p in made if sign * p.point.mismatch > 0.0]
        for low, high in ((0.0, SLOW), (SLOW, FAST), (FAST, np.inf)):
            some = [p for p in mine if low < round(abs(p.point.mismatch) / RPM, 6) <= high]
            count = sum(p.times.size for p in some)
            words = f"{low:.0f} to {high:.0f} 1/min" if high < np.inf else f"above {low:.0f} 1/min"
            print(f"  {name}, {words:<20} {rate(sum(int(p.flipped.sum()) for p in some), count)}")
    print(f"  all {'':<27} {rate(_flips(made), sum(p.times.size for p in made))}")
    print(f"  means with one or more {'':<8} {rate(sum(p.flipped.any() for p in made), len(made))}")
    errors = np.concatenate([p.errors for p in made])
    beyond = int((errors > 0.5).sum())
    print(f"  no flip, but 0.5 to 5 % off {'':<3} {rate(beyond, errors.size)}")
    print("\nerror, %, with its interval")
    print(f"  single shift, no flip: median        {interval(made, lambda m: single(m, 0.5))}")
    print(f"  single shift, no flip: 99 % below    {interval(made, lambda m: single(m, 0.99))}")
    for smooth, name in ((True, "without flips"), (False, "all shifts")):
        for share, text in ((0.5, "median"), (0.95, "95 % below"), (1.0, "largest")):
            words = f"mean of {ANGLES}, {name}: {text}"

            def number(m: Sequence[Pair], s: float = share, without: bool = smooth) -> float:
                return of_means(m, s, smooth=without)

            print(f"  {words:<36} {interval(made, number)}")
    signed = interval(made, lambda m: float(np.mean([p.error for p in m])))
    print(f"  {'all means together, with sign':<36} {signed}")


def _flips(made: Sequence[Pair]) -> int:
    return sum(int(p.flipped.sum()) for p in made)


def worst(made: Sequence[Pair], count: int = 8) -> None:
    """Print the means that err most."""
    print(f"\nthe {count} means that err most")
    print(f"{'a':>6} {'b':>6} {'g':>6} {'h':>6} {'N':>3} {'1/min':>6} {'N':>6} {'ms':>7} "
          f"{'error, %':>9} {'flips':>5} {'without, %':>10}")  # fmt: skip
    for p in sorted(made, key=lambda p: -abs(p.error))[:count]:
        a, b, g, h, n = p.design.values()
        print(
            f"{a:6.2f} {b:6.2f} {g:6.2f} {h:6.3f} {n:3.0f} {p.point.mismatch / RPM:6.0f} "
            f"{p.point.profile.force:6.1f} {1e3 * np.nanmean(p.reference):7.2f} {p.error:9.4f} "
            f"{int(p.flipped.sum()):5d} {p.smooth_error:10.4f}"
        )


if __name__ == "__main__":
    drawn = pairs(paper_study(), DESIGNS, ANGLES)
    print(f"{DESIGNS} designs, a point of either sign, {ANGLES} angles; accuracy 3e-4 and 1e-5")
    summary(drawn)
    worst(drawn)
