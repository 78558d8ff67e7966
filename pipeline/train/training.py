"""The surrogate of a study: simulation of its data, fit, validation and file.

A folder of a search has the rows of the search in ``rows.json``. ``dogshape fit`` fills
``simulated.jsonl`` with a line for each design of four parts. Two thirds of the designs fill the
space; every third one of these breaks a limit by up to ``SLACK``, so that the border has data on
both sides. The others are of the fifth that is expected to be best then. References judge the
surrogate, over the space and of the best tenth. Without them each design is predicted from the
others. Half of the angles of an operating point are even; in a few rounds the others halve the
intervals in which the time most likely jumps (``sim.statistics.bisection``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice, takewhile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import SILENT, Progress, Say, WorkCounter
from dogshape.pipeline.simulate.design import explain_infeasible, mark_worthy
from dogshape.pipeline.simulate.evaluation import Params
from dogshape.pipeline.simulate.executor import Executor, connect
from dogshape.pipeline.store.folder import (
    WRITE_AGAIN,
    ShiftJournal,
    StudyFolder,
    append,
    read_json,
    read_lines,
    write_json,
)
from dogshape.pipeline.train.training_rows import row_record, with_rows
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.files import naming, writing
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.expectation import halves, mean_round_the_pitch
from dogshape.sim.statistics.shift_records import Record, content_key, result_of, unfinished
from dogshape.sim.strength.checks import feasible
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.locking import face_angle
from dogshape.sim.strength.manufacture import manufacturing_checks
from dogshape.sim.versions import engine
from dogshape.surrogate.dataset import COLUMNS, Dataset, row_of
from dogshape.surrogate.model import MIN_DESIGNS, fit
from dogshape.surrogate.process import Effort
from dogshape.surrogate.store import Stored, save, validate

LEAST_ANGLES = 16  #: of an operating point
LEAST_SHIFTS = 128  #: of a design
MOST_DESIGNS = 800  #: more take longer to ask than they are worth
FILLING_SHARE = 2.0 / 3.0  #: share of the designs that fill the space
BEST, BEST_REFERENCES = 5, 10  #: one in so many of a pool is taken
POOL, APART = 60_000, 90_000  #: added to the seed for a pool of designs, and for references
ROUNDS = (3, 3, 2)  #: sixteenths of the angles that halve intervals, round by round
BATCH = 32  #: designs that are simulated before their rows are written

SLACK = 0.15  #: of a limit, by which designs beyond the border break it
BEYOND = 3  #: one design in so many lies beyond the border
DRAWS = 2**16  #: draws without a new design after which there is none


def own_designs(study: Setup) -> list[Params]:
    """List the study's own dog, unless it cannot be made or its face is held by friction."""
    if not feasible(manufacturing_checks(study.clutch.dog, study.limits.manufacturing)):
        return []
    load = study.limits.load
    slides = face_angle(study.clutch.dog) > math.atan(load.friction_release)
    return [study.prototype] if slides or not load.faces_release else []


def first_designs(study: Setup, count: int, apart: int = 0, *, border: bool = True) -> list[Params]:
    """List designs that fill the feasible space and, with ``border``, a band beyond it.

    They are the first ones of the sequence of the study's seed and a number ``apart``.
    """
    seed = study.file.surrogate.seed + apart
    inside, beyond = _sobol_designs(study, seed), _sobol_designs(study, seed + 1, beyond=True)
    turns = islice(cycle([False] * (BEYOND - 1) + [border]), count)
    found = ((next(beyond, {}) if turn else {}) or next(inside, {}) for turn in turns)
    return list(takewhile(bool, found))  # whole numbers alone run out


def _sobol_designs(study: Setup, seed: int, beyond: bool = False) -> Iterator[Params]:
    sequence = qmc.Sobol(len(study.variables), seed=seed)
    seen: set[tuple[float, ...]] = set()
    missed = 0
    while missed < DRAWS:
        designs = [_design(study, unit) for unit in sequence.random(256)]
        fit = (
            (_just_beyond(study, one) for one in designs) if beyond else mark_worthy(study, designs)
        )
        for design, wanted in zip(designs, fit, strict=True):
            missed += 1
            if wanted and tuple(design.values()) not in seen:
                missed = 0
                seen.add(tuple(design.values()))
                yield design
    if not seen and not beyond:
        raise InputError(explain_infeasible(study, DRAWS))


def _design(study: Setup, unit: Array) -> Params:
    return {
        name: int(low + math.floor(share * (high - low + 1.0)))
        if name == "count"
        else round(float(low + share * (high - low)), 3)
        for (name, (low, high)), share in zip(study.variables.items(), unit, strict=True)
    }


