"""A calibrated study: a study file with the effects of a diagnosis, and draws of them.

The file has the most probable hypothesis that contains every named effect, at its posterior means.
The draws are of all hypotheses that contain them: other sizes, and other effects beside. Their
columns are keys of the study, as ``--set`` takes them.
"""

from __future__ import annotations

import csv
import io
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import chance, described, headline_of
from dogshape.diagnosis.terms import UNKNOWN, Hypothesis, plain
from dogshape.pipeline.config.mechanism import PROBE
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, find_study, load_study
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.bench_study import operating_of, rounded, study_of
from dogshape.pipeline.diagnose.effect_keys import EffectKeys
from dogshape.pipeline.diagnose.posterior_draws import (
    DRAWS,
    Values,
    by_effect,
    drawn_from,
    rivals_of,
    row_of,
    uncertain_of,
)
from dogshape.pipeline.store.folder import require_targets
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import validate
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError, StorageError, did_you_mean
from dogshape.sim.files import write_whole
from dogshape.sim.setting import Setting
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.texts import read_toml
from dogshape.sim.units import RPM

SHOWN = 5  #: hypotheses that an error names
OF_POINTS = {"mismatch_speed", REVERSED}  #: effects that change operating points of the bench
Data = dict[str, Any]  #: a TOML file as it is read


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
        table = draws_beside(path)
        write_whole(table, self.table)
        write_whole(path, self.text)
        return table

    @property
    def table(self) -> str:
        """The draws as CSV."""
        text = io.StringIO()
        writer = csv.DictWriter(text, list(self.draws[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.draws)
        return text.getvalue()

    def as_dict(self, path: Path) -> Data:
        """Write the record: files, effects, number of draws, and remarks."""
        file = self.study.file
        return {
            "study": str(path),
            "draws": str(draws_beside(path)),
            "n_draws": len(self.draws),
            "hypothesis": list(self.hypothesis),
            "probability": self.probability,
            "named": list(self.named),
            "effects": dict(file.effects or {}),
            "uncertain": [] if file.uncertain is None else list(file.uncertain.model_fields_set),
            "remarks": list(self.remarks),
        }


def require_new_study(path: Path, base: str | None = None) -> None:
    """Raise an error before the long work unless a study can be written to a path.

    StorageError where it is there already or cannot be written, InputError for a name or a base
    that no study has.
    """
    if path.suffix != ".toml":
        raise InputError(f"--write is '{path}', but a study is a TOML file; name it NAME.toml")
    for name, one in (("--write", path), ("draws of --write", draws_beside(path))):
        if one.exists():
            raise StorageError(f"{name} is {one}, which is there already; name another file")
    require_targets({"--write": path, "draws of --write": draws_beside(path)})
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
    fit = found.fits[hypothesis]
    own = by_effect(found, hypothesis, fit.values.mean(axis=0))
    sizes = {**({REVERSED: {}} if REVERSED in hypothesis else {}), **own}
    data = study_of(found.bench, path.stem) if base is None else read_toml(find_study(base))
    given = _built({**data, "name": path.stem}, path)
    keys = EffectKeys(Setting(given.clutch, PROBE), frozenset(registry.load()))
    taken = {n: found.effects[n] for n in hypothesis if keys.takes(found.effects[n])}
    remarks = _left_out(found, hypothesis, taken, base)
    if not set(hypothesis) & (set(taken) | (OF_POINTS if base is None else set())):
        raise InputError(
            f"--write is '{path}', but a study has no key for the cause "
            f"({plain(hypothesis, found.effects)}); {'; '.join(remarks)}"
        )
    data, replaced = _with_effects(data, taken, sizes, keys, _carried(found, given.clutch))
    rivals = rivals_of(found, hypothesis, causes or ())
    beside = {h: _beside(found, h, hypothesis, keys) for h in rivals}
    kept = [h for h in rivals if not _clashing(data, beside[h], keys)]
    remarks += replaced + [
        f"{plain(h, found.effects)} is not drawn: the study has one of its keys itself"
        for h in rivals
        if h not in kept
    ]
    drawn = drawn_from(found, [hypothesis, *kept], draws, seed)
    columns = taken | {n: e for h in kept if h in dict(drawn) for n, e in beside[h].items()}
    if base is None:
        data["operating"] = _true_points(found, sizes)
    data["name"] = path.stem
    unsure, certain = uncertain_of(fit, sizes)
    data |= {"uncertain": {**data.get("uncertain", {}), **unsure}} if unsure else {}
    remarks += _other_contact(found, given) + certain
    comments = _comments(found, hypothesis, base, remarks, draws_beside(path).name)
    text = toml_text(data, comments)
    return CalibratedStudy(
        _built(tomllib.loads(text), path),
        text,
        hypothesis,
        found.posterior.get(hypothesis, 0.0),
        found.verdict.causes,
        tuple(row_of(k, *one, columns, keys) for k, one in enumerate(drawn, start=1)),
        tuple(remarks),
    )


def _built(data: Data, path: Path) -> Setup:
    return build_study(validate(StudyFile, data, str(path)))


def _chosen(found: Diagnosis, path: Path) -> Hypothesis:
    """Return the most probable hypothesis that contains all named effects; none is refused."""
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
    """Return the hypothesis of some effects; InputError where it has no fit."""
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


def _true_points(found: Diagnosis, sizes: Values) -> Data:
    """Return the bench's operating points with the mismatches of the cause."""
    points: dict[tuple[float, float], None] = {}
    for cell in found.bench.cells:
        setting = Setting(found.bench.clutch, cell.point)
        for name in OF_POINTS & set(sizes):
            setting = found.effects[name].apply(setting, sizes[name])
        force = rounded(cell.point.profile.force)
        points[rounded(setting.point.mismatch / RPM, 6), force] = None
    return operating_of(list(points))


def _left_out(
    found: Diagnosis, hypothesis: Hypothesis, taken: Mapping[str, Effect], base: str | None
) -> list[str]:
    """List the effects that no key of the study takes, with the reason."""
    reasons = {
        name: "it belongs to the stand, not to another study" if name in OF_POINTS
        else "a study takes all relative angles alike"
        for name in hypothesis
        if name not in taken and not (base is None and name in OF_POINTS)
    }  # fmt: skip
    return [
        f"{found.effects[n].plain} ({n}) is left out: {reason}" for n, reason in reasons.items()
    ]


def _other_contact(found: Diagnosis, base: Setup) -> list[str]:
    """Remark on a study with other coefficients of friction than the bench."""
    pairs = [
        f"{one.contact.static_friction:g} and {one.contact.dynamic_friction:g}"
        for one in (found.bench.clutch, base.clutch)
    ]
    same = pairs[0] == pairs[1]
    return [] if same else [f"friction of the bench is {pairs[0]}, that of the study {pairs[1]}"]


def _beside(
    found: Diagnosis, rival: Hypothesis, chosen: Hypothesis, keys: EffectKeys
) -> dict[str, Effect]:
    """Return the effects of a rival that the chosen hypothesis lacks and a study takes."""
    names = [name for name in rival if name not in chosen]
    return {n: found.effects[n] for n in names if keys.takes(found.effects[n])}


def _clashing(data: Data, taken: Mapping[str, Effect], keys: EffectKeys) -> set[str]:
    """List the keys of a study that set the same as some effects."""
    touched = {key for effect in taken.values() for key in keys.touched(effect)}
    given = {f"{t}.{key}" for t in ("mechanism", "contact") for key in data.get(t, {})}
    effects = {
        f"effects.{name}"
        for name in data.get("effects", {})
        if name in taken or keys.touched_by_name(name) & touched
    }
    return (given & touched) | effects


def _with_effects(
    data: Data, taken: Mapping[str, Effect], sizes: Values, keys: EffectKeys, carried: float
) -> tuple[Data, list[str]]:
    """Set the keys of effects in the tables of a study file, in place of its own.

    ``carried`` is the mass of the study's mechanism that the bench has in its ring, kg; a mass of
    the cause comes on top of it. The remarks name each key that is replaced.
    """
    found, gone = dict(data), sorted(_clashing(data, taken, keys))
    remarks = [f"{key} of the study is replaced by that of the bench" for key in gone]
    for key in gone:
        table, _, name = key.partition(".")
        found[table] = {k: v for k, v in found[table].items() if k != name}
    if carried and "mechanism.added_mass_kg" in gone:
        mass = rounded(keys.base.clutch.rings.mass + carried)
        found["sliding"] = {**found["sliding"], "mass_kg": mass}
        remarks.append(f"the ring has the bench's mass, {mass:g} kg, with {carried:g} kg of forks")
    for name, effect in taken.items():
        for key, value in keys.settings(effect, sizes[name]).items():
            *tables, last = key.split(".")
            inner = found
            for table in tables:
                inner[table] = dict(inner.get(table, {}))
                inner = inner[table]
            inner[last] = value
    return found, remarks


def _carried(found: Diagnosis, clutch: Clutch) -> float:
    """Return the mass of a study's mechanism that the bench has in its ring, kg, else 0."""
    carried = clutch.mechanism.added_mass
    whole = clutch.rings.mass + carried
    return carried if math.isclose(found.bench.clutch.rings.mass, whole, rel_tol=1e-6) else 0.0


def _comments(
    found: Diagnosis,
    hypothesis: Hypothesis,
    base: str | None,
    remarks: Sequence[str],
    table: str,
) -> dict[str, list[str]]:
    """Write the comments of the study file."""
    source = "clutch and operating points of the bench" if base is None else f"the study {base}"
    others = [
        f"{plain(h, found.effects)} ({chance(found.posterior[h])})"
        for h in rivals_of(found, hypothesis)
        if h != UNKNOWN
    ]
    head = [
        f"Calibrated study: {source} with the cause from the diagnosis of '{found.bench.name}'.",
        f"{headline_of(found.verdict, found.effects)}.",
        f"Just these effects have {chance(found.posterior.get(hypothesis, 0.0))}.",
        *([f"Other sets: {', '.join(others)}."] if others else []),
        *(f"{remark[0].upper()}{remark[1:]}." for remark in remarks),
        f"Values are posterior means, intervals hold 90 %. {table} has draws from the posterior; "
        "its columns are keys of this file, as --set takes them.",
    ]
    if base is None:
        head.append(
            "The data set gives no loads, material or limits of manufacture: those of the program "
            "stand in [load], [material] and [manufacturing]."
        )
    comments = {"": head}
    for name in hypothesis:
        parameters = found.effects[name].parameters
        size = "; ".join(
            described(p.name, found.fits[hypothesis].interval(p.name)) for p in parameters
        )
        part = "part of the cause" if name in found.verdict.causes else "open"
        comments[f"effects.{name}"] = [
            f"{size}; {part} ({chance(found.inclusion.get(name, 0.0))})."
        ]
    return comments
