"""Each notebook and script of ``examples`` runs, here at a smaller size than its own."""

from __future__ import annotations

import importlib.util
import re
import shutil
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

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


SIZES = {"ANGLES": "4", "TRIALS": "6", "JOBS": "1"}  #: of the notebooks in a test


def _run(name: str, folder: Path) -> tuple[str, list[dict[str, Any]]]:
    """Run a notebook in a copy of its folder; give its text and the figures of its outputs."""
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)
    kept = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    cells = [cell for cell in kept.cells if cell.cell_type == "code"]
    assert len(cells) <= 12
    assert not any(cell.outputs or cell.execution_count for cell in cells)  # stripped
    line = re.search(r"^([A-Z, ]+) = [\d, ]*\d", cells[0].source, re.MULTILINE)
    assert line is not None
    small = ", ".join(SIZES[one] for one in line[1].split(", "))
    cells[0].source = cells[0].source.replace(line[0], f"{line[1]} = {small}")
    NotebookClient(kept, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    outputs = [output for cell in cells for output in cell.outputs]
    data = [output.data for output in outputs if "data" in output]
    text = [one.get("text/plain", "") for one in data]
    text += [output.text for output in outputs if output.output_type == "stream"]
    return "\n".join(text), [one for one in data if "application/vnd.plotly.v1+json" in one]


@pytest.mark.parametrize(
    ("name", "figures", "words"),
    [
        ("clutch", 3, ("contact_ratio", "NO", "chosen design in Drake", "simulating: ")),
        ("bench", 2, ("0,2352;170,2;40", "the stand gives up", "dead time", "next test: ")),
        ("engines", 1, ("drake: ", "ms in the compiled engine", "simulated by Drake")),
    ],
)
def test_a_notebook_runs(name: str, figures: int, words: tuple[str, ...], tmp_path: Path) -> None:
    text, drawn = _run(name, tmp_path)
    for word in words:
        assert word in text
    # What an export to HTML shows.
    assert [one for one in drawn if "plotly-graph-div" in one["text/html"]] == drawn
    assert len(drawn) == figures
