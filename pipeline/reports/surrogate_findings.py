"""Findings of a study's surrogate: effects of its variables and prices of its limits.

Both are computed once and stored beside the surrogate. For prices, designs that fill the space,
and more about the best of them under each limit, are checked by closed forms and predicted. Where
an upper bound L becomes f L a design passes with a margin of 1 - f, where a lower one does with
f - 1: so one pool of designs answers for all limits. Landing and other simulated limits are left
out. Where a study bounds the smallest margin within tolerances, margins are taken there.
Tolerances are a limit too: f times as large they take f times as much from each margin.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Say
from dogshape.pipeline.record import SHARE, FileRecord, Record, Table
from dogshape.pipeline.reports.text import check_name, in_ms
from dogshape.pipeline.simulate.design import (
    WITHIN,
    DesignGroup,
    check_dog,
    limits_of,
)
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.train.training import first_designs
from dogshape.sim.clutch_tables import key, validate
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError, InputError, StorageError
from dogshape.sim.interface import verb
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.checks import RULES, LimitCheck
from dogshape.sim.strength.dog_strength import margin_losses, within_tolerances
from dogshape.sim.strength.manufacture import Kind
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import in_range, require_same_physics
from dogshape.surrogate.sensitivity import main_effects
from dogshape.surrogate.store import load

EFFECT_DESIGNS = 150  #: feasible designs that an effect is the mean over
SEED_OFFSET = 70_000  #: added to the seed of the surrogate's data, so that designs differ
FACTORS = (0.9, 1.0, 1.1)  #: on a limit that has a price
FILLING_EXPONENT = 13  #: power of two of the designs that fill the space
LOCAL_DESIGNS = 16  #: about each of the best, in each round
LOCAL_SPREADS = (0.08, 0.04, 0.02, 0.01, 0.005)  #: shares of the ranges, by round
MIN_PRICE_S = 2e-4  #: change of the time by a tenth of a limit that has a price
#: Step of a limit by its unit, to which a price is referred.
STEPS = {"mm": 0.1, "N": 1000.0, "MPa": 100.0, "deg": 1.0, "": 0.01, "s": 0.001, "%": 10.0}
TOLERANCES = "tolerances at their worst"  #: row of all tolerances together, in % of what they are


class VariableEffect(Record):
    """Main effect of a variable on the expected shift time, with its 95 % band."""

    variable: str = key("key of the study file")
    values: list[float] = key("values of the variable, in its unit")
    effect_s: list[float] = key("effect at each value, about the mean", "s")
    low_s: list[float] = key("lower end of its band", "s")
    high_s: list[float] = key("upper end", "s")


class Effects(Record):
    """Main effects of the variables over feasible designs."""

    designs: int = key("feasible designs that an effect is the mean over")
    outside_trained_range: float = key("share of these outside the trained range", SHARE)
    mean_expected_shift_time_s: float = key("mean predicted time of these", "s")
    variables: list[VariableEffect] = key("the variables")


class LimitPrice(FileRecord):
    """Best times with a limit as it is, changed by a tenth, and without it.

    A time is null where no design passes.
    """

    name: str = key("name of the check, or all tolerances together")
    unit: str = key("unit of the limit")
    limit: float = key("the limit as it is")
    at_most: bool = key("whether it is an upper one")
    less_s: float | None = key("best time with a tenth less of the limit", "s")
    now_s: float | None = key("best time with the limit as it is", "s")
    more_s: float | None = key("best time with a tenth more of it", "s")
    without_s: float | None = key("best time without it", "s")
    key: str = key("key of the study file that sets it")

    @property
    def change_s(self) -> float | None:
        """Change of the best time by a tenth of the limit, s; None without both times."""
        if self.less_s is None or self.more_s is None:
            return None
        return 0.5 * abs(self.less_s - self.more_s)


class Findings(Record):
    """Findings of the surrogate with a hash, ``effects.json``."""

    surrogate: str = key("hash of the surrogate")
    effects: Effects = key("effects of the variables")
    prices: list[LimitPrice] = key("prices of the limits")


def learn_effects(folder: StudyFolder, say: Say) -> None:
    """Compute and store effects and prices of the folder's surrogate, unless they are stored.

    A folder without a surrogate gets none; an unusable surrogate is reported through ``say``.
    """
    if not folder.surrogate.is_file() or stored_effects(folder) is not None:
        return
    study = folder.stored_study()
    try:
        surrogate = load(folder.surrogate).surrogate
        require_same_physics(surrogate.data, study.physics)
    except DogshapeError as error:
        say(f"no effects in the report: {error}")
        return
    say("what each variable does and each limit costs, from the surrogate")
    findings = Findings(
        surrogate=_identity(folder),
        effects=effects_of(study, surrogate),
        prices=prices(study, surrogate),
    )
    write_json(folder.effects, findings.to_dict())


def stored_effects(folder: StudyFolder) -> Findings | None:
    """Read effects and prices of the folder's present surrogate; None if they are not stored."""
    try:
        stored = read_json(folder.effects, f"run {verb('report')} again")
        findings = validate(Findings, stored, str(folder.effects))
        return findings if findings.surrogate == _identity(folder) else None
    except (StorageError, InputError):
        return None


