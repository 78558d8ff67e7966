"""Fixtures: the prototype, and a study small enough to run in seconds."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from dogshape.cli.app import app
from dogshape.pipeline.__main__ import main
from dogshape.pipeline.config.study_file import VARIABLES, Setup, load_study
from dogshape.pipeline.progress import Progress, WorkCounter
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import StudyOptions
from dogshape.sim.clutch_tables import dog_fields
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Rings, contact_set, solver_for
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.strength.checks import LimitCheck
from dogshape.sim.strength.dog_strength import Limits, strength_checks
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.units import DEG, RPM

#: Rise time of the published shift forces, s by N (thesis table 2).
RISE = {235.2: 0.2510, 315.5: 0.2026, 469.0: 0.1766, 641.5: 0.12614}

#: Overrides that make the paper's study small: two operating points, few angles, narrow ranges.
SMALL = [
    "operating.mismatch_rpm=[50, 149]",
    "operating.force_N=[469.0]",
    "expectation.angles=3",
    "search.trials=12",
    "search.startup=10",
    "search.confirm_angles=3",
    "search.confirm_designs=1",
    # Of the default ranges one design in sixty passes every check, of these one in ten.
    "variables.chamfer_deg=[6, 14]",
    "variables.height_mm=[2.8, 4.2]",
    "variables.count=[12, 24]",
    # Another physics than that of the surrogate which the package brings.
    "shift.timeout_s=1.1",
    "search.audit_shifts=4",
    "load.landing_share=",
]


@pytest.fixture(scope="session")
def prototype() -> Dog:
    """The MQ200 prototype (thesis table 5)."""
    return Dog(15, 8 * DEG, 12 * DEG, 22 * DEG, 3.7e-3, 52e-3, 44e-3, axial_gap=1e-3)


@pytest.fixture(scope="session")
def clutch(prototype: Dog) -> Clutch:
    """The prototype with the inertias of thesis table 6 and the design contact set."""
    contact = contact_set("lubricated_steel")
    return Clutch(prototype, Rings(0.3, 0.01, 0.6048), contact, solver_for(contact))


@pytest.fixture(scope="session")
def plant(clutch: Clutch) -> ClutchPlant:
    """The prototype's plant, built once."""
    return ClutchPlant(clutch)


Point = Callable[[float, float], OperatingPoint]


@pytest.fixture(scope="session")
def point() -> Point:
    """Make an operating point from 1/min and one of the published forces in N."""
    return lambda rpm, force: OperatingPoint(rpm * RPM, ForceProfile(force, RISE[force]))


@pytest.fixture
def setting(clutch: Clutch, point: Point) -> Setting:
    """The prototype at 50 1/min and 469 N."""
    return Setting(clutch, point(50, 469.0))


@pytest.fixture(scope="session")
def study() -> Setup:
    """The paper's study."""
    return load_study("mq200_paper")


@pytest.fixture
def small_study() -> Setup:
    """The paper's study at smoke size."""
    return load_study("mq200_paper", SMALL)


def search_run(
    folder: Path, jobs: int = 0, storage: str | None = None, **options: Any
) -> StudyOptions:
    """Return a run of a study in a folder, without a report."""
    return StudyOptions(StudyFolder(folder), jobs, storage, report=False, **options)


@dataclass(frozen=True)
class Listener(Progress):
    """Progress that stores its lines."""

    lines: list[str]

    def update(self, count: WorkCounter) -> None:
        """Ignore a count."""

    def say(self, line: str) -> None:
        self.lines.append(line)


@dataclass(frozen=True)
class CommandResult:
    """Exit status and output of a command."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as JSON."""
        return json.loads(self.out)

    @property
    def sentence(self) -> str:
        """The only line of a refusal on standard error."""
        assert self.status == 2
        lines = self.err.strip().splitlines()
        assert len(lines) == 1, self.err
        assert "Traceback" not in self.err
        return lines[0]


def set_options(settings: Sequence[str]) -> list[str]:
    """Write settings as options of the command line."""
    return [word for setting in settings for word in ("--set", setting)]


Call = Callable[..., CommandResult]


@pytest.fixture
def dogshape(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Call the command line in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> CommandResult:
        result = CliRunner().invoke(app, [str(a) for a in arguments])
        return CommandResult(result.exit_code, result.stdout, result.stderr)

    return call


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Call the program from its entry point, in this process."""

    def call(*arguments: object) -> CommandResult:
        monkeypatch.setattr("sys.argv", ["dogshape", *map(str, arguments)])
        with pytest.raises(SystemExit) as exit_info:
            main()
        output = capsys.readouterr()
        return CommandResult(int(exit_info.value.code or 0), output.out, output.err)

    return call


def named_checks(
    dog: Dog, limits_or_load: Limits | LoadCase | None = None
) -> dict[str, LimitCheck]:
    """Return the checks of a dog by name, for limits or a load case, by default the usual ones."""
    limits = limits_or_load
    if not isinstance(limits, Limits):
        limits = Limits(load=limits or LoadCase())
    return {check.name: check for check in strength_checks(dog, limits)}


def dog_of(dog: Dog, design: Sequence[float]) -> Dog:
    """Set chamfer, traction and braking in deg, height in mm and count of a dog."""
    return replace(dog, **dog_fields(dict(zip(VARIABLES, design, strict=True))))


def require_program(available: bool, name: str) -> None:
    """Skip a test without its external program; fail in continuous integration."""
    if not available and os.environ.get("CI"):
        pytest.fail(f"{name} is missing, but continuous integration installs it")
    if not available:
        pytest.skip(f"{name} is not installed")
