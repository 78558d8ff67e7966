"""Slave of the FMU in FMI 3.0, by pythonfmu3.

``pipeline.export.fmu`` puts this file into the FMU. The loader of pythonfmu3 0.3.4 passes neither
``eventHandlingNeeded`` nor ``earlyReturn`` of a step on: the engagement is a time and a flag.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from pythonfmu3 import (
    Boolean,
    DefaultExperiment,
    Float64,
    Fmi3Causality,
    Fmi3Initial,
    Fmi3Slave,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    Int32,
    Unit,
)

from dogshape.pipeline.export.clutch_block import MODEL, STEP_S, BlockVariable, ClutchBlock
from dogshape.pipeline.export.fmu_loader import release_at_exit

LIBRARY = f"x86_64-linux/{MODEL}.so"
KINDS = {float: Float64, int: Int32, bool: Boolean}


class DogClutchFmi3(Fmi3Slave):  # type: ignore[misc]
    """Dog clutch of a study in FMI 3.0."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        folder = Path(self.resources)
        if "logger" in arguments:  # from the loader, not from the builder of an FMU
            release_at_exit(folder.parent / "binaries" / LIBRARY)
        self.block = ClutchBlock(folder, partial(self.log, status=Fmi3Status.error))
        for name, value in self.block.identity.items():
            setattr(self, name, value)
        self.default_experiment = DefaultExperiment(start_time=0.0, step_size=STEP_S)
        self._shares: set[str] = set()  # variables from 0 to 1
        for name, exponents in self.block.units.items():
            self.register_units([Unit(name, **exponents)])
        for variable in self.block.variables():
            self._declare(variable)

    def _declare(self, variable: BlockVariable) -> None:
        """Register a variable; a pure number has no unit."""
        options: dict[str, Any] = {"unit": variable.unit} if variable.unit else {}
        if variable.causality == "parameter":
            options["initial"] = Fmi3Initial.exact
        if variable.is_share:
            self._shares.add(variable.name)
        declared = KINDS[variable.kind](
            variable.name,
            description=variable.meaning,
            causality=Fmi3Causality[variable.causality],
            variability=Fmi3Variability[variable.variability],
            getter=variable.getter,
            setter=variable.setter,
            **options,
        )
        self.register_variable(declared, nested=False)

    def to_xml(self, *arguments: Any) -> Element:
        """Write the model description with ranges, which pythonfmu3 0.3.4 does not write."""
        root: Element = super().to_xml(*arguments)
        for variable in root.iterfind("ModelVariables/*"):
            if variable.attrib["name"] in self._shares:
                variable.attrib.update(min="0", max="1")
        return root

    def exit_initialization_mode(self) -> None:
        """Build the clutch, and log wrong parameters."""
        self.block.initialize()

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        """Advance by a communication step, or log the reason why it is impossible."""
        advanced = self.block.step(current_time, step_size)
        return Fmi3StepResult(status=Fmi3Status.ok if advanced else Fmi3Status.error)

    def _get_fmu_state(self) -> dict[str, Any]:
        """Copy the state of the block."""
        return self.block.save()

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Go to a state of ``_get_fmu_state``."""
        self.block.restore(state)
