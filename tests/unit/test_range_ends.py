"""Sizes at the end of their range: found, the range widened there, and said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.diagnosis import Diagnosis, Ranked, diagnose_wider, ranked
from dogshape.diagnosis.inference.range_ends import RangeEnd, range_ends, widened
from dogshape.diagnosis.report.wording import range_sentence
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.sim.effect import Effect, Parameter
from tests.toy import EFFECTS, Toy, bench_of, points_of

LIMITS = USUAL.decision


def _bench(values: Mapping[str, float]) -> Bench:
    return bench_of(values, np.random.default_rng(3), shifts=20)


def _found(bench: Bench, effects: Mapping[str, Effect]) -> Diagnosis:
    def once(those: Mapping[str, Effect]) -> Ranked:
        return ranked(bench, Toy(points_of()), those, pairs=[])

    return diagnose_wider(once, effects)


def _few(*names: str) -> dict[str, Effect]:
    return {name: EFFECTS[name] for name in names}


def test_a_range_grows_by_its_measure_and_stops_at_what_is_physical() -> None:
    even = Parameter("x_N", 0.0, 2.0, 4.0, "uniform", "made up", least=1.5, most=10.0)
    assert even.widened(0.5, upper=True) == replace(even, high=5.0)
    assert even.widened(0.5, upper=False) == replace(even, low=1.5)
    log = Parameter("x_N", 0.0, 1.0, 100.0, "log-uniform", "made up")
    assert log.widened(0.5, upper=True).high == pytest.approx(1000.0)
    assert log.widened(0.5, upper=False).low == pytest.approx(0.1)


def test_a_truth_beyond_the_range_is_found_after_widening() -> None:
    """A dead time of 0.5 s, where 0.4 s was held possible."""
    found = _found(_bench({"delay_s": 0.5}), _few("actuation_delay", "moving_mass"))
    (end,) = found.range_ends
    assert (end.effect, end.upper, end.remedy) == ("actuation_delay", True, "widened")
    assert end.moved == pytest.approx(0.6)
    assert end.probability > 0.9
    size = found.intervals[("actuation_delay",)]["delay_s"]
    assert size.low < 0.5 < size.high
    assert "the range was widened to 600 ms" in found.as_dict()["summary"]
    assert found.as_dict()["range_ends"][0]["end"] == pytest.approx(0.4)


def test_a_truth_far_beyond_is_said_to_lie_beyond() -> None:
    """1.2 s is beyond 0.4, 0.6 and 0.9 s."""
    bench = _bench({"delay_s": 1.2})
    found = _found(bench, _few("actuation_delay"))
    assert [one.remedy for one in found.range_ends] == ["widened", "widened", "left"]
    assert found.range_ends[-1].end == pytest.approx(0.9)
    assert "the size may lie beyond" in found.as_dict()["summary"]


def test_a_single_effect_beyond_its_range_beats_two_within_theirs() -> None:
    """A mass far beyond its range: friction with a delay imitates it within theirs."""
    names = ("actuation_delay", "moving_mass", "sleeve_friction")
    effects = _few(*names)
    (mass,) = effects["moving_mass"].parameters
    small = replace(mass, high=0.4 * mass.high)
    effects["moving_mass"] = replace(effects["moving_mass"], parameters=(small,))
    bench = _bench({mass.name: 0.8 * mass.high})
    pair = [("actuation_delay", "sleeve_friction")]

    def once(those: Mapping[str, Effect]) -> Ranked:
        pairs = [one for one in pair if set(one) <= set(those)]
        return ranked(bench, Toy(points_of()), those, pairs=pairs)

    before, found = once(effects).ranking, diagnose_wider(once, effects)
    assert before.leading == pair[0]
    assert found.leading == ("moving_mass",)
    assert ("moving_mass", "widened") in [(one.effect, one.remedy) for one in found.range_ends]
    assert all(one.alone for one in found.range_ends)
    said = found.as_dict()["summary"]
    assert "Alone, some effects would explain more beyond their range, which was widened" in said
    assert "added mass" in said
    without = Settings(decision=replace(LIMITS, simpler=0))
    assert diagnose_wider(once, effects, without).leading == pair[0]
    # No single effect is so much more probable.
    certain = Settings(decision=replace(LIMITS, plausible=1e9))
    assert diagnose_wider(once, effects, certain).leading == pair[0]
    never = Settings(priors=replace(USUAL.priors, included={"moving_mass": 1e-200}))
    assert diagnose_wider(once, effects, never).leading == pair[0]


def test_a_truth_within_the_range_widens_nothing() -> None:
    found = _found(_bench({"delay_s": 0.1}), _few("actuation_delay", "moving_mass"))
    assert found.range_ends == ()
    assert found.as_dict()["range_ends"] == []


def test_an_effect_that_only_grows_too_weak_lies_at_no_end() -> None:
    """Nothing is there: what a mass of 0.03 kg changes nobody sees."""
    bench = _bench({})
    found = ranked(bench, Toy(points_of()), _few("moving_mass"), pairs=[])
    mass = found.ranking.scored[("moving_mass",)]
    assert not range_ends(mass, LIMITS)


def test_an_end_with_nothing_physical_beyond_is_said() -> None:
    effects = _few("relative_angle")
    centre = effects["relative_angle"].parameters[1]
    end = RangeEnd("relative_angle", centre, True, 0.6)
    same, (told,) = widened(effects, (end,), setting_of(_bench({})), LIMITS.wider)
    assert same == effects
    assert told.remedy == "bound"
    assert "nothing physical lies beyond it" in range_sentence(told, effects)


def test_a_range_is_widened_as_far_as_there_is_such_a_bench() -> None:
    """A gap of 1 mm can be smaller by less than 1 mm."""
    effects, bench = _few("axial_gap"), _bench({})
    (gap,) = effects["axial_gap"].parameters
    setting = setting_of(bench)
    end = RangeEnd("axial_gap", gap, False, 0.6)
    wider, (told,) = widened(effects, (end,), setting, LIMITS.wider)
    assert -1.0 < told.moved < -0.8
    assert wider["axial_gap"].possible(setting, {"gap_offset_mm": told.moved})
    assert wider["axial_gap"].parameters[0].high == gap.high
