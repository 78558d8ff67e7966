"""A calibrated study: a study file with the effects that a diagnosis found, and draws of them.

The file has the most probable hypothesis that holds every named effect, at its posterior means.
The draws are of the whole posterior as far as it holds these: other sizes, and other effects
beside the named ones. Their columns are keys of the study, as ``--set`` takes them.
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
from dogshape.diagnosis.inference.posterior import inclusion
from dogshape.diagnosis.inference.verdict import PART
from dogshape.diagnosis.prediction.hypotheses import plain, without
from dogshape.diagnosis.report.wording import chance, described, headline
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.config.mechanism import PROBE
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, find_study, load_study
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.bench_study import operating_of, rounded, study_of
from dogshape.pipeline.diagnose.effect_keys import EffectKeys
from dogshape.pipeline.diagnose.posterior_draws import (
    DRAWS,
    drawn_from,
    effects_beside,
    rivals_of,
    row_of,
)
from dogshape.pipeline.diagnose.uncertain_effects import uncertain_of
from dogshape.pipeline.store.output_files import require_targets
from dogshape.sim import effects as registry
from dogshape.sim.clutch_tables import validate
from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError, StorageError, did_you_mean
from dogshape.sim.files import write_whole
from dogshape.sim.setting import Setting
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.texts import read_toml
from dogshape.sim.units import RPM

LIKELY = 0.5  #: probability above which an open effect is likelier than not
SHOWN = 5  #: hypotheses that an error names
Data = dict[str, Any]  #: a TOML file as it is read


@dataclass(frozen=True)
class CalibratedStudy:
    """A study with what a diagnosis found.

    Parameters
    ----------
    study : as it was read back from ``text``.
    text : the study file.
    hypothesis, probability : effects that it has, and how probable just these are.
    named : those that are part of the cause by the verdict.
    draws : keys of the study with their values, a row for each draw.
    remarks : sentences on what the file leaves out or replaces.
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
        """Write the record: where the files are, what they have and what they leave out."""
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
    causes : effects that the file gets, all that are part of the cause among them; None for the
        most probable set of such.

    Raises
    ------
    InputError
        The diagnosis names no effect, or none that a study can take, or has not looked into
        ``causes``; with what to do.
    """
    hypothesis = _chosen(found, path) if causes is None else _asked(found, causes)
    data = study_of(found.bench, path.stem) if base is None else read_toml(find_study(base))
    plain_study = _built({**data, "name": path.stem}, path)
    clutch = plain_study.clutch
    keys = EffectKeys(Setting(clutch, PROBE), frozenset(registry.load()))
    taken = {n: found.effects[n] for n in hypothesis if keys.takes(found.effects[n])}
    remarks = _left_out(found, hypothesis, taken, base)
    if not set(hypothesis) & (set(taken) | _of_points(base)):
        raise InputError(
            f"--write is '{path}', but a study has no key for what was found "
            f"({plain(hypothesis, found.effects)}); {'; '.join(remarks)}"
        )
    values = {
        name: {p.name: found.intervals[hypothesis][p.name].mean for p in effect.parameters}
        for name, effect in found.effects.items()
        if name in hypothesis
    }
    gone = _clashing(data, taken, keys)
    remarks += [f"{key} of the study gives way to what the bench shows" for key in sorted(gone)]
    data, carried = _without(data, gone), _carried(found, clutch, gone)
    if carried:
        # What is found comes on top of a ring that had this mass already.
        mass = rounded(found.bench.clutch.rings.mass)
        data["sliding"] = {**data["sliding"], "mass_kg": mass}
        remarks.append(
            f"the ring has the bench's mass, {mass:g} kg, with {carried:g} kg that move along"
        )
    for name, effect in taken.items():
        _put(data, keys.settings(effect, values[name]))
    rivals = rivals_of(found, hypothesis, () if causes is None else causes)
    more = {h: effects_beside(found, h, hypothesis, keys) for h in (hypothesis, *rivals)}
    kept = [h for h in rivals if not _clashing(data, more[h], keys)]
    remarks += [
        f"{plain(h, found.effects)} ({chance(found.posterior[h])}) is not drawn: the study gives "
        "one of its keys itself"
        for h in rivals
        if h not in kept
    ]
    drawn = drawn_from(found, [hypothesis, *kept], draws, seed)
    columns = dict(taken)
    for h in dict.fromkeys(h for h, _ in drawn):
        columns |= more[h]
    if base is None:
        data["operating"] = _true_points(found, hypothesis, values)
    data["name"] = path.stem
    remarks += _other_contact(found, plain_study)
    unsure, told = uncertain_of(found.scored[hypothesis], values)
    for key, section in unsure.items():
        data["uncertain"] = {**data.get("uncertain", {}), key: section}
    remarks += told
    text = toml_text(data, _comments(found, hypothesis, base, remarks, draws_beside(path).name))
    study = _built(tomllib.loads(text), path)
    rows = tuple(row_of(k, *one, columns, keys) for k, one in enumerate(drawn, start=1))
    return CalibratedStudy(
        study,
        text,
        hypothesis,
        found.posterior.get(hypothesis, 0.0),
        found.verdict.causes,
        rows,
        tuple(remarks),
    )


def _built(data: Data, path: Path) -> Setup:
    return build_study(validate(StudyFile, data, str(path)))


def _chosen(found: Diagnosis, path: Path) -> Hypothesis:
    """Return the most probable hypothesis that holds all named effects; none is refused."""
    causes = set(found.verdict.causes)
    if causes:
        return next(h for h in found.posterior if h in found.scored and causes <= set(h))
    test = found.tests[0]
    if found.verdict.kind == "none":
        rule, remedy = "no effect is needed", "take the study as it is"
    elif found.verdict.kind == "unknown":
        rule = "no known effect explains the data"
        remedy = f"{test.how} Then diagnose again"
    else:
        best = max(inclusion(found.posterior).items(), key=lambda one: one[1], default=None)
        likeliest = f" (likeliest: {best[0]}, {chance(best[1])})" if best else ""
        rule = f"no effect is part of the cause with more than {PART:.0%}{likeliest}"
        remedy = f"{test.how} Add what it shows ('dogshape gap update') and diagnose again"
    raise InputError(
        f"--write is '{path}', but the diagnosis of {found.bench.name} names nothing to write: "
        f"{rule} ({headline(found.found)}); {remedy}"
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
    """Return the hypothesis of some effects; InputError where it is none that can be written."""
    require_effects(causes, found.effects)
    asked, named = ", ".join(causes), found.verdict.causes
    there = [h for h in found.scored if h and set(named) <= set(h)]
    there.sort(key=lambda h: -found.posterior.get(h, 0.0))
    for hypothesis in there:
        if set(hypothesis) == set(causes):
            return hypothesis
    if lacking := [name for name in named if name not in causes]:
        rule = f"{' and '.join(lacking)} is part of the cause in any case; name it too"
    else:
        likely = "; ".join(", ".join(h) for h in there[:SHOWN])
        rule = f"the diagnosis has not looked into just these together; name one of: {likely}"
    raise InputError(f"--causes is '{asked}', but {rule}")


def _of_points(base: str | None) -> set[str]:
    """List the effects that change operating points, which a study of the bench takes so."""
    return {"mismatch_speed", REVERSED} if base is None else set()


def _true_points(
    found: Diagnosis, hypothesis: Hypothesis, values: Mapping[str, Mapping[str, float]]
) -> Data:
    """Return the bench's operating points with the mismatches that the cause says are true."""
    points: dict[tuple[float, float], None] = {}
    for cell in found.bench.cells:
        setting = Setting(found.bench.clutch, cell.point)
        for name in hypothesis:
            if name in _of_points(None):
                setting = found.effects[name].apply(setting, values[name])
        force = rounded(cell.point.profile.force)
        points[rounded(setting.point.mismatch / RPM, 6), force] = None
    return operating_of(list(points))


