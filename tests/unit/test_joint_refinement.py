"""Effects are simulated together where several may be the cause, and only there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference import joint_refinement
from dogshape.diagnosis.prediction.hypotheses import log_odds
from dogshape.diagnosis.prediction.levels import Level, farthest
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import Array, Hypothesis
from tests.toy import EFFECTS, Toy, bench_of, points_of

POINTS = points_of((235.2, 469.0))
PAIR = ("contact_friction", "sleeve_friction")
NAMES = ("contact_friction", "force_scale", "mismatch_speed", "moving_mass", "sleeve_friction")
FEW = {name: EFFECTS[name] for name in NAMES}
WRONG = 1.35  #: factor by which effects together are emulated too slow
STATED = 0.08  #: of the mean, what they are said to err by


@dataclass(frozen=True)
class Combining(Toy):
    """A toy that is wrong about effects together until they are simulated."""

    known: tuple[Level, ...] = ()
    all_known: bool = False

    def acting(self, hypothesis: Hypothesis) -> Hypothesis:
        """List the effects that are simulated: all."""
        return hypothesis

    def joint_levels(self, acting: Hypothesis) -> int:
        """Count the levels of effects together."""
        return sum(level.hypothesis == acting for level in self.known)

    def with_levels(self, levels: Sequence[Level]) -> Combining:
        """Learn effects together."""
        return replace(self, known=(*self.known, *levels))

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Predict effects together too slow while they were not simulated."""
        found = super().at(hypothesis, values, cell)
        if len(hypothesis) < 2 or self.all_known or self.joint_levels(hypothesis):
            return found
        factor = np.linspace(1.0, WRONG, len(POINTS))[cell]
        mean = found.times.mean(axis=1)
        return replace(found, times=factor * found.times, error=STATED * mean)


TRUE = {"static_friction": 0.4, "dynamic_friction": 0.33, "friction_N": 120.0}


def _bench(values: Mapping[str, float], seed: int = 3) -> Bench:
    generator = np.random.default_rng(seed)
    return bench_of(values, generator, shifts=20, single=True, points=POINTS)


def _diagnosed(emulator: Toy, values: Mapping[str, float] = TRUE, rounds: int = 4) -> Diagnosis:
    settings = Settings(decision=replace(USUAL.decision, rounds=rounds))
    return diagnose(_bench(values), emulator, FEW, settings=settings)


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return _diagnosed(Combining(POINTS))


def test_a_pair_that_is_combined_wrongly_leads_once_it_was_simulated(found: Diagnosis) -> None:
    """Without rounds the wrong combination hides the truth; with them it is as if it were known."""
    assert found.leading == PAIR
    assert _diagnosed(Combining(POINTS), rounds=0).leading != PAIR
    known = _diagnosed(Combining(POINTS, all_known=True))
    assert found.posterior[PAIR] == pytest.approx(known.posterior[PAIR], abs=0.1)


def test_levels_lie_where_the_data_want_them(found: Diagnosis) -> None:
    """Within the priors, each another, not more than are allowed, and near the truth at last."""
    levels = found.together
    limits = USUAL.decision
    mine = [level.values for level in levels if level.hypothesis == PAIR]
    assert limits.together <= len(mine) <= limits.together * limits.rounds_each
    assert len(set(levels)) == len(levels)
    names = [p for name in PAIR for p in EFFECTS[name].parameters]
    for values in mine:
        assert all(p.low <= v <= p.high for p, v in zip(names, values, strict=True))
    forces = [values[2] for values in mine]
    assert min(forces) < TRUE["friction_N"] < max(forces)


def test_nothing_is_simulated_where_one_effect_explains_all() -> None:
    found = _diagnosed(Combining(POINTS), {"friction_N": 80.0})
    assert found.leading == ("sleeve_friction",)
    assert found.together == ()


def test_nothing_is_simulated_for_effects_that_are_far_from_the_best(found: Diagnosis) -> None:
    simulated = {level.hypothesis for level in found.together}
    assert PAIR in simulated
    best = max(_odds(found, h) for h in found.scored)
    far = [h for h in found.scored if len(h) == 2 and _odds(found, h) < best - 60.0]
    assert far
    assert not simulated.intersection(far)


def test_an_emulator_that_cannot_simulate_is_taken_as_it_is() -> None:
    found = _diagnosed(Toy(POINTS))
    assert found.leading == PAIR


def test_places_are_chosen_far_from_each_other() -> None:
    line = np.array([[0.5], [0.51], [0.0], [1.0], [0.49]])
    assert farthest(line, line[0], 2) == [2, 3]
    assert farthest(line[[0, 0]], line[0], 2) == []
    assert farthest(line[:0], line[0], 2) == []


def test_levels_are_the_same_for_other_last_digits(found: Diagnosis) -> None:
    """Else another machine's last digits would ask for other shifts than the package brings."""
    one = found.scored[PAIR]
    other = replace(one, rows=replace(one.rows, shares=one.rows.shares * (1.0 + 1e-9)))
    levels = [joint_refinement._levels(each, PAIR, 6) for each in (one, other)]
    assert levels[0] == levels[1]
    for level in levels[0]:
        shares = [
            p.share(v) * joint_refinement.GRID
            for p, v in zip(one.space.parameters, level.values, strict=True)
        ]
        assert shares == pytest.approx(np.round(shares), abs=1e-6)


def _odds(found: Diagnosis, hypothesis: Hypothesis) -> float:
    return found.scored[hypothesis].log_evidence + log_odds(hypothesis)
