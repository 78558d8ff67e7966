"""Work that a study still has, by kind: as many as are likely, not as many as may be."""

from __future__ import annotations

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.forecast import Kind
from dogshape.pipeline.search.dog_guide import OWN, DogGuide, simulated
from dogshape.pipeline.search.samplers import startup_designs
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.state import SearchState, spent_on
from dogshape.pipeline.simulate.point_plans import most_to_confirm, most_to_search

Work = dict[Kind, float]

PASS = 0.6  #: share of designs that pass their screen, before any was screened
COUNTS = 4.0  #: designs that this guess counts for, once some were


def to_search(search: Search, state: SearchState | None = None) -> Work:
    """Expect the work of the search that is left, of replication and of confirmation.

    Designs so far say how many shifts a design takes and how many the front has.
    """
    study, settings = search.study, search.study.file.search
    partial = search.guide is not None and search.guide.partial
    trials = search.trials() if state is None else state.trials
    left = max(0, settings.trials - len(trials))
    whole = most_to_search(study, 1, partial, False)
    guess = whole * (PASS if settings.screen_angles is not None else 1.0)
    spent = spent_on(study, [trial for trial in trials if simulated(trial)])
    each = (spent + COUNTS * guess) / (len(trials) + COUNTS)
    new = not any(trial.user_attrs.get("prototype") for trial in trials)
    own = most_to_search(study, 1, partial, True) - whole if new else 0
    searching = left * each + own
    again = settings.replicate * (spent + searching)
    first = _filling(search, len(trials), left)
    # A reference is screened with each round beside its designs.
    rounds = (left - first) / max(1, settings.batch) + (first > 0)
    front = settings.confirm_designs
    if state is not None and len(trials) >= settings.trials / 2:
        front = min(front, max(1, len(state.front)))
    confirming = to_confirm(study, front)
    mine: Work = {
        "first": first,
        "design": left - first,
        "quick": screened(study, left + rounds),
        "shift": searching + again,
    }
    kinds: tuple[Kind, ...] = ("first", "design", "quick", "shift", "confirm")
    return {kind: float(mine.get(kind, 0.0) + confirming.get(kind, 0.0)) for kind in kinds}


def _filling(search: Search, told: int, left: int) -> int:
    """Count the designs that are still to fill the space, which cost little to propose."""
    settings, guide = search.study.file.search, search.guide
    if settings.sampler not in OWN:
        return left
    wanted = settings.trials
    if settings.sampler == "surrogate":
        wanted = startup_designs(search.study, guide or DogGuide(search.study))
    return max(0, min(left, wanted - told))


def to_confirm(study: Setup, designs: int) -> Work:
    """Expect the work to confirm prototype and so many designs."""
    kind: Kind = "shift" if study.confirming is study else "confirm"
    return {"quick": screened(study, designs + 2), kind: float(most_to_confirm(study, designs))}


def screened(study: Setup, designs: float) -> float:
    """Count the shifts of the compiled engine that screen so many designs."""
    return designs * len(study.points) * (study.file.search.screen_angles or 0)
