"""Evidence by nested sampling, a second computation to hold quadrature against.

It needs the extra ``nested`` (dynesty; Speagle 2020) and asks the emulator for one value at a
time, so it is for checks and not for every diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dogshape.diagnosis.likelihood.scores import Problem, score
from dogshape.diagnosis.prediction.hypotheses import Space
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import InputError

LIVE = 100  #: points


def nested(
    log_likelihood: Callable[[Array], float], size: int, seed: int = 1
) -> tuple[float, float]:
    """Return the logarithm of the evidence over the unit cube of ``size``, and its error.

    Raises InputError without the extra.
    """
    try:
        from dynesty import NestedSampler  # noqa: PLC0415
    except ImportError as error:
        raise InputError(
            "nested sampling needs dynesty; install it with pip install 'dogshape[nested]'"
        ) from error
    generator = np.random.default_rng(seed)
    sampler = NestedSampler(log_likelihood, lambda u: u, size, nlive=LIVE, rstate=generator)
    sampler.run_nested(dlogz=0.05, print_progress=False)
    return float(sampler.results.logz[-1]), float(sampler.results.logzerr[-1])


def nested_evidence(problem: Problem, space: Space, seed: int = 1) -> tuple[float, float]:
    """Return the logarithm of the evidence of a hypothesis, and its error."""

    def at(shares: Array) -> float:
        return float(score(problem, space, np.atleast_2d(shares)).whole[0])

    return nested(at, len(space.parameters), seed)
