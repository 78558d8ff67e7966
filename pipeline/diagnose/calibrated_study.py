"""A calibrated study (``docs/gap.md``): a study file with the effects of a diagnosis, and draws."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dogshape.bench.texts import read_toml
from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.report.wording import chance, describe_parameter, headline_of
from dogshape.diagnosis.terms import Array, Hypothesis, hypothesis_name
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, find_study, load_study, override
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.study_keys import (
    Data,
    effect_settings,
    has_keys_for,
    rounded,
    study_of,
    touched_keys,
)
from dogshape.pipeline.store.folder import require_targets
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import validate
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError, StorageError, require_known
from dogshape.sim.files import write_whole
from dogshape.sim.interface import argument
from dogshape.sim.shift.clutch import Clutch

DRAWS = 200  #: of the posterior
MAX_LISTED = 5  #: hypotheses that an error names


@dataclass(frozen=True)
class CalibratedStudy:
    """A study with the effects of a diagnosis."""

    study: Setup  #: as it is read back
    text: str  #: of the study file
    hypothesis: Hypothesis  #: effects of the file
    probability: float  #: of just these
    draws: tuple[Data, ...]  #: keys of the study with their values, a row for each draw
    remarks: tuple[str, ...]  #: sentences on effects left out and keys replaced

    def write(self, path: Path) -> None:
        """Write the study, and the draws beside it."""
        draws = pd.DataFrame(list(self.draws), dtype=object)
        write_whole(draws_beside(path), draws.to_csv(index=False, lineterminator="\n"))
        write_whole(path, self.text)

    @property
    def effects(self) -> Data:
        """Effects of the study file with their values."""
        return dict(self.study.file.effects or {})

    def to_dict(self, path: Path) -> Data:
        """Return the record of a study in ``path``: files, effects, number of draws, remarks."""
        return {
            "study": str(path),
            "draws": str(draws_beside(path)),
            "n_draws": len(self.draws),
            "hypothesis": list(self.hypothesis),
            "probability": self.probability,
            "effects": self.effects,
            "remarks": list(self.remarks),
        }


def require_new_study(path: Path, base: str | None = None) -> None:
    """Raise an error before the long work unless a study can be written to a path.

    StorageError where it is there already or cannot be written, InputError for a name or a base
    that no study has.
    """
    if path.suffix != ".toml":
        rule = "a study is a TOML file; name it NAME.toml"
        raise InputError(f"{argument('path')} is '{path}', but {rule}")
    targets = {argument("path"): path, f"draws of {argument('path')}": draws_beside(path)}
    for option, target in targets.items():
        if target.exists():
            raise StorageError(f"{option} is {target}, which is there already; name another file")
    require_targets(targets)
    load_study("mq200" if base is None else base, {"name": path.stem})


def draws_beside(path: Path) -> Path:
    """Return the path of the draws that belong to a study file."""
    return path.with_name(f"{path.stem}-draws.csv")


def calibrated_study(
    diagnosis: Inference, path: Path, base: str | None, draws: int, causes: Sequence[str] | None
) -> CalibratedStudy:
    """Add the effects of a diagnosis to a study, as ``dogshape.Diagnosis.calibrated`` writes it.

    Parameters
    ----------
    diagnosis
        Diagnosis of a bench.
    path
        File of the study, which gives its name.
    base
        Study to add the effects to; by default one of the bench's clutch.
    draws
        Number of draws from the posterior.
    causes
        Names of the effects, by default those of the most probable hypothesis. They contain the
        causes of the verdict.

    Raises
    ------
    InputError
        Where no effect is named, a study takes none, or ``causes`` has no fit.

    """
    hypothesis = _choose_hypothesis(diagnosis, path, causes)
    fit = diagnosis.fits[hypothesis]
    bench = diagnosis.bench
    data = study_of(bench, path.stem) if base is None else read_toml(find_study(base))
    data["name"] = path.stem
    base_study = build_study(validate(StudyFile, data, str(path)))
    effects, remarks = _split_effects(diagnosis, hypothesis, base_study.clutch)
    if not effects:
        raise InputError(
            f"{argument('path')} is '{path}', but a study has no key for the cause "
            f"({hypothesis_name(hypothesis, diagnosis.effects)}); {'; '.join(remarks)}"
        )

    def settings_at(values: Array) -> Data:
        """Write values (p,) of the hypothesis as dotted keys of the study."""
        settings = Data()
        for effect in effects:
            numbers = map(rounded, values[fit.space.columns(effect.name)].tolist())
            names = [parameter.name for parameter in effect.parameters]
            parameters = dict(zip(names, numbers, strict=True))
            settings |= effect_settings(base_study.clutch, effect, parameters)
        return settings

    replaced_keys = _clashing_keys(data, effects, base_study.clutch)
    remarks += [f"{key} of the study is replaced by that of the bench" for key in replaced_keys]
    for key in replaced_keys:
        override(data, key, None)
    for key, value in settings_at(fit.values.mean(axis=0)).items():
        override(data, key, value)
    remarks += _friction_remarks(bench.clutch, base_study.clutch)
    comments = _comments(
        diagnosis, hypothesis, base, remarks=remarks, draws_file=draws_beside(path).name
    )
    text = toml_text(data, comments)
    indices = np.random.default_rng(1).integers(len(fit.values), size=draws).tolist()
    rows = [
        {"draw": number, **settings_at(fit.values[index])}
        for number, index in enumerate(indices, start=1)
    ]
    return CalibratedStudy(
        study=build_study(validate(StudyFile, tomllib.loads(text), str(path))),
        text=text,
        hypothesis=hypothesis,
        probability=diagnosis.posterior.get(hypothesis, 0.0),
        draws=tuple(rows),
        remarks=tuple(remarks),
    )


def _split_effects(
    diagnosis: Inference, hypothesis: Hypothesis, clutch: Clutch
) -> tuple[list[Effect], list[str]]:
    """List the effects that a study has keys for, and a remark on each other effect."""
    effects = []
    remarks = []
    for name in hypothesis:
        effect = diagnosis.effects[name]
        if has_keys_for(clutch, effect):
            effects.append(effect)
            continue
        reason = "set its keys of [mechanism]"
        if name in registry.load():
            reason = "it belongs to the stand"
        remarks.append(f"{effect.plain} ({name}) is left out: {reason}")
    return effects, remarks


def _friction_remarks(bench_clutch: Clutch, study_clutch: Clutch) -> list[str]:
    """List a remark where bench and study differ in friction."""
    bench_friction, study_friction = (
        f"{clutch.contact.static_friction:g} and {clutch.contact.dynamic_friction:g}"
        for clutch in (bench_clutch, study_clutch)
    )
    if bench_friction == study_friction:
        return []
    return [f"friction of the bench is {bench_friction}, that of the study {study_friction}"]


def _choose_hypothesis(
    diagnosis: Inference, path: Path, causes: Sequence[str] | None
) -> Hypothesis:
    """Find the hypothesis of ``causes``, or the most probable one; InputError where none fits."""
    verdict = diagnosis.verdict
    verdict_causes = set(verdict.causes)
    candidates = [
        h for h in diagnosis.posterior if h and h in diagnosis.fits and verdict_causes <= set(h)
    ]
    if causes is not None:
        require_effects(causes, diagnosis.effects)
        hypothesis = tuple(sorted(causes))
        if hypothesis in candidates:
            return hypothesis
        examples = "; ".join(", ".join(h) for h in candidates[:MAX_LISTED])
        raise InputError(
            f"{argument('causes')} is '{', '.join(causes)}', but just these have less than 0.1 % "
            f"or lack a part of the cause ({', '.join(sorted(verdict_causes)) or 'none'}); "
            f"name one of: {examples}"
        )
    if verdict_causes:
        return candidates[0]
    remedy = "take the study as it is"
    if verdict.kind != "none":
        test = diagnosis.tests[0].name if diagnosis.tests else "more shifts"
        remedy = f"make the next test ({test}) and diagnose again"
    raise InputError(
        f"{argument('path')} is '{path}', but the diagnosis of {diagnosis.bench.name} names no "
        f"effect ({headline_of(verdict, diagnosis.effects)}); {remedy}"
    )


def require_effects(causes: Sequence[str], effects: Mapping[str, Effect]) -> None:
    """Raise InputError unless all ``causes`` are names of ``effects``."""
    for name in causes:
        require_known(argument("causes"), name, "an effect", effects)


def _clashing_keys(data: Data, effects: Sequence[Effect], clutch: Clutch) -> list[str]:
    """List the dotted keys of a study that some effects set too."""
    registered = registry.load()
    keys_of_effects = {key for effect in effects for key in touched_keys(clutch, effect)}
    keys = set()
    for table in ("mechanism", "contact"):
        keys |= {f"{table}.{key}" for key in data.get(table, {})} & keys_of_effects
    for name in data.get("effects", {}):
        if touched_keys(clutch, registered[name]) & keys_of_effects:
            keys.add(f"effects.{name}")
    return sorted(keys)


def _comments(
    diagnosis: Inference,
    hypothesis: Hypothesis,
    base: str | None,
    *,
    remarks: Sequence[str],
    draws_file: str,
) -> dict[str, list[str]]:
    """Write the comments of the study file by dotted key, ``""`` for the top."""
    source = "clutch and operating points of the bench" if base is None else f"the study {base}"
    bench = diagnosis.bench.name
    probability = chance(diagnosis.posterior.get(hypothesis, 0.0))
    comments = {
        "": [
            f"Calibrated study: {source} with the cause from the diagnosis of {bench}.",
            f"{headline_of(diagnosis.verdict, diagnosis.effects)}.",
            f"Just these effects have {probability}.",
            *(f"{remark[0].upper()}{remark[1:]}." for remark in remarks),
            "Values are posterior means, intervals hold 90 %; "
            f"{draws_file} has draws of these effects.",
        ]
    }
    intervals = diagnosis.fits[hypothesis].intervals
    for name in hypothesis:
        sizes = [
            describe_parameter(parameter.name, intervals[parameter.name])
            for parameter in diagnosis.effects[name].parameters
        ]
        part = "part of the cause" if name in diagnosis.verdict.causes else "open"
        inclusion = chance(diagnosis.inclusion.get(name, 0.0))
        comments[f"effects.{name}"] = [f"{'; '.join(sizes)}; {part} ({inclusion})."]
    return comments
