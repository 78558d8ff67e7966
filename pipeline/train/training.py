"""The surrogate of a study: simulation of its data, fit, validation and file.

A folder of a search has the rows of the search in ``rows.json``. A folder that ``dogshape fit``
fills has designs that fill their space, each at operating points of its own, in ``shifts.jsonl``;
others at all of the study's operating points in ``mix.jsonl``; references apart in
``references.jsonl``.

A surrogate is judged by references apart, or by designs held out of its own data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.filling import (
    best_designs,
    filling_blocks,
    first_designs,
    first_shifts,
    own_blocks,
    own_designs,
    reference_designs,
    simulate_references,
)
from dogshape.pipeline.train.mix_rows import (
    angles_of,
    count_of,
    expected,
    mix_rows,
    require_mix,
    simulate_mix_rows,
)
from dogshape.pipeline.train.training_rows import dataset_of, study_mix, with_rows
from dogshape.sim.errors import InputError
from dogshape.sim.files import naming
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import COLUMNS, DIGITS, Dataset, Mix, Reference, among, reference_of
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.learning import WHOLE, Effort, fit, fitted, mix_times
from dogshape.surrogate.model import MIN_DESIGNS, Surrogate
from dogshape.surrogate.store import Stored, save
from dogshape.surrogate.validation_figures import Prediction, Validation, figures, predict, ranked

QUICK = Effort(rows=300, steps=20)  #: of the fits to parts of the data


def held_out(
    data: Dataset, mix: Mix, surrogate: Surrogate, folds: int = 6
) -> tuple[Reference, Prediction]:
    """Predict every fully simulated design from fits that never saw it.

    Returns the references and their predictions.
    """
    reference = reference_of(data, mix)
    count = len(reference)
    if count < 2 * MIN_DESIGNS:
        folds = count  # each part fits its own parameters, so it needs all it can have
    if count == 0:
        raise InputError(
            "no design was simulated at every operating point and engaged at each, so nothing "
            "can judge the surrogate; simulate more designs"
        )
    folds = min(folds, count)
    order = np.random.default_rng(0).permutation(count)
    parts: list[Prediction] = []
    for fold in range(folds):
        out = reference.x[order[fold::folds]]
        seen = ~among(data.x, out)
        model = fit(data.subset(seen), like=surrogate, effort=QUICK)
        parts.append(predict(model, out, mix))
    back = np.argsort(np.concatenate([order[fold::folds] for fold in range(folds)]))
    return reference, Prediction(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])[back]
            for field in fields(Prediction)
        )
    )


def validate(surrogate: Surrogate, mix: Mix, reference: Reference | None = None) -> Validation:
    """Judge a surrogate by references apart, or else by holding out designs of its own data."""
    source = "references"
    if reference is None:
        reference, prediction = held_out(surrogate.data, mix, surrogate)
        source = "held out"
    else:
        prediction = predict(surrogate, reference.x, mix)
    return figures(reference, prediction, source, surrogate.data.shifts)


Say = Callable[[str], None]  #: takes a sentence for people
BESIDE = Effort(rows=450, steps=40)  #: of rows that stand beside designs at all of a study's points
FILLED = 1200  #: rows that parameters are fitted to where a folder was filled for it: minutes


def fill(
    study: Setup,
    folder: StudyFolder,
    jobs: int,
    cluster: str | None = None,
    progress: Progress = SILENT,
) -> None:
    """Simulate own designs, some that fill their space, and references; go on where stopped.

    InputError for a study that searches its operation, as a stored shift does not say which, and
    for too few ``surrogate.mix_shifts``.
    """
    if study.searches_operation:
        others = [key for key in study.variables if key not in study.shape_keys]
        raise InputError(
            f"the study searches {', '.join(others)}, which the surrogate learns from a search "
            "alone; run 'dogshape study', which leaves one, or take them out of [variables]"
        )
    require_mix(study)
    connect(cluster)
    working, settings = study.working, study.file.surrogate
    with folder.writing():
        folder.open(study, resume=True)
        designs = first_designs(study, settings.designs)
        blocks = own_blocks(working) + [
            block
            for index, design in enumerate(designs)
            for block in filling_blocks(working, design, index, settings.seed)
        ]
        total = sum(len(block.angles) for block in blocks) + first_shifts(study)
        total += count_of(study) * angles_of(study) * len(study.points)
        with (
            WorkCounter(progress, total) as counter,
            counter.kept_in(folder.root, "the same command goes on"),
        ):
            journals = ShiftJournal(folder.shifts), ShiftJournal(folder.references)
            rows, apart = (
                Executor(journal, jobs, counter.advance, cluster, counter.known)
                for journal in journals
            )
            rows.run(blocks)
            simulate_mix_rows(working, folder, rows)
            references = [
                design
                for design in reference_designs(study, settings.references)
                if design not in designs
            ]
            references += _best(working, folder, counter)
            simulate_references(working, references, apart, counter.extend)
            for journal in journals:
                journal.say_unfinished(progress.say)


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
        return partial(expected, fitted(mix_times(data, mixed, study_mix(study)), points=False))
    over = Over(fit(data, effort=QUICK), study_mix(study))
    return lambda x: over.predict(x)[0]


def train(folder: StudyFolder, out: Path | None = None, *, say: Say = SILENT.say) -> Stored:
    """Fit the surrogate to the shifts of a folder, judge it and write it.

    Fewer designs than it needs raise InputError.
    """
    study = folder.stored_study().working
    data, mixed = _data_of(study, folder)
    seed = study.file.surrogate.seed
    effort = Effort(FILLED if folder.references.exists() else WHOLE.rows, seed=seed)
    if mixed is not None:
        effort = replace(BESIDE, seed=seed)
    surrogate = fit(data, effort=effort)
    if mixed is not None:
        say("the expected time over the study's own operating points")
        surrogate = replace(surrogate, own=fitted(mix_times(data, mixed, study_mix(study))))
    figures = _judged(study, folder, surrogate)
    stored = Stored(surrogate, figures)
    save(out or folder.surrogate, stored)
    with naming(folder.points):
        data.frame().to_csv(folder.points, index=False)
    return stored


def _data_of(study: Setup, folder: StudyFolder) -> tuple[Dataset, Array | None]:
    """Return the rows of a folder, and those of designs at all of the study's operating points."""
    if folder.rows.exists():
        rows = read_json(folder.rows, "run 'dogshape study' with --resume to write it again")
        width = len(study.variables) + len(COLUMNS)
        return with_rows(study, np.array(rows["rows"], dtype=float).reshape(-1, width)), None
    data = dataset_of(study, ShiftJournal(folder.shifts).rows.values())
    mixed = mix_rows(study, folder) if folder.mix.exists() else np.zeros((0, 0))
    if not len(mixed):
        return data, None
    own = np.round(study.rows(own_designs(study)), DIGITS)
    return data, np.concatenate([mixed, data.rows[among(data.x, own)]])


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
    """Return the references of a filled folder that fill the space, and those of the best.

    ``study`` is in the engine that simulated them.
    """
    data = dataset_of(study, ShiftJournal(folder.references).rows.values())
    whole = reference_of(data, study_mix(study))
    kept = read_json(folder.best, "fit again").get("designs", []) if folder.best.exists() else []
    best = whole.of(study.rows(kept))
    return whole.of(whole.x[~among(whole.x, best.x)]), best
