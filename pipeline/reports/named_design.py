"""Designs by the names that a user gives: of a result with a number, or of a study."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from dogshape.pipeline.config.schema import dotted_key
from dogshape.pipeline.config.study_file import (
    Settings,
    Setup,
    bundled_studies,
    find_study,
    load_study,
    replace_keys,
)
from dogshape.pipeline.reports.designs import confirmation_of
from dogshape.pipeline.search.study_record import (
    DesignRow,
    StudyRecord,
    read_study_record,
    study_record_of,
)
from dogshape.pipeline.store.folder import StudyFolder, read_json
from dogshape.sim.errors import InputError
from dogshape.sim.interface import argument, verb
from dogshape.sim.shift.clutch import CONTACT_SETS
from dogshape.sim.versions import bundled_root, clone_remedy


@dataclass(frozen=True)
class NamedDesign:
    """A design with its study; with result and row of a search if it is part of one.

    ``study`` is the one that was searched, or that has the design as its own dog.
    """

    label: str
    study: Setup
    result: StudyRecord | None = None
    row: DesignRow | None = None

    @property
    def title(self) -> str:
        """Name of the study, with the number of a searched design."""
        if self.row is None:
            return self.study.name
        return f"{self.study.name}, design {self.row.trial}"

    @property
    def design_study(self) -> Setup:
        """The study with the design as its dog, operated as the design is."""
        if self.row is None:
            return self.study
        params = self.row.params(self.study.variables)
        study = self.study.with_design(params)
        return replace(study, clutch=self.study.clutch_with(params))

    @property
    def prototype_study(self) -> Setup:
        """The study with the design as its prototype, operated as the design is."""
        if self.row is None:
            return self.study
        return _replace_prototype(self.study, self.row)


def _replace_prototype(study: Setup, row: DesignRow) -> Setup:
    """Rebuild a study with a searched design as its prototype, operated as the design is."""
    params = row.params(study.variables)
    shape = {dotted_key(name): params[name] for name in study.shape_keys}
    return replace_keys(study, shape).with_design(params)


class StoredSearch(NamedTuple):
    """A study that was searched, with its record, and the folder of both."""

    study: Setup
    record: StudyRecord
    folder: Path


def stored_search(source: str) -> StoredSearch | None:
    """Read a study and its record; None where ``source`` has no result.

    ``source`` is a folder of results, or a folder or bundled study whose result is kept beside its
    file. StorageError for a folder with damaged files.
    """
    path = Path(source)
    folder = StudyFolder(path)
    if folder.manifest.exists():
        return StoredSearch(folder.stored_study(), read_study_record(folder), path)
    kept = path if path.is_dir() else bundled_root() / source
    file = kept / "result.json"
    if path.is_file() or not file.is_file():
        return None
    record = study_record_of(read_json(file, "take it away"), str(file))
    return StoredSearch(load_study(source), record, kept)


def named_design(name: str, settings: Settings = None, *, chosen: bool = True) -> NamedDesign:
    """Find the design of ``FOLDER#N`` or ``STUDY#N`` in a result, or of a study by its name.

    ``settings`` are keys of a study with their values. A name without ``#N`` is the chosen design
    of its result, where it has one; unless ``chosen``, it is the study's own dog. InputError for an
    unknown name, a design that is not there, and for settings of a design with a number;
    StorageError for a folder with damaged files.
    """
    numbered = "#" in name and not Path(name).exists()
    source, sign, number = name.rpartition("#") if numbered else (name, "", "")
    if not chosen and not sign:
        return NamedDesign(name, load_study(name, settings))
    if settings:
        fault = (
            f"'{name}' is a design as it was simulated, which {argument('settings')} would change"
        )
        raise InputError(f"{fault}; give '{source}' and the keys of the dog")
    if sign and not number.isdecimal():
        remedy = "write for instance results/mq200#43"
        raise InputError(f"'{name}' must end in the number of a design after '#'; {remedy}")
    stored = stored_search(source)
    if stored is not None:
        return _select_design(source, stored.study, stored.record, number)
    _require_study(source)
    if not sign:
        return NamedDesign(source, load_study(source))
    results = Path("results") / source
    if StudyFolder(results).manifest.exists():
        return named_design(f"{results}#{number}")
    remedy = f"run {verb('search', source)} and give the folder of its results"
    remedy += clone_remedy(source)
    raise InputError(f"'{name}' names design {number}, but '{source}' has no result; {remedy}")


def _require_study(source: str) -> None:
    """Raise InputError for a name that is no study; the message lists the valid names."""
    try:
        find_study(source)
    except InputError as error:
        raise InputError(
            f"'{source}' is no folder of results, no study and no contact set; give a folder as "
            f"results/mq200 (with #N for a design), a study file, one of "
            f"{', '.join(bundled_studies())}, or contact sets ({', '.join(sorted(CONTACT_SETS))})"
        ) from error


def _select_design(source: str, study: Setup, result: StudyRecord, number: str) -> NamedDesign:
    """Select a design of a result by its number; without one the chosen design or the prototype.

    A design that was not simulated becomes the prototype of its study.
    """
    rows = {row.trial: row for row in result.trials}
    prototype = next((row for row in result.trials if row.prototype), None)
    if number:
        design = f"design {int(number)}"
        selected = rows.get(int(number))
    else:
        design = "chosen design"
        selected = result.best or prototype
    if selected is None:
        last = max(rows, default=0)
        raise InputError(f"'{source}' has no {design}; it has the designs 0 (own dog) to {last}")
    row = rows[selected.trial]
    name = f"{source}#{row.trial}"
    if row.expected_shift_time_s is None and confirmation_of(result, row) is None:
        return NamedDesign(name, _replace_prototype(study, row))
    return NamedDesign(name, study, result, row)
