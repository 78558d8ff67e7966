"""The surrogate of a study: simulation of its data, fit, validation and file.

A folder of a search holds the search's own shifts. A folder that ``dogshape fit`` fills holds
designs that fill their space, in ``shifts.jsonl``, and references apart, in ``references.jsonl``;
in two levels the rows are in ``compiled.jsonl``, ``mix.jsonl`` and ``pairs.jsonl``. Rows that the
package brings for the same physics join those of one level.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.filling import filling_blocks, first_designs, own_blocks
from dogshape.pipeline.train.inquiry import Inquiry, inquire
from dogshape.pipeline.train.mix_rows import (
    angles_of,
    count_of,
    expected,
    require_mix,
    simulate_mix_rows,
)
from dogshape.pipeline.train.reference_designs import (
    best_designs,
    first_shifts,
    reference_designs,
    simulate_references,
)
from dogshape.pipeline.train.training_rows import dataset_of, study_mix, with_rows
from dogshape.pipeline.train.two_level_rows import (
    compiled,
    pair_blocks,
    row_blocks,
    row_designs,
    simulate_two_level_references,
    two_level_data,
    two_level_references,
)
from dogshape.sim.errors import InputError
from dogshape.sim.files import naming
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import COLUMNS, Dataset, among
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.fitting import WHOLE, Effort
from dogshape.surrogate.form_choice import compare
from dogshape.surrogate.learning import fit
from dogshape.surrogate.mix_learning import fitted, mix_times
from dogshape.surrogate.model import USUAL, Surrogate
from dogshape.surrogate.references import Reference, reference_of
from dogshape.surrogate.store import Stored, save
from dogshape.surrogate.validation import QUICK, validate
from dogshape.surrogate.validation_figures import Validation, predict, ranked

Say = Callable[[str], None]  #: takes a sentence for people
BESIDE = Effort(rows=450, steps=40)  #: of rows that stand beside designs at all of a study's points
FILLED = 1200  #: rows that parameters are fitted to where a folder was filled for it: minutes


def fill(
    study: Setup,
    folder: StudyFolder,
    jobs: int,
    cluster: str | None = None,
    progress: Progress = SILENT,
    *,
    levels: int = 1,
) -> None:
    """Simulate own designs, some that fill their space, and references; go on where stopped.

    In two ``levels`` most shifts are of the compiled engine (``pipeline.train.two_level_rows``).
    InputError for a study that searches its operation: a stored shift does not say which.
    """
    _require_shapes_alone(study)
    if levels == 2:
        _fill_in_two_levels(study, folder, jobs, cluster, progress)
        return
    settings = study.file.surrogate
    connect(cluster)
    with folder.writing():
        folder.open(study, resume=True)
        designs = first_designs(study, settings.designs)
        own = own_blocks(study)
        blocks = [
            block
            for index, design in enumerate(designs)
            for block in filling_blocks(study, design, index, settings.seed)
        ]
        total = sum(len(block.angles) for block in (*own, *blocks))
        with (
            WorkCounter(progress, total + first_shifts(study)) as counter,
            counter.kept_in(folder.root, "the same command goes on"),
        ):
            shifts, apart_from_them = map(ShiftJournal, (folder.shifts, folder.references))
            _executor(shifts, jobs, cluster, counter).run([*own, *blocks])
            executor = _executor(apart_from_them, jobs, cluster, counter)
            both = _references(study, folder, designs, counter)
            simulate_references(study, both, executor, counter.extend)
            for journal in (shifts, apart_from_them):
                journal.say_unfinished(progress.say)


def _executor(
    journal: ShiftJournal, jobs: int, cluster: str | None, counter: WorkCounter
) -> Executor:
    return Executor(journal, jobs, counter.advance, cluster, counter.known, counter.advance)


def _references(
    study: Setup, folder: StudyFolder, designs: list[dict[str, float]], counter: WorkCounter
) -> list[dict[str, float]]:
    """Choose the designs of the references: some that fill the space, and some of the best."""
    wanted = study.file.surrogate.references
    apart = [one for one in reference_designs(study, wanted) if one not in designs]
    return [*apart, *_best(study, folder, counter)]


def _require_shapes_alone(study: Setup) -> None:
    if study.searches_operation:
        others = [key for key in study.variables if key not in study.shape_keys]
        raise InputError(
            f"the study searches {', '.join(others)}, which the surrogate learns from a search "
            "alone; run 'dogshape study', which leaves one, or take them out of [variables]"
        )


def _fill_in_two_levels(
    study: Setup, folder: StudyFolder, jobs: int, cluster: str | None, progress: Progress
) -> None:
    require_mix(study)
    connect(cluster)
    with folder.writing():
        folder.open(study, resume=True)
        designs = row_designs(study)
        own = own_blocks(compiled(study))
        cheap, dear = row_blocks(study, designs), pair_blocks(study, designs)
        every, few = (sum(len(block.angles) for block in both) for both in ([*own, *cheap], dear))
        every += count_of(study) * angles_of(study) * len(study.points)
        with (
            WorkCounter(progress, every + few + first_shifts(study)) as counter,
            counter.kept_in(folder.root, "the same command goes on"),
        ):
            files = folder.compiled, folder.pairs, folder.compiled_references, folder.references
            journals = [ShiftJournal(path) for path in files]
            rows, pairs, many, one_each = (
                _executor(journal, jobs, cluster, counter) for journal in journals
            )
            rows.run([*own, *cheap])
            pairs.run(dear)
            simulate_mix_rows(compiled(study), folder, rows)
            both = _references(study, folder, designs, counter)
            simulate_two_level_references(study, both, (many, one_each), counter.extend)
            for journal in journals:
                journal.say_unfinished(progress.say)


def ask_more(
    folder: StudyFolder,
    inquiry: Inquiry,
    jobs: int,
    cluster: str | None = None,
    progress: Progress = SILENT,
) -> None:
    """Simulate more about a question into a folder that has shifts already."""
    connect(cluster)
    study = folder.stored_study()
    _require_shapes_alone(study)
    with folder.writing(), WorkCounter(progress, inquiry.shifts) as counter:
        executor = Executor(ShiftJournal(folder.shifts), jobs, counter.advance, cluster)
        with counter.kept_in(folder.root, "the same command goes on"):
            deque(inquire(study, inquiry, executor, progress.say), maxlen=0)


def _best(study: Setup, folder: StudyFolder, counter: WorkCounter) -> list[dict[str, float]]:
    """Return designs of the best tenth, by a quick fit; chosen once and kept."""
    if not folder.best.exists():
        counter.say("choosing references among the best designs")
        write_json(folder.best, {"designs": best_designs(study, _quickly(study, folder))})
    remedy = "remove it and fit again"
    kept: list[dict[str, float]] = read_json(folder.best, remedy).get("designs", [])
    return kept


def _quickly(study: Setup, folder: StudyFolder) -> Callable[[Array], Array]:
    """Give what predicts the expected times of designs (m, d) from a folder's rows, (m,), s."""
    data, mixed = _data_of(study, folder)
    if mixed is not None:
        return partial(
            expected, fitted(mix_times(data, mixed.rows, study_mix(study)), points=False)
        )
    over = Over(fit(data, effort=QUICK), study_mix(study))
    return lambda x: over.predict(x)[0]


