"""Each script of ``examples`` runs, here at a smaller size than its own."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


README = EXAMPLES.parent / "README.md"


def test_the_lines_of_the_readme_run_in_an_empty_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(README.read_text(encoding="utf-8").split("```python")[1].split("```")[0], {})
    said = capsys.readouterr().out
    for words in ("engaged in ", "expected shift time ", "feasible: ", "next test: "):
        assert words in said
    assert [path.name for path in tmp_path.iterdir()] == ["shift.html"]


def _main(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / name / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main


def test_a_clutch_of_ones_own() -> None:
    found = _main("own_clutch")(angles=3)
    assert found["expected_s"] == pytest.approx(0.0739, rel=0.02)
    assert found["variant_s"] == pytest.approx(0.0687, rel=0.02)


def test_a_bench_of_ones_own() -> None:
    result = _main("own_bench")(angles=3)
    assert [round(one.cell.point.profile.force) for one in result.differences] == [300, 600] * 2
    # The times were made up some 50 ms longer than the simulated ones.
    assert result.rmse == pytest.approx(0.05, rel=0.3)


def test_an_effect_of_ones_own() -> None:
    means = _main("own_effect")(count=2)
    assert list(means) == [0.0, 1000.0, 3000.0]
    assert means[0.0] < means[1000.0] < means[3000.0]


def test_a_sampler_in_a_study_of_ones_own() -> None:
    study = _main("own_sampler")(trials=2, angles=3)
    assert len(study.trials) == 2
    assert 0.05 < study.best_value < 0.2
