"""The rules of the house: who may import whom, and what the package ships."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: What each house may import of the others.
ALLOWED = {
    "sim": set(),
    "surrogate": {"sim"},
    "diagnosis": {"sim", "surrogate"},
    "pipeline": {"sim", "surrogate", "diagnosis"},
    "validation": {"sim", "surrogate", "diagnosis", "pipeline"},
    "dogshape": {"sim", "surrogate", "diagnosis", "pipeline"},
}
#: Rooms of a house: each may import those before it. Modules beside the rooms stand where the
#: absence of circles lets them.
ORDER = {
    "sim": ("shift", "part", "statistics", "strength"),
    "diagnosis": ("bench", "prediction", "likelihood", "inference", "report"),
    "pipeline": (
        *("config", "store", "simulate", "train", "search", "diagnose", "export", "reports"),
        "cli",
    ),
    "validation": ("finite_elements", "blind"),
}
#: Outside packages that only some rooms and modules may import.
GUARDED = {
    "pydrake": (
        *("sim/shift/plant.py", "sim/shift/linkage.py", "sim/shift/engagement.py"),
        "pipeline/reports/shift/scene.py",
    ),
    "optuna": ("pipeline/search/", "pipeline/store/trial_storage.py", "pipeline/study.py"),
    "sqlalchemy": ("pipeline/store/claims.py", "pipeline/store/trial_storage.py"),
    "sklearn": ("surrogate/fitting.py",),
    "plotly": ("pipeline/reports/",),
    "typer": ("pipeline/cli/",),
    "rich": ("pipeline/cli/",),
    "joblib": ("pipeline/simulate/executor.py",),
    "distributed": ("pipeline/simulate/executor.py",),
    "mujoco": ("validation/second_engine.py", "validation/blind/mujoco_shift.py"),
    "nptdms": ("diagnosis/bench/tdms.py",),
    "dynesty": ("validation/nested_sampling.py",),
    "build123d": ("pipeline/export/cad.py",),
    "skfem": ("validation/finite_elements/root_stress.py",),
    "SALib": ("surrogate/sobol_indices.py",),
}
#: What takes so long to load that ``check`` must answer without it.
SLOW = ("pydrake", "optuna", "plotly", "scipy", "joblib", "pandas", "sklearn", "jinja2")
#: What the truth of blind cases may have of the project: no physics, no effects.
APART = {"sim.errors", "sim.units"}
TRUTH = ("stand", "mujoco_model", "mujoco_shift", "true_effects", "cases", "data")
#: The command line is an adapter of the public package and of the proof; nothing else of the
#: product imports either.
ADAPTER, ADAPTED = "pipeline/cli/", ("dogshape", "validation")
MODULES = sorted(path for house in ALLOWED for path in (ROOT / house).rglob("*.py"))


def _named(path: Path) -> str:
    """Return the module of a file, without ``dogshape``."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {_named(path) for path in MODULES}


def _short(module: str) -> str:
    """Return a module without ``dogshape``, but for those of the public package itself."""
    inner = module.removeprefix("dogshape.")
    return inner if inner.split(".")[0] in ALLOWED else module


def _imports(path: Path, *, types: bool = True) -> Iterator[str]:
    """Yield all modules that a file imports, anywhere in it; of the project without its name.

    Without ``types`` what only the type checker reads is left out.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    checked = [
        n for n in ast.walk(tree) if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.dump(n)
    ]
    skipped = set() if types else {inner for n in checked for inner in ast.walk(n)}
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (_short(alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            module = _short(node.module or "")
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                yield inner if inner in NAMES else module


def _room(module: str) -> str:
    """Return house and room of a module, or the module itself where it stands beside the rooms."""
    parts = module.split(".")
    return ".".join(parts[:2])


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_keep_to_the_rooms(path: Path) -> None:
    name = path.relative_to(ROOT).as_posix()
    house, *inside = name.split("/")
    order = ORDER.get(house, ())
    runs = set(_imports(path, types=False))
    for imported in _imports(path):
        other, *rest = imported.split(".")
        if other not in ALLOWED:
            assert imported not in runs or name.startswith(GUARDED.get(other, ("",))), (
                f"{name} imports {other}"
            )
        elif other != house:
            adapts = other in ADAPTED and name.startswith(ADAPTER)
            assert adapts or other in ALLOWED[house], f"{name} imports {imported}"
        elif inside[0] in order and rest and rest[0] in order:
            assert order.index(rest[0]) <= order.index(inside[0]), f"{name} imports {imported}"


@pytest.mark.parametrize("level", ["module", "room"])
def test_no_circles(level: str) -> None:
    """Modules, and rooms as a whole, can be put in an order; imports for types count."""
    graph: dict[str, set[str]] = {}
    for path in MODULES:
        mine = _named(path)
        others = {module for module in _imports(path) if module in NAMES}
        if level == "room":
            mine, others = _room(mine), {_room(module) for module in others}
        graph.setdefault(mine, set()).update(others - {mine})
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"circle of {level}s: {' <- '.join(error.args[1])}")


def test_the_package_names_all_its_rooms() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        said = set(tomllib.load(file)["tool"]["setuptools"]["packages"])
    there = {f"dogshape.{_named(p)}" for p in MODULES if p.name == "__init__.py"}
    assert said == {name.replace("dogshape.dogshape", "dogshape") for name in there} | {
        "dogshape.studies"
    }


@pytest.mark.parametrize("name", TRUTH)
def test_truth_of_blind_cases_shares_no_code_with_the_diagnosis(name: str) -> None:
    for module in _imports(ROOT / "validation" / "blind" / f"{name}.py"):
        if module.split(".")[0] in ALLOWED:
            assert module.startswith("validation.blind.") or module in APART, module


def test_studies_hold_no_code() -> None:
    assert not list((ROOT / "studies").rglob("*.py"))


START = f"""
import sys
from dogshape.pipeline.__main__ import main

try:
    main()
finally:
    print("slow:", *sorted(set({SLOW}) & set(sys.modules)), file=sys.stderr)
"""


@pytest.mark.parametrize("arguments", [["check", "--help"], ["--version"], ["chekc"]], ids=str)
def test_a_quick_answer_loads_nothing_slow(arguments: list[str]) -> None:
    command = [sys.executable, "-c", START, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout or "No such command" in done.stderr
    assert done.stderr.splitlines()[-1] == "slow:"


def test_one_place_makes_consoles() -> None:
    """It turns markup off: names and paths of users have square brackets."""
    making = [path for path in MODULES if "Console(" in path.read_text(encoding="utf-8")]
    assert making == [ROOT / "pipeline" / "cli" / "console.py"]
