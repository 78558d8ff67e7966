"""Work that a study still has, by kind: as many as are likely, not as many as may be."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup, wear_of
from dogshape.pipeline.forecast import COST, PLANAR, Kind
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.search.dog_guide import OWN, simulated
from dogshape.pipeline.search.samplers import startup_designs
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.state import SearchState, spent_on
from dogshape.pipeline.simulate.block_cost import FINE
from dogshape.pipeline.simulate.level_times import compiled_angles
from dogshape.pipeline.simulate.life import STAGES
from dogshape.pipeline.simulate.point_plans import most_to_confirm, most_to_search
from dogshape.sim.statistics.numerical_error import repeated

Work = dict[Kind, float]

#: Shares of designs that pass their screen, before any was screened: of those that fill the space,
#: and of those proposed after what the first ones taught (1 of 16 and 41 of 48 in ``mq200``).
FILLS, PROPOSED = 0.15, 0.8
COUNTS = 4.0  #: designs that this guess counts for, once some were
#: s that a proposal takes, fit included: with few rows, and more with a surrogate of so many, by
#: the square of their number.
PROPOSAL, MORE, ROWS = 0.25, 1.75, 2500


@dataclass(frozen=True)
class Running:
    """Designs of a round that is simulated now, and the shifts that this takes."""

    designs: int = 0
    shifts: int = 0


NONE = Running()


def costs(study: Setup) -> Mapping[Kind, float]:
    """Guess what one of each kind of work costs, s."""
    settings = study.file.search
    rows = settings.trials * min(settings.points or len(study.points), len(study.points))
    cost = PLANAR if study.clutch.solver.engine == "planar" else COST
    return {**cost, "design": PROPOSAL + MORE * (rows / ROWS) ** 2}


def to_search(search: Search, state: SearchState | None = None, running: Running = NONE) -> Work:
    """Expect the work of the search that is left, and of confirmation.

    Designs so far say how many shifts a design takes and how many the front has. Of a round that
    is ``running`` the proposals and screens are done, and the shifts are known.
    """
    study, settings = search.study, search.study.file.search
    partial = search.guide is not None and search.guide.partial
    trials = search.trials() if state is None else state.trials
    told, screens = len(trials) + running.designs, settings.screen_angles is not None
    left = max(0, settings.trials - told)
    whole = most_to_search(study, 1, partial, False)
    startup, first = _filling(search, 0, settings.trials), _filling(search, told, left)
    parts = trials[:startup], trials[startup:]
    filling = running if len(trials) < startup else NONE
    proposed = NONE if len(trials) < startup else running
    fills, proposes = (
        _each(study, part, ahead, share * whole if screens else whole)
        for part, ahead, share in zip(parts, (filling, proposed), (FILLS, PROPOSED), strict=True)
    )
    new = not running.designs and not any(t.user_attrs.get("prototype") for t in trials)
    own = most_to_search(study, 1, partial, True) - whole if new else 0
    searching = running.shifts + first * fills + (left - first) * proposes + own
    spent = spent_on(study, [trial for trial in trials if simulated(trial)])
    best = _front((spent + searching) / whole)
    # A reference is screened with each round beside its designs.
    rounds = (left - first) / max(1, settings.batch) + (first > 0)
    front = min(settings.confirm_designs, round(best))
    if state is not None and len(trials) >= settings.trials / 2:
        front = min(front, max(1, len(state.front)))
    confirming = to_confirm(study, front)
    mine: Work = {
        "first": first,
        "design": left - first,
        "quick": screened(study, left + rounds),
        "shift": searching,
    }
    kinds: tuple[Kind, ...] = ("first", "design", "quick", "shift", "confirm")
    confirming["shift"] = confirming.get("shift", 0.0) + to_live(study)
    return {kind: float(mine.get(kind, 0.0) + confirming.get(kind, 0.0)) for kind in kinds}


def _each(study: Setup, trials: Sequence[FrozenTrial], running: Running, guess: float) -> float:
    """Expect the shifts of a design from those of some and of a round that runs."""
    spent = spent_on(study, [trial for trial in trials if simulated(trial)])
    return (spent + running.shifts + COUNTS * guess) / (len(trials) + running.designs + COUNTS)


def _front(passing: float) -> float:
    """Expect how many of so many designs are on the front, at least 1.

    Of *n* drawn at random with two independent objectives it is the sum of *1/k* up to *n*.
    """
    return max(1.0, math.log(max(passing, 1.0)) + 0.58)


def _filling(search: Search, told: int, left: int) -> int:
    """Count the designs that are still to fill the space, which cost little to propose."""
    settings = search.study.file.search
    if settings.sampler not in OWN:
        return left
    wanted = settings.trials
    if settings.sampler == "surrogate":
        wanted = startup_designs(search.study)
    return max(0, min(left, wanted - told))


def to_confirm(study: Setup, designs: int) -> Work:
    """Expect the work to confirm prototype and so many designs."""
    kind: Kind = "shift" if study.confirming is study else "confirm"
    each = len(study.points) * study.file.search.confirm_angles
    finer = (FINE - 1.0) * 2 * repeated(each)
    whole = most_to_confirm(study, designs) + finer
    quick = screened(study, designs + 2)
    if study.two_levels:
        quick = float((designs + 2) * len(study.points) * compiled_angles(study))
    return {"quick": quick, kind: float(whole)}


def to_live(study: Setup) -> float:
    """Count the shifts of the chosen design as it wears; none where the study has no wear."""
    if wear_of(study.file) is None:
        return 0.0
    return float((len(STAGES) - 1) * len(study.points) * study.file.search.confirm_angles)


@dataclass
class RoundAhead:
    """Tells a counter of a search what a round takes as soon as its screen is over.

    How many designs pass is not known before: in a study in which most fail, most of what was
    foreseen falls away then, and not at the end of the round.
    """

    search: Search
    counter: WorkCounter
    state: SearchState | None = None
    _designs: int = 0

    def asked(self, count: int) -> None:
        """Take the number of designs of a round."""
        self._designs = count
        self.counter.asked(count)

    def told(self, state: SearchState) -> None:
        """Take the state after a round."""
        self.state, self._designs = state, 0
        self.counter.told(to_search(self.search, state))

    def begun(self, shifts: int) -> None:
        """Take that so many shifts of the study's own begin; none while designs are screened."""
        self.counter.proposed()
        if self._designs and shifts:
            running = Running(self._designs, shifts)
            self.counter.expects(to_search(self.search, self.state, running))
            self._designs = 0


def screened(study: Setup, designs: float) -> float:
    """Count the shifts of the compiled engine that screen so many designs."""
    return designs * len(study.points) * (study.file.search.screen_angles or 0)
