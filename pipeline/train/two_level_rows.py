"""Rows of two levels: many shifts of the compiled engine, corrected by some of Drake's.

Rows have the designs and operating points of one level and ``DENSE`` times the angles, all in the
compiled engine; other designs have all of the study's points (``pipeline.train.mix_rows``).
``PAIRS`` of the rows, one a design, have ``FEW`` of the same angles in Drake too, which says what
the compiled engine's means are off by (``surrogate.discrepancy``).

References are not corrected by that fit, or its errors would be in what judges it. Each has one
shift of Drake at ``APIECE`` or more operating points, at other points and angles from design to
design. What these differ by from the compiled engine's, in the mean over all references of like
mismatch, is added to the references, and its standard error to theirs: a pair of shifts that part
at a crest differ by tens of milliseconds, and would leave a reference that it alone corrected with
an error larger than that of its angles. Each reference draws angles of its own: with common ones
their errors would go together, and look like a bias of what they judge.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.filling import filling_blocks, first_designs, own_designs
from dogshape.pipeline.train.mix_rows import mix_rows
from dogshape.pipeline.train.reference_designs import APART, simulate_references
from dogshape.pipeline.train.training_rows import dataset_of, shifts_of, study_mix
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import DIGITS, WHERE, Dataset, among
from dogshape.surrogate.discrepancy import Pair, discrepancy_of
from dogshape.surrogate.model import MIN_DESIGNS
from dogshape.surrogate.references import Reference, reference_of

PAIRS = 80  #: rows that Drake has, too
FEW = 4  #: angles of such a row in Drake
DENSE = 2  #: the compiled engine has so many times a row's angles
APIECE = 8  #: operating points of a reference that Drake has, about
NEAR = 6  #: decimals of a relative angle in degrees by which two engines have the same

Place = tuple[tuple[float, ...], tuple[float, ...]]  #: design and operating point
Times = dict[Place, dict[float, float]]  #: of shifts that engage, s, by relative angle in degrees


def compiled(study: Setup) -> Setup:
    """Return the same study in the compiled engine."""
    return replace(study, clutch=study.clutch.with_engine("planar"))


def row_designs(study: Setup) -> list[dict[str, float]]:
    """Return the designs with operating points of their own: half of those of one level.

    Designs at all of the study's points say most about its expected time; these say how times run
    from point to point.
    """
    return first_designs(study, max(MIN_DESIGNS, study.file.surrogate.designs // 2))


def row_blocks(study: Setup, designs: Sequence[dict[str, float]]) -> list[Block]:
    """Return the shifts of all rows in the compiled engine."""
    seed, angles = study.file.surrogate.seed, study.file.surrogate.angles
    dense = FEW * math.ceil(DENSE * angles / FEW)
    return [
        block
        for index, design in enumerate(designs)
        for block in filling_blocks(compiled(study), design, index, seed, angles=dense, base=FEW)
    ]


def pair_blocks(study: Setup, designs: Sequence[dict[str, float]]) -> list[Block]:
    """Return the shifts of some rows in Drake: of each of the first designs one operating point."""
    seed, points = study.file.surrogate.seed, study.file.surrogate.points
    return [
        filling_blocks(study, design, index, seed, angles=FEW, base=FEW)[index % points]
        for index, design in enumerate(designs[:PAIRS])
    ]


def simulate_two_level_references(
    study: Setup,
    designs: Sequence[dict[str, float]],
    executors: tuple[Executor, Executor],
    more: Callable[[int], None],
) -> None:
    """Simulate references in the compiled engine, and at some points one of the angles in Drake.

    ``executors`` are of the compiled engine and of Drake; ``more`` is called with the number of
    shifts that come on top of ``first_shifts``.
    """
    simulate_references(compiled(study), designs, executors[0], more, alike=False)
    settings = study.file.surrogate
    count, seed = settings.reference_angles, settings.seed + APART
    blocks = []
    for index, design in enumerate(designs):
        clutch = study.clutch.with_dog(study.dog_with(design))
        for place in paired(index, len(study.points)):
            point, draw = study.points[place], (seed + index, place)
            whole = even_block(clutch, point, count, draw, count, uncertainty=study.uncertainty)
            blocks.append(whole.only([(index + place) % count]))
    more(len(blocks))
    executors[1].run(blocks)


def paired(index: int, size: int) -> range:
    """Return the operating points, of ``size``, that Drake has of the reference at ``index``."""
    stride = max(1, size // APIECE)
    return range(index % stride, size, stride)


def two_level_data(study: Setup, folder: StudyFolder) -> tuple[Dataset, Dataset]:
    """Return the rows of a folder in two levels, as Drake's; InputError for too few pairs.

    Those at operating points of their own, and those of designs at all of the study's.
    """
    cheap = ShiftJournal(folder.compiled).rows.values()
    dear = ShiftJournal(folder.pairs).rows.values()
    data, names = dataset_of(compiled(study), cheap), list(study.variables)
    there = {tuple(round(float(shift[name]), DIGITS) for name in names) for shift in dear}
    beside = [s for s in cheap if tuple(round(float(s[name]), DIGITS) for name in names) in there]
    found = discrepancy_of(pairs_of(times_of(compiled(study), beside), times_of(study, dear)))
    whole = mix_rows(compiled(study), folder)
    shifts = data.shifts + replace(data, rows=whole).shifts
    if len(whole):
        own = np.round(study.rows(own_designs(study)), DIGITS)
        whole = np.concatenate([whole, data.rows[among(data.x, own)]])
    mixed = replace(data, rows=whole)
    levels: dict[str, Any] = {
        "planar": shifts,
        "drake": len(dear),
        "discrepancy": found.as_dict(),
    }
    corrected, also = (
        replace(found.corrected(rows), physics=study.physics, levels=levels)
        for rows in (data, mixed)
    )
    return corrected, also


def two_level_references(study: Setup, folder: StudyFolder) -> Reference:
    """Return the references of a folder in two levels."""
    cheap = ShiftJournal(folder.compiled_references).rows.values()
    dear = ShiftJournal(folder.references).rows.values()
    mix = study_mix(study)
    found = reference_of(dataset_of(compiled(study), cheap), mix)
    apart = _differences(
        found.x, _points(study), times_of(compiled(study), cheap), times_of(study, dear)
    )
    speeds = np.round(np.abs(mix.points[:, 0]), NEAR)
    shift, unsure = np.zeros(len(speeds)), np.zeros(len(speeds))
    for speed in np.unique(speeds):
        pairs = apart[:, speeds == speed]
        pairs = pairs[np.isfinite(pairs)]
        if len(pairs) > 1:
            shift[speeds == speed] = pairs.mean()
            unsure[speeds == speed] = pairs.std(ddof=1) / len(pairs) ** 0.5
    means, errors = found.means + shift, np.hypot(found.errors, unsure)
    return replace(
        found,
        means=means,
        errors=errors,
        time=means @ mix.weights,
        error=np.sqrt(errors**2 @ mix.weights**2),
    )


def times_of(study: Setup, shifts: Iterable[Record]) -> Times:
    """Collect the times of a journal's shifts that are of the study and engage."""
    found: Times = defaultdict(dict)
    for shift in shifts_of(study, shifts):
        time = result_of(shift).shift_time
        if time is not None:
            design = tuple(round(float(shift[name]), DIGITS) for name in study.variables)
            where = tuple(round(shift[name], DIGITS) for name in WHERE)
            found[design, where][round(shift["relative_angle_deg"], NEAR)] = time
    return found


