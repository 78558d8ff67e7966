"""The surrogate that comes with the package, and which one is asked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import find_study, load_study
from dogshape.pipeline.train.found_surrogates import known_surrogate, stored_surrogate
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.query import in_range
from dogshape.surrogate.store import Stored, save
from tests.conftest import Said

Call = Callable[..., Said]
PROTOTYPE = 0.0945  #: s, expected shift time by 16 angles at each operating point (README)


@pytest.fixture(scope="module")
def brought() -> Stored:
    """The surrogate of the paper's study."""
    found = known_surrogate(load_study("mq200_paper"))
    assert found is not None
    return found


def test_a_check_works_without_any_results(dogshape: Call) -> None:
    said = dogshape("check", "mq200_paper", "--json")
    assert said.status == 0
    assert said.json["low_s"] < PROTOTYPE < said.json["high_s"]
    assert said.json["high_s"] < 1.1 * said.json["low_s"]
    assert said.json["in_range"] is True
    assert 0.99 < said.json["engaged"] < 1.0
    text = dogshape("check", "mq200_paper", "--mismatch-rpm", 80, "--force-N", 300).out
    assert "next simulated design" in text


def test_a_copy_of_the_study_has_it_by_its_physics(tmp_path: Path) -> None:
    copy = tmp_path / "mine.toml"
    text = find_study("mq200_paper").read_text().replace('name = "mq200_paper"', 'name = "mine"')
    copy.write_text(text)
    mine = load_study(copy, ["operating.mismatch_rpm=[50]"])
    stored, _ = stored_surrogate(mine, None)
    assert stored.surrogate.data.physics == mine.physics
    assert known_surrogate(load_study(copy, ["sliding.mass_kg=0.4"])) is None


def test_a_wider_study_keeps_the_meaning_of_its_parameters(brought: Stored) -> None:
    """Joined rows are scaled as the rows that the parameters were fitted to."""
    known = brought.surrogate.data
    other = known.subset(np.arange(20))
    wide = other.__class__(
        other.variables, other.low - 10, other.high + 10, other.rows, other.physics, other.engine
    )
    joined = known.joined(wide)
    assert (joined.low == known.low).all()
    assert len(joined) == len(known)


def test_many_designs_are_answered_like_one(brought: Stored) -> None:
    study = load_study("mq200_paper")
    mix, model = study_mix(study), brought.surrogate
    x = model.data.designs[::60]
    one = [model.expected(row, mix) for row in x]
    time, error = Over(model, mix).predict(x)
    assert time == pytest.approx([e.time for e in one], rel=5e-3)
    assert error == pytest.approx([e.error for e in one], rel=0.15)
    assert in_range(model, x).all()
    far = mix.points * [20.0, 1.0]
    assert not in_range(model, x, mix.__class__(far, mix.weights, mix.retry)).any()


def test_the_named_surrogate_is_asked(brought: Stored, tmp_path: Path) -> None:
    path = tmp_path / "named.json"
    save(path, brought)
    assert path.stat().st_size < 1_000_000
    stored, found = stored_surrogate(load_study("mq200_paper"), path)
    assert found == path
    assert stored.validation == brought.validation
