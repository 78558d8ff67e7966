"""Facts of an effect from readings at rest and from direct tests."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.stand_file import Calibration, Sensor
from dogshape.diagnosis.inference.static_readings import (
    Fact,
    explained,
    facts_of,
    log_density,
    log_unknown,
)
from tests.fits import SETTING, space_of
from tests.toy import EFFECTS

STAND = load_bench("mq200_stand")
DRAG = Fact("drag_torque", "drag_Nm", 0.0, 1.5, 0.1, "")


def _bench(stiffness: float, ratio: float, start: float) -> Bench:
    """Return the stand with readings on a line: N/m at the arm, and m without force."""
    readings = tuple(
        Calibration(arm_displacement_mm=1e3 * (start + force / stiffness), arm_force_N=force)
        for force in (90.0, 120.0, 180.0, 250.0)
    )
    return replace(
        STAND,
        sensor=Sensor(linkage_ratio=ratio, linkage_efficiency=0.5),
        calibration=readings,
    )


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


def test_a_fact_counts_at_its_parameter_and_where_its_effect_is_absent_at_neutral() -> None:
    """A drag of 1.5 N m beside a delay: density at each value, or at none."""
    both = space_of(("actuation_delay", "drag_torque"))
    values = np.array([[0.1, 1.5], [0.2, 1.2], [0.0, 0.0]])
    width = np.log(2.0 * np.pi) / 2.0
    found = log_density([DRAG], both, values) - width
    assert found == pytest.approx(norm.logpdf(values[:, 1], 1.5, 0.1))
    alone = log_density([DRAG, DRAG], space_of(("actuation_delay",)), values[:, :1])
    assert alone - 2.0 * width == pytest.approx([2.0 * norm.logpdf(0.0, 1.5, 0.1)] * 3)
    assert log_density([], both, values).tolist() == [0.0, 0.0, 0.0]


def test_unknown_finds_nothing_or_anything_within_the_range() -> None:
    (parameter,) = EFFECTS["actuation_delay"].parameters
    wide = parameter.high - parameter.low
    assert (parameter.scale, parameter.low) == ("uniform", 0.0)
    fact = Fact("actuation_delay", parameter.name, 0.0, 0.5 * wide, 0.01 * wide, "")
    # A narrow reading within the range has the density of the range, at its end half of it.
    inside = 0.5 / wide * np.sqrt(2.0 * np.pi)
    assert np.exp(log_unknown(fact, EFFECTS)) == pytest.approx(inside, rel=1e-3)
    absent = np.exp(log_unknown(replace(fact, value=0.0), {}))
    assert absent == pytest.approx(0.5 / fact.error + 0.5 * inside, rel=1e-3)


class _Model:
    """Mean times of 300 ms, and 10 ms more for each mm/kN at the first of two points."""

    setting = SETTING
    effects = EFFECTS

    def predict(self, hypothesis: tuple[str, ...], shares: Any) -> Any:
        """Return mean times at shares of the compliance."""
        mean = np.full((1, 3), 0.3)
        if hypothesis:
            space = space_of(hypothesis)
            mean[0, 0] += 0.01 * space.values(shares)[0, 0]
        return SimpleNamespace(mean=mean)


@pytest.mark.parametrize(("gap", "part"), [(0.138, 0.0), (0.04, 0.04), (-0.03, -0.04)])
def test_a_fact_alone_explains_its_part_of_the_gap(gap: float, part: float) -> None:
    """4 mm/kN are 40 ms at the first point: the whole gap there, or as much too much."""
    fact = Fact("linkage_compliance", "compliance_mm_kN", 0.0, 4.0, 0.2, "")
    first = gap if part else 0.02
    other = 0.0 if part else gap
    seen = SimpleNamespace(
        mean=0.3 + np.array([first, other, 9.0]), count=np.array([10.0, 10.0, 0.0])
    )
    found = explained(fact, _Model(), seen)  # type: ignore[arg-type]
    rms = np.sqrt((first**2 + other**2) / 2.0)
    left = np.sqrt(((first - 0.04) ** 2 + other**2) / 2.0)
    assert found == pytest.approx(rms - left)
    assert found == pytest.approx(part / np.sqrt(2.0), abs=1e-9)
