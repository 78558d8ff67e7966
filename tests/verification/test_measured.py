"""Results of direct tests: with the shifts they make the posterior of both, and name a cause."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import logsumexp

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.stand_file import Measured
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.static_readings import measured_facts, require_measured
from dogshape.diagnosis.terms import NONE, UNKNOWN
from dogshape.sim.errors import DogshapeError
from tests.benches import good_set
from tests.diagnosed import EFFECTS, simulated_bench, simulated_diagnosis

DELAY = ("actuation_delay",)


def _diagnosed(*measured: Measured, advise: bool = False) -> Diagnosis:
    """Diagnose shifts with a delay of 80 ms and some results of direct tests."""
    bench: Bench = simulated_bench({"actuation_delay": {"delay_s": 0.08}})
    return simulated_diagnosis(replace(bench, measured=measured), advise=advise)


def test_the_evidence_is_the_integral_over_shifts_and_test_together() -> None:
    """Against a fine grid of the prior, and the neutral value where the effect is absent."""
    told = Measured(effect="actuation_delay", value=0.081, standard_error=0.004)
    alone, both = _diagnosed(), _diagnosed(told)
    (fact,) = measured_facts(both.bench, EFFECTS)
    one = both.fits[DELAY]
    shares = ((np.arange(4000) + 0.5) / 4000)[:, None]
    values = one.space.values(shares)[:, 0]
    likely = both.likelihood.terms(both.model.predict(DELAY, shares)).log
    whole = likely + fact.log_density(values)
    exact = logsumexp(whole) - np.log(4000)
    assert one.log_evidence == pytest.approx(exact, abs=4.0 * one.error + 0.02)
    mean = np.average(values, weights=np.exp(whole - whole.max()))
    assert one.intervals["delay_s"].mean == pytest.approx(mean, abs=5e-4)
    gain = both.fits[NONE].log_evidence - alone.fits[NONE].log_evidence
    assert gain == pytest.approx(float(fact.log_density(np.zeros(1))[0]))


def test_a_test_that_contradicts_the_shifts_is_for_unknown() -> None:
    """The shifts show 80 ms; the test shows 20 ms: nothing known is both."""
    plain, found = (
        _diagnosed(),
        _diagnosed(Measured(effect="actuation_delay", value=0.02, standard_error=0.0005)),
    )
    assert plain.posterior[DELAY] > 0.8
    assert found.posterior.get(DELAY, 0.0) < 0.05
    assert found.posterior[UNKNOWN] > 10.0 * plain.posterior.get(UNKNOWN, 0.0)


def test_what_is_measured_is_a_fact_of_the_record_and_no_advice() -> None:
    found = _diagnosed(
        Measured(effect="actuation_delay", value=0.08, standard_error=0.003), advise=True
    )
    assert found.verdict.causes == DELAY
    (fact,) = [one for one in found.to_dict()["facts"] if one["effect"] == "actuation_delay"]
    assert fact["value"] == pytest.approx(0.08)
    assert "counts with the shifts" in fact["sentence"]
    direct = [one for one in found.tests if one.kind == "direct"]
    assert direct
    assert not any(one.effects == DELAY for one in direct)


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
    assert reads(drag) == (Measured(effect="drag_torque", value=2.2, standard_error=0.1),)
    for given, words in (
        (drag.replace("drag_torque", "drag_torqe"), "did you mean 'drag_torque'"),
        (drag.replace("= 0.1", "= 0.0"), "must be above 0"),
        (drag.replace("value", 'parameter = "drag"\nvalue'), "must be one of: drag_Nm"),
        (drag.replace("drag_torque", "detent_force"), "must be one of: detent_N, position_mm"),
        (drag.replace("drag_torque", "reversed_mismatch"), "none to measure"),
        (drag.replace("drag_torque", "contact_friction"), "is left out, but must be one of"),
    ):
        with pytest.raises(DogshapeError, match=words):
            reads(given)
