"""README.md and docs name what is there, and their tables are those of the sources."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import dogshape
from benchmarks.drawings import DRAWINGS
from benchmarks.figures import BLOCK, ROOT, TABLES, fill_tables, pages

#: CHANGELOG.md is none of them: it names what was there at the time.
PAGES = sorted(
    [
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
        *(ROOT / "paper").glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "examples").rglob("*.md"),
    ]
)
#: Folders of the checkout; what else a page names is the user's own or is made by a command.
FOLDERS = (
    "sim|surrogate|diagnosis|pipeline|validation|dogshape|studies|tests|benchmarks|docs|examples|"
    "paper"
)
PATH = re.compile(rf"`((?:{FOLDERS})/[\w./*-]*)`")
MODULE = re.compile(
    r"\bdogshape((?:\.(?:sim|surrogate|diagnosis|pipeline|validation|dogshape)\b)(?:\.\w+)*)"
)
TEST = re.compile(r"`(test_\w+\.py)`")
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([\w-]+))?\)")


def _is_there(path: str) -> bool:
    return any(True for _ in ROOT.glob(path.rstrip("/")))


def _is_module(dotted: str) -> bool:
    """Accept a module, or a name that stands in a module's text."""
    place = ROOT.joinpath(*dotted.strip(".").split("."))
    if place.is_dir() or place.with_suffix(".py").is_file():
        return True
    for home in (place.parent.with_suffix(".py"), place.parent / "__init__.py"):
        if home.is_file():
            return re.search(rf"\b{place.name}\b", home.read_text("utf-8")) is not None
    return False


def _anchors(path: Path) -> set[str]:
    heads = re.findall(r"^#+ (.+)$", path.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head).lower().strip().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_what_a_page_names_is_there(page: Path) -> None:
    text = page.read_text("utf-8")
    missing = [path for path in PATH.findall(text) if not _is_there(path)]
    missing += [module for module in MODULE.findall(text) if not _is_module(module)]
    missing += [name for name in TEST.findall(text) if not _is_there(f"tests/*/{name}")]
    for target, anchor in LINK.findall(text):
        if target.startswith("http"):
            continue
        linked = page.parent / target if target else page
        if not linked.exists():
            missing.append(target)
        elif anchor and anchor not in _anchors(linked):
            missing.append(f"{target}#{anchor}")
    assert not missing


@pytest.mark.parametrize("page", pages(), ids=lambda p: p.name)
def test_tables_are_those_of_their_sources(page: Path) -> None:
    """``make figures`` writes them."""
    text = page.read_text("utf-8")
    assert text == fill_tables(text)


def test_every_table_is_on_one_page() -> None:
    found = [match[2] for page in pages() for match in BLOCK.finditer(page.read_text("utf-8"))]
    assert sorted(found) == sorted(TABLES)


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawings_are_those_of_their_sources(name: str) -> None:
    """``make figures`` draws them."""
    assert (ROOT / name).read_text("utf-8") == DRAWINGS[name]()


def test_the_api_page_has_every_public_name() -> None:
    listed = re.findall(
        r"^::: dogshape\.(\w+)$", (ROOT / "docs/api/dogshape.md").read_text("utf-8"), re.MULTILINE
    )
    assert sorted(listed) == sorted(dogshape.__all__)


@pytest.mark.parametrize("page", sorted((ROOT / "docs/api").glob("*.md")), ids=lambda p: p.name)
def test_a_search_shows_pages_of_code_last(page: Path) -> None:
    """A title counts a thousand times as much as text, and titles there are names of code."""
    boost = re.match(r"---\nsearch:\n  boost: ([\d.]+)\n---\n", page.read_text("utf-8"))
    assert boost is not None
    assert float(boost[1]) <= 1e-3


KEPT = sorted(
    path
    for folder in ("docs/evidence", "studies")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in {".json", ".txt", ".csv", ".toml"}
)
MACHINE = re.compile(r"(?<![\w.:/])/(?:tmp|home|root|work|usr|var|opt)/")


@pytest.mark.parametrize("kept", KEPT, ids=lambda p: str(p.relative_to(ROOT)))
def test_what_is_kept_names_no_place_of_a_machine(kept: Path) -> None:
    assert not MACHINE.search(kept.read_text(encoding="utf-8"))
