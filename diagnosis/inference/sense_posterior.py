"""Answer given either sense of rotation, where the sense was not noted.

The size of an effect depends on the sense, so each sense has its own answer: only its hypotheses
are weighed, folded and judged. The probability of a sense is that of its hypotheses by evidence,
before invisible effects count as none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dogshape.diagnosis.bench.sense import REVERSED, forward, turned
from dogshape.diagnosis.inference.parameter_intervals import Interval
from dogshape.diagnosis.inference.posterior import Probabilities, inclusion
from dogshape.diagnosis.inference.ranking import Ranking, sense_chances, within_sense
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN
from dogshape.diagnosis.terms import Hypothesis

SHOWN = 5  #: hypotheses in the record

Intervals = Mapping[Hypothesis, Mapping[str, Interval]]


@dataclass(frozen=True)
class SenseAnswer:
    """Answer given one sense of rotation.

    Parameters
    ----------
    reversed : whether the sense is the other one than that of the table.
    probability : of the sense.
    posterior : probabilities of effects given the sense, which is no part of their names.
    """

    reversed: bool
    probability: float
    posterior: Probabilities

    def sizes(self, effects: Hypothesis, intervals: Intervals) -> Mapping[str, Interval]:
        """Return the parameters of effects with this sense."""
        mine = turned(effects) if self.reversed and effects != UNKNOWN else effects
        # Where the sense cannot be seen, what is folded may stand for the other one alone.
        return intervals.get(mine, intervals.get(effects, {}))

    def as_dict(self, intervals: Intervals) -> dict[str, Any]:
        """Write the entry of the record."""
        return {
            "reversed": self.reversed,
            "probability": self.probability,
            "inclusion": inclusion(self.posterior),
            "hypotheses": [
                {
                    "effects": list(h),
                    "probability": p,
                    "parameters": {
                        name: size.as_dict() for name, size in self.sizes(h, intervals).items()
                    },
                }
                for h, p in list(self.posterior.items())[:SHOWN]
            ],
        }


def sense_answers(problem: Problem, ranking: Ranking) -> tuple[SenseAnswer, ...]:
    """Return the answers given either sense, the table's first; none where the sense is known."""
    if problem.sense == "known" or not any(REVERSED in h for h in ranking.raw):
        return ()
    chances = sense_chances(ranking.raw, problem.settings.priors)
    return tuple(
        SenseAnswer(other, chances[other], _merged(within_sense(problem, ranking, other).posterior))
        for other in (False, True)
    )


def _merged(posterior: Probabilities) -> Probabilities:
    """Return probabilities of effects, whichever sense they are named with."""
    found: Probabilities = {}
    for hypothesis, probability in posterior.items():
        name = forward(hypothesis)
        found[name] = found.get(name, 0.0) + probability
    return dict(sorted(found.items(), key=lambda item: -item[1]))
