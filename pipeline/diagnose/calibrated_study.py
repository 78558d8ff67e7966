"""A calibrated study: a study file with the effects of a diagnosis, and draws of their sizes.

The file has the most probable hypothesis that contains every named effect, at its posterior means.
The draws are of this hypothesis; their columns are keys of the study, as ``--set`` takes them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import chance, described, headline_of
from dogshape.diagnosis.terms import Array, Hypothesis, plain
from dogshape.pipeline.config.mechanism import PROBE
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, find_study, load_study
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.study_keys import Data, EffectKeys, rounded, study_of
from dogshape.pipeline.store.folder import require_targets
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import validate
from dogshape.sim.effect import Effect, Values
from dogshape.sim.errors import InputError, StorageError, did_you_mean
from dogshape.sim.files import write_whole
from dogshape.sim.setting import Setting
from dogshape.sim.texts import read_toml

DRAWS = 200  #: of the posterior
RARE = 0.005  #: probability from which another set is named in the file
SHOWN = 5  #: hypotheses that an error names


@dataclass(frozen=True)
class CalibratedStudy:
    """A study with the effects of a diagnosis.

    Parameters
    ----------
    study : as it was read back from ``text``.
    text : the study file.
    hypothesis, probability : effects of the file, and the probability of just these.
    named : effects that are part of the cause by the verdict.
    draws : keys of the study with their values, a row for each draw.
    remarks : sentences on effects left out and keys replaced.
    """

    study: Setup
    text: str
    hypothesis: Hypothesis
    probability: float
    named: tuple[str, ...]
    draws: tuple[Data, ...]
    remarks: tuple[str, ...]

    def write(self, path: Path) -> Path:
        """Write the study, and the draws beside it; return the path of the draws."""
        import pandas as pd  # noqa: PLC0415  # slow to load

        table = draws_beside(path)
        draws = pd.DataFrame(list(self.draws), dtype=object)
        write_whole(table, draws.to_csv(index=False, lineterminator="\n"))
        write_whole(path, self.text)
        return table

    def to_dict(self, path: Path) -> Data:
        """Write the record: files, effects, number of draws, and remarks."""
        return {
            "study": str(path),
            "draws": str(draws_beside(path)),
            "n_draws": len(self.draws),
            "hypothesis": list(self.hypothesis),
            "probability": self.probability,
            "named": list(self.named),
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
    found: Diagnosis,
    path: Path,
    base: str | None = None,
    draws: int = DRAWS,
    seed: int = 1,
    *,
    causes: Sequence[str] | None = None,
) -> CalibratedStudy:
    """Put the effects of a diagnosis into a study.

    Parameters
    ----------
    path : of the study file, whose stem becomes the study's name.
    base : study that takes the effects; None for one of the bench's own clutch and points.
    draws, seed : number of draws from the posterior, and their seed.
    causes : effects of the file, all that are part of the cause among them; None for the most
        probable set of such.

    Raises
    ------
    InputError
        The diagnosis names no effect, or none that a study takes, or has no fit of ``causes``;
        with the remedy.
    """
    hypothesis = _chosen(found, path) if causes is None else _asked(found, causes)
    fit, effects, bench = found.fits[hypothesis], found.effects, found.bench
    sizes = _by_effect(found, hypothesis, fit.values.mean(axis=0))
    data = study_of(bench, path.stem) if base is None else read_toml(find_study(base))
    data["name"] = path.stem
    given = _built(data, path)
    keys = EffectKeys(Setting(given.clutch, PROBE))
    taken = {n: effects[n] for n in hypothesis if keys.takes(effects[n])}
    remarks = [
        f"{effects[n].plain} ({n}) is left out: "
        + ("it belongs to the stand" if n in registry.load() else "set its keys of [mechanism]")
        for n in hypothesis
        if n not in taken
    ]
    if not taken:
        raise InputError(
            f"--write is '{path}', but a study has no key for the cause "
            f"({plain(hypothesis, effects)}); {'; '.join(remarks)}"
        )
    for key in sorted(_clashing(data, taken, keys)):
        table, _, name = key.partition(".")
        data[table] = {k: v for k, v in data[table].items() if k != name}
        remarks.append(f"{key} of the study is replaced by that of the bench")
    for name, effect in taken.items():
        for key, value in keys.settings(effect, sizes[name]).items():
            *tables, last = key.split(".")
            inner = data
            for table in tables:
                inner[table] = dict(inner.get(table, {}))
                inner = inner[table]
            inner[last] = value
    friction = [
        f"{one.static_friction:g} and {one.dynamic_friction:g}"
        for one in (bench.clutch.contact, given.clutch.contact)
    ]
    if friction[0] != friction[1]:
        remarks.append(f"friction of the bench is {friction[0]}, that of the study {friction[1]}")
    text = toml_text(data, _comments(found, hypothesis, base, remarks, draws_beside(path).name))
    rows = []
    places = np.random.default_rng(seed).integers(len(fit.values), size=draws).tolist()
    for number, place in enumerate(places, start=1):
        drawn = _by_effect(found, hypothesis, fit.values[place])
        rows.append(Data(draw=number))
        for name, effect in taken.items():
            rows[-1] |= keys.settings(effect, drawn[name])
    return CalibratedStudy(
        _built(tomllib.loads(text), path), text, hypothesis, found.posterior.get(hypothesis, 0.0),
        found.verdict.causes, tuple(rows), tuple(remarks),
    )  # fmt: skip


def _built(data: Data, path: Path) -> Setup:
    return build_study(validate(StudyFile, data, str(path)))


def _chosen(found: Diagnosis, path: Path) -> Hypothesis:
    """Find the most probable hypothesis that contains all named effects; none is refused."""
    causes = set(found.verdict.causes)
    if causes:
        return next(h for h in found.posterior if h in found.fits and causes <= set(h))
    first = f"the next test ({found.tests[0].name})" if found.tests else "more shifts"
    remedy = f"make {first} and diagnose again"
    if found.verdict.kind == "none":
        remedy = "take the study as it is"
    raise InputError(
        f"--write is '{path}', but the diagnosis of {found.bench.name} names no effect "
        f"({headline_of(found.verdict, found.effects)}); {remedy}"
    )


def require_effects(causes: Sequence[str], effects: Mapping[str, Effect]) -> None:
    """Raise InputError unless all ``causes`` are names of ``effects``."""
    for name in causes:
        if name not in effects:
            hint = did_you_mean(name, effects)
            raise InputError(
                f"--causes is '{', '.join(causes)}', but '{name}' is no effect; {hint}"
            )


def _asked(found: Diagnosis, causes: Sequence[str]) -> Hypothesis:
    """Find the hypothesis of some effects; InputError where it has no fit."""
    require_effects(causes, found.effects)
    asked, named = ", ".join(causes), found.verdict.causes
    hypothesis = tuple(sorted(causes))
    if lacking := [name for name in named if name not in causes]:
        rule = f"{' and '.join(lacking)} is part of the cause in any case; name it too"
    elif hypothesis in found.fits:
        return hypothesis
    else:
        there = [h for h in found.posterior if h and h in found.fits and set(named) <= set(h)]
        likely = "; ".join(", ".join(h) for h in there[:SHOWN])
        rule = f"just these together have less than 0.1 %; name one of: {likely}"
    raise InputError(f"--causes is '{asked}', but {rule}")


def _by_effect(found: Diagnosis, hypothesis: Hypothesis, numbers: Array) -> dict[str, Values]:
    """Sort the numbers (p,) of a hypothesis by effect and parameter."""
    space = found.fits[hypothesis].space
    return {
        effect.name: {
            p.name: rounded(value)
            for p, value in zip(
                effect.parameters, numbers[space.columns(effect.name)].tolist(), strict=True
            )
        }
        for effect in space.effects
    }


def _clashing(data: Data, taken: Mapping[str, Effect], keys: EffectKeys) -> set[str]:
    """List the keys of a study that set the same as some effects."""
    touched = {key for effect in taken.values() for key in keys.touched(effect)}
    given = {f"{t}.{key}" for t in ("mechanism", "contact") for key in data.get(t, {})}
    known = registry.load()
    return (given & touched) | {
        f"effects.{name}"
        for name in data.get("effects", {})
        if name in taken or (name in known and keys.touched(known[name]) & touched)
    }


def _comments(
    found: Diagnosis, hypothesis: Hypothesis, base: str | None, remarks: Sequence[str], table: str
) -> dict[str, list[str]]:
    """Write the comments of the study file."""
    source = "clutch and operating points of the bench" if base is None else f"the study {base}"
    others = [
        f"{plain(h, found.effects)} ({chance(p)})"
        for h, p in found.posterior.items()
        if h in found.fits and h != hypothesis and p >= RARE
    ]
    head = [
        f"Calibrated study: {source} with the cause from the diagnosis of '{found.bench.name}'.",
        f"{headline_of(found.verdict, found.effects)}.",
        f"Just these effects have {chance(found.posterior.get(hypothesis, 0.0))}.",
        *([f"Other sets: {', '.join(others)}."] if others else []),
        *(f"{remark[0].upper()}{remark[1:]}." for remark in remarks),
        f"Values are posterior means, intervals hold 90 %. {table} has draws from the posterior "
        "of these effects; its columns are keys of this file, as --set takes them.",
    ]
    if base is None:
        head.append(
            "The data set gives no loads, material or limits of manufacture: those of the program "
            "stand in [load], [material] and [manufacturing]."
        )
    comments = {"": head}
    for name in hypothesis:
        size = "; ".join(
            described(p.name, found.fits[hypothesis].interval(p.name))
            for p in found.effects[name].parameters
        )
        part = "part of the cause" if name in found.verdict.causes else "open"
        comments[f"effects.{name}"] = [
            f"{size}; {part} ({chance(found.inclusion.get(name, 0.0))})."
        ]
    return comments
