"""A gap map as flat records, by the names of the contract and in the edge's units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from diagnosis.along import CellPhases, PhaseGap, overall
from diagnosis.gap import CellGap, GapMap, Marginal
from sim.units import RPM

Record = dict[str, Any]


def where_records(found: GapMap, phases: Sequence[CellPhases] = ()) -> list[Record]:
    """Return an entry for each operating point, with its phases where traces have them."""
    known = {one.cell.point: one.phases for one in phases}
    return [
        {**where_record(one), "phases": [phase_record(p) for p in known.get(one.cell.point, ())]}
        for one in found.cells
    ]


def where_record(one: CellGap) -> Record:
    """Return one operating point; what is unknown is None."""
    cell, simulated, errors = one.cell, one.simulated, one.errors
    return {
        "mismatch_rpm": cell.point.mismatch / RPM,
        "force_N": cell.point.profile.force,
        "bench_s": cell.time,
        "simulated_s": simulated.mean_engaged,
        "gap_s": one.gap,
        "z": one.z,
        "standard_error_s": errors.whole,
        "error_bench_s": errors.bench,
        "error_simulation_s": errors.simulation,
        "error_numerics_s": errors.numerics,
        "bench_sd_s": one.bench_sd,
        "simulated_sd_s": simulated.sd,
        "n_bench": cell.n,
        "n_simulated": simulated.n,
        "bench_tried": cell.tried,
        "bench_engaged": cell.engaged,
        "bench_unknown": cell.unknown,
        "simulated_engaged": simulated.engaged,
        "engaged_p": one.engaged_p,
        "times_p": one.times_p,
    }


def phase_record(phase: PhaseGap) -> Record:
    """Return one phase of a shift."""
    return {
        "name": phase.name,
        "bench_s": phase.bench_mean,
        "simulated_s": phase.simulated_mean,
        "gap_s": phase.gap,
        "z": phase.z,
        "standard_error_s": phase.standard_error,
        "n_bench": phase.bench,
        "n_simulated": phase.simulated,
    }


def map_record(found: GapMap, phases: Sequence[CellPhases] = ()) -> Record:
    """Return the whole map: its sums, marginal means, operating points and phases."""
    shares = found.shares
    return {
        "gap": {
            "baseline_rmse_s": _number(found.baseline_rmse),
            "floor_rmse_s": _number(found.floor_rmse),
            "mean_square_z": _number(found.chi_square),
            "share_bench_noise": _number(shares.bench),
            "share_simulation_noise": _number(shares.simulation),
            "share_numerics": _number(shares.numerics),
            "share_systematic": _number(shares.systematic),
        },
        "by_force": [{"force_N": m.value, **_marginal(m)} for m in found.by_force],
        "by_mismatch": [{"mismatch_rpm": m.value / RPM, **_marginal(m)} for m in found.by_mismatch],
        "where": where_records(found, phases),
        "phases": [phase_record(p) for p in overall(phases)],
    }


def _marginal(one: Marginal) -> Record:
    error = one.standard_error
    return {"gap_s": one.gap, "z": one.z, "standard_error_s": error, "cells": one.cells}


def _number(value: float) -> float | None:
    """Return a number that JSON knows; None where there is no gap at all."""
    return value if math.isfinite(value) else None
