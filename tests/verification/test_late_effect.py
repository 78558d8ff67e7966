"""An effect of which nothing shows but more late shifts: it is seen, and its gap counts them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.terms import Array, Hypothesis
from tests.toy import CLUTCH, EFFECTS, points_of

POINTS = points_of()[8:28:2]
EARLY, LATE = (0.096, 0.104), 0.1  #: s, times of shifts, and how much later the late ones come
FEW = 0.005  #: share of late shifts without the effect
NAMES = ("actuation_delay", "drag_torque")


@dataclass(frozen=True)
class _Late:
    """Emulator of a clutch in which drag makes shifts late, up to a third of them."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        columns = {name: values[:, k] for k, name in enumerate(hypothesis)}
        one = np.ones(len(values))
        delay = columns.get("actuation_delay", 0.0 * one)
        (drag,) = EFFECTS["drag_torque"].parameters
        share = np.log(columns.get("drag_torque", drag.low * one) / drag.low)
        share = FEW + 0.3 * share / np.log(drag.high / drag.low)
        times = np.tile(np.linspace(*EARLY, 24), (len(values), 1)) + delay[:, None]
        plain = Prediction.plain(times, one, 0.5e-3 * one, 0.02 * one)
        late = {"outlier_share": share, "behind": LATE * one, "behind_sd": 0.1 * LATE * one}
        return replace(plain, **late, delay=delay)


def _bench(share: float, n: int, *, single: bool) -> Bench:
    generator, rows = np.random.default_rng(1), list[Reading]()
    for point in POINTS:
        late = generator.random(n) < share
        times = generator.uniform(*EARLY, n) + late * generator.normal(LATE, 0.01, n)
        groups = [(1, float(t)) for t in times] if single else [(n, float(times.mean()))]
        rows += [Reading(2, point, k, time, True) for k, time in groups]
    return Bench("late", "closed form", CLUTCH, gather(rows), None, Sensor())


def _diagnosed(bench: Bench) -> Diagnosis:
    return diagnose(bench, _Late(), {name: EFFECTS[name] for name in NAMES})


@pytest.mark.parametrize(("share", "n", "single"), [(0.1, 50, False), (0.15, 20, True)])
def test_an_effect_that_only_makes_more_shifts_late_is_no_equivalence(
    share: float, n: int, single: bool
) -> None:
    found = _diagnosed(_bench(share, n, single=single))
    assert found.verdict.kind == "effect"
    assert found.verdict.causes == ("drag_torque",)
    assert found.posterior[("drag_torque",)] > 0.95
    # The margin is 5 ms, and late shifts alone move the mean by more.
    assert found.equivalence is not None
    assert found.equivalence.probability < 0.05
    true = (share - FEW) * LATE
    assert found.equivalence.gap.low < true < found.equivalence.gap.high


def test_few_late_shifts_as_without_any_effect_are_none() -> None:
    found = _diagnosed(_bench(FEW, 50, single=False))
    assert found.verdict.kind == "none"
