"""Work that it takes to fill a folder for a surrogate, by kind: as much as is likely."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.forecast import COST, Kind
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.train.mix_rows import count_of
from dogshape.pipeline.train.reference_designs import MOST
from dogshape.pipeline.train.two_level_rows import paired

AGAIN = 3.0  #: shifts of the later rounds of references over those of the first, about
#: First guesses of the cost where the fit that chooses designs has them at all operating points.
IN_TWO_LEVELS: Mapping[Kind, float] = {**COST, "fit": 2.0}


def to_fill(
    study: Setup, folder: StudyFolder, rows: int, pairs: int, levels: int
) -> dict[Kind, float]:
    """Expect the shifts of rows, pairs and references, and the fits that choose designs."""
    settings = study.file.surrogate
    designs = settings.references + settings.best_references
    points = designs * len(study.points)
    references = points * settings.reference_angles * (1.0 + AGAIN)
    choosing = float(not folder.best.exists())
    if levels == 2:
        apart = designs * len(paired(0, len(study.points)))
        choosing += float(count_of(study) > 0 and not folder.chosen.exists())
        return {"fit": choosing, "quick": rows + references, "shift": pairs + apart}
    return {"fit": choosing, engine_kind(study): rows + references}


def most_references(study: Setup, levels: int) -> int:
    """Count the shifts of references at most, those of Drake beside them included."""
    settings = study.file.surrogate
    designs = settings.references + settings.best_references
    angles = max(MOST, settings.reference_angles)
    apart = len(paired(0, len(study.points))) + 1 if levels == 2 else 0
    return designs * (len(study.points) * angles + apart)


def engine_kind(study: Setup) -> Kind:
    """Return the kind of a shift of the study's own engine."""
    return "quick" if study.clutch.solver.engine == "planar" else "shift"


def round_by_round(counter: WorkCounter, kind: Kind) -> Callable[[int], None]:
    """Give what counts the shifts of a round of references, the first of which is the largest."""
    rounds = 0

    def ahead(count: int) -> None:
        nonlocal rounds
        counter.foresee(kind, count + (0.0 if rounds else AGAIN * count))
        rounds += 1

    return ahead
