"""A calibrated study: a study file with the effects of a diagnosis, and draws of them.

The file has the most probable hypothesis that contains every named effect, at its posterior means.
The draws are of all hypotheses that contain them: other sizes, and other effects beside. Their
columns are keys of the study, as ``--set`` takes them.

A study has factors of the contact's friction and dissipation. A factor differs from shift to shift,
while the posterior is of one unknown number. The mean over both is the same; the scatter from shift
to shift is too wide.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.report.wording import chance, described, headline_of
from dogshape.diagnosis.terms import REVERSED, UNKNOWN, Array, Hypothesis, plain
from dogshape.pipeline.config.mechanism import PROBE
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, find_study, load_study
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.study_keys import Data, EffectKeys, operating_of, rounded, study_of
from dogshape.pipeline.store.folder import require_targets
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import validate
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError, StorageError, did_you_mean
from dogshape.sim.files import write_whole
from dogshape.sim.setting import Setting
from dogshape.sim.texts import read_toml
from dogshape.sim.units import RPM

DRAWS = 200  #: of the posterior
LEAST = 1e-9  #: probability of a set that was asked for, so that it can be drawn
RARE = 0.005  #: probability below which a hypothesis is not drawn
SHOWN = 5  #: hypotheses that an error names
OF_POINTS = {"mismatch_speed", REVERSED}  #: effects that change operating points of the bench
#: Parameter that a factor scales, by effect, and the factor.
FACTORS = {
    "contact_dissipation": ("dissipation_s_m", "dissipation_factor"),
    "contact_friction": ("dynamic_friction", "friction_factor"),
}
TAIL = 0.05  #: probability outside of an interval, either side
NARROW = 0.005  #: spread of a logarithm below which there is no factor

Values = Mapping[str, Mapping[str, float]]  #: of each parameter of each effect


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
    fit = found.fits[hypothesis]
    own = _by_effect(found, hypothesis, fit.values.mean(axis=0))
    sizes = {**({REVERSED: {}} if REVERSED in hypothesis else {}), **own}
    data = study_of(found.bench, path.stem) if base is None else read_toml(find_study(base))
    given = _built({**data, "name": path.stem}, path)
    keys = EffectKeys(Setting(given.clutch, PROBE), frozenset(registry.load()))
    taken = {n: found.effects[n] for n in hypothesis if keys.takes(found.effects[n])}
    ours = OF_POINTS if base is None else set()
    remarks = [
        f"{found.effects[n].plain} ({n}) is left out: "
        + ("it belongs to the stand, not to another study" if n in OF_POINTS
           else "a study takes all relative angles alike")
        for n in hypothesis
        if n not in taken and n not in ours
    ]  # fmt: skip
    if not set(hypothesis) & (set(taken) | ours):
        raise InputError(
            f"--write is '{path}', but a study has no key for the cause "
            f"({plain(hypothesis, found.effects)}); {'; '.join(remarks)}"
        )
    data, replaced = _with_effects(data, taken, sizes, keys, found.bench.clutch.rings.mass)
    rivals = _rivals(found, hypothesis, causes or ())
    beside = {
        h: {n: found.effects[n] for n in h if n not in hypothesis and keys.takes(found.effects[n])}
        for h in rivals
    }
    kept = [h for h in rivals if not _clashing(data, beside[h], keys)]
    remarks += replaced + [
        f"{plain(h, found.effects)} is not drawn: the study has one of its keys itself"
        for h in rivals
        if h not in kept
    ]
    drawn = _drawn(found, [hypothesis, *kept], draws, seed)
    columns = taken | {n: e for h in kept if h in dict(drawn) for n, e in beside[h].items()}
    if base is None:
        data["operating"] = _true_points(found, sizes)
    data["name"] = path.stem
    unsure, certain = _uncertain(fit, sizes)
    data |= {"uncertain": {**data.get("uncertain", {}), **unsure}} if unsure else {}
    friction = [
        f"{one.contact.static_friction:g} and {one.contact.dynamic_friction:g}"
        for one in (found.bench.clutch, given.clutch)
    ]
    if friction[0] != friction[1]:
        remarks.append(f"friction of the bench is {friction[0]}, that of the study {friction[1]}")
    remarks += certain
    comments = _comments(found, hypothesis, base, remarks, draws_beside(path).name)
    text = toml_text(data, comments)
    rows = []
    for number, (one, values) in enumerate(drawn, start=1):
        row: Data = {"draw": number, "hypothesis": " + ".join(one)}
        for name, effect in columns.items():  # one that the draw lacks has its neutral values
            row |= keys.settings(effect, values.get(name) or effect.neutral(keys.base))
        rows.append(row)
    return CalibratedStudy(
        _built(tomllib.loads(text), path),
        text,
        hypothesis,
        found.posterior.get(hypothesis, 0.0),
        found.verdict.causes,
        tuple(rows),
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


def _rivals(found: Diagnosis, chosen: Hypothesis, asked: Sequence[str] = ()) -> list[Hypothesis]:
    """List the other hypotheses that contain named and asked effects, with the chosen sense."""
    causes, turned = {*found.verdict.causes, *asked}, REVERSED in chosen
    return [
        h
        for h, p in found.posterior.items()
        if h in found.fits and h != chosen and causes <= set(h) and p >= RARE
        if (REVERSED in h) == turned
    ]


def _by_effect(found: Diagnosis, hypothesis: Hypothesis, numbers: Array) -> Values:
    """Sort the numbers (p,) of a hypothesis by effect and parameter."""
    space = found.fits[hypothesis].space
    return {
        effect.name: {
            p.name: rounded(number)
            for p, number in zip(
                effect.parameters, numbers[space.columns(effect.name)].tolist(), strict=True
            )
        }
        for effect in space.effects
    }


def _drawn(
    found: Diagnosis, those: Sequence[Hypothesis], count: int, seed: int
) -> list[tuple[Hypothesis, Values]]:
    """Draw hypotheses by their probabilities, each with values from its posterior."""
    generator = np.random.default_rng(seed)
    shares = np.array([max(found.posterior.get(h, 0.0), LEAST) for h in those])
    which = generator.choice(len(those), size=count, p=shares / shares.sum())
    fits = [(those[place], found.fits[those[place]].values) for place in which]
    return [(h, _by_effect(found, h, rows[generator.integers(len(rows))])) for h, rows in fits]


def _uncertain(fit: Fit, means: Values) -> tuple[Data, list[str]]:
    """Return sections of ``[uncertain]`` by name, and a remark on effects without a factor.

    A factor is lognormal with the posterior's median and spread of the logarithm, cut at its 90 %
    interval, over the mean of the study. One that hardly spreads is left out.
    """
    sections: Data = {}
    for name in means.keys() & FACTORS.keys():
        parameter, factor = FACTORS[name]
        place = [p.name for p in fit.space.parameters].index(parameter)
        ratios = fit.values[:, place] / means[name][parameter]
        low, median, high = np.quantile(ratios, (TAIL, 0.5, 1.0 - TAIL))
        spread = float(np.log(ratios).std())
        if spread >= NARROW and low < median < high:
            numbers = {"median": median, "factor": math.exp(spread), "low": low, "high": high}
            shape = {key: rounded(value, 4) for key, value in numbers.items()}
            sections[factor] = {"distribution": "lognormal", **shape}
    rest = ", ".join(name for name in means if name not in FACTORS and means[name])
    said = f"[uncertain] has no factor of {rest}: the draws have the spread"
    return sections, [said] if rest else []


def _true_points(found: Diagnosis, sizes: Values) -> Data:
    """Return the bench's operating points with the mismatches of the cause."""
    points = []
    for cell in found.bench.cells:
        setting = Setting(found.bench.clutch, cell.point)
        for name in OF_POINTS & set(sizes):
            setting = found.effects[name].apply(setting, sizes[name])
        mismatch = rounded(setting.point.mismatch / RPM, 6)
        points.append((mismatch, rounded(cell.point.profile.force)))
    return operating_of(points)


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
    data: Data, taken: Mapping[str, Effect], sizes: Values, keys: EffectKeys, ring: float
) -> tuple[Data, list[str]]:
    """Set the keys of effects in the tables of a study file, in place of its own.

    Where the bench's ``ring``, kg, has the mass of the study's mechanism in it, a mass of the cause
    comes on top of that. The remarks name each key that is replaced.
    """
    carried = keys.base.clutch.mechanism.added_mass
    whole = keys.base.clutch.rings.mass + carried
    found, gone = dict(data), sorted(_clashing(data, taken, keys))
    remarks = [f"{key} of the study is replaced by that of the bench" for key in gone]
    for key in gone:
        table, _, name = key.partition(".")
        found[table] = {k: v for k, v in found[table].items() if k != name}
    if carried and math.isclose(ring, whole, rel_tol=1e-6) and "mechanism.added_mass_kg" in gone:
        mass = rounded(whole)
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


def _comments(
    found: Diagnosis, hypothesis: Hypothesis, base: str | None, remarks: Sequence[str], table: str
) -> dict[str, list[str]]:
    """Write the comments of the study file."""
    source = "clutch and operating points of the bench" if base is None else f"the study {base}"
    others = [
        f"{plain(h, found.effects)} ({chance(found.posterior[h])})"
        for h in _rivals(found, hypothesis)
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
        size = "; ".join(
            described(p.name, found.fits[hypothesis].interval(p.name))
            for p in found.effects[name].parameters
        )
        part = "part of the cause" if name in found.verdict.causes else "open"
        comments[f"effects.{name}"] = [
            f"{size}; {part} ({chance(found.inclusion.get(name, 0.0))})."
        ]
    return comments
