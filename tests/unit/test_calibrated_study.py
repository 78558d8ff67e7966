"""Calibrated studies: what a diagnosis found as a study file, and draws from the posterior."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.terms import NONE, UNKNOWN, Hypothesis
from dogshape.pipeline.config.operating import PROBE
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.study_keys import EffectKeys
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Setting
from dogshape.sim.units import MM
from tests.conftest import Said
from tests.diagnosed import EFFECTS, diagnosis_of

Call = Callable[..., Said]
BENCH = load_bench("mq200_adams")
CLUTCH = BENCH.clutch
DELAY: Hypothesis = ("actuation_delay",)
RUBBED: Hypothesis = ("actuation_delay", "sleeve_friction")


def _found(*hypotheses: Hypothesis) -> ds.Diagnosis:
    """Diagnose by hand: the first hypothesis has 97 %, the others and none share the rest."""
    others = [h for h in (*hypotheses[1:], NONE, UNKNOWN) if h != hypotheses[0]]
    posterior = {hypotheses[0]: 0.97} | dict.fromkeys(others, 0.03 / len(others))
    return ds.Diagnosis(diagnosis_of(posterior, BENCH))


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_study_has_the_posterior_mean_and_its_draws_the_interval(tmp_path: Path) -> None:
    found, path = _found(DELAY), tmp_path / "stand.toml"
    made = found.calibrated(path, draws=2000)
    interval = found.inference.fits[DELAY].interval("delay_s")
    study = load_study(path)
    assert study.name == "stand"
    assert study.actuation.delay == pytest.approx(interval.mean, rel=1e-5)
    assert len(study.points) == len(BENCH.cells)
    rows = _rows(path.with_name("stand-draws.csv"))
    drawn = np.array([float(row["effects.actuation_delay"]) for row in rows])
    assert len(drawn) == 2000
    sd = drawn.std()
    assert drawn.mean() == pytest.approx(interval.mean, abs=4.0 * sd / np.sqrt(2000))
    inside = ((drawn >= interval.low) & (drawn <= interval.high)).mean()
    assert inside == pytest.approx(0.9, abs=4.0 * np.sqrt(0.9 * 0.1 / 2000))
    assert made.study.config_hash == study.config_hash


def test_another_set_of_effects_is_written_where_it_is_asked_for(tmp_path: Path) -> None:
    found, path = _found(DELAY, RUBBED), tmp_path / "other.toml"
    made = found.calibrated(path, draws=20, causes=RUBBED[::-1])
    assert made.hypothesis == RUBBED
    interval = found.inference.fits[RUBBED].interval("friction_N")
    assert load_study(path).clutch.mechanism.friction == pytest.approx(interval.mean, rel=1e-5)
    assert "; open (" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("causes", "words"),
    [
        (
            ["sleeve_friction"],
            r"or lack a part of the cause \(actuation_delay\); name one of: actuation_delay",
        ),
        (["actuation_delay", "sleeve_fricton"], "is no effect; did you mean 'sleeve_friction'"),
    ],
)
def test_effects_that_cannot_be_written_are_refused(
    tmp_path: Path, causes: list[str], words: str
) -> None:
    path = tmp_path / "refused.toml"
    with pytest.raises(InputError, match=words):
        _found(DELAY).calibrated(path, causes=causes)
    assert not path.exists()


def test_the_gap_is_one_of_the_dog_and_the_friction_one_of_the_contact(tmp_path: Path) -> None:
    found = _found(("contact_friction",))
    assert found.causes == ("contact_friction",)
    study = found.calibrated(tmp_path / "rubbing.toml").study
    mean = found.inference.fits["contact_friction",].interval("dynamic_friction").mean
    assert study.clutch.contact.dynamic_friction == pytest.approx(mean, rel=1e-5)
    keys = EffectKeys(Setting(CLUTCH, PROBE))
    wider = keys.settings(EFFECTS["axial_gap"], {"gap_offset_mm": 0.3})
    assert wider == {"dog.axial_gap_mm": pytest.approx(CLUTCH.dog.axial_gap / MM + 0.3)}


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("force_loss", {"loss_N": 25.0}),
        ("force_rise", {"rise_factor": 1.4}),
        ("linkage_compliance", {"compliance_mm_kN": 3.0, "mass_behind_kg": 2.0}),
        ("sliding_inertia", {"inertia_factor": 2.5}),
    ],
)
def test_force_linkage_and_inertia_are_written_as_effects(
    name: str, values: dict[str, float]
) -> None:
    plain = load_study("mq200_paper")
    keys = EffectKeys(Setting(plain.clutch, PROBE))
    assert keys.takes(EFFECTS[name])
    for other in ("relative_angle", "reversed_mismatch", "mismatch_speed"):
        assert not keys.takes(EFFECTS[other])
    study = load_study("mq200_paper", keys.settings(EFFECTS[name], values))
    there = EFFECTS[name].apply(Setting(plain.clutch, plain.points[0]), values)
    assert (study.clutch, study.points[0]) == (there.clutch, there.point)


def test_what_a_base_sets_itself_gives_way(tmp_path: Path) -> None:
    base = tmp_path / "base.toml"
    text = load_study("mq200_paper").file.model_dump(exclude_none=True)
    base.write_text(toml_text({**text, "mechanism": {"delay_s": 0.5, "added_mass_kg": 0.3}}, {}))
    made = _found(DELAY).calibrated(tmp_path / "both.toml", base=str(base))
    assert made.study.actuation.delay == pytest.approx(0.078, abs=0.005)
    assert made.study.mechanism["added_mass_kg"] == 0.3
    assert "mechanism.delay_s of the study is replaced by that of the bench" in made.remarks


@pytest.mark.parametrize(
    ("posterior", "words"),
    [
        ({NONE: 0.97, DELAY: 0.03}, "No effect needed.*take the study as it is"),
        ({UNKNOWN: 0.97, DELAY: 0.03}, r"Unknown: .*make the next test \(traces of 10 shifts"),
        ({DELAY: 0.6, ("drag_torque",): 0.4}, r"Open: .*make the next test \(traces of 10 shifts"),
    ],
)
def test_where_nothing_is_named_nothing_is_written(
    tmp_path: Path, posterior: dict[Hypothesis, float], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        ds.Diagnosis(diagnosis_of(posterior, BENCH)).calibrated(tmp_path / "stand.toml")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A diagnosis of a toy's dead time, or of no effect for the bench ``none``."""

    def diagnosed(bench: str, **_: Any) -> ds.Diagnosis:
        return _found(NONE if bench == "none" else DELAY)

    monkeypatch.setattr("dogshape.gap.diagnose", diagnosed)


