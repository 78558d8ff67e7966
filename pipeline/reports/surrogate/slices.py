"""Slices: the expected time while one variable moves and all others stay."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.maps import thinned
from dogshape.pipeline.reports.surrogate.operating_choices import (
    Operating,
    middle,
    operating_inputs,
)
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.train.design_verdicts import verdicts
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import ask, faces_hold, in_range, time_record
from dogshape.surrogate.sobol_indices import LOG, Input
from dogshape.surrogate.time_curves import Curve, at_points, over_designs

VALUES = 41  #: of each variable
NOTHING = Curve(np.zeros(0), np.zeros(0), np.zeros(0))  #: where no design has an estimate
RIVALS = 12  #: designs of the front beside the study's own, at most


@dataclass(frozen=True)
class Base:
    """A design that slices go through, in edge units, with its name."""

    name: str
    design: dict[str, float]


def bases_of(study: Setup, result: Row | None) -> list[Base]:
    """List the study's own design and some of the front that a search of it found.

    ``result`` is the search's, None where there is none; one of other physics counts as none.
    """
    own = Base("the study's own design", study.prototype)
    return [own, *thinned(rivals_of(study, result), RIVALS)]


def rivals_of(study: Setup, result: Row | None) -> list[Base]:
    """List all designs of the front but the study's own; none of other physics."""
    if result is None or result.get("physics_hash") != study.physics_hash:
        return []
    front = [
        (row["trial"], {name: row[name] for name in study.variables}) for row in result["front"]
    ]
    return [Base(f"design {trial}", found) for trial, found in front if found != study.prototype]


def slices_record(
    study: Setup, surrogate: Surrogate, overs: list[tuple[Operating, Over]], bases: list[Base]
) -> list[Row]:
    """Record the slices through each base at each choice of operating points."""
    cuts = [_Cut(study, surrogate, base) for base in bases]
    return [cut.record() | {"operating": [cut.choice(*one) for one in overs]} for cut in cuts]


def rounded(values: Iterable[float]) -> list[float]:
    """Round numbers to six digits for JSON."""
    return [float(f"{value:.6g}") for value in values]


@dataclass(frozen=True)
class _Cut:
    """A base with the designs along each variable, over the simulated part of its range.

    Designs whose faces hold by friction have no estimate and are left out.
    """

    study: Setup
    surrogate: Surrogate
    base: Base

    @property
    def own(self) -> Array:
        """The base, (1, d)."""
        names = self.surrogate.data.variables
        return np.array([[self.base.design[name] for name in names]], dtype=float)

    @cached_property
    def lines(self) -> dict[str, Array]:
        """Designs along each variable, (m, d)."""
        data, found = self.surrogate.data, {}
        for column, name in enumerate(data.variables):
            known, (low, high) = data.x[:, column], self.study.variables[name]
            ends = (max(known.min(), low), min(known.max(), high))
            own = self.own[0, column]
            values = np.unique(np.append(np.linspace(*ends, VALUES), own))
            if name == "count":
                whole = np.arange(np.ceil(ends[0]), np.floor(ends[1]) + 1.0)
                values = np.unique(np.append(whole, own))
            found[name] = np.repeat(self.own, len(values), axis=0)
            found[name][:, column] = values
            found[name] = found[name][~faces_hold(data, found[name])]
        return found

    @cached_property
    def refusal(self) -> str:
        """Reason why the base cannot be made; empty where it can."""
        return verdicts(self.study, self.surrogate.data.variables, self.own).refusal[0]

    def record(self) -> Row:
        """Record the base at all operating points."""
        asked = ask(self.surrogate, self.base.design, study_mix(self.study), self.study.physics)
        return {
            "base": self.base.name,
            "design": self.base.design,
            "failed": design_of(self.study, self.base.design).failed,
            "warnings": list(asked.warnings),
            "variables": {
                name: {
                    "values": rounded(x[:, column]),
                    "failed": [
                        design_of(self.study, self.study.named(row)).failed for row in x.tolist()
                    ],
                    "in_trained_range": in_range(self.surrogate, x).tolist(),
                }
                for column, (name, x) in enumerate(self.lines.items())
            },
        }

    def choice(self, operating: Operating, over: Over) -> Row:
        """Record the curves at one choice of operating points."""
        # Residuals of a single simulated design would stand in its slices as a false peak.
        smooth = {
            name: over_designs(over, x, alone=False) if len(x) else NOTHING
            for name, x in self.lines.items()
        }
        curves = {name: _curve_record(curve) for name, curve in smooth.items()}
        points = {one.name: self._points(one, operating) for one in operating_inputs(self.study)}
        asked = ask(self.surrogate, self.base.design, operating.mix, self.study.physics)
        expected = None if self.refusal else asked.expected
        return {
            "name": operating.name,
            **time_record(expected, self.refusal or asked.refusal),
            "curves": {**curves, **points},
        }

    def _points(self, moved: Input, operating: Operating) -> Row:
        """Record the curve over mismatch or force, the other one fixed."""
        count = 0 if faces_hold(self.surrogate.data, self.own)[0] else VALUES
        values = moved.at(np.linspace(0.0, 1.0, count))
        mismatch, force = operating.mismatch, middle(self.study.forces)
        fixed = {
            "mismatch_rpm": middle(self.study.mismatches) if mismatch is None else mismatch,
            "force_N": force,
        }
        columns = [values if k == moved.name else np.full(count, v) for k, v in fixed.items()]
        x = np.repeat(self.own, count, axis=0)
        points = np.column_stack(columns)
        curve = at_points(self.surrogate, x, points, operating.mix.retry) if count else NOTHING
        other = {k: v for k, v in fixed.items() if k != moved.name}
        own = mismatch if moved.name == "mismatch_rpm" else force
        return {
            "values": rounded(values),
            "logarithmic": moved.scale == LOG,
            "fixed": other,
            "own": None if mismatch is None else own,
            **_curve_record(curve),
        }


def _curve_record(curve: Curve) -> Row:
    return {
        "time_s": rounded(curve.time),
        "low_s": rounded(curve.low),
        "high_s": rounded(curve.high),
    }
