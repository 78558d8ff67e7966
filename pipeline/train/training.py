"""The surrogate of a study: simulation of its data, fit, validation and file.

A folder of a search has the rows of the search in ``rows.json``. ``dogshape fit`` fills
``simulated.jsonl`` with a line for each design of four parts. Two thirds of the designs fill the
space; every third one of these breaks a limit by up to ``BORDER_WIDTH``, so that the border has
data on both sides. The others are of the fifth that is then expected to be best. References judge
the surrogate, over the space and of the best tenth. Without them each design is predicted from the
others. Half of the angles of an operating point are even; in a few rounds the others halve the
intervals in which the time most likely jumps (``sim.statistics.bisection``).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, cycle, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, Progress, Say, WorkCounter
from dogshape.pipeline.simulate.design import explain_infeasible, mark_worthy, nearest_filling
from dogshape.pipeline.simulate.evaluation import Params
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.folder import (
    ShiftJournal,
    StudyFolder,
    append,
    read_json,
    read_lines,
    rewrite_remedy,
    write_json,
)
from dogshape.pipeline.store.folder_lock import lock_folder
from dogshape.pipeline.train.training_rows import row_record, with_rows
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.files import name_file_in_errors
from dogshape.sim.interface import verb
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.expectation import mean_round_the_pitch, middles_of_jumps
from dogshape.sim.statistics.shift_records import (
    Record,
    angle_of,
    content_key,
    diverged,
    result_of,
    unfinished,
)
from dogshape.sim.strength.checks import feasible
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.locking import face_angle
from dogshape.sim.strength.manufacture import manufacturing_checks
from dogshape.sim.versions import engine_versions
from dogshape.surrogate.dataset import COLUMNS, Dataset, row_of
from dogshape.surrogate.model import MIN_DESIGNS, fit
from dogshape.surrogate.process import Effort
from dogshape.surrogate.store import Stored, save, validate

MIN_ANGLES = 16  #: relative angles at an operating point
MIN_SHIFTS = 128  #: shifts of a design
MAX_DESIGNS = 800  #: more make a slow surrogate that is hardly better
FILLING_SHARE = 2.0 / 3.0  #: share of the designs that fill the space
POOL_RATIO = 5  #: designs of a pool for each that is taken as expected best
REFERENCE_POOL_RATIO = 10  #: designs of a pool for each reference that is expected best
POOL_SEED = 60_000  #: added to the seed for the pool of designs
REFERENCE_SEED = 90_000  #: added to the seed for references
HALVING_ROUNDS = (3, 3, 2)  #: sixteenths of the angles that halve intervals, by round
BATCH = 32  #: designs that are simulated before their rows are written

BORDER_WIDTH = 0.15  #: share of a limit by which designs beyond the border break it
BORDER_PERIOD = 3  #: designs for each that lies beyond the border
MAX_MISSES = 2**16  #: draws without a new design after which there is none
DRAW_SIZE = 256  #: designs of one draw


def prototype_designs(study: Setup) -> list[Params]:
    """List the study's own dog; none if it cannot be made or its face is held by friction."""
    dog = study.clutch.dog
    if not feasible(manufacturing_checks(dog, study.limits.manufacturing)):
        return []
    load = study.limits.load
    slides = face_angle(dog) > math.atan(load.face_release_friction)
    return [study.prototype] if slides or not load.faces_release else []


def first_designs(
    study: Setup, count: int, seed_offset: int = 0, *, border: bool = True
) -> list[Params]:
    """List designs that fill the feasible space and, with ``border``, a band beyond it.

    They are the first of the sequence of the study's seed and ``seed_offset``; less than ``count``
    where whole numbers alone are searched.
    """
    seed = study.file.surrogate.seed + seed_offset
    inside = _sobol_designs(study, seed)
    beyond = _sobol_designs(study, seed + 1, beyond=True)
    turns = islice(cycle([False] * (BORDER_PERIOD - 1) + [border]), count)
    designs = []
    for is_beyond in turns:
        design = next(beyond, {}) if is_beyond else {}
        design = design or next(inside, {})
        if not design:
            break
        designs.append(design)
    return designs


