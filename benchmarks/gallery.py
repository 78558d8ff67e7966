"""Run the notebooks of the gallery and keep their outputs, figures as pictures.

    python -m benchmarks.gallery [NAME...]

A notebook is run in a copy of its folder. Pictures are drawn by Chromium, which loads nothing.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from PIL import Image
from plotly.offline import get_plotlyjs

from tests.browser import Chromium

GALLERY = Path(__file__).parents[1] / "docs" / "gallery"
PLOTLY = "application/vnd.plotly.v1+json"  #: type of a figure among the outputs of a cell
SIZES = re.compile(r"^([A-Z, ]+) = ([\d, ]+)", re.MULTILINE)  #: sizes, in the first code cell
PROCESSES = "JOBS"  #: the size that changes no result
SAMPLED_VERBS = {"diagnose"}  #: whose results have a random error, which differs by processor
PROGRESS = "simulating: "  #: begin of an output that is not kept
WIDTH, HEIGHT = 820, 450  #: of a picture, px; figures have their own height
SCALE = 1.5  #: px of a picture over px of a page
COLOURS = 64  #: of a picture
THUMBNAIL = (360, 220)  #: largest size of the small picture of a notebook, px
TIMEOUT_S = 1800  #: of a cell, on a busy machine

PAGE = """<!doctype html><meta charset="utf-8"><body><script>{plotly}</script><script>
const draw = (figure, options) => Plotly.toImage(figure, options);
</script></body>"""


def names() -> list[str]:
    """List the notebooks of the gallery."""
    return sorted(path.stem for path in GALLERY.glob("*.ipynb"))


def read(name: str) -> NotebookNode:
    """Read a notebook of the gallery."""
    return nbformat.read(GALLERY / f"{name}.ipynb", as_version=4)


def code_cells(notebook: NotebookNode) -> list[NotebookNode]:
    """Select the cells of code."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def sizes_of(notebook: NotebookNode) -> list[str]:
    """List the names of the sizes that the first code cell sets."""
    line = SIZES.search(code_cells(notebook)[0].source)
    if line is None:
        raise ValueError("the first code cell sets no sizes")
    return line[1].split(", ")


def replace_sizes(notebook: NotebookNode, sizes: Mapping[str, int]) -> None:
    """Give the sizes of the first code cell other values, in place."""
    wanted = sizes_of(notebook)
    values = ", ".join(str(sizes[name]) for name in wanted)
    cell = code_cells(notebook)[0]
    cell.source = SIZES.sub(f"{', '.join(wanted)} = {values}", cell.source, count=1)


def run(notebook: NotebookNode, folder: Path) -> None:
    """Run a notebook, in place, in a copy of its folder."""
    shutil.copytree(GALLERY, folder, dirs_exist_ok=True)
    resources = {"metadata": {"path": str(folder)}}
    client = NotebookClient(notebook, timeout=TIMEOUT_S, resources=resources)
    client.execute(env={**os.environ, "PYTHONPATH": str(GALLERY.parents[1])})


def sized_cells(notebook: NotebookNode) -> list[bool]:
    """Decide for each code cell whether its results depend on the sizes, by the names it reads.

    Results of ``SAMPLED_VERBS`` count as such.
    """
    sized_names = set(sizes_of(notebook)) - {PROCESSES}
    decisions = []
    for cell in code_cells(notebook):
        is_sized = False
        for statement in ast.parse(cell.source).body:
            nodes = list(ast.walk(statement))
            names_of = [node for node in nodes if isinstance(node, ast.Name)]
            read_names = {node.id for node in names_of if isinstance(node.ctx, ast.Load)}
            attributes = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
            if sized_names & read_names or SAMPLED_VERBS & attributes:
                is_sized = True
                sized_names |= {node.id for node in names_of if isinstance(node.ctx, ast.Store)}
                sized_names |= {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
                sized_names |= _changed_names(nodes)
        decisions.append(is_sized)
    return decisions


def _changed_names(nodes: Iterable[ast.AST]) -> set[str]:
    """List the names whose elements or attributes are set, as of ``rows`` in ``rows[1] = 2``."""
    targets = [
        node.value
        for node in nodes
        if isinstance(node, ast.Subscript | ast.Attribute) and isinstance(node.ctx, ast.Store)
    ]
    return {
        node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)
    }


