"""An effect: physics that the simulation lacks, as a change of a setting.

Neutral values of its parameters leave the setting unchanged. Priors are uniform in the value or in
its logarithm. ``sim.effects`` has the effects of the package.
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
    Refusal,
    did_you_mean,
    require_known,
)
from dogshape.sim.setting import Setting
from dogshape.sim.units import unit_of

Values = Mapping[str, float]  #: of an effect's parameters, by name, in the edge's units
Share = TypeVar("Share", float, Array)  #: one share of a range or its value, or (n,)

Scale = Literal["uniform", "log-uniform"]
SCALES: tuple[Scale, ...] = get_args(Scale)

UNSTATED_RELATIVE_ERROR = 0.05  #: of a value, by an instrument that a test does not state
UNSTATED_RANGE_ERROR = 0.02  #: of the prior's range, the same


@dataclass(frozen=True)
class Ordinary:
    """Range of a parameter by an ordinary source; a size outside it needs another explanation."""

    source: str
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in the unit that its name ends in."""

    name: str  #: in files, with the unit at its end
    neutral: float | Callable[[Setting], float]  #: value without effect; by setting
    low: float  #: end of the prior's range
    high: float
    scale: Scale  #: scale on which the prior is uniform
    source: str = ""  #: source of the range, for the reader of the file
    least: float = -math.inf  #: smallest possible value, to which the range can be widened
    most: float = math.inf  #: largest possible value
    ordinary: Ordinary | None = None  #: None for a place or a phase, of which none is ordinary

    def __post_init__(self) -> None:
        require_known(f"scale of {self.name}", self.scale, "a scale", SCALES)
        minimum = 0.0 if self.scale == "log-uniform" else -math.inf
        if not minimum < self.low < self.high < math.inf:
            raise InputError(
                f"the range of {self.name} is {self.low:.6g} to {self.high:.6g}, but its prior is "
                f"{self.scale}; give finite ends in this order, positive ones for a logarithm"
            )

    def neutral_of(self, setting: Setting) -> float:
        """Return the value at which the effect leaves ``setting`` unchanged."""
        return self.neutral(setting) if callable(self.neutral) else self.neutral

    def at(self, share: Share) -> Share:
        """Compute the quantile of the prior at ``share`` in [0, 1]."""
        if self.scale == "uniform":
            return self.low + share * (self.high - self.low)
        return self.low * (self.high / self.low) ** share

    def share(self, value: Share) -> Share:
        """Compute the prior's cumulative probability of ``value``, in [0, 1]; inverse of ``at``."""
        clipped = np.clip(value, self.low, self.high)
        if self.scale == "uniform":
            return (clipped - self.low) / (self.high - self.low)
        return np.log(clipped / self.low) / np.log(self.high / self.low)

    def widened(self, share: float, *, upper: bool) -> Parameter:
        """Return the parameter with its range widened at one end by ``share`` of its width.

        The width is that on the prior's scale; ``least`` and ``most`` limit the range.
        """
        if upper:
            return replace(self, high=max(self.high, min(self.most, self.at(1.0 + share))))
        return replace(self, low=min(self.low, max(self.least, self.at(-share))))


@dataclass(frozen=True)
class InstrumentError:
    """Standard error with which a bench test reads a parameter, by its instrument."""

    parameter: str  #: name of the parameter, with its unit
    relative: float  #: of the value
    absolute: float  #: in the parameter's unit, above 0
    source: str  #: of both numbers

    def __post_init__(self) -> None:
        if not (0.0 <= self.relative < math.inf and 0.0 < self.absolute < math.inf):
            quantity = f"instrument error of {self.parameter}"
            rule = "the absolute part must be above 0, the relative part must not be negative"
            remedy = f"correct it; the relative part is {self.relative:.6g}"
            unit = unit_of(self.parameter)
            raise InputError(Refusal(quantity, self.absolute, unit, rule=rule, remedy=remedy))

    def at(self, value: Share) -> Share:
        """Compute the standard error of the reading of a value, in the parameter's unit."""
        return np.hypot(self.absolute, self.relative * value)


@dataclass(frozen=True)
class BenchTest:
    """The measurement that would show an effect directly."""

    name: str
    how: str  #: instruction in one sentence
    errors: tuple[InstrumentError, ...] = ()  #: of the effect's parameters


