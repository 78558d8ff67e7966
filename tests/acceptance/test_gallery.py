"""Each notebook of the gallery runs, and the outputs that it keeps are those of its code."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path

import nbformat
import pytest
from nbformat import NotebookNode

from benchmarks import gallery
from tests.acceptance.test_documents import MACHINE

SMALL = {"ANGLES": 4, "TRIALS": 6, "JOBS": 1}  #: sizes of a notebook in a test
MAX_BYTES = 200_000
MAX_CELLS = 12  #: of code
MINUS = "\N{MINUS SIGN}"
NUMBER = re.compile(rf"[-{MINUS}]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TOLERANCE = 0.02  #: of a kept number, relative; other processors end in other last digits


def assert_alike(kept: str, text: str) -> None:
    """Compare the words of two texts, and their numbers within the tolerance."""
    assert NUMBER.sub("#", text).split() == NUMBER.sub("#", kept).split()
    numbers = [float(number.replace(MINUS, "-")) for number in NUMBER.findall(text)]
    kept_numbers = [float(number.replace(MINUS, "-")) for number in NUMBER.findall(kept)]
    assert numbers == pytest.approx(kept_numbers, rel=TOLERANCE, abs=TOLERANCE)


def figures_of(notebook: NotebookNode, mimetype: str) -> list[NotebookNode]:
    """List the outputs that are figures."""
    outputs = [output for cell in gallery.code_cells(notebook) for output in cell.outputs]
    return [output.data for output in outputs if mimetype in output.get("data", {})]


def ends_in_value(cell: NotebookNode) -> bool:
    """Whether the last statement of a cell is an expression, whose value a notebook shows."""
    return isinstance(ast.parse(cell.source).body[-1], ast.Expr)


@pytest.mark.parametrize("name", gallery.names())
def test_a_notebook_keeps_its_outputs(name: str) -> None:
    notebook = gallery.read(name)
    cells = gallery.code_cells(notebook)
    assert len(cells) <= MAX_CELLS
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert all(cell.outputs for cell in cells if ends_in_value(cell))
    assert not [o for cell in cells for o in cell.outputs if o.output_type == "error"]
    assert figures_of(notebook, "image/png")
    text = (gallery.GALLERY / f"{name}.ipynb").read_text(encoding="utf-8")
    assert len(text) < MAX_BYTES
    assert "<script" not in text
    assert gallery.PROGRESS not in text
    assert not [cell.source for cell in cells if MACHINE.search(gallery.text_of(cell))]


@pytest.mark.parametrize("name", gallery.names())
def test_a_notebook_runs(name: str, tmp_path: Path) -> None:
    """At a small size; outputs that no size changes are those that are kept."""
    kept = gallery.read(name)
    notebook = gallery.read(name)
    gallery.replace_sizes(notebook, SMALL)
    gallery.run(notebook, tmp_path)
    pairs = zip(gallery.code_cells(kept), gallery.code_cells(notebook), strict=True)
    for (kept_cell, cell), is_sized in zip(pairs, gallery.sized_cells(kept), strict=True):
        if not is_sized:
            assert_alike(gallery.text_of(kept_cell), gallery.text_of(cell))
    outputs = [output for cell in gallery.code_cells(notebook) for output in cell.outputs]
    warnings = [output.text for output in outputs if output.get("name") == "stderr"]
    assert not warnings or "import optuna" in gallery.code_cells(kept)[0].source
    figures = figures_of(notebook, gallery.PLOTLY)
    assert len(figures) == len(figures_of(kept, "image/png"))
    pages = [figure["text/html"] for figure in figures if "text/html" in figure]
    assert pages  # what an export to HTML shows
    for page in pages:
        assert "plotly-graph-div" in page
        assert 'src="http' not in page


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery.names())
def test_kept_outputs_are_those_of_the_code(name: str, tmp_path: Path) -> None:
    kept = gallery.read(name)
    notebook = gallery.read(name)
    gallery.run(notebook, tmp_path)
    for kept_cell, cell in zip(gallery.code_cells(kept), gallery.code_cells(notebook), strict=True):
        assert_alike(gallery.text_of(kept_cell), gallery.text_of(cell))


def test_a_notebook_shows_progress(tmp_path: Path) -> None:
    code = "import dogshape as ds\nds.Study('mq200_paper').expect(angles=1, jobs=1).time_s"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    gallery.run(notebook, tmp_path)
    progress, time = notebook.cells[0].outputs
    assert progress.data["text/plain"].startswith(gallery.PROGRESS)
    assert float(time.data["text/plain"]) > 0.0


@pytest.mark.parametrize("name", gallery.names())
def test_the_site_shows_a_notebook(name: str) -> None:
    """Its page has the kept pictures; overview and menu of the site lead to it."""
    root = gallery.GALLERY.parents[1]
    spec = importlib.util.spec_from_file_location("notebooks", root / "docs" / "notebooks.py")
    assert spec is not None
    assert spec.loader is not None
    hook = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hook)
    page = hook.NotebookPage(f"gallery/{name}.ipynb", str(root / "docs"), "site", False)
    assert page.is_documentation_page()
    pictures = figures_of(gallery.read(name), "image/png")
    assert page.content_string.count("<img ") == len(pictures)
    assert page.content_string.startswith("# ")
    overview = (gallery.GALLERY / "index.md").read_text(encoding="utf-8")
    assert f"![]({name}.webp) | [" in overview
    assert f"]({name}.ipynb)" in overview
    assert f"gallery/{name}.ipynb" in (root / "mkdocs.yml").read_text(encoding="utf-8")


def test_cells_that_depend_on_sizes_are_found() -> None:
    cells = [
        "ANGLES, JOBS = 8, 0\nfixed = make(jobs=JOBS)\ndef mean(study):\n    return study(ANGLES)",
        "fixed.check()",
        "rows = {}\nrows[1] = mean(fixed)",
        "rows",
        "other = fixed\nother",
    ]
    notebook = nbformat.v4.new_notebook(cells=list(map(nbformat.v4.new_code_cell, cells)))
    assert gallery.sized_cells(notebook) == [True, False, True, True, False]
