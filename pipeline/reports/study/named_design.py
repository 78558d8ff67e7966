"""Designs by their names: ``FOLDER#N`` and ``STUDY#N`` of a result, ``STUDY`` alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import (
    Setup,
    bundled_studies,
    find_study,
    load_study,
)
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.store.folder import StudyFolder, read_json
from dogshape.sim.errors import InputError
from dogshape.sim.shift.contact import CONTACT_SETS
from dogshape.sim.versions import bundled_root

Row = dict[str, Any]  #: a part of result.json, whose schema is ``pipeline.store.result_schema``


@dataclass(frozen=True)
class NamedDesign:
    """A design with its study, and with the result that it was searched in.

    Parameters
    ----------
    label : its name, with the number of the design.
    study : the study that was searched, or that holds the design as its own dog.
    result, row : the result and the design's row in it; None where nothing was searched.
    """

    label: str
    study: Setup
    result: Row | None = None
    row: Row | None = None

    @property
    def title(self) -> str:
        """Name of the study, and the number of the design where it has one."""
        return self.study.name + ("" if self.row is None else f", design {self.row['trial']}")

    @property
    def own_study(self) -> Setup:
        """The study with the design as its dog, operated as the design is."""
        if self.row is None:
            return self.study
        dog = self.study.dog_with({key: self.row[key] for key in self.study.variables})
        own = self.study.operated(self.row)
        return replace(own, clutch=own.clutch.with_dog(dog))


def design_or_study(
    name: str, settings: Iterable[str] | Mapping[str, Any] | None = None
) -> NamedDesign:
    """Read ``FOLDER#N`` or ``STUDY#N`` as a design of a result, any other name as a study's dog.

    Parameters
    ----------
    name : ``results/mq200#43``, ``mq200#43``, or what ``load_study`` takes.
    settings : keys of the study with their values, of a study alone.

    Raises
    ------
    InputError
        As ``named_design`` and ``load_study``, and for settings of a design with a number.
    """
    where, sign, _ = name.rpartition("#")
    if not sign or Path(name).exists():
        return NamedDesign(name, load_study(name, settings))
    if settings:
        raise InputError(
            f"'{name}' is a design as it was simulated, which --set would change; give '{where}' "
            "and the keys of the dog"
        )
    return named_design(name)


def named_design(name: str) -> NamedDesign:
    """Read a design; without ``#N`` the chosen one of a result, else the study's own dog.

    Raises
    ------
    InputError
        For an unknown name, or a design that is not there or was not simulated.
    StorageError
        For a folder with damaged files.
    """
    where, sign, number = name.rpartition("#") if "#" in name else (name, "", "")
    if sign and not number.isdecimal():
        raise InputError(
            f"'{name}' must end in the number of a design after '#'; write for instance "
            "results/mq200#43"
        )
    trial = int(number) if sign else None
    folder = StudyFolder(Path(where))
    if folder.manifest.exists():
        return _searched(where, folder.stored_study(), folder.stored_result(), trial)
    study, kept = _study(where), _kept_result(where)
    if kept is not None:
        return _searched(where, study, read_json(kept, "take it away"), trial)
    if trial is not None:
        raise InputError(
            f"'{name}' names design {trial}, but '{where}' has no result; run 'dogshape study "
            f"{where}' and give the folder of its results"
        )
    return NamedDesign(where, study)


def _study(where: str) -> Setup:
    try:
        find_study(where)
    except InputError as error:
        raise InputError(
            f"'{where}' is no folder of results, no study and no contact set; give a folder as "
            f"results/mq200 (with #N for a design), a study file, one of "
            f"{', '.join(bundled_studies())}, or contact sets ({', '.join(sorted(CONTACT_SETS))})"
        ) from error
    return load_study(where)


def _kept_result(where: str) -> Path | None:
    """Find the result that is kept beside a study file, in a folder or of a bundled study."""
    path = Path(where)
    folder = path if path.is_dir() else bundled_root() / where
    found = folder / "result.json"
    return found if found.is_file() and not path.is_file() else None


def _searched(where: str, study: Setup, result: Row, trial: int | None) -> NamedDesign:
    rows = {row["trial"]: row for row in result["trials"]}
    if trial is None:
        own = next((row for row in result["trials"] if row["prototype"]), None)
        chosen = result["best"] or own
        if chosen is None:
            raise InputError(f"'{where}' has no chosen design and no prototype; name one with #N")
        trial = int(chosen["trial"])
    row = rows.get(trial)
    if row is None:
        raise InputError(
            f"'{where}' has no design {trial}; it has the designs 0 (prototype) to {max(rows)}"
        )
    if row[SIMULATED] is None:
        raise InputError(
            f"design {trial} of '{where}' failed {', '.join(row['failed'])} and was not simulated; "
            "name one that has a time"
        )
    return NamedDesign(f"{where}#{trial}", study, result, row)