def _left_out(
    found: Diagnosis, hypothesis: Hypothesis, taken: Mapping[str, Effect], base: str | None
) -> list[str]:
    """Explain which of the effects no key of the study takes."""
    told = []
    for name in hypothesis:
        if name in taken or name in _of_points(base):
            continue
        reason = "a study takes all relative angles alike"
        if name in _of_points(None):
            reason = "it is the stand's and says nothing of the operating points of another study"
        told.append(f"{found.effects[name].plain} ({name}) is left out: {reason}")
    return told


def _other_contact(found: Diagnosis, base: Setup) -> list[str]:
    """Remark on a study whose dogs rub otherwise than those with which the sizes were found."""
    bench, study = found.bench.clutch.contact, base.clutch.contact
    pairs = [(c.static_friction, c.dynamic_friction) for c in (bench, study)]
    if pairs[0] == pairs[1]:
        return []
    said = [f"{static:g} and {dynamic:g}" for static, dynamic in pairs]
    return [f"sizes were found with the bench's friction {said[0]}, and the study has {said[1]}"]


def _clashing(data: Data, taken: Mapping[str, Effect], keys: EffectKeys) -> set[str]:
    """List the keys of a study that set what some effects set."""
    touched = {key for effect in taken.values() for key in keys.touched(effect)}
    given = {f"{t}.{key}" for t in ("mechanism", "contact") for key in data.get(t, {})}
    effects = {
        f"effects.{name}"
        for name in data.get("effects", {})
        if name in taken or keys.touched_by_name(name) & touched
    }
    return (given & touched) | effects


