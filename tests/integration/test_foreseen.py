"""A study says beforehand how long it takes, and what is left at any moment."""

from __future__ import annotations

from pathlib import Path

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.progress import Count
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from tests.conftest import SMALL

ASKED = [*SMALL, "solver.engine=planar", "search.trials=6", "search.screen_angles=8"]


class Watch:
    """A progress that keeps counts and sentences."""

    def __init__(self) -> None:
        self.counts: list[Count] = []
        self.said: list[str] = []

    def update(self, count: Count) -> None:
        """Keep a count."""
        self.counts.append(count)

    def say(self, line: str) -> None:
        """Keep a sentence."""
        self.said.append(line)

    @property
    def left(self) -> list[float]:
        """Times left, s, as they were foreseen."""
        assert all(count.left_s is not None for count in self.counts)
        return [count.left_s for count in self.counts if count.left_s is not None]


def test_a_study_foresees_its_time(tmp_path: Path) -> None:
    study, first = load_study("mq200_paper", ASKED), Watch()
    run_study(study, Run(StudyFolder(tmp_path), 1, report=False, progress=first))
    assert any(line.startswith("that takes ") for line in first.said)
    assert first.left[0] > 0.0
    assert first.left[-1] < 0.3 * first.left[0]

    again = Watch()
    run_study(study, Run(StudyFolder(tmp_path), 1, resume=True, report=False, progress=again))
    # All designs are there: only the screens of the confirmation, which are not kept, are left.
    assert again.left[0] < first.left[0]
    assert again.counts[-1].known == again.counts[-1].done > 0