def pairs_of(cheap: Times, dear: Times) -> list[Pair]:
    """Pair the rows of both engines, where three of their angles engage in both."""
    pairs = []
    for (design, where), times in sorted(dear.items()):
        beside = cheap.get((design, where), {})
        both = [angle for angle in times if angle in beside]
        if len(both) > 2:
            ours, theirs = (np.array([one[angle] for angle in both]) for one in (beside, times))
            pairs.append(Pair(where[0], ours, theirs))
    return pairs


def _points(study: Setup) -> list[tuple[float, ...]]:
    """Return mismatch, force and rise of each operating point, as records have them."""
    record = [even_block(study.clutch, point, 1, (0, 0)).inputs[0] for point in study.points]
    return [tuple(round(given[name], DIGITS) for name in WHERE) for given in record]


def _differences(x: Array, points: Sequence[tuple[float, ...]], cheap: Times, dear: Times) -> Array:
    """Return Drake's time less the compiled engine's, of designs (k, d) at points, (k, m), s.

    NaN where a design has no pair, or its shift engages in one of them alone.
    """
    apart = np.full((len(x), len(points)), np.nan)
    for k, row in enumerate(x.tolist()):
        for j, where in enumerate(points):
            place = tuple(row), where
            beside = cheap.get(place, {})
            found = [t - beside[a] for a, t in dear.get(place, {}).items() if a in beside]
            apart[k, j] = np.mean(found) if found else np.nan
    return apart
