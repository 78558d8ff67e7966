"""Work that it takes to fill a folder for a surrogate, by kind: as much as is likely."""

from __future__ import annotations

from collections.abc import Callable

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.forecast import Kind
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.train.two_level_rows import paired

AGAIN = 0.4  #: shifts of the later rounds of references over those of the first, about


def to_fill(study: Setup, rows: int, pairs: int, levels: int) -> dict[Kind, float]:
    """Expect the shifts of rows, pairs and references, and the fit that chooses references."""
    settings = study.file.surrogate
    designs = settings.references + settings.best_references
    points = designs * len(study.points)
    references = points * settings.reference_angles * (1.0 + AGAIN)
    if levels == 2:
        apart = designs * len(paired(0, len(study.points)))
        return {"fit": 2, "quick": rows + references, "shift": pairs + apart}
    return {"fit": 1, engine_kind(study): rows + references}


def engine_kind(study: Setup) -> Kind:
    """Return the kind of a shift of the study's own engine."""
    return "quick" if study.clutch.solver.engine == "planar" else "shift"


def round_by_round(counter: WorkCounter, kind: Kind) -> Callable[[int], None]:
    """Give what counts the shifts of a round of references, the first of which is the largest."""
    rounds = 0

    def ahead(count: int) -> None:
        nonlocal rounds
        counter.more(kind, count, later=0.0 if rounds else AGAIN * count)
        rounds += 1

    return ahead
