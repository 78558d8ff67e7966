"""The rules of the house: who may import whom, what the package ships, and how verbs are said."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import dogshape as ds

ROOT = Path(__file__).parents[2]
#: What each house may import of the others.
ALLOWED = {
    "sim": set(),
    "surrogate": {"sim"},
    "bench": {"sim"},
    "diagnosis": {"sim", "surrogate", "bench"},
    "pipeline": {"sim", "surrogate", "bench", "diagnosis"},
    "validation": {"sim", "surrogate", "bench", "diagnosis", "pipeline"},
    "dogshape": {"sim", "surrogate", "bench", "diagnosis", "pipeline"},
}
#: Rooms of a house: each may import those before it. Modules beside the rooms stand where the
#: absence of circles lets them.
ORDER = {
    "sim": ("shift", "part", "statistics", "strength"),
    "diagnosis": ("prediction", "likelihood", "inference", "report"),
    "pipeline": (
        *("config", "store", "simulate", "train", "search"),
        *("diagnose", "drafts", "export", "reports"),
    ),
    "validation": ("finite_elements", "blind"),
}
#: Outside packages that only some rooms and modules may import.
GUARDED = {
    "pydrake": ("sim/shift/plant.py", "pipeline/reports/shift_page.py"),
    "optuna": ("pipeline/search/", "pipeline/store/trial_storage.py", "pipeline/study.py"),
    "sqlalchemy": ("pipeline/store/trial_storage.py",),
    "plotly": ("pipeline/reports/",),
    "typer": ("dogshape/cli/", "validation/blind/verbs.py"),
    "openpyxl": ("bench/workbook.py", "pipeline/reports/workbook.py"),
    "rich": ("dogshape/terminal.py",),
    "joblib": ("pipeline/simulate/executor.py", "validation/blind/sealed.py"),
    "distributed": ("pipeline/simulate/executor.py",),
    "mujoco": ("validation/blind/mujoco_shift.py",),
    "asammdf": ("bench/traces.py",),
    "nptdms": ("bench/traces.py",),
    "build123d": ("pipeline/export/cad.py",),
    "ezdxf": ("pipeline/export/dxf.py",),
    "pythonfmu": ("pipeline/export/fmi2_slave.py",),
    "pythonfmu3": ("pipeline/export/fmi3_slave.py",),
    "skfem": ("validation/finite_elements/root_stress.py",),
    "sklearn": ("surrogate/regression.py",),
    "tomlkit": ("pipeline/config/toml_text.py",),
    "dash": ("dogshape/app/",),
    "flask": ("dogshape/app/live_callbacks.py", "dogshape/app/questions_page.py"),
    "werkzeug": ("dogshape/app/server.py",),
}
#: What takes so long to load that the help must do without it, and ``check`` without most of it.
SLOW = ("pydrake", "optuna", "plotly", "scipy", "joblib", "pandas", "sklearn", "jinja2", "dash",
        "numpy", "numba")  # fmt: skip
#: What the truth of blind cases may have of the project: no physics, no effects.
APART = {"sim.errors", "sim.units"}
TRUTH = ("stand", "mujoco_model", "mujoco_shift", "true_effects", "cases", "data")
#: The command line and the proof import each other; ``python -m dogshape.pipeline`` starts it.
ADAPTERS = {
    ("dogshape/cli/", "validation"), ("validation/blind/verbs.py", "dogshape"),
    ("pipeline/__main__.py", "dogshape"),
}  # fmt: skip
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


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _imports(path: Path, *, types: bool = True) -> Iterator[str]:
    """Yield all modules that a file imports, anywhere in it; of the project without its name.

    Without ``types`` what only the type checker reads is left out.
    """
    nodes = [*ast.walk(_tree(path))]
    checked = [n for n in nodes if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.dump(n)]
    skipped = set() if types else {inner for n in checked for inner in ast.walk(n)}
    for node in nodes:
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (_short(alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = _short(node.module or "")
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                yield inner if inner in NAMES else module


def _pairs(*, types: bool = True) -> Iterator[tuple[str, str]]:
    """Yield the path of each module with each module that it imports."""
    for path in MODULES:
        name = path.relative_to(ROOT).as_posix()
        yield from ((name, imported) for imported in _imports(path, types=types))


def test_large_packages_are_imported_in_their_places_alone() -> None:
    assert not [
        (name, imported)
        for name, imported in _pairs(types=False)
        if (package := imported.split(".")[0]) in GUARDED and not name.startswith(GUARDED[package])
    ]


def test_a_house_imports_those_below_it_alone() -> None:
    def may(name: str, other: str) -> bool:
        house = name.split("/", maxsplit=1)[0]
        adapts = any(name.startswith(one) and other == into for one, into in ADAPTERS)
        return other in {house, *ALLOWED[house]} or adapts

    assert not [
        (name, imported)
        for name, imported in _pairs()
        if (other := imported.split(".")[0]) in ALLOWED and not may(name, other)
    ]


def test_a_room_imports_those_before_it_alone() -> None:
    def place(house: str, room: str) -> int | None:
        order = ORDER.get(house, ())
        return order.index(room) if room in order else None

    wrong = []
    for name, imported in _pairs():
        (house, mine, *_), (other, theirs, *_) = name.split("/"), [*imported.split("."), ""]
        here, there = place(house, mine), place(other, theirs)
        if house == other and here is not None and there is not None and there > here:
            wrong.append((name, imported))
    assert not wrong


@pytest.mark.parametrize("level", ["module", "room"])
def test_no_circles(level: str) -> None:
    """Modules, and rooms as a whole, can be put in an order; imports for types count."""

    def room(module: str) -> str:
        return ".".join(module.split(".")[:2])

    graph: dict[str, set[str]] = {}
    for path in MODULES:
        mine = _named(path)
        others = {module for module in _imports(path) if module in NAMES}
        if level == "room":
            mine, others = room(mine), {room(module) for module in others}
        graph.setdefault(mine, set()).update(others - {mine})
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"circle of {level}s: {' <- '.join(error.args[1])}")


def test_each_folder_of_code_is_a_package_and_studies_hold_none() -> None:
    """Setuptools installs no folder without ``__init__.py``."""
    assert not [path for path in MODULES if not (path.parent / "__init__.py").is_file()]
    assert not list((ROOT / "studies").rglob("*.py"))


@pytest.mark.parametrize("name", TRUTH)
def test_truth_of_blind_cases_shares_no_code_with_the_diagnosis(name: str) -> None:
    for module in _imports(ROOT / "validation" / "blind" / f"{name}.py"):
        if module.split(".")[0] in ALLOWED:
            assert module.startswith("validation.blind.") or module in APART, module


START = f"""
import sys
from dogshape.pipeline.__main__ import main

