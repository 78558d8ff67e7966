"""Choice of the operating points at which a new design is simulated.

A surrogate predicts operating points that are left out, so a new design needs some of them only.
Those where dogs land hardest are always among them: nothing else predicts the landing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.point_plans import Plan
from dogshape.surrogate.acquisition import Question, choose
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over

HARD = 2  #: points that every design is simulated at for the landing's sake


def hard_points(study: Setup) -> list[int]:
    """List the places of the points where dogs land hardest.

    Of 32 designs at the published points 19 landed hardest at the fastest with the largest force,
    12 at the next slower with that force, one at the fastest with the next smaller force.
    """
    keys = [(abs(p.mismatch) * p.profile.force**2, i) for i, p in enumerate(study.points)]
    return sorted(i for _, i in sorted(keys, reverse=True)[:HARD])


def first_plan(study: Setup, points: int, number: int) -> Plan:
    """Plan a design before anything is predicted: points take turns."""
    hard = hard_points(study)
    others = [i for i in range(len(study.points)) if i not in hard]
    own = np.random.default_rng(study.file.search.seed).permutation(len(others))
    taken = max(points - len(hard), 0)
    turn = [others[own[(number * taken + k) % len(others)]] for k in range(taken)]
    return _plan(study, [*hard, *turn])


def telling_plan(study: Setup, points: int, over: Over, design: Array) -> Plan:
    """Plan a design (d,), in edge units, so that its expected time has the least error.

    The hard points tell of the time too: the others are chosen given these, each once.
    """
    hard = hard_points(study)
    count = max(points - len(hard), 0)
    if not count:
        return _plan(study, hard)
    question = Question(design[None, :], np.ones(1))
    angles = study.file.expectation.angles
    chosen = choose(over, question, angles, count, given=hard, again=False)
    return _plan(study, [*hard, *(int(place) for place in chosen.points)])


def _plan(study: Setup, places: Sequence[int]) -> Plan:
    angles = study.file.expectation.angles
    return [angles if place in places else 0 for place in range(len(study.points))]
