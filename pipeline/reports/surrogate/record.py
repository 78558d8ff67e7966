"""The numbers of the page: effects, indices, slices, and how good the surrogate is."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

import numpy as np

from dogshape.pipeline.config.study_file import Setup, require_variables
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.surrogate.operating_choices import choices, middle, operating_inputs
from dogshape.pipeline.reports.surrogate.slices import Base, rounded, slices_record
from dogshape.pipeline.simulate.design import worth_simulating
from dogshape.pipeline.train.filling import filling_designs
from dogshape.sim.versions import versions
from dogshape.surrogate.covariance import Array, Mask
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.main_effects import effects
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import in_range, require_same_physics
from dogshape.surrogate.sobol_indices import SAMPLES, WHOLE, Indices, Input, indices
from dogshape.surrogate.store import Stored
from dogshape.surrogate.time_curves import times_at

Say = Callable[[str], None]

DESIGNS = 150  #: feasible designs that an effect is the mean over
APART = 70_000  #: added to the seed of the surrogate's data, so that none of these is among them
BOX = 0.1  #: half width of the box of the indices, in shares of the search range
POINT = ("mismatch_rpm", "force_N")  #: inputs that make an operating point
CHECKED = 400  #: samples of a box that are checked for feasibility


def explored(study: Setup, stored: Stored, bases: list[Base], say: Say) -> Row:
    """Compute everything that the page draws.

    Times in s, all else in edge units. A surrogate of other physics raises InputError.
    """
    require_variables(study)
    surrogate = stored.surrogate
    require_same_physics(surrogate.data, study.physics)
    say("the surrogate over the study's operating points")
    overs = [(one, Over(surrogate, one.mix)) for one in choices(study)]
    known = learned(study, surrogate, overs[0][1], say)
    say(f"slices through {len(bases)} {'design' if len(bases) == 1 else 'designs'}")
    return {
        "study": study.name,
        **known,
        "slices": slices_record(study, surrogate, overs, bases),
        "validation": stored.validation.as_dict(),
        "comparison": list(stored.comparison),
        "data": _data_record(surrogate),
        "versions": versions(),
    }


def learned(study: Setup, surrogate: Surrogate, over: Over, say: Say) -> Row:
    """Compute effects and indices over the operating points of ``over``, as the page has them."""
    say(f"effects over {DESIGNS} feasible designs")
    effect = _effects_record(study, surrogate, over)
    say("Sobol indices")
    return {"effects": effect, "indices": _indices_record(study, surrogate, over)}


def _effects_record(study: Setup, surrogate: Surrogate, over: Over) -> Row:
    names = surrogate.data.variables
    seed = study.file.surrogate.seed + APART
    designs = islice(filling_designs(study, seed, border=False), DESIGNS)
    x = study.rows(designs)
    return {
        "designs": len(x),
        "outside_trained_range": 1.0 - float(in_range(surrogate, x).mean()),
        "mean_expected_shift_time_s": float(over.predict(x)[0].mean()),
        "variables": [
            {
                "variable": one.variable,
                "values": rounded(one.values),
                "effect_s": rounded(one.effect),
                "low_s": rounded(one.low),
                "high_s": rounded(one.high),
                "span_s": one.span,
                "span_by_chance_s": one.chance,
                "fastest": one.fastest,
                "distinguishable": one.clear,
            }
            for one in effects(over, names, x)
        ],
    }


def _indices_record(study: Setup, surrogate: Surrogate, over: Over) -> list[Row]:
    """Record the indices over designs, and over designs and operating points at once."""
    cut, retry = len(surrogate.data.variables), study.clutch.timeout + study.retraction
    box, seed = _box(study, surrogate.data), study.file.surrogate.seed + 1
    alone = indices(box, lambda z: over.predict(z)[0], SAMPLES, seed)
    found = [_index_record(study, surrogate, "designs", alone)]
    operating = operating_inputs(study)
    if operating:
        fixed = {"mismatch_rpm": study.mismatches[0],
                 "force_N": middle(study.forces)}  # fmt: skip

        def times(z: Array) -> Array:
            given = {one.name: z[:, cut + k] for k, one in enumerate(operating)}
            points = [given.get(name, np.full(len(z), value)) for name, value in fixed.items()]
            return times_at(surrogate, z[:, :cut], np.column_stack(points), retry)

        whole = indices([*box, *operating], times, SAMPLES, seed)
        found.append(_index_record(study, surrogate, "designs and operating points", whole))
    return found


def _box(study: Setup, data: Dataset) -> list[Input]:
    """Return the box about the study's own design, within the simulated designs.

    A design beyond them has its box about the nearest value that was simulated.
    """
    sides = []
    for name, values in zip(data.variables, data.x.T, strict=True):
        known_low, known_high = float(values.min()), float(values.max())
        low, high = study.variables[name]
        centre = min(max(study.prototype[name], known_low), known_high)
        half = BOX * (high - low)
        if name == "count":
            half = max(1.0, round(half))
        ends = max(centre - half, known_low), min(centre + half, known_high)
        sides.append(Input(name, *ends, WHOLE) if name == "count" else Input(name, *ends))
    return sides


def _index_record(study: Setup, surrogate: Surrogate, over: str, found: Indices) -> Row:
    names = surrogate.data.variables
    x = found.values[:, : len(names)]
    checked = x[:: max(1, len(x) // CHECKED)]
    passed = [worth_simulating(study, study.named(row)) for row in checked.tolist()]
    trained = in_range(surrogate, x) & _known(surrogate, found)
    return {
        "over": over,
        "samples": SAMPLES,
        "evaluations": len(x),
        "outside_trained_range": 1.0 - float(trained.mean()),
        "infeasible": 1.0 - float(np.mean(passed)),
        "mean_s": found.mean,
        "sd_s": found.sd,
        "inputs": [
            {
                "variable": one.name, "low": one.low, "high": one.high, "scale": one.scale,
                "first": float(found.first[k]), "first_half_width": float(found.first_half[k]),
                "total": float(found.total[k]), "total_half_width": float(found.total_half[k]),
            }
            for k, one in enumerate(found.inputs)
        ],
    }  # fmt: skip


def _known(surrogate: Surrogate, found: Indices) -> Mask:
    """Mark the samples within the simulated operating points, (n,)."""
    known = np.ones(len(found.values), dtype=bool)
    for one, values in zip(found.inputs, found.values.T, strict=True):
        if one.name in POINT:
            simulated = surrogate.data.column(one.name)
            slack = 0.01 * np.ptp(simulated)
            known &= (values >= simulated.min() - slack) & (values <= simulated.max() + slack)
    return known


def _data_record(surrogate: Surrogate) -> Row:
    data = surrogate.data
    return {
        "form": surrogate.form,
        "designs": len(data.designs),
        "rows": len(data),
        "shifts": data.shifts,
        "hash": data.digest,
        "engine": data.engine,
        "low": dict(zip(data.variables, data.x.min(axis=0).tolist(), strict=True)),
        "high": dict(zip(data.variables, data.x.max(axis=0).tolist(), strict=True)),
    }