def _identity(folder: StudyFolder) -> str:
    """Read the hash of the folder's surrogate."""
    return str(read_json(folder.surrogate, f"run {verb('report')} again").get("hash"))


def effects_of(study: Setup, surrogate: Surrogate) -> Effects:
    """Compute the main effects of the variables, means over feasible designs."""
    x = study.rows(first_designs(study, EFFECT_DESIGNS, SEED_OFFSET, border=False))
    variables = [
        VariableEffect(
            variable=effect.variable,
            values=_round_all(effect.values),
            effect_s=_round_all(effect.effect),
            low_s=_round_all(effect.low),
            high_s=_round_all(effect.high),
        )
        for effect in main_effects(surrogate, surrogate.data.variables, x)
    ]
    return Effects(
        designs=len(x),
        outside_trained_range=1.0 - float(in_range(surrogate, x).mean()),
        mean_expected_shift_time_s=float(surrogate.predict(x)[0].mean()),
        variables=variables,
    )


def _round_all(values: Iterable[float]) -> list[float]:
    """Round values to six digits."""
    return [float(f"{number:.6g}") for number in values]


def prices(study: Setup, times: Surrogate) -> list[LimitPrice]:
    """Compute the best times with each limit of a study changed, in the order of its checks.

    Limits that are zero have no price.
    """
    checks = _checks(study, study.clutch.dog)
    # A case is the margin that each check needs, and the factor on what tolerances take of it.
    cases: list[tuple[Array, float]] = []
    for place, check in enumerate(checks):
        signs = 1.0 if check.rule.at_most else -1.0
        for margin in (*(signs * (1.0 - factor) for factor in FACTORS), -np.inf):
            needed = np.zeros(len(checks))
            needed[place] = margin
            cases.append((needed, 1.0))
    cases += [(np.zeros(len(checks)), factor) for factor in (*FACTORS, 0.0)]
    best_times, has_losses = _best_times(study, times, cases)
    limits = [
        (check.name, check.rule.key, check.rule.unit, check.limit, check.rule.at_most)
        for check in checks
    ]
    limits.append((TOLERANCES, "[tolerance]", "%", 100.0, True))
    rows = []
    for place, (name, limit_key, unit, limit, at_most) in enumerate(limits):
        less, now, more, without = best_times[4 * place : 4 * place + 4]
        if limit > 0.0 and (has_losses or name != TOLERANCES):
            rows.append(
                LimitPrice(
                    name=name,
                    key=limit_key,
                    unit=unit,
                    limit=limit,
                    at_most=at_most,
                    less_s=less,
                    now_s=now,
                    more_s=more,
                    without_s=without,
                )
            )
    return rows


def prices_table(rows: Sequence[LimitPrice]) -> Table:
    """Tabulate the limits that have a price: those without a source first, the dearest first."""
    lines = []
    for row in rows:
        price = row.change_s
        worth = max(price or 0.0, (row.now_s or 0.0) - (row.without_s or 0.0))
        if price is None or worth >= MIN_PRICE_S:
            rule = RULES.get(row.name)
            is_sourced = rule is None or not rule.assumed
            lines.append((is_sourced, -worth, _price_line(row)))
    lines.sort(key=lambda line: line[:2])
    cells: list[list[str]] = []
    looks: dict[int, str] = {}
    for group, title in ((False, "limits without a source, assumed"), (True, "other limits")):
        members = [line for line_group, _, line in lines if line_group == group]
        if members:
            looks[len(cells)] = "group"
            cells += [[title], *members]
    if not cells:
        cells = [["no limit costs time", *6 * [""]]]
    heads = "limit", "as it is", "a tenth less, ms", "as it is, ms", "a tenth more, ms"
    note = (
        "Least expected shift time, predicted by the surrogate, of all designs within the limits, "
        "with one limit changed. Limits that are not listed cost nothing. Landing, other simulated "
        "limits and the error of the surrogate are left out."
    )
    return Table((*heads, "without it, ms", "price"), cells, looks, note=note)


def _price_line(row: LimitPrice) -> list[str]:
    """Print a limit with its best times, ms, and its price for a step of its unit."""
    step = STEPS.get(row.unit)
    words = ""
    if row.change_s is not None and step is not None:
        price = 1e4 * row.change_s * step / row.limit
        words = f"{price:.2g} ms per {step:g} {row.unit}".strip()
    times = (row.less_s, row.now_s, row.more_s, row.without_s)
    sense = "≤" if row.at_most else "≥"
    return [
        f"{check_name(row.name)} {row.key}",
        f"{sense} {row.limit:.4g} {row.unit}",
        *("no design" if time is None else in_ms(time) for time in times),
        words,
    ]


