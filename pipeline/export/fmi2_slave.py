"""Slave of the FMU in FMI 2.0, by pythonfmu.

``pipeline.export.fmu`` puts this file into the FMU. pythonfmu 0.7.0 writes neither units nor
unknowns of the initialization, which ``to_xml`` adds, and has no independent variable: the slave
is without ``time``.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import (
    Boolean,
    DefaultExperiment,
    Fmi2Causality,
    Fmi2Initial,
    Fmi2Slave,
    Fmi2Variability,
    Integer,
    Real,
)
from pythonfmu.enums import Fmi2Status

from dogshape.pipeline.export.clutch_block import MODEL, STEP_S, BlockVariable, ClutchBlock
from dogshape.pipeline.export.fmu_loader import release_at_exit

LIBRARY = f"linux64/{MODEL}.so"
KINDS = {float: Real, int: Integer, bool: Boolean}


class DogClutchFmi2(Fmi2Slave):  # type: ignore[misc]
    """Dog clutch of a study in FMI 2.0."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        folder = Path(self.resources)
        if "logger" in arguments:  # from the loader, not from the builder of an FMU
            release_at_exit(folder.parent / "binaries" / LIBRARY)
        self.block = ClutchBlock(folder, partial(self.log, status=Fmi2Status.error))
        for name, value in self.block.identity.items():
            setattr(self, name, value)
        self.default_experiment = DefaultExperiment(start_time=0.0, step_size=STEP_S)
        self._units: dict[str, str] = {}  # by variable
        self._shares: set[str] = set()  # variables from 0 to 1
        for variable in self.block.variables():
            if variable.causality != "independent":
                self._declare(variable)

    def _declare(self, variable: BlockVariable) -> None:
        """Register a variable; a pure number has no unit."""
        if variable.unit:
            self._units[variable.name] = variable.unit
        if variable.is_share:
            self._shares.add(variable.name)
        declared = KINDS[variable.kind](
            variable.name,
            description=variable.meaning,
            causality=Fmi2Causality[variable.causality],
            variability=Fmi2Variability[variable.variability],
            initial=Fmi2Initial.exact if variable.causality == "parameter" else None,
            getter=variable.getter,
            setter=variable.setter,
        )
        self.register_variable(declared, nested=False)

    def to_xml(self, *arguments: Any) -> Element:
        """Write the model description with units, ranges and unknowns of the initialization."""
        root: Element = super().to_xml(*arguments)
        root.insert(1, _unit_definitions(self.block.units))  # behind CoSimulation
        unknowns = SubElement(_child(root, "ModelStructure"), "InitialUnknowns")
        for index, variable in enumerate(_child(root, "ModelVariables"), start=1):
            unit = self._units.get(variable.attrib["name"])
            if unit is not None:
                _child(variable, "Real").set("unit", unit)
            if variable.attrib["name"] in self._shares:
                _child(variable, "Real").attrib.update(min="0", max="1")
            if variable.attrib["causality"] == "output":
                SubElement(unknowns, "Unknown", index=str(index))
        return root

    def exit_initialization_mode(self) -> None:
        """Build the clutch, and log wrong parameters."""
        self.block.initialize()

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by a communication step, or log the reason why it is impossible."""
        return self.block.step(current_time, step_size)

    def _get_fmu_state(self) -> dict[str, Any]:
        """Copy the state of the block."""
        return self.block.save()

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Go to a state of ``_get_fmu_state``."""
        self.block.restore(state)


def _child(element: Element, tag: str) -> Element:
    """Find the child of a tag that pythonfmu always writes."""
    child = element.find(tag)
    assert child is not None
    return child


def _unit_definitions(units: dict[str, dict[str, int]]) -> Element:
    """Define the units of the variables by exponents of base units."""
    definitions = Element("UnitDefinitions")
    for name, exponents in units.items():
        unit = SubElement(definitions, "Unit", name=name)
        powers = {base: str(exponent) for base, exponent in exponents.items()}
        SubElement(unit, "BaseUnit", powers)
    return definitions