def train(
    folder: StudyFolder, out: Path | None = None, *, choose: bool = False, say: Say = SILENT.say
) -> Stored:
    """Fit the surrogate to the shifts of a folder, judge it and write it.

    ``choose`` compares the alternative forms and takes the best; else the usual one is taken.
    Fewer designs than it needs raise InputError.
    """
    study = folder.stored_study()
    data, mixed = _data_of(study, folder)
    scores = compare(data, study.file.surrogate.seed, say) if choose else []
    effort = _effort(study, folder, data)
    surrogate = fit(data, scores[0].form if scores else USUAL, effort=effort)
    if mixed is not None:
        say("the expected time over the study's own operating points")
        own = fitted(mix_times(data, mixed.rows, study_mix(study)))
        surrogate = replace(surrogate, own=own)
    figures = _judged(study, folder, surrogate)
    stored = Stored(surrogate, figures, tuple(score.as_dict() for score in scores))
    save(out or folder.surrogate, stored)
    with naming(folder.points):
        data.frame().to_csv(folder.points, index=False)
    return stored


def _effort(study: Setup, folder: StudyFolder, data: Dataset) -> Effort:
    """Return the effort with which the parameters of rows are fitted."""
    seed = study.file.surrogate.seed
    if data.levels:
        return Effort(BESIDE.rows, BESIDE.steps, seed)
    return Effort(FILLED if folder.references.exists() else WHOLE.rows, seed=seed)


def _data_of(study: Setup, folder: StudyFolder) -> tuple[Dataset, Dataset | None]:
    """Return the rows of a folder, and those of designs at all of the study's operating points."""
    if folder.compiled.exists():
        data, mixed = two_level_data(study, folder)
        return data, mixed if len(mixed) else None
    # A shift does not say which set-point and factors moved its operating point there.
    shifts = [] if study.searches_operation else [*ShiftJournal(folder.shifts).rows.values()]
    # Of a search in two levels the rows say what its shifts do, and more.
    if study.two_levels and folder.others.exists():
        seed = study.file.expectation.seed
        shifts = [shift for shift in shifts if shift.get("seed") != seed]
    own = dataset_of(study, shifts)
    if not folder.others.exists():
        return own, None
    rows = read_json(folder.others, "run 'dogshape study' with --resume to write it again")
    width = len(study.variables) + len(COLUMNS)
    shared = with_rows(study, np.array(rows["rows"], dtype=float).reshape(-1, width))
    return shared.joined(own), None


def _judged(study: Setup, folder: StudyFolder, surrogate: Surrogate) -> Validation:
    """Validate a surrogate, by the folder's references where it has some."""
    mix = study_mix(study)
    if not folder.references.exists():
        return validate(surrogate, mix)
    space, best = references_of(study, folder)
    if len(space) == 0:
        raise InputError(
            f"{folder.references} holds no design that engages at every operating point of the "
            "study; run 'dogshape fit' for the study again to finish its references"
        )
    found = validate(surrogate, mix, space)
    return ranked(found, best, predict(surrogate, best.x, mix).time) if len(best) else found


def references_of(study: Setup, folder: StudyFolder) -> tuple[Reference, Reference]:
    """Return the references of a filled folder that fill the space, and those of the best."""
    if folder.compiled_references.exists():
        whole = two_level_references(study, folder)
    else:
        data = dataset_of(study, ShiftJournal(folder.references).rows.values())
        whole = reference_of(data, study_mix(study))
    kept = read_json(folder.best, "fit again").get("designs", []) if folder.best.exists() else []
    best = whole.of(study.rows(kept))
    return whole.of(whole.x[~among(whole.x, best.x)]), best
