"""An effect: physics that the simulation lacks, as a change of a setting.

Parameters have neutral values, with which the setting stays what it was. Their priors are
uniform in the value or in its logarithm. ``sim.effects`` has those of the package.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeVar, get_args

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import (
    DogshapeError,
    EffectError,
    InputError,
    did_you_mean,
    refusal,
    require_known,
)
from dogshape.sim.setting import Setting
from dogshape.sim.units import unit_of

Values = Mapping[str, float]  #: of an effect's parameters, by name, in the edge's units
Share = TypeVar("Share", float, Array)  #: one share of a range or its value, or (n,)

Scale = Literal["uniform", "log-uniform"]
SCALES: tuple[Scale, ...] = get_args(Scale)


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in the unit that its name ends in."""

    name: str  #: as files have it
    neutral: float | Callable[[Setting], float]  #: changes nothing, or says what does of a setting
    low: float  #: end of the prior's range
    high: float
    scale: Scale  #: what the prior is uniform in
    source: str = ""  #: of the range, in words, for the reader of the file
    least: float = -math.inf  #: below which no range can be widened: no shift mechanism lies there
    most: float = math.inf  #: the same above
    #: largest size of an ordinary source, and that source; None where no source has one
    ordinary: tuple[float, str] | None = None

    def __post_init__(self) -> None:
        require_known(f"scale of {self.name}", self.scale, "a scale", SCALES)
        least = 0.0 if self.scale == "log-uniform" else -math.inf
        if not least < self.low < self.high < math.inf:
            raise InputError(
                f"the range of {self.name} is {self.low:.6g} to {self.high:.6g}, but its prior is "
                f"{self.scale}; give finite ends in this order, positive ones for a logarithm"
            )

    def neutral_of(self, setting: Setting) -> float:
        """Return the value that changes nothing of a setting."""
        return self.neutral(setting) if callable(self.neutral) else self.neutral

    def at(self, share: Share) -> Share:
        """Compute the value below which a ``share`` in [0, 1] of the prior lies."""
        if self.scale == "uniform":
            return self.low + share * (self.high - self.low)
        return self.low * (self.high / self.low) ** share

    def share(self, value: Share) -> Share:
        """Compute the share of the prior below a value, in [0, 1]; the inverse of ``at``."""
        inside = np.clip(value, self.low, self.high)
        if self.scale == "uniform":
            return (inside - self.low) / (self.high - self.low)
        return np.log(inside / self.low) / np.log(self.high / self.low)

    def widened(self, share: float, *, upper: bool) -> Parameter:
        """Return the parameter with a range wider at one end by a ``share`` of its measure.

        It goes no farther than ``least`` and ``most``.
        """
        if upper:
            return replace(self, high=max(self.high, min(self.most, self.at(1.0 + share))))
        return replace(self, low=min(self.low, max(self.least, self.at(-share))))


@dataclass(frozen=True)
class BenchTest:
    """The measurement that would show an effect directly: short name and one sentence."""

    name: str
    how: str


@dataclass(frozen=True)
class Effect:
    """One physical mechanism that the simulation lacks or has wrong."""

    name: str  #: as files have it; that of its file
    parameters: tuple[Parameter, ...]  #: none for what is there or not, one or two
    #: makes a setting with it of one without, given a value for each parameter
    change: Callable[[Setting, Values], Setting]
    test: BenchTest  #: what would measure it directly
    aliases: tuple[str, ...] = ()  #: what no data of shifts can tell from it, in words
    title: str = ""  #: name for people; its name without underscores by default
    meaning: str = ""  #: in one line, for the reader of the file

    @property
    def plain(self) -> str:
        """Name for people."""
        return self.title or self.name.replace("_", " ")

    def apply(self, setting: Setting, values: Values) -> Setting:
        """Return the setting with the effect.

        Raises InputError where a value is missing, unknown, not finite or gives no such bench,
        GeometryError where it gives no such dog, EffectError where ``change`` cannot be run or
        gives no setting. The prior's range is no limit.
        """
        names = [parameter.name for parameter in self.parameters]
        for name in dict.fromkeys((*values, *names)):
            if name not in names:
                hint = did_you_mean(name, names)
                raise InputError(f"'{name}' is not a parameter of {self.name}; {hint}")
            if name not in values:
                raise InputError(f"{self.name} needs a value of '{name}'; give it")
            if not math.isfinite(values[name]):
                given, unit = f"{self.name}.{name}", unit_of(name)
                rule, remedy = "it must be finite", "correct the value"
                raise InputError(refusal(given, values[name], unit, rule, remedy))
        given = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
        try:
            changed: object = self.change(setting, values)
        except DogshapeError:
            raise
        except Exception as error:
            raise EffectError(
                f"change of the effect {self.name} cannot be run at {given} "
                f"({type(error).__name__}: {error}); correct it"
            ) from error
        if not isinstance(changed, Setting):
            kind = "None" if changed is None else f"a {type(changed).__name__}"
            raise EffectError(
                f"change of the effect {self.name} returns {kind}, but it must return a Setting; "
                "end it with, for instance, return setting.with_mechanism(...)"
            )
        return changed

    def neutral(self, setting: Setting) -> dict[str, float]:
        """Return the values that change nothing of a setting."""
        try:
            return {p.name: float(p.neutral_of(setting)) for p in self.parameters}
        except Exception as error:
            raise EffectError(
                f"a neutral value of the effect {self.name} is no number "
                f"({type(error).__name__}: {error}); correct it"
            ) from error

    def possible(self, setting: Setting, values: Values) -> bool:
        """Decide whether such a bench can exist; one of dynamic above static friction cannot."""
        try:
            self.apply(setting, values)
        except EffectError:
            raise
        except DogshapeError:
            return False
        return True

    def require_working(self, setting: Setting) -> None:
        """Raise EffectError where the effect cannot be run, or no value of its priors is a bench.

        Tried are the neutral values, and the ends and middles of the priors.
        """
        names = [p.name for p in self.parameters]
        ends = [[p.at(share) for share in (0.0, 0.5, 1.0)] for p in self.parameters]
        tried = [dict(zip(names, values, strict=True)) for values in itertools.product(*ends)]
        found = [self.possible(setting, values) for values in (self.neutral(setting), *tried)]
        if any(found):
            return
        try:
            self.apply(setting, self.neutral(setting))
        except DogshapeError as refused:
            raise EffectError(
                f"no value of the effect {self.name} gives a bench: {refused}"
            ) from refused
