"""Hook of the site: a notebook is a page, with the outputs that it keeps.

Its text is Markdown like that of any page, so links are checked, code has a copy button and the
search finds it. Nothing is run.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

DOWNLOADS = "notebooks"  #: folder of the copies beside the pages
SEARCH_BOOST = 0.3  #: of notebooks, so that a search shows guides and reference first


class NotebookPage(File):
    """A notebook among the files of the site, whose content is Markdown."""

    def is_documentation_page(self) -> bool:
        """Whether the file becomes a page."""
        return True

    @property
    def content_string(self) -> str:
        """Content of the page."""
        path = Path(str(self.abs_src_path))
        notebook = json.loads(path.read_text(encoding="utf-8"))
        download = f"[This page as a notebook]({DOWNLOADS}/{path.name})"
        return "\n\n".join([*map(_cell, notebook["cells"]), download])


def on_files(files: Files, config: MkDocsConfig, **_: Any) -> Files:
    """Put a page and a copy to download in the place of each notebook."""
    places = config.docs_dir, config.site_dir, config.use_directory_urls
    for file in list(files):
        if file.src_uri.endswith(".ipynb"):
            folder, _, name = file.src_uri.rpartition("/")
            copy = File(f"{folder}/{DOWNLOADS}/{name}", *places)
            copy.abs_src_path = file.abs_src_path
            files.remove(file)
            files.append(NotebookPage(file.src_uri, *places))
            files.append(copy)
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Give a notebook its rank in a search."""
    if isinstance(page.file, NotebookPage):
        page.meta["search"] = {"boost": SEARCH_BOOST}
    return markdown


def _cell(cell: dict[str, Any]) -> str:
    """Write a cell as Markdown, code with its outputs below."""
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return source
    return "\n\n".join([_fence("python", source), *map(_output, cell["outputs"])])


def _output(output: dict[str, Any]) -> str:
    """Write an output as Markdown: picture, table or text."""
    if output["output_type"] == "stream":
        return _fence("text", "".join(output["text"]))
    data = {mimetype: "".join(content) for mimetype, content in output["data"].items()}
    if "image/png" in data:
        picture = re.sub(r"\s", "", data["image/png"])
        return f'<p><img alt="figure" src="data:image/png;base64,{picture}"></p>'
    if "text/html" in data:
        return f'<div class="output">{_plain_tables(data["text/html"])}</div>'
    return _fence("text", data["text/plain"])


def _plain_tables(html: str) -> str:
    """Take looks and empty lines out of HTML, so that the site's own look holds."""
    html = re.sub(r"<style.*?</style>", "", html, flags=re.DOTALL)
    html = re.sub(r'<table border="\d+" class="dataframe">', "<table>", html)
    return re.sub(r"\n\s*\n", "\n", html.replace(' style="text-align: right;"', ""))


def _fence(language: str, text: str) -> str:
    return f"```{language}\n{text.rstrip()}\n```"
