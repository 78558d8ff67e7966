"""What the sampler finds more than one that knows nothing."""

from __future__ import annotations

import numpy as np
import optuna

from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.surrogate.hypervolume import hypervolume
from tests.unit.test_sampler import FEW, bowls


def searched(sampler: optuna.samplers.BaseSampler, trials: int = 40) -> float:
    """Hypervolume of what a sampler finds of the bowls."""
    study = optuna.create_study(directions=["minimize"] * 2, sampler=sampler)
    study.optimize(bowls, n_trials=trials)
    kept = [t.values for t in study.trials if t.constraints["ring"] <= 0.0]
    return hypervolume(np.array(kept), np.full(2, 0.8))


def test_it_finds_more_of_a_front_than_random_designs() -> None:
    """Two objectives and a constraint that only the evaluation tells."""
    own = [searched(SurrogateSampler(seed=seed, breadth=FEW)) for seed in range(3)]
    blind = [searched(optuna.samplers.RandomSampler(seed=seed)) for seed in range(3)]
    assert min(own) > max(blind)
