"""Findings of a study's surrogate: effects of its variables and prices of its limits.

Both are computed once and stored beside the surrogate. For prices, designs that fill the space,
and more about the best of them under each limit, are checked by closed forms and predicted. Where
an upper bound L becomes f L a design passes with a margin of 1 - f, where a lower one does with
f - 1: so one pool of designs answers for all limits. Landing and other simulated limits are left
out. Where a study bounds the smallest margin within tolerances, margins are taken there.
Tolerances are a limit too: f times as large they take f times as much from each margin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Say
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.designs import Row
from dogshape.pipeline.reports.text import check_name, in_ms
from dogshape.pipeline.simulate.design import WITHIN, check_dog, dogs_of, limits_of
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.train.training import first_designs
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError, StorageError
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.checks import RULES, Check
from dogshape.sim.strength.dog_strength import margin_losses, within_tolerances
from dogshape.sim.strength.manufacture import Kind
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import in_range, require_same_physics
from dogshape.surrogate.sensitivity import main_effects
from dogshape.surrogate.store import load

DESIGNS = 150  #: feasible designs that an effect is the mean over
APART = 70_000  #: added to the seed of the surrogate's data, so that none of these is among them
FACTORS = {"less_s": 0.9, "now_s": 1.0, "more_s": 1.1}  #: on a limit, by the key of the best time
WITHOUT = "without_s"  #: key of the best time without a limit
FILLING = 13  #: power of two of designs that fill the space
ABOUT = 16  #: more designs about each of the best, in each round
NEAR = (0.08, 0.04, 0.02, 0.01, 0.005)  #: shares of the ranges about it, one for each round
CLEAR = 2e-4  #: s for a tenth of a limit from which it has a price
#: Natural step of a limit by its unit, for what a step costs.
STEPS = {"mm": 0.1, "N": 1000.0, "MPa": 100.0, "deg": 1.0, "": 0.01, "s": 0.001, "%": 10.0}
TOLERANCES = "tolerances at their worst"  #: row of all tolerances together, in % of what they are


def learn_effects(folder: StudyFolder, say: Say) -> None:
    """Store effects and prices of the folder's surrogate unless they are there.

    A folder without a surrogate has none; a surrogate that cannot be used is said.
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
    found = {"effects": _effects_record(study, surrogate), "prices": prices(study, surrogate)}
    write_json(folder.effects, {"surrogate": _identity(folder), **found})


def stored_effects(folder: StudyFolder) -> Row | None:
    """Read what the folder's surrogate as it is now was found to say; None without it."""
    try:
        stored = read_json(folder.effects, "run 'dogshape report' again")
        fits = stored["surrogate"] == _identity(folder)
        return {key: stored[key] for key in ("effects", "prices")} if fits else None
    except (StorageError, KeyError):
        return None


def _identity(folder: StudyFolder) -> str:
    return str(read_json(folder.surrogate, "run 'dogshape report' again").get("hash"))


def _effects_record(study: Setup, surrogate: Surrogate) -> Row:
    x = study.rows(first_designs(study, DESIGNS, APART, border=False))
    return {
        "designs": len(x),
        "outside_trained_range": 1.0 - float(in_range(surrogate, x).mean()),
        "mean_expected_shift_time_s": float(surrogate.predict(x)[0].mean()),
        "variables": [
            {"variable": one.variable, **{
                key: [float(f"{number:.6g}") for number in values]
                for key, values in (("values", one.values), ("effect_s", one.effect),
                                    ("low_s", one.low), ("high_s", one.high))
            }}
            for one in main_effects(surrogate, surrogate.data.variables, x)
        ],
    }  # fmt: skip


