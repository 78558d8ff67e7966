"""Settings of a diagnosis: every statistical constant that decides an answer, with its source.

A diagnosis takes its settings as one value and keeps them with its result. Each field says in its
metadata its unit, what it means, where its value is from, and whether that was measured or judged.
Constants of numerical methods, and those with which an emulator is built, stay in their modules;
``docs/diagnosis_model.md`` has a table of all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

Status = Literal["measured", "judged", "numerical"]

ENGINES = "MuJoCo against Drake without any effect, `docs/evidence/blind_engines.txt`"


def constant(default: Any, unit: str, meaning: str, status: Status, source: str) -> Any:
    """Return a field of a settings class with what its documentation says."""
    told = {"unit": unit, "meaning": meaning, "status": status, "source": source}
    if isinstance(default, dict):
        return field(default_factory=lambda: dict(default), metadata=told)
    return field(default=default, metadata=told)


@dataclass(frozen=True)
class Rules:
    """Errors that the likelihood assumes of any simulation."""

    model_error: float = constant(
        0.01,
        "of the simulated mean",
        "error of any simulation in one cell: mesh, contact, rigid bodies",
        "judged",
        "small beside the discrepancy",
    )
    least_error: float = constant(
        0.5e-3, "s", "the same, at least", "judged", "resolution of a shift time"
    )
    discrepancy: float = constant(
        0.05,
        "of the mean without effect",
        "scale of the half-normal prior of the discrepancy's amplitude",
        "measured",
        f"root mean square of {ENGINES}: one pair of engines, one clutch",
    )
    spread_share: float = constant(
        0.2,
        "of the spread",
        "error of the simulated spread of single shifts",
        "judged",
        "cases of another engine that were opened",
    )
    spread_error: float = constant(
        0.025,
        "of the simulated mean",
        "further error of that spread",
        "judged",
        "cases of another engine that were opened",
    )
    odd_share: float = constant(
        0.005,
        "probability",
        "share of cells whose mean is off by much more, whatever the hypothesis",
        "judged",
        "in a checked table an entry in some hundred is wrong",
    )
    odd_size: float = constant(
        0.5,
        "of the simulated mean",
        "what the mean of such a cell is off by",
        "measured",
        "levels left out where times jump between two of them",
    )
    odd_spread: float = constant(
        1.0, "of ln spread", "error of the spread of such a cell", "judged", "a factor of e"
    )
    discrepancy_length: float = constant(
        1.0,
        "of ln mismatch",
        "length over which the discrepancy is alike",
        "judged",
        f"smooth as {ENGINES}",
    )
    discrepancy_shapes: tuple[tuple[float, float, float, float], ...] = constant(
        ((0.7, 0.2, 0.1, 0.5), (0.1, 0.6, 0.3, 0.5)),
        "shares of variance; probability",
        "shapes of the discrepancy: constant, curve over the mismatch, slope over the force; and "
        "the probability of each",
        "judged",
        f"{ENGINES}: three quarters one-sided, 2 to 5 points over the force",
    )
    drift: float = constant(
        0.1,
        "of the mean time",
        "scale of the half-normal prior of a drift's size over the whole series, where the order "
        "of the shifts is known",
        "judged",
        "oil and actuator warm up, edges wear; a fifth of the time would be noticed at the stand",
    )
    late_least: float = constant(
        0.003,
        "probability",
        "least share of late shifts anywhere",
        "judged",
        "",
    )
    late_anything: float = constant(
        0.002,
        "probability",
        "share of late shifts that may take any time until the time-out",
        "judged",
        "so that no single shift excludes a hypothesis",
    )
    late_known: float = constant(
        24.0,
        "shifts",
        "number of shifts that the simulated share of late ones counts as",
        "judged",
        "cases of another engine that were opened",
    )
    late_spread: float = constant(
        0.5, "of ln spread", "error of a spread with late shifts in it", "judged", ""
    )
    flight_freedom: float = constant(
        5.0,
        "degrees of freedom",
        "of the Student distribution of a profile's marks",
        "judged",
        "one odd profile decides nothing alone",
    )


@dataclass(frozen=True)
class Priors:
    """Probabilities of hypotheses before the data."""

    included: Mapping[str, float] = constant(
        {"actuation_delay": 0.3, "sleeve_friction": 0.3, "linkage_compliance": 0.1},
        "probability",
        "that an effect is part of the cause",
        "judged",
        "every actuator has a dead time, every "
        "ring rubs on its shaft, Bowden cables and levers give way",
    )
    rare: float = constant(
        0.05, "probability", "the same of any other effect", "judged", "all else is rare"
    )
    unlisted: float = constant(
        0.15, "probability", "of *unknown*", "judged", "no list of effects is complete"
    )
    reversed_known: float = constant(
        0.02,
        "probability",
        "of the reversed sense of rotation where the sense was noted",
        "judged",
        "one entry in some hundred is wrong, more where no custom says which is +",
    )
    reversed_unknown: float = constant(
        0.5, "probability", "the same where nobody noted it", "judged", "nothing is known"
    )

    def effect(self, name: str) -> float:
        """Return the probability of an effect to be part of the cause."""
        return self.included.get(name, self.rare)

    def reversed(self, sense: str) -> float:
        """Return the probability of the reversed sense where it is ``known`` or ``unknown``."""
        return self.reversed_known if sense == "known" else self.reversed_unknown


@dataclass(frozen=True)
class Unlisted:
    """Prior of what *unknown* does."""

    least_offset: float = constant(
        0.005,
        "s",
        "least standard deviation of the cells' offsets",
        "judged",
        "",
    )
    most_offset: float = constant(0.4, "s", "largest standard deviation of them", "judged", "")
    lengths: tuple[float, ...] = constant(
        (0.5, 1.5, 5.0),
        "of ln force and ln mismatch",
        "lengths over which offsets are alike",
        "judged",
        "from a neighbour to the whole table",
    )
    smooth: float = constant(
        0.8, "of the variance", "share that neighbours have in common", "judged", ""
    )
    stretches: tuple[tuple[float, float | None, float], ...] = constant(
        ((0.5, None, 0.2), (1.0, None, 0.4), (2.0, None, 0.2), (2.0, 1.5, 0.2)),
        "factor; of ln spread; probability",
        "stretch of all spreads, its error (the simulation's "
        "own where there is none), and its probability",
        "judged",
        "",
    )
    least_mark: float = constant(
        1e-3, "s", "least standard deviation of offsets of marks of the flight", "judged", ""
    )
    most_mark: float = constant(0.2, "s", "largest standard deviation of them", "judged", "")
    mark_length: float = constant(
        1.5, "of ln force and ln share", "length over which they are alike", "judged", ""
    )
    mark_smooth: float = constant(
        0.9, "of the variance", "share that neighbours have in common", "judged", ""
    )


@dataclass(frozen=True)
class Decision:
    """Limits of the answer."""

    named: float = constant(
        0.8,
        "probability",
        "from which a hypothesis is named, and *none* and *unknown* said",
        "judged",
        "wrong once in five at most, if probabilities hold",
    )
    most: int = constant(
        2, "effects", "that are named at once", "judged", "of three some always fit"
    )
    part: float = constant(
        0.95,
        "probability",
        "from which an effect is part of the cause, whatever else is",
        "judged",
        "usual level",
    )
    credible: float = constant(
        0.9,
        "probability",
        "of the set that is given where nothing is named",
        "judged",
        "usual level",
    )
    adequate: float = constant(
        0.01,
        "p-value",
        "below which a hypothesis fails the predictive check",
        "judged",
        "`docs/evidence/predictive_check.txt` has how often true ones do",
    )
    visible: float = constant(
        4.0,
        "squared standard errors",
        "distance from which two predictions can be told apart",
        "judged",
        "two standard errors in all",
    )
    apart: float = constant(
        1.5,
        "nat",
        "expected log Bayes factor below which two hypotheses are one class",
        "judged",
        "odds of 4.5 : 1",
    )
    plausible: float = constant(
        0.01, "probability", "from which a hypothesis is checked and compared", "judged", ""
    )
    engaged_margin: float = constant(
        0.05,
        "share engaged",
        "margin of a share engaged (margins of times are keys of `bench.toml`)",
        "judged",
        "one shift in twenty",
    )
    model_form: tuple[str, ...] = constant(
        ("contact_dissipation", "contact_stiffness"),
        "effects",
        "that are properties of the simulation, and so named by a direct test only",
        "measured",
        "they lead where two engines differ without any effect, `docs/blind.md`",
    )
    drift_sure: float = constant(
        0.99,
        "probability",
        "of the direction of a drift, from which it is said",
        "judged",
        "one false mention in fifty sets",
    )
    drift_known: float = constant(
        0.75,
        "of the prior's variance",
        "that repeated operating points must take for a drift to be told from an effect",
        "judged",
        "half of its deviation",
    )
    in_order: float = constant(
        0.7,
        "rank correlation",
        "of the order of the shifts with mismatch or force, from which these were not run in "
        "random order",
        "judged",
        "half of the variance",
    )
    near: float = constant(
        0.03,
        "probability",
        "of a pair beside all pairs, from which it is tried with a third effect",
        "judged",
        "",
    )
    tried: int = constant(5, "pairs", "that are tried so, at most", "judged", "cost")
    shown: float = constant(
        8.0,
        "nat",
        "log odds from which a reading at rest shows that its effect is there",
        "judged",
        "3000 : 1",
    )
    end_share: float = constant(
        0.05,
        "of a range",
        "at its end, in which the sizes of the leading hypothesis count as at the end",
        "judged",
        "a size anywhere in the range lies there once in twenty",
    )
    end_mass: float = constant(
        0.3,
        "probability",
        "of a size to lie at the end of its range, from which that is widened",
        "judged",
        "six times what a size anywhere in the range has",
    )
    wider: float = constant(
        0.5,
        "of a range",
        "by which it is widened at that end",
        "judged",
        "twice makes it a little more than twice as wide",
    )
    widenings: int = constant(2, "times", "that ranges are widened, at most", "judged", "cost")
    within: float = constant(
        12.0,
        "nat",
        "below the best, in which hypotheses of several effects are simulated together",
        "judged",
        "before that their means may be off by a third",
    )
    more: float = constant(
        1.0,
        "nat",
        "by which several effects explain more than fewer of them, to be simulated together",
        "judged",
        "else one of them hardly acts",
    )
    doubt: float = constant(
        1.5,
        "of the error of fewer",
        "error of a prediction of several effects, from which they are simulated together though "
        "they explain as much as fewer",
        "judged",
        "their combination errs more than each of them",
    )
    near_pairs: int = constant(
        6, "hypotheses", "that are simulated together in a round, at most", "judged", "cost"
    )
    together: int = constant(
        6, "levels", "at which effects are simulated together in a round", "judged", "cost"
    )
    rounds: int = constant(3, "rounds", "of simulating effects together, at most", "judged", "cost")
    rounds_each: int = constant(2, "rounds", "the same of one set of effects", "judged", "cost")
    simpler: int = constant(
        3,
        "effects",
        "that explain most of the single ones at an end of their range, which is widened beside "
        "those of several effects that lead",
        "judged",
        "cost",
    )
    blind: float = constant(
        0.999,
        "of a prior",
        "hidden share from which data hold no information on an effect",
        "judged",
        "",
    )


@dataclass(frozen=True)
class Settings:
    """All settings of a diagnosis."""

    likelihood: Rules = field(default_factory=Rules)
    priors: Priors = field(default_factory=Priors)
    unlisted: Unlisted = field(default_factory=Unlisted)
    decision: Decision = field(default_factory=Decision)

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Write the record ``settings``, section by section."""
        return {f.name: _plain(getattr(self, f.name)) for f in fields(self)}


def _plain(section: Any) -> dict[str, Any]:
    return {f.name: _lists(getattr(section, f.name)) for f in fields(section)}


def _lists(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_lists(one) for one in value]
    return dict(value) if isinstance(value, Mapping) else value


def told(settings: Settings) -> Iterator[tuple[str, str, Any, Mapping[str, str]]]:
    """Yield section, name, value and metadata of each setting."""
    for section in fields(settings):
        inner = getattr(settings, section.name)
        for one in fields(inner):
            yield section.name, one.name, getattr(inner, one.name), one.metadata


USUAL = Settings()  #: what a diagnosis takes unless it is told otherwise
