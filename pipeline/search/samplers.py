"""Samplers of a search by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from optuna.samplers import BaseSampler, NSGAIISampler, RandomSampler, TPESampler

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import OWN, DogGuide
from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.surrogate.model import MIN_DESIGNS

SAMPLERS = ("surrogate", "space_filling", "tpe", "nsga2", "random")


def sampler_factory(study: Setup, guide: DogGuide | None = None) -> Callable[[int], BaseSampler]:
    """Return a function that gives the sampler for a proposal, by how many were asked before.

    ``guide`` steers the study's own sampler; None for one that knows nothing beforehand. Optuna's
    samplers are made and seeded anew for each proposal, which makes a resumed search equal to
    an uninterrupted one.
    """
    search, guide = study.file.search, guide or DogGuide(study)
    if search.sampler in OWN:
        startup = startup_designs(study) if search.sampler == "surrogate" else search.trials
        own = SurrogateSampler(guide, search.seed, startup)
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
    return lambda number: make(int(np.random.default_rng([search.seed, number]).integers(2**31)))


def startup_designs(study: Setup) -> int:
    """Count the designs that fill the space first."""
    return max(study.file.search.startup, MIN_DESIGNS)
