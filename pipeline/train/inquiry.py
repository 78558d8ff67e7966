"""Simulating where it tells most about a question: the best designs, the front, or one design.

Which designs are best or on the front is itself uncertain: each draw of the surrogate has its
own, and how often a design is among them is its weight in the question. Rows are chosen by what
they take from the error of these designs' expected times (``surrogate.acquisition``), from among
the same designs; the surrogate learns from each round before the next is chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import exact_losses
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.train.filling import filling_designs
from dogshape.pipeline.train.training_rows import dataset_of, study_mix
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.surrogate.acquisition import Choice, Question, choose
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.hypervolume import not_dominated
from dogshape.surrogate.learning import fit
from dogshape.surrogate.model import Surrogate

QUESTIONS = ("best", "front", "design")
APART = 190_000  #: added to the seed for the designs that a question is about
POOL = 200  #: feasible designs from which those of a question come
DRAWS = 40  #: of the expected times of all of them
TENTH = 0.1  #: share of the pool that counts as best
ROWS = 32  #: chosen in a round


@dataclass(frozen=True)
class Inquiry:
    """A question and how many shifts may be spent on it.

    ``kind`` is ``best`` (the fastest tenth), ``front`` (what no other design beats in all of the
    study's objectives) or ``design`` (the study's own).
    """

    kind: str
    shifts: int

    def __post_init__(self) -> None:
        if self.kind not in QUESTIONS:
            hint = did_you_mean(self.kind, QUESTIONS)
            raise InputError(f"--question is '{self.kind}', which is no question; {hint}")


def inquire(
    study: Setup,
    inquiry: Inquiry,
    executor: Executor,
    say: Callable[[str], None],
    among: Array | None = None,
) -> Iterator[Surrogate]:
    """Simulate about a question; yield the surrogate before each round and after the last.

    The executor's journal has to hold shifts to begin with, and gets the new ones. ``among`` are
    designs that the question is about, (m, d) in edge units; None for such as fill the space.
    """
    rng = np.random.default_rng(study.file.surrogate.seed)
    pool = _pool(study, inquiry.kind) if among is None else among
    angles = study.file.surrogate.angles
    rows, model = executor.journal.rows, None
    goal = len(rows) + inquiry.shifts
    while True:
        effort = Effort() if model is None else Effort(steps=0)
        model = fit(dataset_of(study, rows.values()), like=model, effort=effort)
        yield model
        left = goal - len(rows)
        if left < angles:
            return
        over = Over(model, study_mix(study))
        question = _question(study, inquiry.kind, over, pool, rng)
        choice = choose(over, question, angles, min(ROWS, left // angles))
        say(
            f"{left} shifts to go; the next {len(choice.left) * angles} leave "
            f"{choice.left[-1]:.0%} of the variance of {len(question.designs)} designs"
        )
        executor.run(_blocks(study, question, choice, study.file.surrogate.seed + len(rows)))


def _pool(study: Setup, kind: str) -> Array:
    if kind == "design":
        return study.rows([study.prototype])
    found = filling_designs(study, study.file.surrogate.seed + APART, border=False)
    return study.rows(islice(found, POOL))


def _question(
    study: Setup, kind: str, over: Over, pool: Array, rng: np.random.Generator
) -> Question:
    """Return the designs of the pool that draws find best or on the front, by how often."""
    if kind == "design":
        return Question(pool, np.ones(1))
    # The surrogate knows the expected time; other simulated objectives are left out.
    exact = exact_losses(study, [study.named(row) for row in pool])
    exact = exact[:, np.isfinite(exact).all(axis=0)]
    weights = np.zeros(len(pool))
    for _ in range(DRAWS):
        drawn = over.sample(pool, rng)
        if kind == "best":
            weights[np.argsort(drawn)[: max(1, round(TENTH * len(pool)))]] += 1.0
        else:
            weights[not_dominated(np.column_stack([drawn, exact]))] += 1.0
    kept = weights > 0.0
    return Question(pool[kept], weights[kept] / weights.sum())


def _blocks(study: Setup, question: Question, choice: Choice, seed: int) -> list[Block]:
    """Return the chosen rows; each has angles of a draw of its own, as one may be chosen twice."""
    blocks = []
    for index, (design, point) in enumerate(zip(choice.designs, choice.points, strict=True)):
        clutch = study.clutch.with_dog(study.dog_with(study.named(question.designs[design])))
        own = APART + 1000 * seed + index
        count = study.file.surrogate.angles
        place, unsure = study.points[point], study.uncertainty
        blocks.append(even_block(clutch, place, count, (own, 0), uncertainty=unsure))
    return blocks
