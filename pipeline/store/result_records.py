"""Results as records by the names of the command line's contract, fit for JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.strength.checks import Check
from dogshape.sim.units import RPM

if TYPE_CHECKING:
    from dogshape.diagnosis.bench.comparison import Comparison, Difference


def expectation_record(expectation: Expectation) -> dict[str, Any]:
    """Record an expectation by the names of the command line's contract.

    Where too few shifts engage there is no time, and no error of one.
    """
    none = not expectation.engages
    return {
        "expected_shift_time_s": expectation.time,
        "standard_error_s": None if none else number_or_none(expectation.standard_error),
        "numerical_error_s": None if none else number_or_none(expectation.numerical_error),
        "engages": expectation.engages,
        "engaged": expectation.engaged,
        "mean_engaged_s": expectation.mean_engaged,
        "shifts": expectation.shifts,
        "not_engaged": expectation.lost,
        "held_dog_on_dog": expectation.blocked,
        "points": [
            {
                "mismatch_rpm": p.point.mismatch / RPM,
                "force_N": p.point.profile.force,
                "mean_s": p.time,
                "mean_engaged_s": p.mean_engaged,
                "standard_error_s": number_or_none(p.standard_error if p.engages else None),
                "sd_s": p.sd,
                "engaged": p.engaged,
                "n": p.n,
                "held_dog_on_dog": p.blocked,
            }
            for p in expectation.points
        ],
    }


def number_or_none(value: float | None) -> float | None:
    """Return a number that JSON can hold: None where there is none."""
    return value if value is not None and math.isfinite(value) else None


def check_record(check: Check) -> dict[str, Any]:
    """Record a check by the names of the command line's contract."""
    rule = check.rule
    return {
        "name": check.name,
        "value": number_or_none(check.value),
        "limit": check.limit,
        "unit": check.unit,
        "margin": number_or_none(check.margin),
        "passed": check.passed,
        "group": rule.group,
        "at_most": rule.at_most,
        "meaning": rule.meaning,
        "formula": rule.formula,
        "source": rule.source,
        "limit_key": rule.key,
    }


def difference_record(d: Difference) -> dict[str, Any]:
    """Record one operating point of a comparison by the contract's names."""
    return {
        "mismatch_rpm": d.cell.point.mismatch / RPM,
        "force_N": d.cell.point.profile.force,
        "bench_s": d.cell.time,
        "simulated_s": d.simulated.mean_engaged,
        "standard_error_s": d.standard_error,
        "z": d.z,
        "engaged": d.simulated.engaged,
        "n": d.simulated.n,
    }


def engaged_record(result: Comparison) -> dict[str, Any]:
    """Record the share of tried shifts that engaged, on the bench and in the simulation."""
    engaged, tried, simulated = result.engaged
    return {"engaged": engaged, "tried": tried, "simulated_share": simulated if tried else None}
