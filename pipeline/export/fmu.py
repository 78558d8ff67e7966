"""The clutch of a study as a co-simulation block for driveline models (FMI 2.0 or 3.0).

The FMU holds the slave (``fmi2_slave`` or ``fmi3_slave``), the study file and the loader of
pythonfmu or pythonfmu3, optional extras. It runs where Python with this package is installed.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.export.clutch_block import RESOURCE
from dogshape.sim.errors import InputError
from dogshape.sim.files import write_whole
from dogshape.sim.interface import argument


@dataclass(frozen=True)
class FmiVersion:
    """A version of FMI: package of the loader, file of the slave, capabilities of the slave."""

    package: str
    slave: str
    capabilities: tuple[str, ...]


VERSIONS = {
    2: FmiVersion(
        package="pythonfmu",
        slave="fmi2_slave.py",
        capabilities=("canGetAndSetFMUstate", "canSerializeFMUstate"),
    ),
    3: FmiVersion(
        package="pythonfmu3",
        slave="fmi3_slave.py",
        capabilities=("canGetAndSetFMUState", "canSerializeFMUState"),
    ),
}
#: Capability that both packages have by default, and pythonfmu3 0.3.4 does not write.
ANY_STEP = "canHandleVariableCommunicationStepSize"


def load_fmu_builder(fmi: int) -> Any:
    """Import the builder of FMUs, an optional extra.

    InputError for a version without a slave, or with the way to install the extra.
    """
    if fmi not in VERSIONS:
        remedy = f"give {argument('fmi', 2)} or {argument('fmi', 3)}"
        raise InputError(f"{argument('fmi')} is {fmi}, but FMUs are of FMI 2 or 3; {remedy}")
    package = VERSIONS[fmi].package
    try:
        return import_module(package).FmuBuilder
    except ImportError as error:
        fault = f"an FMU needs {package}, which cannot be loaded ({error})"
        raise InputError(f"{fault}; install 'dogshape[fmu]' with pip") from error


def write_fmu(study: Setup, path: Path, fmi: int) -> None:
    """Write the clutch of a study as an FMU of FMI ``fmi``; InputError without the extra."""
    builder = load_fmu_builder(fmi)
    version = VERSIONS[fmi]
    slave = Path(__file__).with_name(version.slave)
    capabilities = dict.fromkeys((*version.capabilities, ANY_STEP), True)
    with TemporaryDirectory() as name, same_import_path():
        folder = Path(name)
        resource = folder / RESOURCE
        tables = study.file.model_dump(exclude_none=True)
        resource.write_text(json.dumps(tables, indent=1), encoding="utf-8")
        built = builder.build_FMU(slave, dest=folder, project_files=[resource], **capabilities)
        write_whole(path, built.read_bytes())


@contextmanager
def same_import_path() -> Iterator[None]:
    """Restore the import path, to which pythonfmu adds the folder of the slave."""
    folders = list(sys.path)
    try:
        yield
    finally:
        sys.path[:] = folders
