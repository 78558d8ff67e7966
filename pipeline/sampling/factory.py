"""Samplers of a search by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from optuna.samplers import BaseSampler, NSGAIISampler, RandomSampler, TPESampler

from pipeline.config import Study
from pipeline.sampling.dogs import DogGuide
from pipeline.sampling.sampler import SurrogateSampler
from sim.errors import InputError, did_you_mean
from surrogate.model import MIN_DESIGNS, Surrogate

SAMPLERS = ("surrogate", "space_filling", "tpe", "nsga2", "random")


def sampler_factory(study: Study, known: Surrogate | None = None) -> Callable[[int], BaseSampler]:
    """Return a function that gives the sampler for a round, by the round's first trial.

    ``known`` is a surrogate of the study's physics that the search begins with. Optuna's samplers
    are made and seeded afresh for each round, which makes a resumed search equal to an
    uninterrupted one.
    """
    search = study.file.search
    if search.sampler in ("surrogate", "space_filling"):
        startup = search.startup if search.sampler == "surrogate" else search.trials
        own = SurrogateSampler(DogGuide(study, known), search.seed, max(startup, MIN_DESIGNS))
        own.require_allowed()
        return lambda _: own
    kinds: dict[str, Callable[[int], BaseSampler]] = {
        "tpe": lambda seed: TPESampler(seed=seed, n_startup_trials=search.startup),
        "nsga2": lambda seed: NSGAIISampler(seed=seed, population_size=search.startup),
        "random": lambda seed: RandomSampler(seed=seed),
    }
    if search.sampler not in kinds:
        hint = did_you_mean(search.sampler, SAMPLERS)
        raise InputError(f"search.sampler is '{search.sampler}', which is not a sampler; {hint}")
    make = kinds[search.sampler]
    return lambda first: make(int(np.random.default_rng([search.seed, first]).integers(2**31)))
