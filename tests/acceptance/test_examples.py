"""The lines of README.md and the scripts of ``examples`` run, here at a smaller size."""

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
    for words in ("engaged in ", "expected shift time ", "verdict: passes", "next test: "):
        assert words in said
    assert [path.name for path in tmp_path.iterdir()] == ["shift.html"]


def _main(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / name / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main


def test_an_effect_of_ones_own() -> None:
    means = _main("own_effect")(count=2)
    assert list(means) == [0.0, 1000.0, 3000.0]
    assert means[0.0] < means[1000.0] < means[3000.0]