def text_of(cell: NotebookNode) -> str:
    """Join the texts of the outputs of a cell, without progress."""
    texts = []
    for output in cell.outputs:
        if output.output_type == "stream" and output.name != "stderr":
            texts.append(output.text)
        elif "data" in output and PLOTLY not in output.data and "image/png" not in output.data:
            texts.append(output.data.get("text/plain", ""))
    return "\n".join(text for text in texts if not text.startswith(PROGRESS))


def keep_outputs(notebook: NotebookNode, browser: Chromium) -> None:
    """Replace figures by pictures, in place; drop progress, times and scripts."""
    notebook.metadata = {
        key: value for key, value in notebook.metadata.items() if key == "kernelspec"
    } | {"language_info": {"name": "python"}}
    for cell in code_cells(notebook):
        cell.metadata = {}
        cell.outputs = [kept for output in cell.outputs for kept in _kept(output, browser)]


def _kept(output: NotebookNode, browser: Chromium) -> Iterable[NotebookNode]:
    """Yield what is kept of an output: no progress, script or warning."""
    data = output.get("data", {})
    is_progress = data.get("text/plain", "").startswith(PROGRESS)
    is_script = "<script" in data.get("text/html", "")
    if PLOTLY in data:
        picture = draw(data[PLOTLY], browser)
        encoded = base64.b64encode(picture).decode()
        yield nbformat.v4.new_output("display_data", data={"image/png": encoded})
    elif not is_progress and not is_script and output.get("name") != "stderr":
        yield output


def draw(figure: Mapping[str, Any], browser: Chromium) -> bytes:
    """Draw a figure as a PNG of few colours."""
    options = {
        "format": "png",
        "width": WIDTH,
        "height": figure["layout"].get("height", HEIGHT),
        "scale": SCALE,
    }
    content = {"data": figure["data"], "layout": figure["layout"]}
    answer = browser.call(
        "Runtime.evaluate",
        expression=f"draw({json.dumps(content)}, {json.dumps(options)})",
        awaitPromise=True,
        returnByValue=True,
    )
    _, _, encoded = answer["result"]["value"].partition(",")
    picture = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB")
    file = io.BytesIO()
    picture.quantize(COLOURS).save(file, "png", optimize=True)
    return file.getvalue()


def write_thumbnail(notebook: NotebookNode, path: Path) -> None:
    """Write the first picture of a notebook that is wider than high, small."""
    for cell in code_cells(notebook):
        for output in cell.outputs:
            if "image/png" in output.get("data", {}):
                content = base64.b64decode(output.data["image/png"])
                picture = Image.open(io.BytesIO(content)).convert("RGB")
                if picture.width > picture.height:
                    picture.thumbnail(THUMBNAIL)
                    picture.save(path, quality=80)
                    return
    raise ValueError("the notebook has no picture that is wider than high")


def main(chosen: list[str]) -> None:
    """Run the chosen notebooks, or all, and write them with their outputs."""
    with tempfile.TemporaryDirectory() as scratch, Chromium(Path(scratch) / "profile") as browser:
        page = Path(scratch) / "draw.html"
        page.write_text(PAGE.format(plotly=get_plotlyjs()), encoding="utf-8")
        browser.call("Page.enable")
        browser.call("Page.navigate", url=page.as_uri())
        browser.wait("typeof draw === 'function'", TIMEOUT_S)
        for name in chosen or names():
            notebook = read(name)
            run(notebook, Path(scratch) / name)
            keep_outputs(notebook, browser)
            nbformat.write(notebook, GALLERY / f"{name}.ipynb")
            write_thumbnail(notebook, GALLERY / f"{name}.webp")
            size = (GALLERY / f"{name}.ipynb").stat().st_size
            print(f"{name}: {size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
