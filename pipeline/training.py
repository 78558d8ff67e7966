"""The surrogate of a study: simulating what it learns from, fitting, judging, keeping.

A folder of a search holds the search's own shifts. A folder that ``dogshape fit`` fills holds
designs that fill their space, in ``shifts.jsonl``, and references apart, in
``references.jsonl``. Rows that the package brings for the same physics join either way.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pipeline.config import Study
from pipeline.executor import Executor
from pipeline.filling import filling_blocks, first_designs
from pipeline.folder import StudyFolder
from pipeline.journal import ShiftJournal
from pipeline.known import known_surrogate
from pipeline.progress import ShiftProgress
from pipeline.references import reference_designs, simulate_references
from pipeline.rows import dataset_of, study_mix
from surrogate.comparison import compare
from surrogate.dataset import Dataset, differences
from surrogate.fitting import Effort
from surrogate.learning import fit
from surrogate.model import USUAL, Surrogate
from surrogate.reference import Reference, reference_of
from surrogate.store import Stored, save
from surrogate.validation import QUICK, validate

Say = Callable[[str], None]  #: prints a line for people


def fill(study: Study, folder: StudyFolder, jobs: int) -> None:
    """Simulate designs that fill their space, and references; go on where a call was stopped."""
    settings = study.file.surrogate
    with folder.writing():
        folder.open(study, resume=True)
        designs, apart = first_designs(study, settings.designs), reference_designs(study)
        shifts = settings.designs * settings.points * settings.angles
        with ShiftProgress(shifts) as progress:
            try:
                executor = Executor(ShiftJournal(folder.shifts), jobs, progress.advance)
                executor.run(
                    [
                        block
                        for index, design in enumerate(designs)
                        for block in filling_blocks(study, design, index, settings.seed)
                    ]
                )
                executor = Executor(ShiftJournal(folder.references), jobs, progress.advance)
                simulate_references(study, apart, executor, progress.extend)
            except KeyboardInterrupt:
                progress.say(f"finished shifts are kept in {folder.root}; the same command goes on")
                raise


def train(
    folder: StudyFolder, out: Path | None = None, *, choose: bool = False, say: Say = print
) -> Stored:
    """Fit the surrogate to what a folder holds, judge it and write it.

    ``choose`` compares the alternative forms and takes the best; else the usual one is taken.
    Fewer designs than it needs raise InputError.
    """
    study = folder.stored_study()
    journal = ShiftJournal(folder.shifts)
    data = dataset_of(study, journal.rows.values())
    known = _known_for(study, data, folder, say)
    if known is not None:
        data = data.joined(known.data)
    scores = compare(data, study.file.surrogate.seed, say) if choose else []
    form = scores[0].form if scores else USUAL if known is None else known.form
    # What the package brings are far more rows than a search adds: its parameters stand.
    keeps = known is not None and not choose
    effort = Effort(steps=0) if keeps else Effort(seed=study.file.surrogate.seed)
    surrogate = fit(data, form, known, effort)
    parts = effort if keeps else QUICK
    figures = validate(surrogate, study_mix(study), references_of(study, folder), parts)
    stored = Stored(surrogate, figures, tuple(score.as_dict() for score in scores))
    save(out or folder.surrogate, stored)
    data.frame().to_csv(folder.points, index=False)
    return stored


def references_of(study: Study, folder: StudyFolder) -> Reference | None:
    """Return the references of a folder that was filled, None where it has none."""
    if not folder.references.exists():
        return None
    journal = ShiftJournal(folder.references)
    return reference_of(dataset_of(study, journal.rows.values()), study_mix(study))


def _known_for(study: Study, data: Dataset, folder: StudyFolder, say: Say) -> Surrogate | None:
    """Return the surrogate that the package brings, if its rows are of the same kind."""
    brought = known_surrogate(study)
    if brought is None or folder.references.exists():
        return None
    known = brought.surrogate
    if differences(known.data.engine, data.engine) or known.data.variables != data.variables:
        say("the surrogate that the package brings is of other versions, so it is not used")
        return None
    shifts, designs = known.data.shifts, len(known.data.designs)
    say(f"the surrogate joins {shifts} shifts of {designs} designs that the package brings")
    return known
