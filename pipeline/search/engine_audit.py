"""Agreement of the compiled engine with Drake.

An *audit* simulates random shifts of the search again in Drake.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import chain

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Say
from dogshape.pipeline.simulate.evaluation import OperatedDesign, Params
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.store.result_records import EngineAgreement
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record as Shift
from dogshape.sim.statistics.shift_records import result_of

#: Share of shifts that may end differently in both engines: at the angles between two slots a
#: rounding decides, in up to 0.8 % of the shifts of a clutch (``docs/evidence/engines.txt``).
DIFFERENT_OUTCOME_SHARE = 0.01
#: Difference of the engines' means over Drake's; measured are 0.06 %, at most 0.8 %.
MEAN_TOLERANCE = 0.01
ENGINE_SIGMAS = 3.0  #: standard errors from which a difference of the engines counts


def agreement_of(pairs: Sequence[tuple[Shift, Shift]]) -> EngineAgreement:
    """Compare shifts of the compiled engine with the same shifts in Drake.

    They agree where no more than ``max(1, n r + 3 sqrt(n r))`` of *n* shifts end differently, with
    *r* the share ``DIFFERENT_OUTCOME_SHARE``, and the means of those that engage in both differ by
    no more than ``MEAN_TOLERANCE`` or three standard errors. Deviations are 0 where none does.
    """
    results = [(result_of(compiled), result_of(drake)) for compiled, drake in pairs]
    same_count = sum(compiled.outcome is drake.outcome for compiled, drake in results)
    time_pairs = [(compiled.shift_time, drake.shift_time) for compiled, drake in results]
    engaged_pairs = [pair for pair in time_pairs if None not in pair] or [(1.0, 1.0)]
    times = np.array(engaged_pairs, dtype=float)
    differences = times[:, 0] - times[:, 1]
    drake_mean = float(times[:, 1].mean())
    sizes = np.abs(differences) / times[:, 1]
    deviation = float(differences.mean()) / drake_mean
    error = 0.0
    if len(differences) > 1:
        error = float(differences.std(ddof=1)) / len(differences) ** 0.5 / drake_mean
    expected_count = DIFFERENT_OUTCOME_SHARE * len(pairs)
    max_count = max(1.0, expected_count + ENGINE_SIGMAS * math.sqrt(expected_count))
    outcomes_agree = len(pairs) - same_count <= max_count
    return EngineAgreement(
        shifts=len(pairs),
        outcome_same=same_count,
        median_deviation=float(np.median(sizes)),
        worst_deviation=float(sizes.max()),
        mean_deviation=deviation,
        standard_error=error,
        agrees=outcomes_agree and abs(deviation) <= max(MEAN_TOLERANCE, ENGINE_SIGMAS * error),
    )


def pair_shifts(
    blocks: Sequence[Block], drake_clutch: Clutch, compiled: Executor, drake: Executor
) -> list[tuple[Shift, Shift]]:
    """Simulate blocks in the compiled engine, and again in Drake; pair the shifts of both."""
    drake_blocks = [
        replace(block, clutch=replace(block.clutch, solver=drake_clutch.solver)) for block in blocks
    ]
    compiled_shifts = chain(*compiled.run(blocks))
    drake_shifts = chain(*drake.run(drake_blocks))
    return list(zip(compiled_shifts, drake_shifts, strict=True))


def audit(
    study: Setup, designs: Sequence[Params], executor: Executor, shifts: int, say: Say
) -> EngineAgreement | None:
    """Simulate random shifts of designs of the compiled engine again in both engines.

    None where Drake does not judge.
    """
    settings = study.file.expectation
    reference = study.reference_setup
    if study.engine_gap:
        say(f"no confirmation by Drake and no audit: {study.engine_gap}")
    if reference is None or not shifts or not designs:
        return None
    say(f"auditing {shifts} shifts of the search in Drake")
    shape = len(designs), len(study.points), settings.angles
    rng = np.random.default_rng([study.file.search.seed, shifts])
    size = math.prod(shape)
    drawn_shifts = np.sort(rng.choice(size, min(shifts, size), replace=False))
    blocks_of = cache(
        lambda place: OperatedDesign.of(study, designs[place]).blocks(
            settings.angles, settings.seed
        )
    )
    places = zip(*np.unravel_index(drawn_shifts, shape), strict=True)
    blocks = [blocks_of(design)[point].only([int(angle)]) for design, point, angle in places]
    # Compiled shifts are quick to repeat: a journal of their own keeps them out of the study's.
    compiled = scratch_executor(executor.jobs, executor.progress, executor.cluster)
    agreement = agreement_of(pair_shifts(blocks, reference.clutch, compiled, executor))
    say(agreement.text)
    return agreement
