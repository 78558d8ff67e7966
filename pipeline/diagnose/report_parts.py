"""Parts of a report beside the diagnosis: phases along the shift, effect on the design choice."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.sense import forward
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.phase_times import PhaseGap, phase_gaps
from dogshape.diagnosis.terms import NONE, UNKNOWN
from dogshape.pipeline.diagnose.bank_diagnosis import Means
from dogshape.pipeline.diagnose.consequence import Consequence, consequence, shifts_of, studied
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.executor import kept_shifts, work_folder
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import engine

POINTS, ANGLES = 8, 8  #: simulated with traces: operating points at most, and shifts at each
LEAST = 0.01  #: probability from which a cause is simulated with a study's designs


@dataclass(frozen=True)
class Extras:
    """Optional parts of a report; an empty part has no heading.

    Parameters
    ----------
    phases : gaps along the shift, over all operating points.
    consequence : of the cause for the designs of a study.
    provenance : facts on the run by name: command, versions, number of simulations.
    """

    phases: tuple[PhaseGap, ...] = ()
    consequence: Consequence | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)


def extras_of(found: Diagnosis) -> Extras:
    """Compute the parts of the report beside the diagnosis; simulates some traces."""
    return Extras(
        phases=phases_of(found.bench),
        provenance={
            "engine": found.bench.clutch.solver.engine,
            "programs": ", ".join(f"{name} {version}" for name, version in engine().items()),
            "processor time": f"{found.seconds:.3g} s on one of {os.cpu_count()} processors",
            "hash of the data": _digest(found.bench),
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


def phases_of(bench: Bench) -> tuple[PhaseGap, ...]:
    """Return the gap of each phase of the shift where the data set has traces, else none."""
    having = [cell for cell in bench.cells if cell.traces]
    if not having:
        return ()
    some = having[:: -(-len(having) // POINTS)]
    return phase_gaps(replace(bench, cells=tuple(some)), angles=ANGLES)


def price_of(found: Diagnosis, study: str, means: Means, folder: Path) -> Consequence:
    """Compute the consequence of the cause for the best designs of a study.

    The cause is the most probable set of effects, at the means of its parameters. The sense of
    rotation belongs to the stand and is left out. Finished simulations stay in a folder below
    ``folder`` until all are. Raises InputError where no effect is probable.
    """
    cause = next((h for h in found.posterior if forward(h) not in (NONE, UNKNOWN)), None)
    if cause is None or found.posterior[cause] < LEAST:
        raise InputError(
            f"--study is '{study}', but the diagnosis of {found.bench.name} has no effect above "
            f"{LEAST:.0%}; leave --study out"
        )
    given, designs = studied(study)
    fit = found.fits[cause]
    values = {
        name: {p.name: fit.interval(p.name).mean for p in found.effects[name].parameters}
        for name in forward(cause)
    }
    work = work_folder(folder, "so-what", given.config_hash)
    with (
        WorkCounter(means.progress, shifts_of(given, designs)) as progress,
        kept_shifts(work, progress, means.jobs) as executor,
    ):
        return consequence(given, designs, values, found.effects, executor.run)
