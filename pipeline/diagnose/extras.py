"""Parts of a report beside the diagnosis itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from dogshape.diagnosis.report.phase_times import PhaseGap
from dogshape.pipeline.diagnose.consequence import Candidate, Consequence


@dataclass(frozen=True)
class Remark:
    """A sentence, from something else than the shift times, for or against an effect."""

    effect: str
    speaks: Literal["for", "against"]
    sentence: str


@dataclass(frozen=True)
class Optimum:
    """A best design: its values by key (``chamfer_deg``), and expected times, s.

    ``time_without_s`` is simulated without the effect, ``time_with_s`` with it.
    """

    design: Mapping[str, float]
    time_without_s: float
    time_with_s: float


@dataclass(frozen=True)
class SoWhat:
    """Consequence of the effect for the best design, as a report shows it.

    Parameters
    ----------
    without, within : the best designs of a search without and with the effect.
    regret_s : what it costs, with the effect, to build the one found without it, s.
    sentence : what that means.
    """

    without: Optimum
    within: Optimum
    regret_s: float
    sentence: str


@dataclass(frozen=True)
class Extras:
    """Optional parts of a report; an empty part leaves no trace in the report.

    Parameters
    ----------
    phases : gaps along the shift, over all operating points
        (``diagnosis.report.phase_times.overall``).
    so_what : what the effect means for the best design.
    remarks : for and against effects, from outside the shift times.
    unknown_cells : how shifts were read of which nothing is known, a sentence.
    provenance : words by what they are of: command, versions, seeds, number of simulations.
    """

    phases: tuple[PhaseGap, ...] = ()
    so_what: SoWhat | None = None
    remarks: tuple[Remark, ...] = ()
    unknown_cells: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)


def so_what(found: Consequence) -> SoWhat:
    """Describe the consequence of a cause for the choice of a design."""
    without, within = _optimum(found.chosen), _optimum(found.best)
    return SoWhat(without, within, found.regret, found.sentence)


def _optimum(one: Candidate) -> Optimum:
    return Optimum(one.params, one.without.mean, one.with_effect.mean)