def prices(study: Setup, times: Surrogate) -> list[Row]:
    """Compute what each limit of a study costs, in the order of its checks.

    Each row has the check's ``name``, ``key``, ``unit``, ``limit`` and ``at_most``, and the best
    times in s with a tenth less of the limit, the limit as it is, a tenth more of it, and
    ``without_s`` it; None where no design passes. Limits that are zero have no price.
    """
    checks = _checks(study, study.clutch.dog)
    limits = [(c.name, c.rule.key, c.rule.unit, c.limit, c.rule.at_most) for c in checks]
    limits.append((TOLERANCES, "[tolerance]", "%", 100.0, True))
    rows = [Row(zip(("name", "key", "unit", "limit", "at_most"), o, strict=True)) for o in limits]
    # A case is the margin that each check needs, and the factor on what tolerances take of it.
    cases: dict[tuple[int, str], tuple[Array, float]] = {}
    for place, row in enumerate(rows):
        for key, factor in (FACTORS | {WITHOUT: 0.0}).items():
            needed = np.zeros(len(checks))
            if row["name"] != TOLERANCES:
                more = 1.0 - factor if row["at_most"] else factor - 1.0
                needed[place] = -np.inf if key == WITHOUT else more
            cases[place, key] = needed, factor if row["name"] == TOLERANCES else 1.0
    best, lose = _best_times(study, times, list(cases.values()))
    for (place, key), time in zip(cases, best, strict=True):
        rows[place][key] = time
    return [row for row in rows if row["limit"] > 0.0 and (lose or row["name"] != TOLERANCES)]


def prices_table(rows: list[Row]) -> Table:
    """Tabulate the limits that have a price: those without a source first, the dearest first."""
    lines = []
    for row in rows:
        less, more, limit = row["less_s"], row["more_s"], row["limit"]
        price = None if less is None or more is None else 0.5 * abs(less - more)
        worth = max(price or 0.0, (row["now_s"] or 0.0) - (row[WITHOUT] or 0.0))
        step, words = STEPS.get(row["unit"]), ""
        if price is not None and step is not None:
            words = f"{1e4 * price * step / limit:.2g} ms per {step:g} {row['unit']}".strip()
        line = [
            f"{check_name(row['name'])} {row['key']}",
            f"{'≤' if row['at_most'] else '≥'} {limit:.4g} {row['unit']}",
            *("no design" if row[key] is None else in_ms(row[key]) for key in (*FACTORS, WITHOUT)),
            words,
        ]
        if price is None or worth >= CLEAR:
            rule = RULES.get(row["name"])
            lines.append((rule is None or not rule.assumed, -worth, line))
    heads = "limit", "as it is", "a tenth less, ms", "as it is, ms", "a tenth more, ms"
    note = (
        "Least expected shift time, predicted by the surrogate, of all designs within the limits, "
        "with one limit changed. Limits that are not listed cost nothing. Landing, other simulated "
        "limits and the error of the surrogate are left out."
    )
    lines.sort(key=lambda one: one[:2])
    cells, looks = list[list[str]](), dict[int, str]()
    for sourced, title in enumerate(("limits without a source, assumed", "other limits")):
        if members := [line for place, _, line in lines if place == sourced]:
            looks[len(cells)] = "group"
            cells += [[title], *members]
    cells = cells or [["no limit costs time", *6 * [""]]]
    return Table((*heads, "without it, ms", "price"), cells, looks, note=note)


def _checks(study: Setup, dog: Dog) -> tuple[Check, ...]:
    """Work out the checks of a dog, or of ``Dogs``, that need no simulation, but for sums of them.

    Those that have the tolerances in them add effects as the study's limit does.
    """
    limits = [(one, limit) for one, limit in limits_of(study) if one.name not in WITHIN]
    checks = check_dog(study, {}, dog, limits, {}).checks
    kind = _kind(study)
    if kind is None:
        return checks
    own = {check.name: check for check in within_tolerances(dog, study.limits, kind)}
    return tuple(own.get(check.name, check) for check in checks)


def _kind(study: Setup) -> Kind | None:
    """Return how the study adds effects of tolerances; None where it bounds none of their sums."""
    return next((WITHIN[name] for name in WITHIN if name in (study.file.search.limits or {})), None)


