"""REXS model of a gearbox as data: components, relations and load cases (www.rexs.info).

Read as the specification of version 1.7 defines both spellings (spec.rexs.info/1.7, "REXS object
structure" and "JSON syntax"): XML (``.rexs``) and JSON (``.rexsj``). Attributes are looked up by
their ids; a unit must be that of the published schema.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from pydantic import BaseModel, ConfigDict, ValidationError

from dogshape.sim.errors import InputError

VERSIONS = ("1", "2")  #: main versions that are read
#: Units of the published schema (versions 1.3 to 2.0.0) by attribute.
UNITS = {
    "density": "kg / dm^3",
    "gear_shift_index": "none",
    "inner_diameter": "mm",
    "inner_diameter_begin": "mm",
    "inner_diameter_end": "mm",
    "is_engaged": "none",
    "length": "mm",
    "mass_of_component": "kg",
    "moment_of_inertia_u_axis": "kg m^2",
    "operating_time": "h",
    "operating_time_fraction": "%",
    "outer_diameter": "mm",
    "outer_diameter_begin": "mm",
    "outer_diameter_end": "mm",
    "rotational_speed": "1 / min",
    "torque_acting_on_inner_component_u": "N m",
    "torque_acting_on_outer_component_u": "N m",
}
FLAGS = {"true": True, "1": True, "false": False, "0": False}  #: booleans of XML
ZIP_START = b"PK"  #: first bytes of a packed file, ``.rexsz``


class RexsAttribute(NamedTuple):
    """Value of an attribute as the file spells it: a scalar or a list."""

    value: Any
    unit: str


Attributes = Mapping[str, RexsAttribute]  #: by id


@dataclass(frozen=True)
class RexsComponent:
    """Machine element, or a part of one."""

    number: int  #: its id
    kind: str  #: its type
    name: str
    attributes: Attributes

    @property
    def text(self) -> str:
        """Type, id and name."""
        return f"{self.kind} {self.number} ({self.name})" if self.name else self.label

    @property
    def label(self) -> str:
        """Type and id."""
        return f"{self.kind} {self.number}"


class RexsRelation(NamedTuple):
    """Relation of components, by their role."""

    kind: str
    members: Mapping[str, int]


class RexsLoadCase(NamedTuple):
    """Attributes of a load case, by component and id."""

    number: int
    attributes: Mapping[int, Attributes]


#: Load case of a model without a load spectrum: the attributes of its components.
SINGLE_LOAD = RexsLoadCase(0, {})


@dataclass(frozen=True)
class RexsModel:
    """Gearbox of a REXS file."""

    file: Path
    version: str
    components: Mapping[int, RexsComponent]  #: by id
    relations: tuple[RexsRelation, ...]
    load_cases: tuple[RexsLoadCase, ...]  #: of its load spectrum, or ``SINGLE_LOAD``

    def of_kind(self, kind: str) -> list[RexsComponent]:
        """List the components of a type."""
        return [component for component in self.components.values() if component.kind == kind]

    def related(self, kind: str, role: str, number: int) -> Iterator[Mapping[str, int]]:
        """Yield the members of the relations of a type in which a component has a role."""
        for relation in self.relations:
            if relation.kind == kind and relation.members.get(role) == number:
                yield relation.members

    def number(
        self, component: RexsComponent, name: str, load_case: RexsLoadCase = SINGLE_LOAD
    ) -> float | None:
        """Read a number of a component in the unit of the schema; None for a missing one.

        That of the load case is before that of the component. Raises InputError for another unit,
        or a value that is no number.
        """
        attribute = self._attribute(component, name, load_case)
        if attribute is None:
            return None
        try:
            value = float(attribute.value)
        except (TypeError, ValueError):
            value = math.nan
        if isinstance(attribute.value, bool) or not math.isfinite(value):
            raise self._fault(component, name, f"is '{attribute.value}', but it must be a number")
        return value

    def flags(
        self, component: RexsComponent, name: str, load_case: RexsLoadCase = SINGLE_LOAD
    ) -> list[bool] | None:
        """Read a list of booleans of a component; None for a missing one, else as ``number``."""
        attribute = self._attribute(component, name, load_case)
        if attribute is None:
            return None
        values = attribute.value if isinstance(attribute.value, list) else [attribute.value]
        spellings = [str(value).strip().lower() for value in values]
        if not all(spelling in FLAGS for spelling in spellings):
            rule = "but it must be a list of true and false"
            raise self._fault(component, name, f"is '{attribute.value}', {rule}")
        return [FLAGS[spelling] for spelling in spellings]

    def _attribute(
        self, component: RexsComponent, name: str, load_case: RexsLoadCase
    ) -> RexsAttribute | None:
        """Look up an attribute with a value; InputError for a unit of another schema."""
        case_attributes = load_case.attributes.get(component.number, {})
        attribute = case_attributes.get(name) or component.attributes.get(name)
        if attribute is None or attribute.value in (None, ""):
            return None
        unit = "".join(attribute.unit.split())
        if unit not in ("", "".join(UNITS[name].split())):
            fault = f"is in '{attribute.unit}', but REXS has it in '{UNITS[name]}'"
            raise self._fault(component, name, fault)
        return attribute

    def _fault(self, component: RexsComponent, name: str, fault: str) -> InputError:
        return InputError(f"{self.file}: {name} of {component.text} {fault}; correct the file")


class _FileAttribute(BaseModel):
    """Attribute of the JSON; the key of its value is the value's type."""

    model_config = ConfigDict(extra="allow")
    id: str
    unit: str | None = None

    @property
    def attribute(self) -> RexsAttribute:
        """Value and unit."""
        values = list((self.model_extra or {}).values())
        return RexsAttribute(values[0] if values else None, self.unit or "")