def _without(data: Data, gone: set[str]) -> Data:
    """Return the tables of a study file without some keys."""
    found = dict(data)
    for key in gone:
        table, _, name = key.partition(".")
        found[table] = {k: v for k, v in found[table].items() if k != name}
    return found


def _carried(found: Diagnosis, clutch: Clutch, gone: set[str]) -> float:
    """Return the mass of a study's mechanism that the bench has in its ring, kg, else 0."""
    carried = clutch.mechanism.added_mass
    if "mechanism.added_mass_kg" not in gone or not carried:
        return 0.0
    there = math.isclose(found.bench.clutch.rings.mass, clutch.rings.mass + carried, rel_tol=1e-6)
    return carried if there else 0.0


def _put(data: Data, settings: Mapping[str, Any]) -> None:
    """Set dotted keys in the tables of a study file."""
    for key, value in settings.items():
        *tables, last = key.split(".")
        inner = data
        for name in tables:
            inner[name] = dict(inner.get(name, {}))
            inner = inner[name]
        inner[last] = value


def _comments(
    found: Diagnosis,
    hypothesis: Hypothesis,
    base: str | None,
    remarks: Sequence[str],
    table: str,
) -> dict[str, list[str]]:
    """Write the comments of the study file."""
    part, sizes = inclusion(found.posterior), found.intervals[hypothesis]
    causes = found.verdict.causes
    what = "the clutch and operating points of the bench" if base is None else f"the study {base}"
    head = [
        f"Calibrated study: {what} with what the diagnosis of '{found.bench.name}' found.",
        f"{headline(found.found)}.",
        f"Just these effects together have {chance(found.posterior.get(hypothesis, 0.0))}.",
        *_in_place(found, hypothesis),
        *(_sentence(remark) for remark in remarks),
        f"Values are posterior means, intervals hold 90 %. {table} has draws from the posterior: "
        "its columns are keys of this file, as --set takes them.",
    ]
    if base is None:
        head.append(
            "The data set gives no loads, material or limits of manufacture: those of the program "
            "stand for them until [load], [material] and [manufacturing] say better."
        )
    told = {"": head}
    for name in hypothesis:
        effect = found.effects[name]
        size = "; ".join(described(p.name, sizes[p.name]) for p in effect.parameters)
        likely = "open, though likely" if part.get(name, 0.0) > LIKELY else "open"
        sure = "part of the cause" if name in causes else likely
        alias = f" It cannot be told from {' or '.join(effect.aliases)}." if effect.aliases else ""
        told[f"effects.{name}"] = [f"{size}; {sure} ({chance(part.get(name, 0.0))}).{alias}"]
    return told


def _sentence(remark: str) -> str:
    """Write a remark as a sentence; one that begins with a key keeps its first letter."""
    key = "." in remark.partition(" ")[0]
    return f"{remark if key else remark[0].upper() + remark[1:]}."


def _in_place(found: Diagnosis, hypothesis: Hypothesis) -> list[str]:
    """Name what else may stand beside the named effects."""
    causes = tuple(sorted(found.verdict.causes))
    others = [
        f"{plain(without(h, causes), found.effects)} ({chance(found.posterior[h])})"
        for h in rivals_of(found, hypothesis)
    ]
    rest = tuple(sorted(set(hypothesis) - set(causes)))
    if not others:
        return []
    begun = f"In place of {plain(rest, found.effects)}" if rest else "There may also be"
    return [f"{begun}: {', '.join(others)}."]
