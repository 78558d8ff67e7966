"""Hypotheses that the data can or cannot tell apart, as a matrix of odds and in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.classes import APART
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, in_common, plain, without
from dogshape.diagnosis.report.wording import chance
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.reports.gap.charts import row_height
from dogshape.pipeline.reports.gap.hypothesis_cards import MANY, short
from dogshape.pipeline.reports.kit.look import styled
from dogshape.pipeline.reports.kit.maps import frame, shaded_cells
from dogshape.sim.effect import Effect

MOST = 7  #: hypotheses that are compared
#: The more alike two are, the darker.
ALIKE_TO_APART = ((0.0, "#8db9e2"), (1.0, "#ffffff"))


def alike_figure(found: Diagnosis) -> go.Figure:
    """Draw the odds that data of this kind would give the true row over the column."""
    ordered = sorted(
        range(len(found.confusion.hypotheses)),
        key=lambda k: -found.posterior[found.confusion.hypotheses[k]],
    )[:MOST]
    letters = [chr(ord("A") + place) for place in range(len(ordered))]
    names = [
        f"{short(found, found.confusion.hypotheses[k])}  {letter}"
        for k, letter in zip(ordered, letters, strict=True)
    ]
    apart, last = found.confusion.apart[np.ix_(ordered, ordered)], len(ordered) - 1
    cells = {
        (last - i, j): (min(log, math.log(MANY)), odds(log) if i != j else "itself")
        for (i, j), log in np.ndenumerate(apart)
    }
    trace = shaded_cells(letters, names[::-1], cells, ALIKE_TO_APART)
    figure = go.Figure(trace.update(zmin=0.0, zmax=math.log(MANY)))
    for i, j in np.argwhere(np.maximum(apart, apart.T) < APART).tolist():
        if i != j:
            frame(figure, last - i, j)
    figure.update_xaxes(title="odds against this")
    figure.update_yaxes(title="if this is true", automargin=True)
    height = 170 + row_height(names) * len(names)
    return styled(figure, height).update_layout(margin={"t": 20})


def odds(log: float) -> str:
    """Print an expected logarithm of a Bayes factor as odds."""
    if log > math.log(MANY):
        return f"> {MANY:.0f} : 1"
    ratio = math.exp(log)
    return f"{ratio:.0f} : 1" if ratio >= 9.5 else f"{ratio:.2g} : 1"


def class_in_words(
    group: Sequence[Hypothesis], effects: Mapping[str, Effect], *, keys: bool = False
) -> str:
    """Name hypotheses that are alike, with the effects that all share named once.

    With ``keys`` the key of each effect stands behind its name.
    """

    def named(hypothesis: Hypothesis) -> str:
        names = [effects[n].plain + (f" ({n})" if keys else "") for n in hypothesis]
        return " and ".join(names) or ("nothing more" if common else plain(NONE, effects))

    common = in_common(group)
    names = [named(without(h, common)) for h in group]
    beside = f", each with {named(common)}" if common else ""
    return f"{', '.join(names[:-1])} or {names[-1]}{beside}"


def classes_in_words(found: Diagnosis) -> list[str]:
    """Write a sentence for each class of hypotheses, and each alias."""
    said = []
    for group in found.confusion.classes:
        if len(group) > 1:
            together = chance(sum(found.posterior[h] for h in group))
            said.append(
                f"{class_in_words(group, found.effects)}: with sizes to suit they predict the same "
                f"here; they are one class, with {together} together."
            )
    named = {n for h in found.confusion.hypotheses if h != UNKNOWN for n in h}
    for name in sorted(named):
        effect = found.effects[name]
        for alias in effect.aliases:
            said.append(f"No table of shift times can tell {effect.plain} from {alias}.")
    return [words[0].upper() + words[1:] for words in said]
