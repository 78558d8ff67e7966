"""Results of direct tests: with the shifts they make the posterior of both, and name a cause."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.stand_file import Measured
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.static_readings import measured_facts, require_measured, shown
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem, score
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.sim.errors import DataError
from tests.benches import good_set
from tests.toy import EFFECTS, Toy, bench_of, points_of

NAMES = ("actuation_delay", "actuation_lag", "moving_mass")
DELAY, LAG = ("actuation_delay",), ("actuation_lag",)


def _bench(*measured: Measured) -> Bench:
    """A delay of 80 ms, which a lag in the toy does as well."""
    plain = bench_of({"delay_s": 0.08}, np.random.default_rng(1))
    return replace(plain, measured=measured)


def _diagnosed(*measured: Measured) -> Diagnosis:
    few = {name: EFFECTS[name] for name in NAMES}
    return diagnose(_bench(*measured), Toy(points_of()), few, pairs=[])


def test_the_evidence_is_the_integral_over_shifts_and_test_together() -> None:
    """Against a fine grid of the prior, and the neutral value where the effect is absent."""
    value, error = 0.081, 0.004
    alone, told = _diagnosed(), _diagnosed(Measured("actuation_delay", None, value, error))
    one = alone.scored[DELAY]
    shares = (np.arange(4000) + 0.5) / 4000
    rows = score(_problem(alone), one.space, shares[:, None])
    values = one.space.values(shares[:, None])[:, 0]
    density = norm.pdf(values, value, error) * np.sqrt(2.0 * np.pi)
    likely = np.exp(rows.whole - rows.whole.max())
    exact = rows.whole.max() + np.log(np.mean(likely * density))
    assert told.scored[DELAY].log_evidence == pytest.approx(exact, abs=0.05)
    mean = np.average(values, weights=likely * density)
    assert told.intervals[DELAY]["delay_s"].mean == pytest.approx(mean, abs=2e-4)
    for absent in (NONE, LAG):
        gain = told.scored[absent].log_evidence - alone.scored[absent].log_evidence
        assert gain == pytest.approx(norm.logpdf(0.0, value, error) + 0.5 * np.log(2.0 * np.pi))


def _problem(found: Diagnosis) -> Problem:
    return Problem(observe(found.bench), Toy(points_of()), found.settings)


def test_what_a_test_shows_decides_between_what_shifts_cannot_tell() -> None:
    alone = _diagnosed()
    assert alone.verdict.kind == "ambiguous"
    found = _diagnosed(Measured("actuation_delay", None, 0.08, 0.003))
    assert found.verdict.causes == DELAY
    assert found.verdict.kind == "effect"
    absent = _diagnosed(Measured("actuation_delay", "delay_s", 0.0, 0.003))
    assert absent.posterior[DELAY] < 0.01
    assert absent.posterior[LAG] > alone.posterior[LAG]
    # What is known already is not advised, and the record says what was told.
    weighed = _diagnosed(Measured("moving_mass", None, 0.0, 0.1))
    mine = [[test.shows == ("moving_mass",) for test in one.tests] for one in (alone, weighed)]
    assert [any(those) for those in mine] == [True, False]
    (fact,) = [one for one in found.as_dict()["facts"] if one["effect"] == "actuation_delay"]
    assert "counts with the shifts" in fact["sentence"]


def test_a_test_that_contradicts_the_shifts_is_for_unknown() -> None:
    """The shifts show 80 ms and no lag; the test shows 20 ms: nothing known is both."""
    few = {"actuation_delay": EFFECTS["actuation_delay"]}
    measured = Measured("actuation_delay", None, 0.02, 0.0005)
    found = diagnose(_bench(measured), Toy(points_of()), few, pairs=[])
    assert found.posterior[UNKNOWN] > 0.9


def test_a_property_of_the_contact_is_named_by_its_test_alone() -> None:

    told = _bench(Measured("contact_stiffness", None, 4e12, 2e11))
    assert shown(measured_facts(told, EFFECTS)) == {"contact_stiffness"}
    (fact,) = measured_facts(told, EFFECTS)
    same = replace(told, measured=(Measured("contact_stiffness", None, fact.neutral, 2e11),))
    assert shown(measured_facts(same, EFFECTS)) == frozenset()


def test_results_are_keys_of_the_data_set_and_mistakes_are_sentences(tmp_path: Path) -> None:
    folder = good_set(tmp_path, traces=False)
    head = folder / "bench.toml"
    text = head.read_text()

    def reads(result: str) -> tuple[Measured, ...]:
        head.write_text(text + f"\n[[measured]]\n{result}\n")
        bench = load_bench(folder)
        require_measured(bench, EFFECTS)
        return bench.measured

    drag = 'effect = "drag_torque"\nvalue = 2.2\nstandard_error = 0.1'
    assert reads(drag) == (Measured("drag_torque", None, 2.2, 0.1),)
    for given, words in (
        (drag.replace("drag_torque", "drag_torqe"), "did you mean 'drag_torque'"),
        (drag.replace("= 0.1", "= 0.0"), "the error positive"),
        (drag.replace("value", 'parameter = "drag"\nvalue'), "must be one of: drag_Nm"),
        (drag.replace("drag_torque", "detent_force"), "must be one of: detent_N, position_mm"),
        (drag.replace("drag_torque", "reversed_mismatch"), "none to measure"),
    ):
        with pytest.raises(DataError, match=words):
            reads(given)
