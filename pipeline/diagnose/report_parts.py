"""Parts of a report beside the diagnosis: phases along the shift, the price of the cause."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.sense import forward
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.diagnosis.prediction.levels import Level
from dogshape.diagnosis.report.phase_times import PhaseGap, along, overall
from dogshape.pipeline.diagnose.bank_diagnosis import Means
from dogshape.pipeline.diagnose.consequence import Consequence, consequence, shifts_of, studied
from dogshape.pipeline.diagnose.extras import Extras
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.kept_shifts import kept_shifts, work_folder
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import engine

POINTS, ANGLES = 8, 8  #: simulated with traces: operating points at most, and shifts at each


def extras_of(found: Diagnosis) -> Extras:
    """Compute the parts of the report beside the diagnosis; simulates some traces."""
    return Extras(
        phases=phases_of(found.bench),
        unknown_cells=_unknown(found.bench),
        provenance={
            "engine of the simulations": found.bench.clutch.solver.engine,
            "programs": ", ".join(f"{name} {version}" for name, version in engine().items()),
            "hash of the data": _digest(found.bench),
            "processors": str(os.cpu_count()),
        },
    )


def _digest(bench: Bench) -> str:
    """Return a hash of all readings of a data set."""
    rows = [
        [cell.point.mismatch, cell.point.profile.force, r.n, r.time, r.engaged]
        + [one for one in (r.sd, r.place) if one is not None]
        for cell in bench.cells
        for r in cell.readings
    ]
    return content_key({"name": bench.name, "rows": rows})


def _unknown(bench: Bench) -> str:
    cells = [cell for cell in bench.cells if cell.unknown]
    if not cells:
        return ""
    shifts = sum(cell.unknown for cell in cells)
    return (
        f"Of {shifts} shifts at {len(cells)} operating points the data set does not say whether "
        "they were tried or did not engage. They are left out; the last column of the table of "
        "readings has the answer if all of them were tried and failed."
    )


def phases_of(bench: Bench) -> tuple[PhaseGap, ...]:
    """Return the gap of each phase of the shift where the data set has traces, else none."""
    having = [cell for cell in bench.cells if cell.traces]
    if not having:
        return ()
    some = having[:: -(-len(having) // POINTS)]
    found = along(replace(bench, cells=tuple(some)), angles=ANGLES)
    return overall(found) if found else ()


def price_of(found: Diagnosis, study: str, means: Means, folder: Path) -> Consequence:
    """Compute the consequence of the cause for the best designs of a study.

    The cause is the most probable set of effects, at the mean of its parameters. The sense of
    rotation is the stand's and says nothing of a study. What is finished of the simulations stays
    in a folder below ``folder`` until all are.
    Raises InputError where the diagnosis has no such.
    """
    cause = next((h for h in found.posterior if forward(h) not in (NONE, UNKNOWN)), None)
    if cause is None or found.posterior[cause] < 0.01:
        raise InputError(
            f"--study is '{study}', but the diagnosis of {found.bench.name} names no effect whose "
            "price could be told; leave --study out"
        )
    given, designs = studied(study)
    values = tuple(interval.mean for interval in found.intervals[cause].values())
    work = work_folder(folder, "so-what", given.config_hash)
    with (
        WorkCounter(means.progress, shifts_of(given, designs)) as progress,
        kept_shifts(work, progress, means.jobs) as executor,
    ):
        return consequence(
            given, designs, Level(forward(cause), values), found.effects, executor.run
        )