try:
    main()
finally:
    print("slow:", *sorted(set({SLOW}) & set(sys.modules)), file=sys.stderr)
"""


@pytest.mark.parametrize(
    "arguments", [["--help"], ["check", "--help"], ["--version"], ["chekc"]], ids=str
)
def test_a_quick_answer_loads_nothing_slow(arguments: list[str]) -> None:
    command = [sys.executable, "-c", START, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout or "No such command" in done.stderr
    assert done.stderr.splitlines()[-1] == "slow:"


def test_a_check_loads_nothing_slow() -> None:
    code = f"""
import sys, dogshape
brought = "{ROOT / "studies" / "mq200_paper" / "surrogate.json"}"
found = dogshape.Study("mq200_paper").check(surrogate=brought)
print(found, found.to_dict().keys(), file=sys.stderr)
print(*sorted({set(SLOW) - {"numpy"}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
    assert "(surrogate); single shifts scatter" in done.stderr


def test_no_room_asks_for_the_time_of_day() -> None:
    """Only a report's provenance does, and what reads the times that a bench wrote."""
    reading = ("bench/cell_values", "bench/table", "bench/workbook")
    allowed = {ROOT / f"{name}.py" for name in reading}
    reports = ("data_sheet", "report", "study_page")
    allowed |= {ROOT / f"pipeline/reports/{name}.py" for name in reports}
    allowed.add(ROOT / "dogshape/app/live_content.py")  # which is printed
    words = re.compile(r"time\.time\(|datetime|time_ns\(|st_mtime")
    product = {p for p in MODULES if not p.is_relative_to(ROOT / "validation")}
    assert not [p for p in product - allowed if words.search(p.read_text(encoding="utf-8"))]


#: Errors that only the command line raises.
OWN = (*(ROOT / "dogshape" / "cli").rglob("*.py"), *(ROOT / "validation").rglob("*.py"))


def _raised() -> Iterator[tuple[str, str]]:
    """Yield the sentences that modules raise, X for what is put into them."""
    for path in sorted({*MODULES} - {*OWN}):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            texts = [*ast.walk(node.exc)] if isinstance(node, ast.Raise) and node.exc else []
            parts = {p for text in texts if isinstance(text, ast.JoinedStr) for p in text.values}
            for text in texts:
                if isinstance(text, ast.JoinedStr):
                    words = [p.value if isinstance(p, ast.Constant) else "X" for p in text.values]
                    yield path.name, "".join(map(str, words))
                elif isinstance(text, ast.Constant) and text not in parts:
                    yield path.name, str(text.value)


def test_no_sentence_spells_an_option_or_a_command() -> None:
    """``sim.interface`` writes both, in the words of the interface in use."""
    option = re.compile(r"--\w|\bdogshape (?!has)[a-z]+\b")
    assert not [(name, text) for name, text in _raised() if option.search(text)]


@pytest.mark.parametrize("room", ["bench", "pipeline/drafts"])
def test_rooms_with_words_of_the_interface_spell_no_option(room: str) -> None:
    """Their sentences take options and arguments from ``sim.interface``."""
    texts = {path.name: path.read_text("utf-8") for path in (ROOT / room).glob("*.py")}
    assert not [name for name, text in texts.items() if re.search(r"--[a-z]|'dogshape ", text)]


DEBIAN = "3.11.2"  #: of Debian 12
PINS = (Path(__file__).parents[2] / "constraints.txt").read_text("utf-8").split()


@pytest.mark.parametrize("pin", PINS)
def test_a_pin_allows_debians_python(pin: str) -> None:
    """A pin that asks for a later patch level installs here, and not on a fresh machine."""
    name, version = pin.partition(";")[0].split("==")
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return  # of an extra that is not here
    wanted = found.metadata.get("Requires-Python")
    assert wanted is None or SpecifierSet(wanted).contains(DEBIAN)
    assert found.version.partition("+")[0] == version


def test_each_requirement_is_declared_once_and_pinned() -> None:
    """In the dependencies, an extra, or the dependency group of development."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    extras = project["project"]["optional-dependencies"]
    groups = project["dependency-groups"]
    lists = [project["project"]["dependencies"], *extras.values(), *groups.values()]
    names = [Requirement(text).name.lower() for requirements in lists for text in requirements]
    assert len(names) == len(set(names))
    pinned = {pin.partition("==")[0].lower() for pin in PINS}
    assert {Requirement(text).name.lower() for text in groups["dev"]} <= pinned


KINDS = (ds.Study, ds.StudyResult)
VERBS = {
    **{name: verb for name in ds.__all__ if inspect.isfunction(verb := getattr(ds, name))},
    **{
        f"{kind.__name__}.{name}": verb
        for kind in KINDS
        for name, verb in vars(kind).items()
        if inspect.isfunction(verb) and not name.startswith(("_", "to_"))
    },
}


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_names_its_parameters_and_has_an_example(name: str) -> None:
    verb: Callable[..., Any] = VERBS[name]
    text, signature = inspect.getdoc(verb) or "", inspect.signature(verb)
    names = [one for one in signature.parameters if one != "self"]
    assert not [one for one in names if not re.search(rf"\b{one}\b", text)]
    assert "0x" not in str(signature)  # a default that is some object
    (example,) = re.findall(r"Example: ``(.*?)``", text, re.DOTALL)
    call = ast.parse(example).body[0].value  # type: ignore[attr-defined]
    assert call.func.attr == name.rpartition(".")[2]
    given = {one.arg: ast.literal_eval(one.value) for one in call.keywords}
    own = ["self"] if "self" in signature.parameters else []
    signature.bind(*own, *call.args, **given)