def _sobol_designs(study: Setup, seed: int, beyond: bool = False) -> Iterator[Params]:
    """Yield distinct designs of a Sobol sequence that are feasible, or just beyond a limit."""
    sequence = qmc.Sobol(len(study.variables), seed=seed)
    yielded: set[tuple[float, ...]] = set()
    misses = 0
    while misses < MAX_MISSES:
        designs = [_design(study, shares) for shares in sequence.random(DRAW_SIZE)]
        if beyond:
            marks: Iterable[bool] = (_is_just_beyond(study, design) for design in designs)
        else:
            marks = mark_worthy(study, designs)
        for design, is_wanted in zip(designs, marks, strict=True):
            misses += 1
            values = tuple(design.values())
            if is_wanted and values not in yielded:
                misses = 0
                yielded.add(values)
                yield design
    if not yielded and not beyond:
        raise InputError(explain_infeasible(study, MAX_MISSES, nearest_filling(study)))


def _design(study: Setup, shares: Array) -> Params:
    """Place a design in the search ranges by shares of them, (d,)."""
    design: Params = {}
    for (name, (low, high)), share in zip(study.variables.items(), shares, strict=True):
        if name == "count":
            design[name] = int(low + math.floor(share * (high - low + 1.0)))
        else:
            design[name] = round(float(low + share * (high - low)), 3)
    return design


def _is_just_beyond(study: Setup, design: Params) -> bool:
    """Whether a design breaks a limit, none by more than ``BORDER_WIDTH``, and is released."""
    try:
        checks = strength_checks(study.dog_with(design), study.with_design(design).limits)
    except GeometryError:
        return False
    releases = [check for check in checks if check.name.endswith("_release")]
    is_near = all(check.margin >= -BORDER_WIDTH for check in checks)
    return is_near and feasible(releases) and not feasible(checks)


