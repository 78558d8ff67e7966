"""``dogshape blind``: a run that gets its diagnosis injected, scores, and refusals."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from dogshape.validation.blind.baselines import plain
from tests.conftest import Said
from tests.toy import EFFECTS, Toy, bench_of, points_of
from tests.unit.test_blind_score import CASES, RESULTS, _sealed

Call = Callable[..., Said]


@pytest.fixture
def _injected(monkeypatch: pytest.MonkeyPatch) -> None:
    """A diagnosis that knows the made-up results, in the place of the real one."""
    module = ModuleType("dogshape.validation.blind.case_diagnosis")

    def seen_by(folder: Path, jobs: int = 0) -> None:
        raise AssertionError(f"{folder} has no stands")

    def diagnose_folder(folder: Path, jobs: int = 0) -> dict[str, object]:
        assert jobs in (0, 1)
        return RESULTS["case_00" if folder.name == "case_04" else folder.name]["diagnosis"]

    module.seen_by = seen_by  # type: ignore[attr-defined]
    module.diagnose_folder = diagnose_folder  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "dogshape.validation.blind.case_diagnosis", module)


@pytest.mark.usefixtures("_injected")
def test_run_then_score(dogshape: Call, tmp_path: Path) -> None:
    folder = _sealed(tmp_path)
    said = dogshape("blind", "run", folder, "--jobs", 1, "--json")
    assert said.status == 0
    assert set(said.json["cases"]) == set(CASES)
    scored = dogshape("blind", "score", folder, "--json")
    assert scored.json["cases"] == len(CASES)
    assert scored.json["outside"]["drift"]["named"]["value"] == 1.0
    text = dogshape("blind", "score", folder).out
    assert "no effect: one is named" in text


def test_what_cannot_be_scored_or_made_is_refused(dogshape: Call, tmp_path: Path) -> None:
    folder = _sealed(tmp_path)
    for arguments, words in (
        (("score", folder), "5 of 5 cases are not diagnosed yet"),
        (("make", folder), "has a set of cases already"),
        (("make", tmp_path / "new", "--size", "big"), "--size is 'big'"),
        (("run", tmp_path / "none"), "make it with: dogshape blind make"),
    ):
        said = dogshape("blind", *arguments, "--json")
        assert said.status == 2, arguments
        assert words in said.err, arguments


def test_plain_baselines_on_a_toy_whose_effect_is_known() -> None:
    """A delay of 80 ms: AICc finds it or the toy's lag, which is a delay; none has no weight."""
    points = points_of((235.2, 641.5))
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(3), points=points)
    names = ("actuation_delay", "actuation_lag", "axial_gap", "contact_friction", "moving_mass")
    found = plain(bench, Toy(points), {name: EFFECTS[name] for name in names})
    assert set(found["rmse_s"]) == set(names)
    assert found["aicc"][0]["effects"][0] in ("actuation_delay", "actuation_lag")
    weights = {tuple(w["effects"]): w["weight"] for w in found["aicc"]}
    assert sum(weights.values()) == pytest.approx(1.0)
    assert weights[()] < 1e-6
    assert found["rmse_s"][found["smallest_rmse"][0]] == min(found["rmse_s"].values())
