"""What a diagnosis says of why it has to simulate."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.reading import gather
from dogshape.pipeline.diagnose.lacking import reason
from dogshape.sim.shift.actuation import ForceProfile

GIVEN = load_bench("mq200_stand")
STAND = replace(GIVEN, clutch=GIVEN.clutch.with_engine("planar"))


def _with(rise: float | None = None, mismatch: float | None = None) -> Bench:
    readings = []
    for one in STAND.readings:
        point = one.point
        if rise is not None:
            point = replace(point, profile=ForceProfile(point.profile.force, rise))
        if mismatch is not None:
            point = replace(point, mismatch=mismatch * point.mismatch)
        readings.append(replace(one, point=point))
    return replace(STAND, cells=gather(readings))


def test_what_is_bundled_has_no_reason() -> None:
    assert reason(STAND) == ""


def test_other_rise_times_are_named_with_both() -> None:
    said = reason(_with(rise=0.2))
    assert said.startswith("other rise times of the force than the bundled ones (0.2 s instead of")
    assert "0.251 s at 235.2 N" in said


def test_other_operating_points_are_counted() -> None:
    said = reason(_with(mismatch=1.01))
    assert said == "28 points that no bundled data set has (such as 5.05 1/min with 235.2 N)"


@pytest.mark.parametrize("own", [("cold_oil",), ("cold_oil", "worn_fork")])
def test_effects_of_ones_own_are_named(own: tuple[str, ...]) -> None:
    assert reason(STAND, own) == f"effects of your own ({', '.join(own)})"


def test_another_clutch_is_said() -> None:
    other = replace(STAND, clutch=replace(STAND.clutch, timeout=1.1))
    assert reason(other) == "no simulations of this clutch come with the package"


def test_the_published_clutch_in_drake_is_no_other_clutch() -> None:
    said = reason(GIVEN)
    assert said == "those that the package brings of this clutch are of the compiled engine"


def test_wider_ranges_are_named() -> None:
    said = reason(STAND, wider=["actuation_delay"])
    assert said == "wider ranges than those of the bundled simulations (actuation_delay)"
