"""The rules of the house: who may import whom, and what the package ships."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("sim", "surrogate", "diagnosis", "pipeline")
#: What each room may import of the others.
ALLOWED = {
    "sim": set(),
    "surrogate": {"sim"},
    "diagnosis": {"sim", "surrogate"},
    "pipeline": {"sim", "surrogate", "diagnosis"},
}
#: Outside packages that only some modules may import.
GUARDED = {
    "pydrake": {"sim/plant.py", "sim/linkage.py", "sim/engagement.py", "pipeline/scene.py"},
    "optuna": {
        "pipeline/confirmation.py",
        "pipeline/repair.py",
        "pipeline/replication.py",
        "pipeline/rounds.py",
        "pipeline/search.py",
        "pipeline/standing.py",
        "pipeline/storage.py",
        "pipeline/study.py",
        "pipeline/trials.py",
        "pipeline/sampling/space.py",
        "pipeline/sampling/guide.py",
        "pipeline/sampling/sampler.py",
        "pipeline/sampling/dogs.py",
        "pipeline/sampling/factory.py",
    },
    "sqlalchemy": {"pipeline/claims.py", "pipeline/storage.py"},
    "sklearn": {"surrogate/fitting.py"},
    "plotly": {
        "pipeline/reporting/look.py",
        "pipeline/reporting/html.py",
        "pipeline/reporting/labels.py",
        "pipeline/reporting/maps.py",
        "pipeline/reporting/front.py",
        "pipeline/reporting/parallel.py",
        "pipeline/reporting/operating.py",
        "pipeline/reporting/listed.py",
        "pipeline/reporting/distribution.py",
        "pipeline/reporting/convergence.py",
        "pipeline/gapreport/alike.py",
        "pipeline/gapreport/before.py",
        "pipeline/gapreport/charts.py",
        "pipeline/gapreport/gapmap.py",
        "pipeline/animation.py",
        "pipeline/exploring/figures.py",
    },
    "typer": {
        "pipeline/cli.py",
        "pipeline/options.py",
        "pipeline/console.py",
        "pipeline/verbs/shifts.py",
        "pipeline/verbs/asking.py",
        "pipeline/verbs/designs.py",
        "pipeline/verbs/studies.py",
        "pipeline/verbs/benches.py",
        "pipeline/verbs/blinds.py",
        "pipeline/verbs/exploring.py",
        "pipeline/verbs/gaps.py",
    },
    "joblib": {"pipeline/executor.py"},
    "distributed": {"pipeline/executor.py"},
    "mujoco": {"diagnosis/second_engine.py", "diagnosis/blind/engine.py"},
    "nptdms": {"diagnosis/tdms.py"},
    "dynesty": {"diagnosis/nested.py"},
    "build123d": {"pipeline/cad.py"},
    "skfem": {"sim/root_stress.py"},
    "SALib": {"surrogate/sensitivity.py"},
}
#: What takes so long to load that ``check`` must answer without it.
SLOW = ("pydrake", "optuna", "plotly", "scipy", "joblib", "pandas", "sklearn", "jinja2")
#: What the truth of blind cases may have of the project: no physics, no effects.
APART = {"sim.errors", "sim.units"}
TRUTH = ("stand", "model", "engine", "effects", "cases", "data")
MODULES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))


def _imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.add((node.module or "").split(".")[0])
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_keep_to_the_rooms(path: Path) -> None:
    name = path.relative_to(ROOT).as_posix()
    room = name.split("/")[0]
    imported = _imports(path)
    assert imported & set(ROOMS) <= ALLOWED[room] | {room}
    for package, modules in GUARDED.items():
        assert package not in imported or name in modules, f"{name} imports {package}"


@pytest.mark.parametrize("name", TRUTH)
def test_truth_of_blind_cases_shares_no_code_with_the_diagnosis(name: str) -> None:
    path = ROOT / "diagnosis" / "blind" / f"{name}.py"
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ROOMS:
            own = (node.module or "").startswith("diagnosis.blind.")
            assert own or node.module in APART, f"{name} imports {node.module}"


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOT)))
def test_rooms_stay_small(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 400


def test_studies_hold_no_code() -> None:
    assert not list((ROOT / "studies").rglob("*.py"))


START = f"""
import sys
from pipeline.__main__ import main

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
    assert making == [ROOT / "pipeline" / "console.py"]