@pytest.mark.usefixtures("_toy")
def test_the_verb_writes_a_study_and_prints_the_diagnosis_where_it_cannot(
    dogshape: Call, tmp_path: Path
) -> None:
    said = dogshape("gap", "late", "--write", "late.toml", "--draws", 7, "--json")
    assert said.status == 0
    told: Mapping[str, Any] = said.json["calibrated"]
    assert (told["study"], told["n_draws"]) == ("late.toml", 7)
    assert load_study(tmp_path / "late.toml").name == "late"
    assert "7 draws" in dogshape("gap", "late", "--write", "again.toml", "--draws", 7).out
    refused = dogshape("gap", "none", "--write", "none.toml", "--json")
    assert (refused.status, refused.json["verdict"]) == (2, "none")
    assert "names no effect" in refused.sentence
    for arguments, words in (
        (("--write", "late.toml"), "there already"),
        (("--write", "late.json"), "name it NAME.toml"),
        (("--write", "a b.toml"), "name is 'a b'"),
        (("--write", "nowhere/late.toml"), "there is no folder nowhere"),
        (("--base", "mq200_paper"), "give --write FILE too"),
        (("--write", "new.toml", "--base", "mq20"), "there is no study at mq20"),
    ):
        said = dogshape("gap", "late", *arguments)
        assert (said.status, words in said.sentence) == (2, True), said.err


DRAWN = ["operating.mismatch_rpm=[50]", "operating.force_N=[469.0]", "solver.engine=planar"]


def test_draws_of_a_dead_time_move_the_mean_by_themselves(tmp_path: Path) -> None:
    """Times are later by each draw's dead time to the digit, so their interval is its own."""
    _found(DELAY).calibrated(tmp_path / "late.toml", base="mq200_paper", draws=6)
    rows = _rows(tmp_path / "late-draws.csv")
    delays = np.array([float(row["effects.actuation_delay"]) for row in rows])
    spread = ds.expect_draws(tmp_path / "late.toml", tmp_path / "late-draws.csv", DRAWN, angles=3)
    apart = spread.times - delays
    assert np.ptp(apart) < 1e-9
    low, high = np.quantile(delays, (0.05, 0.95)) + apart[0]
    # All draws have the same few angles, whose error comes on top.
    assert spread.error_s > 0.0
    assert spread.interval_s[0] < low < high < spread.interval_s[1]