def _checks(study: Setup, dog: Dog) -> tuple[LimitCheck, ...]:
    """Compute the checks of a dog, or of ``Dogs``, that need no simulation, without sums of checks.

    Checks within tolerances add their effects as the limit of the study does.
    """
    limits = [
        (quantity, limit) for quantity, limit in limits_of(study) if quantity.name not in WITHIN
    ]
    checks = check_dog(study, {}, dog, limits, {}).checks
    kind = _kind(study)
    if kind is None:
        return checks
    replacements = {check.name: check for check in within_tolerances(dog, study.limits, kind)}
    return tuple(replacements.get(check.name, check) for check in checks)


def _kind(study: Setup) -> Kind | None:
    """Select the addition of tolerance effects that the study limits; None without a limit."""
    limits = study.file.search.limits or {}
    return next((kind for name, kind in WITHIN.items() if name in limits), None)


def _margins(study: Setup, designs: Array) -> tuple[Array, Array]:
    """Compute margins of designs and their losses by tolerances, each (n, checks).

    An impossible shape has margins of -inf.
    """
    names = [check.name for check in _checks(study, study.clutch.dog)]
    rows = np.full((len(designs), len(names)), -np.inf)
    losses = np.zeros(rows.shape)
    shape = study.shape_keys
    kind = _kind(study)
    of_shape = np.array([name in shape for name in study.variables])

    def dogs_at(operated: Setup, places: Array) -> tuple[Setup, Dog]:
        if len(places) == 1:  # numbers take half the time of arrays of one
            params = study.params_of(designs[places[0]])
            shape_params = {name: params[name] for name in shape}
            return operated.with_design(shape_params), study.dog_with(params)
        return DesignGroup.of(operated, shape, designs[places][:, of_shape])

    def margins_at(operated: Setup, places: Array) -> Array:
        margins = [check.margin for check in _checks(*dogs_at(operated, places))]
        return np.array([np.broadcast_to(margin, len(places)) for margin in margins]).T

    with np.errstate(all="ignore"):  # of shapes that cannot be
        possible = DesignGroup.of(study, shape, designs[:, of_shape]).possible
        groups: dict[tuple[float, ...], list[int]] = {}  # operated alike, with limits alike
        for place in np.flatnonzero(possible).tolist():
            groups.setdefault(tuple(designs[place, ~of_shape].tolist()), []).append(place)
        for group in groups.values():
            places = np.array(group)
            params = study.params_of(designs[group[0]])
            operated = study.with_design({key: params[key] for key in OPERATED if key in params})
            tolerances = operated.limits.tolerances.without_sizes()
            exact_limits = replace(operated.limits, tolerances=tolerances)
            rows[places] = margins_at(replace(operated, limits=exact_limits), places)
            # A design that breaks two limits is the best under none of the cases.
            places = places[(rows[places] < 0.0).sum(axis=1) <= 1]
            if places.size:
                losses[places] = rows[places] - margins_at(operated, places)
                group_study, dogs = dogs_at(operated, places)
                sums = margin_losses(dogs, group_study.limits) if kind else {}
                for k, name in enumerate(names):
                    losses[places, k] += getattr(sums[name], kind or "") if name in sums else 0.0
    return rows, losses


def _best_times(
    study: Setup, times: Surrogate, cases: list[tuple[Array, float]]
) -> tuple[list[float | None], bool]:
    """Find the least time under each case, s, and whether tolerances reduce any margin.

    Designs that fill the space are refined about the best design of each case.
    """
    bounds = np.array(list(study.variables.values()))
    is_integer = np.array([name == "count" for name in study.variables])
    rng = np.random.default_rng(1)

    def evaluate(shares: Array) -> tuple[Array, ...]:
        designs = bounds[:, 0] + np.clip(shares, 0.0, 1.0) * np.ptp(bounds, axis=1)
        designs = np.where(is_integer, np.rint(designs), designs)
        margins, losses = _margins(study, designs)
        # A design that breaks two limits, or one by far, is the best under none of the cases.
        candidates = (margins < 0.0).sum(axis=1) <= 1
        predicted = np.zeros(0)
        if candidates.any():
            predicted = times.predict(designs[candidates])[0]
        return designs[candidates], predicted, margins[candidates], losses[candidates]

    def best(pool: tuple[Array, ...], case: tuple[Array, float]) -> int | None:
        _, predicted, margins, losses = pool
        needed, factor = case
        passing = np.flatnonzero((margins - factor * losses >= needed).all(axis=1))
        if not passing.size:
            return None
        return int(passing[np.argmin(predicted[passing])])

    pool = evaluate(qmc.Sobol(len(bounds), seed=rng).random_base2(FILLING_EXPONENT))
    for spread in LOCAL_SPREADS:
        best_designs = {best(pool, case) for case in cases}
        elite = sorted(place for place in best_designs if place is not None)
        if not elite:
            break
        shares = (pool[0][elite] - bounds[:, 0]) / np.ptp(bounds, axis=1)
        centres = np.repeat(shares, LOCAL_DESIGNS, 0)
        local_pool = evaluate(centres + rng.normal(0.0, spread, centres.shape))
        pool = tuple(np.concatenate(arrays) for arrays in zip(pool, local_pool, strict=True))
    places = [best(pool, case) for case in cases]
    best_times = [None if place is None else float(pool[1][place]) for place in places]
    return best_times, bool(pool[3].any())
