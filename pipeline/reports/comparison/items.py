"""Items of a comparison: designs, studies, folders of results and contact sets by their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dogshape.pipeline.config.study_file import Setup, bundled_studies, load_study
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.study.single_shifts import Shifts, read_shifts
from dogshape.pipeline.reports.study.standing import Standing, standing_of
from dogshape.pipeline.simulate.design import SIMULATED, design_of, weakest_within
from dogshape.pipeline.store.decisions import decisions_of
from dogshape.pipeline.store.folder import StudyFolder, read_json
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.bundled import bundled_root
from dogshape.sim.errors import InputError
from dogshape.sim.shift.contact import CONTACT_SETS, ContactSet
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.units import MM


@dataclass(frozen=True)
class Item:
    """A design that is compared, with the study it belongs to.

    Parameters
    ----------
    label : as it was asked for, with the number of the design.
    source : where the result comes from, in words.
    study : its study file.
    standing : what is known of the design; without a time where nothing was simulated.
    prototype : that of the study's own dog; None where it was not simulated.
    shifts : single shifts, None where only a kept result is there.
    predicted : what its time comes from where nothing of it was simulated; empty elsewhere.
    """

    label: str
    source: str
    study: Setup
    standing: Standing
    prototype: Standing | None = None
    shifts: Shifts | None = None
    predicted: str = ""

    @property
    def engine(self) -> str:
        """Engine of the study's shifts."""
        return self.study.clutch.solver.engine

    @property
    def confirmed_shifts(self) -> list[Record]:
        """Shifts at the new angles of the confirmation; empty where there are none."""
        if self.shifts is None:
            return []
        names = self.study.variables
        return self.shifts.confirmed({name: self.standing.row[name] for name in names})


def contact_sets(names: Sequence[str]) -> list[ContactSet] | None:
    """Return the contact sets of the names; None where none of them is one.

    Raises InputError where some are contact sets and others not.
    """
    sets = [name for name in names if name in CONTACT_SETS and not Path(name).exists()]
    if not sets:
        return None
    if others := [name for name in names if name not in sets]:
        raise InputError(
            f"'{sets[0]}' is a contact set and '{others[0]}' is none, so that they have nothing to "
            "compare; give contact sets alone, or designs and studies alone"
        )
    return [CONTACT_SETS[name] for name in names]


def item_of(name: str) -> Item:
    """Read an item: ``FOLDER#N`` or ``STUDY#N`` is a design, without ``#N`` the one that counts.

    That is the one decided for, else the one chosen, else the study's own dog.

    Raises
    ------
    InputError
        For a name that is nothing known, or a design that is not there or was not simulated.
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
        study, result = folder.stored_study(), folder.stored_result()
        taken = decisions_of(folder)
        if trial is None and taken:
            trial = taken[-1].design
        shifts = read_shifts(study, ShiftJournal(folder.shifts, only_read=True))
        return _searched(where, study, result, trial, shifts)
    study = _study(where)
    kept = _kept_result(where)
    if kept is None:
        if trial is not None:
            raise InputError(
                f"'{name}' names design {trial}, but '{where}' has no result; run 'dogshape study "
                f"{where}' and give the folder of its results"
            )
        return Item(where, "study, not searched", study, _own(study))
    return _searched(where, study, read_json(kept, "take it away"), trial, None)


def _study(where: str) -> Setup:
    try:
        return load_study(where)
    except InputError as error:
        if "there is no study" not in str(error):
            raise
        raise InputError(
            f"'{where}' is no folder of results, no study and no contact set; give a folder as "
            f"results/mq200 (with #N for a design), a study file, one of "
            f"{', '.join(bundled_studies())}, or contact sets ({', '.join(sorted(CONTACT_SETS))})"
        ) from error


def _kept_result(where: str) -> Path | None:
    """Find the result that is kept beside a study file, in a folder or of a bundled study."""
    path = Path(where)
    folder = path if path.is_dir() else bundled_root() / where
    found = folder / "result.json"
    return found if found.is_file() and not path.is_file() else None


def _searched(
    where: str, study: Setup, result: Row, trial: int | None, shifts: Shifts | None
) -> Item:
    rows = {row["trial"]: row for row in result["trials"]}
    own = next((row for row in result["trials"] if row["prototype"]), None)
    if trial is None:
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
    prototype = None
    if own is not None and own[SIMULATED] is not None:
        prototype = standing_of(study, result, own)
    kept = "kept result, without single shifts" if shifts is None else "results with their shifts"
    standing = standing_of(study, result, row)
    return Item(f"{where}#{trial}", kept, study, standing, prototype, shifts)


def _own(study: Setup) -> Standing:
    """Give the standing of a study's own dog, of which nothing was simulated."""
    design, dog = design_of(study, {}), study.clutch.dog
    margins = {check.name: check.margin for check in design.checks}
    row: Row = {"trial": 0, "prototype": True, **study.prototype}
    friction = locking_friction(dog, study.limits.load)
    worst = weakest_within(study, design)
    return Standing(row, None, None, margins, worst, friction, dog.axial_length / MM)