def _margins(study: Setup, designs: Array) -> tuple[Array, Array]:
    """Compute margins of exact designs, and what tolerances take of them; of no dog none."""
    names = [check.name for check in _checks(study, study.clutch.dog)]
    rows = np.full((len(designs), len(names)), -np.inf)
    losses, shape = np.zeros(rows.shape), study.shape_keys
    kind = _kind(study)
    of_shape = np.array([name in shape for name in study.variables])

    def dogs_at(places: Array) -> Dog:
        if len(places) == 1:  # numbers take half the time of arrays of one
            return study.dog_with(study.params_of(designs[places[0]]))
        return dogs_of(study, shape, designs[places][:, of_shape])

    def stacked(own: Setup, places: Array) -> Array:
        margins = [check.margin for check in _checks(own, dogs_at(places))]
        return np.array([np.broadcast_to(one, len(places)) for one in margins]).T

    with np.errstate(all="ignore"):  # of shapes that cannot be
        possible = dogs_of(study, shape, designs[:, of_shape]).possible
        groups: dict[tuple[float, ...], list[int]] = {}  # operated alike, with limits alike
        for place in np.flatnonzero(np.broadcast_to(possible, len(designs))).tolist():
            groups.setdefault(tuple(designs[place, ~of_shape].tolist()), []).append(place)
        for group in groups.values():
            places, own = np.array(group), study.with_operation(study.params_of(designs[group[0]]))
            bare = replace(own.limits, tolerances=own.limits.tolerances.without_sizes())
            rows[places] = stacked(replace(own, limits=bare), places)
            # What breaks two limits can be the best under none of the cases.
            places = places[(rows[places] < 0.0).sum(axis=1) <= 1]
            if places.size:
                losses[places] = rows[places] - stacked(own, places)
                lost = margin_losses(dogs_at(places), own.limits) if kind else {}
                for k, name in enumerate(names):
                    losses[places, k] += getattr(lost[name], kind or "") if name in lost else 0.0
    return rows, losses


def _best_times(
    study: Setup, times: Surrogate, cases: list[tuple[Array, float]]
) -> tuple[list[float | None], bool]:
    """Find the least time under each case, s, and whether tolerances take anything.

    Fills the space, then looks about the best design under each case.
    """
    bounds = np.array(list(study.variables.values()))
    whole = np.array([name == "count" for name in study.variables])
    rng = np.random.default_rng(1)

    def pooled(shares: Array) -> tuple[Array, ...]:
        designs = bounds[:, 0] + np.clip(shares, 0.0, 1.0) * np.ptp(bounds, axis=1)
        designs = np.where(whole, np.rint(designs), designs)
        margins, losses = _margins(study, designs)
        # What breaks two limits or one by far can be the best under none of the cases.
        near = (margins < 0.0).sum(axis=1) <= 1
        found = times.predict(designs[near])[0] if near.any() else np.zeros(0)
        return designs[near], found, margins[near], losses[near]

    def best(pool: tuple[Array, ...], case: tuple[Array, float]) -> int | None:
        _, found, margins, losses = pool
        fit = np.flatnonzero((margins - case[1] * losses >= case[0]).all(axis=1))
        return int(fit[np.argmin(found[fit])]) if fit.size else None

    pool = pooled(qmc.Sobol(len(bounds), seed=rng).random_base2(FILLING))
    for near in NEAR:
        elite = sorted({place for case in cases if (place := best(pool, case)) is not None})
        if not elite:
            break
        about = np.repeat((pool[0][elite] - bounds[:, 0]) / np.ptp(bounds, axis=1), ABOUT, 0)
        more = pooled(about + rng.normal(0.0, near, about.shape))
        pool = tuple(np.concatenate(both) for both in zip(pool, more, strict=True))
    places = [best(pool, case) for case in cases]
    return [None if k is None else float(pool[1][k]) for k in places], bool(pool[3].any())
