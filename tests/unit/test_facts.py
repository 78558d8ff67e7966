"""What static readings of a stand tell of its linkage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.stand_file import Calibration, Sensor
from dogshape.diagnosis.inference.static_readings import facts_of

STAND = load_bench("mq200_stand")


def _bench(stiffness: float, ratio: float, start: float) -> Bench:
    """Return the stand with readings on a line: N/m at the arm, and m without force."""
    readings = tuple(
        Calibration(None, start + force / stiffness, force, None, None)
        for force in (90.0, 120.0, 180.0, 250.0)
    )
    return replace(STAND, sensor=Sensor("actuator", ratio, 0.5), calibration=readings)


def test_a_line_of_known_slope_gives_its_compliance_and_ratio() -> None:
    travel = STAND.clutch.dog.travel
    compliance, scale = facts_of(_bench(1e5, 3.0, 2.4 * travel))
    # 0.01 mm/N at the arm: over the squared ratio 1.11 mm/kN, with half the force lost 2.22.
    assert compliance.value == pytest.approx(1.5 * 10.0 / 9.0)
    assert abs(compliance.value - 10.0 / 9.0) < 2.0 * compliance.error
    assert scale.value == pytest.approx(2.4 / 3.0)
    assert (compliance.neutral, scale.neutral) == (0.0, 1.0)


def test_the_published_stand_is_as_compliant_as_its_table_says() -> None:
    """Thesis Table 2: 28.6 N/mm at the arm, 14.0 mm without force for 4.7 mm of the sleeve."""
    compliance, scale = facts_of(STAND)
    assert "35 mm/kN at the arm" in compliance.sentence
    assert compliance.value == pytest.approx(0.5 * (1.0 / 0.233 + 1.0 / 0.291), rel=0.01)
    assert scale.value == pytest.approx(1.0 - 0.066, abs=0.001)


def test_a_fact_is_likeliest_at_its_value() -> None:
    compliance, _ = facts_of(STAND)
    grid = np.linspace(0.0, 10.0, 2001)
    density = np.exp(compliance.log_density(grid))
    assert grid[np.argmax(density)] == pytest.approx(compliance.value, abs=0.01)
    inside = (grid > compliance.low) & (grid < compliance.high)
    assert density[inside].sum() / density.sum() == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("count", [0, 2])
def test_too_few_readings_tell_nothing(count: int) -> None:
    assert facts_of(replace(STAND, calibration=STAND.calibration[:count])) == ()


def test_readings_at_one_force_tell_nothing() -> None:
    assert facts_of(replace(STAND, calibration=STAND.calibration[:1] * 4)) == ()
