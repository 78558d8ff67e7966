"""The clutch of a study as a co-simulation block for driveline models (FMI 3.0).

The FMU holds the slave (``pipeline.export.fmu_slave``), the study file and the loader of
pythonfmu3, an optional extra. It runs where Python with this package is installed.
"""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dogshape.pipeline.config.study_file import Setup
from dogshape.sim.errors import InputError
from dogshape.sim.files import write_whole

#: Capabilities that the slave adds to those of pythonfmu3.
CAPABILITIES = {
    "canGetAndSetFMUState": True,
    "canSerializeFMUState": True,
    "canHandleVariableCommunicationStepSize": True,
}


def load_fmu_builder() -> Any:
    """Import pythonfmu3, an optional extra; InputError with the way to install it."""
    try:
        return import_module("pythonfmu3").FmuBuilder
    except ImportError as error:
        fault = f"an FMU needs pythonfmu3, which cannot be loaded ({error})"
        raise InputError(f"{fault}; install 'dogshape[fmu]' with pip") from error


def write_fmu(study: Setup, path: Path) -> None:
    """Write the clutch of a study as an FMU; InputError without pythonfmu3."""
    builder = load_fmu_builder()
    from dogshape.pipeline.export import fmu_slave  # noqa: PLC0415  needs the extra

    with TemporaryDirectory() as name:
        folder = Path(name)
        resource = folder / fmu_slave.RESOURCE
        tables = study.file.model_dump(exclude_none=True)
        resource.write_text(json.dumps(tables, indent=1), encoding="utf-8")
        built = builder.build_FMU(
            fmu_slave.__file__, dest=folder, project_files=[resource], **CAPABILITIES
        )
        write_whole(path, built.read_bytes())