@dataclass(frozen=True)
class Effect:
    """One physical mechanism that the simulation lacks or has wrong."""

    name: str  #: in files; also the name of its own file
    parameters: tuple[Parameter, ...]  #: two at most; none for an effect that is present or absent
    #: adds the effect to a setting, with a value for each parameter
    change: Callable[[Setting, Values], Setting]
    test: BenchTest  #: measures the effect directly
    aliases: tuple[str, ...] = ()  #: causes that no data of shifts can tell from it, in words
    title: str = ""  #: displayed name; by default the name without underscores
    meaning: str = ""  #: in one line, for the reader of the file

    def __post_init__(self) -> None:
        names = [parameter.name for parameter in self.parameters]
        for error in self.test.errors:
            label = f"instrument error of {self.name}"
            require_known(label, error.parameter, "a parameter of the effect", names)

    @property
    def plain(self) -> str:
        """Displayed name."""
        return self.title or self.name.replace("_", " ")

    def instrument_error(self, parameter: Parameter) -> InstrumentError:
        """Return the error with which the effect's test reads a parameter.

        A test that states none reads to 5 % of the value and 2 % of the range.
        """
        for error in self.test.errors:
            if error.parameter == parameter.name:
                return error
        absolute = UNSTATED_RANGE_ERROR * (parameter.high - parameter.low)
        source = "assumption: instrument of a workshop"
        return InstrumentError(parameter.name, UNSTATED_RELATIVE_ERROR, absolute, source)

    def apply(self, setting: Setting, values: Values) -> Setting:
        """Return the setting with the effect.

        Raises InputError for a missing, unknown or infinite value or an impossible bench,
        GeometryError for an impossible dog, EffectError if ``change`` fails or returns no setting.
        Values may lie beyond the range of the prior.
        """
        self._require_values(values)
        try:
            result: object = self.change(setting, values)
        except DogshapeError:
            raise
        except Exception as error:
            place = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
            raise EffectError(
                f"change of the effect {self.name} cannot be run at {place} "
                f"({type(error).__name__}: {error}); correct it"
            ) from error
        if not isinstance(result, Setting):
            kind = "None" if result is None else f"a {type(result).__name__}"
            raise EffectError(
                f"change of the effect {self.name} returns {kind}, but it must return a Setting; "
                "end it with, for instance, return setting.with_mechanism(...)"
            )
        return result

    def _require_values(self, values: Values) -> None:
        """Raise InputError unless ``values`` has a finite number for each parameter alone."""
        names = [parameter.name for parameter in self.parameters]
        for name in dict.fromkeys((*values, *names)):
            if name not in names:
                hint = did_you_mean(name, names)
                raise InputError(f"'{name}' is not a parameter of {self.name}; {hint}")
            if name not in values:
                raise InputError(f"{self.name} needs a value of '{name}'; give it")
            if not math.isfinite(values[name]):
                quantity = f"{self.name}.{name}"
                rule = "it must be finite"
                sentence = Refusal(
                    quantity, values[name], unit_of(name), rule=rule, remedy="correct the value"
                )
                raise InputError(sentence)

    def neutral(self, setting: Setting) -> dict[str, float]:
        """Return the parameter values at which the effect leaves ``setting`` unchanged."""
        try:
            return {p.name: float(p.neutral_of(setting)) for p in self.parameters}
        except Exception as error:
            raise EffectError(
                f"a neutral value of the effect {self.name} is no number "
                f"({type(error).__name__}: {error}); correct it"
            ) from error

    def possible(self, setting: Setting, values: Values) -> bool:
        """Test whether the effect with ``values`` gives a bench that can exist.

        EffectError for an effect that fails otherwise.
        """
        try:
            self.apply(setting, values)
        except EffectError:
            raise
        except DogshapeError:
            return False
        return True

    def require_working(self, setting: Setting) -> None:
        """Raise EffectError if the effect cannot be run or gives no bench anywhere in its priors.

        Tests the neutral values, and all ends and middles of the priors.
        """
        names = [p.name for p in self.parameters]
        levels = [[p.at(share) for share in (0.0, 0.5, 1.0)] for p in self.parameters]
        combinations = itertools.product(*levels)
        neutral = self.neutral(setting)
        trials = [neutral, *(dict(zip(names, values, strict=True)) for values in combinations)]
        # All of them, so that a program that fails somewhere is an error here.
        results = [self.possible(setting, trial) for trial in trials]
        if any(results):
            return
        try:
            self.apply(setting, neutral)
        except DogshapeError as refused:
            raise EffectError(
                f"no value of the effect {self.name} gives a bench: {refused}"
            ) from refused