class _LoadedComponent(BaseModel):
    """Component of a load case in the JSON."""

    id: int
    attributes: list[_FileAttribute]

    @property
    def attributes_by_id(self) -> dict[str, RexsAttribute]:
        """Attributes by their id."""
        return {row.id: row.attribute for row in self.attributes}


class _FileComponent(_LoadedComponent):
    """Component of the gearbox in the JSON."""

    type: str
    name: str | None = None


class _FileLoadCase(BaseModel):
    """Load case in the JSON."""

    id: int
    components: list[_LoadedComponent]


class _FileSpectrum(BaseModel):
    """Load spectrum in the JSON."""

    load_cases: list[_FileLoadCase]


class _FileMember(BaseModel):
    """Component of a relation in the JSON."""

    id: int
    role: str


class _FileRelation(BaseModel):
    """Relation in the JSON."""

    type: str
    refs: list[_FileMember]


class _FileModel(BaseModel):
    """Model in the JSON."""

    version: str
    components: list[_FileComponent]
    relations: list[_FileRelation]
    load_spectrum: list[_FileSpectrum] | _FileSpectrum | None = None

    @property
    def spectra(self) -> list[_FileSpectrum]:
        """Load spectra, one or several as the file has them."""
        if isinstance(self.load_spectrum, _FileSpectrum):
            return [self.load_spectrum]
        return self.load_spectrum or []


def read_rexs(path: Path) -> RexsModel:
    """Read a REXS file, XML or JSON by its first sign.

    Raises InputError for a file that cannot be read, is none of REXS, is of another main version,
    or has more than one load spectrum.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); name a REXS file") from error
    if content.startswith(ZIP_START):
        raise InputError(f"{path} is packed; unpack it and name the .rexs or .rexsj file in it")
    is_json = content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{")
    try:
        document: Any = json.loads(content) if is_json else ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError) as error:
        syntax = "JSON" if is_json else "XML"
        raise InputError(f"{path} is no {syntax} ({error}); export the model again") from error
    try:
        return _model_of(path, document["model"] if is_json else _xml_tables(document))
    except (KeyError, TypeError, ValueError) as error:
        fault = f"{path} is no REXS model ({_reason_of(error)})"
        remedy = "its model must have components, relations and ids as REXS 1.7 defines them"
        raise InputError(f"{fault}; {remedy}") from error


def _reason_of(error: Exception) -> str:
    """Describe the first wrong place of a file, or the error."""
    if not isinstance(error, ValidationError):
        return f"{type(error).__name__}: {error}"
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    return f"{place}: {first['msg']}"


def _model_of(path: Path, tables: Mapping[str, Any]) -> RexsModel:
    """Build a model from the tables of its JSON."""
    version = str(tables["version"])
    if version.partition(".")[0] not in VERSIONS:
        raise InputError(
            f"{path} has REXS version {version}, but versions 1 and 2 are read; export it in one "
            "of these"
        )
    model = _FileModel.model_validate({**tables, "version": version})
    if len(model.spectra) > 1:
        raise InputError(f"{path} has {len(model.spectra)} load spectra; export the model with one")
    load_cases = [
        RexsLoadCase(case.id, {part.id: part.attributes_by_id for part in case.components})
        for spectrum in model.spectra
        for case in spectrum.load_cases
    ]
    components = {
        part.id: RexsComponent(part.id, part.type, part.name or "", part.attributes_by_id)
        for part in model.components
    }
    relations = [
        RexsRelation(relation.type, {member.role: member.id for member in relation.refs})
        for relation in model.relations
    ]
    return RexsModel(
        path, version, components, tuple(relations), tuple(load_cases) or (SINGLE_LOAD,)
    )


def _xml_tables(root: ElementTree.Element) -> dict[str, Any]:
    """Convert the XML of a model to the tables of its JSON; values are texts."""
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]  # without a namespace
    if root.tag != "model":
        raise KeyError("model")

    def parts(parent: ElementTree.Element) -> list[dict[str, Any]]:
        return [
            {**part.attrib, "attributes": [_xml_attribute(row) for row in part.iter("attribute")]}
            for part in parent.findall("component")
        ]

    spectra = [
        {
            "load_cases": [
                {"id": case.attrib["id"], "components": parts(case)}
                for case in spectrum.findall("load_case")
            ]
        }
        for spectrum in root.findall("load_spectrum")
    ]
    relations = [
        {"type": relation.attrib["type"], "refs": [ref.attrib for ref in relation.findall("ref")]}
        for relation in root.findall("relations/relation")
    ]
    components = root.find("components")
    return {
        "version": root.attrib["version"],
        "relations": relations,
        "components": [] if components is None else parts(components),
        "load_spectrum": spectra,
    }


def _xml_attribute(element: ElementTree.Element) -> dict[str, Any]:
    """Convert an attribute of XML: its text, or the columns of its array."""
    array = element.find("array")
    value: Any = (element.text or "").strip()
    if array is not None:
        value = [(column.text or "").strip() for column in array.findall("c")]
    return {"id": element.attrib["id"], "unit": element.attrib.get("unit", ""), "value": value}
