"""Forecast of the time left: kinds of work are weighed by what they cost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.duration import about
from dogshape.pipeline.forecast import COST, Forecast
from dogshape.pipeline.progress import Count, WorkCounter
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.train.foreseen import to_fill


@dataclass
class Clock:
    now: float = 0.0

    def __call__(self) -> float:
        return self.now


def test_kinds_that_cost_differently_are_foreseen_by_their_cost() -> None:
    """Ten designs of 2 s, 1000 quick shifts of 5 ms and 50 of 0.2 s each, one after the other."""
    clock = Clock()
    truth = {"design": 2.0, "quick": 0.005, "shift": 0.2}
    forecast = Forecast({"design": 10, "quick": 10_000, "shift": 500}, 1, clock=clock)
    whole = 10 * (2.0 + 5.0 + 10.0)
    for done in range(1, 11):
        for kind, count in (("quick", 1000), ("shift", 50), ("design", 1)):
            clock.now += count * truth[kind]
            forecast.report(kind, count)
        left = whole - clock.now
        if done < 10:
            assert forecast.seconds == pytest.approx(left, rel=0.15), done
    assert forecast.seconds == 0.0
    assert clock.now == pytest.approx(whole)


def test_the_time_of_a_proposal_is_not_that_of_the_shifts_after_it() -> None:
    clock = Clock()
    forecast = Forecast({"design": 8, "shift": 400}, 1, clock=clock)
    clock.now = 12.0  # four designs are proposed
    forecast.report("design", 0)
    before = forecast.each("design")
    clock.now = 22.0
    forecast.report("shift", 200)
    assert forecast.each("shift") == pytest.approx(0.05, rel=0.05)
    assert before == COST["design"], "nothing is known of a design before one is told"
    forecast.report("design", 4)
    assert forecast.each("design") == pytest.approx(3.0, rel=0.2)
    assert forecast.seconds == pytest.approx(22.0, rel=0.2)


def test_before_anything_is_measured_the_guess_holds() -> None:
    forecast = Forecast({"shift": 1000}, 2, clock=Clock())
    assert forecast.seconds == pytest.approx(1000 * COST["shift"] / 2)


def test_what_an_earlier_run_finished_costs_nothing() -> None:
    clock = Clock()
    forecast = Forecast({"shift": 100}, 1, clock=clock)
    forecast.skip("shift", 50)
    clock.now = 10.0
    forecast.report("shift", 10)
    assert forecast.left["shift"] == 40
    assert forecast.each("shift") == pytest.approx(1.0, rel=0.55)


def test_a_counter_hands_on_what_is_foreseen() -> None:
    seen: list[Count] = []

    class Watch:
        def update(self, count: Count) -> None:
            seen.append(count)

        def say(self, line: str) -> None: ...

    clock = Clock()
    forecast = Forecast({"shift": 10, "quick": 100}, 1, clock=clock)
    with WorkCounter(Watch(), 10, forecast=forecast) as counter:
        clock.now = 1.0
        counter.quick(50)
        assert (seen[-1].done, seen[-1].left_s) == (0, forecast.seconds)
        clock.now = 3.0
        counter.advance(2)
        assert forecast.left == {"shift": 8, "quick": 50}
        counter.told({"shift": 1})
        assert seen[-1].left_s == pytest.approx(forecast.each("shift"))
    assert seen[-1].ended


def test_kinds_not_yet_measured_follow_the_pace_of_those_that_were() -> None:
    """On a machine of a third of the speed the dear shifts are foreseen by the cheap ones."""
    clock = Clock()
    forecast = Forecast({"quick": 8000, "shift": 400}, 1, clock=clock)
    clock.now = 3.0 * COST["quick"] * 4000
    forecast.report("quick", 4000)
    assert forecast.each("shift") == pytest.approx(3.0 * COST["shift"], rel=0.1)


def test_the_start_of_workers_is_not_taken_for_work() -> None:
    clock = Clock()
    forecast = Forecast({"quick": 10_000}, 1, clock=clock)
    clock.now = 5.0  # what loads and compiles comes once
    forecast.report("quick", 100)
    for _ in range(10):
        clock.now += 0.4
        forecast.report("quick", 100)
    assert forecast.each("quick") == pytest.approx(0.004, rel=0.15)


def test_dear_shifts_first_do_not_mislead_a_counter() -> None:
    """Half of the shifts cost three times the others, and come first."""
    seen: list[Count] = []

    class Watch:
        def update(self, count: Count) -> None:
            seen.append(count)

        def say(self, line: str) -> None: ...

    clock = Clock()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dogshape.pipeline.forecast.CLOCK", clock)
        with WorkCounter(Watch(), 200) as counter:
            assert seen[-1].left_s is None
            for cost in (1.5, 0.5):
                for _ in range(100):
                    clock.now += cost
                    counter.weigh(cost)
                    counter.advance(1)
                    if 10 <= seen[-1].done < 200:
                        assert seen[-1].left_s == pytest.approx(200.0 - clock.now, rel=0.02)
    assert seen[-1].left_s == 0.0


def test_a_counter_takes_what_it_was_told_later() -> None:
    seen: list[Count] = []

    class Watch:
        def update(self, count: Count) -> None:
            seen.append(count)

        def say(self, line: str) -> None: ...

    clock = Clock()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dogshape.pipeline.forecast.CLOCK", clock)
        with WorkCounter(Watch(), 20) as counter:
            counter.weigh(1.0)
            clock.now = 10.0
            counter.advance(10)
            assert seen[-1].left_s == pytest.approx(10.0)
            counter.extend(20)
            assert seen[-1].left_s == pytest.approx(30.0)
            counter.rest(5)
            assert seen[-1].left_s == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.4, "less than a minute"),
        (50.0, "about a minute"),
        (119.0, "about 2 minutes"),
        (360.0, "about 6 minutes"),
        (7140.0, "about 119 minutes"),
        (7200.0, "about 2 h"),
        (7900.0, "about 2 h 10 min"),
        (19_270.0, "about 5 h 20 min"),
        (86_400.0, "about 24 h"),
    ],
)
def test_times_are_said_in_minutes_and_hours(seconds: float, said: str) -> None:
    assert about(seconds) == said


def test_a_fit_that_was_done_is_foreseen_no_more(tmp_path: Path) -> None:
    """A surrogate in two levels is fitted quickly twice: to choose designs, and references."""
    study, folder = load_study("mq200_paper"), StudyFolder(tmp_path)
    assert to_fill(study, folder, 1000, 300, 2)["fit"] == 2.0
    assert to_fill(study, folder, 1000, 0, 1)["fit"] == 1.0
    folder.chosen.write_text("{}", encoding="utf-8")
    assert to_fill(study, folder, 1000, 300, 2)["fit"] == 1.0
    folder.best.write_text("{}", encoding="utf-8")
    assert to_fill(study, folder, 1000, 300, 2)["fit"] == 0.0
    few = load_study("mq200_paper", {"surrogate.mix_shifts": 0})
    assert to_fill(few, StudyFolder(tmp_path / "new"), 1000, 300, 2)["fit"] == 1.0