@dataclass(frozen=True)
class Job:
    """Simulation of a design: its number of angles at each point, and their draw.

    Each ``index`` of a part has angles of its own: common angles err like a bias.
    """

    design: Params
    angles: int
    seed: int
    index: int

    def rounds(self, study: Setup) -> tuple[int, ...]:
        """List the angles of each round that halves intervals; none where all are even."""
        if study.uncertainty is not None:
            return ()
        return tuple(self.angles * sixteenths // 16 for sixteenths in HALVING_ROUNDS)

    def blocks(self, study: Setup) -> list[Block]:
        """Build the even angles of the design, a block for each operating point."""
        clutch = study.clutch_with(self.design)
        even_angles = self.angles - sum(self.rounds(study))
        first_place = self.index * len(study.points)
        return [
            even_block(
                clutch, point, even_angles, (self.seed, place), uncertainty=study.uncertainty
            )
            for place, point in enumerate(study.points, first_place)
        ]

    def key(self, study: Setup) -> str:
        """Hash the inputs of the design's shifts."""
        first_keys = [[block.first_key, len(block.angles)] for block in self.blocks(study)]
        inputs = {"blocks": first_keys, "halved": list(self.rounds(study)), **engine_versions()}
        return content_key(inputs)


def simulate_designs(
    study: Setup, path: Path, part: str, jobs: Sequence[Job], executor: Executor
) -> None:
    """Simulate the designs of a part that a file lacks, and append their rows to it.

    The journal forgets their shifts.
    """
    stored_keys = {line.key for line in _lines(path)}
    jobs_by_key = {job.key(study): job for job in jobs}
    missing_keys = [key for key in jobs_by_key if key not in stored_keys]
    stored_angles = sum(jobs_by_key[key].angles for key in jobs_by_key.keys() & stored_keys)
    stored_shifts = len(study.points) * stored_angles
    executor.progress(stored_shifts, stored_shifts)
    for start in range(0, len(missing_keys), BATCH):
        batch = [jobs_by_key[key] for key in missing_keys[start : start + BATCH]]
        for job, shifts in zip(batch, _simulate_jobs(study, batch, executor), strict=True):
            if any(unfinished(shift) for shift in chain(*shifts)):
                continue
            rows = np.array(
                [_row(study, job, point_shifts) for point_shifts in shifts], dtype=float
            )
            design = FittedDesign(job.key(study), part, row_record(rows))
            append(path, design._asdict())
        executor.drop_shifts()


class FittedDesign(NamedTuple):
    """Finished design of a fit; its fields are the keys of its line in a file."""

    key: str  #: of its job
    part: str  #: ``filling``, ``best``, ``references`` or ``best_references``
    rows: list[list[float | None]]  #: a row for each operating point, as ``row_record`` writes it


def _lines(path: Path) -> list[FittedDesign]:
    """Read the finished designs of a fit."""
    lines = read_lines(path, lambda line: FittedDesign(**line), "a finished design")
    return [FittedDesign(**line) for line in lines]


def simulated_data(study: Setup, path: Path, *parts: str) -> Dataset:
    """Collect the designs of some parts in a file; ``study`` has the engine of their shifts."""
    rows = list(chain(*(line.rows for line in _lines(path) if line.part in parts)))
    return with_rows(study, rows)


def _simulate_jobs(
    study: Setup, jobs: Sequence[Job], executor: Executor
) -> list[list[list[Record]]]:
    """Simulate designs at even angles, then where their times jump; by design and point."""
    blocks = list(chain(*(job.blocks(study) for job in jobs)))
    shifts = executor.run(blocks)
    for count in jobs[0].rounds(study):  # the same for all jobs of a part
        halving_blocks = []
        for block, records in zip(blocks, shifts, strict=True):
            phases, times = _phases_and_times(records)
            angles = middles_of_jumps(phases, times, count) * block.clutch.dog.pitch_angle
            halving_blocks.append(replace(block, angles=tuple(angles.tolist())))
        new_shifts = executor.run(halving_blocks)
        shifts = [[*even, *new] for even, new in zip(shifts, new_shifts, strict=True)]
    size = len(study.points)
    return [shifts[start : start + size] for start in range(0, len(shifts), size)]


def _phases_and_times(shifts: Sequence[Record]) -> tuple[Array, Array]:
    """Return the angles of shifts in fractions of a pitch and their times, (n,) each."""
    phases = [angle_of(shift).pitches for shift in shifts]
    times = [result_of(shift).shift_time for shift in shifts]
    return np.array(phases), np.array(times, dtype=float)


def _row(study: Setup, job: Job, shifts: Sequence[Record]) -> list[float] | None:
    """Compute the row of a design at one operating point from its shifts, even angles first.

    Mean and share engaged are over the pitch: angles are dense where shifts hang.
    """
    x = study.rows([job.design])[0].tolist()
    halving_count = sum(job.rounds(study))
    row = row_of(x, shifts[: len(shifts) - halving_count])
    if row is None or not halving_count:
        return row
    phases, times = _phases_and_times(shifts)
    mean, variance = mean_round_the_pitch(phases, times)
    order = np.argsort(phases)
    gaps = np.diff(phases[order], append=phases[order[0]] + 1.0)
    widths = 0.5 * (gaps + np.roll(gaps, 1))
    engaged_share = float(widths @ np.isfinite(times[order]))
    valid_count = sum(not diverged(shift) for shift in shifts)
    values = {
        "mean_s": mean,
        "standard_error_s": variance**0.5,
        "shifts": float(valid_count),
        "engaged": round(engaged_share * valid_count, 6),
    }
    for name, value in values.items():
        row[len(x) + COLUMNS.index(name)] = value
    return row


def angles_of(study: Setup) -> int:
    """Return the number of angles of a design at each operating point, a power of two."""
    return max(MIN_ANGLES, 2 ** math.ceil(math.log2(MIN_SHIFTS / len(study.points))))


def count_of(study: Setup) -> int:
    """Return the number of designs for ``surrogate.mix_shifts``; InputError for too few."""
    mix_shifts = study.file.surrogate.mix_shifts
    design_shifts = angles_of(study) * len(study.points)
    count = mix_shifts // design_shifts
    min_count = math.ceil(MIN_DESIGNS / FILLING_SHARE)  # the first of them choose the others
    if count < min_count:
        raise InputError(
            f"surrogate.mix_shifts = {mix_shifts} is enough for {count} designs of {design_shifts} "
            f"shifts, but the expected time over the study's operating points needs {min_count} "
            f"at least; give {min_count * design_shifts} or more"
        )
    return min(MAX_DESIGNS, count)


def fill(
    study: Setup, folder: StudyFolder, jobs: int, cluster: str | None, progress: Progress
) -> None:
    """Simulate designs and references of a surrogate in a folder, without finished ones.

    InputError for a study that searches its operation, and for too few ``surrogate.mix_shifts``.
    """
    _require_shape_only(study)
    settings = study.file.surrogate
    count = count_of(study)
    reference_count = settings.references + settings.best_references
    angle_count = count * angles_of(study) + reference_count * settings.reference_angles
    resumption = f"{folder.root}; the same command goes on"
    connect(cluster)
    with lock_folder(folder.root):
        folder.open(study, resume=True)
        shift_count = angle_count * len(study.points)
        with WorkCounter(progress, shift_count, resumption=resumption) as counter:
            journal = ShiftJournal(folder.running)
            executor = Executor(journal, jobs, counter.advance, cluster)
            _fill_parts(study.search_setup, folder, count, executor=executor, say=counter.say)
            journal.say_unfinished(progress.say)
            folder.running.unlink(missing_ok=True)


def _require_shape_only(study: Setup) -> None:
    """Raise InputError for a study that searches keys of its operation."""
    operation_keys = [key for key in study.variables if key not in study.shape_keys]
    if operation_keys:
        raise InputError(
            f"the study searches {', '.join(operation_keys)}, which the surrogate learns from a "
            f"search alone; run {verb('search')}, which leaves one, or take them out of [variables]"
        )


def _fill_parts(
    study: Setup, folder: StudyFolder, count: int, *, executor: Executor, say: Say
) -> None:
    """Simulate the four parts of a fit with ``count`` designs besides references."""
    path = folder.simulated
    settings = study.file.surrogate

    def simulate(part: str, designs: Sequence[Params], angles: int, seed_offset: int = 0) -> None:
        seed = settings.seed + seed_offset
        jobs = [Job(design, angles, seed, index) for index, design in enumerate(designs)]
        simulate_designs(study, path, part, jobs, executor)

    angles = angles_of(study)
    prototypes = prototype_designs(study)
    filling_count = round(FILLING_SHARE * count) - len(prototypes)
    filling = [*prototypes, *first_designs(study, filling_count)]
    simulate("filling", filling, angles)
    if not folder.chosen.exists():
        say("choosing among the designs that are expected to be best")
        best = _choose_best(study, path, filling, count - len(filling))
        write_json(folder.chosen, best._asdict())
    chosen = BestDesigns(**read_json(folder.chosen, "remove it and run the same command again"))
    simulate("best", chosen.designs, angles, POOL_SEED)
    references = first_designs(study, settings.references, REFERENCE_SEED, border=False)
    simulate("references", references, settings.reference_angles, REFERENCE_SEED)
    simulate("best_references", chosen.references, settings.reference_angles, REFERENCE_SEED + 1)


class BestDesigns(NamedTuple):
    """Designs that a first fit expects to be best, and references; the keys of their file."""

    designs: list[Params]
    references: list[Params]


def _choose_best(study: Setup, path: Path, filling: list[Params], count: int) -> BestDesigns:
    """Choose ``count`` designs, and references, that a first fit expects to be best.

    They are from pools of new designs; ``filling`` are the designs of the first fit.
    """
    settings = study.file.surrogate
    model = fit(simulated_data(study, path, "filling"))

    def best(pool: list[Params], count: int) -> list[Params]:
        if not pool:
            return []
        order = np.argsort(model.predict(study.rows(pool))[0], kind="stable")
        return [pool[index] for index in sorted(order[:count].tolist())]

    pool = first_designs(study, POOL_RATIO * count, POOL_SEED, border=False)
    designs = best([design for design in pool if design not in filling], count)
    pool_size = settings.references + REFERENCE_POOL_RATIO * settings.best_references
    reference_pool = first_designs(study, pool_size, REFERENCE_SEED, border=False)
    candidates = [
        design
        for design in reference_pool[settings.references :]
        if design not in filling and design not in designs
    ]
    return BestDesigns(designs, best(candidates, settings.best_references))


def train(folder: StudyFolder, out: Path | None = None, *, say: Say = SILENT.say) -> Stored:
    """Fit the surrogate to the shifts of a folder, validate it and write it.

    ``out`` is its file, by default in the folder. InputError for too few designs.
    """
    study = folder.stored_study().search_setup
    path = folder.simulated
    if folder.rows.exists():
        data = with_rows(study, read_json(folder.rows, rewrite_remedy())["rows"])
    else:
        data = simulated_data(study, path, "filling", "best")
    say(f"fitting the surrogate to {len(data)} designs")
    surrogate = fit(data, Effort(seed=study.file.surrogate.seed))
    parts = ("references", "best_references") if folder.chosen.exists() else ()
    references = [simulated_data(study, path, part) for part in parts]
    stored = Stored(surrogate, validate(surrogate, *references))
    save(out or folder.surrogate, stored)
    with name_file_in_errors(folder.points):
        data.frame().to_csv(folder.points, index=False)
    return stored