def _just_beyond(study: Setup, design: Params) -> bool:
    """Check whether a design breaks a limit, none by more than ``SLACK``, and lets go."""
    try:
        checks = strength_checks(study.dog_with(design), study.limits)
    except GeometryError:
        return False
    releases = [check for check in checks if check.name.endswith("_release")]
    within = all(check.margin >= -SLACK for check in checks)
    return within and feasible(releases) and not feasible(checks)


@dataclass(frozen=True)
class Job:
    """A design with the number of its angles at each point, and the draw of the even ones.

    Each ``index`` of a part has angles of its own: common ones err like a bias.
    """

    design: Params
    angles: int
    seed: int
    index: int

    def rounds(self, study: Setup) -> tuple[int, ...]:
        """Count the angles of each round that halves intervals; none where all are even."""
        if study.uncertainty is not None:
            return ()
        return tuple(self.angles * share // 16 for share in ROUNDS)

    def blocks(self, study: Setup) -> list[Block]:
        """List the even angles of the design at each operating point."""
        clutch = replace(study.clutch, dog=study.dog_with(self.design))
        even, first = self.angles - sum(self.rounds(study)), self.index * len(study.points)
        return [
            even_block(clutch, point, even, (self.seed, place), uncertainty=study.uncertainty)
            for place, point in enumerate(study.points, first)
        ]

    def key(self, study: Setup) -> str:
        """Hash what tells the design's shifts from all others."""
        first = [[block.first_key, len(block.angles)] for block in self.blocks(study)]
        return content_key({"blocks": first, "halved": list(self.rounds(study)), **engine()})


def simulate_designs(
    study: Setup, path: Path, part: str, jobs: Sequence[Job], executor: Executor
) -> None:
    """Simulate the designs of a part that the file lacks; the journal forgets their shifts."""
    known, keys = {line["key"] for line in _lines(path)}, {job.key(study): job for job in jobs}
    left = [key for key in keys if key not in known]
    there = len(study.points) * sum(keys[key].angles for key in keys.keys() & known)
    executor.progress(there, there)
    for batch in (left[start : start + BATCH] for start in range(0, len(left), BATCH)):
        found = _shifts(study, [keys[key] for key in batch], executor)
        for key, shifts in zip(batch, found, strict=True):
            if not any(unfinished(shift) for one in shifts for shift in one):
                rows = np.array([_row(study, keys[key], one) for one in shifts], dtype=float)
                append(path, {"key": key, "part": part, "rows": row_record(rows)})
        executor.forget()


def _lines(path: Path) -> list[Record]:
    return list(read_lines(path, lambda line: line["rows"] and line["part"], "a finished design"))


def simulated_data(study: Setup, path: Path, *parts: str) -> Dataset:
    """Collect the designs of parts that the file has; ``study`` is in their engine."""
    rows = [row for line in _lines(path) if line["part"] in parts for row in line["rows"]]
    return with_rows(study, rows)


def _shifts(study: Setup, jobs: Sequence[Job], executor: Executor) -> list[list[list[Record]]]:
    """Simulate designs at even angles, then where their times jump; by design and point."""
    blocks = [block for job in jobs for block in job.blocks(study)]
    found = executor.run(blocks)
    for count in jobs[0].rounds(study):  # those of a part are alike
        nearer = []
        for block, shifts in zip(blocks, found, strict=True):
            angles = halves(*_phases_and_times(shifts), count) * block.clutch.dog.pitch_angle
            nearer.append(replace(block, angles=tuple(angles.tolist())))
        found = [[*old, *new] for old, new in zip(found, executor.run(nearer), strict=True)]
    size = len(study.points)
    return [found[k : k + size] for k in range(0, len(found), size)]


def _phases_and_times(shifts: Sequence[Record]) -> tuple[Array, Array]:
    """Return the angles of shifts in fractions of a pitch and their times, (n,) each."""
    phases = [shift["relative_angle_deg"] * shift["count"] / 360.0 for shift in shifts]
    times = [result_of(shift).shift_time for shift in shifts]
    return np.array(phases), np.array(times, dtype=float)


def _row(study: Setup, job: Job, shifts: Sequence[Record]) -> list[float] | None:
    """Return the row of a design's shifts at one operating point, even angles first.

    Mean and share engaged are over the pitch: angles are dense where shifts hang.
    """
    x, halved = study.rows([job.design])[0].tolist(), sum(job.rounds(study))
    row = row_of(x, shifts[: len(shifts) - halved])
    if row is None or not halved:
        return row
    phases, times = _phases_and_times(shifts)
    mean, variance = mean_round_the_pitch(phases, times)
    order = np.argsort(phases)
    gaps = np.diff(phases[order], append=phases[order[0]] + 1.0)
    widths = 0.5 * (gaps + np.roll(gaps, 1))
    share = float(widths @ np.isfinite(times[order]))
    sound = sum(result_of(shift).outcome is not Outcome.DIVERGED for shift in shifts)
    new = {"mean_s": mean, "standard_error_s": variance**0.5, "shifts": float(sound)}
    for name, value in {**new, "engaged": round(share * sound, 6)}.items():
        row[len(x) + COLUMNS.index(name)] = value
    return row


def angles_of(study: Setup) -> int:
    """Count the angles at each operating point of a design: a power of two."""
    return max(LEAST_ANGLES, 2 ** math.ceil(math.log2(LEAST_SHIFTS / len(study.points))))


def count_of(study: Setup) -> int:
    """Count the designs that ``mix_shifts`` are enough for; InputError for too few."""
    given, each = study.file.surrogate.mix_shifts, angles_of(study) * len(study.points)
    least = math.ceil(MIN_DESIGNS / FILLING_SHARE)  # the first of them choose the others
    if given // each < least:
        raise InputError(
            f"surrogate.mix_shifts = {given} is enough for {given // each} designs of {each} "
            f"shifts, but the expected time over the study's operating points needs {least} "
            f"at least; give {least * each} or more"
        )
    return min(MOST_DESIGNS, given // each)


def fill(study: Setup, folder: StudyFolder, jobs: int, cluster: str | None, bar: Progress) -> None:
    """Simulate designs and references; go on where stopped.

    InputError for a study that searches its operation, and for too few ``surrogate.mix_shifts``.
    """
    if others := [key for key in study.variables if key not in study.shape_keys]:
        raise InputError(
            f"the study searches {', '.join(others)}, which the surrogate learns from a search "
            "alone; run 'dogshape study', which leaves one, or take them out of [variables]"
        )
    settings, working, path = study.file.surrogate, study.search_setup, folder.simulated
    count, angles, dense = count_of(study), angles_of(study), settings.reference_angles
    shifts = count * angles + (settings.references + settings.best_references) * dense
    kept = f"{folder.root}; the same command goes on"
    connect(cluster)
    with writing(folder.root):
        folder.open(study, resume=True)
        with WorkCounter(bar, shifts * len(study.points), kept=kept) as counter:
            journal = ShiftJournal(folder.running)
            executor = Executor(journal, jobs, counter.advance, cluster)

            def simulate(part: str, designs: Sequence[Params], angles: int, apart: int = 0) -> None:
                seed = settings.seed + apart
                some = [Job(one, angles, seed, index) for index, one in enumerate(designs)]
                simulate_designs(working, path, part, some, executor)

            own = own_designs(working)
            filling = [*own, *first_designs(working, round(FILLING_SHARE * count) - len(own))]
            simulate("filling", filling, angles)
            if not folder.chosen.exists():
                counter.say("choosing among the designs that are expected to be best")
                write_json(folder.chosen, _choose(working, path, filling, count - len(filling)))
            chosen = read_json(folder.chosen, "remove it and run the same command again")
            simulate("best", chosen["designs"], angles, POOL)
            space = first_designs(working, settings.references, APART, border=False)
            simulate("references", space, dense, APART)
            simulate("best_references", chosen["references"], dense, APART + 1)
            journal.say_unfinished(bar.say)
            folder.running.unlink(missing_ok=True)


def _choose(study: Setup, path: Path, known: list[Params], count: int) -> dict[str, Any]:
    """Choose so many designs, and references, of those that are expected to be best."""
    settings, model = study.file.surrogate, fit(simulated_data(study, path, "filling"))

    def best(pool: list[Params], count: int) -> list[Params]:
        if not pool:
            return []
        order = np.argsort(model.predict(study.rows(pool))[0], kind="stable")
        return [pool[place] for place in sorted(order[:count].tolist())]

    pool = first_designs(study, BEST * count, POOL, border=False)
    designs = best([design for design in pool if design not in known], count)
    drawn = settings.references + BEST_REFERENCES * settings.best_references
    others = first_designs(study, drawn, APART, border=False)[settings.references :]
    left = [design for design in others if design not in known and design not in designs]
    return {"designs": designs, "references": best(left, settings.best_references)}


def train(folder: StudyFolder, out: Path | None = None, *, say: Say = SILENT.say) -> Stored:
    """Fit the surrogate to the shifts of a folder, judge it and write it; InputError for few."""
    study, path = folder.stored_study().search_setup, folder.simulated
    if folder.rows.exists():
        data = with_rows(study, read_json(folder.rows, WRITE_AGAIN)["rows"])
    else:
        data = simulated_data(study, path, "filling", "best")
    say(f"fitting the surrogate to {len(data)} designs")
    surrogate = fit(data, Effort(seed=study.file.surrogate.seed))
    parts = ("references", "best_references") if folder.chosen.exists() else ()
    references = [simulated_data(study, path, part) for part in parts]
    stored = Stored(surrogate, validate(surrogate, *references))
    save(out or folder.surrogate, stored)
    with naming(folder.points):
        data.frame().to_csv(folder.points, index=False)
    return stored
