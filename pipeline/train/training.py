"""The surrogate of a study: simulation of its data, fit, validation and file.

A folder of a search has the rows of the search in ``rows.json``. A folder that ``dogshape fit``
fills has in ``simulated.jsonl`` designs to learn from and references that judge the surrogate.
Two thirds of the designs fill the space. The others are of the fifth that is expected to be best
then, where a search has to tell designs apart; so are some references, of the best tenth. They
are chosen once and kept in ``chosen.json``. Without references each design is predicted from the
others.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.design_rows import Job, jobs_of, simulate_designs, simulated_rows
from dogshape.pipeline.train.filling import Values, first_designs, own_designs
from dogshape.pipeline.train.training_rows import with_rows
from dogshape.sim.errors import InputError
from dogshape.sim.files import naming
from dogshape.surrogate.dataset import COLUMNS, Dataset
from dogshape.surrogate.model import MIN_DESIGNS, fit
from dogshape.surrogate.process import Effort
from dogshape.surrogate.store import Stored, save
from dogshape.surrogate.validation_figures import ranked, validate

LEAST_ANGLES = 16  #: of an operating point
LEAST_SHIFTS = 128  #: of a design
MOST_DESIGNS = 800  #: more take longer to ask than they are worth
FILLING_SHARE = 2.0 / 3.0  #: share of the designs that fill the space
BEST, BEST_REFERENCES = 5, 10  #: one in so many of a pool is taken
POOL, APART = 60_000, 90_000  #: added to the seed for a pool of designs, and for references

Say = Callable[[str], None]  #: takes a sentence for people


def angles_of(study: Setup) -> int:
    """Count the angles at each operating point of a design: a power of two."""
    angles = LEAST_ANGLES
    while angles * len(study.points) < LEAST_SHIFTS:
        angles *= 2
    return angles


def count_of(study: Setup) -> int:
    """Count the designs that the study's ``mix_shifts`` are enough for, ``MOST_DESIGNS`` at most.

    Raises InputError for too few.
    """
    given, each = study.file.surrogate.mix_shifts, angles_of(study) * len(study.points)
    least = math.ceil(MIN_DESIGNS / FILLING_SHARE)  # the first of them choose the others
    if given // each < least:
        raise InputError(
            f"surrogate.mix_shifts = {given} is enough for {given // each} designs of {each} "
            f"shifts, but the expected time over the study's operating points needs {least} "
            f"at least; give {least * each} or more"
        )
    return min(MOST_DESIGNS, given // each)


def fill(
    study: Setup,
    folder: StudyFolder,
    jobs: int,
    cluster: str | None = None,
    progress: Progress = SILENT,
) -> None:
    """Simulate designs and references; go on where stopped.

    InputError for a study that searches its operation, as a stored shift does not say which, and
    for too few ``surrogate.mix_shifts``.
    """
    if study.searches_operation:
        others = [key for key in study.variables if key not in study.shape_keys]
        raise InputError(
            f"the study searches {', '.join(others)}, which the surrogate learns from a search "
            "alone; run 'dogshape study', which leaves one, or take them out of [variables]"
        )
    settings, working = study.file.surrogate, study.working
    angles = count_of(study) * angles_of(study)
    angles += (settings.references + settings.best_references) * settings.reference_angles
    connect(cluster)
    with folder.writing():
        folder.open(study, resume=True)
        with (
            WorkCounter(progress, angles * len(study.points)) as counter,
            counter.kept_in(folder.root, "the same command goes on"),
        ):
            journal = ShiftJournal(folder.running)
            executor = Executor(journal, jobs, counter.advance, cluster, counter.known)
            simulate_designs(working, folder.simulated, filling_jobs(working), executor)
            if not folder.chosen.exists():
                counter.say("choosing among the designs that are expected to be best")
                write_json(folder.chosen, _choose(working, folder))
            for some in later_jobs(working, folder):
                simulate_designs(working, folder.simulated, some, executor)
            journal.say_unfinished(progress.say)
            folder.running.unlink(missing_ok=True)


def filling_jobs(study: Setup) -> list[Job]:
    """List the study's own designs and those that fill its space."""
    own = own_designs(study)
    designs = [*own, *first_designs(study, round(FILLING_SHARE * count_of(study)) - len(own))]
    return jobs_of(designs, angles_of(study), study.file.surrogate.seed)


def later_jobs(study: Setup, folder: StudyFolder) -> tuple[list[Job], list[Job], list[Job]]:
    """List designs of the best fifth, references over the space, and those of the best tenth."""
    chosen = read_json(folder.chosen, "run 'dogshape fit' for the study again to finish it")
    settings = study.file.surrogate
    references = first_designs(study, settings.references, APART, border=False)
    dense, seed = settings.reference_angles, settings.seed
    return (
        jobs_of(chosen["designs"], angles_of(study), seed + POOL),
        jobs_of(references, dense, seed + APART),
        jobs_of(chosen["references"], dense, seed + APART + 1),
    )


def _choose(study: Setup, folder: StudyFolder) -> dict[str, list[Values]]:
    """Choose designs and references of those that are expected to be best."""
    jobs, settings = filling_jobs(study), study.file.surrogate
    model = fit(with_rows(study, simulated_rows(study, folder.simulated, jobs)))
    known = [job.design for job in jobs]

    def best(pool: list[Values], count: int) -> list[Values]:
        if not pool:
            return []
        order = np.argsort(model.predict(study.rows(pool))[0], kind="stable")
        return [pool[place] for place in sorted(order[:count].tolist())]

    count = count_of(study) - len(jobs)
    pool = [d for d in first_designs(study, BEST * count, POOL, border=False) if d not in known]
    designs = best(pool, count)
    drawn = settings.references + BEST_REFERENCES * settings.best_references
    others = first_designs(study, drawn, APART, border=False)[settings.references :]
    left = [design for design in others if design not in known and design not in designs]
    return {"designs": designs, "references": best(left, settings.best_references)}


def train(folder: StudyFolder, out: Path | None = None, *, say: Say = SILENT.say) -> Stored:
    """Fit the surrogate to the shifts of a folder, judge it and write it.

    Fewer designs than it needs raise InputError.
    """
    study = folder.stored_study().working
    data = _data_of(study, folder)
    say(f"fitting the surrogate to {len(data)} designs")
    surrogate = fit(data, Effort(seed=study.file.surrogate.seed))
    if folder.chosen.exists():
        references, best = references_of(study, folder)
        validation = ranked(validate(surrogate, references), surrogate, best)
    else:
        validation = validate(surrogate)
    stored = Stored(surrogate, validation)
    save(out or folder.surrogate, stored)
    with naming(folder.points):
        data.frame().to_csv(folder.points, index=False)
    return stored


def _data_of(study: Setup, folder: StudyFolder) -> Dataset:
    """Collect the designs of a folder that the surrogate learns from."""
    if not folder.rows.exists():
        jobs = [*filling_jobs(study), *later_jobs(study, folder)[0]]
        return with_rows(study, simulated_rows(study, folder.simulated, jobs))
    rows = read_json(folder.rows, "run 'dogshape study' with --resume to write it again")["rows"]
    width = len(study.variables) + len(COLUMNS)
    return with_rows(study, np.array(rows, dtype=float).reshape(-1, width))


def references_of(study: Setup, folder: StudyFolder) -> tuple[Dataset, Dataset]:
    """Return the references of a filled folder that fill the space, and those of the best.

    ``study`` is in the engine that simulated them.
    """
    _, space, best = (
        with_rows(study, simulated_rows(study, folder.simulated, jobs))
        for jobs in later_jobs(study, folder)
    )
    return space, best
