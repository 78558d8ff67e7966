"""Record of a study: every key of ``result.json`` with its type, unit and meaning.

Search and confirmation make these records, pages and tables read them. Unknown keys are refused.
``docs/api/result.md`` shows the same declarations (``benchmarks.figures.key_table``).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pydantic import create_model

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.schema import variable_key
from dogshape.pipeline.config.study_file import SHAPE
from dogshape.pipeline.record import SHARE, FileRecord, Record
from dogshape.pipeline.simulate.design import OBJECTIVES
from dogshape.pipeline.simulate.evaluation import LifeStage
from dogshape.pipeline.simulate.tolerance_time import ToleranceTime
from dogshape.pipeline.store.check_records import CheckRow, VerdictRow
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.result_records import (
    EngineAgreement,
    ExpectedTime,
    HangKeys,
    HangPriorRow,
)
from dogshape.sim.clutch_tables import key, validate
from dogshape.sim.strength.manufacture import Kind
from dogshape.sim.units import unit_of
from dogshape.surrogate.store import Validation

#: Keys that a design has where the study searches them or has them for objectives.
OPTIONAL = {
    name: f"value of `{variable_key(name)}`, where it is searched" for name in (*SHAPE, *OPERATED)
}
OPTIONAL |= {
    name: f"{objective.label}, where it is an objective" for name, objective in OBJECTIVES.items()
}

if TYPE_CHECKING:

    class DesignKeys(FileRecord):
        """Searched keys and objectives; ``DesignRow.value`` reads them by their names."""
else:
    _FIELDS: Any = {
        name: (int | float | None, key(meaning, unit_of(name), None))
        for name, meaning in OPTIONAL.items()
    }
    DesignKeys = create_model("DesignKeys", __base__=FileRecord, **_FIELDS)


class DesignRow(DesignKeys, HangKeys):
    """A design of the search; its searched keys have the units that their names end in.

    In `trials` values and margins are those of the search, in `best` and `front` those of the new
    angles, once there is a confirmation. Of a design that was not simulated simulated values are
    null, of one that engages too seldom its times.
    """

    trial: int = key("number of the trial")
    prototype: bool = key("whether this is the study's own design")
    smallest_margin: float | None = key("smallest margin of all checks at nominal size", "1")
    weakest_check: str = key("check with the smallest margin; `geometry` if no dog has the shape")
    margins: dict[str, float] = key("margin to the limit, by check", "1")
    expected_shift_time_s: float | None = key("`engaged_mean_s` and `retries_s`", "s")
    standard_errors: dict[str, float | None] = key("of each estimated objective, in its unit")
    standard_error_s: float | None = key("standard error of the expected shift time", "s")
    points: int = key("operating points that were simulated")
    shifts: int = key("shifts that were simulated")
    engaged: float | None = key("least share of the shifts that engaged at a point", SHARE)
    feasible: bool = key("whether the design was simulated and no check has a negative margin")
    failed: list[str] = key(
        "checks that fail; `engines` where these disagree, `simulation` where shifts say nothing"
    )
    margin_worst_case: float | None = key("smallest margin with all tolerances at worst", "1")
    weakest_check_worst_case: str | None = key("check with that margin", late=True)
    margin_root_sum_square: float | None = key("smallest margin by root sum of squares", "1")
    weakest_check_root_sum_square: str | None = key("check with that margin", late=True)
    time_within_tolerances: ToleranceTime | None = key(
        "change of the expected shift time within tolerances; null without a surrogate"
    )

    def value(self, name: str) -> float | None:
        """Return a searched key or an objective by its name; None where the design has none."""
        value: float | None = getattr(self, name)
        return value

    def params(self, names: Iterable[str]) -> dict[str, float]:
        """Return searched keys by their names, edge units."""
        return {name: getattr(self, name) for name in names}

    def margin_within(self, kind: Kind) -> float | None:
        """Return the smallest margin within the tolerances, effects added as by ``kind``."""
        return self.margin_worst_case if kind == "worst_case" else self.margin_root_sum_square

    def weakest_within(self, kind: Kind) -> str | None:
        """Return the check with that margin; None in earlier versions."""
        if kind == "worst_case":
            return self.weakest_check_worst_case
        return self.weakest_check_root_sum_square


class ObjectiveEstimate(Record):
    """A simulated objective of a confirmed design."""

    value: float = key("value, in the unit of the objective")
    standard_error: float = key("standard error, in the same unit")


class ConfirmedDesign(FileRecord, ExpectedTime):
    """A design re-simulated at every operating point and at angles that the search did not use."""

    trial: int | None = key("number of the trial; in `designs` alone", "", None)
    estimates: dict[str, ObjectiveEstimate] = key("simulated objectives, by name")
    checks: list[CheckRow] = key("all checks, the hardest landing among them")
    verdict: VerdictRow | None = key("verdict on the design", late=True)
    drake: EngineAgreement | None = key("agreement of Drake; null where one engine ran", "", None)
    searched: ObjectiveEstimate | None = key(
        "leading objective by the search; in `designs` alone", "", None
    )
    errors_apart: float | None = key(
        "new angles less search, over their combined standard error; in `designs` alone", "", None
    )
    agrees: bool | None = key("whether `errors_apart` is at most 3; in `designs` alone", "", None)


class OtherShape(Record):
    """The chosen design with a feature of shape that it has not, at the same new angles."""

    shape: str = key("what differs")
    expected_shift_time_s: float | None = key("mean shift time; null where too few engage", "s")
    standard_error_s: float | None = key("its standard error", "s")
    feasible: bool = key("whether no check has a negative margin")
    verdict: VerdictRow | None = key("verdict on it, without assumptions", late=True)


class Confirmation(FileRecord):
    """Re-simulation of the prototype and of designs of the front at new angles."""

    angles: int = key("relative angles at each operating point")
    prototype: ConfirmedDesign = key("the study's own design")
    chosen: int = key(
        "trial of the chosen design, the best at the new angles with hangs by their posterior"
    )
    best: ConfirmedDesign = key("the chosen design")
    designs: list[ConfirmedDesign] = key("all designs, in the order of the search")
    hang_prior: list[HangPriorRow] | None = key(
        "prior of hangs by operating point, fitted to all designs", late=True
    )
    shapes: list[OtherShape] | None = key("the chosen design with other features", "", None)
    left_out: list[int] = key("undominated trials beyond `search.confirm_designs`, not confirmed")
    gain_s: float | None = key(
        "prototype's time less the chosen design's; null where one has none or both are one", "s"
    )
    gain_standard_error_s: float | None = key("standard error of `gain_s`", "s")
    gain_share: float | None = key("gain over the time of the prototype", SHARE)
    gains: dict[str, ObjectiveEstimate] = key("gain in each simulated objective, in its unit")


class RemainingGain(Record):
    """Gain in the leading objective of the best allowed design over the chosen one.

    Predicted from the designs of the search for candidates about the best and of the whole space,
    in the unit of the objective.
    """

    expected: float = key("expected gain, at least 0")
    upper: float = key("95 % quantile of the gain")


class StudyRecord(FileRecord):
    """The whole record, ``result.json``."""

    study: str = key("name of the study")
    engine: str = key("engine that simulated the shifts, `drake` or `planar`", "", "drake")
    objectives: list[str] = key("objectives, in the order of the study file")
    leading: str = key("objective that decides which design is best")
    quantile: float = key("level of the quantile of the shift time", SHARE)
    best: DesignRow | None = key(
        "the chosen design; null where each has a check with a negative margin"
    )
    front: list[DesignRow] = key(
        "designs that no other dominates, best first; once there is a confirmation, by its values"
    )
    trials: list[DesignRow] = key("all designs, by trial")
    n_simulated_designs: int = key("different designs that were simulated")
    n_simulated_shifts: int = key("shifts of search and confirmation, of both engines")
    failed_shifts: dict[str, int] = key(
        "shifts that failed in the solver, by reason; of a confirmation those that are kept"
    )
    hang_prior: list[HangPriorRow] | None = key(
        "prior of hangs by operating point, fitted to the designs of the search", late=True
    )
    confirmation: Confirmation | None = key("confirmation; null until the search has ended")
    nearest: list[ConfirmedDesign] | None = key(
        "own dog and designs that fail by least, re-simulated where none passes", "", None
    )
    remaining_gain: RemainingGain | None = key(
        "gain that further designs promise; null where nothing is chosen or predicted", late=True
    )
    life: list[LifeStage] | None = key("drift over the life; null without `[wear]`", "", None)
    audit: EngineAgreement | None = key(
        "agreement of Drake on random shifts; null where one engine did all", "", None
    )
    surrogate: Validation | None = key("validation of the surrogate; null without one")
    versions: dict[str, str] = key("versions of the programs that the result depends on")
    config_hash: str = key("hash of the study file as it was run")
    physics_hash: str = key("hash of what the simulation of a shift depends on")


def read_study_record(folder: StudyFolder) -> StudyRecord:
    """Read ``result.json`` of a study.

    StorageError if the file is missing or damaged; InputError for keys that ``StudyRecord`` lacks,
    or that the file lacks.
    """
    return study_record_of(folder.stored_result(), str(folder.result))


def study_record_of(values: dict[str, Any], source: str) -> StudyRecord:
    """Read the values of a ``result.json``; InputError with its ``source`` for wrong keys."""
    return validate(StudyRecord, values, source)
