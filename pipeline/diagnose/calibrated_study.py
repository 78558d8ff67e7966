"""A calibrated study (``docs/gap.md``): a study file with the effects of a diagnosis, and draws."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import chance, described, headline_of
from dogshape.diagnosis.terms import Array, Hypothesis, plain
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, find_study, load_study, override
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.study_keys import (
    Data,
    effect_settings,
    rounded,
    study_of,
    takes,
    touched_keys,
)
from dogshape.pipeline.store.folder import require_targets
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import validate
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError, StorageError, require_known
from dogshape.sim.files import write_whole
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.texts import read_toml

DRAWS = 200  #: of the posterior
SHOWN = 5  #: hypotheses that an error names


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

    def to_dict(self, path: Path) -> Data:
        """Write the record: files, effects, number of draws, and remarks."""
        return {
            "study": str(path),
            "draws": str(draws_beside(path)),
            "n_draws": len(self.draws),
            "hypothesis": list(self.hypothesis),
            "probability": self.probability,
            "effects": dict(self.study.file.effects or {}),
            "remarks": list(self.remarks),
        }


def require_new_study(path: Path, base: str | None = None) -> None:
    """Raise an error before the long work unless a study can be written to a path.

    StorageError where it is there already or cannot be written, InputError for a name or a base
    that no study has.
    """
    if path.suffix != ".toml":
        raise InputError(f"--write is '{path}', but a study is a TOML file; name it NAME.toml")
    targets = {"--write": path, "draws of --write": draws_beside(path)}
    for name, one in targets.items():
        if one.exists():
            raise StorageError(f"{name} is {one}, which is there already; name another file")
    require_targets(targets)
    load_study("mq200" if base is None else base, {"name": path.stem})


def draws_beside(path: Path) -> Path:
    """Return the path of the draws that belong to a study file."""
    return path.with_name(f"{path.stem}-draws.csv")


def calibrated_study(
    found: Diagnosis, path: Path, base: str | None, draws: int, causes: Sequence[str] | None
) -> CalibratedStudy:
    """Put the effects of a diagnosis into a study, as ``dogshape.Diagnosis.calibrated`` writes it.

    ``causes`` has those of the verdict. Raises InputError, with the remedy, where no effect is
    named, a study takes none, or ``causes`` has no fit.
    """
    hypothesis = _chosen(found, path, causes)
    fit, effects, bench = found.fits[hypothesis], found.effects, found.bench
    data = study_of(bench, path.stem) if base is None else read_toml(find_study(base))
    data["name"] = path.stem
    given = build_study(validate(StudyFile, data, str(path)))
    taken = [effects[n] for n in hypothesis if takes(given.clutch, effects[n])]
    remarks = [
        f"{effects[n].plain} ({n}) is left out: "
        + ("it belongs to the stand" if n in registry.load() else "set its keys of [mechanism]")
        for n in hypothesis
        if effects[n] not in taken
    ]
    if not taken:
        raise InputError(
            f"--write is '{path}', but a study has no key for the cause "
            f"({plain(hypothesis, effects)}); {'; '.join(remarks)}"
        )

    def keyed(numbers: Array) -> Data:
        """Write values (p,) of the hypothesis as dotted keys of the study."""
        row = Data()
        for effect in taken:
            mine = map(rounded, numbers[fit.space.columns(effect.name)].tolist())
            names = [parameter.name for parameter in effect.parameters]
            row |= effect_settings(given.clutch, effect, dict(zip(names, mine, strict=True)))
        return row

    replaced = _clashing(data, taken, given.clutch)
    remarks += [f"{key} of the study is replaced by that of the bench" for key in replaced]
    for key, value in (*dict.fromkeys(replaced).items(), *keyed(fit.values.mean(axis=0)).items()):
        override(data, key, value)
    friction = [
        f"{one.static_friction:g} and {one.dynamic_friction:g}"
        for one in (bench.clutch.contact, given.clutch.contact)
    ]
    if friction[0] != friction[1]:
        remarks.append(f"friction of the bench is {friction[0]}, that of the study {friction[1]}")
    text = toml_text(data, _comments(found, hypothesis, base, remarks, draws_beside(path).name))
    places = np.random.default_rng(1).integers(len(fit.values), size=draws).tolist()
    rows = [{"draw": k, **keyed(fit.values[place])} for k, place in enumerate(places, start=1)]
    return CalibratedStudy(
        build_study(validate(StudyFile, tomllib.loads(text), str(path))),
        text,
        hypothesis,
        found.posterior.get(hypothesis, 0.0),
        tuple(rows),
        tuple(remarks),
    )


def _chosen(found: Diagnosis, path: Path, causes: Sequence[str] | None) -> Hypothesis:
    """Find the hypothesis of ``causes``, or the most probable one; InputError where none fits."""
    named = set(found.verdict.causes)
    there = [h for h in found.posterior if h and h in found.fits and named <= set(h)]
    if causes is not None:
        require_effects(causes, found.effects)
        if (hypothesis := tuple(sorted(causes))) in there:
            return hypothesis
        likely = "; ".join(", ".join(h) for h in there[:SHOWN])
        raise InputError(
            f"--causes is '{', '.join(causes)}', but just these have less than 0.1 % or lack a "
            f"part of the cause ({', '.join(sorted(named)) or 'none'}); name one of: {likely}"
        )
    if named:
        return there[0]
    remedy = "take the study as it is"
    if found.verdict.kind != "none":
        first = found.tests[0].name if found.tests else "more shifts"
        remedy = f"make the next test ({first}) and diagnose again"
    raise InputError(
        f"--write is '{path}', but the diagnosis of {found.bench.name} names no effect "
        f"({headline_of(found.verdict, found.effects)}); {remedy}"
    )


def require_effects(causes: Sequence[str], effects: Mapping[str, Effect]) -> None:
    """Raise InputError unless all ``causes`` are names of ``effects``."""
    for name in causes:
        require_known("--causes", name, "an effect", effects)


def _clashing(data: Data, taken: Sequence[Effect], clutch: Clutch) -> list[str]:
    """List the keys of a study that set the same as some effects."""
    known = registry.load()
    touched = {key for effect in taken for key in touched_keys(clutch, effect)}
    given = [f"{table}.{key}" for table in ("mechanism", "contact") for key in data.get(table, {})]
    own = {name: touched_keys(clutch, known[name]) for name in data.get("effects", {})}
    again = [f"effects.{name}" for name, keys in own.items() if keys & touched]
    return sorted([*touched.intersection(given), *again])


def _comments(
    found: Diagnosis, hypothesis: Hypothesis, base: str | None, remarks: Sequence[str], table: str
) -> dict[str, list[str]]:
    source = "clutch and operating points of the bench" if base is None else f"the study {base}"
    comments = {
        "": [
            f"Calibrated study: {source} with the cause from the diagnosis of {found.bench.name}.",
            f"{headline_of(found.verdict, found.effects)}.",
            f"Just these effects have {chance(found.posterior.get(hypothesis, 0.0))}.",
            *(f"{remark[0].upper()}{remark[1:]}." for remark in remarks),
            f"Values are posterior means, intervals hold 90 %; {table} has draws of these effects.",
        ]
    }
    sizes = found.fits[hypothesis].intervals
    for name in hypothesis:
        size = "; ".join(described(p.name, sizes[p.name]) for p in found.effects[name].parameters)
        part = "part of the cause" if name in found.verdict.causes else "open"
        share = chance(found.inclusion.get(name, 0.0))
        comments[f"effects.{name}"] = [f"{size}; {part} ({share})."]
    return comments
